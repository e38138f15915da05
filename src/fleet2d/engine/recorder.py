"""The recorder of a run: which tables it has, and the rows for them.

Rows are collected over spans and stored in the order of (step, entity), so that the tables don't
depend on the spans of a run.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate
from typing import Any

import numpy as np

from fleet2d.algorithms.history import SensorRow
from fleet2d.algorithms.observations import (
    Activities,
    NearestRooms,
    Observations,
    SightingTable,
    Truth,
)
from fleet2d.artifacts.table import KEY_KINDS, Column, TableSpec
from fleet2d.engine.basis import Basis, ImmutableRows
from fleet2d.engine.cameras import Cameras
from fleet2d.engine.sensors import Sensors
from fleet2d.engine.trajectories import HEADING, STEP, TIME, KeyFrames, Samples, X, Y
from fleet2d.floorplan.placed_objects import POSTURES
from fleet2d.kernels import I8, I32, I64, NOBODY, UNKNOWN_TRUTH
from fleet2d.runtime.events import HOME, RANKS, Event, EventKind


def table_specs(
    basis: Basis, cameras: Sequence[Cameras], sensors: Sensors, *, activities: bool
) -> list[TableSpec]:
    """Return the tables that a run stores.

    Args:
        basis: The basis of the run.
        cameras: The cameras of robots.
        sensors: The sensors of the home.
        activities: Whether robots perceive activities.
    """
    scenario = basis.scenario
    settings = scenario.artifacts
    users = tuple(scenario.users)
    robots = tuple(scenario.robots)
    rooms = tuple(room.name for room in basis.home.rooms)
    entity = Column("entity", "category", categories=(*users, *robots))
    room = Column("room", "category", nullable=True, categories=rooms)
    specs = []
    if settings.trajectories != "off":
        away = Column("away", "bool", description="not at home: x, y and room are missing")
        specs.append(TableSpec("trajectories", (STEP, TIME, entity, X, Y, HEADING, room, away)))
    if settings.key_frames:
        kind = Column("kind", "category", categories=KEY_KINDS)
        away = Column("away", "bool", description="not at home: x and y are where it left")
        specs.append(TableSpec("key_frames", (STEP, TIME, entity, kind, X, Y, HEADING, away)))
    if settings.observations and users and robots:
        specs.append(_observation_table(basis, room, cameras, activities))
    if settings.events:
        event = Column("event", "category")
        detail = Column("detail", "string")
        user = Column("user", "category", nullable=True, categories=users)
        user_columns = (user,) if users else ()
        entities = entity
        if basis.may_change:
            text = "what did it, or what it happened to; none: the home itself"
            names = (*users, *robots, *scenario.objects)
            entities = Column(
                "entity", "category", categories=names, nullable=True, description=text
            )
        specs.append(TableSpec("events", (STEP, TIME, entities, event, *user_columns, detail)))
    if settings.decisions:
        specs.append(TableSpec("decisions", (STEP, TIME, entity, *DECISION)))
    if sensors.names:  # in the layout of the CASAS smart homes
        where = Column("room", "category")
        state = Column("state", "category")
        sensor = Column("sensor", "category", categories=tuple(sensors.names))
        activity = Column("activity", "string", description="what the person does, if known")
        specs.append(TableSpec("sensors", (STEP, TIME, where, sensor, state, activity)))
    return specs


def camera_names(cameras: Sequence[Cameras]) -> tuple[str, ...]:
    """Return the names of all cameras if the table of observations has to name them.

    It does if a robot has several cameras, or cameras that err.
    """
    if not any(group.errs or len(group.names) > 1 for group in cameras):
        return ()
    return tuple(dict.fromkeys(name for group in cameras for name in group.names))


def _observation_table(
    basis: Basis, room: Column, groups: Sequence[Cameras], activities: bool
) -> TableSpec:
    """Return the table of what was perceived, with the truth if that can differ."""
    cameras = camera_names(groups)
    users = tuple(basis.scenario.users)
    robots = tuple(basis.scenario.robots)
    robot = Column("robot", "category", categories=robots)
    user = Column("user", "category", nullable=bool(cameras), categories=users)
    columns = [STEP, TIME, robot, user, X, Y, room]
    if cameras:
        posture = Column("posture", "category", categories=POSTURES)
        true = {
            column.name: replace(column, name=f"true_{column.name}", nullable=True)
            for column in (user, X, Y, HEADING, posture)
        }
        camera = Column("camera", "category", categories=tuple(cameras))
        columns += [HEADING, posture, camera, *true.values()]
    if not all(group.knows_truth for group in groups):
        text = "whether it is known who was there: not for what real robots perceived"
        columns.append(Column("truth_known", "bool", description=text))
    if activities:
        text = "what the user does, if a behavior says so"
        for name in ("activity", "true_activity"):
            columns.append(Column(name, "category", nullable=True, description=text))
    return TableSpec("observations", tuple(columns))


DECISION = (
    Column("behavior", "category", nullable=True, description="the one whose plan it follows"),
    Column("reason", "string", description="the last note of the plan"),
    Column(
        "next_step",
        "int64",
        nullable=True,
        description="when it decides next if nothing interrupts it",
    ),
)
# Events whose detail is a user, who has a column of their own.
USER_EVENTS = frozenset({EventKind.USER_LOST, EventKind.USER_SEEN})
ACTIVITY = EventKind.ACTIVITY.value
# Rows that are collected before they are stored: so many, or more with many bodies.
MAX_ROWS = 1 << 16
# Sightings that repeat another one take as much memory as one other row, if they are so many.
REPEATS_PER_ROW = 8
UNSTORED = (
    "changes of the home are not in the table of events, as the scenario has none: announce them,"
    " like changes: [{at: 0 s, lights: all, turn: on}]"
)
ROWS_PER_BODY = 128


class Recorder:
    """Collects the rows of a run.

    Attributes:
        activities: The activities of users so far.
        wall_s: Wall time of storing [s].
        keeps_none: Whether rows are stored at once, for those who listen to them.
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
        self.home, self.bodies = basis.home, basis.bodies
        self._samples, self._keys = Samples(basis), KeyFrames(basis)
        senses = {(g.index, c): s for g in cameras for c, s in enumerate(g.activity_senses)}
        self.activities = Activities(basis.bodies.users, senses)
        perceived = self.activities.are_perceived
        for spec in table_specs(basis, cameras, sensors, activities=perceived):
            self.store.add_table(spec)
        self._tables = set(self.store.names)
        self._users = {actor.name: row for row, actor in enumerate(basis.users)}
        entities = [*(actor.name for actor in basis.actors), *basis.scenario.objects]
        self._rows = {name: row for row, name in enumerate(entities)} | {HOME: -1}
        self._stores_home = basis.may_change
        self._events: ImmutableRows[Event] = ImmutableRows()
        self._actors = basis.actors
        self._decisions: list[tuple[int, int, str, str, int | None]] = []
        self._observations: ImmutableRows[SightingTable] = ImmutableRows()
        self._sensors = sensors
        self._readings = list[SensorRow]()
        self._rooms = NearestRooms(basis.home.plan)
        names = camera_names(cameras)
        self._camera_codes = {g.index: [names.index(n) for n in g.names] for g in cameras if names}
        self._has_unknown_truth = not all(group.knows_truth for group in cameras)
        self._count = 0  # observations and readings
        self._most = max(MAX_ROWS, ROWS_PER_BODY * len(basis.actors))
        self.wall_s = 0.0
        self.keeps_none = False

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
        begun = [event for event in events if event[2] == ACTIVITY and event[1] in self._users]
        if not self.activities.are_perceived:  # then only the present one is asked for
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
        if count > self._most or self.keeps_none:
            self.drain()

    def end(self, step: int, rows: int) -> None:
        """Collect the ends of the present plans, as the run ends before `step`; store all rows."""
        if "key_frames" in self._tables:
            self._keys.collect()
            for row in range(rows):
                # Not at the last step, whose rows may be stored already: the order would be wrong.
                self._keys.break_off(row, step)
        self.drain()

    def drain(self) -> None:
        """Append all collected rows to the store."""
        began = time.perf_counter()
        self._samples.store()
        if "key_frames" in self._tables:
            self._keys.store()
        self._store_observations()
        self._store_events()
        self._store_decisions()
        self._store_readings()
        self._count = 0
        self.wall_s += time.perf_counter() - began

    def _store_observations(self) -> None:
        blocks = self._observations
        self._observations = ImmutableRows()
        while blocks:  # so many rows at a time that their columns take little memory
            counts = accumulate(map(len, blocks))
            size = next((k for k, count in enumerate(counts, 1) if count > MAX_ROWS), len(blocks))
            self._store_blocks(blocks[:size])
            del blocks[:size]

    def _store_blocks(self, blocks: Sequence[SightingTable]) -> None:
        o = Observations(self.home.plan, self._rooms, blocks, self.activities)
        columns: dict[str, Any] = {
            **self._times(o.step),
            "robot": o.robot,
            "user": o.user,
            "x": o.x,
            "y": o.y,
            "room": o.room.astype(np.int32),
        }
        if self._camera_codes:
            t = Truth.behind(o)
            is_user = t.user >= 0
            columns |= {
                "heading": o.heading,
                "posture": o.posture.astype(np.int32),
                "camera": self._cameras(o.robot, o.camera),
                "true_user": np.where(is_user, t.user, np.int32(NOBODY)),
                "true_x": np.where(is_user, t.x, np.nan),
                "true_y": np.where(is_user, t.y, np.nan),
                "true_heading": np.where(is_user, t.heading, np.nan),
                "true_posture": np.where(is_user, t.posture, -1).astype(np.int32),
            }
            if self._has_unknown_truth:
                columns["truth_known"] = t.user != UNKNOWN_TRUTH
            if self.activities.are_perceived:
                columns |= {"activity": o.activity.tolist(), "true_activity": t.activity.tolist()}
        self.store.append("observations", **columns)

    def _cameras(self, robot: I32, camera: I8) -> I32:
        """Return the codes of cameras from their indices among the cameras of their robot."""
        most = 1 + max(map(len, self._camera_codes.values()))
        codes = np.zeros((len(self.bodies), most), np.int32)
        for index, names in self._camera_codes.items():
            codes[index, : len(names)] = names
        return codes[robot, camera]

    def _store_events(self) -> None:
        if not self._events:
            return
        users = self._users
        step, entity, kind, detail = zip(*self._events, strict=True)
        self._events = ImmutableRows()
        steps = np.array(step, np.int64)
        rows = np.array([self._rows[name] for name in entity], np.int32)
        ranks = np.array([RANKS.get(name, 0) for name in kind], np.int8)
        order = np.lexsort((ranks, rows, steps))
        if not self._stores_home and rows.min() < 0:  # a change by hand, which nobody announced
            order = order[rows[order] >= 0]
            if UNSTORED not in self.store.manifest.notes:
                self.store.manifest.notes.append(UNSTORED)
        kinds, details = ([column[i] for i in order.tolist()] for column in (kind, detail))
        of_users = [i for i, name in enumerate(kinds) if name in USER_EVENTS]
        columns: dict[str, Any] = self._times(steps[order])
        if users:
            user = np.full(len(kinds), -1, np.int32)
            user[of_users] = [users.get(details[i], -1) for i in of_users]
            columns["user"] = user
        for i in of_users:
            details[i] = ""
        words = {"event": list(map(str, kinds)), "detail": details}
        self.store.append("events", **columns, entity=rows[order], **words)

    def _store_decisions(self) -> None:
        if not self._decisions:
            return
        # Who gives way at the step of its decision decides twice: the last one counts.
        last = {entry[:2]: entry for entry in self._decisions}
        self._decisions = []
        entries = [last[key] for key in sorted(last)]
        step, row, behavior, reason, next_step = zip(*entries, strict=True)
        missing = np.array([at is None for at in next_step])
        self.store.append(
            "decisions",
            **self._times(np.array(step, np.int64)),
            entity=np.array(row, np.int32),
            behavior=[name or None for name in behavior],
            reason=list(reason),
            next_step=np.ma.array([at or 0 for at in next_step], np.int64, mask=missing),
        )

    def _store_readings(self) -> None:
        if not self._readings:
            return
        step, sensor, on, activity = zip(*self._readings, strict=True)
        self._readings = []
        rooms = self._sensors.rooms
        words = self._sensors.words
        self.store.append(
            "sensors",
            **self._times(np.array(step, np.int64)),
            room=[rooms[number] for number in sensor],
            sensor=np.array(sensor, np.int32),
            state=[words[number][not is_on] for number, is_on in zip(sensor, on, strict=True)],
            activity=list(activity),
        )

    def _times(self, step: I64) -> dict[str, Any]:
        return {"step": step, "time": self.clock.times(step)}
