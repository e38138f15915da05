"""Maximum likelihood for yes-or-no outcomes whose probability is a product of factors.

Fisher scoring finds the maximum. Intervals are those of the profile likelihood: all values of a
parameter for which the deviance, minimized over the other parameters, is at most 3.84 above its
minimum. They cover the true value with a probability of 95 %. Unlike standard errors, they don't
assume normal distributions, and they are open where the log bounds a parameter on one side only.
"""

import math
from collections.abc import Sequence
from functools import cache
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.stats import binomtest

from fleet2d.kernels import F64, Bool

CHI_SQUARE_95 = 3.8414588206941236  # one degree of freedom
PROBABILITY_MARGIN = 1e-12  # minimum distance of probabilities from 0 and 1
MIN_GAIN = 1e-10  # the search ends when a round gains less log-likelihood than this
MAX_ROUNDS = 200
SURE_LOGIT = 12.0  # logits from here on count as a share of 1


class Factor:
    """Base of the factors of a probability, each with parameters of its own.

    Attributes:
        names: The names of its parameters.
        lower: Lower bound of each parameter.
        upper: Upper bound of each parameter.
        starts: Values of the parameters from which the search for the maximum starts.
    """

    names: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    starts: tuple[tuple[float, ...], ...]

    def shares(self, theta: F64) -> tuple[F64, F64]:
        """Return the factor of each row (n,), and its derivatives (n, parameters)."""
        raise NotImplementedError

    def natural(self, index: int, value: float) -> float:
        """Return a parameter in the unit of a scenario; by default the share of a logit."""
        return share_of(value)


class ParameterEstimate(NamedTuple):
    """A parameter: its most likely value and its 95 % interval.

    Attributes:
        value: The most likely value.
        low: The lower end of the interval; None: the log doesn't bound the parameter.
        high: The upper end of the interval; None: the log doesn't bound it.
    """

    value: float
    low: float | None
    high: float | None

    def __str__(self) -> str:
        """Return a text like '4.02 (3.95 to 4.09)'."""
        low = "?" if self.low is None else f"{self.low:.3g}"
        high = "?" if self.high is None else f"{self.high:.3g}"
        return f"{self.value:.3g} ({low} to {high})"


class Fit(NamedTuple):
    """The parameters of a maximum of the likelihood.

    Attributes:
        theta: The parameters of all factors in order, (parameters,).
        log_likelihood: The logarithm of the likelihood there.
        shares: The probability of each row, (n,).
    """

    theta: F64
    log_likelihood: float
    shares: F64

    @property
    def deviance(self) -> float:
        """Twice the difference of the log-likelihood to a perfect model's, which is 0."""
        return -2 * self.log_likelihood


class ProductLikelihood:
    """The likelihood of outcomes whose probability is a product of factors."""

    def __init__(self, factors: Sequence[Factor], outcomes: Bool) -> None:
        self.factors = factors
        self.outcomes = outcomes
        self.lower = np.array([v for factor in factors for v in factor.lower])
        self.upper = np.array([v for factor in factors for v in factor.upper])

    def fit(self) -> Fit:
        """Return the best of the fits from all starting points."""
        starts: list[list[float]] = [[]]
        for factor in self.factors:
            starts = [[*values, *start] for values in starts for start in factor.starts]
        free = np.ones(len(self.lower), bool)
        fits = [self._climb(np.array(start, np.float64), free) for start in starts]
        return max(fits, key=attrgetter("log_likelihood"))

    def estimates(self, best: Fit) -> dict[str, ParameterEstimate]:
        """Return every parameter with its interval, by name."""
        estimates = {}
        index = 0
        for factor in self.factors:
            for i, name in enumerate(factor.names):
                ends = [self._interval_end(best, index, side) for side in (-1, 1)]
                low, high = [None if end is None else factor.natural(i, end) for end in ends]
                value = factor.natural(i, float(best.theta[index]))
                estimates[name] = ParameterEstimate(value, low, high)
                index += 1
        return estimates

    def _model(self, theta: F64) -> tuple[F64, F64]:
        """Return the probabilities, and the derivatives of their logarithms."""
        shares = np.ones(len(self.outcomes))
        slopes = []
        index = 0
        for factor in self.factors:
            count = len(factor.names)
            share, slope = factor.shares(theta[index : index + count])
            share = np.maximum(share, PROBABILITY_MARGIN)
            shares = shares * share
            slopes.append(slope / share[:, None])
            index += count
        shares = np.clip(shares, PROBABILITY_MARGIN, 1 - PROBABILITY_MARGIN)
        return shares, np.concatenate(slopes, axis=1)

    def _value(self, shares: F64) -> float:
        """Return the log-likelihood of the probabilities of the rows."""
        hits = np.log(shares[self.outcomes])
        misses = np.log1p(-shares[~self.outcomes])
        return float(hits.sum() + misses.sum())

    def _climb(self, theta: F64, free: Bool) -> Fit:
        """Return the maximum over the free parameters, by damped Fisher scoring from `theta`."""
        theta = np.clip(theta, self.lower, self.upper)
        shares, slopes = self._model(theta)
        value = self._value(shares)
        damping = 1e-3
        for _ in range(MAX_ROUNDS):
            slopes = slopes[:, free]
            score = slopes.T @ ((self.outcomes - shares) / (1 - shares))
            information = slopes.T @ (slopes * (shares / (1 - shares))[:, None])
            damped = information + np.diag(damping * np.diag(information) + 1e-9)
            trial = theta.copy()
            trial[free] += np.linalg.solve(damped, score) if len(score) else score
            trial = np.clip(trial, self.lower, self.upper)
            trial_shares, trial_slopes = self._model(trial)
            gain = self._value(trial_shares) - value
            if gain < 0 and damping < 1e9:
                damping = max(damping * 10, 1e-3)
                slopes = self._model(theta)[1]
                continue
            theta = trial
            shares = trial_shares
            slopes = trial_slopes
            value = value + gain
            damping /= 10
            if gain < MIN_GAIN:
                break
        return Fit(theta, value, shares)

    def _interval_end(self, best: Fit, index: int, side: int) -> float | None:
        """Return the lower (-1) or upper (1) end of a parameter's interval; None if unbounded."""
        limit = float((self.upper if side > 0 else self.lower)[index])
        free = np.ones(len(best.theta), bool)
        free[index] = False
        theta = best.theta  # where the next search starts

        @cache  # in small logs, another start may end at another maximum
        def excess(value: float) -> float:
            nonlocal theta
            start = theta.copy()
            start[index] = value
            fit = self._climb(start, free)
            theta = fit.theta
            # The root of a deviance, which is nearly a parabola, is nearly linear.
            rise = max(2 * (best.log_likelihood - fit.log_likelihood), 0.0)
            return float(np.sqrt(rise) - np.sqrt(CHI_SQUARE_95))

        inside = float(best.theta[index])
        step = 0.05 * (1 + abs(inside))
        excess(inside)
        while True:
            outside = inside + side * step
            if (outside - limit) * side >= 0:
                outside = limit
            if excess(outside) > 0:
                return float(brentq(excess, inside, outside, xtol=1e-6))
            if outside == limit:
                return None
            inside = outside
            step = 2 * step


