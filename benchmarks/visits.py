"""Visits to kinds of rooms, stays, outings, nights and meals, of logs and of simulated personas.

They are counted in the kinds of rooms and the activities of each second, so that logs and personas
are compared by the same rule.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from datetime import date, timedelta
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import TypeAdapter

from fleet2d.kernels import I16, Bool
from fleet2d.learning.fit.timeline import read_seconds, runs
from fleet2d.logs.layout import read_log
from fleet2d.logs.log import AWAY, ActivityLog, LogError
from fleet2d.routines.life import Life
from fleet2d.routines.persona import AnyPersona

DAY_S, HOUR_S = 86_400, 3_600
# A shorter time in a room is not counted as a visit [s].
PASSING_S = 15
# The limit of short visits, and of the time away from a room to which one returns [s].
SHORT_S, BACK_S = 180, 300
DAYTIME_S = (9 * HOUR_S, 21 * HOUR_S)
BATHROOMS = ("bathroom", "toilet")
# Kinds of rooms that lead to others; visits to them are not counted.
PASSAGES = ("hallway", "entryway", "corridor", "lobby")
START = "2026-01-05"  # a Monday


class RoomTrace(NamedTuple):
    """The kind of room of each second, from midnight on.

    Attributes:
        rooms: Index of the kind, -1 if unknown, int16 (seconds,).
        kinds: The kinds of rooms.
    """

    rooms: I16
    kinds: tuple[str, ...]


class ActivityTrace(NamedTuple):
    """The activity of each second, from midnight on.

    Attributes:
        seconds: Index of the activity, -1 if unknown, int16 (seconds,).
        names: The activities.
    """

    seconds: I16
    names: tuple[str, ...]


def traces_of_log(path: Path) -> tuple[RoomTrace, ActivityTrace]:
    """Return the rooms and the activities of a log.

    Raises:
        LogError: The log can't be read, or is one of positions.
    """
    log = read_log(path)
    if not isinstance(log, ActivityLog):
        raise LogError(f"{path} is a log of positions: give a log of rooms")
    states, seconds = read_seconds(log)
    kinds = tuple(sorted({state.place for state in states}))
    index = np.array([kinds.index(state.place) for state in states] + [-1], np.int16)
    names = tuple(state.activity for state in states)
    return RoomTrace(index[seconds], kinds), ActivityTrace(seconds, names)


def traces_of_persona(persona: Any, days: int, seed: int) -> tuple[RoomTrace, ActivityTrace]:
    """Return the rooms and activities of one who lives alone in the bundled home, with furniture.

    Args:
        persona: The persona, as in a scenario.
        days: The number of days.
        seed: The seed of the run.
    """
    from fleet2d.engine.simulation import run

    stored = run(
        {
            "simulation": {"start": START, "duration": f"{days} d", "seed": seed},
            "floorplan": {"type": "bundled", "furnish": True},
            "users": {"ana": {"type": "routine", "persona": persona}},
        }
    )
    of_room = [room.type for room in stored.plan.rooms]
    kinds = tuple(sorted({*of_room, AWAY}))
    index = np.array([kinds.index(kind) for kind in (*of_room, AWAY)], np.int16)
    rooms = RoomTrace(index[stored.path("ana", every=timedelta(seconds=1)).room], kinds)
    life = Life(TypeAdapter(AnyPersona).validate_python(persona), seed, "users.ana")
    names: dict[str, int] = {}
    seconds = np.full(days * DAY_S, -1, np.int16)
    first = date.fromisoformat(START).toordinal()
    for day in range(-1, days):
        for episode in life.day(first + day):
            begin, end = (max(0, day * DAY_S + at) for at in episode[1:3])
            seconds[begin:end] = names.setdefault(episode.activity, len(names))
    return rooms, ActivityTrace(seconds, tuple(names))


class Visits(NamedTuple):
    """Counts of each whole day.

    Attributes:
        bathroom: Visits to bathrooms and toilets.
        bathroom_daytime: Those from 9 to 21 h.
        short: Visits to any room but hallways that last less than three minutes.
        returns: Times that a room was left and entered again within five minutes.
        comings: Times that the person came home.
    """

    bathroom: list[int]
    bathroom_daytime: list[int]
    short: list[int]
    returns: list[int]
    comings: list[int]


class Stay(NamedTuple):
    """A stay in a kind of room: its beginning [s of the trace] and its length [s]."""

    kind: str
    begin: int
    length: int


def stays(trace: I16, kinds: Sequence[str]) -> list[Stay]:
    """Return the stays of a trace, without passages and rooms that are only passed through.

    Args:
        trace: The index of the kind of room in each second, -1 if unknown.
        kinds: The kinds of rooms.
    """
    result: list[Stay] = []
    for label, begin, length in runs(trace):
        kind = kinds[label] if label >= 0 else ""
        if not kind or kind in PASSAGES or (length < PASSING_S and kind != AWAY):
            continue
        last = result[-1] if result else None
        if last is not None and last.kind == kind and begin - last.begin - last.length < PASSING_S:
            result[-1] = last._replace(length=begin + length - last.begin)
        else:
            result.append(Stay(kind, begin, length))
    return result


def count_visits(trace: I16, kinds: Sequence[str]) -> Visits:
    """Count the visits of each whole day of a trace that begins at midnight."""
    all_stays = stays(trace, kinds)
    counts = np.zeros((len(Visits._fields), len(trace) // DAY_S + 1), np.int64)
    for i, stay in enumerate(all_stays):
        day, second = divmod(stay.begin, DAY_S)
        bath = stay.kind in BATHROOMS
        before = all_stays[i - 1].kind if i else ""
        after = all_stays[i + 1] if i + 1 < len(all_stays) else None
        is_return = after is not None and after.kind == before != stay.kind != AWAY
        counts[0, day] += bath
        counts[1, day] += bath and DAYTIME_S[0] <= second < DAYTIME_S[1]
        counts[2, day] += stay.length < SHORT_S and stay.kind != AWAY
        counts[3, day] += is_return and after is not None and after.begin - stay.begin < BACK_S
        counts[4, day] += before == AWAY
    return Visits(*(row[: len(trace) // DAY_S].tolist() for row in counts))


def spread(homes: Sequence[Visits]) -> tuple[list[int], list[int]]:
    """Return the least and the largest count of a day in some homes, by field of Visits.

    Days without a visit to a bathroom, such as the last day of a log that ends at night, are left
    out.
    """
    lows, highs = [], []
    for field in range(len(Visits._fields)):
        days = [
            home[field][i] for home in homes for i in range(len(home.bathroom)) if home.bathroom[i]
        ]
        lows.append(min(days))
        highs.append(max(days))
    return lows, highs


class Measures(NamedTuple):
    """What is measured of a person's days.

    Attributes:
        bathroom: Visits to bathrooms and toilets, of each day.
        bathroom_min: The length of each of them [min].
        night_bathroom: Those during each night.
        short: Visits of less than three minutes at home, of each day.
        transitions: Changes of room, or to and from out, of each day.
        outings: Times out for more than five minutes, of each day.
        away_h: Time of these [h], of each day.
        return_h: When the last outing of a day ended [h], of each day with one.
        sleep_h: The length of each night's sleep [h].
        bed_h: When it began [h], after midnight more than 24.
        wake_h: When it ended [h].
        meals: Meals and snacks, of each day.
        main_meals: Breakfasts, lunches and dinners, of each day.
        stays_min: The length of each stay in a room at home [min].
    """

    bathroom: list[float]
    bathroom_min: list[float]
    night_bathroom: list[float]
    short: list[float]
    transitions: list[float]
    outings: list[float]
    away_h: list[float]
    return_h: list[float]
    sleep_h: list[float]
    bed_h: list[float]
    wake_h: list[float]
    meals: list[float]
    main_meals: list[float]
    stays_min: list[float]


# Those of which the median is printed; of the others it is the mean.
MEDIANS = ("bathroom_min", "stays_min")
# Main meals, and the least pause between two of them, and between two of any kind [s].
MAIN_MEALS, MAIN_PAUSE_S, PAUSE_S = ("breakfast", "lunch", "dinner"), 1800, 600
# A day counts if more than this share of it is known.
KNOWN_SHARE = 0.8
# An absence and a sleep that are counted last longer than this [s].
ABSENCE_S, SLEEP_S, UP_AT_NIGHT_S = 300, 3 * HOUR_S, HOUR_S


def grouped_stays(trace: RoomTrace) -> list[Stay]:
    """Return stays without a gap: hallways and glances count for the room before them.

    Bathrooms and toilets are one kind, as are kitchens and dining rooms.
    """
    one = {"toilet": "bathroom", "dining_room": "kitchen"}
    result: list[Stay] = []
    for label, begin, length in runs(trace.rooms):
        kind = "" if label < 0 else trace.kinds[label]
        kind = one.get(kind, kind)
        passes = not kind or kind in PASSAGES or (length < PASSING_S and kind != AWAY)
        if result and (passes or result[-1].kind == kind):
            result[-1] = result[-1]._replace(length=begin + length - result[-1].begin)
        elif not passes:
            result.append(Stay(kind, begin, length))
    return result


def _spans(flags: Bool, pause_s: int) -> list[tuple[int, int]]:
    """Return begins and ends of the times that are flagged; shorter pauses don't end one."""
    joined: list[tuple[int, int]] = []
    for flag, begin, length in runs(flags.astype(np.int16)):
        if not flag:
            continue
        if joined and begin - joined[-1][1] <= pause_s:
            joined[-1] = joined[-1][0], begin + length
        else:
            joined.append((begin, begin + length))
    return joined


