"""What is done to sensors, and what ends all that lasts: stick, restore."""

from typing import ClassVar

from pydantic import Field

from fleet2d.component import register
from fleet2d.entities.objects.sensor import SensorFault
from fleet2d.errors import ScenarioError
from fleet2d.interventions.intervention import Intervention, Lasting
from fleet2d.interventions.world import World
from fleet2d.problems import did_you_mean


@register("intervention", "stick")
class Stick(Lasting):
    """Let a sensor say what it doesn't sense: for a moment a false alarm, for longer a fault."""

    subject: ClassVar[str] = "sensor"
    sensor: str = Field(description="the sensor")
    says: SensorFault = Field(
        default="silent",
        description="on: it is excited all the time; off: never; silent: it reports nothing",
    )

    def check(self, world: World) -> None:
        """Refuse a sensor that there isn't."""
        if self.sensor not in world.sensors:
            raise ScenarioError(
                f"there is no sensor {self.sensor!r}{did_you_mean(self.sensor, world.sensors)}"
                f" There are: {', '.join(world.sensors) or 'none'}"
            )

    def begin(self, world: World) -> None:
        """Let it say what the latest that is under way wants."""
        says = (
            act.says
            for act in reversed(world.lasting)
            if isinstance(act, Stick) and act.sensor == self.sensor
        )
        world.stick(self.sensor, next(says, None))

    def end(self, world: World) -> None:
        """Let it say what it senses."""
        self.begin(world)


@register("intervention", "restore")
class Restore(Intervention):
    """End all that lasts on a robot's cameras, wheels and behaviors, a sensor, or an algorithm."""

    subject: ClassVar[str] = "name"
    name: str = Field(description="the robot, sensor or algorithm")

    def check(self, world: World) -> None:
        """Refuse what there isn't."""
        known = [*world.users, *world.robots, *world.sensors, *world.algorithms]
        if self.name not in known:
            raise ScenarioError(
                f"there is nothing named {self.name!r} to restore{did_you_mean(self.name, known)}"
                f" There are: {', '.join(known)}"
            )

    def begin(self, world: World) -> None:
        """End it."""
        world.undo(lambda act: isinstance(act, Lasting) and getattr(act, act.subject) == self.name)
