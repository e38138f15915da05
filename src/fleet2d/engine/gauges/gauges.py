"""Gauges: they measure the signals of expectations during a run, block by block."""

from collections.abc import Callable, Sequence, Set
from typing import Any

import numpy as np

from fleet2d.algorithms.observations import ROBOT
from fleet2d.engine.gauges.block import Block
from fleet2d.entities.behavior import Actor
from fleet2d.entities.equipment import Course
from fleet2d.expectations import states
from fleet2d.expectations.trace import Trace, constant, joined, pulses, shortest
from fleet2d.floorplan.home.home import Home
from fleet2d.kernels import I64, Bool
from fleet2d.kernels.motion import distances_between, distances_to_shape, rooms_at, speeds
from fleet2d.kernels.sight import SightingColumn as Column
from fleet2d.runtime.events import EventKind

# The charge of a battery is rounded down to thousandths; errors of floats must not lower it.
PARTS = 1000
ROUNDING = 1e-9


class Gauge:
    """Measures a signal, block by block.

    Attributes:
        words: The words that each value stands for, if the signal consists of words.
    """

    def __init__(self) -> None:
        """Start without a measured step."""
        self.words: dict[int, Set[str]] = {}
        self._parts: list[Trace] = []

    def take(self, block: Block) -> None:
        """Measure the signal over a block of steps, and append it."""
        self._parts.append(self._measure(block))

    def trace(self, end: int) -> Trace:
        """Return the signal at all steps before a step, up to which all blocks were measured."""
        trace = joined(self._parts)
        self._parts = [trace]
        return trace

    def _measure(self, block: Block) -> Trace:
        raise NotImplementedError


class BodyGauge(Gauge):
    """Base of gauges that measure the poses of a body."""

    def __init__(self, row: int) -> None:
        super().__init__()
        self._row = row

    def _window(self, block: Block) -> Any:
        return block.bodies.window(block.first, block.end)


class DistanceGauge(BodyGauge):
    """Measures the distance of a body from another, or from a shape [m]."""

    def __init__(
        self, row: int, other_row: int | None, shape: Callable[[Home], I64] | None
    ) -> None:
        super().__init__(row)
        self._other_row, self._shape = other_row, shape

    def _measure(self, block: Block) -> Trace:
        window = self._window(block)
        if self._other_row is not None:
            start, value = distances_between(window, self._row, self._other_row)
        else:
            assert self._shape is not None
            start, value = distances_to_shape(window, self._row, self._shape(block.home))
        return Trace(start, value / block.home.plan.lattice.units_per_m, block.end)


class SpeedGauge(BodyGauge):
    """Measures the speed of a body [m/s]: its distance from its place at the step before."""

    def __init__(self, row: int, last_pose: Sequence[int], step_us: int) -> None:
        super().__init__(row)
        self._last_pose = np.array(last_pose, np.int64)
        self._steps_per_s = 1e6 / step_us

    def _measure(self, block: Block) -> Trace:
        start, distance = speeds(self._window(block), self._row, self._last_pose)
        pose = block.bodies.pose_at(self._row, block.end - 1)
        self._last_pose = np.array([pose.x, pose.y, pose.away], np.int64)
        metres = distance / block.home.plan.lattice.units_per_m
        return Trace(start, metres * self._steps_per_s, block.end)


class RoomGauge(BodyGauge):
    """Measures the room of a body by its index; -1 if it is in none or away."""

    def __init__(self, row: int, home: Home) -> None:
        super().__init__(row)
        self.words = {room.index: {room.name, room.type} for room in home.rooms}

    def _measure(self, block: Block) -> Trace:
        runs = block.bodies.runs(self._row, block.first, block.end)
        room = rooms_at(block.home.plan.room_of_place, runs.x, runs.y)
        return shortest(runs.step, np.where(runs.away != 0, -1.0, room), block.end)


class AwayGauge(BodyGauge):
    """Measures whether a body is away."""

    def _measure(self, block: Block) -> Trace:
        runs = block.bodies.runs(self._row, block.first, block.end)
        return shortest(runs.step, (runs.away != 0).astype(np.float64), block.end)


