"""Sightings divided by the time watched: of all looks, of audits, by periods of the week."""

import math
from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from pydantic import Field

from fleet2d.algorithms.evidence import Evidence
from fleet2d.algorithms.presence.belief import HOURS, Presence, WeeklyPresence
from fleet2d.algorithms.presence.estimator import Estimator, array_of, natural_log, normalized
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import PositiveDuration, Share
from fleet2d.errors import ComponentError
from fleet2d.kernels import F64, I64
from fleet2d.runtime.clock import DAY_MINUTES

PRIOR = 1.0  # bins of average sightings that are added to each place

WEEK = 7 * DAY_MINUTES
PERIODS = 100  # candidate periods: a week divided by 1, 2 … 100
ORDERS = 5  # models with 0 to 4 periods
SPANS = 1.5  # periods that the data must span before one is considered
# Forecasts are clipped to MIN_PROBABILITY … 1 - MIN_PROBABILITY before they are scored.
MIN_PROBABILITY = 1e-6
# The weight of an order's log loss a day later, as periods found early are often wrong.
RECENT = 0.5
UNIT = 1 << 30


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
        self.half_life = half_life
        self.is_recalled = False
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
        """Return for how long each patch was watched, and somebody seen in it, in bins."""
        patches = evidence.by_patch
        return seen_and_watched(patches.seen, patches.watched, evidence.bin_steps)

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
    seen = sums[..., :places]
    watched = sums[..., places:-1]
    all_seen = seen.sum(axis=-1)
    all_watched = watched.sum(axis=-1)
    is_watched = all_watched > 0
    average = (all_seen / np.where(is_watched, all_watched, 1))[..., None]
    rate = (seen + PRIOR * average) / (watched + PRIOR)
    away = 1 - np.minimum(rate.sum(axis=-1) / detection, 1)
    return rate, np.where(is_watched, away, 0.0)


