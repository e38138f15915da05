"""Simulated time: steps of one length from a start, local times, and the sun of each day."""

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date, datetime, time, timedelta, timezone
from functools import cached_property, lru_cache
from math import isqrt

import numpy as np
from numpy.typing import NDArray

from fleet2d.errors import InputError
from fleet2d.kernels import F64, I64, TURN, UNIT, half_sines
from fleet2d.runtime.local_time import (
    EPOCH,
    LocalTime,
    Zone,
    at_reading,
    readings_of,
    stamp_us,
    wall_us,
)

MICROSECOND = timedelta(microseconds=1)
SECOND = timedelta(seconds=1)
SECOND_US = 1_000_000
MINUTE_US = 60 * SECOND_US
HOUR_S = 60 * 60
DAY_S = 24 * HOUR_S
DAY_MINUTES = 24 * 60
HOUR_US = HOUR_S * 1_000_000
DAY_US = DAY_S * 1_000_000

DAY = timedelta(days=1)
# Angles are in 10**-7 degrees.
DEGREE = 10_000_000
CIRCLE = 360 * DEGREE
OBLIQUITY = 234_393_000
# With refraction, the sun's upper edge appears while its centre is this far below the horizon.
HORIZON = -8_330_000
# Dawn is from half an hour before sunrise to half an hour after; dusk is the same at sunset.
TWILIGHT = timedelta(minutes=30)


