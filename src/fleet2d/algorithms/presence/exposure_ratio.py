"""Exposure ratio, of all looks or of audits only: sightings divided by time watched."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from fleet2d.algorithms.evidence import Evidence
from fleet2d.algorithms.presence.estimator import Estimator, normalized
from fleet2d.configuration.components import register
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import PositiveDuration, Share
from fleet2d.errors import ComponentError
from fleet2d.kernels import F64, I64, Bool

PRIOR = 1.0  # bins of average sightings that are added to each place


@register("presence_estimator", "exposure_ratio")
class ExposureRatio(Estimator):
    """Sightings in each room divided by the time watched, patch by patch: sum of n_p / e_p.

    n_p is the time at which the user was perceived in patch p of the room
    (`fleet2d.algorithms.evidence`), e_p the time for which the patch was watched, both in bins; a
    patch half in view counts half (the form of the estimator of Horvitz and Thompson). Shares are
    these sums, divided by that of all rooms. It goes by patches because people use few places of a
    room: the part that a robot watches may be one where nobody ever is, or the only seat.

    n_p / e_p estimates the probability of being in p times that of being detected there, so away is
    1 - sum of n_p / (e_p detection), at least 0; for anyone, who can be in several rooms, that is
    too low. One bin at the average rate is added to each patch, which is all that a patch has that
    was never watched. Without any sighting all patches are equal.

    It is right when the times at which a patch is watched don't depend on whether the user is
    there. It fails when the robot follows, approaches, or stays while it sees somebody: rooms that
    the robot leaves at once because nobody is there are watched too little.

    Attributes:
        detection: Chance that somebody in view is perceived.
    """

    detection: Share = Field(default=0.95, gt=0)

    def begin(self, rooms: int, users: int, half_life: float | None = None) -> None:
        """Prepare for a run."""
        self.room = np.arange(rooms)  # the room of each patch; until the first evidence, one each
        self.half_life, self.is_recalled = half_life, False
        super().begin(rooms, users, half_life)

    def width(self, rooms: int) -> int:
        """Return the number of columns of `sums`: seen and watched of each patch, and bins."""
        return 2 * len(self.room) + 1

    def observe(self, evidence: Evidence) -> None:
        """Add the next bins of evidence; the first ones define the patches."""
        room = evidence.by_patch.room
        if not np.array_equal(room, self.room):
            if self.is_recalled:
                raise _foreign(len(self.room), int(self.room.max()) + 1)
            self._divide(room)
        super().observe(evidence)

    def _divide(self, room: I64) -> None:
        """Start over with the given patches."""
        self.room = room
        super().begin(self.rooms, self.users, self.half_life)

    def remember(self) -> dict[str, Any]:
        """Return the learned state, as arrays in mappings."""
        return {**super().remember(), "room": self.room}

    def recall(self, learned: Mapping[str, Any], today: int) -> None:
        """Restore what `remember` returned; called after `begin`."""
        room = np.asarray(learned.get("room", self.room))
        if room.max(initial=-1) + 1 != self.rooms:
            raise _foreign(len(room), int(room.max(initial=-1)) + 1)
        self._divide(room)
        super().recall(learned, today)
        self.is_recalled = True

    def sums(self, evidence: Evidence) -> F64:
        """Return seen and watched of each patch, in bins."""
        return seen_and_watched(
            evidence.by_patch.seen,
            evidence.by_patch.watched,
            self.is_counted(evidence),
            evidence.bin_steps,
        )

    def is_counted(self, evidence: Evidence) -> Bool:
        """Return whether each bin counts: bool (bins,)."""
        return np.ones(len(evidence), bool)

    def shares(self, sums: F64) -> tuple[F64, F64]:
        """Return the sums of ratios, normalized, and the remainder as away."""
        rate, away = ratios(sums, self.detection)
        first = np.flatnonzero(np.diff(self.room, prepend=-1))
        return normalized(np.add.reduceat(rate, first, axis=-1)), away


def _foreign(patches: int, rooms: int) -> ComponentError:
    return ComponentError(
        f"the learned state has {patches} patches in {rooms} rooms, unlike this home: it is from"
        " another home"
    )


def ratios(sums: F64, detection: float) -> tuple[F64, F64]:
    """Return the ratio of seen to watched of each place, and the remainder as away.

    Args:
        sums: float64 (..., 2 places + 1), sums of the rows of `seen_and_watched`.
        detection: Chance that somebody in view is perceived.
    """
    places = (sums.shape[-1] - 1) // 2
    seen, watched = sums[..., :places], sums[..., places:-1]
    all_seen, all_watched = seen.sum(axis=-1), watched.sum(axis=-1)
    is_watched = all_watched > 0
    average = (all_seen / np.where(is_watched, all_watched, 1))[..., None]
    rate = (seen + PRIOR * average) / (watched + PRIOR)
    away = 1 - np.minimum(rate.sum(axis=-1) / detection, 1)
    return rate, np.where(is_watched, away, 0.0)


def seen_and_watched(seen: I64, watched: F64, is_counted: Bool, bin_steps: int) -> F64:
    """Return seen and watched of each place, in bins, and 1: (bins, users + 1, 2 places + 1).

    Args:
        seen: int64 (bins, users + 1, places), steps.
        watched: float64 (bins, places), shares.
        is_counted: bool (bins,), whether each bin counts.
        bin_steps: Steps of a bin.
    """
    factor = is_counted[:, None, None]
    exposure = np.broadcast_to(watched[:, None], seen.shape)
    ones = np.ones((*seen.shape[:2], 1))
    return np.concatenate([seen / bin_steps * factor, exposure * factor, ones], axis=-1)


@register("presence_estimator", "audit_only")
class AuditOnly(ExposureRatio):
    """The exposure ratio of audits only: bins in which the robot looks by the clock.

    `every` and `length` define these bins: the first `length` of each `every` from midnight on, in
    which the robot looks around by schedule, regardless of what it saw before.

    It is right when the looks of audits don't depend on where the user is. It fails when audits
    begin because the user is lost; and it is noisy, as most sightings aren't used.

    Attributes:
        every: Time from the beginning of one audit to the next, counted from midnight.
        length: Duration of an audit.
    """

    every: PositiveDuration = timedelta(hours=2)
    length: PositiveDuration = timedelta(minutes=15)

    @model_validator(mode="after")
    def _check_length(self) -> "AuditOnly":
        if self.length > self.every:
            raise problem(
                f"length is {self.length}, but audits come every {self.every}: it can't be longer"
            )
        return self

    def is_counted(self, evidence: Evidence) -> Bool:
        """Return whether each bin begins in an audit: bool (bins,)."""
        every, length = (
            max(1, duration // timedelta(minutes=1)) for duration in (self.every, self.length)
        )
        return evidence.minute % every < length
