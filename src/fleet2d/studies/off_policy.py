"""Off-policy estimates: what another policy would have been worth, from the log of one that drew.

Each opportunity has a context, the action that was drawn, the probability with which it was, and a
reward. The estimates are those of Horvitz and Thompson (1952), its self-normalized form (Hájek),
and the doubly robust one (Dudík, Langford and Li, 2011).

How many opportunities there are depends on the policy: a person who gave no answer isn't looked for
for hours. So the mean reward of a day is estimated, not that of an opportunity, and intervals take
days, not opportunities, for independent. What an answer changes beyond that, such as annoyance that
lasts for days, is no part of the estimates. `benchmarks/off_policy_coverage.py` measures how often
the intervals contain the truth.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np
from numpy.typing import ArrayLike

from fleet2d.errors import InputError
from fleet2d.kernels import F64, I64
from fleet2d.runs.run import Run
from fleet2d.runtime.events import EventKind
from fleet2d.studies.intervals import MeanEstimate, estimate


@dataclass(frozen=True)
class LoggedOpportunities:
    """Opportunities to address a person, in order.

    All arrays have one entry for each, shape (n,).

    Attributes:
        text: The interaction and the person.
        step: int64, when it was considered.
        asked: bool, whether the robot went to ask.
        chance: float64, the probability with which it would.
        reward: float64, what came of it: 1 for a yes, 0 for anything else, or another reward.
        day: int64, the day of the log that it is in, from 0 on; another unit that is independent of
            the others can stand in its place, such as the opportunity itself.
        days: Number of days of the log, those without opportunities, too.
    """

    text: Sequence[str]
    step: I64
    asked: np.ndarray[tuple[int], np.dtype[np.bool_]]
    chance: F64
    reward: F64
    day: I64
    days: int


def read_opportunities(run: Run) -> LoggedOpportunities:
    """Return the opportunities of a stored run: what robots considered and drew, and the answers.

    A reward belongs to the last opportunity of the same interaction and person before it. Days are
    those of the calendar.
    """
    events = (run.tables["events"][name].to_pylist() for name in ("step", "event", "detail"))
    wanted = {EventKind.OPPORTUNITY, EventKind.ACCEPTED}
    rows = (row for row in zip(*events, strict=True) if row[1] in wanted)
    logged: list[tuple[str, int, bool, float]] = []
    rewards: list[float] = []
    last: dict[str, int] = {}
    for step, event, detail in sorted(rows, key=itemgetter(0)):
        if event == EventKind.ACCEPTED:
            if detail in last:
                rewards[last[detail]] = 1.0
            continue
        text, chance, action = detail.rsplit(" ", 2)
        last[text] = len(logged)
        logged.append((text, step, action == "asks", float(chance)))
        rewards.append(0.0)
    texts, steps, asked, chances = zip(*logged, strict=True) if logged else ((), (), (), ())
    clock = run.clock
    first = clock.start.toordinal()
    return LoggedOpportunities(
        list(texts),
        np.array(steps, np.int64),
        np.array(asked, bool),
        np.array(chances),
        np.array(rewards),
        np.array([clock.time(step).toordinal() - first for step in steps], np.int64),
        clock.time(clock.steps - 1).toordinal() - first + 1,
    )


def inverse_propensity(
    log: LoggedOpportunities, target: ArrayLike, *, normalized: bool = False
) -> MeanEstimate:
    """Estimate the reward that another policy has in a day, by weights.

    Args:
        log: What a policy drew.
        target: Probability of asking of the other policy at each opportunity, (n,).
        normalized: Divide by the sum of the weights: less variance, a small bias.

    Returns:
        The mean and its 95 % interval, in which days count as independent.

    Raises:
        InputError: An action was drawn that the log says can't be, the log has no opportunity, or
            `target` isn't a probability for each.

    Example:
        >>> log = LoggedOpportunities(
        ...     ["tea ana"] * 4, np.arange(4), np.array([True, True, False, False]),
        ...     np.full(4, 0.5), np.array([1.0, 0.0, 0.0, 0.0]), np.array([0, 0, 1, 1]), 2,
        ... )
        >>> inverse_propensity(log, np.ones(4)).mean
        1.0
    """
    weights = _weights(log, target)
    if not normalized:
        return _mean_of_days(log, weights * log.reward)
    mean = float((weights * log.reward).sum() / weights.sum())
    return _mean_of_days(log, mean + weights * (log.reward - mean) / weights.mean())


def doubly_robust(
    log: LoggedOpportunities, target: ArrayLike, if_asked: ArrayLike, if_not: ArrayLike = 0.0
) -> MeanEstimate:
    """Estimate the reward of another policy in a day by a model, corrected by weights.

    It is right if either the model or the probabilities in the log are.

    Args:
        log: What a policy drew.
        target: Probability of asking of the other policy at each opportunity, (n,).
        if_asked: The model's reward of asking at each opportunity, (n,) or a number.
        if_not: The model's reward of waiting.

    Returns:
        The mean and its 95 % interval, in which days count as independent.

    Raises:
        InputError: An action was drawn that the log says can't be, the log has no opportunity, or
            `target` isn't a probability for each.
    """
    weights = _weights(log, target)
    probability = np.asarray(target, np.float64)
    asked = np.asarray(if_asked, np.float64)
    waited = np.asarray(if_not, np.float64)
    expected = probability * asked + (1 - probability) * waited
    predicted = np.where(log.asked, asked, waited)
    return _mean_of_days(log, expected + weights * (log.reward - predicted))


def _weights(log: LoggedOpportunities, target: ArrayLike) -> F64:
    """Return importance weights: each action's probability by another policy over that logged."""
    if not len(log.text):
        raise InputError(
            "the log has no opportunity: `interact` records them with timing: NAME, an algorithm of"
            " type timing"
        )
    probability = np.asarray(target, np.float64)
    fits = probability.shape in ((), log.chance.shape)
    if not (fits and (probability >= 0).all() and (probability <= 1).all()):
        raise InputError(
            f"target: expected a probability from 0 to 1 for each of {len(log.text)} opportunities,"
            f" or one for all, got an array of shape {probability.shape}"
        )
    drawn = np.where(log.asked, log.chance, 1 - log.chance)
    if (drawn <= 0).any():
        raise InputError(
            "an action was drawn whose probability is 0 in the log: let the policy that is logged"
            " explore (min_chance, explore)"
        )
    return np.where(log.asked, probability, 1 - probability) / drawn


def _mean_of_days(log: LoggedOpportunities, terms: F64) -> MeanEstimate:
    """Return the mean of the days' sums of terms, and its interval."""
    sums = np.bincount(log.day, terms, log.days).astype(np.float64)
    return estimate(sums, {"day": range(log.days)})
