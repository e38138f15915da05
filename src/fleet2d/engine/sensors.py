"""The sensors of a run: what they report, and beside what activity."""

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from operator import itemgetter

import numpy as np

from fleet2d.algorithms.log import SensorRow
from fleet2d.blame import blame
from fleet2d.clock import Clock
from fleet2d.engine.bodies import Bodies, PoseBlock
from fleet2d.entities.behavior import SightEvent
from fleet2d.entities.objects.contact_sensor import ContactSensor
from fleet2d.entities.objects.home_object import HomeObject
from fleet2d.entities.objects.sensor import (
    Sensor,
    SensorFault,
    SensorReading,
    SensorState,
    SensorView,
    in_order,
)
from fleet2d.errors import ScenarioError
from fleet2d.events import Event, EventKind
from fleet2d.floorplan.home.home import Home
from fleet2d.problems import did_you_mean


class Sensors:
    """All sensors of a scenario.

    Attributes:
        names: Their names, in the order of the scenario.
        taken: The step before which the sensors were read.
        rooms: The room that each one's readings name.
        words: What each one calls its two states, on and off.
        on: Whether each is on at present.
    """

    def __init__(
        self,
        objects: Mapping[str, HomeObject],
        doors: Sequence[str],
        home: Home,
        clock: Clock,
        users: Sequence[str],
    ) -> None:
        self.home, self.users = home, len(users)
        self.taken = 0
        self.stuck: dict[str, SensorFault] = {}  # what somebody outside lets them say
        self.awaited = False  # whether an algorithm waits for readings
        self._rows: list[SensorRow] = []
        self.sensors: list[Sensor] = []
        self.names: list[str] = []
        for name, thing in objects.items():
            if isinstance(thing, Sensor):
                sensor = thing.model_copy(deep=True)
                if isinstance(sensor, ContactSensor):
                    sensor.watch(_door(name, sensor.of, doors))
                sensor.start(home, clock.step_us)
                self.names.append(name)
                self.sensors.append(sensor)
        self.rooms = [sensor.room or sensor.place(home) for sensor in self.sensors]
        self.words = [sensor.words for sensor in self.sensors]
        self._states = [SensorState(sensor.hold_us() // clock.step_us) for sensor in self.sensors]
        self._before: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self._doing: dict[str, list[tuple[int, str]]] = {user: [] for user in users}

    @property
    def on(self) -> dict[str, bool]:
        """Whether each sensor is on at present."""
        return {name: state.on for name, state in zip(self.names, self._states, strict=True)}

    @property
    def waits(self) -> bool:
        """Whether readings end a span."""
        return self.awaited and bool(self.sensors)

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step after the first in which a sensor reports something."""
        first, before = self.taken, self._before
        with blame("objects", first):
            view = self._view(bodies.block(first, end), first)
            self._before = before
            for number, state in enumerate(self._states):
                readings = self._read(number, copy(state), view, end)
                end = min([end, *(reading.step + 1 for reading in readings)])
        return end

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Read the sensors; `collect` hands over what they report."""
        first, self.taken = self.taken, end
        if not self.sensors or first == end:
            return ()
        with blame("objects", first):
            view = self._view(bodies.block(first, end), first)
            readings = []
            for number, state in enumerate(self._states):
                readings += [(number, each) for each in self._read(number, state, view, end)]
        self._rows += [
            SensorRow(reading.step, number, reading.on, self._activity(reading.user, reading.step))
            for number, reading in in_order(readings)
        ]
        return ()

    def _read(
        self, number: int, state: SensorState, view: SensorView, end: int
    ) -> list[SensorReading]:
        """Return the readings of a sensor before step `end`, and update its state."""
        steps, users = self.sensors[number].sense(view, self.home)
        fault = self.stuck.get(self.names[number])
        if fault == "on":
            steps = np.arange(view.first, end)
            users = np.full(len(steps), -1)
        elif fault == "off":
            steps, users = steps[:0], users[:0]
        readings = state.read(steps, users, end)
        return [] if fault == "silent" else readings

    def interruptions(self, events: Sequence[Event]) -> Iterable[tuple[int, SightEvent]]:
        """Return nothing: no plan waits for a sensor."""
        return ()

    def collect(self) -> list[SensorRow]:
        """Hand over what sensors reported since this was called last, by step and sensor."""
        rows, self._rows = self._rows, []
        return rows

    def events_of(self, rows: Iterable[SensorRow]) -> list[Event]:
        """Return readings as events: of which sensor, and its state in the words of the table."""
        names, words = self.names, self.words
        return [
            Event(row.step, names[row.sensor], EventKind.SENSOR, words[row.sensor][not row.on])
            for row in rows
        ]

    def take_events(self, events: Sequence[Event]) -> None:
        """Note what users do, for the readings to say."""
        for event in events:
            if event.event == EventKind.ACTIVITY and event.entity in self._doing:
                self._doing[event.entity].append((event.step, event.detail))

    def _view(self, block: PoseBlock, first: int) -> SensorView:
        here = (block.x, block.y, block.away == 0)
        before = self._before or tuple(part[:, :1] for part in here)
        self._before = (here[0][:, -1:].copy(), here[1][:, -1:].copy(), here[2][:, -1:].copy())
        x, y, present = (np.concatenate(pair, axis=1) for pair in zip(before, here, strict=True))
        return SensorView(first, x, y, present, self.users)

    def _activity(self, user: int, step: int) -> str:
        """Return what a user is doing at a step, if known; of all users if it is nobody's."""
        if user >= self.users:
            return ""
        if user < 0:
            doing = [self._activity(one, step) for one in range(self.users)]
            return " and ".join(dict.fromkeys(text for text in doing if text))
        begun = list(self._doing.values())[user]
        at = bisect_right(begun, step, key=itemgetter(0))
        return begun[at - 1][1] if at else ""


def _door(name: str, of: str, doors: Sequence[str]) -> int:
    if of in doors:
        return list(doors).index(of)
    raise ScenarioError(
        f"objects.{name}.of names {of!r}, which is no door of the scenario"
        f"{did_you_mean(of, doors)} There are: {', '.join(doors) or 'none'}"
    )
