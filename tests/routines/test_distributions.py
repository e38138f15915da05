"""Laws: tables of quantiles that have the mean and spread they were asked for, and stay in bounds."""

import math
import statistics
from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from fleet2d.routines.distributions import (
    KNOTS,
    NORMAL,
    draw_weighted,
    empirical,
    exponential,
    gamma,
    log,
    lognormal,
    normal,
)
from fleet2d.runtime.determinism import Draws, exp2, stream_key

KEY = stream_key(4, "users.ana", "law")


def drawn(law, count=6000):
    streams = [Draws(KEY, step) for step in range(count // 100)]
    return [law.draw(draws) for draws in streams for _ in range(100)]


def test_the_normal_table_holds_the_quantiles_of_the_normal_law():
    expected = [NormalDist().inv_cdf((i + 0.5) / KNOTS) for i in range(KNOTS)]
    assert expected == pytest.approx(list(NORMAL), abs=1e-5)


@given(st.floats(-30, 30))
def test_exp_is_that_of_the_library(x):
    assert math.exp(x) == pytest.approx(exp2(x / math.log(2)), rel=1e-12)


@given(st.floats(1e-6, 1e6))
def test_log_is_that_of_the_library(x):
    assert math.log(x) == pytest.approx(log(x), rel=1e-11, abs=1e-13)


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        (lognormal(1800, 300), stats.lognorm(0.1655, scale=1775.5)),
        (lognormal(1800, 900), stats.lognorm(0.4724, scale=1610.0)),
        (gamma(1800, 900), stats.gamma(4, scale=450)),
        (gamma(28800, 2700), stats.gamma(113.8, scale=253.1)),
        (normal(28800, 2700), stats.norm(28800, 2700)),
        (exponential(1000), stats.expon(scale=1000)),
        (empirical([60, 120, 600]), stats.rv_histogram(([1, 1], [60, 120, 600]), density=False)),
    ],
)  # fmt: skip
def test_a_law_has_the_quantiles_of_that_of_scipy(law, expected):
    shares = [0.1, 0.25, 0.5, 0.75, 0.9]
    assert expected.ppf(shares) == pytest.approx(
        np.quantile(drawn(law, 20_000), shares), rel=0.05, abs=10
    )


@given(
    low=st.integers(0, 5000),
    length=st.integers(0, 4000),
    make=st.sampled_from([lognormal, gamma, normal]),
    step=st.integers(0, 10_000),
)
def test_a_draw_between_bounds_is_between_them(low, length, make, step):
    law = make(1800, 600)
    assert low <= law.draw(Draws(KEY, step), low, low + length) <= low + length


def test_a_cut_law_is_the_same_law_between_its_bounds():
    law = lognormal(1800, 600)
    whole = [v for v in drawn(law, 30_000) if 1500 <= v <= 2000]
    draws = Draws(KEY, 1)
    cut = [law.draw(draws, 1500, 2000) for _ in range(5000)]
    assert statistics.mean(whole) == pytest.approx(statistics.mean(cut), abs=8)
    assert statistics.pstdev(whole) == pytest.approx(statistics.pstdev(cut), rel=0.05)


def test_weights_are_shares():
    draws = Draws(KEY, 2)
    indices = [draw_weighted(draws, [1, 0, 3]) for _ in range(4000)]
    assert 0 == indices.count(1)
    assert 0.25 == pytest.approx(indices.count(0) / 4000, abs=0.03)
    with pytest.raises(ValueError, match="bound"):
        draw_weighted(draws, [0, 0])
