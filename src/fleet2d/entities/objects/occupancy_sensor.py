"""Occupancy sensors: whether somebody is on a bed or a seat."""

import numpy as np
import shapely

from fleet2d.configuration.components import register
from fleet2d.entities.objects.home_object import FurnitureSensor, SensorView, first_cause
from fleet2d.floorplan.home import Home
from fleet2d.kernels import I64


@register("object", "occupancy_sensor")
class OccupancySensor(FurnitureSensor):
    """A sensor that is on while somebody is on a bed, a sofa or a chair."""

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
