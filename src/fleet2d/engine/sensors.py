"""The sensors of a run: their readings, and the activities at that time."""

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from copy import copy
from operator import itemgetter
from typing import Protocol, runtime_checkable

import numpy as np

from fleet2d.algorithms.history import SensorRow
from fleet2d.configuration.problems import check_known
from fleet2d.engine.basis import Basis, Watcher
from fleet2d.entities.body import Bodies
from fleet2d.entities.sensor import Sensor, SensorFault, SensorReading, SensorState, SensorView
from fleet2d.errors import blame, errors_as
from fleet2d.kernels import PoseBlock
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import Event, EventKind


@runtime_checkable
class OfDoor(Protocol):
    """A sensor of the door `of`; `watch` sets the number of that door in the home."""

    of: str

    def watch(self, door: int) -> None:
        """Set the door."""


@runtime_checkable
class FromLog(Protocol):
    """A sensor whose readings are in a file, which `read` reads before the run."""

    def read(self, clock: Clock) -> None:
        """Read the file."""


class Sensors(Watcher):
    """All sensors of a scenario.

    Attributes:
        sensors: The sensors by name, in the order of the scenario.
        names: Their names.
        next_step: The first step at which the sensors have not been read.
        rooms: The room in the readings of each sensor.
        words: The words of each sensor for its two states, on and off.
        stuck: The faults from outside, by name.
    """

    def __init__(self, basis: Basis, doors: Sequence[str]) -> None:
        home = basis.home
        step_us = basis.clock.step_us
        self.home = home
        self.users = basis.bodies.users
        self.stuck: dict[str, SensorFault] = {}
        self._readings: list[tuple[int, SensorReading]] = []  # not collected yet
        self.sensors: dict[str, Sensor] = {}
        for name, item in basis.scenario.objects.items():
            if isinstance(item, Sensor):
                sensor = item.model_copy(deep=True)
                if isinstance(sensor, FromLog):
                    with errors_as(None, f"objects.{name}"):
                        sensor.read(basis.clock)
                if isinstance(sensor, OfDoor):
                    check_known(sensor.of, "door", doors, where=f"objects.{name}.of: ")
                    sensor.watch(list(doors).index(sensor.of))
                sensor.start(home, step_us)
                self.sensors[name] = sensor
        self.names = list(self.sensors)
        sensors = self.sensors.values()
        self.rooms = [sensor.room or sensor.place(home) for sensor in sensors]
        self.words = [sensor.words for sensor in sensors]
        self._states = {n: SensorState(s.hold_us() // step_us) for n, s in self.sensors.items()}
        self._last_poses: tuple[np.ndarray, ...] | None = None
        self._activities: dict[str, list[tuple[int, str]]] = {user.name: [] for user in basis.users}

    @property
    def notes(self) -> list[str]:
        """Remarks on the tables of replayed sensors."""
        return [
            f"objects.{name}: {note}"
            for name, sensor in self.sensors.items()
            for note in getattr(sensor, "notes", ())
        ]

    @property
    def on(self) -> dict[str, bool]:
        """Whether each sensor is on at present."""
        return {name: state.on for name, state in self._states.items()}

    @property
    def is_needed(self) -> bool:
        """Whether there are sensors."""
        return bool(self.sensors)

    @property
    def waits(self) -> bool:
        """Whether readings end a span."""
        return EventKind.SENSOR in self.awaited

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step after the first in which a sensor reports something."""
        first = self.next_step
        last_poses = self._last_poses
        with blame("objects", first):
            view = self._view(bodies.block(first, end), first)
            self._last_poses = last_poses
            for name, state in self._states.items():
                readings = self._read(name, copy(state), view, end)
                end = min([end, *(reading.step + 1 for reading in readings)])
        return end

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Read the sensors; `collect` returns the readings."""
        first = self.next_step
        self.next_step = end
        if first == end:
            return ()
        with blame("objects", first):
            view = self._view(bodies.block(first, end), first)
            readings = [
                (number, reading)
                for number, (name, state) in enumerate(self._states.items())
                for reading in self._read(name, state, view, end)
            ]
        # The order is by step, then by sensor.
        readings.sort(key=lambda item: (item[1].step, item[0]))
        self._readings += readings
        return ()

    def _read(
        self, name: str, state: SensorState, view: SensorView, end: int
    ) -> list[SensorReading]:
        """Return the readings of a sensor before step `end`, and update its state."""
        steps, users = self.sensors[name].sense(view, self.home)
        fault = self.stuck.get(name)
        if fault == "on":
            steps = np.arange(view.first, end)
            users = np.full(len(steps), -1)
        elif fault == "off":
            steps = steps[:0]
            users = users[:0]
        readings = state.read(steps, users, end)
        return [] if fault == "silent" else readings

    def collect(self) -> list[SensorRow]:
        """Return the readings since the last call, by step and sensor.

        Events up to these steps must be known, since readings have activities.
        """
        rows = self._readings
        self._readings = []
        return [SensorRow(r.step, i, r.on, self._activity(r.user, r.step)) for i, r in rows]

    def events_of(self, rows: Iterable[SensorRow]) -> list[Event]:
        """Return readings as events, with the sensor and its state in the words of the table."""
        names = self.names
        kind = EventKind.SENSOR
        events = []
        for row in rows:
            word = self.words[row.sensor][not row.on]
            events.append(Event(row.step, names[row.sensor], kind, word))
        return events

    def take_events(self, events: Sequence[Event]) -> None:
        """Record the activities of users, for the readings."""
        if not self.sensors:
            return
        for event in events:
            if event.event == EventKind.ACTIVITY and event.entity in self._activities:
                self._activities[event.entity].append((event.step, event.detail))

    def _view(self, block: PoseBlock, first: int) -> SensorView:
        arrays = (block.x, block.y, block.away == 0)
        last_poses = self._last_poses or tuple(array[:, :1] for array in arrays)
        self._last_poses = tuple(array[:, -1:].copy() for array in arrays)
        pairs = zip(last_poses, arrays, strict=True)
        x, y, present = (np.concatenate(pair, axis=1) for pair in pairs)
        return SensorView(first, x, y, present, self.users)

    def _activity(self, user: int, step: int) -> str:
        """Return the activity of a user at a step, if known; for user -1, of all users."""
        if user >= self.users:
            return ""
        if user < 0:
            activities = [self._activity(number, step) for number in range(self.users)]
            return " and ".join(dict.fromkeys(text for text in activities if text))
        activities_of_user = list(self._activities.values())[user]
        index = bisect_right(activities_of_user, step, key=itemgetter(0))
        return activities_of_user[index - 1][1] if index else ""
