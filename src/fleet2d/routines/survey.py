"""Time use as a survey found it, and lives whose shares follow it.

The survey says which share of people does what at each hour. A person goes through the day in steps
of ten minutes. From one step to the next, those whose episode is over by its law of durations
leave, and as many more of an activity as it has to shrink by; everybody who left goes where people
are wanted. With the numbers of people by activity and age of episode followed through the week,
both can be worked out beforehand, so that every person draws alone and yet the shares come out
exactly, but for chance:

    stay(a, age) = (1 - hazard(a, age)) * min(1, wanted(a) / would stay(a))
    go to b      ~ wanted(b) - staying(b)

A leaver who draws what they did before just goes on. Durations so follow the survey's means where
the shares leave room for it.
"""

import json
from collections.abc import Sequence
from datetime import date
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.routines.laws import KNOTS, Law, lognormal, position
from fleet2d.streams import Draws

TABLE = Path(__file__).parent / "survey.json"
CATEGORIES = (
    "sleeping", "work", "eating", "food_prep", "laundry", "exercise", "travel", "tv", "other",
)  # fmt: skip
STEP_S = 600
DAY_STEPS = 144
WEEK_STEPS = 7 * DAY_STEPS
DAWN_S = 4 * 3600  # the survey's days begin at 04:00
AGES = 96  # steps that an episode's age is followed; older ones count as that old
ONE = 1 << 24
WARM_UP_WEEKS = 2
SLEEP_S = (8 * 3600, 3600)  # the survey cuts nights at 04:00, so its mean is of no use
SPREAD = 0.6  # of an episode's duration, beside its mean

F64 = NDArray[np.float64]


class Block(NamedTuple):
    """A stretch of time in one category [s since the midnight of the day's date]."""

    category: str
    begin: int
    end: int


class State(NamedTuple):
    """What somebody is in the middle of: the category's number, and since how many steps."""

    category: int
    age: int


class Group(NamedTuple):
    """A group of people, worked out.

    Attributes:
        name: What it is called.
        facts: What the table says of it.
        leave: int32 (WEEK_STEPS, 9, AGES), how likely one leaves after a step, of ONE.
        enter: int32 (WEEK_STEPS, 9), where leavers go: cumulative, of ONE.
        people: float64 (7, 9, AGES), shares by activity and age at each day's beginning.
    """

    name: str
    facts: dict[str, Any]
    leave: NDArray[np.int32]
    enter: NDArray[np.int32]
    people: F64


@cache
def table() -> dict[str, Any]:
    """Return the survey's numbers."""
    found: dict[str, Any] = json.loads(TABLE.read_text(encoding="utf-8"))
    return found


def groups() -> list[str]:
    """Return the names of the groups of people.

    >>> groups()
    ['workers', 'retired', 'working_parents', 'at_home']
    """
    return list(table()["groups"])


def shares(group: str, kind: str) -> list[dict[str, float]]:
    """Return the share of people in each category at half past each hour, of a kind of day."""
    return [
        {c: part / 10_000 for c, part in zip(CATEGORIES, hour, strict=True)}
        for hour in table()["groups"][group][kind]
    ]


