"""Signals with words (rooms, activities) or truth values (sights, doors, events, times of day)."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta

import numpy as np

from fleet2d.configuration.problems import did_you_mean
from fleet2d.expectations.expectation import RunSignals
from fleet2d.expectations.formatting import call_text
from fleet2d.expectations.scene import Scene
from fleet2d.expectations.signals import BODY, Condition, Measurement, WordSignal
from fleet2d.expectations.trace import Trace
from fleet2d.kernels import I64
from fleet2d.runtime.clock import midnight_of


@dataclass(frozen=True, eq=False)
class RoomSignal(WordSignal):
    """The room that a body is in: its name or its type; no word between two rooms, or away."""

    body: str

    word = "room"
    of = BODY

    def check_word(self, word: str, scene: Scene) -> None:
        """Refuse an unknown room."""
        scene.check_name("room", word, scene.rooms, self)


@dataclass(frozen=True, eq=False)
class ActivitySignal(WordSignal):
    """A user's activity, from the events `activity`; no word before the first of them."""

    user: str

    word = "activity"
    of = ("user", "users")


@dataclass(frozen=True, eq=False)
class BodyCondition(Condition):
    """Base of conditions about one body alone."""

    body: str

    of = BODY


class IsMoving(BodyCondition):
    """Whether a body's position differs from that at the step before."""

    word = "moving"


class IsAway(BodyCondition):
    """Whether a body is away from home."""

    word = "away"


@dataclass(frozen=True, eq=False)
class CameraCondition(Condition):
    """Base of conditions about a camera.

    Attributes:
        body: Name of the body that the camera may see.
        by: Name of the robot or user that the camera belongs to.
    """

    body: str
    by: str

    def check(self, scene: Scene) -> None:
        """Refuse an owner without a camera, and a body that the camera never looks at."""
        scene.check_name("robot or user with a camera", self.by, scene.cameras, self)
        if self.body not in scene.cameras[self.by]:
            near = did_you_mean(self.body, scene.cameras[self.by])
            raise scene.error(
                f"{self}: {self.by} doesn't look at {self.body!r}{near} It looks at:"
                f" {', '.join(scene.cameras[self.by])}"
            )

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return call_text(self.word, self.body, by=self.by)


class IsSeen(CameraCondition):
    """Whether a camera's owner counts a body as seen: from `user_seen` until `user_lost`."""

    word = "seen"


class IsInView(CameraCondition):
    """Whether a body truly is in view of a camera, noticed or not."""

    word = "in_view"


class IsPerceived(CameraCondition):
    """Whether a robot has an observation of a user at a step, correct or not."""

    word = "perceived"

    def check(self, scene: Scene) -> None:
        """Refuse users as owners: their perception isn't recorded."""
        scene.check_name("robot", self.by, scene.robots, self)
        super().check(scene)


@dataclass(frozen=True, eq=False)
class IsOpen(Condition):
    """Whether a door is open."""

    name: str

    word = "door"
    of = ("door", "doors")


@dataclass(frozen=True, eq=False)
class IsOn(Condition):
    """Whether a sensor is on; for the contact sensor of a door, whether the door is open."""

    name: str

    word = "sensor"
    of = ("sensor", "sensors")


@dataclass(frozen=True, eq=False)
class EventHappens(Condition):
    """Whether an event happens at a step.

    Attributes:
        kind: Kind of the event, as in the table of events.
        entity: Name of the entity to which it happens; None: any.
        detail: Detail of the event; None: any.
    """

    kind: str
    entity: str | None = None
    detail: str | None = None

    def check(self, scene: Scene) -> None:
        """Refuse an event that can never happen."""
        scene.check_event(self.kind, self.entity, self.detail, self)

    def occasions(self, run: RunSignals) -> I64:
        """Return the steps at which it happens, repeated for several events at one step."""
        trace = self.trace(run)
        end = np.append(trace.start[1:], trace.end)
        lengths = np.where(trace.value > 0, end - trace.start, 0)
        offset = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        steps = np.repeat(trace.start, lengths) + offset
        return np.repeat(steps, np.repeat(trace.value.clip(0).astype(np.int64), lengths))

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return call_text("events", self.kind, self.entity, detail=self.detail)


@dataclass(frozen=True, eq=False)
class IsDuring(Condition):
    """Whether it is a certain time of day, on certain days of the week.

    Attributes:
        begin: Time of day at which it begins, as time since midnight.
        end: Time of day before which it ends; on the next day if that is earlier than `begin`.
        days: Days of the week on which it begins, 0 is Monday.
        text: The hours and the days as they were written.
    """

    begin: timedelta
    end: timedelta
    days: frozenset[int]
    text: tuple[str, str | None]

    def measures(self) -> Iterator[Measurement]:
        """Yield nothing: it follows from the clock."""
        yield from ()

    def check(self, scene: Scene) -> None:
        """Accept every run."""

    def trace(self, run: RunSignals) -> Trace:
        """Return 1 where the time is within these hours, 0 elsewhere."""
        clock, day = run.clock, timedelta(days=1)
        midnight = midnight_of(clock.time(run.first)) - day
        starts, values = [run.first], [0.0]
        while midnight < clock.time(run.end):
            if midnight.weekday() in self.days:
                length = (
                    self.end - self.begin if self.end > self.begin else self.end + day - self.begin
                )
                for offset, is_within in ((self.begin, 1.0), (self.begin + length, 0.0)):
                    step = clock.step_at_or_after(clock.elapsed(midnight + offset))
                    if step <= starts[-1]:
                        values[-1] = is_within
                    elif step < run.end:
                        starts.append(step)
                        values.append(is_within)
            midnight += day
        return Trace(np.array(starts, np.int64), np.array(values), run.end)

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return call_text("during", self.text[0], days=self.text[1])
