"""Sensors: objects that notice what goes on in the home, and say when it begins and ends."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.entities.objects.home_object import HomeObject
from fleet2d.floorplan.home.home import Home

I64 = NDArray[np.int64]
Mask = NDArray[np.bool_]


SensorFault = Literal["on", "off", "silent"]
"""What a sensor says instead of what it senses: excited all the time, never, or nothing at all."""


class Reading(NamedTuple):
    """A sensor goes on or off."""

    step: int
    on: bool
    user: int  # index of whom it noticed, -1: nobody in particular


@dataclass(frozen=True)
class SensorView:
    """The bodies over a span, as sensors see them: row u is user u, then come the robots.

    Attributes:
        first: First step of the span.
        x: int64 (bodies, steps + 1) [lattice]; column 0 is the step before the span (at the first
            step of a run, that step itself), column j + 1 is step first + j.
        y: As x.
        present: bool (bodies, steps + 1), whether the body is at home.
        users: How many of the rows are users.
    """

    first: int
    x: I64
    y: I64
    present: Mask
    users: int

    @property
    def steps(self) -> int:
        """The number of steps in the span."""
        return int(self.x.shape[1]) - 1


class Sensor(HomeObject):
    """Base of sensors: a subclass writes `sense`, which says in which steps it is excited.

    What a sensor says follows from that: it goes on with the first step, and off when it has been
    quiet for its `hold`.
    """

    room: str | None = Field(
        default=None,
        min_length=1,
        description="the room that its readings name; left out: where it is",
    )

    # What its two states are called in the table of readings.
    words: ClassVar[tuple[str, str]] = ("ON", "OFF")

    def start(self, home: Home, step_us: int) -> None:
        """Prepare for a run; check here that what it watches exists."""

    def place(self, home: Home) -> str:
        """Return the name of the room that its readings name."""
        raise NotImplementedError

    def hold_us(self) -> int:
        """Return how long it stays on after it was excited last [us]."""
        return 0

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return the steps in which it is excited, ascending, and by whom: int64 (n,) each."""
        raise NotImplementedError


def seen_by(excited: Mask, first: int) -> tuple[I64, I64]:
    """Return the steps in which anybody excites a sensor, and the first who does.

    Args:
        excited: bool (bodies, steps).
        first: The step of the first column.

    Example:
        >>> steps, bodies = seen_by(np.array([[0, 0, 1], [0, 1, 1]], bool), 100)
        >>> steps.tolist(), bodies.tolist()
        ([101, 102], [1, 0])
    """
    columns = np.flatnonzero(excited.any(axis=0))
    return columns + first, np.argmax(excited[:, columns], axis=0).astype(np.int64)


class Memory:
    """What a sensor carries from span to span."""

    def __init__(self, hold_steps: int) -> None:
        self.hold = hold_steps
        self.on = False
        self.last = 0  # the last step in which it was excited
        self.user = -1

    def read(self, steps: I64, users: I64, end: int) -> list[Reading]:
        """Return what it says up to step `end` - 1, excited in these steps."""
        readings: list[Reading] = []
        # Between excited steps no farther apart than it holds, nothing is said.
        quiet = np.flatnonzero(np.diff(steps) > self.hold + 1)
        begins = [0, *(quiet + 1).tolist()] if len(steps) else []
        ends = [*quiet.tolist(), len(steps) - 1]
        for i, j in zip(begins, ends, strict=False):
            if self.on and steps[i] > self.last + self.hold + 1:
                readings.append(self._off())
            if not self.on:
                self.on, self.user = True, int(users[i])
                readings.append(Reading(int(steps[i]), True, self.user))
            self.last = int(steps[j])
        if self.on and self.last + self.hold + 1 < end:
            readings.append(self._off())
        return readings

    def _off(self) -> Reading:
        self.on = False
        return Reading(self.last + self.hold + 1, False, self.user)


def in_order(readings: Sequence[tuple[int, Reading]]) -> list[tuple[int, Reading]]:
    """Return the readings of several sensors by step, then sensor."""
    return sorted(readings, key=lambda item: (item[1].step, item[0]))
