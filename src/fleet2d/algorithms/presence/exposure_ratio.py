"""Exposure ratio, of all looks or of audits only: sightings by how much a room was watched."""

from datetime import timedelta

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from fleet2d.algorithms.presence.counts import Bins
from fleet2d.algorithms.presence.estimator import F64, Estimator, normalized
from fleet2d.component import register
from fleet2d.problems import problem
from fleet2d.units import PositiveDuration, Share

PRIOR = 1.0  # bins of average sightings that each room is given before it was ever watched


@register("presence_estimator", "exposure_ratio")
class ExposureRatio(Estimator):
    """Sightings of each room by how much it was watched: n_r / e_r, divided by their sum.

    n_r is the number of bins' worth of steps at which the user was perceived in room r; e_r is
    the number of bins' worth of it that were watched, a room half in view counting half (the form
    of the estimator of Horvitz and Thompson). Since n_r / e_r estimates the chance to be in r
    times that of being detected there, away is 1 - sum of n_r / (e_r detection), at least 0; for
    anyone, who can be in several rooms, that is too low.

    Each room is given one bin at the average rate beforehand, which is what a room has that was
    never watched. Without any sighting all rooms are alike.

    Right when watching a room at a time doesn't depend on whether the user is there. Breaks when
    the robot follows, approaches, or stays while it sees somebody: rooms that are left at once
    because nobody is there are watched too little for how rarely the user is there.
    """

    detection: Share = Field(
        default=0.95, description="chance that somebody in view is perceived", gt=0
    )

    def width(self, rooms: int) -> int:
        """Return how many numbers `sums` has: seen and watched of each room, and bins."""
        return 2 * rooms + 1

    def sums(self, bins: Bins) -> F64:
        """Count seen and watched, in bins."""
        seen = bins.seen / bins.bin_steps
        watched = np.broadcast_to(bins.watched[:, None], seen.shape)
        counted = self.counted(bins)[:, None, None]
        return np.concatenate(
            [seen * counted, watched * counted, np.ones((*seen.shape[:2], 1))], axis=-1
        )

    def counted(self, bins: Bins) -> NDArray[np.bool_]:
        """Return which bins count."""
        return np.ones(len(bins.day), bool)

    def shares(self, sums: F64) -> tuple[F64, F64]:
        """Return the ratios, normalized, and what they leave for away."""
        rooms = (sums.shape[-1] - 1) // 2
        seen, watched = sums[..., :rooms], sums[..., rooms:-1]
        all_seen, all_watched = seen.sum(axis=-1), watched.sum(axis=-1)
        some = all_watched > 0
        average = (all_seen / np.where(some, all_watched, 1))[..., None]
        rate = (seen + PRIOR * average) / (watched + PRIOR)
        away = 1 - np.minimum(rate.sum(axis=-1) / self.detection, 1)
        return normalized(rate), np.where(some, away, 0.0)


@register("presence_estimator", "audit_only")
class AuditOnly(ExposureRatio):
    """The exposure ratio of audits only: of bins whose looks were timed by the clock.

    Which bins those are is told by `every` and `length`: the first `length` of each `every` from
    midnight on, in which the robot looks around by schedule, whatever it saw before.

    Right when the looks of audits don't depend on where the user is. Breaks when audits begin
    because the user is lost, and is noisy: most of what was seen isn't used.
    """

    every: PositiveDuration = Field(
        default=timedelta(hours=2), description="from one audit to the next, from midnight on"
    )
    length: PositiveDuration = Field(
        default=timedelta(minutes=15), description="of an audit, from its beginning"
    )

    @model_validator(mode="after")
    def _check_length(self) -> "AuditOnly":
        if self.length > self.every:
            raise problem(
                f"length is {self.length}, but audits come every {self.every}: it can't be longer"
            )
        return self

    def counted(self, bins: Bins) -> NDArray[np.bool_]:
        """Return which bins begin in an audit."""
        every, length = (
            max(1, duration // timedelta(minutes=1)) for duration in (self.every, self.length)
        )
        return bins.minute % every < length
