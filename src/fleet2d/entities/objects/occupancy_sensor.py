"""Occupancy sensors: whether somebody is on a bed or a seat."""

from datetime import timedelta

import numpy as np
import shapely
from pydantic import Field

from fleet2d.component import register
from fleet2d.entities.objects.sensor import I64, Sensor, SensorView, first_cause
from fleet2d.floorplan.home.home import Home
from fleet2d.units import Duration, micros


@register("object", "occupancy_sensor")
class OccupancySensor(Sensor):
    """On while somebody is on a bed, a sofa or a chair."""

    of: str = Field(description="the object of the floor plan that it is in, by name")
    hold: Duration = Field(
        default=timedelta(seconds=0), description="it goes off when nobody was there for this long"
    )

    def start(self, home: Home, step_us: int) -> None:
        """Check that the object exists."""
        home.object(self.of)

    def place(self, home: Home) -> str:
        """Return the room that the object stands in."""
        return room_of(home, self.of)

    def hold_us(self) -> int:
        """Return how long it stays on [us]."""
        return micros(self.hold)

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return the steps in which the middle of a person is over the object."""
        lattice = home.plan.lattice
        footprint = home.object(self.of).footprint
        x0, y0, x1, y1 = lattice.to_lattice(np.reshape(footprint.bounds, (2, 2))).ravel().tolist()
        x, y = view.x[: view.users, 1:], view.y[: view.users, 1:]
        on_object = view.present[: view.users, 1:] & (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)
        bodies, columns = np.nonzero(on_object)
        if len(columns):
            points = lattice.to_metres(np.stack([x[bodies, columns], y[bodies, columns]], axis=1))
            on_object[bodies, columns] = shapely.intersects_xy(footprint, points)
        return first_cause(on_object, view.first)


def room_of(home: Home, name: str) -> str:
    """Return the name of the room that an object stands in; empty if it is in none."""
    middle = home.object(name).footprint.centroid
    room = home.plan.room_at(middle.x, middle.y)
    return room.name if room else ""