@dataclass(frozen=True)
class Clock:
    """The steps of a run: step k is the moment k * step_us after the start.

    Attributes:
        start: Local time of step 0: of a home whose clocks change a `LocalTime`; a plain datetime
            where each day has 24 hours.
        step_us: Length of a step [us].
        steps: Number of steps; the last is steps - 1.
        sun: The sun over the home; None: the light doesn't depend on it.

    Example:
        >>> clock = Clock(datetime(2026, 1, 5), step_us=1_000_000, steps=3600)
        >>> clock.time(90).isoformat()
        '2026-01-05T00:01:30'
        >>> clock.step_at_or_after(1_500_000)
        2
    """

    start: datetime
    step_us: int
    steps: int
    sun: "Sun | None" = None

    @cached_property
    def zone(self) -> Zone | None:
        """The clock of the home, if it has a time zone."""
        return self.start.zone if isinstance(self.start, LocalTime) else None

    def time(self, step: int) -> datetime:
        """Return the local time of a step."""
        return self.start + step * self.step_us * MICROSECOND

    def times(self, steps: I64) -> NDArray[np.datetime64]:
        """Return the local times of steps, datetime64[us]."""
        return readings_of(self.start, steps * self.step_us).astype("M8[us]")

    def stamp(self, step: int) -> np.datetime64:
        """Return the time of a step as tables hold it: UTC if the home has a time zone."""
        return np.datetime64(self._start_us + step * self.step_us, "us")

    def stamps(self, steps: I64) -> NDArray[np.datetime64]:
        """Return the times of steps as tables hold them."""
        return self.moments(steps * self.step_us)

    def moments(self, elapsed_us: I64) -> NDArray[np.datetime64]:
        """Return moments [us since the start] as tables hold them."""
        return np.datetime64(self._start_us, "us") + elapsed_us.astype("m8[us]")

    def texts(self, steps: I64) -> list[str]:
        """Return the local times of steps as ISO 8601, with offsets if the home has a time zone."""
        readings = self.times(steps)
        texts = [time.isoformat() for time in readings.tolist()]
        if self.zone is None:
            return texts
        offsets_us, which = np.unique(readings - self.stamps(steps), return_inverse=True)
        zones = [timezone(offset) for offset in offsets_us.tolist()]
        suffixes = [datetime.min.replace(tzinfo=zone).isoformat()[19:] for zone in zones]
        return [text + suffixes[k] for text, k in zip(texts, which.tolist(), strict=True)]

    def elapsed(self, moment: datetime) -> int:
        """Return the microseconds from the start to a local time; negative before the start.

        Raises:
            InputError: The time has an offset, and the home has no time zone.
        """
        if moment.tzinfo is not None and self.zone is None:
            raise InputError(
                f"{moment.isoformat()} has an offset, and the home has no time zone: leave it out,"
                " or set simulation.time_zone"
            )
        return (moment - self.start) // MICROSECOND

    def reading(self, ordinal: int, second: int) -> int:
        """Return the moment at which the clock reads a time of day [us since the start].

        Args:
            ordinal: The ordinal of the day's date.
            second: The seconds since its midnight, also of an earlier or later day.
        """
        reading_us = ((ordinal - EPOCH.toordinal()) * DAY_S + second) * SECOND_US
        return (self.zone.utc_us(reading_us) if self.zone else reading_us) - self._start_us

    @cached_property
    def _start_us(self) -> int:
        return stamp_us(self.start)

    def next_change(self, step: int) -> int | None:
        """Return the first step after another one at which the offset from UTC changes."""
        zone = self.zone
        change = zone.next_change(zone.at(self.time(step))) if zone else None
        return None if change is None else self.step_at_or_after(self.elapsed(change))

    def step_at_or_after(self, elapsed_us: int) -> int:
        """Return the first step that is not before a moment [us since the start]."""
        return -(-elapsed_us // self.step_us)


def midnight_of(moment: datetime) -> datetime:
    """Return the midnight that begins the day of a moment, as the clock reads it."""
    return datetime.combine(moment.date(), time())


def next_midnight(moment: datetime) -> datetime:
    """Return the next midnight after a moment."""
    midnight = at_reading(moment, midnight_of(moment) + DAY)
    # A clock that is put back shortly after midnight reads it twice.
    return midnight if midnight > moment else midnight.replace(fold=1)


def midnights(begin: datetime, end: datetime | None = None) -> Iterator[datetime]:
    """Yield the midnight that begins the day of a moment, and all later ones before `end`.

    A date that a time zone skipped, as on islands that moved across the date line, has none.

    >>> [midnight.day for midnight in midnights(datetime(2026, 1, 5, 8), datetime(2026, 1, 7, 1))]
    [5, 6, 7]
    """
    midnight = midnight_of(begin)
    while end is None or midnight < end:
        if at_reading(begin, midnight).date() == midnight.date():
            yield midnight
        midnight += DAY


# The day from which the numbers of the almanac count: 1 January 2000, at noon.
ALMANAC = date(2000, 1, 1).toordinal()


@dataclass(frozen=True)
class Sun:
    """The sun over a home, by the low-precision formulas of the Astronomical Almanac.

    Computed in integers; times are accurate to a minute or two in the centuries around 2000.

    Attributes:
        latitude_deg: The latitude of the home, north is positive; the sun rises on each day.
        noon: Solar noon by the home's clock without summer time, averaged over the year.
        zone: The clock of the home, if it has a time zone.

    Example:
        >>> sun = Sun(52.52, timedelta(hours=12, minutes=6))  # Berlin
        >>> [str(moment) for moment in sun.day(date(2026, 12, 21).toordinal())]
        ['2026-12-21 08:14:20', '2026-12-21 15:53:48']
    """

    latitude_deg: float
    noon: timedelta
    zone: Zone | None = None

    def day(self, ordinal: int) -> tuple[datetime, datetime]:
        """Return sunrise and sunset of a day, given as the ordinal of its date."""
        half_day_s, late_s = _sun_on(ordinal, round(self.latitude_deg * DEGREE))
        noon = datetime.fromordinal(ordinal) + self.noon - timedelta(seconds=late_s)
        if self.zone is not None:
            noon = self.zone.moment(wall_us(noon) - self.zone.standard_us)
        return noon - timedelta(seconds=half_day_s), noon + timedelta(seconds=half_day_s)

    def shares(self, times: NDArray[np.datetime64]) -> F64:
        """Return the share of daylight: 1 by day, 0 at night, linear in between.

        Args:
            times: Local times, datetime64[us] (n,).
        """
        days, which = np.unique(times.astype("M8[D]"), return_inverse=True)
        ends = [self.day(day.toordinal()) for day in days.tolist()]
        ends_us = [(wall_us(rise), wall_us(fall)) for rise, fall in ends]
        rise, fall = np.array(ends_us, np.int64).astype("M8[us]").reshape(-1, 2).T
        twilight = np.timedelta64(TWILIGHT)
        risen = (times - rise[which] + twilight) / (2 * twilight)
        left = (fall[which] - times + twilight) / (2 * twilight)
        return np.clip(np.minimum(risen, left), 0, 1)

    def end_at(self, time: datetime) -> datetime | None:
        """Return the end of the night that a moment lies in; None by day."""
        rise, fall = self.day(time.toordinal())
        if time >= fall:
            return self.day(time.toordinal() + 1)[0]
        return rise if time < rise else None

    def next_begin(self, time: datetime) -> datetime:
        """Return the beginning of the next night after a moment."""
        fall = self.day(time.toordinal())[1]
        return fall if fall > time else self.day(time.toordinal() + 1)[1]


@lru_cache(4096)
def _sun_on(ordinal: int, latitude: int) -> tuple[int, int]:
    """Return half of the length of a day, and the equation of time [s]."""
    days = ordinal - ALMANAC
    anomaly = 3_575_280_000 + 9_856_003 * days
    mean = 2_804_600_000 + 9_856_474 * days
    longitude = mean + (19_150_000 * _sine(anomaly) + 200_000 * _sine(2 * anomaly)) // UNIT
    # The equation of time: the true sun's right ascension against the mean sun's.
    early = (
        -19_150_000 * _sine(anomaly)
        - 200_000 * _sine(2 * anomaly)
        + 24_660_000 * _sine(2 * longitude)
        - 530_000 * _sine(4 * longitude)
    ) // UNIT
    sine = _sine(OBLIQUITY) * _sine(longitude) // UNIT
    cosine = isqrt(UNIT**2 - sine**2)
    across = _sine(latitude + CIRCLE // 4) * cosine
    height = (_sine(HORIZON) * UNIT - _sine(latitude) * sine) * UNIT // across
    # The hour angle whose cosine that is: cosines fall from 0 to half a turn.
    falling = half_sines()[TURN // 2 : TURN + TURN // 2 + 1]
    angle = bisect_left(falling, -height, key=lambda value: -int(value))
    return angle * DAY_S // (2 * TURN), early * DAY_S // CIRCLE


def _sine(angle: int) -> int:
    """Return UNIT times the sine of an angle [10**-7 degrees]."""
    halves = (angle * 2 * TURN + CIRCLE // 2) // CIRCLE
    return int(half_sines()[halves % (2 * TURN)])
