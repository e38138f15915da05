"""Interactions as data: requests of a robot to a person, their value over time, and their queue."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from enum import StrEnum
from itertools import count
from typing import Literal, NamedTuple

from pydantic import Field

from fleet2d.configuration import units
from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import Duration, Length, OnDays, PositiveDuration, Share, TimeOfDay
from fleet2d.runtime.clock import midnights
from fleet2d.runtime.events import EventKind
from fleet2d.runtime.local_time import at_reading

InteractionKind = Literal["remind", "offer", "ask", "greet", "deliver", "patrol_report"]


class Outcome(StrEnum):
    """The outcomes of addressing a person, which are events of the robot."""

    ACCEPTED = EventKind.ACCEPTED
    DECLINED = EventKind.DECLINED
    DEFERRED = EventKind.DEFERRED
    # The robot was noticed but not answered; one that isn't noticed sees the same.
    IGNORED = EventKind.IGNORED
    # The robot addressed somebody else.
    MISTAKEN = EventKind.MISTAKEN
    SENT_AWAY = EventKind.SENT_AWAY
    # The robot was banned from the room that it is in.
    BANNED = EventKind.BANNED
    SWITCHED_OFF = EventKind.SWITCHED_OFF


OUTCOMES = frozenset(Outcome)
REQUEST_EVENTS = frozenset(
    {
        EventKind.DUE, EventKind.EXPIRED, EventKind.QUESTION, EventKind.ALLOWED, EventKind.TOLD,
        *OUTCOMES,
    }
)  # fmt: skip
"""What a robot hears: requests come up and expire, people answer, ask it, and let it in again."""


class Interaction(Settings):
    """A recurring request of a robot to a person.

    A *request* comes up at each time of `at`, or every `every`, and is open for `within`. Its value
    falls evenly from `worth` to `worth` · `falls_to` at the deadline.

    Attributes:
        do: Its kind.
        to: The person.
        by: The robot; left out: the first one.
        about: The subject, for reports; the person whom a question is about.
        fetch_from: For `deliver`: the person who has to give the object to the robot first.
        at: Times of day at which a request comes up.
        on: The days on which requests come up.
        every: Interval between two requests, from the start on, instead of `at`.
        within: Time for which a request is open.
        worth: Its value if it is carried out at once, in any unit.
        falls_to: The part of the value that is left at the deadline.
        takes: Its duration once the person has accepted.
        distance: Distance at which the robot stops [m].
        manner: Whether it speaks, or only shows a text, which has to be in sight.
        tries: Number of times that the robot addresses the person, at most.
        retry: Time before it tries again.
        seek: Whether the behavior `interact` looks for the person; else only opportunities count.

    Example:
        >>> pill = Interaction(do="remind", to="ana", at=["08:00"], within="30 min", worth=4)
        >>> pill.value_after(timedelta(minutes=10))
        4.0
        >>> song = Interaction(do="offer", to="ana", every="1 d", worth=4, falls_to=0.5)
        >>> song.value_after(timedelta(minutes=15))
        3.0
    """

    do: InteractionKind
    to: str = Field(min_length=1)
    by: str | None = None
    about: str = ""
    fetch_from: str | None = None
    at: tuple[TimeOfDay, ...] = ()
    on: OnDays = "daily"
    every: PositiveDuration | None = None
    within: PositiveDuration = timedelta(minutes=30)
    worth: float = Field(default=1.0, ge=0, le=1e6)
    falls_to: Share = 1.0
    takes: Duration = timedelta(minutes=1)
    distance: Length = Field(default=1.2, ge=0.3, le=10)
    manner: Literal["spoken", "shown"] = "spoken"
    tries: int = Field(default=3, ge=1, le=100)
    retry: Duration = timedelta(minutes=10)
    seek: bool = True

    def model_post_init(self, _: object, /) -> None:
        """Require either times or an interval."""
        if bool(self.at) == (self.every is not None):
            raise problem("it comes up by 'at' (times of day) or 'every' (a duration): give one")
        if self.fetch_from is not None and (self.do != "deliver" or self.fetch_from == self.to):
            raise problem("'fetch_from' is for `do: deliver`, and names another person than 'to'")

    @property
    def people(self) -> list[str]:
        """The people whom the robot addresses, in order."""
        return [self.to] if self.fetch_from is None else [self.fetch_from, self.to]

    def value_after(self, age: timedelta) -> float:
        """Return the value of a request carried out at some age; 0 if too late."""
        if not timedelta(0) <= age <= self.within:
            return 0.0
        return self.worth * (1 - (1 - self.falls_to) * (age / self.within))

    def times(self, start: datetime, after: datetime) -> Iterator[datetime]:
        """Yield the times at which requests come up from a moment on.

        Args:
            start: The start of the run.
            after: The first moment that counts.
        """
        days = units.weekdays_of(self.on)
        if self.every is not None:
            passed = max(timedelta(0), after - start)
            for number in count(-(-passed // self.every)):
                moment = start + number * self.every
                if moment.weekday() in days:
                    yield moment
        for midnight in midnights(after):
            for at in sorted(self.at) if midnight.weekday() in days else ():
                moment = at_reading(start, midnight + at)
                if moment >= after:
                    yield moment


@dataclass
class Request:
    """One request of an interaction.

    Attributes:
        name: The interaction's name in the scenario.
        interaction: The interaction.
        since: Time at which it came up.
        not_before: Time from which the robot may try (again).
        tries: Number of times that the person was addressed.
        is_fetched: Whether the robot has what it delivers.
    """

    name: str
    interaction: Interaction
    since: datetime
    not_before: datetime
    tries: int = 0
    is_fetched: bool = False

    @property
    def to(self) -> str:
        """The person whom the robot has to address now."""
        giver = self.interaction.fetch_from
        return self.interaction.to if giver is None or self.is_fetched else giver

    @property
    def is_last_stage(self) -> bool:
        """Whether the request is done once that person accepts."""
        return self.to == self.interaction.to

    @property
    def until(self) -> datetime:
        """The deadline."""
        return self.since + self.interaction.within

    @property
    def text(self) -> str:
        """The interaction and the person to address, as events name them."""
        return f"{self.name} {self.to}"

    def value_at(self, time: datetime) -> float:
        """Return the value of the request if carried out at a time."""
        return self.interaction.value_after(time - self.since)


class RequestChange(NamedTuple):
    """A request that came up, or whose deadline has passed."""

    time: datetime
    event: EventKind
    request: Request


@dataclass
class RequestQueue:
    """The requests of a robot to people at present.

    Attributes:
        interactions: Its interactions, by name.
        start: The start of the run.
        open: The open requests, in the order in which they came up.
        opportunities: Opportunities that the robot considered, for the events: step and text.
    """

    interactions: Mapping[str, Interaction]
    start: datetime
    open: list[Request] = field(default_factory=list)
    opportunities: list[tuple[int, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._next = {
            name: next(each.times(self.start, self.start))
            for name, each in self.interactions.items()
        }

    def take_opportunities(self) -> list[tuple[int, str]]:
        """Return and remove the opportunities."""
        taken = self.opportunities
        self.opportunities = []
        return taken

    def next_changes(self) -> dict[str, datetime]:
        """Return the next times at which a request comes up (`due`) and one `expired`."""
        if not self._next:
            return {}
        until = [request.until for request in self.open]
        until += [due + self.interactions[name].within for name, due in self._next.items()]
        return {EventKind.DUE: min(self._next.values()), EventKind.EXPIRED: min(until)}

    def advance(self, time: datetime) -> list[RequestChange]:
        """Open requests that have come up by a time, drop expired ones; return the changes."""
        came_up = []
        for name, due in self._next.items():
            each = self.interactions[name]
            while due <= time:
                came_up.append(Request(name, each, due, due))
                due = next(each.times(self.start, due + timedelta(microseconds=1)))
            self._next[name] = due
        if not came_up and all(request.until > time for request in self.open):
            return []
        requests = [*self.open, *came_up]
        self.open = [request for request in requests if request.until > time]
        self.open.sort(key=lambda request: (request.since, request.name))
        late = [request for request in requests if request.until <= time]
        changes = [RequestChange(request.until, EventKind.EXPIRED, request) for request in late]
        changes += [RequestChange(request.since, EventKind.DUE, request) for request in came_up]
        return sorted(changes, key=lambda change: (change.time, change.request.name))

    def find(self, text: str) -> Request | None:
        """Return the first open request that a text, as in events, names."""
        return next((request for request in self.open if request.text == text), None)

    def ready(self, time: datetime, people: Sequence[str] | None = None) -> list[Request]:
        """Return the requests that may be tried now, the most valuable and urgent first.

        Args:
            time: The present time.
            people: The people to whom requests are returned.
        """
        ready = [request for request in self.open if request.not_before <= time]
        if people is not None:
            ready = [request for request in ready if request.to in people]
        return sorted(ready, key=lambda each: (-each.interaction.worth, each.until, each.name))

    def next_ready(self, time: datetime) -> datetime | None:
        """Return the time at which a waiting request may be tried again; None: none waits."""
        times = (request.not_before for request in self.open)
        return min((at for at in times if at > time), default=None)

    def reopen(self, request: Request, time: datetime) -> None:
        """Reopen an accepted request that wasn't carried out, unless it is too late."""
        if request.is_fetched and any(each is request for each in self.open):
            request.is_fetched = False
        elif request.until > time:
            request.not_before = time
            self.open = sorted([*self.open, request], key=lambda each: (each.since, each.name))

    def settle(self, request: Request, outcome: Outcome, time: datetime, later: datetime) -> None:
        """Note the outcome of addressing the person.

        Args:
            request: The request.
            outcome: The outcome that the robot saw.
            time: The present time.
            later: Time at which the person wants to be asked again, if deferred.
        """
        if outcome == Outcome.ACCEPTED and not request.is_last_stage:
            request.is_fetched = True
            request.tries = 0
            request.not_before = time
            return
        request.tries += 1
        may_retry = outcome in (Outcome.DEFERRED, Outcome.IGNORED, Outcome.MISTAKEN)
        if not may_retry or request.tries >= request.interaction.tries:
            self.open = [each for each in self.open if each is not request]
        elif outcome == Outcome.DEFERRED:
            request.not_before = later
        else:
            request.not_before = time + request.interaction.retry
