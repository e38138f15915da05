"""Moments of a run that are worth a look: found by the run itself, for the page and the report."""

import math
from collections.abc import Iterator, Sequence
from datetime import timedelta
from itertools import pairwise
from typing import Any, NamedTuple

from pyarrow import compute

from fleet2d.artifacts.arrow import string_array, values_of
from fleet2d.artifacts.table import categories
from fleet2d.errors import ArtifactError
from fleet2d.runs.run import Run
from fleet2d.runs.verdicts import verdicts_of
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import EventKind
from fleet2d.viewing.contract import StoryFacts

KINDS = (
    EventKind.ACCEPTED,
    EventKind.ACTIVITY,
    EventKind.CAME_HOME,
    EventKind.FIND_BEGINS,
    EventKind.FOUND,
    EventKind.LEFT_HOME,
    EventKind.USER_LOST,
    EventKind.USER_SEEN,
)
SIGHTINGS = (EventKind.USER_SEEN, EventKind.USER_LOST)
ASLEEP = "sleep"
EVENING_H = 20
"""The hour at which a night begins, so that going to bed at one is later than at eleven."""

LEAST_SLEEP = timedelta(hours=1)
"""Shorter sleep is a nap."""

LEAST_UNSEEN = timedelta(minutes=20)
SETTLED = 1.1
"""A belief has settled once its error stays below the last one times this."""


class StoredEvent(NamedTuple):
    """A row of the table of events."""

    step: int
    entity: str
    event: str
    user: str | None
    detail: str


def story_of(run: Run) -> list[StoryFacts]:
    """Return moments of a run in their order: firsts, lasts and longests. Empty without events."""
    try:
        events = _events_of(run)
        moments = [
            *_requests(events),
            *_searches(events, run.clock),
            *_people(run, events),
            *_learning(run),
            *_failure(run),
        ]
    except ArtifactError:  # the run's notes say which table is damaged
        return []
    return sorted(moments, key=lambda moment: moment["step"])


def _events_of(run: Run) -> list[StoredEvent]:
    if "events" not in run.tables:
        return []
    table = run.tables["events"]
    if "user" not in table.schema.names:  # nobody lives there
        return []
    kinds = compute.cast(table["event"], "string")
    rows = table.filter(compute.is_in(kinds, string_array(KINDS)))
    columns = [_words(rows[name]) for name in StoredEvent._fields[1:]]
    steps = values_of(rows["step"]).tolist()
    return list(map(StoredEvent._make, zip(steps, *columns, strict=True)))


def _words(column: Any) -> list[Any]:
    """Return the words of a column; None where one is missing."""
    codes, names = categories(column)
    words = [*names, None]
    return [words[code] for code in codes.tolist()]


def _requests(events: Sequence[StoredEvent]) -> Iterator[StoryFacts]:
    """Yield the first time that anybody accepted what a robot wanted."""
    for event in events:
        if event.event == EventKind.ACCEPTED:
            about, _, user = event.detail.rpartition(" ")
            words = f"{titled(user)} accepts what {titled(event.entity)} asks: {plain(about)}"
            who = [event.entity, user]
            yield StoryFacts(step=event.step, title="The first yes", words=words, who=who)
            return


def _searches(events: Sequence[StoredEvent], clock: Clock) -> Iterator[StoryFacts]:
    """Yield the first successful search, and the longest one."""
    begun: dict[tuple[str, str], int] = {}
    first: StoredEvent | None = None
    longest: tuple[int, StoredEvent] | None = None
    for event in events:
        key = event.entity, event.detail
        if event.event == EventKind.FIND_BEGINS:
            begun[key] = event.step
        elif event.event == EventKind.FOUND and key in begun:
            steps = event.step - begun.pop(key)
            first = first or event
            if longest is None or steps > longest[0]:
                longest = steps, event
    if longest is not None:
        steps, event = longest
        took = _duration(timedelta(microseconds=steps * clock.step_us))
        words = f"{titled(event.entity)} finds {titled(event.detail)} after {took}"
        who = [event.entity, event.detail]
        yield StoryFacts(step=event.step, title="The longest search", words=words, who=who)
        if first is not None and first is not event:
            words = f"{titled(first.entity)} looks for {titled(first.detail)}, and finds"
            who = [first.entity, first.detail]
            yield StoryFacts(step=first.step, title="The first find", words=words, who=who)