def measure(trace: RoomTrace, activities: ActivityTrace) -> Measures:
    """Measure the days of a person.

    Args:
        trace: The kind of room in each second, from midnight.
        activities: The activity in each second.
    """
    known = (trace.rooms[: len(trace.rooms) // DAY_S * DAY_S] >= 0).reshape(-1, DAY_S)
    days = np.flatnonzero(known.mean(axis=1) > KNOWN_SHARE).tolist()
    all_stays = grouped_stays(trace)

    def by_day(begins: Iterable[int]) -> list[float]:
        counts = Counter(begin // DAY_S for begin in begins)
        return [float(counts[day]) for day in days]

    def doing(test: Callable[[str], bool]) -> Bool:
        which = np.array([test(name) for name in activities.names] + [False])
        return which[activities.seconds]

    bathroom = [stay for stay in all_stays if stay.kind == "bathroom"]
    outings = [(s.begin, s.begin + s.length) for s in all_stays if s.kind == AWAY]
    outings = [(begin, end) for begin, end in outings if end - begin > ABSENCE_S]
    returns = [max((e % DAY_S for _, e in outings if e // DAY_S == d), default=-1) for d in days]
    nights = _spans(doing(lambda name: "sleep" in name or "toilet_trans" in name), UP_AT_NIGHT_S)
    nights = [(begin, end) for begin, end in nights if end - begin > SLEEP_S]
    is_main = doing(lambda name: name.removeprefix("eat_") in MAIN_MEALS)
    is_meal = is_main | doing(lambda name: name == "snack")
    return Measures(
        bathroom=by_day(stay.begin for stay in bathroom),
        bathroom_min=[stay.length / 60 for stay in bathroom],
        night_bathroom=[
            float(sum(begin + 60 <= stay.begin <= end - 180 for stay in bathroom))
            for begin, end in nights
        ],
        short=by_day(s.begin for s in all_stays if s.length < SHORT_S and s.kind != AWAY),
        transitions=by_day(stay.begin for stay in all_stays),
        outings=by_day(begin for begin, _ in outings),
        away_h=[
            sum(max(0, min(e, DAY_S * (d + 1)) - max(b, DAY_S * d)) for b, e in outings) / HOUR_S
            for d in days
        ],
        return_h=[end / HOUR_S for end in returns if end >= 0],
        sleep_h=[(end - begin) / HOUR_S for begin, end in nights],
        bed_h=[(begin / HOUR_S - 12) % 24 + 12 for begin, _ in nights],
        wake_h=[end / HOUR_S % 24 for _, end in nights],
        meals=by_day(begin for begin, _ in _spans(is_meal, PAUSE_S)),
        main_meals=by_day(begin for begin, _ in _spans(is_main, MAIN_PAUSE_S)),
        stays_min=[s.length / 60 for s in all_stays[1:-1] if s.kind != AWAY],
    )
