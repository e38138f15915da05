"""Interventions on the home: its doors, furniture, rooms and sensors; and the end of others."""

from typing import ClassVar, Literal

from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.configuration.problems import suggest
from fleet2d.entities.home_object import SensorFault
from fleet2d.entities.place import Point
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.home import HomeChange
from fleet2d.floorplan.slow_area import SlowArea
from fleet2d.interventions.intervention import Intervention, Lasting, World


class HomeIntervention(Intervention):
    """Base of interventions that change the home."""

    @property
    def home_change(self) -> HomeChange:
        """The change."""
        raise NotImplementedError

    def check(self, world: World) -> None:
        """Refuse a change of something unknown."""
        world.check_change(self.home_change)

    def begin(self, world: World) -> None:
        """Change the home at the present step."""
        world.change(self.home_change)


@register("intervention", "change")
class Change(HomeIntervention):
    """Change the home like an entry of `changes`.

    Attributes:
        change: The change, as in `changes` of a scenario.
    """

    subject: ClassVar[str] = "change"
    change: HomeChange

    @property
    def home_change(self) -> HomeChange:
        """The change."""
        return self.change


class DoorIntervention(HomeIntervention):
    """Base of interventions on a door.

    Attributes:
        door: The door.
    """

    subject: ClassVar[str] = "door"
    door: str

    @property
    def home_change(self) -> HomeChange:
        """The change."""
        return HomeChange.model_validate({self.type_name: self.door})


@register("intervention", "open")
class Open(DoorIntervention):
    """Open a door, even a locked one."""


@register("intervention", "shut")
class Shut(DoorIntervention):
    """Shut a door, as soon as nobody stands in the doorway."""


@register("intervention", "lock")
class Lock(DoorIntervention):
    """Lock a door: nobody opens it by hand once it is shut."""


@register("intervention", "unlock")
class Unlock(DoorIntervention):
    """Unlock a door."""


@register("intervention", "move")
class Move(HomeIntervention):
    """Move a piece of furniture.

    Attributes:
        object: The piece of furniture.
        to: Where its centre is then, [x, y] in metres.
        turn_deg: How far it is turned, counter-clockwise.
    """

    subject: ClassVar[str] = "object"
    object: str
    to: Point
    turn_deg: float = Field(default=0.0, ge=-3600, le=3600)

    @property
    def home_change(self) -> HomeChange:
        """The change."""
        return HomeChange(move=self.object, to=self.to, turn_deg=self.turn_deg)


@register("intervention", "room")
class SetRoomType(HomeIntervention):
    """Change the type of a room: behaviors that go to a bedroom go there from then on.

    Attributes:
        name: The room.
        type: Its new type.
    """

    subject: ClassVar[str] = "name"
    name: str
    type: str

    @property
    def home_change(self) -> HomeChange:
        """The change."""
        return HomeChange(room=self.name, type=self.type)


@register("intervention", "lights")
class Lights(HomeIntervention):
    """Switch the light of a room on or off.

    Attributes:
        room: The room, a kind of rooms, or `all`.
        turn: How it is switched.
    """

    subject: ClassVar[str] = "room"
    room: str
    turn: Literal["on", "off"]

    @property
    def home_change(self) -> HomeChange:
        """The change."""
        return HomeChange(lights=self.room, turn=self.turn)


@register("intervention", "slow")
class Slow(SlowArea, Lasting):
    """Let a wet floor or a carpet slow robots down, or its edge stop them; they don't know of it.

    Attributes:
        area: Its corners [m].
        speed: Their speed in it, as a share of the usual one; turning on the spot is as ever.
        stop: How long they stop when they enter it.
    """

    subject: ClassVar[str] = "area"

    def begin(self, world: World) -> None:
        """Apply all that are active."""
        world.slow([act for act in world.lasting if isinstance(act, Slow)])

    def end(self, world: World) -> None:
        """Apply the others."""
        self.begin(world)


@register("intervention", "report")
class Report(Intervention):
    """Let a real sensor report its state: one of the type `live_sensor`.

    Attributes:
        sensor: The sensor.
        says: Whether it is on or off from now on.
    """

    subject: ClassVar[str] = "sensor"
    sensor: str
    says: Literal["on", "off"]

    def check(self, world: World) -> None:
        """Refuse an unknown sensor, and one that is simulated."""
        check_sensor(world, self.sensor)
        if self.sensor not in world.live_sensors:
            raise ScenarioError(
                f"{self.sensor} is simulated: only a sensor of the type live_sensor reports what"
                " arrives"
            )

    def begin(self, world: World) -> None:
        """Set its state."""
        world.stick(self.sensor, self.says)


def check_sensor(world: World, sensor: str) -> None:
    """Refuse an unknown sensor.

    Raises:
        ScenarioError: There is none of that name.
    """
    if sensor not in world.sensors:
        raise ScenarioError(f"there is no sensor {sensor!r}{suggest(sensor, world.sensors)}")


@register("intervention", "stick")
class Stick(Lasting):
    """Let a sensor report a fixed state: a false alarm if it is short, a fault if it is long.

    Attributes:
        sensor: The sensor.
        says: The state: on, always triggered; off, never triggered; silent, it reports nothing.
    """

    subject: ClassVar[str] = "sensor"
    sensor: str
    says: SensorFault = "silent"

    def check(self, world: World) -> None:
        """Refuse an unknown sensor."""
        check_sensor(world, self.sensor)

    def begin(self, world: World) -> None:
        """Apply the latest active intervention on the sensor."""
        says = (
            act.says
            for act in reversed(world.lasting)
            if isinstance(act, Stick) and act.sensor == self.sensor
        )
        world.stick(self.sensor, next(says, None))

    def end(self, world: World) -> None:
        """Return to the intervention before, if that is still active, else to its readings."""
        self.begin(world)


@register("intervention", "restore")
class Restore(Intervention):
    """End all active interventions on a robot, a sensor or an algorithm that have a duration.

    Attributes:
        name: The robot, sensor or algorithm.
    """

    subject: ClassVar[str] = "name"
    name: str

    def check(self, world: World) -> None:
        """Refuse an unknown name."""
        names = [*world.users, *world.robots, *world.sensors, *world.algorithms]
        if self.name not in names:
            raise ScenarioError(
                f"there is nothing named {self.name!r} to restore{suggest(self.name, names)}"
            )

    def begin(self, world: World) -> None:
        """End them."""
        world.undo(lambda act: isinstance(act, Lasting) and getattr(act, act.subject) == self.name)
