"""Interventions on the home, its doors, furniture, rooms and sensors, and one that ends others."""

from typing import Literal

from pydantic import Field

from fleet2d.configuration.problems import check_known, suggest
from fleet2d.entities.place import Point
from fleet2d.entities.sensor import SensorFault
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.home import HomeChange
from fleet2d.floorplan.slow_area import SlowArea
from fleet2d.interventions.intervention import Intervention, Lasting, World


class HomeIntervention(Intervention):
    """Base of interventions that change the home."""

    @property
    def home_change(self) -> HomeChange:
        """The change, whose keys are those of the intervention."""
        fields = dict(self)
        return HomeChange.model_validate({self.type_name: fields.pop(self.subject), **fields})

    def check(self, world: World) -> None:
        """Refuse a change of something unknown."""
        world.check_change(self.home_change)

    def begin(self, world: World) -> None:
        """Change the home at the present step."""
        world.change(self.home_change)


class DoorIntervention(HomeIntervention):
    """Base of interventions on a door.

    Attributes:
        door: The door.
    """

    subject = "door"
    door: str


class OpenDoor(DoorIntervention):
    """Open a door, even a locked one.

    Example:
        >>> OpenDoor("front").door
        'front'
    """


class ShutDoor(DoorIntervention):
    """Shut a door, as soon as nobody stands in the doorway.

    Example:
        >>> ShutDoor("front").door
        'front'
    """


class LockDoor(DoorIntervention):
    """Lock a door: nobody opens it by hand once it is shut.

    Example:
        >>> LockDoor("front").door
        'front'
    """


class UnlockDoor(DoorIntervention):
    """Unlock a door.

    Example:
        >>> UnlockDoor("front").door
        'front'
    """


class MoveFurniture(HomeIntervention):
    """Move a piece of furniture.

    Attributes:
        object: The piece of furniture.
        to: The new position of its centre, [x, y] in metres.
        turn_deg: Angle by which it is turned, counter-clockwise.

    Example:
        >>> MoveFurniture("sofa_1", (2, 1), turn_deg=90).to
        (2.0, 1.0)
    """

    subject = "object"
    object: str
    to: Point
    turn_deg: float = Field(default=0.0, ge=-3600, le=3600)


class SetRoomType(HomeIntervention):
    """Change the type of a room: behaviors that go to a bedroom go there from then on.

    Attributes:
        name: The room.
        type: Its new type.

    Example:
        >>> SetRoomType("office_1", "bedroom").type
        'bedroom'
    """

    subject = "name"
    name: str
    type: str


class SwitchLights(HomeIntervention):
    """Switch the light of a room on or off.

    Attributes:
        room: The room, a kind of rooms, or `all`.
        turn: The new state of the light.

    Example:
        >>> SwitchLights("kitchen", "off").turn
        'off'
    """

    subject = "room"
    room: str
    turn: Literal["on", "off"]


class SlowFloor(SlowArea, Lasting):
    """Let a wet floor or a carpet slow robots down, or its edge stop them, unknown to them.

    Attributes:
        area: The corners of the area [m].
        speed: Speed of robots in the area, as a share of the usual one; turning on the spot is as
            ever.
        stop: Time for which robots stop when they enter it.

    Example:
        >>> SlowFloor([(2, 2), (4, 2), (4, 3)], speed="20 %").speed
        0.2
    """

    subject = "area"

    def check(self, world: World) -> None:
        """Refuse an area where the home has no floor."""
        world.home.plan.check_area(self.area)

    def begin(self, world: World) -> None:
        """Apply all that are active."""
        world.slow([act for act in world.lasting if isinstance(act, SlowFloor)])


class SensorIntervention(Intervention):
    """Base of interventions on a sensor.

    Attributes:
        sensor: The sensor.
    """

    subject = "sensor"
    sensor: str

    def check(self, world: World) -> None:
        """Refuse an unknown sensor."""
        check_known(self.sensor, "sensor", world.sensors)


class ReportState(SensorIntervention):
    """Let a real sensor report its state: one of the type `live_sensor`.

    Attributes:
        sensor: The sensor.
        says: The state of the sensor from now on.

    Example:
        >>> ReportState("front_door", "on").says
        'on'
    """

    says: Literal["on", "off"]

    def check(self, world: World) -> None:
        """Refuse an unknown sensor, and one that is simulated."""
        super().check(world)
        if world.sensors[self.sensor].type_name != "live_sensor":
            raise ScenarioError(
                f"{self.sensor} is simulated: only a sensor of the type live_sensor reports what"
                " arrives"
            )

    def begin(self, world: World) -> None:
        """Set the state of the sensor."""
        world.stick(self.sensor, self.says)


class StickSensor(SensorIntervention, Lasting):
    """Let a sensor report a fixed state: a false alarm if it is short, a fault if it is long.

    Attributes:
        sensor: The sensor.
        says: The state: on, always triggered; off, never triggered; silent, it reports nothing.

    Example:
        >>> StickSensor("bath_contact", says="off").says
        'off'
    """

    says: SensorFault = "silent"

    def begin(self, world: World) -> None:
        """Apply the latest active intervention on the sensor."""
        active = self.active(world)
        world.stick(self.sensor, active[-1].says if active else None)


class Restore(Intervention):
    """End all active interventions on a robot, a sensor or an algorithm that have a duration.

    Attributes:
        name: The robot, sensor or algorithm.

    Example:
        >>> Restore("astro").name
        'astro'
    """

    subject = "name"
    name: str

    def check(self, world: World) -> None:
        """Refuse an unknown name."""
        names = [*world.users, *world.robots, *world.sensors, *world.algorithms]
        if self.name not in names:
            raise ScenarioError(
                f"there is nothing named {self.name!r} to restore{suggest(self.name, names)}"
            )

    def begin(self, world: World) -> None:
        """End these interventions."""
        world.undo(lambda act: isinstance(act, Lasting) and getattr(act, act.subject) == self.name)
