"""Maximum likelihood for yes-or-no outcomes whose probability is a product of factors.

Fisher scoring finds the maximum; intervals are of the profile likelihood: all values of a parameter
with which the best of the others explain the log nearly as well (deviance up by at most 3.84, so
that they cover the truth 95 times out of 100). Unlike a standard error they need no parameter to be
bell-shaped, and say it when the log bounds a parameter on one side only.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

CHI_SQUARE_95 = 3.8414588206941236  # one degree of freedom
NEVER = 1e-12  # probabilities are kept this far from 0 and 1
ENOUGH = 1e-10  # gain of likelihood below which the maximum is found
MOST_ROUNDS = 200


class Factor(Protocol):
    """A part of a probability, with parameters of its own that may have any value."""

    @property
    def names(self) -> tuple[str, ...]:
        """What its parameters are called."""

    @property
    def least(self) -> tuple[float, ...]:
        """The least that each parameter may be."""

    @property
    def most(self) -> tuple[float, ...]:
        """The most that each parameter may be."""

    @property
    def starts(self) -> tuple[tuple[float, ...], ...]:
        """Where the search for the most likely values begins."""

    def shares(self, theta: F64) -> tuple[F64, F64]:
        """Return the factor of each row (n,), and its derivatives (n, parameters)."""

    def natural(self, index: int, value: float) -> float:
        """Return a parameter as people read it."""


@dataclass(frozen=True)
class Estimate:
    """A parameter: its most likely value, and its 95 % interval; None: not bounded by the log."""

    value: float
    low: float | None
    high: float | None

    def __str__(self) -> str:
        """Write it like '4.02 (3.95 to 4.09)'."""
        low = "?" if self.low is None else f"{self.low:.3g}"
        high = "?" if self.high is None else f"{self.high:.3g}"
        return f"{self.value:.3g} ({low} to {high})"


@dataclass(frozen=True)
class Fit:
    """What explains the outcomes best.

    Attributes:
        theta: The parameters of all factors, one behind the other.
        log_likelihood: How well it explains them.
        shares: The probability of each row.
    """

    theta: F64
    log_likelihood: float
    shares: F64

    @property
    def deviance(self) -> float:
        """Twice what the log-likelihood lacks to that of knowing every outcome."""
        return -2 * self.log_likelihood


class Likelihood:
    """How well a product of factors explains outcomes."""

    def __init__(self, factors: Sequence[Factor], outcomes: NDArray[np.bool_]) -> None:
        self.factors, self.outcomes = factors, outcomes
        self.least = np.array([v for factor in factors for v in factor.least])
        self.most = np.array([v for factor in factors for v in factor.most])

    def fit(self) -> Fit:
        """Return the best of the fits from all starting points."""
        starts: list[list[float]] = [[]]
        for factor in self.factors:
            starts = [[*before, *start] for before in starts for start in factor.starts]
        free = np.ones(len(self.least), bool)
        return max(
            (self._climb(np.array(start, np.float64), free) for start in starts),
            key=lambda fit: fit.log_likelihood,
        )

    def estimates(self, best: Fit) -> dict[str, Estimate]:
        """Return every parameter with its interval, by name."""
        found, index = {}, 0
        for factor in self.factors:
            for i, name in enumerate(factor.names):
                ends = [self._end(best, index, way) for way in (-1, 1)]
                found[name] = Estimate(
                    factor.natural(i, float(best.theta[index])),
                    *(None if end is None else factor.natural(i, end) for end in ends),
                )
                index += 1
        return found

    def _model(self, theta: F64) -> tuple[F64, F64]:
        """Return the probabilities, and the derivatives of their logarithms."""
        shares, slopes, index = np.ones(len(self.outcomes)), [], 0
        for factor in self.factors:
            count = len(factor.names)
            share, slope = factor.shares(theta[index : index + count])
            share = np.maximum(share, NEVER)
            shares = shares * share
            slopes.append(slope / share[:, None])
            index += count
        return np.clip(shares, NEVER, 1 - NEVER), np.concatenate(slopes, axis=1)

    def _value(self, shares: F64) -> float:
        hit = self.outcomes
        return float(np.log(shares[hit]).sum() + np.log1p(-shares[~hit]).sum())

    def _climb(self, theta: F64, free: NDArray[np.bool_]) -> Fit:
        """Climb to the maximum over the free parameters, by damped Fisher scoring."""
        theta = np.clip(theta, self.least, self.most)
        shares, slopes = self._model(theta)
        value, damping = self._value(shares), 1e-3
        for _ in range(MOST_ROUNDS):
            slopes = slopes[:, free]
            score = slopes.T @ ((self.outcomes - shares) / (1 - shares))
            information = slopes.T @ (slopes * (shares / (1 - shares))[:, None])
            damped = information + np.diag(damping * np.diag(information) + 1e-9)
            trial = theta.copy()
            trial[free] += np.linalg.solve(damped, score) if len(score) else score
            trial = np.clip(trial, self.least, self.most)
            trial_shares, trial_slopes = self._model(trial)
            gain = self._value(trial_shares) - value
            if gain < 0 and damping < 1e9:
                damping = max(damping * 10, 1e-3)
                slopes = self._model(theta)[1]
                continue
            theta, shares, slopes, value = trial, trial_shares, trial_slopes, value + gain
            damping /= 10
            if gain < ENOUGH:
                break
        return Fit(theta, value, shares)

    def _end(self, best: Fit, index: int, way: int) -> float | None:
        """Return where the profile likelihood of a parameter ends, to one side."""
        limit = float((self.most if way > 0 else self.least)[index])
        free = np.ones(len(best.theta), bool)
        free[index] = False

        def excess(at: float, near: F64) -> tuple[float, F64]:
            theta = near.copy()
            theta[index] = at
            fit = self._climb(theta, free)
            return 2 * (best.log_likelihood - fit.log_likelihood) - CHI_SQUARE_95, fit.theta

        inside, near = float(best.theta[index]), best.theta
        below, step = -CHI_SQUARE_95, 0.05 * (1 + abs(inside))
        while True:
            outside = inside + way * step
            if (outside - limit) * way >= 0:
                outside = limit
            above, theta = excess(outside, near)
            if above > 0:
                break
            if outside == limit:
                return None
            inside, near, below, step = outside, theta, above, 2 * step
        # The deviance is nearly a parabola, so that its root is nearly straight.
        for _ in range(30):
            low, high = math.sqrt(below + CHI_SQUARE_95), math.sqrt(above + CHI_SQUARE_95)
            part = (math.sqrt(CHI_SQUARE_95) - low) / (high - low)
            middle = inside + min(max(part, 0.02), 0.98) * (outside - inside)
            value, theta = excess(middle, near)
            if abs(value) < 1e-4 or abs(outside - inside) < 1e-9:
                return middle
            if value > 0:
                outside, above = middle, value
            else:
                inside, below, near = middle, value, theta
        return inside


def chi_square_tail(value: float, freedom: int) -> float:
    """Return the probability that a chi-square variable of whole degrees of freedom exceeds it.

    >>> round(chi_square_tail(3.841, 1), 4), round(chi_square_tail(15.507, 8), 4)
    (0.05, 0.05)
    """
    half = max(value, 0.0) / 2
    order, tail = (0.5, math.erfc(math.sqrt(half))) if freedom % 2 else (1.0, math.exp(-half))
    while order < freedom / 2 and half > 0:
        tail += math.exp(order * math.log(half) - half - math.lgamma(order + 1))
        order += 1
    return min(tail, 1.0)


def wilson(hits: int, total: int) -> Estimate:
    """Return a share with its 95 % interval (Wilson's).

    >>> print(wilson(8, 10))
    0.8 (0.49 to 0.943)
    """
    z2 = CHI_SQUARE_95
    share = hits / total
    middle = (share + z2 / (2 * total)) / (1 + z2 / total)
    half = math.sqrt(z2 * (share * (1 - share) / total + z2 / (4 * total * total)))
    half /= 1 + z2 / total
    return Estimate(share, max(0.0, middle - half), min(1.0, middle + half))
