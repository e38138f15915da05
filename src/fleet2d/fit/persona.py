"""A persona fitted to days: when it wakes and sleeps, what it does when, what fills the rest."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from fleet2d.fit.days import Day, Run, sleep_states
from fleet2d.fit.timeline import MINUTES, State, Timeline
from fleet2d.logs.log import AWAY, LogError
from fleet2d.logs.rooms import USUAL
from fleet2d.routines.persona import Persona
from fleet2d.routines.recorded import RecordedDay, write_day

BLOCK = 180  # minutes of a day that share what is done to fill the time
QUANTILES = 21  # of a law of durations, at most
LIE, SIT = ("sleep", "nap", "bed", "wake_up"), ("eat", "tv", "work", "read", "relax", "computer",
    "breakfast", "lunch", "dinner", "snack", "music", "rest", "social", "toilet")  # fmt: skip
# An appointment is kept on this share of days or more, once a day, about the same time.
KEPT, SPREAD, APART = 0.8, 20, 60  # share, min, min
LONG = 10  # min; shorter things are no appointments
FEWEST = 4  # days of a kind from which a template is fitted
WORKDAYS = 5
Model = Literal["recorded", "laws"]


@dataclass
class Fitted:
    """A persona and what it was fitted to.

    Attributes:
        document: As its YAML has it.
        persona: As it is read from that.
        states: The state of the timeline that each of its activities stands for.
        notes: What the fit had to decide.
    """

    document: dict[str, Any]
    persona: Persona
    states: dict[str, int]
    notes: list[str] = field(default_factory=list)


def fit_persona(
    timeline: Timeline, days: Sequence[Day], about: str = "", *, model: Model = "recorded"
) -> Fitted:
    """Fit a persona to days of a log.

    Of model `recorded`, its days are drawn from those of the log, of which each goes on as another
    where both do the same at about the same time.

    Of model `laws`: what is done once on most days at about the same time becomes a task with the
    mean and spread of its beginning, the measured law of its duration and the share of days that
    have it. All else fills the rest: per three hours of the day a weighted choice, with the
    measured durations of what began in them. Getting up at night becomes the fetching of sleep.

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
        "needs": {},  # the log has them already
        "errands": {},
        "days": templates,
    }
    return Fitted(document, Persona.model_validate(document), fitter.states, notes)


def _kinds_of_days(
    timeline: Timeline, days: Sequence[Day]
) -> tuple[dict[str, tuple[str, list[Day]]], list[str]]:
    """Return weekdays and weekend, or all days as one kind where either has too few."""
    if timeline.weekdays is None:
        return {"every_day": ("daily", list(days))}, ["no dates: all days are of one kind"]
    weekdays = [day for day in days if timeline.weekdays[day.number] < WORKDAYS]
    weekend = [day for day in days if timeline.weekdays[day.number] >= WORKDAYS]
    if min(len(weekdays), len(weekend)) < FEWEST:
        note = (
            f"{len(weekdays)} weekdays and {len(weekend)} days of weekends: too few to tell apart"
        )
        return {"every_day": ("daily", list(days))}, [note]
    return {"weekday": ("weekdays", weekdays), "weekend": ("weekend", weekend)}, []


def _names(timeline: Timeline) -> list[str]:
    """Return a name for each state: its activity, with its room where it is done in several."""
    asleep = sleep_states(timeline)
    lasts = np.bincount(
        timeline.minutes[timeline.minutes >= 0], minlength=len(timeline.states)
    ).tolist()
    most: dict[str, int] = {}
    for i in sorted(range(len(timeline.states)), key=lambda i: -lasts[i]):
        most.setdefault(_called(timeline.states[i], i in asleep), i)
    names = []
    for i, state in enumerate(timeline.states):
        called = _called(state, i in asleep)
        names.append(called if most[called] == i else f"{called}_in_{state.place}")
    return names


