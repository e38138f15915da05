"""What a run writes down: samples, key frames, observations and events, in an order of their own.

Rows are gathered over spans and handed to the store sorted by (step, entity), so that a table is
the same however the run was cut into spans.
"""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.activities import ROBOT, TOLD, Activities
from fleet2d.algorithms.log import SensorRow
from fleet2d.algorithms.observations import (
    OBSERVATION,
    NearestRooms,
    perceived,
    truth,
)
from fleet2d.artifacts.settings import ArtifactSettings
from fleet2d.artifacts.store import RunStore
from fleet2d.clock import Clock
from fleet2d.engine.buckets import Eye, PoseBlock
from fleet2d.engine.changes import Happened
from fleet2d.engine.key_frames import KeyFrames
from fleet2d.engine.samples import Samples
from fleet2d.engine.sensors import Sensors
from fleet2d.engine.tables import told_cameras
from fleet2d.entities.actor import Actor
from fleet2d.floorplan.home import Home
from fleet2d.kernels.look import SIGHTING
from fleet2d.kernels.look import STEP as STEP_COLUMN

# Rows gathered before they go to the store.
GATHERED = 1 << 15


def activities_of(eyes: Sequence[Eye], users: int) -> Activities:
    """Return what users do, and what each camera takes it for: nothing known yet."""
    senses = {(eye.index, c): sense for eye in eyes for c, sense in enumerate(eye.activity_senses)}
    return Activities(users, senses)


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
        self.store, self.clock, self.home, self.actors = store, clock, home, actors
        self._tables = set(store.names)
        self._samples = Samples(store, settings, clock, home)
        self._keys = KeyFrames(store, clock, home, actors, changes)
        users = sum(actor.path.startswith("users.") for actor in actors)
        self.activities = activities_of(eyes, users)
        self._object_rows = {name: len(actors) + i for i, name in enumerate(objects)}
        self._notes_told = [0] * len(actors)
        self._events: list[tuple[int, int, int, str, int, str]] = []
        self._observations: list[NDArray[np.int64]] = []
        self._sensors, self._readings = sensors, list[SensorRow]()
        self._rooms = NearestRooms(home.plan)
        self._camera_codes = _codes_of(eyes)
        self._gathered = 0  # observations and readings
        self.wall_s = 0.0

    def before_plan(self, row: int, step: int) -> None:
        """Gather the end of the plan that is about to be replaced at `step`."""
        self._tell_notes(row, step)
        if "key_frames" in self._tables:
            self._keys.end_plan(row, step)

    def after_plan(self, row: int, step: int) -> None:
        """Gather the beginning of the plan that was just made at `step`."""
        self._notes_told[row] = 0
        self._tell_notes(row, step)
        if "key_frames" in self._tables:
            self._keys.begin_plan(row, step)

    def changed(self, happened: Sequence[Happened]) -> None:
        """Gather what changed in the home."""
        if "events" in self._tables:
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
            self._tell_notes(row, first + count - 1)
            if "key_frames" in self._tables:
                self._keys.pass_by(row, first + count - 1)
        self._samples.span(block, first, count)
        if "key_frames" in self._tables:
            self._keys.span(block, first, count)
        if "events" in self._tables:
            self._tell_sights([*eyes, *gazes])
        observations = self._observe(eyes) if eyes else None
        waiting = self._gathered + self._samples.gathered + self._keys.gathered
        if waiting + len(self._events) > GATHERED:
            self.drain()
        return observations

    def end(self, step: int) -> None:
        """Gather what is under way when the run ends before `step`, and hand over everything."""
        if "key_frames" in self._tables:
            for row in range(len(self.actors)):
                # Not at the last step, whose rows may be with the store already: order would be
                # lost.
                self._keys.break_off(row, step)
        self.drain()

    def drain(self) -> None:
        """Hand everything gathered to the store."""
        began = time.perf_counter()
        self._samples.store()
        self._keys.store()
        self._store_observations()
        self._store_events()
        self._store_readings()
        self._gathered = 0
        self.wall_s += time.perf_counter() - began

    # Gathering

    def _tell_notes(self, row: int, step: int) -> None:
        """Gather the notes of the present plan up to a step."""
        if not ("events" in self._tables or self.activities.are_told):
            return
        notes = self.actors[row].plan.notes
        moment = step * self.clock.step_us
        while self._notes_told[row] < len(notes) and notes[self._notes_told[row]].time_us <= moment:
            note = notes[self._notes_told[row]]
            at = self.clock.step_at_or_after(note.time_us)
            if "events" in self._tables:
                self._events.append((at, row, 0, note.event, -1, note.detail))
            if note.event == TOLD and row < self.activities.users:
                self.activities.begin(row, at, note.detail)
            self._notes_told[row] += 1

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
        if "observations" in self._tables and len(rows):
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
            if self.activities.are_told:
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
        if self.activities.users:
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


def _codes_of(eyes: Sequence[Eye]) -> dict[int, list[int]]:
    """Return the code of each camera of each robot; none where the run doesn't tell them apart."""
    names = told_cameras(eyes)
    return {eye.index: [names.index(name) for name in eye.cameras] for eye in eyes} if names else {}
