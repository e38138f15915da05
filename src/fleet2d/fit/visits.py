"""How people move about a home: visits to each kind of room per day, short ones, and returns.

What is compared is second by second the kind of room that somebody is in, from a log or from a
simulated run, so that both are counted by one rule.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.fit.timeline import runs
from fleet2d.logs.log import AWAY

I16 = NDArray[np.int16]
DAY_S, HOUR_S = 86_400, 3_600
# Less than this in a room is passing through [s].
PASSING_S = 15
# A visit shorter than this is short [s]; who is back within this long made a way there and back.
SHORT_S, BACK_S = 180, 300
DAYTIME_S = (9 * HOUR_S, 21 * HOUR_S)
BATHROOMS = ("bathroom", "toilet")
# In such rooms nobody stays: they lead to others.
WAYS = ("hallway", "entryway", "corridor", "lobby")


class Visits(NamedTuple):
    """Counts of each whole day.

    Attributes:
        bathroom: Visits to bathrooms and toilets.
        bathroom_daytime: Those from 9 to 21 h.
        short: Visits to any room but hallways that last less than three minutes.
        returns: Ways out of a room and back into it within five minutes.
        comings: How often one came home.
    """

    bathroom: list[int]
    bathroom_daytime: list[int]
    short: list[int]
    returns: list[int]
    comings: list[int]


class Stay(NamedTuple):
    """A stay in a kind of room: from when [s of the trace], and how long [s]."""

    kind: str
    begin: int
    length: int


def stays(trace: I16, kinds: Sequence[str]) -> list[Stay]:
    """Return the stays of a trace, without the rooms that one only passes through.

    Args:
        trace: The index of the kind of room in each second, -1 where nobody knows.
        kinds: The kinds of rooms.
    """
    result: list[Stay] = []
    for label, begin, length in runs(trace):
        kind = kinds[label] if label >= 0 else ""
        if not kind or kind in WAYS or (length < PASSING_S and kind != AWAY):
            continue
        last = result[-1] if result else None
        if last is not None and last.kind == kind and begin - last.begin - last.length < PASSING_S:
            result[-1] = last._replace(length=begin + length - last.begin)
        else:
            result.append(Stay(kind, begin, length))
    return result


def count_visits(trace: I16, kinds: Sequence[str]) -> Visits:
    """Count the visits of each whole day of a trace that begins at midnight."""
    found = stays(trace, kinds)
    counts = np.zeros((len(Visits._fields), len(trace) // DAY_S + 1), np.int64)
    for i, stay in enumerate(found):
        day, second = divmod(stay.begin, DAY_S)
        bath = stay.kind in BATHROOMS
        before = found[i - 1].kind if i else ""
        back = i + 1 < len(found) and found[i + 1].kind == before != stay.kind
        counts[0, day] += bath
        counts[1, day] += bath and DAYTIME_S[0] <= second < DAYTIME_S[1]
        counts[2, day] += stay.length < SHORT_S and stay.kind != AWAY
        counts[3, day] += back and found[i + 1].begin - stay.begin < BACK_S and stay.kind != AWAY
        counts[4, day] += before == AWAY
    return Visits(*(row[: len(trace) // DAY_S].tolist() for row in counts))


def spread(homes: Sequence[Visits]) -> tuple[list[int], list[int]]:
    """Return the lowest and the highest count of any day of some homes, by field of Visits.

    Days on which nobody was seen at all, such as the last of a log that ends at night, don't count.
    """
    lows, highs = [], []
    for field in range(len(Visits._fields)):
        days = [
            home[field][i] for home in homes for i in range(len(home.bathroom)) if home.bathroom[i]
        ]
        lows.append(min(days))
        highs.append(max(days))
    return lows, highs
