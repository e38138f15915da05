"""Laws: tables of quantiles that have the mean and spread they were asked for, and stay in bounds."""

import math
import statistics
from statistics import NormalDist

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet2d.routines.distributions import (
    KNOTS,
    NORMAL,
    Distribution,
    draw_weighted,
    empirical,
    exponential,
    gamma,
    log,
    lognormal,
    normal,
    uniform,
)
from fleet2d.runtime.determinism import Draws, exp2, stream_key

KEY = stream_key(4, "users.ana", "law")


def drawn(law: Distribution, count: int = 6000) -> list[int]:
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


@pytest.mark.parametrize("make", [lognormal, gamma, normal])
@pytest.mark.parametrize(("mean", "std"), [(1800, 300), (1800, 900), (28800, 2700)])
def test_a_law_has_its_mean_and_standard_deviation_but_for_its_cut_tails(make, mean, std):
    values = drawn(make(mean, std))
    assert mean == pytest.approx(statistics.mean(values), rel=0.03)
    assert std == pytest.approx(statistics.pstdev(values), rel=0.12)


def test_a_gamma_law_has_the_quantiles_of_the_gamma_law():
    # Shape 4, scale 450 s: the quantiles at 10, 50 and 90 %, from tables of chi-squared / 2.
    law = gamma(1800, 900)
    values = sorted(drawn(law, 20_000))
    for share, expected in (
        (0.1, 3.490 / 2 * 450),
        (0.5, 7.344 / 2 * 450),
        (0.9, 13.362 / 2 * 450),
    ):
        assert expected == pytest.approx(values[int(share * len(values))], rel=0.03)


def test_an_exponential_law_is_that_of_waiting():
    values = sorted(drawn(exponential(1000), 20_000))
    assert 1000 == pytest.approx(statistics.mean(values), rel=0.03)
    assert 1000 * math.log(2) == pytest.approx(values[10_000], rel=0.03)


def test_measured_quantiles_are_joined_by_lines():
    values = sorted(drawn(empirical([60, 120, 600]), 20_000))
    assert 60 <= values[0] < values[-1] <= 600
    assert 120 == pytest.approx(values[10_000], abs=5)
    assert 360 == pytest.approx(values[15_000], abs=15)


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


def test_between_equal_bounds_there_is_one_value():
    assert 700 == uniform(700, 700).draw(Draws(KEY, 0))


def test_weights_are_shares():
    draws = Draws(KEY, 2)
    indices = [draw_weighted(draws, [1, 0, 3]) for _ in range(4000)]
    assert 0 == indices.count(1)
    assert 0.25 == pytest.approx(indices.count(0) / 4000, abs=0.03)
    with pytest.raises(ValueError, match="bound"):
        draw_weighted(draws, [0, 0])
