"""FreMEn: each room's presence as a sum of periodic functions of time, found in what was seen."""

import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.algorithms.learned import array_of
from fleet2d.algorithms.presence.belief import HOURS, Presence, WeeklyPresence
from fleet2d.algorithms.presence.counts import Bins
from fleet2d.algorithms.presence.estimator import F64, Estimator, normalized
from fleet2d.algorithms.presence.exposure_ratio import counted, ratios
from fleet2d.algorithms.presence.logarithm import natural_log
from fleet2d.component import register
from fleet2d.units import Share

WEEK = 10_080  # minutes
PERIODS = 100  # candidates: a week by 1, 2 … 100
ORDERS = 5  # models with 0 to 4 periods
SPANS = 1.5  # periods that the data must span before one is considered
LEAST = 1e-6  # probability to which forecasts are raised, and from one, before they are scored
RECENT = 0.5  # what an order's log loss counts a day later: early periods are wrong ones
UNIT = 1 << 30


def _cosines() -> F64:
    """Return cos(2 pi m / WEEK) of each minute, rounded to where no library disagrees."""
    return np.array([round(math.cos(2 * math.pi * m / WEEK) * UNIT) / UNIT for m in range(WEEK)])


@register("presence_estimator", "fremen")
class Fremen(Estimator):
    """Frequency map enhancement (Krajnik et al.), one model for each user and room.

    A bin is a sample of the room's state s with the weight w, the share of the room in view; s is
    the share of its steps at which the user was perceived there. With n the sum of weights and p0
    that of s by n, and candidate periods T_i = 7 d / i, i = 1 … 100, the sums of (s - p0 w)
    e^(j 2 pi t / T_i) have amplitude A_i = |sum| / n and phase phi_i; A_i counts only once the data
    span 1.5 T_i. Then p(t) = p0 + sum over the m largest of 2 A_i cos(2 pi t / T_i - phi_i),
    clipped to 0 … 1; m = 0 is the static model, sightings by exposure. Where rooms are in view as a
    whole or not at all, that is the method as published.

    The order m, 0 to 4, is that with the least log loss of late: each day's samples are forecast
    by what was known before that day, and a day counts half of the one after. Over rooms p(t) is
    then normalized, and what it lacks to the chance of detection is away, as for the exposure
    ratio.

    Right where daily and weekly rhythms make a room likely or not, and looks are timed
    independently of the user. Breaks, as the exposure ratio, when the robot follows; and in the
    first days there are no periods yet.
    """

    has_interval: ClassVar[bool] = False

    detection: Share = Field(
        default=0.95, description="chance that somebody in view is perceived", gt=0
    )

    def width(self, rooms: int) -> int:
        """Return how many numbers `sums` has: seen and watched of each room, and bins."""
        return 2 * rooms + 1

    def sums(self, bins: Bins) -> F64:
        """Count seen and watched, in bins."""
        return counted(bins.seen, bins.watched, np.ones(len(bins.day), bool), bins.bin_steps)

    def shares(self, sums: F64) -> tuple[F64, F64]:
        """Return what the static models say."""
        rate, away = ratios(sums, self.detection)
        return normalized(rate), away

    def begin(self, rooms: int, users: int, half_life: float | None = None) -> None:
        """Prepare for a run."""
        super().begin(rooms, users, half_life)
        self.cosines = _cosines()
        shape = (users + 1, rooms)
        self.waves = np.zeros((2, 2, *shape, PERIODS))  # cos, sin of weights; of states
        self.fit = np.zeros((*shape, ORDERS))  # log likelihood of each order's forecasts so far
        self.first = 0  # day with samples
        self.span = 0  # days from that to the last over
        self.day: list[tuple[NDArray[np.int64], F64]] = []
        self.week: tuple[F64, F64] | None = None  # the forecast of each hour

    def observe(self, bins: Bins) -> None:
        """Take in evidence; periods are found again when a day is over."""
        ends = [*(np.flatnonzero(np.diff(bins.day)) + 1).tolist(), len(bins.day)]
        begin = 0
        for end in ends:
            if begin == end:
                continue
            part = bins.part(begin, end)
            begin, today = end, int(part.day[0])
            self.first = self.first or today
            if today != self.counts.today and self.day:
                self._end_day(today)
            sums = self.sums(part)
            self.day.append((((today - 1) * 1440 + part.minute) % WEEK, sums))
            self.counts.add(part.day, part.minute, sums)

    def presence(self, users: Sequence[str], time: datetime) -> Presence:
        """Return the forecast of each hour of the week, from its middle."""
        if self.week is None or not self.span:  # it changes when a day is over
            minutes = np.arange(HOURS, dtype=np.int64) * 60 + 30
            self.week = self._with_away(self.forecast(minutes))
        return WeeklyPresence(users, self.week, time)

    def weekly(self, users: Sequence[str], time: datetime, smoothing: float) -> Presence:
        """Return the forecast of each hour of the week; it needs no smoothing."""
        return self.presence(users, time)

    def forecast(self, minutes: NDArray[np.int64]) -> F64:
        """Return p(t) at minutes of the week, of the best orders: (minutes, users + 1, rooms)."""
        order = self.fit.argmax(axis=2)[np.newaxis, ..., np.newaxis]
        found: F64 = np.take_along_axis(self._by_order(minutes), order, axis=3)
        return found[..., 0]

    def _with_away(self, p: F64) -> tuple[F64, F64]:
        away = 1 - np.minimum(p.sum(axis=-1) / self.detection, 1)
        return normalized(p), away if self.span else np.zeros_like(away)

    def _waves(self, minutes: NDArray[np.int64]) -> F64:
        """Return cos and sin of 2 pi t / T_i: float64 (2, minutes, periods)."""
        at = minutes[:, np.newaxis] * np.arange(1, PERIODS + 1) % WEEK
        return np.stack([self.cosines[at], self.cosines[(at - WEEK // 4) % WEEK]])

    def _end_day(self, following: int) -> None:
        """Score each order by the day that is over, and then learn from it."""
        minutes, sums = (np.concatenate(parts) for parts in zip(*self.day, strict=True))
        seen, watched = sums[..., : self.rooms], sums[..., self.rooms : -1]
        p = np.clip(self._by_order(minutes), LEAST, 1 - LEAST)
        missed = np.maximum(watched - seen, 0)[..., np.newaxis]
        gain = seen[..., np.newaxis] * natural_log(p) + missed * natural_log(1 - p)
        self.fit = RECENT * self.fit + gain.sum(axis=0)
        for wave, of in zip(self.waves, self._waves(minutes), strict=True):
            for user in range(self.users + 1):
                for room in range(self.rooms):
                    for k, values in enumerate((watched, seen)):
                        some = values[:, user, room] > 0
                        weight = values[some, user, room, np.newaxis]
                        wave[k, user, room] += (weight * of[some]).sum(axis=0)
        self.waves = self.waves * self.counts.faded(following - self.counts.today)
        self.day, self.week = [], None
        self.span = self.counts.today - self.first + 1

    def _by_order(self, minutes: NDArray[np.int64]) -> F64:
        """Return p(t) of each order: float64 (minutes, users + 1, rooms, orders)."""
        total = self.counts.over  # of days that are over
        seen, watched = total[:, : self.rooms], total[:, self.rooms : -1]
        n = np.where(watched > 0, watched, 1)
        mean = np.where(watched > 0, np.minimum(seen / n, 1), 0.0)
        sums = self.waves[:, 1] - (seen / n)[..., np.newaxis] * self.waves[:, 0]
        real, imaginary = sums / n[..., np.newaxis]
        strength = real * real + imaginary * imaginary
        enough = self.span >= SPANS * 7 / np.arange(1, PERIODS + 1)
        strength = np.where(enough, strength, 0.0)
        best = np.argsort(-strength, axis=2, kind="stable")[..., : ORDERS - 1]
        kept = np.take_along_axis(strength, best, axis=2) > 0
        real, imaginary = (
            np.where(kept, 2 * np.take_along_axis(part, best, axis=2), 0.0)
            for part in (real, imaginary)
        )
        at = minutes[:, np.newaxis, np.newaxis, np.newaxis] * (best + 1) % WEEK
        wave = real * self.cosines[at] + imaginary * self.cosines[(at - WEEK // 4) % WEEK]
        by_order = np.empty((*wave.shape[:3], ORDERS))
        by_order[..., 0] = mean
        for m in range(1, ORDERS):
            by_order[..., m] = by_order[..., m - 1] + wave[..., m - 1]
        return np.clip(by_order, 0, 1)

    def remember(self) -> dict[str, Any]:
        """Return all that was learned, as arrays in mappings."""
        return {**super().remember(), "waves": self.waves, "fit": self.fit, "span": self.span}

    def recall(self, learned: Mapping[str, Any], today: int) -> None:
        """Go on from what `remember` returned; called after `begin`."""
        super().recall(learned, today)
        self.waves = array_of(learned, "waves", self.waves.shape)
        self.fit = array_of(learned, "fit", self.fit.shape)
        self.span = int(array_of(learned, "span", (), np.int64, most=1 << 31))
        self.first = today - self.span
