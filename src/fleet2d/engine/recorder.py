"""What a run writes down: samples, key frames, observations and events, in an order of their own.

Rows are gathered over spans and handed to the store sorted by (step, entity), so that a table is
the same however the run was cut into spans.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.activities import ROBOT, TOLD, Activities
from fleet2d.algorithms.history import SensorRow
from fleet2d.algorithms.observations import (
    OBSERVATION,
    NearestRooms,
    perceived,
    truth,
)
from fleet2d.artifacts.settings import ArtifactSettings
from fleet2d.artifacts.store import RunStore
from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.clock import Clock
from fleet2d.engine.buckets import Eye, PoseBlock
from fleet2d.engine.changes import Happened
from fleet2d.engine.sensors import Sensors
from fleet2d.entities.actor import Actor
from fleet2d.entities.plan import Track
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.home import Home
from fleet2d.kernels.headings import in_radians
from fleet2d.kernels.look import SIGHTING
from fleet2d.kernels.look import STEP as STEP_COLUMN
from fleet2d.kernels.mesh import SUB
from fleet2d.kernels.motion import Breakpoints
from fleet2d.sight.perception import POSTURES
from fleet2d.units import micros

# How a row of key_frames is to be read: a breakpoint that was reached, the end of a segment that
# was broken off before it, or a state from which a random walk is drawn on.
TRACK, PLANNED, WALK = 0, 1, 2
KEY_KINDS = ("track", "planned", "walk")
# A random walk is rebuilt from the last hour's key frame.
WALK_KEY_US = 3_600_000_000
# Rows gathered before they go to the store.
GATHERED = 1 << 15

STEP = Column("step", "step", description="step at which the row takes effect")
TIME = Column("time", "time", description="local time")
X = Column("x", "float64", "m", nullable=True)
Y = Column("y", "float64", "m", nullable=True)
HEADING = Column("heading", "float64", "rad", description="counter-clockwise from +x")


def table_specs(
    users: Sequence[str],
    robots: Sequence[str],
    rooms: Sequence[str],
    settings: ArtifactSettings,
    objects: Sequence[str] = (),
    *,
    changes: bool = False,
    cameras: Sequence[str] = (),
    activities: bool = False,
) -> list[TableSpec]:
    """Return the tables that a run with these settings stores; `cameras` are told_cameras()."""
    entity = Column("entity", "category", categories=(*users, *robots))
    room = Column("room", "category", nullable=True, categories=tuple(rooms))
    away = Column("away", "bool", description="not at home; x and y are where it left")
    specs = []
    if settings.trajectories != "off":
        specs.append(TableSpec("trajectories", (STEP, TIME, entity, X, Y, HEADING, room, away)))
    if settings.key_frames:
        kind = Column("kind", "category", categories=KEY_KINDS)
        specs.append(TableSpec("key_frames", (STEP, TIME, entity, kind, X, Y, HEADING, away)))
    if settings.observations and users and robots:
        specs.append(_observation_table(users, robots, room, cameras, activities))
    if settings.events:
        event, detail = Column("event", "category"), Column("detail", "string")
        user = Column("user", "category", nullable=True, categories=tuple(users))
        whom = (user,) if users else ()
        who = entity
        if changes:
            what = "what did it, or what it happened to; none: the home itself"
            names = (*users, *robots, *objects)
            who = Column("entity", "category", categories=names, nullable=True, description=what)
        specs.append(TableSpec("events", (STEP, TIME, who, event, *whom, detail)))
    return specs


def told_cameras(eyes: Sequence[Eye]) -> tuple[str, ...]:
    """Return the names of all cameras if a run has to tell them apart, or from the truth.

    It does where a robot has several, or errs.
    """
    if not any(eye.errs or len(eye.cameras) > 1 for eye in eyes):
        return ()
    return tuple(dict.fromkeys(name for eye in eyes for name in eye.cameras))


def activities_of(eyes: Sequence[Eye], users: int) -> Activities:
    """Return what users do, and what each camera takes it for: nothing known yet."""
    senses = {(eye.index, c): sense for eye in eyes for c, sense in enumerate(eye.activity_senses)}
    return Activities(users, senses)


def _observation_table(
    users: Sequence[str],
    robots: Sequence[str],
    room: Column,
    cameras: Sequence[str],
    activities: bool,
) -> TableSpec:
    """Return the table of what was perceived; where that can be wrong, with the truth beside it."""
    robot = Column("robot", "category", categories=tuple(robots))
    user = Column("user", "category", nullable=bool(cameras), categories=tuple(users))
    columns = [STEP, TIME, robot, user, X, Y, room]
    if cameras:
        posture = Column("posture", "category", categories=POSTURES)
        true = {
            column.name: replace(column, name=f"true_{column.name}", nullable=True)
            for column in (user, X, Y, HEADING, posture)
        }
        camera = Column("camera", "category", categories=tuple(cameras))
        columns += [HEADING, posture, camera, *true.values()]
    if activities:
        doing = "what the user does, as far as a behavior tells"
        for name in ("activity", "true_activity"):
            columns.append(Column(name, "category", nullable=True, description=doing))
    return TableSpec("observations", tuple(columns))


def sensor_table(sensors: Sensors) -> TableSpec:
    """Return the table of what sensors say, in the layout of the CASAS smart homes."""
    sensor = Column("sensor", "category", categories=tuple(sensors.names))
    room, state = Column("room", "category"), Column("state", "category")
    activity = Column("activity", "string", description="what the person does, as far as told")
    return TableSpec("sensors", (STEP, TIME, room, sensor, state, activity))


class Recorder:
    """Gathers the rows of a run.

    Attributes:
        wall_s: Time spent on storing [s].
    """

    def __init__(
        self,
        store: RunStore,
        settings: ArtifactSettings,
        clock: Clock,
        home: Home,
        actors: Sequence[Actor],
        objects: Sequence[str] = (),
        *,
        changes: bool = False,
        eyes: Sequence[Eye] = (),
        sensors: Sensors | None = None,
    ) -> None:
        """Prepare to record.

        Args:
            store: Takes the rows.
            settings: What is stored.
            clock: Of the run.
            home: Of the run.
            actors: Users, then robots.
            objects: The names of the home's objects.
            changes: Whether walls may change during the run.
            eyes: The cameras.
            sensors: The sensors of the home.
        """
        self._sensors = sensors
        self._readings: list[SensorRow] = []
        self.store = store
        self.clock, self.home, self.actors = clock, home, actors
        tables = set(store.names)
        self._keeps_keys = "key_frames" in tables
        self._keeps_observations = "observations" in tables
        self._keeps_events = "events" in tables
        users = sum(actor.path.startswith("users.") for actor in actors)
        self._has_users = users > 0
        self.activities = activities_of(eyes, users)
        self._tells_activities = self.activities.are_told
        self._every = _steps_between_samples(settings, clock)
        self._object_rows = {name: len(actors) + i for i, name in enumerate(objects)}
        # A random walk is rebuilt by walking it again between walls that haven't changed since;
        # where they may have, it is kept step by step.
        self._walk_kind = TRACK if changes else WALK
        self._walk_every = 1 if changes else max(1, WALK_KEY_US // clock.step_us)
        # Breakpoints of the present plan already gathered; the plan before the first has none to
        # tell.
        self._emitted = [2] * len(actors)
        self._told_until = [-1] * len(actors)
        self._notes_told = [0] * len(actors)
        self._samples: list[NDArray[np.int64]] = []
        self._keys: list[NDArray[np.int64]] = []
        self._events: list[tuple[int, int, int, str, int, str]] = []
        self._observations: list[NDArray[np.int64]] = []
        self._rooms = NearestRooms(home.plan)
        names = told_cameras(eyes)
        # The code of each camera of each robot.
        self._camera_codes = (
            {eye.index: [names.index(name) for name in eye.cameras] for eye in eyes}
            if names
            else {}
        )
        self._gathered = 0
        self.wall_s = 0.0

    def before_plan(self, row: int, step: int) -> None:
        """Gather the end of the plan that is about to be replaced at `step`."""
        self._tell_plan(row, step)
        self._break_off(row, step)
        motion = self.actors[row].motion
        track = motion.breakpoints if isinstance(motion, Track) else None
        self._told_until[row] = (
            int(track.time[-1])
            if track is not None and self._emitted[row] == len(track.time)
            else -1
        )

    def after_plan(self, row: int, step: int) -> None:
        """Gather the beginning of the plan that was just made at `step`."""
        # A plan that takes over just where the last one ended needs no key frame to begin.
        self._emitted[row] = int(self._told_until[row] == step * self.clock.step_us and step > 0)
        self._notes_told[row] = 0
        actor = self.actors[row]
        if self._keeps_keys and not isinstance(actor.motion, Track):
            moment = step * self.clock.step_us
            self._keys.append(_key(step, row, self._walk_kind, moment, actor.state))
        self._tell_plan(row, step)

    def changed(self, happened: Sequence[Happened]) -> None:
        """Gather what changed in the home."""
        if self._keeps_events:
            for what in happened:
                row = -1 if what.target is None else self._object_rows[what.target]
                self._events.append((what.step, row, 2, what.event, -1, what.detail))

    def sensed(self, rows: Sequence[SensorRow]) -> None:
        """Gather what the sensors said in a span."""
        self._readings += rows
        self._gathered += len(rows)

    def span(
        self,
        block: PoseBlock,
        first: int,
        count: int,
        eyes: Sequence[Eye],
        gazes: Sequence[Eye] = (),
    ) -> NDArray[np.int64] | None:
        """Gather a span; return its observations, (n, OBSERVATION).

        Args:
            block: The poses of the span.
            first: Its first step.
            count: How many steps it has.
            eyes: The cameras of robots.
            gazes: Those of users, of which only the events are kept.
        """
        for row in range(len(self.actors)):
            self._tell_plan(row, first + count - 1)
        if self._every:
            self._sample(block, first, count)
        if self._keeps_keys:
            self._key_walks(block, first, count)
        if self._keeps_events:
            self._tell_sights([*eyes, *gazes])
        observations = self._observe(eyes) if eyes else None
        if self._gathered + len(self._events) + 8 * len(self._keys) > GATHERED:
            self.drain()
        return observations

    def end(self, step: int) -> None:
        """Gather what is under way when the run ends before `step`, and hand over everything."""
        for row in range(len(self.actors)):
            # Not at the last step, whose rows may be with the store already: order would be lost.
            self._break_off(row, step)
        self.drain()

    def drain(self) -> None:
        """Hand everything gathered to the store."""
        began = time.perf_counter()
        self._store_samples()
        self._store_keys()
        self._store_observations()
        self._store_events()
        self._store_readings()
        self._gathered = 0
        self.wall_s += time.perf_counter() - began

    # Gathering

    def _tell_plan(self, row: int, step: int) -> None:
        """Gather key frames and notes of the present plan up to a step."""
        actor = self.actors[row]
        moment = step * self.clock.step_us
        if self._keeps_events or self._tells_activities:
            notes = actor.plan.notes
            while (
                self._notes_told[row] < len(notes)
                and notes[self._notes_told[row]].time_us <= moment
            ):
                note = notes[self._notes_told[row]]
                at = self.clock.step_at_or_after(note.time_us)
                if self._keeps_events:
                    self._events.append((at, row, 0, note.event, -1, note.detail))
                if note.event == TOLD and row < self.activities.users:
                    self.activities.begin(row, at, note.detail)
                self._notes_told[row] += 1
        if self._keeps_keys and isinstance(actor.motion, Track):
            track = actor.motion.breakpoints
            begin = self._emitted[row]
            if begin < len(track.time) and track.time[begin] <= moment:
                end = int(np.searchsorted(track.time, moment, side="right"))
                self._keys.append(_keys(track, begin, end, row, TRACK, self.clock.step_us))
                self._gathered += end - begin
                self._emitted[row] = end

    def _break_off(self, row: int, step: int) -> None:
        """Gather where the present segment would have ended."""
        motion = self.actors[row].motion
        if self._keeps_keys and isinstance(motion, Track):
            begin = self._emitted[row]
            if begin < len(motion.breakpoints.time):
                planned = _keys(
                    motion.breakpoints, begin, begin + 1, row, PLANNED, self.clock.step_us
                )
                planned[:, 0] = step
                self._keys.append(planned)

    def _sample(self, block: PoseBlock, first: int, count: int) -> None:
        steps = np.arange(-(-first // self._every) * self._every, first + count, self._every)
        if not len(steps):
            return
        rows = np.empty((len(steps), len(self.actors), 6), np.int64)
        rows[:, :, 0] = steps[:, None]
        rows[:, :, 1] = np.arange(len(self.actors))
        columns = steps - first
        rows[:, :, 2] = block.x[:, columns].T
        rows[:, :, 3] = block.y[:, columns].T
        rows[:, :, 4] = block.heading[:, columns].T
        rows[:, :, 5] = block.away[:, columns].T
        self._samples.append(rows.reshape(-1, 6))
        self._gathered += len(steps) * len(self.actors)

    def _key_walks(self, block: PoseBlock, first: int, count: int) -> None:
        every = self._walk_every
        for row, actor in enumerate(self.actors):
            if isinstance(actor.motion, Track):
                continue
            for step in range(-(-first // every) * every, first + count, every):
                if step != actor.planned_at:
                    state = block.state(row, step - first)
                    moment = step * self.clock.step_us
                    self._keys.append(_key(step, row, self._walk_kind, moment, state))

    def _observe(self, eyes: Sequence[Eye]) -> NDArray[np.int64]:
        """Join the findings of all cameras, in order of step and robot."""
        if not any(eye.found for eye in eyes):
            return np.empty((0, OBSERVATION), np.int64)
        rows = np.empty((sum(eye.found for eye in eyes), OBSERVATION), np.int64)
        end = 0
        for eye in eyes:
            begin, end = end, end + eye.found
            rows[begin:end, :SIGHTING] = eye.sightings[: eye.found]
            rows[begin:end, ROBOT] = eye.index
        if len(eyes) > 1:
            rows = rows[np.argsort(rows[:, STEP_COLUMN], kind="stable")]
        if self._keeps_observations and len(rows):
            self._observations.append(rows)
            self._gathered += len(rows)
        return rows

    def _tell_sights(self, eyes: Sequence[Eye]) -> None:
        """Gather who came into view of whom, and who was lost."""
        for eye in eyes:
            for i in range(eye.happened):
                event = eye.event_names[eye.events.kind[i]]
                who, detail = int(eye.events.user[i]), ""
                if who == len(eye.others):
                    who = -1  # somebody unknown
                if event.startswith("robot"):
                    who, detail = -1, eye.name_of(who)
                self._events.append((int(eye.events.step[i]), eye.row, 1, event, who, detail))

    # Storing

    def _store_samples(self) -> None:
        if not self._samples:
            return
        rows = _in_order(self._samples)
        self._samples = []
        step, entity, x, y, heading, away = rows.T
        plan = self.home.plan
        gone = away.astype(bool)
        xy = plan.lattice.to_metres(rows[:, 2:4])
        xy[gone] = np.nan
        room = plan.room_of_place[y // SUB, x // SUB].astype(np.int32)
        self.store.append(
            "trajectories",
            **self._when(step),
            entity=entity.astype(np.int32),
            x=xy[:, 0],
            y=xy[:, 1],
            heading=in_radians(heading),
            room=np.where(gone, np.int32(-1), room),
            away=gone,
        )

    def _store_keys(self) -> None:
        if not self._keys:
            return
        rows = _in_order(self._keys)
        self._keys = []
        xy = self.home.plan.lattice.to_metres(rows[:, 4:6])
        self.store.append(
            "key_frames",
            step=rows[:, 0],
            time=self.clock.moments(rows[:, 3]),
            entity=rows[:, 1].astype(np.int32),
            kind=rows[:, 2].astype(np.int32),
            x=xy[:, 0],
            y=xy[:, 1],
            heading=in_radians(rows[:, 6]),
            away=rows[:, 7].astype(bool),
        )

    def _store_observations(self) -> None:
        if not self._observations:
            return
        rows = np.concatenate(self._observations)
        self._observations = []
        o = perceived(self.home.plan, self._rooms, rows, self.activities)
        columns: dict[str, Any] = {
            **self._when(o.step),
            "robot": o.robot,
            "user": o.user,
            "x": o.x,
            "y": o.y,
            "room": o.room.astype(np.int32),
        }
        if self._camera_codes:
            t = truth(self.home.plan, rows, self.activities)
            real = t.user >= 0
            columns |= {
                "heading": o.heading,
                "posture": o.posture.astype(np.int32),
                "camera": self._cameras(o.robot, o.camera),
                "true_user": t.user,
                "true_x": np.where(real, t.x, np.nan),
                "true_y": np.where(real, t.y, np.nan),
                "true_heading": np.where(real, t.heading, np.nan),
                "true_posture": np.where(real, t.posture, -1).astype(np.int32),
            }
            if self._tells_activities:
                columns |= {"activity": o.activity.tolist(), "true_activity": t.activity.tolist()}
        self.store.append("observations", **columns)

    def _cameras(self, robot: NDArray[np.int32], camera: NDArray[np.int8]) -> NDArray[np.int32]:
        """Return the codes of cameras that are given by their index among their robot's."""
        codes = np.zeros(
            (len(self.actors), 1 + max(map(len, self._camera_codes.values()))), np.int32
        )
        for index, names in self._camera_codes.items():
            codes[index, : len(names)] = names
        found: NDArray[np.int32] = codes[robot, camera]
        return found

    def _store_events(self) -> None:
        if not self._events:
            return
        rows = sorted(self._events, key=lambda row: row[:3])
        self._events = []
        step, entity, _, event, user, detail = zip(*rows, strict=True)
        columns: dict[str, Any] = self._when(np.array(step, np.int64))
        if self._has_users:
            columns["user"] = np.array(user, np.int32)
        self.store.append(
            "events",
            **columns,
            entity=np.array(entity, np.int32),
            event=list(event),
            detail=list(detail),
        )

    def _store_readings(self) -> None:
        if not self._readings or self._sensors is None:
            return
        step, sensor, on, activity = zip(*self._readings, strict=True)
        self._readings = []
        rooms, words = self._sensors.rooms, self._sensors.words
        self.store.append(
            "sensors",
            **self._when(np.array(step, np.int64)),
            room=[rooms[number] for number in sensor],
            sensor=np.array(sensor, np.int32),
            state=[words[number][not is_on] for number, is_on in zip(sensor, on, strict=True)],
            activity=list(activity),
        )

    def _when(self, step: NDArray[np.int64]) -> dict[str, Any]:
        return {"step": step, "time": self.clock.times(step)}


