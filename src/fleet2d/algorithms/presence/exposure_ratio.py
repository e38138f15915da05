"""Exposure ratio, of all looks or of audits only: sightings by how much a room was watched."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from fleet2d.algorithms.presence.counts import Bins
from fleet2d.algorithms.presence.estimator import F64, Estimator, normalized
from fleet2d.component import register
from fleet2d.errors import ComponentError
from fleet2d.problems import problem
from fleet2d.units import PositiveDuration, Share

PRIOR = 1.0  # bins of average sightings that each room is given before it was ever watched


@register("presence_estimator", "exposure_ratio")
class ExposureRatio(Estimator):
    """Sightings of each room by how much it was watched, patch by patch: sum of n_p / e_p.

    n_p is the number of bins' worth of steps at which the user was perceived in patch p of the
    room (`fleet2d.algorithms.patches`); e_p is the number of bins' worth of it that were watched, a
    patch half in view counting half (the form of the estimator of Horvitz and Thompson). Shares
    are these sums, divided by that of all rooms. By patches, because people have their places in a
    room: what a robot sees of it may be where nobody ever is, or the only seat.

    Since n_p / e_p estimates the chance to be in p times that of being detected there, away is
    1 - sum of n_p / (e_p detection), at least 0; for anyone, who can be in several rooms, that is
    too low. Each patch is given one bin at the average rate beforehand, which is what a patch has
    that was never watched. Without any sighting all patches are alike.

    Right when watching a patch at a time doesn't depend on whether the user is there. Breaks when
    the robot follows, approaches, or stays while it sees somebody: rooms that are left at once
    because nobody is there are watched too little for how rarely the user is there.
    """

    detection: Share = Field(
        default=0.95, description="chance that somebody in view is perceived", gt=0
    )

    def begin(self, rooms: int, users: int, half_life: float | None = None) -> None:
        """Prepare for a run."""
        self.room = np.arange(rooms)  # of each patch, until evidence says otherwise
        self.half_life, self.recalled = half_life, False
        super().begin(rooms, users, half_life)

    def width(self, rooms: int) -> int:
        """Return how many numbers `sums` has: seen and watched of each patch, and bins."""
        return 2 * len(self.room) + 1

    def observe(self, bins: Bins) -> None:
        """Take in evidence that follows on that before; the first says what patches there are."""
        room = bins.parts.room
        if not np.array_equal(room, self.room):
            if self.recalled:
                raise _foreign(len(self.room), int(self.room.max()) + 1)
            self._divide(room)
        super().observe(bins)

    def _divide(self, room: NDArray[np.int64]) -> None:
        """Begin with the rooms divided into patches."""
        self.room = room
        super().begin(self.rooms, self.users, self.half_life)

    def remember(self) -> dict[str, Any]:
        """Return all that was learned, as arrays in mappings."""
        return {**super().remember(), "room": self.room}

    def recall(self, learned: Mapping[str, Any], today: int) -> None:
        """Go on from what `remember` returned; called after `begin`."""
        room = np.asarray(learned.get("room", self.room))
        if room.max(initial=-1) + 1 != self.rooms:
            raise _foreign(len(room), int(room.max(initial=-1)) + 1)
        self._divide(room)
        super().recall(learned, today)
        self.recalled = True

    def sums(self, bins: Bins) -> F64:
        """Count seen and watched, in bins."""
        return counted(bins.parts.seen, bins.parts.watched, self.counted(bins), bins.bin_steps)

    def counted(self, bins: Bins) -> NDArray[np.bool_]:
        """Return which bins count."""
        return np.ones(len(bins.day), bool)

    def shares(self, sums: F64) -> tuple[F64, F64]:
        """Return the sums of ratios, normalized, and what they leave for away."""
        rate, away = ratios(sums, self.detection)
        first = np.flatnonzero(np.diff(self.room, prepend=-1))
        return normalized(np.add.reduceat(rate, first, axis=-1)), away


def _foreign(patches: int, rooms: int) -> ComponentError:
    return ComponentError(
        f"what was learned is of {patches} patches of {rooms} rooms, which aren't those here: it is"
        " from another home"
    )


def ratios(sums: F64, detection: float) -> tuple[F64, F64]:
    """Return the ratio of seen to watched of each place, and what they leave for away.

    Args:
        sums: float64 (..., 2 places + 1), of what `counted` returns.
        detection: Chance that somebody in view is perceived.
    """
    places = (sums.shape[-1] - 1) // 2
    seen, watched = sums[..., :places], sums[..., places:-1]
    all_seen, all_watched = seen.sum(axis=-1), watched.sum(axis=-1)
    some = all_watched > 0
    average = (all_seen / np.where(some, all_watched, 1))[..., None]
    rate = (seen + PRIOR * average) / (watched + PRIOR)
    away = 1 - np.minimum(rate.sum(axis=-1) / detection, 1)
    return rate, np.where(some, away, 0.0)


def counted(
    seen: NDArray[np.int64], watched: F64, counts: NDArray[np.bool_], bin_steps: int
) -> F64:
    """Return seen and watched of each place in bins, and 1: float64 (bins, users + 1, numbers).

    Args:
        seen: int64 (bins, users + 1, places), steps.
        watched: float64 (bins, places), shares.
        counts: bool (bins,), which bins count.
        bin_steps: Steps of a bin.
    """
    here = counts[:, None, None]
    exposure = np.broadcast_to(watched[:, None], seen.shape)
    ones = np.ones((*seen.shape[:2], 1))
    return np.concatenate([seen / bin_steps * here, exposure * here, ones], axis=-1)


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
