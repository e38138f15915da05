"""Batteries: how long a robot drives and stands on a charge, and its charge during a run."""

from typing import NamedTuple

import numpy as np

from fleet2d.configuration.components import Settings
from fleet2d.configuration.units import PositiveDuration, Share, micros
from fleet2d.entities.body import Body, Motion, Track
from fleet2d.entities.place import Place, stop_at
from fleet2d.entities.plan import Note, Plan
from fleet2d.kernels import F64, I64

# The table of events gets a row `battery` when the charge has changed by this much.
RECORDED_CHANGE = 0.05


class Battery(Settings):
    """A battery, described by how long it lasts; the charge falls at one of two constant rates.

    Attributes:
        driving: How long a full charge lasts driving or turning.
        standing: How long a full charge lasts standing still.
        charging: How long it takes to charge from empty to full.
        charger: Where the charger is: a point, or a room, at the point farthest from its walls.
        charge: Charge when the run begins.
    """

    driving: PositiveDuration
    standing: PositiveDuration
    charging: PositiveDuration
    charger: Place
    charge: Share = 1.0


class Course(NamedTuple):
    """The charge over time while a motion is followed.

    Attributes:
        level: Charge at `begins[0]`, 0 to 1.
        begins: Moments at which the rate changes [us], int64 (n,).
        rates: The rate from each of those moments on [1/us], (n,).
    """

    level: float
    begins: I64
    rates: list[float]

    def levels(self, moments: I64) -> F64:
        """Return the charge, float64 (n,), at moments from `begins[0]` on [us], int64 (n,)."""
        level, rows = self.level, []
        for i, rate in enumerate(self.rates):
            rows.append(level)
            if i + 1 < len(self.rates):
                change = rate * int(self.begins[i + 1] - self.begins[i])
                level = min(1.0, max(0.0, level + change))
        piece = np.searchsorted(self.begins, moments, side="right") - 1
        since = moments - self.begins[piece]
        levels: F64 = np.array(rows)[piece] + np.array(self.rates)[piece] * since
        return levels.clip(0.0, 1.0)


class Charge:
    """The charge of a robot in a run. Whenever the robot stands at its charger, it charges.

    Attributes:
        level: Charge at the last decision, 0 to 1.
        charger: Where the charger is [lattice].
    """

    def __init__(self, battery: Battery, body: Body) -> None:
        self.level = battery.charge
        self._drain = 1 / micros(battery.driving), 1 / micros(battery.standing)  # per us
        self._gain = 1 / micros(battery.charging)
        self.charger = stop_at(body, battery.charger)
        self._recorded = -1.0
        self._since_us = 0

    @property
    def is_empty(self) -> bool:
        """Whether the charge is 0."""
        return self.level <= 0

    @property
    def percent(self) -> str:
        """The charge for the table of events."""
        return f"{100 * self.level:.1f} %"

    def set(self, level: float, motion: Motion, now_us: int) -> None:
        """Set the charge at a moment, up to which a motion was followed."""
        self.follow(motion, now_us)
        self.level = level

    def follow(self, motion: Motion, until_us: int) -> None:
        """Update the charge: a motion was followed from the last decision to a moment."""
        begins, rates = self._rates(motion, self._since_us)
        ends = np.append(begins[1:], until_us)
        for begin, end, rate in zip(begins.tolist(), ends.tolist(), rates, strict=True):
            lasts = min(end, until_us) - begin
            if lasts > 0:
                self.level = min(1.0, max(0.0, self.level + rate * lasts))
        self._since_us = until_us

    def course(self, motion: Motion) -> Course:
        """Return the charge from the last decision on, if a motion is followed."""
        return Course(self.level, *self._rates(motion, self._since_us))

    def falls_to(self, level: float, motion: Motion) -> int | None:
        """Return when the charge falls to a level [us], if a motion is followed; None: never."""
        begins, rates = self._rates(motion, self._since_us)
        now, charge = self._since_us, self.level
        for begin, end, rate in zip(
            begins.tolist(), [*begins.tolist()[1:], None], rates, strict=True
        ):
            if charge <= level:
                return int(max(begin, now))
            if rate < 0 and (end is None or charge + rate * (end - begin) <= level):
                return int(begin) + int((charge - level) / -rate) + 1
            if end is not None:
                charge = min(1.0, charge + rate * (end - begin))
        return None

    def full_in_us(self, level: float) -> int:
        """Return how long it takes to charge to a level [us]."""
        return max(0, int((level - self.level) / self._gain) + 1)

    def record(self, plan: Plan) -> None:
        """Note the charge at the beginning of a plan, if it differs from the last one noted."""
        change = abs(self.level - self._recorded)
        if change >= RECORDED_CHANGE or (self.level <= 0) != (self._recorded <= 0):
            self._recorded = self.level
            begin_us = plan.began[0] * plan.step_us
            plan.notes.insert(0, Note(begin_us, "battery", self.percent))

    def _rates(self, motion: Motion, since_us: int) -> tuple[I64, list[float]]:
        """Return the moments at which the rate of the charge changes [us], and the rates [1/us]."""
        driving, standing = -self._drain[0], -self._drain[1]
        if not isinstance(motion, Track):  # a random walk never stands still
            return np.array([since_us], np.int64), [driving]
        track = motion.breakpoints
        time, x, y = track.time, track.x, track.y
        same = (np.diff(x) == 0) & (np.diff(y) == 0)
        still = np.append(same & (np.diff(track.heading) == 0), True)
        docked = np.append(same, True) & (x == self.charger[0]) & (y == self.charger[1])
        rate = np.where(docked, self._gain, np.where(still, standing, driving))
        first = max(0, int(np.searchsorted(time, since_us, side="right")) - 1)
        begins = np.maximum(time[first:], since_us)
        return begins, rate[first:].tolist()