class DoorGauge(Gauge):
    """Measures whether a door is open."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self._number = number

    def _measure(self, block: Block) -> Trace:
        is_open = self._number not in block.home.shut
        return constant(float(is_open), block.first, block.end)


class SwitchGauge(Gauge):
    """Base of gauges of values that change by events, such as an activity or a sensor."""

    def __init__(self, now: float) -> None:
        super().__init__()
        self._now = now

    def _measure(self, block: Block) -> Trace:
        start, value = [block.first], [self._now]
        for step, now in self._changes(block):
            if step > start[-1]:
                start.append(step)
                value.append(now)
            else:
                value[-1] = now
        self._now = value[-1]
        return shortest(np.array(start, np.int64), np.array(value), block.end)

    def _changes(self, block: Block) -> list[tuple[int, float]]:
        """Return the steps of changes and the values from then on, in order."""
        raise NotImplementedError


class SeenGauge(SwitchGauge):
    """Measures whether a body counts as seen by the owner of a camera."""

    def __init__(self, signal: states.CameraCondition, now: bool) -> None:
        super().__init__(float(now))
        self._body, self._owner = signal.body, signal.by

    def _changes(self, block: Block) -> list[tuple[int, float]]:
        begins = (EventKind.USER_SEEN, EventKind.ROBOT_SEEN)
        ends = (EventKind.USER_LOST, EventKind.ROBOT_LOST)
        return [
            (event.step, float(event.event in begins))
            for event in block.events
            if event.entity == self._owner
            and event.detail == self._body
            and event.event in begins + ends
        ]


class ActivityGauge(SwitchGauge):
    """Measures the activity of a user, as a number for each activity."""

    NOTHING = -1.0

    def __init__(self, user: str, now: str | None) -> None:
        super().__init__(self.NOTHING)
        self._user = user
        if now is not None:
            self._now = self._code(now)

    def _code(self, activity: str) -> float:
        code = next((code for code, words in self.words.items() if activity in words), None)
        if code is None:
            code = len(self.words)
            self.words[code] = {activity}
        return float(code)

    def _changes(self, block: Block) -> list[tuple[int, float]]:
        return [
            (event.step, self._code(event.detail))
            for event in block.events
            if event.event == EventKind.ACTIVITY and event.entity == self._user
        ]


class SensorGauge(SwitchGauge):
    """Measures whether a sensor is on."""

    def __init__(self, name: str, now: bool) -> None:
        super().__init__(float(now))
        self._name = name

    def _changes(self, block: Block) -> list[tuple[int, float]]:
        rows = block.readings
        return [
            (row.step, float(row.on)) for row in rows if block.sensors[row.sensor] == self._name
        ]


class EventGauge(Gauge):
    """Counts events at each step."""

    def __init__(self, signal: states.EventHappens) -> None:
        super().__init__()
        self._kind, self._entity, self._detail = signal.kind, signal.entity, signal.detail

    def _measure(self, block: Block) -> Trace:
        steps = [
            event.step
            for event in block.events
            if event.event == self._kind
            and self._entity in (None, event.entity)
            and self._detail in (None, event.detail)
        ]
        return pulses(np.array(steps, np.int64), block.first, block.end)


class BatteryGauge(Gauge):
    """Measures the charge of a robot, plan by plan."""

    def __init__(self, actor: Actor) -> None:
        super().__init__()
        self._courses: list[Course] = []
        self._step_us = actor.clock.step_us
        self.begin_plan(actor)

    def begin_plan(self, actor: Actor) -> None:
        """Add the course of the charge along a new plan."""
        if actor.charge is not None and hasattr(actor, "motion"):
            course = actor.charge.course(actor.motion)
            self._courses = [c for c in self._courses if c.begins[0] < course.begins[0]]
            self._courses.append(course)

    def _measure(self, block: Block) -> Trace:
        moments = np.arange(block.first, block.end, dtype=np.int64) * self._step_us
        begins = np.array([course.begins[0] for course in self._courses], np.int64)
        edges = [0, *np.searchsorted(moments, begins[1:]).tolist(), len(moments)]
        pieces = [
            course.levels(np.maximum(moments[a:b], course.begins[0]))
            for course, a, b in zip(self._courses, edges, edges[1:], strict=False)
        ]
        charge = np.floor(np.concatenate(pieces) * PARTS + ROUNDING) / PARTS
        self._courses = self._courses[-1:]
        return shortest(np.arange(block.first, block.end), charge, block.end)


class PerceivedGauge(Gauge):
    """Measures at which steps a robot perceives a user."""

    def __init__(self, robot: int, user: int) -> None:
        super().__init__()
        self._robot, self._user = robot, user

    def _measure(self, block: Block) -> Trace:
        rows = block.observations
        rows = rows[(rows[:, ROBOT] == self._robot) & (rows[:, Column.IDENTITY] == self._user)]
        return pulses(np.unique(rows[:, Column.STEP]), block.first, block.end)


class ValueGauge(Gauge):
    """Records a number that is passed to `note` whenever it changes; missing before the first."""

    def __init__(self, since: int, read: Callable[[Any], float]) -> None:
        super().__init__()
        self._start, self._value = [since], [float("nan")]
        self._read = read

    def note(self, step: int, source: Any) -> None:
        """Record the value from a step on."""
        while self._start and self._start[-1] >= step:
            self._start.pop()
            self._value.pop()
        self._start.append(step)
        self._value.append(self._read(source))

    def take(self, block: Block) -> None:
        """Do nothing: the values are passed to `note`."""

    def trace(self, end: int) -> Trace:
        """Return the signal at all steps before a step."""
        start, value = np.array(self._start, np.int64), np.array(self._value)
        is_before = start < end
        return shortest(start[is_before], value[is_before], end)


def outline(mask: Bool, side: int) -> I64:
    """Return the edges around some cells: int64 (n, 4), from (x, y) to (x, y) [lattice units].

    Args:
        mask: bool (rows, columns), the cells.
        side: The side of a cell [lattice units].
    """
    padded = np.pad(mask, 1)
    horizontal = [(x0, y, x1, y) for y, x0, x1 in _borders(padded[1:] != padded[:-1])]
    vertical = [(x, y0, x, y1) for x, y0, y1 in _borders((padded[:, 1:] != padded[:, :-1]).T)]
    edges = np.array(horizontal + vertical, np.int64).reshape(-1, 4)
    return edges * side


def _borders(differ: Bool) -> list[tuple[int, int, int]]:
    """Return the runs of true values of each row: row, first column, one past the last column."""
    padded = np.pad(differ, ((0, 0), (1, 1)))
    row, column = np.nonzero(padded[:, 1:] != padded[:, :-1])
    # Columns are shifted by 1, as the cells themselves were padded.
    pairs = zip(row[::2].tolist(), column[::2].tolist(), column[1::2].tolist(), strict=True)
    return [(r, a - 1, b - 1) for r, a, b in pairs]