def seen_and_watched(seen: I64, watched: F64, bin_steps: int) -> F64:
    """Return seen and watched of each place, in bins, and 1: (bins, users + 1, 2 places + 1).

    Args:
        seen: int64 (bins, users + 1, places), steps.
        watched: float64 (bins, places), shares.
        bin_steps: Steps of a bin.
    """
    exposure = np.broadcast_to(watched[:, None], seen.shape)
    ones = np.ones((*seen.shape[:2], 1))
    return np.concatenate([seen / bin_steps, exposure, ones], axis=-1)


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

    def model_post_init(self, _: object, /) -> None:
        """Refuse audits that are longer than the time between two."""
        if self.length > self.every:
            raise problem(
                f"length is {self.length}, but audits come every {self.every}: it can't be longer"
            )

    def sums(self, evidence: Evidence) -> F64:
        """Return for how long each patch was watched, and somebody seen in it, during audits."""
        minute = timedelta(minutes=1)
        sums = super().sums(evidence)
        every, length = (max(1, duration // minute) for duration in (self.every, self.length))
        sums[evidence.minute % every >= length, :, :-1] = 0
        return sums


def _cosines() -> F64:
    """Return cos(2 pi m / WEEK) of each minute, rounded so that all math libraries agree."""
    return np.array([round(math.cos(2 * math.pi * m / WEEK) * UNIT) / UNIT for m in range(WEEK)])


class Fremen(Estimator):
    """Frequency map enhancement (Krajnik et al.), one model for each user and room.

    A bin is a sample of the room's state s with the weight w, the share of the room in view; s is
    the share of its steps at which the user was perceived there. With n the sum of weights and p0
    that of s by n, and candidate periods T_i = 7 d / i, i = 1 … 100, the sums of (s - p0 w)
    e^(j 2 pi t / T_i) have amplitude A_i = |sum| / n and phase phi_i; A_i counts only once the data
    span 1.5 T_i. Then p(t) = p0 + sum over the m largest of 2 A_i cos(2 pi t / T_i - phi_i),
    clipped to 0 … 1; m = 0 is the static model, sightings by exposure. Where rooms are in view as a
    whole or not at all, that is the method as published.

    The order m, 0 to 4, is the one with the lowest recent log loss: each day's samples are forecast
    from the days before, and a day counts half as much as the one after. p(t) is then normalized
    over rooms, and its difference to the chance of detection is away, as for the exposure ratio.

    It is right where daily and weekly rhythms decide which rooms are likely, and looks are timed
    independently of the user. It fails, as the exposure ratio does, when the robot follows a user;
    and in the first days there are no periods yet.

    Attributes:
        detection: Chance that somebody in view is perceived.
    """

    has_interval = False

    detection: Share = Field(default=0.95, gt=0)

    def width(self, rooms: int) -> int:
        """Return the number of columns of `sums`: seen and watched of each room, and bins."""
        return 2 * rooms + 1

    def sums(self, evidence: Evidence) -> F64:
        """Return for how long each room was watched, and somebody seen in it, in bins."""
        return seen_and_watched(evidence.seen, evidence.watched, evidence.bin_steps)

    def shares(self, sums: F64) -> tuple[F64, F64]:
        """Return the shares by the static models, which have no periods."""
        rate, away = ratios(sums, self.detection)
        return normalized(rate), away

    def begin(self, rooms: int, users: int, half_life: float | None = None) -> None:
        """Prepare for a run."""
        super().begin(rooms, users, half_life)
        self.cosines = _cosines()
        shape = (users + 1, rooms)
        self.waves = np.zeros((2, 2, *shape, PERIODS))  # cos, sin of weights; of states
        self.fit = np.zeros((*shape, ORDERS))  # log likelihood of each order's forecasts so far
        self.first = 0  # the first day with samples
        self.span = 0  # days from the first to the last finished one
        self.day: list[tuple[I64, F64]] = []  # samples of the present day
        self.week: tuple[F64, F64] | None = None  # the forecast for each hour

    def observe(self, evidence: Evidence) -> None:
        """Add the next bins of evidence; periods are selected again when a day is over."""
        for part in evidence.days:
            today = int(part.day[0])
            self.first = self.first or today
            if today != self.counts.today and self.day:
                self._end_day(today)
            sums = self.sums(part)
            self.day.append((((today - 1) * DAY_MINUTES + part.minute) % WEEK, sums))
            self.counts.add(part.day, part.minute, sums)

    def presence(self, users: Sequence[str], time: datetime) -> Presence:
        """Return the forecast for each hour of the week, evaluated at its middle."""
        if self.week is None or not self.span:  # it only changes when a day is over
            minutes = np.arange(HOURS, dtype=np.int64) * 60 + 30
            p = self.forecast(minutes)
            away = 1 - np.minimum(p.sum(axis=-1) / self.detection, 1)
            self.week = normalized(p), away if self.span else np.zeros_like(away)
        return WeeklyPresence(users, self.week, time)

    def weekly(self, users: Sequence[str], time: datetime, smoothing: float) -> Presence:
        """Return the forecast for each hour of the week; it needs no smoothing."""
        return self.presence(users, time)

    def forecast(self, minutes: I64) -> F64:
        """Return p(t) at minutes of the week, by the best orders: (minutes, users + 1, rooms)."""
        order = self.fit.argmax(axis=2)[np.newaxis, ..., np.newaxis]
        p: F64 = np.take_along_axis(self._by_order(minutes), order, axis=3)
        return p[..., 0]

    def _waves(self, minutes: I64) -> F64:
        """Return cos and sin of 2 pi t / T_i: float64 (2, minutes, periods)."""
        angle = minutes[:, np.newaxis] * np.arange(1, PERIODS + 1) % WEEK
        return np.stack([self.cosines[angle], self.cosines[(angle - WEEK // 4) % WEEK]])

    def _end_day(self, next_day: int) -> None:
        """Score each order by the finished day, then update the models with it."""
        minutes, sums = (np.concatenate(parts) for parts in zip(*self.day, strict=True))
        seen = sums[..., : self.rooms]
        watched = sums[..., self.rooms : -1]
        p = np.clip(self._by_order(minutes), MIN_PROBABILITY, 1 - MIN_PROBABILITY)
        missed = np.maximum(watched - seen, 0)[..., np.newaxis]
        gain = seen[..., np.newaxis] * natural_log(p) + missed * natural_log(1 - p)
        self.fit = RECENT * self.fit + gain.sum(axis=0)
        weights = np.stack([watched, seen])
        for sums_by_state, wave in zip(self.waves, self._waves(minutes), strict=True):
            for k, user, room in np.ndindex(sums_by_state.shape[:3]):
                is_positive = weights[k, :, user, room] > 0
                weight = weights[k, is_positive, user, room, np.newaxis]
                sums_by_state[k, user, room] += (weight * wave[is_positive]).sum(axis=0)
        self.waves = self.waves * self.counts.faded(next_day - self.counts.today)
        self.day = []
        self.week = None
        self.span = self.counts.today - self.first + 1

    def _by_order(self, minutes: I64) -> F64:
        """Return p(t) for each order: float64 (minutes, users + 1, rooms, orders)."""
        total = self.counts.finished
        seen = total[:, : self.rooms]
        watched = total[:, self.rooms : -1]
        n = np.where(watched > 0, watched, 1)
        mean = np.where(watched > 0, np.minimum(seen / n, 1), 0.0)
        sums = self.waves[:, 1] - (seen / n)[..., np.newaxis] * self.waves[:, 0]
        real, imaginary = sums / n[..., np.newaxis]
        strength = real * real + imaginary * imaginary
        is_long_enough = self.span >= SPANS * 7 / np.arange(1, PERIODS + 1)
        strength = np.where(is_long_enough, strength, 0.0)
        best = np.argsort(-strength, axis=2, kind="stable")[..., : ORDERS - 1]
        is_used = np.take_along_axis(strength, best, axis=2) > 0
        real, imaginary = (
            np.where(is_used, 2 * np.take_along_axis(part, best, axis=2), 0.0)
            for part in (real, imaginary)
        )
        angle = minutes[:, np.newaxis, np.newaxis, np.newaxis] * (best + 1) % WEEK
        wave = real * self.cosines[angle] + imaginary * self.cosines[(angle - WEEK // 4) % WEEK]
        by_order = np.empty((*wave.shape[:3], ORDERS))
        by_order[..., 0] = mean
        for m in range(1, ORDERS):
            by_order[..., m] = by_order[..., m - 1] + wave[..., m - 1]
        return np.clip(by_order, 0, 1)

    def remember(self) -> dict[str, Any]:
        """Return the learned state, as arrays in mappings."""
        return {**super().remember(), "waves": self.waves, "fit": self.fit, "span": self.span}

    def recall(self, learned: Mapping[str, Any], today: int) -> None:
        """Restore what `remember` returned; called after `begin`."""
        super().recall(learned, today)
        self.waves = array_of(learned, "waves", self.waves.shape)
        self.fit = array_of(learned, "fit", self.fit.shape)
        self.span = int(array_of(learned, "span", (), np.int64, max_value=1 << 31))
        self.first = today - self.span
