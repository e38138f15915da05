"""The recorder of a run: its tables, and their rows.

Rows are collected over spans and stored in the order of (step, entity), so that the tables don't
depend on the spans of a run.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.history import SensorRow
from fleet2d.algorithms.observations import (
    Activities,
    NearestRooms,
    Observations,
    SightingTable,
    Truth,
)
from fleet2d.artifacts.table import Column, Columns, Repeated, TableSpec, moment_columns
from fleet2d.engine.basis import Basis, ImmutableRows
from fleet2d.engine.cameras import NOTHING, Cameras
from fleet2d.engine.sensors import Sensors
from fleet2d.engine.trajectories import (
    HEADING,
    KeyFrames,
    Samples,
    X,
    Y,
    entity_column,
    room_column,
)
from fleet2d.floorplan.placed_objects import POSTURES
from fleet2d.kernels import I8, I32, NOBODY, UNKNOWN_TRUTH
from fleet2d.runtime.events import HOME, RANKS, Event, EventKind

# These describe columns.
ANY_ENTITY = "what did it, or what it happened to; none: the home itself"
TRUTH_KNOWN = "whether it is known who was there: not for what real robots perceived"
ACTIVITY_SAID = "what the user does, if a behavior says so"
# Events with a user as their detail, which is stored in a column of its own.
USER_EVENTS = frozenset({EventKind.USER_LOST, EventKind.USER_SEEN})
# This many rows are collected before they are stored, or more with many bodies.
MAX_ROWS = 1 << 16
# This many repeated sightings take as much memory as one other row.
REPEATS_PER_ROW = 8
UNSTORED = (
    "changes of the home are not in the table of events, as the scenario has none: announce them,"
    " like script: [{at: 0 s, lights: all, turn: on}]"
)
ROWS_PER_BODY = 128


class Recorder:
    """Collects the rows of a run.

    Attributes:
        activities: The activities of users so far.
        wall_s: Wall time of storing [s].
        flushes_every_span: Whether rows are stored at once, for listeners.
    """

    def __init__(self, basis: Basis, cameras: Sequence[Cameras], sensors: Sensors) -> None:
        """Add the tables of the run to its store.

        Args:
            basis: The basis of the run.
            cameras: The cameras of robots.
            sensors: The sensors of the home.
        """
        self.store = basis.store
        self.clock = basis.clock
        self.home = basis.home
        self.bodies = basis.bodies
        self._samples = Samples(basis)
        self._keys = KeyFrames(basis)
        senses = {(g.index, c): s for g in cameras for c, s in enumerate(g.activity_senses)}
        self.activities = Activities(basis.bodies.users, senses)
        scenario = basis.scenario
        self._user_names = tuple(scenario.users)
        self._robot_names = tuple(scenario.robots)
        self._users = {name: row for row, name in enumerate(self._user_names)}
        entities = [*(actor.name for actor in basis.actors), *scenario.objects]
        self._rows = {name: row for row, name in enumerate(entities)} | {HOME: -1}
        self._entity = entity_column(basis)
        self._room = room_column(basis)
        self._event_entity = self._entity
        if basis.may_change:
            self._event_entity = replace(
                self._entity, categories=tuple(entities), nullable=True, description=ANY_ENTITY
            )
        self._stores_home = basis.may_change
        self._events: ImmutableRows[Event] = ImmutableRows()
        self._actors = basis.actors
        self._decisions: list[tuple[int, int, str, str, int | None]] = []
        self._observations: ImmutableRows[SightingTable] = ImmutableRows()
        self._sensors = sensors
        self._readings = list[SensorRow]()
        self._rooms = NearestRooms(basis.home.plan)
        self._camera_names = camera_names(cameras)
        self._camera_codes: dict[int, list[int]] = {}
        if self._camera_names:
            for group in cameras:
                codes = [self._camera_names.index(name) for name in group.names]
                self._camera_codes[group.index] = codes
        self._has_unknown_truth = not all(group.knows_truth for group in cameras)
        self._count = 0  # number of observations and readings
        self._most = max(MAX_ROWS, ROWS_PER_BODY * len(basis.actors))
        self.wall_s = 0.0
        self.flushes_every_span = False
        settings = scenario.artifacts
        is_stored = {
            "trajectories": settings.trajectories != "off",
            "key_frames": settings.key_frames,
            "observations": settings.observations and scenario.users and scenario.robots,
            "events": settings.events,
            "decisions": settings.decisions,
            "sensors": sensors.names,
        }
        self._tables = [name for name, is_on in is_stored.items() if is_on]
        for name in self._tables:
            self.store.add_table(TableSpec(name, tuple(self._drain(name))))

    def _drain(self, table: str) -> Columns:
        """Return and remove the collected rows of a table."""
        drains = {
            "trajectories": self._samples.drain,
            "key_frames": self._keys.drain,
            "observations": self._drain_observations,
            "events": self._drain_events,
            "decisions": self._drain_decisions,
            "sensors": self._drain_readings,
        }
        return drains[table]()

    def before_plan(self, row: int, step: int) -> None:
        """Collect the end of the plan that is replaced at `step`."""
        if "key_frames" in self._tables:
            self._keys.end_plan(row, step)

    def after_plan(self, row: int, step: int) -> None:
        """Collect the beginning of a body's plan, which was made at `step`."""
        if "key_frames" in self._tables:
            self._keys.begin_plan(row, step)
        if "decisions" in self._tables:
            actor = self._actors[row]
            self._decisions.append((step, row, *actor.reason(), actor.asked_at))

    def move_body(self, row: int, step: int) -> None:
        """Note that a body is put elsewhere, so that its next plan begins with a key frame."""
        self._keys.move_body(row, step)

    def take_events(self, events: Sequence[Event]) -> None:
        """Collect events."""
        if "events" in self._tables:
            self._events += events
        activities = [event for event in events if event[2] == EventKind.ACTIVITY]
        begun = [event for event in activities if event[1] in self._users]
        if not self.activities.are_perceived:  # only the present activity is needed then
            begun = list({event[1]: event for event in begun}.values())
        for step, entity, _, detail in begun:
            self.activities.begin(self._users[entity], step, detail)

    def take(
        self, first: int, end: int, observations: SightingTable, readings: Sequence[SensorRow]
    ) -> None:
        """Collect the rows of the steps from `first` to `end` - 1.

        Args:
            first: First step.
            end: One past the last step.
            observations: Observations of robots, in order.
            readings: Readings of sensors, in order.
        """
        self._samples.take(self.bodies, first, end)
        if "key_frames" in self._tables:
            self._keys.take(end)
        if "observations" in self._tables and len(observations):
            self._observations.append(observations)
        self._readings += readings
        self._count += len(observations.distinct) + len(observations) // REPEATS_PER_ROW
        self._count += len(readings)
        count = self._count + self._samples.count + self._keys.count
        count += len(self._events) + len(self._decisions)
        if count > self._most or self.flushes_every_span:
            self.drain()

    def end(self, step: int, rows: int) -> None:
        """Collect the ends of the present plans, as the run ends before `step`; store all rows."""
        if "key_frames" in self._tables:
            self._keys.collect()
            for row in range(rows):
                # Rows of the last step may be stored already, so these come after it.
                self._keys.break_off(row, step)
        self.drain()

    def drain(self) -> None:
        """Append all collected rows to the store."""
        began = time.perf_counter()
        for name in self._tables:
            self.store.add_rows(name, self._drain(name))
        while self._observations:
            self.store.add_rows("observations", self._drain_observations())
        self._count = 0
        self.wall_s += time.perf_counter() - began

    def _drain_observations(self) -> Columns:
        """Return and remove observations, few enough for their columns to take little memory."""
        counts = accumulate(map(len, self._observations))
        size = next((k for k, count in enumerate(counts, 1) if count > MAX_ROWS), None)
        seen = SightingTable.joined(self._observations[:size] or [NOTHING])
        del self._observations[:size]
        columns = moment_columns(self.clock, seen.step)
        # Most rows repeat an earlier one but for the step, so columns are made of distinct rows.
        index = seen.index.astype(np.int64)
        o = self._seen(SightingTable.of_rows(seen.distinct))
        for column, values in self._columns_of(o).items():
            columns[column] = Repeated(values, index)
        if self._camera_names and self.activities.are_perceived:
            o = self._seen(seen)
            activity = Column("activity", "category", nullable=True, description=ACTIVITY_SAID)
            columns[activity] = o.activity.tolist()
            columns[_true(activity)] = Truth.behind(o).activity.tolist()
        return columns

    def _seen(self, table: SightingTable) -> Observations:
        return Observations(self.home.plan, self._rooms, [table], self.activities)

    def _columns_of(self, o: Observations) -> dict[Column, NDArray[Any]]:
        """Return the columns of observations that don't depend on the step."""
        has_cameras = bool(self._camera_names)
        user = Column("user", "category", nullable=has_cameras, categories=self._user_names)
        columns: dict[Column, NDArray[Any]] = {
            Column("robot", "category", categories=self._robot_names): o.robot,
            user: o.user,
            X: o.x,
            Y: o.y,
            self._room: o.room.astype(np.int32),
        }
        if not has_cameras:
            return columns
        t = Truth.behind(o)
        is_user = t.user >= 0
        posture = Column("posture", "category", categories=POSTURES)
        camera = Column("camera", "category", categories=self._camera_names)
        columns |= {
            HEADING: o.heading,
            posture: o.posture.astype(np.int32),
            camera: self._cameras(o.robot, o.camera),
            _true(user): np.where(is_user, t.user, np.int32(NOBODY)),
            _true(X): np.where(is_user, t.x, np.nan),
            _true(Y): np.where(is_user, t.y, np.nan),
            _true(HEADING): np.where(is_user, t.heading, np.nan),
            _true(posture): np.where(is_user, t.posture, -1).astype(np.int32),
        }
        if self._has_unknown_truth:
            known = Column("truth_known", "bool", description=TRUTH_KNOWN)
            columns[known] = t.user != UNKNOWN_TRUTH
        return columns

    def _cameras(self, robot: I32, camera: I8) -> I32:
        """Return the codes of cameras from their indices among the cameras of their robot."""
        most = 1 + max(map(len, self._camera_codes.values()))
        codes = np.zeros((len(self.bodies), most), np.int32)
        for index, names in self._camera_codes.items():
            codes[index, : len(names)] = names
        return codes[robot, camera]

    def _drain_events(self) -> Columns:
        step, entity, kind, detail = _transposed(self._events, 4)
        self._events = ImmutableRows()
        steps = np.array(step, np.int64)
        rows = np.array([self._rows[name] for name in entity], np.int32)
        ranks = np.array([RANKS.get(name, 0) for name in kind], np.int8)
        order = np.lexsort((ranks, rows, steps))
        if not self._stores_home and (rows < 0).any():  # a change by hand
            order = order[rows[order] >= 0]
            if UNSTORED not in self.store.manifest.notes:
                self.store.manifest.notes.append(UNSTORED)
        ordered = order.tolist()
        kinds = [str(kind[i]) for i in ordered]
        details = [detail[i] for i in ordered]
        of_users = [i for i, name in enumerate(kinds) if name in USER_EVENTS]
        user = np.full(len(kinds), -1, np.int32)
        user[of_users] = [self._users.get(details[i], -1) for i in of_users]
        for i in of_users:
            details[i] = ""
        columns = moment_columns(self.clock, steps[order])
        columns[self._event_entity] = rows[order]
        columns[Column("event", "category")] = kinds
        if self._users:
            user_column = Column("user", "category", nullable=True, categories=self._user_names)
            columns[user_column] = user
        columns[Column("detail", "string")] = details
        return columns

    def _drain_decisions(self) -> Columns:
        # A body that gives way at the step of its decision decides twice: the last one counts.
        last = {entry[:2]: entry for entry in self._decisions}
        self._decisions = []
        entries = [last[key] for key in sorted(last)]
        step, row, behavior, reason, next_step = _transposed(entries, 5)
        steps = np.array(step, np.int64)
        missing = np.array([at is None for at in next_step], np.bool_)
        who = "the one whose plan it follows"
        when = "when it decides next if nothing interrupts it"
        behaviors = [name or None for name in behavior]
        next_steps = np.ma.array([at or 0 for at in next_step], np.int64, mask=missing)
        return {
            **moment_columns(self.clock, steps),
            self._entity: np.array(row, np.int32),
            Column("behavior", "category", nullable=True, description=who): behaviors,
            Column("reason", "string", description="the last note of the plan"): list(reason),
            Column("next_step", "int64", nullable=True, description=when): next_steps,
        }

    def _drain_readings(self) -> Columns:
        """Return and remove readings, in the layout of the CASAS smart homes."""
        step, sensor, on, activity = _transposed(self._readings, 4)
        self._readings = []
        steps = np.array(step, np.int64)
        rooms = self._sensors.rooms
        words = self._sensors.words
        states = [words[number][not is_on] for number, is_on in zip(sensor, on, strict=True)]
        names = tuple(self._sensors.names)
        said = "what the person does, if known"
        return {
            **moment_columns(self.clock, steps),
            Column("room", "category"): [rooms[number] for number in sensor],
            Column("sensor", "category", categories=names): np.array(sensor, np.int32),
            Column("state", "category"): states,
            Column("activity", "string", description=said): list(activity),
        }


def camera_names(cameras: Sequence[Cameras]) -> tuple[str, ...]:
    """Return the names of all cameras if the table of observations has to name them.

    They are needed if a robot has several cameras, or cameras that err.
    """
    if not any(group.errs or len(group.names) > 1 for group in cameras):
        return ()
    return tuple(dict.fromkeys(name for group in cameras for name in group.names))


def _true(column: Column) -> Column:
    """Return the column of the true value behind a perceived one."""
    return replace(column, name=f"true_{column.name}", nullable=True)


def _transposed(rows: Sequence[tuple[Any, ...]], width: int) -> Sequence[tuple[Any, ...]]:
    """Return the columns of rows of some width; empty ones without rows."""
    return list(zip(*rows, strict=True)) or [()] * width
