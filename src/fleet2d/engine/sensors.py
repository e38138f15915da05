"""The sensors of a run: what they say over each span, and beside what activity."""

from collections.abc import Mapping, Sequence
from copy import copy

import numpy as np

from fleet2d.algorithms.log import SensorRow
from fleet2d.clock import Clock
from fleet2d.engine.buckets import PoseBlock
from fleet2d.entities.actor import Actor
from fleet2d.entities.objects.contact_sensor import ContactSensor
from fleet2d.entities.objects.home_object import HomeObject
from fleet2d.entities.objects.sensor import Memory, Sensor, SensorView, in_order
from fleet2d.errors import ScenarioError
from fleet2d.floorplan.home import Home
from fleet2d.problems import did_you_mean


class Sensors:
    """All sensors of a scenario.

    Attributes:
        names: Their names, in the order of the scenario.
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
        users: int,
    ) -> None:
        self.clock, self.users = clock, users
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
        self._memories = [Memory(sensor.hold_us() // clock.step_us) for sensor in self.sensors]
        self._before: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self._activities = [""] * users

    @property
    def on(self) -> dict[str, bool]:
        """Whether each sensor is on at present."""
        return {name: memory.on for name, memory in zip(self.names, self._memories, strict=True)}

    def span(
        self, block: PoseBlock, first: int, count: int, home: Home, actors: Sequence[Actor]
    ) -> list[SensorRow]:
        """Return what the sensors say in a span, by step and sensor."""
        if not self.sensors:
            return []
        view = self._view(block, first, count)
        said = []
        for number, (sensor, memory) in enumerate(zip(self.sensors, self._memories, strict=True)):
            steps, users = sensor.sense(view, home)
            said += [(number, reading) for reading in memory.read(steps, users, first + count)]
        rows = [
            SensorRow(
                reading.step, number, reading.on, self._activity(actors, reading.user, reading.step)
            )
            for number, reading in in_order(said)
        ]
        for user in range(self.users):
            self._activities[user] = self._activity(actors, user, first + count - 1)
        return rows

    def limit(self, block: PoseBlock, first: int, count: int, home: Home) -> int:
        """Return the steps of a span up to the first in which a sensor says something."""
        before = self._before
        view = self._view(block, first, count)
        self._before = before
        for sensor, memory in zip(self.sensors, self._memories, strict=True):
            said = copy(memory).read(*sensor.sense(view, home), first + count)
            count = min([count, *(reading.step - first + 1 for reading in said)])
        return count

    def _view(self, block: PoseBlock, first: int, count: int) -> SensorView:
        here = (block.x[:, :count], block.y[:, :count], block.away[:, :count] == 0)
        before = self._before or tuple(part[:, :1] for part in here)
        self._before = (here[0][:, -1:].copy(), here[1][:, -1:].copy(), here[2][:, -1:].copy())
        x, y, present = (np.concatenate(pair, axis=1) for pair in zip(before, here, strict=True))
        return SensorView(first, x, y, present, self.users)

    def _activity(self, actors: Sequence[Actor], user: int, step: int) -> str:
        """Return what a user is doing at a step, as its plan says; all users' if it is nobody's."""
        if user >= self.users:
            return ""
        if user < 0:
            doing = [self._activity(actors, one, step) for one in range(self.users)]
            return " and ".join(dict.fromkeys(text for text in doing if text))
        told = self._activities[user]
        for note in actors[user].plan.notes:
            if note.time_us > step * self.clock.step_us:
                break
            if note.event == "activity":
                told = note.detail
        return told


def _door(name: str, of: str, doors: Sequence[str]) -> int:
    if of in doors:
        return list(doors).index(of)
    raise ScenarioError(
        f"objects.{name}.of names {of!r}, which is no door of the scenario"
        f"{did_you_mean(of, doors)} There are: {', '.join(doors) or 'none'}"
    )