@cache
def group(name: str) -> Group:
    """Work out a group's week."""
    facts = table()["groups"][name]
    wanted = _wanted(facts)
    goes_on = np.array([_survival(facts, c) for c in CATEGORIES])
    leave = np.empty((WEEK_STEPS, len(CATEGORIES), AGES), np.int32)
    enter = np.empty((WEEK_STEPS, len(CATEGORIES)), np.int32)
    people = np.empty((7, len(CATEGORIES), AGES))
    now = np.zeros((len(CATEGORIES), AGES))
    now[:, 0] = wanted[0]
    for step in range((WARM_UP_WEEKS + 1) * WEEK_STEPS):
        k = step % WEEK_STEPS
        if k % DAY_STEPS == 0:
            people[k // DAY_STEPS] = now
        stay, into, now = _next(now, wanted[(k + 1) % WEEK_STEPS], goes_on)
        leave[k] = (1 - stay) * ONE
        enter[k] = np.cumsum(into) * ONE
    enter[:, -1] = ONE
    return Group(name, facts, leave, enter, people)


def _wanted(facts: dict[str, Any]) -> F64:
    """Return the shares at each step of a week from Monday 04:00, (WEEK_STEPS, 9)."""
    points = []
    for day in range(7):
        hours = np.array(facts["weekend" if day > 4 else "weekday"], np.float64) / 10_000
        points += [hours[hour % 24] for hour in range(4, 28)]
    at = np.array(points)  # at 04:30, 05:30, …: three steps after each hour's beginning
    wanted = np.empty((WEEK_STEPS, len(CATEGORIES)))
    for step in range(WEEK_STEPS):
        hour, part = divmod(step - 3, 6)
        wanted[step] = (at[hour] * (6 - part) + at[(hour + 1) % 168] * part) / 6
    return wanted


def _survival(facts: dict[str, Any], category: str) -> list[float]:
    """Return how likely an episode of each age outlives another step."""
    mean_s = facts["minutes"].get(category, 60) * 60
    law = lognormal(*SLEEP_S) if category == "sleeping" else lognormal(mean_s, SPREAD * mean_s)
    over = [_share_below(law, age * STEP_S) for age in range(AGES + 1)]
    return [(1 - b) / (1 - a) if a < 1 else 0.5 for a, b in pairwise(over)]


def _share_below(law: Law, value: int) -> float:
    return position(law.knots, value) / ((KNOTS - 1) << 24)


def _next(now: F64, wanted: F64, goes_on: F64) -> tuple[F64, F64, F64]:
    """Take a population one step on: who stays, where the others go, and what comes of it."""
    # Sums by cumsum: they are taken in order on every machine.
    staying = now * goes_on
    stayers = np.cumsum(staying, axis=1)[:, -1]
    keep = np.minimum(1.0, wanted / np.where(stayers > 0, stayers, 1.0))
    stay = goes_on * keep[:, None]
    gaps = np.maximum(wanted - stayers * keep, 0.0)
    total = np.cumsum(gaps)[-1]
    into = gaps / total if total > 0 else np.full(len(gaps), 1 / len(gaps))
    left = np.cumsum(now * (1 - stay), axis=1)[:, -1]
    everybody = np.cumsum(left)[-1]
    after = np.zeros_like(now)
    older = now * (stay + (1 - stay) * into[:, None])
    after[:, 1:] = older[:, :-1]
    after[:, -1] += older[:, -1]
    after[:, 0] = (everybody - left) * into
    return stay, into, after


def first_state(group: Group, draws: Draws, ordinal: int) -> State:
    """Draw what somebody is in the middle of when a day begins."""
    people = group.people[date.fromordinal(ordinal).weekday()]
    sums = np.cumsum(people.ravel())
    at = int(np.searchsorted(sums, draws.uniform() * sums[-1], side="right"))
    return State(*divmod(min(at, sums.size - 1), AGES))


def live(group: Group, draws: Draws, ordinal: int, state: State) -> tuple[Sequence[Block], State]:
    """Draw a day, from 04:00 to the next.

    Args:
        group: Whose habits.
        draws: The day's random draws.
        ordinal: The day, by its date's ordinal.
        state: What one is in the middle of when it begins.

    Returns:
        What is done, without a gap, and the state in which it ends.
    """
    first = date.fromordinal(ordinal).weekday() * DAY_STEPS
    now, age = state
    begin, blocks = DAWN_S, []
    for k in range(DAY_STEPS):
        age = min(age + 1, AGES)
        if draws.below(ONE) >= group.leave[first + k, now, age - 1]:
            continue
        at = draws.below(ONE)
        goal = int(np.searchsorted(group.enter[first + k], at, side="right"))
        if goal == now:
            continue
        end = DAWN_S + k * STEP_S + 1 + draws.below(STEP_S)
        blocks.append(Block(CATEGORIES[now], begin, end))
        now, age, begin = goal, 0, end
    blocks.append(Block(CATEGORIES[now], begin, DAWN_S + DAY_STEPS * STEP_S))
    if blocks[-1].begin == blocks[-1].end:
        blocks.pop()
    return blocks, State(now, age)
