"""Smart plugs: whether a device is in use."""

from datetime import timedelta

import numpy as np
from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.configuration.units import Duration, Length
from fleet2d.entities.objects.home_object import FurnitureSensor, SensorView, first_cause
from fleet2d.errors import PlacementError
from fleet2d.floorplan.home import Home
from fleet2d.kernels import I64


@register("object", "smart_plug")
class SmartPlug(FurnitureSensor):
    """A plug that is on while a person stays where its device is used: a stove, a desk, a TV.

    Passing by doesn't switch it on: the person has to stay on the spot for two steps.

    Attributes:
        of: The object of the floor plan that it feeds, by name.
        reach: How near to such a place counts as using the device.
        hold: It turns off when nobody has used it for this long.
    """

    of: str
    reach: Length = Field(default=0.3, ge=0)
    hold: Duration = timedelta(minutes=1)

    def start(self, home: Home, step_us: int) -> None:
        """Check that the object exists, and can be used."""
        if not home.object(self.of).uses:
            raise PlacementError(
                f"{self.of} has no place to use it from: a plug can't tell its use"
            )

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return the steps in which a person stays at one of the object's places."""
        lattice = home.plan.lattice
        x, y = view.x[: view.users], view.y[: view.users]
        still = (np.diff(x) == 0) & (np.diff(y) == 0)
        at_device = np.zeros(still.shape, np.bool_)
        reach = round(self.reach * lattice.units_per_m)
        for use in home.object(self.of).uses:
            at_x, at_y = lattice.point_at((use.x, use.y))
            at_device |= (x[:, 1:] - at_x) ** 2 + (y[:, 1:] - at_y) ** 2 <= reach * reach
        return first_cause(at_device & still & view.present[: view.users, 1:], view.first)
