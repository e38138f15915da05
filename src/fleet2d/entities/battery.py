"""Batteries: how long a robot drives and stands on a charge, and what is left of it."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.component import Settings
from fleet2d.entities.furniture import stop_at
from fleet2d.entities.motion import Motion, Track
from fleet2d.entities.place import Place
from fleet2d.entities.plan import Note, Plan
from fleet2d.units import PositiveDuration, Share, micros

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor

# A row `battery` in the table of events tells the charge when it has changed by so much.
TOLD = 0.05

I64 = NDArray[np.int64]


class Battery(Settings):
    """A battery, by how long it lasts; the charge goes down evenly at either rate."""

    driving: PositiveDuration = Field(description="how long a full charge lasts driving or turning")
    standing: PositiveDuration = Field(description="how long a full charge lasts standing still")
    charging: PositiveDuration = Field(description="how long it takes to charge from empty to full")
    charger: Place = Field(
        description="where the charger is: a point, or a room, at the point farthest from its walls"
    )
    charge: Share = Field(default=1.0, description="charge when the run begins")


class Course(NamedTuple):
    """How a charge goes on while a motion is followed.

    Attributes:
        level: Charge at `begins[0]`, 0 to 1.
        begins: Moments from which on it changes at another rate [us], int64 (n,).
        rates: The rates [1/us], (n,).
    """

    level: float
    begins: I64
    rates: list[float]

    def levels(self, moments: I64) -> NDArray[np.float64]:
        """Return the charge at some moments, none of them before it begins [us]."""
        level, rows = self.level, []
        for i, rate in enumerate(self.rates):
            rows.append(level)
            if i + 1 < len(self.rates):
                change = rate * int(self.begins[i + 1] - self.begins[i])
                level = min(1.0, max(0.0, level + change))
        piece = np.searchsorted(self.begins, moments, side="right") - 1
        since = moments - self.begins[piece]
        levels: NDArray[np.float64] = np.array(rows)[piece] + np.array(self.rates)[piece] * since
        return levels.clip(0.0, 1.0)


class Charge:
    """The charge of a robot in a run. Whenever the robot stands at its charger, it charges.

    Attributes:
        level: Charge at the last decision, 0 to 1.
        charger: Where the charger is [lattice].
    """

    def __init__(self, battery: Battery, actor: "Actor") -> None:
        self.level = battery.charge
        self._drain = 1 / micros(battery.driving), 1 / micros(battery.standing)  # per us
        self._gain = 1 / micros(battery.charging)
        self.charger = stop_at(actor, battery.charger)
        self._told = -1.0
        self._since_us = 0

    @property
    def is_empty(self) -> bool:
        """Whether nothing is left."""
        return self.level <= 0

    @property
    def percent(self) -> str:
        """The charge for the table of events."""
        return f"{100 * self.level:.1f} %"

    def set(self, level: float, motion: Motion, now_us: int) -> None:
        """Have another charge from a moment on, at which a motion is being followed."""
        self.follow(motion, now_us)
        self.level = level

    def follow(self, motion: Motion, until_us: int) -> None:
        """Take in that a motion was followed from the last decision to a moment."""
        begins, rates = self._rates(motion, self._since_us)
        ends = np.append(begins[1:], until_us)
        for begin, end, rate in zip(begins.tolist(), ends.tolist(), rates, strict=True):
            lasts = min(end, until_us) - begin
            if lasts > 0:
                self.level = min(1.0, max(0.0, self.level + rate * lasts))
        self._since_us = until_us

    def course(self, motion: Motion) -> Course:
        """Return how the charge goes on from the last decision, if a motion is followed."""
        return Course(self.level, *self._rates(motion, self._since_us))

    def falls_to(self, level: float, motion: Motion) -> int | None:
        """Return when a motion that begins now brings the charge down to a level [us], or None."""
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
        """Return how long it charges to a level [us]."""
        return max(0, int((level - self.level) / self._gain) + 1)

    def tell(self, plan: Plan) -> None:
        """Note the charge at the beginning of a plan if it isn't what was noted last."""
        if abs(self.level - self._told) >= TOLD or (self.level <= 0) != (self._told <= 0):
            self._told = self.level
            begin_us = plan.began[0] * plan.step_us
            plan.notes.insert(0, Note(begin_us, "battery", self.percent))

    def _rates(self, motion: Motion, since_us: int) -> tuple[I64, list[float]]:
        """Return the moments from which on the charge changes at which rate [1/us]."""
        driving, standing = -self._drain[0], -self._drain[1]
        if not isinstance(motion, Track):  # it wanders about all the time
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
