"""Interventions on sensors, and the end of those with a duration: stick, restore."""

from typing import ClassVar

from fleet2d.configuration.components import register
from fleet2d.configuration.problems import suggest
from fleet2d.entities.objects.home_object import SensorFault
from fleet2d.errors import ScenarioError
from fleet2d.interventions.intervention import Intervention, Lasting
from fleet2d.interventions.world import World


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
        if self.sensor not in world.sensors:
            raise ScenarioError(
                f"there is no sensor {self.sensor!r}{suggest(self.sensor, world.sensors)}"
            )

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
