"""Off-policy estimates: what another policy would have been worth, from the log of one that drew.

Each opportunity has a context, the action that was drawn, the probability with which it was, and a
reward. The estimates are those of Horvitz and Thompson (1952), its self-normalized form (Hájek),
and the doubly robust one (Dudík, Langford and Li, 2011). Opportunities count as independent.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from fleet2d.errors import InputError
from fleet2d.kernels import F64

# Of a normal variable: 95 % lie within so many standard errors.
Z_95 = 1.959963984540054


class StoredRun(Protocol):
    """A run with its tables: `fleet2d.Run`."""

    @property
    def tables(self) -> Mapping[str, Any]:
        """Its tables, as Arrow tables by name."""


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
    """

    text: Sequence[str]
    step: np.ndarray[tuple[int], np.dtype[np.int64]]
    asked: np.ndarray[tuple[int], np.dtype[np.bool_]]
    chance: F64
    reward: F64


class Estimate(NamedTuple):
    """An estimated mean reward for each opportunity, and its 95 % interval.

    Attributes:
        mean: The mean.
        low: Lower end of the interval.
        high: Upper end of the interval.
    """

    mean: float
    low: float
    high: float


def read_opportunities(run: StoredRun) -> LoggedOpportunities:
    """Return the opportunities of a stored run: what robots considered and drew, and the answers.

    A reward belongs to the last opportunity of the same interaction and person before it.
    """
    events = run.tables["events"]
    wanted = {"opportunity", "accepted"}
    rows = [
        (int(step), str(event), str(detail))
        for step, event, detail in zip(
            events["step"].to_pylist(),
            events["event"].to_pylist(),
            events["detail"].to_pylist(),
            strict=True,
        )
        if event in wanted
    ]
    texts: list[str] = []
    steps: list[int] = []
    chances: list[float] = []
    asked: list[bool] = []
    rewards: list[float] = []
    last: dict[str, int] = {}
    for step, event, detail in sorted(rows, key=lambda row: row[0]):
        if event == "accepted":
            if detail in last:
                rewards[last[detail]] = 1.0
            continue
        text, chance, action = detail.rsplit(" ", 2)
        last[text] = len(texts)
        texts.append(text)
        steps.append(step)
        chances.append(float(chance))
        asked.append(action == "asks")
        rewards.append(0.0)
    return LoggedOpportunities(
        texts, np.array(steps, np.int64), np.array(asked), np.array(chances), np.array(rewards)
    )


def inverse_propensity(
    log: LoggedOpportunities, target: ArrayLike, *, normalized: bool = False
) -> Estimate:
    """Estimate the mean reward of another policy by weights.

    Args:
        log: What a policy drew.
        target: Probability of asking of the other policy at each opportunity, (n,).
        normalized: Divide by the sum of the weights: less variance, a small bias.

    Raises:
        InputError: An action was drawn that the log says can't be.

    Example:
        >>> log = LoggedOpportunities(
        ...     ["tea ana"] * 4, np.arange(4), np.array([True, True, False, False]),
        ...     np.full(4, 0.5), np.array([1.0, 0.0, 0.0, 0.0]),
        ... )
        >>> inverse_propensity(log, np.ones(4)).mean
        0.5
    """
    weights = _weights(log, target)
    terms = weights * log.reward
    if not normalized:
        return _interval(terms)
    mean = float(terms.sum() / weights.sum())
    return _interval(mean + weights * (log.reward - mean) / weights.mean())


def doubly_robust(
    log: LoggedOpportunities, target: ArrayLike, if_asked: ArrayLike, if_not: ArrayLike = 0.0
) -> Estimate:
    """Estimate the mean reward of another policy by a model of rewards, corrected by weights.

    It is right if either the model or the probabilities in the log are.

    Args:
        log: What a policy drew.
        target: Probability of asking of the other policy at each opportunity, (n,).
        if_asked: The model's reward of asking at each opportunity, (n,) or a number.
        if_not: The model's reward of waiting.

    Raises:
        InputError: An action was drawn that the log says can't be.
    """
    probability = np.asarray(target, np.float64)
    asked, waited = np.asarray(if_asked, np.float64), np.asarray(if_not, np.float64)
    expected = probability * asked + (1 - probability) * waited
    predicted = np.where(log.asked, asked, waited)
    return _interval(expected + _weights(log, target) * (log.reward - predicted))


def _weights(log: LoggedOpportunities, target: ArrayLike) -> F64:
    """Return how much likelier each action is with another policy than it was."""
    probability = np.asarray(target, np.float64)
    drawn = np.where(log.asked, log.chance, 1 - log.chance)
    if (drawn <= 0).any():
        raise InputError(
            "an action was drawn whose probability is 0 in the log: let the policy that is logged"
            " explore (min_chance, explore)"
        )
    return np.where(log.asked, probability, 1 - probability) / drawn


def _interval(terms: F64) -> Estimate:
    """Return the mean of independent terms and its 95 % interval."""
    mean = float(terms.mean())
    error = float(terms.std(ddof=1) / np.sqrt(len(terms))) if len(terms) > 1 else np.inf
    return Estimate(mean, mean - Z_95 * error, mean + Z_95 * error)
