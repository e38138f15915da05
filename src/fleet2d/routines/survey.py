"""Time use of a survey, and random days whose shares of activities are those of the survey.

The survey has the share of people who do each activity at each hour. A person's day is a Markov
chain in steps of ten minutes. After a step, an episode ends by the distribution of its duration, or
because the share of its activity has to shrink; then the next activity is drawn by the shares that
have to grow. The probabilities of both are computed beforehand, by following the shares of people
by activity and age of their episode through a week. So every person is drawn independently, and the
expected shares are exactly those of the survey:

    stay(a, age)  = (1 - hazard(a, age)) * min(1, target(a) / stayers(a))
    next(b)       ~ target(b) - staying(b)

Here stayers(a) is the share of people in activity a whose episode doesn't end by the distribution
of its duration, and staying(b) the share of people that remains in activity b after the step. An
episode whose next activity is the same continues. Durations have the survey's means as far as the
shares allow.
"""

import json
from collections.abc import Iterable, Sequence
from datetime import date
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fleet2d.kernels import F64, I32, NO_GAP_S
from fleet2d.routines.distributions import KNOTS, draw_weighted, lognormal, position
from fleet2d.routines.planner import Episode
from fleet2d.runtime.clock import HOUR_S
from fleet2d.runtime.determinism import Draws

TABLE = Path(__file__).parent / "survey.json"
CATEGORIES = (
    "sleeping", "work", "eating", "food_prep", "laundry", "exercise", "travel", "tv", "other",
)  # fmt: skip
STEP_S = 600
DAY_STEPS = 144
WEEK_STEPS = 7 * DAY_STEPS
DAWN_S = 4 * HOUR_S  # the survey's days begin at 04:00
AGES = 96  # the largest age of an episode that is distinguished [steps]
ONE = 1 << 24
SHARE_UNIT = 10_000  # the survey's shares are in parts of this
WARM_UP_WEEKS = 2
SLEEP_S = (8 * HOUR_S, HOUR_S)  # mean and deviation; the survey's mean is of nights cut at 04:00
SPREAD = 0.6  # standard deviation of an episode's duration, relative to its mean


class SurveyEpisode(NamedTuple):
    """A time spent in one category; times in seconds since the midnight of the day's date."""

    category: str
    begin: int
    end: int


class EpisodeState(NamedTuple):
    """The episode that a person is in: the category's number, and the episode's age [steps]."""

    category: int
    age: int


class SurveyGroup(NamedTuple):
    """A group of people, with the probabilities of its Markov chain.

    Attributes:
        name: The name of the group.
        facts: Its entry in the survey's table.
        leave: Probability that an episode ends after a step, in parts of ONE, int32 (WEEK_STEPS, 9,
            AGES).
        enter: Cumulative probability of the next category, in parts of ONE, int32 (WEEK_STEPS, 9).
        people: Shares of people by category and age at 04:00 of each day, float64 (7, 9, AGES).
    """

    name: str
    facts: dict[str, Any]
    leave: I32
    enter: I32
    people: F64


@cache
def table() -> dict[str, Any]:
    """Return the survey's numbers."""
    return json.loads(TABLE.read_text(encoding="utf-8"))


def groups() -> list[str]:
    """Return the names of the groups of people.

    >>> groups()
    ['workers', 'retired', 'working_parents', 'at_home']
    """
    return list(table()["groups"])


def shares(group: str, kind: str) -> list[dict[str, float]]:
    """Return the share of people in each category at half past each hour, of a kind of day."""
    hours = np.array(table()["groups"][group][kind]) / SHARE_UNIT
    return [dict(zip(CATEGORIES, hour, strict=True)) for hour in hours.tolist()]