def _steps_between_samples(settings: ArtifactSettings, clock: Clock) -> int:
    """Return how many steps lie between two samples, 0 for no samples.

    Raises:
        ScenarioError: The interval is not a multiple of the step.
    """
    if settings.trajectories == "off":
        return 0
    if settings.trajectories == "every step":
        return 1
    every, rest = divmod(micros(settings.trajectories), clock.step_us)
    if rest or not every:
        raise ScenarioError(
            f"artifacts.trajectories is {settings.trajectories}, which is no multiple of"
            f" simulation.step ({clock.step_us / 1e6:g} s): choose one, 'every step' or 'off'"
        )
    return every


def _key(step: int, row: int, kind: int, time_us: int, state: Sequence[int]) -> NDArray[np.int64]:
    return np.array([[step, row, kind, time_us, *state]], np.int64)


def _keys(
    track: Breakpoints, begin: int, end: int, row: int, kind: int, step_us: int
) -> NDArray[np.int64]:
    keys = np.empty((end - begin, 8), np.int64)
    time = track.time[begin:end]
    keys[:, 0] = -(-time // step_us)
    keys[:, 1], keys[:, 2], keys[:, 3] = row, kind, time
    keys[:, 4], keys[:, 5] = track.x[begin:end], track.y[begin:end]
    keys[:, 6], keys[:, 7] = track.heading[begin:end], track.away[begin:end]
    return keys


def _in_order(blocks: list[NDArray[np.int64]]) -> NDArray[np.int64]:
    """Join blocks of rows (step, entity, …) and sort them; ties stay in the order gathered."""
    rows = np.concatenate(blocks)
    return rows[np.lexsort((rows[:, 1], rows[:, 0]))]
