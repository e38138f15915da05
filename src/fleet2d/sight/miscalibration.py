"""Cameras that are calibrated or mounted wrongly."""

from math import radians

from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.configuration.units import AngleDeg, Length
from fleet2d.sight.perception_error import CameraSightings, PerceptionError


@register("perception_error", "miscalibration")
class Miscalibration(PerceptionError):
    """A camera that isn't mounted or calibrated as the robot assumes: the same error in each look.

    Attributes:
        yaw_deg: Angle by which all that it perceives is turned round it, counter-clockwise, with
            the headings of people; rounded to 1/8192 of a turn.
        scale: Factor of all distances.
        offset: What is added to all distances [m].
    """

    yaw_deg: AngleDeg = Field(default=0.0, ge=-180, le=180)
    scale: float = Field(default=1.0, gt=0, le=10)
    offset: Length = Field(default=0.0, ge=-10, le=10)

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        """Turn and stretch all sightings."""
        moved = sightings.moved(turn_deg=self.yaw_deg, scale=self.scale, offset=self.offset)
        return moved.replace(heading=moved.heading + radians(self.yaw_deg))
