"""Personas fitted to the days of a log, and how well their days match days held back."""

import math
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from typing import Any, Literal, NamedTuple

import numpy as np
import yaml

from fleet2d.fit.timeline import (
    ActivityPlace,
    Distances,
    LivedDay,
    Stretch,
    Timeline,
    distances,
    find_days,
    sleep_states,
)
from fleet2d.kernels import I16
from fleet2d.logs.log import AWAY, LogError
from fleet2d.logs.placement import USUAL_ROOMS
from fleet2d.routines.activity import Activity, seconds
from fleet2d.routines.distributions import KNOTS, exponential
from fleet2d.routines.life import Life
from fleet2d.routines.persona import Persona
from fleet2d.routines.planner import Episode, RecordedDay, write_day
from fleet2d.runtime.clock import DAY_MINUTES, DAY_S
from fleet2d.runtime.determinism import Draws, stream_key

BLOCK = 180  # length of a part of the day that has pastimes of its own [min]
QUANTILES = 21  # maximum number of quantiles of a law of durations
# Words of activities that are done standing, lying and sitting; the first that fit decide.
STAND = ("cook", "prepar", "wash", "dish", "clean", "transition", "hygiene", "bathing")
LIE, SIT = ("sleep", "nap", "bed", "wake_up"), ("eat", "tv", "work", "read", "relax", "computer",
    "breakfast", "lunch", "dinner", "snack", "music", "rest", "social", "toilet")  # fmt: skip
# A task is done on at least this share of the days, at most once a day. The standard deviation of
# its beginning is at most SPREAD, and the gap to begins at other times more than APART [min].
MIN_SHARE, SPREAD, APART = 0.8, 20, 60
LONG = 10  # minimum mean duration of a task [min]
MIN_TEMPLATE_DAYS = 4  # minimum number of days of a kind from which a template is fitted
WORKDAYS = 5
Model = Literal["recorded", "laws"]
# The date of the first sampled day, a Monday.
MONDAY = date(2017, 1, 2).toordinal()
MODELS = (
    "the persona", "copies of whole days", "a first-order Markov chain",
    "the days they were fitted on",
)  # fmt: skip
# Two distances that differ by less than this count as equal.
EQUAL = 0.0005
FOLDS = 3
SAMPLED = 700  # the number of days drawn from a persona, whole weeks
CHAIN_DAYS = 140  # the number of days drawn from the chain


@dataclass
class FittedPersona:
    """A fitted persona.

    Attributes:
        document: The persona as plain data, as in its YAML file.
        persona: The persona.
        states: The timeline's state of each of its activities.
        notes: Decisions that the fit had to make.
    """

    document: dict[str, Any]
    persona: Persona
    states: dict[str, int]
    notes: list[str] = field(default_factory=list)


