"""Signals that are words, or merely so or not: rooms, activities, sights, doors, events, times."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from typing import ClassVar

import numpy as np

from fleet2d.expectations.expectation import Known
from fleet2d.expectations.scene import Scene
from fleet2d.expectations.signals import Measured, State, WordSignal
from fleet2d.expectations.trace import I64, Trace
from fleet2d.expectations.words import call_text
from fleet2d.problems import did_you_mean


@dataclass(frozen=True, eq=False)
class RoomOf(WordSignal):
    """The room that a body is in, by its name or its type; none between two, or away."""

    body: str

    __hash__ = object.__hash__

    def check(self, scene: Scene) -> None:
        """Refuse an unknown body."""
        scene.check_body(self.body, self)

    def check_word(self, word: str, scene: Scene) -> None:
        """Refuse an unknown room."""
        scene.check_name("room", word, scene.rooms, self)

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("room", self.body)


@dataclass(frozen=True, eq=False)
class ActivityOf(WordSignal):
    """What a user does, as the events `activity` say; none before the first of them."""

    user: str

    __hash__ = object.__hash__

    def check(self, scene: Scene) -> None:
        """Refuse an unknown user."""
        scene.check_name("user", self.user, scene.users, self)

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("activity", self.user)


@dataclass(frozen=True, eq=False)
class Moving(State):
    """That a body is elsewhere than at the step before."""

    body: str

    def check(self, scene: Scene) -> None:
        """Refuse an unknown body."""
        scene.check_body(self.body, self)

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("moving", self.body)


@dataclass(frozen=True, eq=False)
class Away(State):
    """That a body is not at home."""

    body: str

    def check(self, scene: Scene) -> None:
        """Refuse an unknown body."""
        scene.check_body(self.body, self)

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("away", self.body)


@dataclass(frozen=True, eq=False)
class Sight(State):
    """Something between a camera's owner and somebody whom it looks at."""

    body: str
    by: str

    word: ClassVar[str]

    def check(self, scene: Scene) -> None:
        """Refuse who has no camera, and whom it never looks at."""
        scene.check_name("robot or user with a camera", self.by, scene.cameras, self)
        if self.body not in scene.cameras[self.by]:
            near = did_you_mean(self.body, scene.cameras[self.by])
            raise scene.error(
                f"{self}: {self.by} doesn't look at {self.body!r}{near} It looks at:"
                f" {', '.join(scene.cameras[self.by])}"
            )

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text(self.word, self.body, by=self.by)


class Seen(Sight):
    """That a camera's owner counts somebody as seen: from `user_seen` until `user_lost`."""

    word = "seen"


class InView(Sight):
    """That somebody really is in view of a camera, noticed or not."""

    word = "in_view"


class Perceived(Sight):
    """That a robot perceives somebody, rightly or wrongly, in the row of a step."""

    word = "perceived"

    def check(self, scene: Scene) -> None:
        """Refuse users, whose perception isn't recorded."""
        scene.check_name("robot", self.by, scene.robots, self)
        super().check(scene)


@dataclass(frozen=True, eq=False)
class DoorOpen(State):
    """That a door is open."""

    name: str

    def check(self, scene: Scene) -> None:
        """Refuse an unknown door."""
        scene.check_name("door", self.name, scene.doors, self)

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("door", self.name)


@dataclass(frozen=True, eq=False)
class SensorOn(State):
    """That a sensor is on; of a door's contact, that it is open."""

    name: str

    def check(self, scene: Scene) -> None:
        """Refuse an unknown sensor."""
        scene.check_name("sensor", self.name, scene.sensors, self)

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("sensor", self.name)


@dataclass(frozen=True, eq=False)
class Happens(State):
    """That an event happens at a step.

    Attributes:
        kind: Of the event, as the table of events has it.
        entity: To whom it happens; None: to anybody.
        detail: What else it says; None: anything.
    """

    kind: str
    entity: str | None = None
    detail: str | None = None

    def check(self, scene: Scene) -> None:
        """Refuse an event that can never happen."""
        scene.check_event(self.kind, self.entity, self.detail, self)

    def occasions(self, known: Known) -> I64:
        """Return the steps at which it happens, each as often as it does."""
        trace = self.trace(known)
        end = np.append(trace.start[1:], trace.end)
        lengths = np.where(trace.value > 0, end - trace.start, 0)
        offset = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        steps = np.repeat(trace.start, lengths) + offset
        return np.repeat(steps, np.repeat(trace.value.clip(0).astype(np.int64), lengths))

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("events", self.kind, self.entity, detail=self.detail)


@dataclass(frozen=True, eq=False)
class During(State):
    """That it is a time of day, on some days of the week.

    Attributes:
        begin: Time of day at which it begins, since midnight.
        end: Time of day before which it ends; the next day's if that is earlier than `begin`.
        days: Days of the week on which it begins, 0 is Monday.
        text: What was written.
    """

    begin: timedelta
    end: timedelta
    days: frozenset[int]
    text: tuple[str, str | None]

    def measures(self) -> Iterator[Measured]:
        """Yield nothing: the clock tells."""
        yield from ()

    def trace(self, known: Known) -> Trace:
        """Return when it is."""
        clock, day = known.clock, timedelta(days=1)
        midnight = clock.time(known.first).replace(hour=0, minute=0, second=0, microsecond=0) - day
        edges, value = [known.first], [0.0]
        while midnight < clock.time(known.end):
            if midnight.weekday() in self.days:
                length = (
                    self.end - self.begin if self.end > self.begin else self.end + day - self.begin
                )
                for moment, on in ((self.begin, 1.0), (self.begin + length, 0.0)):
                    step = clock.step_at_or_after(clock.elapsed(midnight + moment))
                    if step <= edges[-1]:
                        value[-1] = on
                    elif step < known.end:
                        edges.append(step)
                        value.append(on)
            midnight += day
        return Trace(np.array(edges, np.int64), np.array(value), known.end)

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("during", self.text[0], days=self.text[1])
