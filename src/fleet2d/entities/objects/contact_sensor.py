"""Contact sensors: whether a door is open."""

from typing import ClassVar

import numpy as np

from fleet2d.configuration.components import register
from fleet2d.entities.objects.home_object import Sensor, SensorView
from fleet2d.floorplan.home import Home
from fleet2d.kernels import I64


@register("object", "contact_sensor")
class ContactSensor(Sensor):
    """A sensor that reports OPEN when a door opens, and CLOSE when it shuts.

    Attributes:
        of: The name of the door, one of the scenario's objects.
    """

    of: str

    words: ClassVar[tuple[str, str]] = ("OPEN", "CLOSE")

    def watch(self, door: int) -> None:
        """Set the door that it watches, by its number in the home."""
        self.door = door

    def place(self, home: Home) -> str:
        """Return the first room of the doorway."""
        return home.rooms[home.doors[self.door].rooms[0]].name

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return all steps of the span if the door is open: doors move between spans only."""
        shut = self.door in home.shut
        steps = np.arange(0 if shut else view.steps, dtype=np.int64) + view.first
        return steps, np.full(len(steps), -1, np.int64)