def fit_persona(
    timeline: Timeline, days: Sequence[LivedDay], about: str = "", *, model: Model = "recorded"
) -> FittedPersona:
    """Fit a persona to days of a log.

    With the model `recorded`, its days are drawn from those of the log, and switch from one to
    another where both have the same activity at about the same time.

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
    templates = {}
    for name, (on, members) in kinds.items():
        if model == "recorded":
            templates[name] = {"on": on, "recorded": fitter.recorded(members)}
        else:
            kind = name if len(kinds) > 1 else ""
            templates[name] = {"on": on, **fitter.template(members, kind)}
    fitter.sleep(days, gets_up=model == "laws")
    fitter.rest(days)
    document = {
        "about": about or f"fitted to {len(days)} days of a log",
        "activities": fitter.activities,
        "needs": {},  # their activities are in the log
        "errands": {},
        "days": templates,
    }
    return FittedPersona(document, Persona.model_validate(document), fitter.states, notes)


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
        note = (
            f"{len(weekdays)} weekdays and {len(weekend)} days of weekends: too few for two kinds"
        )
        return {"every_day": ("daily", list(days))}, [note]
    return {"weekday": ("weekdays", weekdays), "weekend": ("weekend", weekend)}, []


def _names(timeline: Timeline) -> list[str]:
    """Return a name for each state: its activity, with its room if it is done in several."""
    asleep = sleep_states(timeline)
    lasts = np.bincount(
        timeline.minutes[timeline.minutes >= 0], minlength=len(timeline.states)
    ).tolist()
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
        least_night = (
            self.dawn + DAY_MINUTES - max(beds)
        )  # if the next day begins as early as possible
        tasks, rest = self._tasks(days)
        return {
            "wake": _timing(wakes),
            "sleep": {**_timing(beds), "at_least": _minutes(max(1, min(shortest, least_night)))},
            "do": tasks,
            "leisure": self._leisure(rest, min(wakes), kind),
        }

    def _tasks(self, days: Sequence[LivedDay]) -> tuple[dict[str, Any], list[Stretch]]:
        """Return the tasks, and the stretches that are part of none."""
        by_state: dict[int, list[tuple[int, Stretch]]] = defaultdict(list)
        for day in days:
            for run in day.awake:
                by_state[run.state].append((day.number, run))
        tasks, rest = {}, []
        for state, done in sorted(by_state.items()):
            for number, cluster in enumerate(_clusters(done)):
                longest: dict[int, Stretch] = {}
                for number_of_day, run in cluster:
                    known = longest.get(number_of_day)
                    if known is None or run.length > known.length:
                        longest[number_of_day] = run
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
                self._add(self.names[state], state, stretches)
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
                self._add(name, state, done)
                leisure[name] = {
                    "weight": float(len(done)),
                    "between": [_clock(first), _clock(last)],
                }
        return leisure

    @staticmethod
    def _main_state(done: Sequence[Stretch]) -> tuple[int, bool]:
        """Return the state with the most time, and whether that is more than half of the time."""
        lasts: dict[int, int] = defaultdict(int)
        for run in done:
            lasts[run.state] += run.length
        state = max(lasts, key=lambda s: (lasts[s], -s))
        return state, 2 * lasts[state] > sum(lasts.values())

    def recorded(self, days: Sequence[LivedDay]) -> list[str]:
        """Return days as texts of recorded days."""
        by_state: dict[int, list[Stretch]] = defaultdict(list)
        for day in days:
            for run in (*day.awake, *day.up):
                by_state[run.state].append(run)
        for state, done in sorted(by_state.items()):
            self._add(self.names[state], state, done)
        return [write_day(_recorded_day(day, self.names)) for day in days]

    def sleep(self, days: Sequence[LivedDay], *, gets_up: bool) -> None:
        """Describe sleep, and how often and how long the person is up at night."""
        state = max(sleep_states(self.timeline), key=lambda s: (self.timeline.minutes == s).sum())
        fields = self._where(state) | {"posture": "lie"}
        places = self.timeline.states
        up = [r for day in days for r in day.up if places[r.state].place not in (AWAY,)]
        own = places[state].place
        up = [run for run in up if gets_up and places[run.state].place != own]
        if up:
            asleep = sum(day.next_wake - day.bed for day in days) - sum(r.length for r in up)
            rooms: dict[str, int] = defaultdict(int)
            for run in up:
                rooms[places[run.state].place] += 1
            usual = max(rooms, key=lambda place: (rooms[place], place))
            fields |= {
                "fetches": _minutes(max(1, asleep // len(up))),
                "fetches_from": [usual, "any"],
                "fetch_takes": _takes(up),
            }
        self.activities["sleep"] = fields
        self.states["sleep"] = state

    def rest(self, days: Sequence[LivedDay]) -> None:
        """Describe rest, for times in which nothing else fits, by the most frequent state."""
        lasts: dict[int, int] = defaultdict(int)
        for day in days:
            for run in day.awake:
                lasts[run.state] += run.length
        home = {s: n for s, n in lasts.items() if self.timeline.states[s].place != AWAY}
        state = max(home or lasts, key=lambda s: (lasts[s], -s))
        self.activities["rest"] = self._where(state) | {"takes": "15 min"}
        self.states["rest"] = state

    def _add(self, name: str, state: int, done: Sequence[Stretch]) -> None:
        self.activities[name] = self._where(state) | {"takes": _takes(done)}
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


def _recorded_day(day: LivedDay, names: Sequence[str]) -> RecordedDay:
    """Return a day of a log as a recorded day; in unknown times, the activity before continues."""
    entries = [(run.begin, names[run.state]) for run in day.awake] or [(day.wake, "rest")]
    entries[0] = (day.wake, entries[0][1])
    entries.append((day.bed, "sleep"))
    for run in day.up:
        entries += [(run.begin, names[run.state]), (run.begin + run.length, "sleep")]
    entries = [e for e in dict(entries).items() if e[0] < day.next_wake]
    last = [e for e in entries if e[0] < day.next_wake - 1]
    if last[-1][1] != "sleep":
        last.append((day.next_wake - 1, "sleep"))
    changes = [e for i, e in enumerate(last) if not i or e[1] != last[i - 1][1]]
    begins, activities = zip(*changes, strict=True)
    return RecordedDay(tuple(60 * at for at in begins), tuple(activities), 60 * day.next_wake)


def _clusters(done: Sequence[tuple[int, Stretch]]) -> list[list[tuple[int, Stretch]]]:
    """Return stretches, with the number of their day, in groups more than APART from each other."""
    ordered = sorted(done, key=lambda entry: (entry[1].begin, entry[0]))
    groups: list[list[tuple[int, Stretch]]] = []
    for entry in ordered:
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
    mean, std = float(np.mean(begins)), float(np.std(begins))
    first, last = min(begins), max(begins)
    return {
        "at": _clock(min(max(round(mean), first), last)),
        "spread": _minutes(max(1, round(std))),
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


def _minutes(minutes: int) -> str:
    return f"{minutes} min"


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


def sample_persona(
    fitted: FittedPersona, timeline: Timeline, days: int, seed: int = 0
) -> tuple[I16, I16]:
    """Return days drawn from a persona: for each minute a state and a place.

    Returns:
        Indices of `timeline.states`, and of `timeline.places`; int16 (days, 1440) each.
    """
    life = Life(fitted.persona, seed, "fit")
    key = stream_key(seed, "fit", "up at night")
    places = timeline.places
    place_of = {n: places.index(timeline.states[s].place) for n, s in fitted.states.items()}
    states = np.zeros((days + 2) * DAY_S, np.int16)
    rooms = np.zeros((days + 2) * DAY_S, np.int16)
    for day in range(days + 1):  # the first night is of the day before the first
        ordinal = MONDAY - 1 + day
        for i, episode in enumerate(life.day(ordinal)):
            begin, end = day * DAY_S + episode.begin, day * DAY_S + episode.end
            states[begin:end] = fitted.states[episode.activity]
            rooms[begin:end] = place_of[episode.activity]
            activity = fitted.persona.activity(episode.activity)
            if activity.fetches is not None and activity.fetches_from[0] in places:
                place = places.index(activity.fetches_from[0])
                for first, last in _fetches(activity, episode, Draws(key, ordinal * 1024 + i)):
                    rooms[day * DAY_S + first : day * DAY_S + last] = place
    sample = slice(DAY_S + 30, (days + 1) * DAY_S + 30, 60)  # the middles of the minutes
    return states[sample].reshape(-1, DAY_MINUTES), rooms[sample].reshape(-1, DAY_MINUTES)


def _fetches(activity: Activity, episode: Episode, draws: Draws) -> list[tuple[int, int]]:
    """Return begin and end [s] of each short trip during an activity, drawn as for residents."""
    assert activity.fetches is not None
    wait, takes = exponential(seconds(activity.fetches)), activity.fetch_takes.table()
    times = []
    now = episode.begin + wait.knots[draws.below(KNOTS)]
    while now < episode.end:
        end = now + takes.draw(draws)
        if end < episode.end:
            times.append((now, end))
        now = end + wait.knots[draws.below(KNOTS)]
    return times


def sample_days(labels: I16, days: int, seed: int = 0) -> I16:
    """Return copies of whole days, drawn with replacement, int16 (days, 1440)."""
    draws = Draws(stream_key(seed, "fit", "whole days"), 0)
    return labels[[draws.below(len(labels)) for _ in range(days)]]


def sample_markov(labels: I16, count: int, days: int, seed: int = 0) -> I16:
    """Return days of the first-order Markov chain of some days' minutes, int16 (days, 1440).

    Its transition probabilities are the relative frequencies of the label in the next minute. The
    first label is drawn by the frequency of the labels.
    """
    follows = np.zeros((count, count), np.int64)
    known = (labels[:, :-1] >= 0) & (labels[:, 1:] >= 0)
    np.add.at(follows, (labels[:, :-1][known], labels[:, 1:][known]), 1)
    share = np.bincount(labels[labels >= 0], minlength=count)
    for label in range(count):
        if not follows[label].any():
            follows[label] = share
    limits: list[list[int]] = follows.cumsum(axis=1).tolist()
    draws = Draws(stream_key(seed, "fit", "markov"), 0)
    out = np.empty(days * DAY_MINUTES, np.int16)
    at = bisect_right(share.cumsum().tolist(), draws.below(int(share.sum())))
    for minute in range(len(out)):
        out[minute] = at
        at = bisect_right(limits[at], draws.below(limits[at][-1]))
    return out.reshape(-1, DAY_MINUTES)


class Validation(NamedTuple):
    """Distances to held-back days, averaged over the folds.

    Attributes:
        days: The number of days, each held back once.
        folds: The number of parts that were held back in turn.
        rooms: The distances of rooms, for each model of MODELS.
        activities: The distances of activities, for each model of MODELS.
    """

    days: int
    folds: int
    rooms: tuple[Distances, ...]
    activities: tuple[Distances, ...]

    def worse_than_copying(self) -> list[str]:
        """Return a line for each measure in which the persona is worse than days copied from a log.

        The measures compare in which rooms somebody is with the days held back.
        """
        persona, copies = self.rooms[0], self.rooms[1]
        keys = {"dwell times (KS)": "ks", "hours": "hours", "time shares": "share"}
        return [
            f"{name} {getattr(persona, key):.3f}, copies {getattr(copies, key):.3f}"
            for name, key in keys.items()
            if getattr(persona, key) > getattr(copies, key) + EQUAL
        ]


def validate(
    timeline: Timeline, folds: int = FOLDS, seed: int = 0, *, model: Model = "recorded"
) -> Validation:
    """Fit a persona to a part of the days and compare it with the others, for each part in turn.

    With three parts, every third day is held back, so that each part has early and late days.

    Raises:
        LogError: There are too few days to hold any back.
    """
    days = find_days(timeline)
    if len(days) < 3:
        raise LogError(
            f"the log has {len(days)} whole days, with a night before and after: three are needed"
            " at least, to hold one back"
        )
    folds = min(folds, len(days))
    rooms, activities = [], []
    for fold in range(folds):
        held = days[fold::folds]
        rest = [day for day in days if day not in held]
        of_rooms, of_activities = _fold(timeline, rest, held, seed, model)
        rooms.append(of_rooms)
        activities.append(of_activities)
    return Validation(len(days), folds, _mean(rooms), _mean(activities))


def _fold(
    timeline: Timeline, rest: Sequence[LivedDay], held: Sequence[LivedDay], seed: int, model: Model
) -> tuple[tuple[Distances, ...], tuple[Distances, ...]]:
    """Return how far the days of each model are from days held back: in rooms, in activities."""
    fitted = fit_persona(timeline, rest, model=model)
    states, rooms = sample_persona(fitted, timeline, SAMPLED, seed)
    rest_days, held_days = ([day.number for day in part] for part in (rest, held))
    place_count, state_count = len(timeline.places), len(timeline.states)
    result = []
    for sampled, labels, count in (
        (rooms, timeline.rooms, place_count),
        (states, timeline.minutes, state_count),
    ):
        real: I16 = labels[held_days]
        copies = sample_days(labels[rest_days], SAMPLED, seed)
        chain = sample_markov(labels[rest_days], count, CHAIN_DAYS, seed)
        models = (sampled, copies, chain, labels[rest_days])
        result.append(tuple(distances(real, other, count) for other in models))
    return result[0], result[1]


def _mean(folds: Sequence[tuple[Distances, ...]]) -> tuple[Distances, ...]:
    """Return the mean distances of each model over the folds."""
    return tuple(Distances(*row) for row in np.mean(np.array(folds), axis=0).tolist())
