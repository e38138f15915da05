"""Visits to kinds of rooms a day, short ones, and returns, of logs and of simulated personas.

They are counted in the kinds of rooms of each second, so that logs and personas are compared by
the same rule.
"""

from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fleet2d.fit.timeline import read_seconds, runs
from fleet2d.kernels import I16
from fleet2d.logs.layouts import read_log
from fleet2d.logs.log import AWAY, ActivityLog, LogError

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


def trace_of_log(path: Path) -> RoomTrace:
    """Return the trace of a log of rooms and activities.

    Raises:
        LogError: The log can't be read, or is one of positions.
    """
    log = read_log(path)
    if not isinstance(log, ActivityLog):
        raise LogError(f"{path} is a log of positions: give a log of rooms")
    states, seconds = read_seconds(log)
    kinds = tuple(sorted({state.place for state in states}))
    index = np.array([kinds.index(state.place) for state in states] + [-1], np.int16)
    return RoomTrace(index[seconds], kinds)


def trace_of_persona(persona: str, days: int, seed: int) -> RoomTrace:
    """Return the trace of a persona that lives alone in the bundled home, with furniture."""
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
    return RoomTrace(index[stored.path("ana", every=timedelta(seconds=1)).room], kinds)


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
