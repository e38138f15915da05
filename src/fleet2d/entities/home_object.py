"""Objects of a home that have a state during a run, and doors."""

from pydantic import Field

from fleet2d.configuration.components import Component, Settings
from fleet2d.configuration.problems import did_you_mean, problem
from fleet2d.configuration.units import PositiveDuration, TimeOfDay
from fleet2d.entities.place import Point
from fleet2d.errors import PlacementError
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms.doorways import Doorway
from fleet2d.runtime.clock import DAY


class HomeObject(Component):
    """An object of the home with a state: a door, a sensor.

    Furniture without a state is part of the floor plan.
    """

    kind = "object"


class Turn(Settings):
    """A change of a door at a time of day, every day.

    Attributes:
        at: The time of day.
        open: Open it, or shut it.
        locked: Lock it, or unlock it.
    """

    at: TimeOfDay
    open: bool | None = None
    locked: bool | None = None

    def model_post_init(self, _: object, /) -> None:
        """Refuse a turn without effect."""
        if self.open is None and self.locked is None:
            raise problem("nothing happens then: give 'open' or 'locked', true or false")


class Door(HomeObject):
    """A door: while it is shut, it blocks sight and ways exactly like a wall.

    People open it as they come to it, unless it is locked; for bodies with `opens_doors: false`,
    such as robots, it is a wall. A door never shuts on a body, but waits until the doorway is free.

    Attributes:
        doorway: Its doorway: by name, by a room that has one only, by 'room-room', or the one
            nearest to a point [x, y] in metres.
        open: Whether it stands open at first.
        locked: Whether it is locked at first, so that nobody can open it by hand.
        closes_after: It shuts this long after somebody opened it or went through; left out: it
            stays as it was left.
        schedule: The times at which it is opened, shut or locked, every day.
    """

    doorway: str | Point = Field(examples=["bathroom_1", "kitchen_1-hallway_1", [4.0, 2.5]])
    open: bool = True
    locked: bool = False
    closes_after: PositiveDuration | None = Field(default=None, examples=["10 s"])
    schedule: tuple[Turn, ...] = ()

    def model_post_init(self, _: object, /) -> None:
        """Refuse a schedule that goes beyond midnight."""
        late = [turn.at for turn in self.schedule if turn.at >= DAY]
        if late:
            raise problem("a door's schedule ends at 23:59:59: write 00:00 for midnight")

    def find(self, plan: FloorPlan) -> Doorway:
        """Return its doorway in a floor plan.

        Raises:
            PlacementError: There is no such doorway, or several; the message lists the doorways.
        """
        if not plan.doorways:
            raise PlacementError(f"{plan.name} has no doorways: give it some, or no doors")
        if not isinstance(self.doorway, str):
            x, y = self.doorway
            plan.check_inside(x, y)
            return min(plan.doorways, key=lambda d: (_squared(d, x, y), d.index))
        matches = doorways_named(plan, self.doorway)
        names = [doorway.name for doorway in plan.doorways]
        if not matches:
            known = [*names, *(room.name for room in plan.rooms)]
            raise PlacementError(
                f"there is no doorway {self.doorway!r}{did_you_mean(self.doorway, known)}"
                f" The doorways are: {', '.join(names)}"
            )
        if len(matches) > 1:
            raise PlacementError(
                f"{self.doorway!r} has {len(matches)} doorways: choose one of"
                f" {', '.join(doorway.name for doorway in matches)}"
            )
        return matches[0]


def doorways_named(plan: FloorPlan, name: str) -> list[Doorway]:
    """Return the doorway of a name, those between 'room-room', or all of a room."""
    exact = [doorway for doorway in plan.doorways if doorway.name == name]
    if exact:
        return exact
    rooms = {room.name: room.index for room in plan.rooms}
    if name in rooms:
        return [doorway for doorway in plan.doorways if rooms[name] in doorway.rooms]
    pairs = [{rooms[a], rooms[b]} for a in rooms for b in rooms if f"{a}-{b}" == name]
    return [doorway for doorway in plan.doorways if set(doorway.rooms) in pairs]


def door_hint(plan: FloorPlan, name: str) -> str:
    """Return advice on adding a door to a doorway of a plan, for messages."""
    names = [doorway.name for doorway in plan.doorways]
    if not names:
        return ""
    matches = doorways_named(plan, name)
    doorway = matches[0].name if matches else names[0]
    return (
        ". A doorway that the picture shows is open until a door hangs in it: objects:"
        f" {{{name}: {{type: door, doorway: {doorway}}}}}; the doorways are: {', '.join(names)}"
    )


def _squared(doorway: Doorway, x: float, y: float) -> float:
    x0, y0 = doorway.start
    x1, y1 = doorway.end
    return float(((x0 + x1) / 2 - x) ** 2 + ((y0 + y1) / 2 - y) ** 2)
