"""Interventions on the home: its doors, furniture, rooms and sensors; and on algorithms."""

from typing import Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from fleet2d.algorithms.algorithm import FROZEN, WITHHELD, RoomDistribution
from fleet2d.configuration.components import register
from fleet2d.configuration.problems import problem, suggest
from fleet2d.configuration.units import InputPath
from fleet2d.entities.objects.home_object import SensorFault
from fleet2d.entities.place import Point
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.home_change import HomeChange
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


@register("intervention", "reset")
class Reset(Intervention):
    """Let an algorithm forget what it has learned, or load what another run has learned.

    Its present output remains until its next update.

    Attributes:
        algorithm: The algorithm.
        learned: Learned state to load, a file of the folder learned/ of another run; left out: the
            algorithm starts without any.
    """

    subject: ClassVar[str] = "algorithm"
    algorithm: str
    learned: InputPath | None = None

    def check(self, world: World) -> None:
        """Refuse an unknown algorithm."""
        check_algorithm(world, self.algorithm)

    def begin(self, world: World) -> None:
        """Restart the algorithm."""
        world.reset(self.algorithm, self.learned)


@register("intervention", "replace")
class Replace(Lasting):
    """Let behaviors and other algorithms read another output of an algorithm for a while.

    The algorithm itself continues, and its tables and metrics show its real output.

    Attributes:
        algorithm: The algorithm.
        rooms: Weights of rooms; 0 for those left out.
        values: Numbers and texts by name, for an output that is a mapping.
        frozen: Whether its output at that step remains.
        withheld: Whether there is no output, as before the first one.
    """

    subject: ClassVar[str] = "algorithm"
    algorithm: str
    rooms: dict[str, float] = Field(default={}, min_length=0)
    values: dict[str, float | str] = Field(default={})
    frozen: bool = False
    withheld: bool = False

    @model_validator(mode="after")
    def _is_one_output(self) -> Self:
        if sum(map(bool, (self.rooms, self.values, self.frozen, self.withheld))) != 1:
            raise problem(
                "give exactly one of 'rooms', 'values', 'frozen: true' and 'withheld: true'"
            )
        for room, weight in self.rooms.items():
            if weight < 0:
                raise problem(f"rooms.{room}: weight {weight:g} is negative")
        return self

    def check(self, world: World) -> None:
        """Refuse an unknown algorithm or room."""
        check_algorithm(world, self.algorithm)
        names = [room.name for room in world.home.rooms]
        for room in self.rooms:
            if room not in names:
                raise ScenarioError(f"there is no room {room!r}{suggest(room, names)}")

    def begin(self, world: World) -> None:
        """Replace the output."""
        world.replace(self.algorithm, self._output(world))

    def end(self, world: World) -> None:
        """Return to the latest intervention that is still active, else to the real output."""
        active = (
            act
            for act in reversed(world.lasting)
            if isinstance(act, Replace) and act.algorithm == self.algorithm
        )
        latest = next(active, None)
        world.replace(self.algorithm, None if latest is None else latest._output(world))

    def _output(self, world: World) -> Any:
        if self.rooms:
            return RoomDistribution([self.rooms.get(room.name, 0.0) for room in world.home.rooms])
        return dict(self.values) or (FROZEN if self.frozen else WITHHELD)


def check_algorithm(world: World, name: str) -> None:
    """Refuse an unknown algorithm.

    Raises:
        ScenarioError: There is no such algorithm; the message lists those that there are.
    """
    if name not in world.algorithms:
        raise ScenarioError(f"there is no algorithm {name!r}{suggest(name, world.algorithms)}")
