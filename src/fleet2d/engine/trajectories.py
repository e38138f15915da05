"""The tables of poses: samples at regular times, and key frames.

Key frames are few, and all poses of a run can be rebuilt from them.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.artifacts.table import (
    KEY_KINDS,
    PLANNED,
    STEP,
    TRACK,
    WALK,
    Column,
    Columns,
    moment_columns,
    time_column,
)
from fleet2d.configuration.units import whole_steps
from fleet2d.engine.basis import Basis, ImmutableRows
from fleet2d.entities.body import Bodies, Pose, Track
from fleet2d.kernels import I64, SUB, Breakpoints, in_radians
from fleet2d.runtime.clock import HOUR_US

X = Column("x", "float64", "m", nullable=True)
Y = Column("y", "float64", "m", nullable=True)
HEADING = Column("heading", "float64", "rad", description="counter-clockwise from +x")


def entity_column(basis: Basis) -> Column:
    """Return the column of bodies, as codes: users, then robots."""
    return Column("entity", "category", categories=tuple(actor.name for actor in basis.actors))


def room_column(basis: Basis) -> Column:
    """Return the column of rooms, as codes."""
    rooms = tuple(room.name for room in basis.home.rooms)
    return Column("room", "category", nullable=True, categories=rooms)


class Samples:
    """Collects the rows of the table of trajectories.

    Attributes:
        count: Number of rows that are not stored yet.
    """

    def __init__(self, basis: Basis) -> None:
        """Start without rows.

        Raises:
            ScenarioError: The interval between samples is not a multiple of the step.
        """
        self._clock = basis.clock
        self._entity = entity_column(basis)
        self._room = room_column(basis)
        self._home = basis.home
        every = basis.scenario.artifacts.trajectories
        if isinstance(every, str):
            self._every = {"off": 0, "every step": 1}[every]
        else:
            self._every = whole_steps(every, self._clock.step_us, "artifacts.trajectories")
        self._blocks: list[I64] = []
        self.count = 0

    def take(self, bodies: Bodies, first: int, end: int) -> None:
        """Collect the samples of the steps from `first` to `end` - 1."""
        if not self._every or first >= end:
            return
        begin = -(-first // self._every) * self._every
        steps = np.arange(begin, end, self._every)
        rows = np.empty((len(steps), len(bodies), 6), np.int64)
        rows[:, :, 0] = steps[:, None]
        rows[:, :, 1] = np.arange(len(bodies))
        if self._every == 1:
            block = bodies.block(first, end)
            rows[:, :, 2] = block.x.T
            rows[:, :, 3] = block.y.T
            rows[:, :, 4] = block.heading.T
            rows[:, :, 5] = block.away.T
        else:
            rows[:, :, 2:] = bodies.poses(steps)
        if rows.size:
            self._blocks.append(rows.reshape(-1, 6))
            self.count += len(steps) * len(bodies)

    def drain(self) -> Columns:
        """Return and remove all collected rows."""
        rows = np.concatenate([np.empty((0, 6), np.int64), *self._blocks])
        rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
        self._blocks = []
        self.count = 0
        step, entity, x, y, heading, away = rows.T
        plan = self._home.plan
        is_away = away.astype(bool)
        xy = plan.lattice.to_metres(rows[:, 2:4])
        xy[is_away] = np.nan
        room = plan.room_of_place[y // SUB, x // SUB].astype(np.int32)
        away_text = "not at home: x, y and room are missing"
        return {
            **moment_columns(self._clock, step),
            self._entity: entity.astype(np.int32),
            X: xy[:, 0],
            Y: xy[:, 1],
            HEADING: in_radians(heading),
            self._room: np.where(is_away, np.int32(-1), room),
            Column("away", "bool", description=away_text): is_away,
        }


# Time between the key frames of a random walk [us].
WALK_KEY_US = HOUR_US
NO_FRAMES = [np.empty(0, np.int64)] * len(Breakpoints._fields)


class KeySegment(NamedTuple):
    """Breakpoints `begin` to `end` - 1 of a track, which are key frames of a body.

    Attributes:
        track: The track.
        begin: The number of the first one.
        end: The number after the last one.
        row: The row of the body.
        kind: The kind of the key frames.
        step: The step at which they take effect; -1: that of their time.
    """

    track: Breakpoints
    begin: int
    end: int
    row: int
    kind: int
    step: int = -1

    def columns(self) -> list[NDArray[Any]]:
        """Return time, x, y, heading and away of its key frames."""
        return [column[self.begin : self.end] for column in self.track]


class KeyFrames:
    """Collects the key frames of a run."""

    def __init__(self, basis: Basis) -> None:
        """Start without key frames."""
        self._clock = basis.clock
        self._entity = entity_column(basis)
        self._home = basis.home
        self._actors = basis.actors
        self._bodies = basis.bodies
        # A random walk is rebuilt by repeating it between the same walls; if these may change, each
        # step is a key frame.
        self._walk_kind = WALK
        self._walk_every = max(1, WALK_KEY_US // basis.clock.step_us)
        if basis.may_change:
            self._walk_kind = TRACK
            self._walk_every = 1
        # Collected breakpoints of the present plan; the plan before the first has none.
        count = len(basis.actors)
        self._emitted = [2] * count
        self._complete_until = [-1] * count  # end of the last plan, if reached
        self._walkers: set[int] = set()  # bodies whose present plan is a random walk
        self._walked = [1] * count  # step before which a walk is collected
        self._moved: set[int] = set()  # bodies that were put elsewhere since their last plan
        self._segments: ImmutableRows[KeySegment] = ImmutableRows()
        self._rows = 0
        self._end = 0  # key frames before this step are collected on storing

    @property
    def count(self) -> int:
        """Approximate number of rows not stored yet; many small segments take more memory."""
        return self._rows + 8 * len(self._segments)

    def end_plan(self, row: int, step: int) -> None:
        """Collect the end of the plan that is replaced at `step`."""
        self.pass_by(row, step)
        motion = self._actors[row].motion
        self._complete_until[row] = -1
        if not isinstance(motion, Track):
            self._walk_on(row, step)
        elif self._emitted[row] < len(motion.breakpoints.time):
            self.break_off(row, step)
        else:
            self._complete_until[row] = int(motion.breakpoints.time[-1])

    def begin_plan(self, row: int, step: int) -> None:
        """Note the beginning of a body's plan, which was made at `step`."""
        moment = step * self._clock.step_us
        # A plan that begins at the end of the last one needs no key frame there.
        self._walked[row] = step + 1
        is_joined = self._complete_until[row] == moment and step > 0 and row not in self._moved
        self._emitted[row] = int(is_joined)
        self._moved.discard(row)
        actor = self._actors[row]
        if isinstance(actor.motion, Track):
            self._walkers.discard(row)
        else:
            self._walkers.add(row)
            self._segments.append(_key(row, self._walk_kind, moment, actor.state))

    def move_body(self, row: int, step: int) -> None:
        """Begin the next plan of a body with a key frame, since it doesn't continue the last one.

        A random walk ends with a key frame of its own, where the body was before the move.
        """
        self._moved.add(row)
        actor = self._actors[row]
        if self._walk_kind == WALK and not isinstance(actor.motion, Track):
            self._walk_on(row, step)
            self._segments.append(_key(row, WALK, step * self._clock.step_us, actor.state))

    def pass_by(self, row: int, step: int) -> None:
        """Collect the breakpoints of the present plan that are reached up to a step."""
        motion = self._actors[row].motion
        if not isinstance(motion, Track):
            return
        moment = step * self._clock.step_us
        track = motion.breakpoints
        begin = self._emitted[row]
        if begin < len(track.time) and track.time[begin] <= moment:
            end = int(track.time.searchsorted(moment, side="right"))
            self._segments.append(KeySegment(track, begin, end, row, TRACK))
            self._rows += end - begin
            self._emitted[row] = end

    def break_off(self, row: int, step: int) -> None:
        """Collect the planned end of the present segment."""
        motion = self._actors[row].motion
        begin = self._emitted[row]
        if isinstance(motion, Track) and begin < len(motion.breakpoints.time):
            end = KeySegment(motion.breakpoints, begin, begin + 1, row, PLANNED, step)
            self._segments.append(end)

    def take(self, end: int) -> None:
        """Collect random walks up to step `end` - 1; `collect` takes the other key frames.

        The poses of a random walk are forgotten afterwards, the breakpoints of a plan are not.
        """
        for row in sorted(self._walkers):
            self._walk_on(row, end)
        self._end = end

    def collect(self) -> None:
        """Collect the key frames of all bodies before the step up to which they were taken."""
        for row in range(len(self._actors)):
            self.pass_by(row, self._end - 1)

    def _walk_on(self, row: int, end: int) -> None:
        """Collect the states of a random walk up to step `end` - 1."""
        if isinstance(self._actors[row].motion, Track):
            return
        every = self._walk_every
        first = self._walked[row]
        for step in range(-(-first // every) * every, end, every):
            moment = step * self._clock.step_us
            pose = self._bodies.pose_at(row, step)
            self._segments.append(_key(row, self._walk_kind, moment, pose))
        self._walked[row] = max(first, end)

    def drain(self) -> Columns:
        """Return and remove all key frames so far."""
        self.collect()
        segments = self._segments
        self._segments = ImmutableRows()
        self._rows = 0
        parts = [NO_FRAMES, *(segment.columns() for segment in segments)]
        time, x, y, heading, away = map(np.concatenate, zip(*parts, strict=True))
        marks = [(segment.row, segment.kind, segment.step) for segment in segments]
        counts = [segment.end - segment.begin for segment in segments]
        numbers = np.array(marks, np.int64).reshape(-1, 3)
        entity, kind, step = np.repeat(numbers, counts, axis=0).T
        step = np.where(step < 0, -(-time // self._clock.step_us), step)
        order = np.lexsort((entity, step))
        xy = self._home.lattice.to_metres(np.column_stack([x, y])[order])
        away_text = "not at home: x and y are where it left"
        return {
            STEP: step[order],
            time_column(self._clock.zone): self._clock.moments(time[order]),
            self._entity: entity[order].astype(np.int32),
            Column("kind", "category", categories=KEY_KINDS): kind[order].astype(np.int32),
            X: xy[:, 0],
            Y: xy[:, 1],
            HEADING: in_radians(heading[order]),
            Column("away", "bool", description=away_text): away[order].astype(bool),
        }


def _key(row: int, kind: int, time_us: int, pose: Pose) -> KeySegment:
    """Return the key frame of a random walk at a pose."""
    moment, x, y, heading = np.array([time_us, *pose[:3]], np.int64)[:, None]
    away = np.array([pose.away], np.uint8)
    return KeySegment(Breakpoints(moment, x, y, heading, away), 0, 1, row, kind)
