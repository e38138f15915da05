"""Maximum likelihood recovers what was put in, and its intervals cover it as often as they claim."""

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest
from tests.learning.fit.detection_logs import TRUE, shares, simulated
from tests.thorough import some

from fleet2d.kernels import F64
from fleet2d.learning.fit.likelihood import (
    Constant,
    Falling,
    Orientation,
    ProductLikelihood,
)
from fleet2d.learning.fit.perception import DetectionLog


def test_derivatives_of_the_factors_are_those_of_finite_differences():
    x = np.linspace(0, 7, 50)
    for factor, theta in (
        (Constant("top", 50), [1.3]),
        (Falling("distance", x), [3.0, np.log(0.7)]),
        (Orientation(np.linspace(0, 180, 50)), [0.4, -1.0]),
    ):
        at = np.array(theta)
        _, slopes = factor.shares(at)
        for i in range(len(at)):
            step = np.zeros(len(at))
            step[i] = 1e-6
            rise = (factor.shares(at + step)[0] - factor.shares(at - step)[0]) / 2e-6
            assert rise == pytest.approx(slopes[:, i], abs=1e-6)


def test_the_fit_of_a_constant_is_the_share():
    outcomes = np.arange(100) < 37
    likelihood = ProductLikelihood([Constant("top", 100)], outcomes)
    best = likelihood.fit()
    top = likelihood.estimates(best)["top"]
    assert 0.37 == pytest.approx(top.value, abs=1e-6)
    # The likelihood-ratio interval of 37 of 100, from its definition.
    p = np.linspace(0.2, 0.6, 400_001)
    fall = 2 * (37 * np.log(0.37 / p) + 63 * np.log(0.63 / (1 - p)))
    inside = p[fall <= 3.8414588]
    assert (top.low, top.high) == pytest.approx((inside[0], inside[-1]), abs=1e-4)


@pytest.mark.slow
def test_large_logs_give_the_true_parameters():
    log = simulated(3, 80_000, bearing=True, turned=True)
    factors = [
        Constant("top", len(log)),
        Falling("distance", log.distance),
        Falling("bearing", log.bearing),
        Orientation(log.orientation),
    ]
    likelihood = ProductLikelihood(factors, log.detected)
    best = likelihood.fit()
    index = 0
    for factor in factors:
        for i, name in enumerate(factor.names):
            assert TRUE[name] == pytest.approx(factor.natural(i, best.theta[index]), rel=0.05), name
            index += 1
    assert best.shares == pytest.approx(
        shares(log.distance, log.bearing, log.orientation), abs=0.02
    )


def missed(logs: Iterable[DetectionLog], factors_of: Callable[[DetectionLog], Any]) -> Counter[str]:
    """Count by parameter the logs whose intervals don't hold the truth."""
    misses = Counter()
    for log in logs:
        likelihood = ProductLikelihood(factors_of(log), log.detected)
        for name, estimate in likelihood.estimates(likelihood.fit()).items():
            low = -np.inf if estimate.low is None else estimate.low
            high = np.inf if estimate.high is None else estimate.high
            assert low <= estimate.value <= high
            misses[name] += not low <= TRUE[name] <= high
    return misses


@pytest.mark.slow
@pytest.mark.parametrize(("repeats", "most"), some([(50, 8), (250, 25)], 2))
def test_intervals_cover_the_truth_as_often_as_they_claim(repeats, most):
    """Of 50 logs, 95 % intervals miss the truth in 2.5 +- 1.5; 3.7 deviations are allowed."""
    logs = (simulated(100 + seed, 600) for seed in range(repeats))
    misses = missed(
        logs, lambda log: [Constant("top", len(log)), Falling("distance", log.distance)]
    )
    assert {"top", "distance midpoint", "distance width"} == misses.keys()
    assert all(1 <= count <= most for count in misses.values()), misses


class Known:
    """A factor without parameters."""

    names: tuple[str, ...] = ()
    lower: tuple[float, ...] = ()
    upper: tuple[float, ...] = ()
    starts: tuple[tuple[float, ...], ...] = ((),)

    def __init__(self, factor: F64):
        self._factor = factor

    def shares(self, theta: F64) -> tuple[F64, F64]:
        return self._factor, np.zeros((len(self._factor), 0))

    def natural(self, index, value):
        return value


@pytest.mark.slow
def test_intervals_of_bearing_and_orientation_cover_the_truth_as_often_as_they_claim():
    """Of 30 logs, 95 % intervals miss in 1.5 +- 1.2; none of 4 parameters may miss in more than 5."""

    def factors_of(log: DetectionLog):
        # What distance does is known here, so that four parameters are fitted and not seven.
        known = Known(shares(log.distance, None, None))
        return [known, Falling("bearing", log.bearing), Orientation(log.orientation)]

    misses = missed(
        (simulated(900 + seed, 1500, bearing=True, turned=True) for seed in range(30)), factors_of
    )
    assert {"bearing midpoint", "bearing width", "side", "back"} == misses.keys()
    assert max(misses.values()) <= 5, misses
    assert misses.total() >= 2, misses


def test_an_interval_that_the_log_does_not_bound_is_open():
    rng = np.random.default_rng(5)
    outcomes = rng.random(300) < 0.999999
    likelihood = ProductLikelihood([Constant("top", 300)], outcomes)
    top = likelihood.estimates(likelihood.fit())["top"]
    assert top.high is None
    assert 0.98 < (top.low or 0) < 0.995  # 300 of 300: exp(-1.92 / 300)
