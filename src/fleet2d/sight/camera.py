"""The camera of a robot: what it could see (its field of view), and how surely it notices."""

import math
from datetime import timedelta
from typing import Self

from pydantic import Field, model_validator

from fleet2d.component import Settings
from fleet2d.kernels.headings import TURN
from fleet2d.kernels.look import Lens
from fleet2d.units import AngleDeg, Duration, Length, Share, micros, problem

# Squares of distances in lattice units stay far inside 64 bits.
FARTHEST_M = 10_000


class Camera(Settings):
    """A camera at the centre of the body that looks where the body heads.

    A user is in view when the user's centre is between the two ranges, within the angle, and no
    wall touches the line between the centres: exactly when it lies in the visibility region of the
    robot's position. Ranges are rounded to the lattice, the half angle to 1/8192 of a turn (0.044
    degrees).
    """

    range: tuple[Length, Length] = Field(
        default=(0.0, 4.5),
        description="nearest and farthest distance it sees at [m]",
        examples=[[0.3, 4.5]],
    )
    angle_deg: AngleDeg = Field(
        default=108.0,
        gt=0,
        le=360,
        description="width of the field of view, centred on the heading",
    )
    detection: Share = Field(
        default=1.0, description="probability that a user in view is noticed, in each step"
    )
    lost_after: Duration = Field(
        default=timedelta(seconds=5),
        description="a user not noticed for this long counts as lost (event user_lost)",
    )

    @model_validator(mode="after")
    def _range_is_ordered(self) -> Self:
        near, far = self.range
        if not 0 <= near < far:
            raise problem(
                f"range is [{near:g}, {far:g}]: the nearest distance must be below the farthest"
            )
        if far > FARTHEST_M:
            raise problem(f"range ends at {far:g} m: {FARTHEST_M:g} m is beyond any home")
        return self

    def lens(self, units_per_m: float, step_us: int) -> Lens:
        """Return the camera in the integers of the sight kernel."""
        near, far = (round(distance * units_per_m) for distance in self.range)
        return Lens(
            near_squared=near * near,
            far_squared=far * far,
            # At 0, both borders are one line, and what lies right behind is on it, too.
            half_angle=max(1, round(self.angle_deg / 360 * TURN)),
            chance=round(self.detection * 2**53),
            patience=math.ceil(micros(self.lost_after) / step_us),
        )
