"""Sensors: the base of all, their readings, and their state between spans."""

from dataclasses import dataclass
from datetime import timedelta
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from fleet2d.configuration.units import Duration, micros
from fleet2d.entities.home_object import HomeObject
from fleet2d.floorplan.home import Home
from fleet2d.kernels import I64, Bool
from fleet2d.sight.failures import Failures

SensorFault = Literal["on", "off", "silent"]
"""How a sensor fails: it is always triggered, never triggered, or reports nothing."""


class SensorFailures(Failures):
    """The failures of a sensor, with their effect.

    Attributes:
        says: The effect: no reports (`silent`), or always or never triggered (`on`, `off`).
    """

    says: SensorFault = "silent"


class SensorReading(NamedTuple):
    """A change of a sensor's state.

    Attributes:
        step: The step at which it goes on or off.
        on: Whether it goes on.
        user: The index of the noticed user; -1: none.
    """

    step: int
    on: bool
    user: int


@dataclass(frozen=True)
class SensorView:
    """The bodies over a span, as sensors see them: row u is user u, then come the robots.

    Attributes:
        first: First step of the span.
        x: Positions [lattice], int64 (bodies, steps + 1). Column 0 is the step before the span (at
            the first step of a run, that step itself), column j + 1 is step first + j.
        y: Likewise.
        present: Whether the body is at home, bool (bodies, steps + 1).
        users: The number of rows that are users.
    """

    first: int
    x: I64
    y: I64
    present: Bool
    users: int

    @property
    def steps(self) -> int:
        """The number of steps in the span."""
        return int(self.x.shape[1]) - 1


class Sensor(HomeObject):
    """Base of sensors: a subclass implements `sense`, which returns the steps that trigger it.

    The sensor goes on with the first of these steps, and off after its `hold` without any.

    Attributes:
        room: The room in its readings; left out: the room that it is in.
        fails: Its failures; null: none.
    """

    room: str | None = Field(default=None, min_length=1)
    fails: SensorFailures | None = None

    # The names of the two states in the table of readings.
    words: ClassVar[tuple[str, str]] = ("ON", "OFF")

    def start(self, home: Home, step_us: int) -> None:
        """Prepare for a run, and check that the watched object exists."""

    def place(self, home: Home) -> str:
        """Return the name of the room in the readings."""
        raise NotImplementedError

    def hold_us(self) -> int:
        """Return the time for which the sensor stays on after its last trigger [us]: its `hold`."""
        return micros(getattr(self, "hold", timedelta(0)))

    def sense(self, view: SensorView, home: Home) -> tuple[I64, I64]:
        """Return the triggering steps, ascending, and the user of each: int64 (n,) each."""
        raise NotImplementedError


def first_cause(triggered: Bool, first: int) -> tuple[I64, I64]:
    """Return the steps in which a body triggers a sensor, and the lowest row of those that do.

    Args:
        triggered: Whether each body triggers it at each step, bool (bodies, steps).
        first: The step of the first column.

    Example:
        >>> steps, bodies = first_cause(np.array([[0, 0, 1], [0, 1, 1]], bool), 100)
        >>> steps.tolist(), bodies.tolist()
        ([101, 102], [1, 0])
    """
    columns = np.flatnonzero(triggered.any(axis=0))
    return columns + first, np.argmax(triggered[:, columns], axis=0).astype(np.int64)


class SensorState:
    """The state of a sensor between spans.

    Attributes:
        hold: Number of steps for which it stays on after the last trigger.
        on: Whether it is on.
        last: The last step that triggered it.
        user: The index of the user that switched it on; -1: none.
    """

    def __init__(self, hold_steps: int) -> None:
        self.hold = hold_steps
        self.on = False
        self.last = 0
        self.user = -1

    def read(self, steps: I64, users: I64, end: int) -> list[SensorReading]:
        """Return the readings before step `end`, given the triggering steps, and their users.

        Args:
            steps: Ascending, int64 (n,).
            users: Index of the user of each step, int64 (n,).
            end: The step after the span.
        """
        readings: list[SensorReading] = []
        # The sensor stays on between triggers no farther apart than its hold.
        quiet = np.flatnonzero(np.diff(steps) > self.hold + 1)
        begins = [0, *(quiet + 1).tolist()] if len(steps) else []
        ends = [*quiet.tolist(), len(steps) - 1]
        for i, j in zip(begins, ends, strict=False):
            if self.on and steps[i] > self.last + self.hold + 1:
                readings.append(self._off())
            if not self.on:
                self.on = True
                self.user = int(users[i])
                readings.append(SensorReading(int(steps[i]), True, self.user))
            self.last = int(steps[j])
        if self.on and self.last + self.hold + 1 < end:
            readings.append(self._off())
        return readings

    def _off(self) -> SensorReading:
        self.on = False
        return SensorReading(self.last + self.hold + 1, False, self.user)


class FurnitureSensor(Sensor):
    """Base of sensors of an object of the floor plan, in whose room they are.

    Attributes:
        of: The name of the object of the floor plan that it is in.
        hold: Time without anybody there after which it turns off.
    """

    of: str
    hold: Duration = timedelta(seconds=0)

    def start(self, home: Home, step_us: int) -> None:
        """Check that the object exists."""
        home.object(self.of)

    def place(self, home: Home) -> str:
        """Return the room of the object; empty if it is in none."""
        middle = home.object(self.of).footprint.centroid
        room = home.plan.room_at(middle.x, middle.y)
        return room.name if room else ""