def _people(run: Run, events: Sequence[StoredEvent]) -> Iterator[StoryFacts]:
    """Yield who was out of view longest, awake and at home, and who went to bed latest."""
    of_user: dict[str, list[StoredEvent]] = {u: [] for u in run.manifest["entities"]["users"]}
    for event in events:
        subject = event.user if event.event in SIGHTINGS else event.entity
        if subject in of_user:
            of_user[subject].append(event)
    clock = run.clock
    unseen: list[tuple[timedelta, int, str]] = []
    nights: list[tuple[float, int, str]] = []
    for user, user_events in of_user.items():
        unseen += _unseen(clock, user, user_events)
        nights += _nights(clock, user, user_events)
    if unseen and any(event.event == EventKind.USER_SEEN for event in events):
        lasted, step, user = max(unseen)
        if lasted >= LEAST_UNSEEN:
            words = f"{titled(user)} is up and at home, and out of view for {_duration(lasted)}"
            yield StoryFacts(step=step, title="The longest out of view", words=words, who=[user])
    if len(nights) > 1:
        _, step, user = max(nights)
        words = f"{titled(user)} goes to bed at {run.clock.time(step):%H:%M}"
        yield StoryFacts(step=step, title="The latest night", words=words, who=[user])


def _unseen(
    clock: Clock, user: str, user_events: Sequence[StoredEvent]
) -> Iterator[tuple[timedelta, int, str]]:
    """Yield how long a user was out of view, awake and at home, and since when."""
    is_asleep = True  # until the first activity
    is_out = False
    seen_by = 0
    since: int | None = None
    for event in user_events:
        if event.event in SIGHTINGS:
            seen_by += 1 if event.event == EventKind.USER_SEEN else -1
        elif event.event == EventKind.ACTIVITY:
            is_asleep = event.detail == ASLEEP
        elif event.event in (EventKind.LEFT_HOME, EventKind.CAME_HOME):
            is_out = event.event == EventKind.LEFT_HOME
        else:
            continue
        counts = not is_asleep and not is_out and seen_by == 0
        if counts and since is None:
            since = event.step
        elif not counts and since is not None:
            steps = event.step - since
            yield timedelta(microseconds=steps * clock.step_us), since, user
            since = None


def _nights(
    clock: Clock, user: str, user_events: Sequence[StoredEvent]
) -> Iterator[tuple[float, int, str]]:
    """Yield when a user went to bed, in hours since the evening began: once a night, to sleep."""
    activities = [event for event in user_events if event.event == EventKind.ACTIVITY]
    nights = set()
    for event, following in pairwise(activities):
        lasts = timedelta(microseconds=(following.step - event.step) * clock.step_us)
        since_evening = clock.time(event.step) - timedelta(hours=EVENING_H)
        if event.detail != ASLEEP or lasts < LEAST_SLEEP or since_evening.date() in nights:
            continue
        nights.add(since_evening.date())
        yield since_evening.hour + since_evening.minute / 60, event.step, user


def _learning(run: Run) -> Iterator[StoryFacts]:
    """Yield the moment from which the beliefs of long-term presence hardly got better."""
    rows = rows_of_metric(run, "ltp_error", ["step", "user", "tv"])
    rows = [row for row in rows if row["user"] == rows[-1]["user"]]
    errors = [row["tv"] for row in rows]
    if len(errors) < 3 or any(error is None or math.isnan(error) for error in errors):
        return
    last = errors[-1]
    settled = len(errors) - 1
    while settled > 0 and errors[settled - 1] <= SETTLED * last:
        settled -= 1
    if 0 < settled < len(errors) - 1:
        below = f"{100 * SETTLED * last:.0f} %"
        end = f"{100 * last:.0f} % at the end"
        words = f"They are wrong by less than {below} from here on, and by {end}"
        title = "The beliefs have settled"
        yield StoryFacts(step=rows[settled]["step"], title=title, words=words, who=[])


def rows_of_metric(run: Run, kind: str, columns: list[str]) -> list[dict[str, Any]]:
    """Return the rows of the table of the first metric of a type; none if nothing measured it."""
    configured = run.manifest["scenario"]["metrics"]
    name = next((name for name in configured if configured[name]["type"] == kind), None)
    if name is None or name not in run.tables:
        return []
    rows: list[dict[str, Any]] = run.tables[name].select(columns).to_pylist()
    return rows


def _failure(run: Run) -> Iterator[StoryFacts]:
    """Yield the first moment at which an expectation was violated."""
    failures = [each for each in verdicts_of(run) if each.step is not None]
    if failures:
        first = min(failures, key=lambda verdict: verdict.step or 0)
        words = f"{titled(first.name)}: {first.says}"
        yield StoryFacts(step=first.step or 0, title="The first failure", words=words, who=[])


def titled(name: str) -> str:
    """Return the name of a body as a sentence writes it."""
    return plain(name[:1].upper() + name[1:])


def plain(name: str) -> str:
    """Return a name without underscores."""
    return name.replace("_", " ")


def _duration(lasted: timedelta) -> str:
    """Return a duration in words.

    >>> _duration(timedelta(seconds=74)), _duration(timedelta(hours=2, minutes=5))
    ('1 min 14 s', '2 h 5 min')
    """
    seconds = round(lasted.total_seconds())
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} min {seconds % 60} s"
    return f"{seconds // 3600} h {seconds % 3600 // 60} min"