def wilson(hits: int, total: int) -> ParameterEstimate:
    """Return a share with its 95 % interval (Wilson's).

    >>> print(wilson(8, 10))
    0.8 (0.49 to 0.943)
    """
    interval = binomtest(hits, total).proportion_ci(0.95, "wilson")
    return ParameterEstimate(hits / total, float(interval.low), float(interval.high))


def share_of(logit: float) -> float:
    """Return the probability of a logit; exactly 1 from SURE_LOGIT on.

    >>> share_of(0.0), share_of(SURE_LOGIT)
    (0.5, 1.0)
    """
    return 1.0 if logit >= SURE_LOGIT else 1 / (1 + math.exp(-logit))


class Constant(Factor):
    """The same factor for every row."""

    lower = (-SURE_LOGIT,)
    upper = (SURE_LOGIT,)
    starts = ((2.0,),)

    def __init__(self, name: str, rows: int) -> None:
        self.names = (name,)
        self._rows = rows

    def shares(self, theta: F64) -> tuple[F64, F64]:
        """Return the factor of each row, and its derivative by the logit."""
        share = share_of(float(theta[0]))
        slope = np.full((self._rows, 1), max(share * (1 - share), 1e-9))
        return np.full(self._rows, share), slope


class Falling(Factor):
    """A factor that decreases logistically with x: 1 / (1 + exp((x - midpoint) / width))."""

    def __init__(self, name: str, values: F64) -> None:
        self.names = (f"{name} midpoint", f"{name} width")
        self._x = values
        span = max(float(values.max()), 1e-6)
        self.lower = (-span, math.log(span / 1000))
        self.upper = (3 * span, math.log(3 * span))
        self.starts = tuple((share * span, math.log(span / 8)) for share in (0.5, 0.8, 1.1))

    def shares(self, theta: F64) -> tuple[F64, F64]:
        """Return the factor of each row, and its derivatives by midpoint and log of width."""
        midpoint = float(theta[0])
        width = math.exp(float(theta[1]))
        scaled = np.clip((self._x - midpoint) / width, -700, 700)
        share = 1 / (1 + np.exp(scaled))
        slope = share * (1 - share)
        return share, np.stack([slope / width, slope * scaled], axis=1)

    def natural(self, index: int, value: float) -> float:
        """Return midpoint or width in the quantity's unit."""
        return math.exp(value) if index else value


class Orientation(Factor):
    """A factor that decreases with the angle by which a person is turned away, piecewise linear.

    It is 1 for a person who faces the camera, `side` at 90 degrees and `back` at 180 degrees.
    """

    names = ("side", "back")
    lower = (-SURE_LOGIT, -SURE_LOGIT)
    upper = (SURE_LOGIT, SURE_LOGIT)
    starts = ((2.0, 1.0),)

    def __init__(self, degrees: F64) -> None:
        quarters = degrees / 90
        self._side = np.where(quarters < 1, quarters, 2 - quarters)
        self._back = np.maximum(quarters - 1, 0)

    def shares(self, theta: F64) -> tuple[F64, F64]:
        """Return the factor of each row, and its derivatives by the two logits."""
        side = share_of(float(theta[0]))
        back = share_of(float(theta[1]))
        front = 1 - self._side - self._back
        share = front + side * self._side + back * self._back
        slopes = [
            self._side * max(side * (1 - side), 1e-9),
            self._back * max(back * (1 - back), 1e-9),
        ]
        return share, np.stack(slopes, axis=1)
