"""Personas fitted to the days of a log, and how well their days match days held back."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from operator import itemgetter
from typing import Any

import numpy as np
import yaml

from fleet2d.floorplan.rooms.room import PRIORITY
from fleet2d.learning.fit.privacy import private_days
from fleet2d.learning.fit.timeline import (
    ActivityPlace,
    LivedDay,
    Stretch,
    Timeline,
    is_sleep,
    runs,
    sleep_states,
)
from fleet2d.logs.log import AWAY, LogError
from fleet2d.logs.placement import USUAL_ROOMS
from fleet2d.routines.persona import Persona
from fleet2d.routines.planner import NO_SLEEP_S, RecordedDay, parse_day, write_day
from fleet2d.runtime.clock import DAY_S

QUANTILES = 21  # maximum number of quantiles of a distribution of durations
# Words in names of activities for standing, lying and sitting; the first match counts.
STAND = ("cook", "prepar", "wash", "dish", "clean", "transition", "hygiene", "bathing")
LIE = ("sleep", "nap", "bed", "wake_up")
SIT = (
    "eat",
    "tv",
    "work",
    "read",
    "relax",
    "computer",
    "breakfast",
    "lunch",
    "dinner",
    "supper",
    "snack",
    "music",
    "rest",
    "social",
    "toilet",
)
MIN_TEMPLATE_DAYS = 4  # minimum number of days of a kind from which a template is fitted
WORKDAYS = 5


@dataclass
class FittedPersona:
    """A fitted persona.

    Attributes:
        document: The persona as plain data, as in its YAML file.
        persona: The persona.
        states: The timeline's state of each of its activities.
        notes: Decisions that the fit had to make.
        log: The recorded days of the log.
    """

    document: dict[str, Any]
    persona: Persona
    states: dict[str, int]
    notes: list[str] = field(default_factory=list)
    log: list[RecordedDay] = field(default_factory=list)


def fit_persona(
    timeline: Timeline, days: Sequence[LivedDay], about: str = "", *, private: bool = False
) -> FittedPersona:
    """Fit a persona to days of a log.

    Its days are drawn from those of the log, switching between days that have the same activity at
    about the same time. A private persona has days like those of the log instead (see
    `private_days`), and no measured durations.

    Raises:
        LogError: There are no days to fit.
    """
    if not days:
        raise LogError("the log has no day with a night before and a night after it: log more days")
    names = _names(timeline)
    fitter = _Fitter(timeline, names)
    kinds, notes = _kinds_of_days(timeline, days)
    templates: dict[str, dict[str, Any]] = {}
    log: list[RecordedDay] = []
    for name, (on, members) in kinds.items():
        recorded = fitter.recorded(members)
        log += recorded
        new = private_days(recorded, 0, name) if private else recorded
        templates[name] = {"on": on, "recorded": [write_day(day) for day in new]}
    fitter.sleep()
    fitter.rest(days)
    activities = fitter.activities
    if private:
        used = {"rest"}
        for template in templates.values():
            for text in template["recorded"]:
                used.update(parse_day(text).activities)
        activities = {name: {**fields} for name, fields in activities.items() if name in used}
        for fields in activities.values():
            fields.pop("takes", None)
    document = {
        "about": about or f"fitted to {len(days)} days of a log",
        "activities": activities,
        "needs": {},  # the log has their activities
        "errands": {},
        "days": templates,
    }
    persona = Persona.model_validate(document)
    return FittedPersona(document, persona, fitter.states, notes, log)


def _kinds_of_days(
    timeline: Timeline, days: Sequence[LivedDay]
) -> tuple[dict[str, tuple[str, list[LivedDay]]], list[str]]:
    """Return weekdays and weekend, or all days as one kind if either has too few; with notes.

    Each kind has the `on` of its template, and its days.
    """
    if timeline.weekdays is None:
        return {"every_day": ("daily", list(days))}, ["no dates: all days are of one kind"]
    weekdays = [day for day in days if timeline.weekdays[day.number] < WORKDAYS]
    weekend = [day for day in days if timeline.weekdays[day.number] >= WORKDAYS]
    if min(len(weekdays), len(weekend)) < MIN_TEMPLATE_DAYS:
        counts = f"{len(weekdays)} weekdays and {len(weekend)} days of weekends"
        return {"every_day": ("daily", list(days))}, [f"{counts}: too few for two kinds"]
    return {"weekday": ("weekdays", weekdays), "weekend": ("weekend", weekend)}, []


# The places that nearly every home has.
USUAL_PLACES = ("bathroom", "bedroom", "kitchen", AWAY)
MUCH_UNKNOWN = 0.05  # a larger share of unknown time is reported


def gaps(timeline: Timeline, days: Sequence[LivedDay]) -> list[str]:
    """Return what a log lacks, and the consequences for a persona fitted to it."""
    notes = []
    left_out = len(timeline.minutes) - len(days)
    if left_out > 2:  # the first and the last day always are
        notes.append(
            f"{left_out} of {len(timeline.minutes)} days are left out: the night before or after"
            " them isn't in the log, or they begin before midnight"
        )
    numbers = [day.number for day in days]
    unknown = float(np.mean(timeline.seconds[numbers] < 0)) if days else 0.0
    if unknown > MUCH_UNKNOWN:
        notes.append(f"{unknown:.0%} of the time is unknown: what was done before it goes on")
    (only, *others) = timeline.places
    if not others:
        notes.append(
            f"all of the log is in one room, {only}: changes of room, stays and absences can't be"
            " fitted, and distances in rooms are 0 whatever the persona"
        )
    for place in USUAL_PLACES if others else ():
        if all(state.place != place for state in timeline.states):
            where = "out of the home" if place == AWAY else f"in a {place}"
            notes.append(f"nobody is ever {where} in this log, nor will the persona be")
    known = {AWAY, *PRIORITY, *USUAL_ROOMS}
    unusual = [place for place in timeline.places if place not in known]
    if unusual:
        notes.append(
            f"rooms of no known kind: {', '.join(unusual)}; in a home without such rooms the"
            " persona is in any room instead: --rooms LABEL=KIND says what they are"
        )
    if not any(state.activity and not is_sleep(state) for state in timeline.states):
        notes.append("activities have no names: postures and furniture follow from rooms alone")
    return notes


def _names(timeline: Timeline) -> list[str]:
    """Return a name for each state: its activity, with its room if it is done in several."""
    asleep = sleep_states(timeline)
    known = timeline.minutes[timeline.minutes >= 0]
    lasts = np.bincount(known, minlength=len(timeline.states)).tolist()
    most_frequent: dict[str, int] = {}
    for i in sorted(range(len(timeline.states)), key=lambda i: -lasts[i]):
        most_frequent.setdefault(_base_name(timeline.states[i], i in asleep), i)
    names = []
    for i, state in enumerate(timeline.states):
        name = _base_name(state, i in asleep)
        names.append(name if most_frequent[name] == i else f"{name}_in_{state.place}")
    return names


def _base_name(state: ActivityPlace, asleep: bool) -> str:
    if asleep:
        return "nap"
    return state.activity or (AWAY if state.place == AWAY else f"in_{state.place}")


class _Fitter:
    """Gathers the activities that the templates of a persona use."""

    def __init__(self, timeline: Timeline, names: list[str]) -> None:
        self.timeline = timeline
        self.names = names
        self.activities: dict[str, dict[str, Any]] = {}
        self.states: dict[str, int] = {}

    def recorded(self, days: Sequence[LivedDay]) -> list[RecordedDay]:
        """Return days as recorded days."""
        by_state: dict[int, list[Stretch]] = defaultdict(list)
        for day in days:
            for run in (*day.awake, *day.up):
                by_state[run.state].append(run)
        for state, done in sorted(by_state.items()):
            self._add(self.names[state], state, takes=_duration_quantiles(done))
        recorded = [_recorded_day(self.timeline, day, self.names) for day in days]
        used = {name for day in recorded for name in day.activities} - set(self.activities)
        for name in sorted(used - {"sleep", "rest"}):  # states that never fill most of a minute
            state = self.names.index(name)
            self._add(name, state, takes=_duration_quantiles([Stretch(state, 0, 1)]))
        return recorded

    def sleep(self) -> None:
        """Describe sleep, in the place where the person sleeps most."""
        minutes = self.timeline.minutes
        state = max(sleep_states(self.timeline), key=lambda state: (minutes == state).sum())
        self._add("sleep", state, posture="lie")

    def rest(self, days: Sequence[LivedDay]) -> None:
        """Describe rest, for times in which nothing else fits, by the most frequent state."""
        lasts = _time_by_state(run for day in days for run in day.awake)
        states = self.timeline.states
        at_home = [state for state in lasts if states[state].place != AWAY]
        state = max(at_home or lasts, key=lambda state: (lasts[state], -state))
        self._add("rest", state, takes="15 min")

    def _add(self, name: str, state: int, **fields: Any) -> None:
        self.activities[name] = self._place_fields(state) | fields
        self.states[name] = state

    def _place_fields(self, state: int) -> dict[str, Any]:
        activity, place = self.timeline.states[state]
        if place == AWAY:
            return {"away": True}
        rooms = dict.fromkeys([place, *USUAL_ROOMS.get(place, ()), "any"])
        return {"rooms": list(rooms), "posture": usual_posture(activity)}


def usual_posture(activity: str) -> str:
    """Return the posture of an activity, by the words in its name.

    >>> [usual_posture(name) for name in ("cook_dinner", "eat_dinner", "bed_toilet_transition")]
    ['stand', 'sit', 'stand']
    """
    for posture, words in (("stand", STAND), ("lie", LIE), ("sit", SIT)):
        if any(word in activity for word in words):
            return posture
    return "stand"


def _recorded_day(timeline: Timeline, day: LivedDay, names: Sequence[str]) -> RecordedDay:
    """Return a day of a log, to the second; in unknown times, the activity before continues."""
    midnight = day.number * DAY_S
    wake = 60 * day.wake
    bed = 60 * day.bed
    next_wake = 60 * day.next_wake
    flat = timeline.seconds.ravel()
    awake = flat[midnight + wake : midnight + bed]
    entries = [(wake + at, names[state]) for state, at, _ in runs(awake) if state >= 0]
    entries = entries or [(wake, "rest")]
    entries[0] = (wake, entries[0][1])
    asleep = sleep_states(timeline)
    entries.append((bed, "sleep"))
    for up in day.up:
        begin = 60 * up.begin
        end = 60 * (up.begin + up.length)
        for state, at, _ in runs(flat[midnight + begin : midnight + end]):
            if state >= 0:
                entries.append((begin + at, "sleep" if state in asleep else names[state]))
        entries.append((end, "sleep"))
    ordered = sorted(dict(entries).items())
    last = [entry for entry in ordered if entry[0] < next_wake - NO_SLEEP_S]
    if last[-1][1] != "sleep":
        last.append((next_wake - NO_SLEEP_S, "sleep"))
    changes = [next(same) for _, same in groupby(last, key=itemgetter(1))]
    begins, activities = zip(*changes, strict=True)
    return RecordedDay(begins, activities, next_wake)


def _time_by_state(done: Iterable[Stretch]) -> Counter[int]:
    """Return the time of each state in some stretches [min]."""
    lasts: Counter[int] = Counter()
    for run in done:
        lasts[run.state] += run.length
    return lasts


def _duration_quantiles(done: Sequence[Stretch]) -> dict[str, Any]:
    """Return the measured distribution of durations, as quantiles at even steps from 0 to 1."""
    lengths = np.log(np.sort([float(run.length) for run in done]))
    count = min(max(2, 2 * len(lengths) - 1), QUANTILES)
    at = np.linspace(0, len(lengths) - 1, count)
    # Interpolated geometrically, as durations differ by factors.
    values = np.exp(np.interp(at, np.arange(len(lengths)), lengths))
    quantiles = [_seconds(round(60 * v)) for v in values.tolist()]
    # A short minimum duration, so that it may be cut rather than left out.
    return {"law": "measured", "quantiles": quantiles, "at_least": "1 min"}


def _seconds(seconds: int) -> str:
    return f"{seconds // 60} min" if seconds % 60 == 0 else f"{seconds} s"


def to_yaml(document: Mapping[str, Any]) -> str:
    """Return a persona as YAML, with one line per activity and task."""
    lines = [_flow({"about": document["about"]})[1:-1], "activities:"]
    for name, fields in sorted(document["activities"].items()):
        lines.append(f"  {name}: {_flow(fields)}")
    lines += ["needs: {}", "errands: {}", "days:"]
    for name, day in document["days"].items():
        lines += [f"  {name}:", f"    on: {day['on']}"]
        if "recorded" in day:
            lines += ["    recorded:", *(f'      - "{text}"' for text in day["recorded"])]
            continue
        lines += [f"    {key}: {_flow(day[key])}" for key in ("wake", "sleep")]
        for key in ("do", "leisure"):
            lines.append(f"    {key}:" + ("" if day[key] else " {}"))
            lines += [f"      {task}: {_flow(fields)}" for task, fields in day[key].items()]
    return "\n".join(lines) + "\n"


def _flow(fields: Mapping[str, Any]) -> str:
    """Return a mapping as YAML in one line."""
    return yaml.safe_dump(
        dict(fields), default_flow_style=True, sort_keys=False, allow_unicode=True, width=math.inf
    ).strip()