@cache
def group(name: str) -> SurveyGroup:
    """Compute the probabilities of a group for a week."""
    facts = table()["groups"][name]
    targets = _targets(facts)
    survival = np.array([_survival(facts, c) for c in CATEGORIES])
    leave = np.empty((WEEK_STEPS, len(CATEGORIES), AGES), np.int32)
    enter = np.empty((WEEK_STEPS, len(CATEGORIES)), np.int32)
    people = np.empty((7, len(CATEGORIES), AGES))
    now = np.zeros((len(CATEGORIES), AGES))
    now[:, 0] = targets[0]
    for step in range((WARM_UP_WEEKS + 1) * WEEK_STEPS):
        k = step % WEEK_STEPS
        if k % DAY_STEPS == 0:
            people[k // DAY_STEPS] = now
        stay, into, now = _next(now, targets[(k + 1) % WEEK_STEPS], survival)
        leave[k] = (1 - stay) * ONE
        enter[k] = np.cumsum(into) * ONE
    enter[:, -1] = ONE
    return SurveyGroup(name, facts, leave, enter, people)


def _targets(facts: dict[str, Any]) -> F64:
    """Return the survey's shares at each step of a week from Monday 04:00, (WEEK_STEPS, 9)."""
    days = [np.array(facts[kind], np.float64) / SHARE_UNIT for kind in ("weekday", "weekend")]
    from_dawn = [np.roll(day, -4, axis=0) for day in days]
    # At 04:30, 05:30, …: three steps after each hour's begin.
    at = np.concatenate([from_dawn[day > 4] for day in range(7)])
    hour, part = np.divmod(np.arange(-3, WEEK_STEPS - 3)[:, None], 6)
    return (at[hour[:, 0]] * (6 - part) + at[(hour[:, 0] + 1) % 168] * part) / 6


def _survival(facts: dict[str, Any], category: str) -> list[float]:
    """Return the probability that an episode of each age lasts another step."""
    mean_s = facts["minutes"].get(category, 60) * 60
    lasts = lognormal(*SLEEP_S) if category == "sleeping" else lognormal(mean_s, SPREAD * mean_s)
    whole = (KNOTS - 1) << 24
    ended = [position(lasts.knots, age * STEP_S) / whole for age in range(AGES + 1)]
    return [(1 - b) / (1 - a) if a < 1 else 0.5 for a, b in pairwise(ended)]


def _next(now: F64, target: F64, survival: F64) -> tuple[F64, F64, F64]:
    """Advance the shares of people by one step.

    Args:
        now: Shares by category and age, (9, AGES).
        target: Shares by category after the step, (9,).
        survival: Probability that an episode of each category and age lasts another step.

    Returns:
        Probability of staying by category and age, probability of each next category, and the
        shares after the step.
    """
    # Sums by cumsum, which adds in the same order on every machine.
    staying = now * survival
    stayers = np.cumsum(staying, axis=1)[:, -1]
    retained = np.minimum(1.0, target / np.where(stayers > 0, stayers, 1.0))
    stay = survival * retained[:, None]
    gaps = np.maximum(target - stayers * retained, 0.0)
    total = np.cumsum(gaps)[-1]
    into = gaps / total if total > 0 else np.full(len(gaps), 1 / len(gaps))
    leavers = np.cumsum(now * (1 - stay), axis=1)[:, -1]
    all_leavers = np.cumsum(leavers)[-1]
    after = np.zeros_like(now)
    older = now * (stay + (1 - stay) * into[:, None])
    after[:, 1:] = older[:, :-1]
    after[:, -1] += older[:, -1]
    after[:, 0] = (all_leavers - leavers) * into
    return stay, into, after


def first_state(group: SurveyGroup, draws: Draws, ordinal: int) -> EpisodeState:
    """Draw the episode that a person is in when a day begins."""
    people = group.people[date.fromordinal(ordinal).weekday()]
    sums = np.cumsum(people.ravel())
    at = int(np.searchsorted(sums, draws.uniform() * sums[-1], side="right"))
    return EpisodeState(*divmod(min(at, sums.size - 1), AGES))


def draw_episodes(
    group: SurveyGroup, draws: Draws, ordinal: int, state: EpisodeState
) -> tuple[Sequence[SurveyEpisode], EpisodeState]:
    """Draw a day, from 04:00 to the next 04:00.

    Args:
        group: The person's group.
        draws: The day's random draws.
        ordinal: The ordinal of the day's date.
        state: The episode that the person is in when the day begins.

    Returns:
        The day's episodes, without a gap, and the state in which the day ends.
    """
    first = date.fromordinal(ordinal).weekday() * DAY_STEPS
    now, age = state
    begin = DAWN_S
    blocks = []
    for k in range(DAY_STEPS):
        age = min(age + 1, AGES)
        if draws.below(ONE) >= group.leave[first + k, now, age - 1]:
            continue
        at = draws.below(ONE)
        goal = int(np.searchsorted(group.enter[first + k], at, side="right"))
        if goal == now:
            continue
        end = DAWN_S + k * STEP_S + 1 + draws.below(STEP_S)
        blocks.append(SurveyEpisode(CATEGORIES[now], begin, end))
        now = goal
        age = 0
        begin = end
    blocks.append(SurveyEpisode(CATEGORIES[now], begin, DAWN_S + DAY_STEPS * STEP_S))
    if blocks[-1].begin == blocks[-1].end:
        blocks.pop()
    return blocks, EpisodeState(now, age)


PLAIN = {
    "sleeping": "sleep", "food_prep": "cook", "laundry": "laundry", "travel": "travel", "tv": "tv",
}  # fmt: skip
# The hours before which a meal has which name; later meals are dinner.
MEALS = ((4, "snack"), (11, "breakfast"), (15, "lunch"), (17, "snack"))


def activities(group: SurveyGroup) -> list[str]:
    """Return the names of the activities that a group's days may have."""
    named = {*PLAIN.values(), "dinner", "work", "work_at_home", "exercise", "sport", "outing"}
    return sorted(named | {meal for _, meal in MEALS} | set(group.facts["other"]))


def draw_works_at_home(group: SurveyGroup, draws: Draws) -> bool:
    """Draw whether a person of a group works at home."""
    return draws.below(SHARE_UNIT) < int(group.facts["work_at_home"])


def to_activities(
    group: SurveyGroup, episodes: Iterable[SurveyEpisode], works_at_home: bool, draws: Draws
) -> Sequence[Episode]:
    """Return a day of activities from one of categories, which become the tasks.

    Args:
        group: The person's group.
        episodes: The episodes of the day.
        works_at_home: Whether work is done at home.
        draws: The day's random draws.
    """
    day: list[Episode] = []
    for category, begin, end in episodes:
        if category == "other":
            _add_pastimes(group, day, begin, end, draws)
            continue
        if category == "work":
            name = "work_at_home" if works_at_home else "work"
        elif category == "eating":
            eats_at_home = draws.below(SHARE_UNIT) < table()["eat_at_home"]
            hour = begin // HOUR_S % 24
            meal = next((meal for until, meal in MEALS if hour < until), "dinner")
            name = meal if eats_at_home else "outing"
        elif category == "exercise":
            exercises_at_home = draws.below(SHARE_UNIT) < table()["exercise_at_home"]
            name = "exercise" if exercises_at_home else "sport"
        else:
            name = PLAIN[category]
        day.append(Episode(name, begin, end, category))
    return day


def _add_pastimes(
    group: SurveyGroup, day: list[Episode], begin: int, end: int, draws: Draws
) -> None:
    """Fill an episode of 'other' with pastimes, by their shares in the survey."""
    pastimes = group.facts["other"]
    names = list(pastimes)
    shares = [share for share, _ in pastimes.values()]
    while begin < end:
        name = names[draw_weighted(draws, shares)]
        mean_s = pastimes[name][1] * 60
        over = begin + max(NO_GAP_S, lognormal(mean_s, SPREAD * mean_s).draw(draws))
        over = end if over + NO_GAP_S > end else over
        day.append(Episode(name, begin, over, "other"))
        begin = over
