"""The base of sensors that are part of a piece of furniture or a device."""

from datetime import timedelta

from fleet2d.entities.objects.sensor import Sensor
from fleet2d.floorplan.home.home import Home
from fleet2d.units import Duration, micros


class FurnitureSensor(Sensor):
    """Base of sensors of an object of the floor plan, in whose room they are.

    Attributes:
        of: The object of the floor plan that it is in, by name.
        hold: It goes off when nobody was there for this long.
    """

    of: str
    hold: Duration = timedelta(seconds=0)

    def start(self, home: Home, step_us: int) -> None:
        """Check that the object exists."""
        home.object(self.of)

    def place(self, home: Home) -> str:
        """Return the room that the object stands in; empty if it is in none."""
        middle = home.object(self.of).footprint.centroid
        room = home.plan.room_at(middle.x, middle.y)
        return room.name if room else ""

    def hold_us(self) -> int:
        """Return how long it stays on [us]."""
        return micros(self.hold)