def _called(state: State, asleep: bool) -> str:
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

    def template(self, days: Sequence[Day], kind: str) -> dict[str, Any]:
        """Return the template of a kind of days."""
        wakes = [day.wake for day in days]
        beds = [day.bed for day in days]
        shortest = min(day.next_wake - day.bed for day in days)
        room = self.dawn + MINUTES - max(beds)  # however early the next day begins
        tasks, rest = self._tasks(days)
        return {
            "wake": _timing(wakes),
            "sleep": {**_timing(beds), "at_least": _minutes(max(1, min(shortest, room)))},
            "do": tasks,
            "leisure": self._leisure(rest, min(wakes), kind),
        }

    def _tasks(self, days: Sequence[Day]) -> tuple[dict[str, Any], list[Run]]:
        """Return what is done once a day at its time, and the runs that are none of it."""
        by_state: dict[int, list[tuple[int, Run]]] = defaultdict(list)
        for day in days:
            for run in day.awake:
                by_state[run.state].append((day.number, run))
        tasks, rest = {}, []
        for state, done in sorted(by_state.items()):
            for number, cluster in enumerate(_clusters(done)):
                longest: dict[int, Run] = {}
                for number_of_day, run in cluster:
                    known = longest.get(number_of_day)
                    if known is None or run.length > known.length:
                        longest[number_of_day] = run
                if not _is_appointment(list(longest.values()), len(cluster), len(days)):
                    rest += [run for _, run in cluster]
                    continue
                kept = list(longest.values())
                name = self.names[state] + (f"_{number + 1}" if number else "")
                tasks[name] = {
                    **({"activity": self.names[state]} if number else {}),
                    **_timing([run.begin for run in kept]),
                    "takes": _takes(kept),
                    # Below 1, so that a full day is possible without it.
                    "probability": round(min(len(kept) / len(days), 0.99), 3),
                }
                self._add(self.names[state], state, kept)
                rest += [run for n, run in cluster if longest[n] is not run]
        return tasks, rest

    def _leisure(self, rest: Iterable[Run], dawn: int, kind: str) -> dict[str, Any]:
        """Return what fills the rest: of the stays that began in each block of the day, how often.

        All stays in a room are one pastime, for nobody leaves a room to go to the same.
        """
        blocks: dict[int, dict[str, list[Run]]] = defaultdict(lambda: defaultdict(list))
        for run in rest:
            place = self.timeline.states[run.state].place
            blocks[(run.begin - dawn) // BLOCK][place].append(run)
        leisure = {}
        for block in sorted(blocks):
            first = dawn + block * BLOCK
            if first >= dawn + MINUTES:
                continue
            last = min(first + BLOCK, dawn + MINUTES) - 1
            for _, done in sorted(blocks[block].items()):
                state, most = self._most(done)
                called = self.names[state] if most else f"in_{self.timeline.states[state].place}"
                words = [called, *([kind] if kind else []), f"{first // 60 % 24:02}h"]
                name = "_".join(words)
                self._add(name, state, done)
                leisure[name] = {
                    "weight": float(len(done)),
                    "between": [_clock(first), _clock(last)],
                }
        return leisure

    @staticmethod
    def _most(done: Sequence[Run]) -> tuple[int, bool]:
        """Return the state that stays are most of, and whether that is most of their time."""
        lasts: dict[int, int] = defaultdict(int)
        for run in done:
            lasts[run.state] += run.length
        state = max(lasts, key=lambda s: (lasts[s], -s))
        return state, 2 * lasts[state] > sum(lasts.values())

    def recorded(self, days: Sequence[Day]) -> list[str]:
        """Return days as they were lived, with a name for each state."""
        by_state: dict[int, list[Run]] = defaultdict(list)
        for day in days:
            for run in (*day.awake, *day.up):
                by_state[run.state].append(run)
        for state, done in sorted(by_state.items()):
            self._add(self.names[state], state, done)
        return [write_day(_as_lived(day, self.names)) for day in days]

    def sleep(self, days: Sequence[Day], *, gets_up: bool) -> None:
        """Describe sleep, and how often and for how long one is up at night."""
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

    def rest(self, days: Sequence[Day]) -> None:
        """Describe what is done where nothing else fits: what is done most."""
        lasts: dict[int, int] = defaultdict(int)
        for day in days:
            for run in day.awake:
                lasts[run.state] += run.length
        home = {s: n for s, n in lasts.items() if self.timeline.states[s].place != AWAY}
        state = max(home or lasts, key=lambda s: (lasts[s], -s))
        self.activities["rest"] = self._where(state) | {"takes": "15 min"}
        self.states["rest"] = state

    def _add(self, name: str, state: int, done: Sequence[Run]) -> None:
        self.activities[name] = self._where(state) | {"takes": _takes(done)}
        self.states[name] = state

    def _where(self, state: int) -> dict[str, Any]:
        activity, place = self.timeline.states[state]
        if place == AWAY:
            return {"away": True}
        rooms = dict.fromkeys([place, *USUAL.get(place, ()), "any"])
        posture = "lie" if any(word in activity for word in LIE) else "stand"
        if posture == "stand" and any(word in activity for word in SIT):
            posture = "sit"
        return {"rooms": list(rooms), "posture": posture}


def _as_lived(day: Day, names: Sequence[str]) -> RecordedDay:
    """Return a day of a log; what nobody knows of it is taken for going on with what one did."""
    entries = [(run.begin, names[run.state]) for run in day.awake] or [(day.wake, "rest")]
    entries[0] = (day.wake, entries[0][1])
    entries.append((day.bed, "sleep"))
    for run in day.up:
        entries += [(run.begin, names[run.state]), (run.begin + run.length, "sleep")]
    entries = [e for e in dict(entries).items() if e[0] < day.next_wake]
    last = [e for e in entries if e[0] < day.next_wake - 1]
    if last[-1][1] != "sleep":
        last.append((day.next_wake - 1, "sleep"))
    kept = [e for i, e in enumerate(last) if not i or e[1] != last[i - 1][1]]
    begins, activities = zip(*kept, strict=True)
    return RecordedDay(tuple(60 * at for at in begins), tuple(activities), 60 * day.next_wake)


def _clusters(done: Sequence[tuple[int, Run]]) -> list[list[tuple[int, Run]]]:
    """Return runs by time of day, in groups that are an hour or more apart."""
    ordered = sorted(done, key=lambda entry: (entry[1].begin, entry[0]))
    groups: list[list[tuple[int, Run]]] = []
    for entry in ordered:
        if not groups or entry[1].begin - groups[-1][-1][1].begin > APART:
            groups.append([])
        groups[-1].append(entry)
    return groups


def _is_appointment(kept: Sequence[Run], count: int, days: int) -> bool:
    begins = np.array([run.begin for run in kept], np.float64)
    return (
        len(kept) >= max(KEPT * days, 2)
        and count <= 1.3 * len(kept)
        and float(np.std(begins)) <= SPREAD
        and float(np.mean([run.length for run in kept])) >= LONG
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


def _takes(done: Sequence[Run]) -> dict[str, Any]:
    """Return the measured law of durations, as quantiles at even steps from 0 to 1."""
    lengths = np.log(np.sort([float(run.length) for run in done]))
    count = min(max(2, 2 * len(lengths) - 1), QUANTILES)
    at = np.linspace(0, len(lengths) - 1, count)
    # Durations differ by factors: between two measured ones, their geometric means.
    values = np.exp(np.interp(at, np.arange(len(lengths)), lengths))
    quantiles = [_seconds(round(60 * v)) for v in values.tolist()]
    # It may be broken off by what comes next, rather than not be begun.
    return {"law": "measured", "quantiles": quantiles, "at_least": "1 min"}


def _clock(minute: int) -> str:
    return f"{minute // 60 % 24:02}:{minute % 60:02}"


def _minutes(minutes: int) -> str:
    return f"{minutes} min"


def _seconds(seconds: int) -> str:
    return f"{seconds // 60} min" if seconds % 60 == 0 else f"{seconds} s"


def to_yaml(document: Mapping[str, Any]) -> str:
    """Write a persona as people read it: one line for each activity and task."""
    lines = [f"about: {document['about']}", "activities:"]
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


def _flow(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_flow(v)}" for key, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_flow(v) for v in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str) and (":" in value or not value):
        return f'"{value}"'
    return f"{value:g}" if isinstance(value, float) else str(value)
