"""Sightings at the wrong distance, as when the depth is that of the background."""

from datetime import timedelta

import numpy as np
from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.configuration.units import Duration, Length, Share, micros
from fleet2d.sight.perception_error import CameraSightings, PerceptionError


@register("perception_error", "outliers")
class Outliers(PerceptionError):
    """A share of sightings is far off along the ray, as when the depth is that of the background.

    Attributes:
        share: Share of sightings that are outliers.
        spread: Standard deviation of their error in distance, bell-shaped and independent in each
            look [m].
        lasts: How long a person stays an outlier, rounded to steps, in intervals from the start of
            the run; 0: each look by itself.
    """

    share: Share = 0.02
    spread: Length = Field(default=1.0, gt=0, le=100)
    lasts: Duration = timedelta(0)

    def distort(self, sightings: CameraSightings) -> CameraSightings:
        """Move the outliers along their rays."""
        steps = max(1, round(micros(self.lasts) / 1e6 / sightings.step_s))
        is_far_off = sightings.uniform("which", at=sightings.step // steps) < self.share
        error = np.where(is_far_off, self.spread * sightings.bell("how far"), 0.0)
        return sightings.moved(offset=error)
