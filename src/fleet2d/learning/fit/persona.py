"""Personas fitted to the days of a log, and how well their days match days held back."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

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
from fleet2d.runtime.clock import DAY_MINUTES, DAY_S

BLOCK = 180  # length of a part of the day that has pastimes of its own [min]
QUANTILES = 21  # maximum number of quantiles of a law of durations
# Words of activities that are done standing, lying and sitting; the first that fit decide.
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
# A task is done on at least this share of the days, at most once a day. The standard deviation of
# its beginning is at most SPREAD, and the gap to begins at other times more than APART [min].
MIN_SHARE = 0.8
SPREAD = 20
APART = 60
LONG = 10  # minimum mean duration of a task [min]
MIN_TEMPLATE_DAYS = 4  # minimum number of days of a kind from which a template is fitted
WORKDAYS = 5
Model = Literal["recorded", "laws"]


@dataclass
class FittedPersona:
    """A fitted persona.

    Attributes:
        document: The persona as plain data, as in its YAML file.
        persona: The persona.
        states: The timeline's state of each of its activities.
        notes: Decisions that the fit had to make.
        log: The recorded days of the log; none with the model `laws`.
    """

    document: dict[str, Any]
    persona: Persona
    states: dict[str, int]
    notes: list[str] = field(default_factory=list)
    log: list[RecordedDay] = field(default_factory=list)


def fit_persona(
    timeline: Timeline,
    days: Sequence[LivedDay],
    about: str = "",
    *,
    model: Model = "recorded",
    private: bool = False,
) -> FittedPersona:
    """Fit a persona to days of a log.

    With the model `recorded`, its days are drawn from those of the log, and switch from one to
    another where both have the same activity at about the same time. If it is private, it has days
    that are like those of the log instead (see `private_days`), and no measured durations.

    With the model `laws`, an activity that is done once on most days at about the same time becomes
    a task, with the mean and spread of its beginning, the measured law of its duration and the
    share of days that have it. All other activities become pastimes: for each slot of three hours
    of the day, their weights and durations are those that began in this slot. Getting up at night
    becomes a rate of `fetches` during sleep.

    Raises:
        LogError: There are no days to fit.
    """
    if not days:
        raise LogError("the log has no day with a night before and a night after it: log more days")
    names = _names(timeline)
    fitter = _Fitter(timeline, names, min(day.wake for day in days))
    kinds, notes = _kinds_of_days(timeline, days)
    away = [day for day in days if any(up.length == day.next_wake - day.bed for up in day.up)]
    if away and model == "laws":
        notes.append(f"{len(away)} nights away are slept at home: choose the model `recorded`")
    templates: dict[str, dict[str, Any]] = {}
    log: list[RecordedDay] = []
    for name, (on, members) in kinds.items():
        if model == "recorded":
            recorded = fitter.recorded(members)
            log += recorded
            new = private_days(recorded, 0, name) if private else recorded
            templates[name] = {"on": on, "recorded": [write_day(day) for day in new]}
        else:
            kind = name if len(kinds) > 1 else ""
            templates[name] = {"on": on, **fitter.template(members, kind)}
    fitter.sleep(days, gets_up=model == "laws")
    fitter.rest(days)
    activities = fitter.activities
    if private:
        texts = [text for template in templates.values() for text in template["recorded"]]
        used = {"rest", *(name for text in texts for name in parse_day(text).activities)}
        activities = {
            name: {key: value for key, value in fields.items() if key != "takes"}
            for name, fields in activities.items()
            if name in used
        }
    document = {
        "about": about or f"fitted to {len(days)} days of a log",
        "activities": activities,
        "needs": {},  # their activities are in the log
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


# What nearly every home has; the kinds of days of a week.
USUAL_PLACES = ("bathroom", "bedroom", "kitchen", AWAY)
MUCH_UNKNOWN = 0.05  # share of the time


def gaps(timeline: Timeline, days: Sequence[LivedDay]) -> list[str]:
    """Return what isn't in a log, and what that means for a persona that is fitted to it."""
    notes = []
    left_out = len(timeline.minutes) - len(days)
    if left_out > 2:  # the first and the last
        notes.append(
            f"{left_out} of {len(timeline.minutes)} days are left out: the night before or after"
            " them isn't in the log, or they begin before midnight"
        )
    unknown = float(np.mean(timeline.seconds[[day.number for day in days]] < 0)) if days else 0.0
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

    def __init__(self, timeline: Timeline, names: list[str], dawn: int) -> None:
        self.timeline = timeline
        self.names = names
        self.dawn = dawn  # the earliest waking of all kinds of days
        self.activities: dict[str, dict[str, Any]] = {}
        self.states: dict[str, int] = {}

    def template(self, days: Sequence[LivedDay], kind: str) -> dict[str, Any]:
        """Return the template of a kind of days."""
        wakes = [day.wake for day in days]
        beds = [day.bed for day in days]
        shortest = min(day.next_wake - day.bed for day in days)
        # If the next day begins as early as possible.
        least_night = self.dawn + DAY_MINUTES - max(beds)
        tasks, rest = self._tasks(days)
        return {
            "wake": _timing(wakes),
            "sleep": {**_timing(beds), "at_least": f"{max(1, min(shortest, least_night))} min"},
            "do": tasks,
            "leisure": self._leisure(rest, min(wakes), kind),
        }

    def _tasks(self, days: Sequence[LivedDay]) -> tuple[dict[str, Any], list[Stretch]]:
        """Return the tasks, and the stretches that are part of none."""
        by_state: dict[int, list[tuple[int, Stretch]]] = defaultdict(list)
        for day in days:
            for run in day.awake:
                by_state[run.state].append((day.number, run))
        tasks = {}
        rest = []
        for state, done in sorted(by_state.items()):
            for number, cluster in enumerate(_clusters(done)):
                longest: dict[int, Stretch] = {}
                for of_day, run in cluster:
                    if of_day not in longest or run.length > longest[of_day].length:
                        longest[of_day] = run
                stretches = list(longest.values())
                if not _is_task(stretches, len(cluster), len(days)):
                    rest += [run for _, run in cluster]
                    continue
                name = self.names[state] + (f"_{number + 1}" if number else "")
                tasks[name] = {
                    **({"activity": self.names[state]} if number else {}),
                    **_timing([run.begin for run in stretches]),
                    "takes": _takes(stretches),
                    # Below 1, so that it may be left out of a day that is too full.
                    "probability": round(min(len(stretches) / len(days), 0.99), 3),
                }
                self._add(self.names[state], state, takes=_takes(stretches))
                rest += [run for n, run in cluster if longest[n] is not run]
        return tasks, rest

    def _leisure(self, rest: Iterable[Stretch], dawn: int, kind: str) -> dict[str, Any]:
        """Return the pastimes: one per block of the day and room, weighted by its stays.

        All stays in a room are one pastime, as a pastime is never followed by itself.
        """
        blocks: dict[int, dict[str, list[Stretch]]] = defaultdict(lambda: defaultdict(list))
        for run in rest:
            place = self.timeline.states[run.state].place
            blocks[(run.begin - dawn) // BLOCK][place].append(run)
        leisure = {}
        for block in sorted(blocks):
            first = dawn + block * BLOCK
            if first >= dawn + DAY_MINUTES:
                continue
            last = min(first + BLOCK, dawn + DAY_MINUTES) - 1
            for _, done in sorted(blocks[block].items()):
                state, is_main = self._main_state(done)
                base = self.names[state] if is_main else f"in_{self.timeline.states[state].place}"
                name = "_".join([base, *([kind] if kind else []), f"{first // 60 % 24:02}h"])
                self._add(name, state, takes=_takes(done))
                between = [_clock(first), _clock(last)]
                leisure[name] = {"weight": float(len(done)), "between": between}
        return leisure

    @staticmethod
    def _main_state(done: Sequence[Stretch]) -> tuple[int, bool]:
        """Return the state with the most time, and whether that is more than half of the time."""
        lasts = _time_by_state(done)
        state = max(lasts, key=lambda s: (lasts[s], -s))
        return state, 2 * lasts[state] > lasts.total()

    def recorded(self, days: Sequence[LivedDay]) -> list[RecordedDay]:
        """Return days as recorded days."""
        by_state: dict[int, list[Stretch]] = defaultdict(list)
        for day in days:
            for run in (*day.awake, *day.up):
                by_state[run.state].append(run)
        for state, done in sorted(by_state.items()):
            self._add(self.names[state], state, takes=_takes(done))
        recorded = [_recorded_day(self.timeline, day, self.names) for day in days]
        used = {name for day in recorded for name in day.activities} - set(self.activities)
        for name in sorted(used - {"sleep", "rest"}):  # never for most of a minute
            state = self.names.index(name)
            self._add(name, state, takes=_takes([Stretch(state, 0, 1)]))
        return recorded

    def sleep(self, days: Sequence[LivedDay], *, gets_up: bool) -> None:
        """Describe sleep, and how often and how long the person is up at night."""
        state = max(sleep_states(self.timeline), key=lambda s: (self.timeline.minutes == s).sum())
        fields: dict[str, Any] = {"posture": "lie"}
        places = self.timeline.states
        here = (AWAY, places[state].place)
        up = [run for day in days for run in day.up if places[run.state].place not in here]
        if up and gets_up:
            asleep = sum(day.next_wake - day.bed for day in days) - sum(r.length for r in up)
            rooms = Counter(places[run.state].place for run in up)
            usual = max(rooms, key=lambda place: (rooms[place], place))
            fields |= {
                "fetches": f"{max(1, asleep // len(up))} min",
                "fetches_from": [usual, "any"],
                "fetch_takes": _takes(up),
            }
        self._add("sleep", state, **fields)

    def rest(self, days: Sequence[LivedDay]) -> None:
        """Describe rest, for times in which nothing else fits, by the most frequent state."""
        lasts = _time_by_state(run for day in days for run in day.awake)
        home = {s: n for s, n in lasts.items() if self.timeline.states[s].place != AWAY}
        state = max(home or lasts, key=lambda s: (lasts[s], -s))
        self._add("rest", state, takes="15 min")

    def _add(self, name: str, state: int, **fields: Any) -> None:
        self.activities[name] = self._where(state) | fields
        self.states[name] = state

    def _where(self, state: int) -> dict[str, Any]:
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
    words = {"stand": STAND, "lie": LIE, "sit": SIT}
    return next((p for p, names in words.items() if any(n in activity for n in names)), "stand")


def _recorded_day(timeline: Timeline, day: LivedDay, names: Sequence[str]) -> RecordedDay:
    """Return a day of a log, to the second; in unknown times, the activity before continues."""
    midnight = day.number * DAY_S
    wake, bed, next_wake = (60 * minute for minute in (day.wake, day.bed, day.next_wake))
    flat = timeline.seconds.ravel()
    awake = flat[midnight + wake : midnight + bed]
    entries = [(wake + at, names[state]) for state, at, _ in runs(awake) if state >= 0]
    entries = entries or [(wake, "rest")]
    entries[0] = (wake, entries[0][1])
    asleep = sleep_states(timeline)
    entries.append((bed, "sleep"))
    for up in day.up:
        begin, end = 60 * up.begin, 60 * (up.begin + up.length)
        for state, at, _ in runs(flat[midnight + begin : midnight + end]):
            if state >= 0:
                entries.append((begin + at, "sleep" if state in asleep else names[state]))
        entries.append((end, "sleep"))
    ordered = sorted(dict(entries).items())
    last = [entry for entry in ordered if entry[0] < next_wake - NO_SLEEP_S]
    if last[-1][1] != "sleep":
        last.append((next_wake - NO_SLEEP_S, "sleep"))
    changes = [e for i, e in enumerate(last) if not i or e[1] != last[i - 1][1]]
    begins, activities = zip(*changes, strict=True)
    return RecordedDay(tuple(begins), tuple(activities), next_wake)


def _time_by_state(done: Iterable[Stretch]) -> Counter[int]:
    """Return the time of each state in some stretches [min]."""
    lasts: Counter[int] = Counter()
    for run in done:
        lasts[run.state] += run.length
    return lasts


def _clusters(done: Sequence[tuple[int, Stretch]]) -> list[list[tuple[int, Stretch]]]:
    """Return stretches, with the number of their day, in groups more than APART from each other."""
    groups: list[list[tuple[int, Stretch]]] = []
    for entry in sorted(done, key=lambda entry: (entry[1].begin, entry[0])):
        if not groups or entry[1].begin - groups[-1][-1][1].begin > APART:
            groups.append([])
        groups[-1].append(entry)
    return groups


def _is_task(stretches: Sequence[Stretch], count: int, days: int) -> bool:
    """Return whether an activity is a task.

    Args:
        stretches: The longest one of each day that has some.
        count: The number of all of them.
        days: The number of days.
    """
    begins = np.array([run.begin for run in stretches], np.float64)
    return (
        len(stretches) >= max(MIN_SHARE * days, 2)
        and count <= 1.3 * len(stretches)
        and float(np.std(begins)) <= SPREAD
        and float(np.mean([run.length for run in stretches])) >= LONG
    )


def _timing(begins: Sequence[int]) -> dict[str, Any]:
    """Return mean, spread and window of times of day [min]."""
    mean = float(np.mean(begins))
    std = float(np.std(begins))
    first, last = min(begins), max(begins)
    return {
        "at": _clock(min(max(round(mean), first), last)),
        "spread": f"{max(1, round(std))} min",
        "between": [_clock(first), _clock(last)],
    }


def _takes(done: Sequence[Stretch]) -> dict[str, Any]:
    """Return the measured law of durations, as quantiles at even steps from 0 to 1."""
    lengths = np.log(np.sort([float(run.length) for run in done]))
    count = min(max(2, 2 * len(lengths) - 1), QUANTILES)
    at = np.linspace(0, len(lengths) - 1, count)
    # Interpolated geometrically, as durations differ by factors.
    values = np.exp(np.interp(at, np.arange(len(lengths)), lengths))
    quantiles = [_seconds(round(60 * v)) for v in values.tolist()]
    # A short minimum duration, so that it may be cut rather than left out.
    return {"law": "measured", "quantiles": quantiles, "at_least": "1 min"}


def _clock(minute: int) -> str:
    return f"{minute // 60 % 24:02}:{minute % 60:02}"


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
