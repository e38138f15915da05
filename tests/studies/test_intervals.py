"""Intervals hold the truth as often as they claim, over homes and seeds."""

import math
import runpy
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from tests.thorough import some

from fleet2d.studies.intervals import ENOUGH_UNITS, MeanEstimate, estimate

BENCHMARK = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "intervals.py"))


def test_equal_values_do_not_tell_how_much_others_differ():
    for values in ([0.5, 0.5, 0.5], [0.1 + 0.2, 0.3, 0.3]):
        mean = estimate(values)
        assert math.isnan(mean.low)
        assert math.isnan(mean.high)
        assert "all 3 values are equal" in mean.doubt


def test_levels_with_a_single_unit_do_not_count():
    one_level = estimate([1.0, 2.0, 4.0], {"seed": [0, 1, 2]})
    assert one_level == estimate([1.0, 2.0, 4.0], {"home": ["a"] * 3, "seed": [0, 1, 2]})


def study_of(homes, effect) -> MeanEstimate:
    generator = np.random.default_rng(3)
    of_home, seeds = generator.normal(effect, 1, homes), 4
    values = np.repeat(of_home, seeds) + generator.normal(0, 0.5, homes * seeds)
    levels = {"home": np.repeat(np.arange(homes), seeds), "seed": list(range(seeds)) * homes}
    return estimate(values, levels)


def test_p_values_are_below_five_percent_where_intervals_exclude_zero():
    generator = np.random.default_rng(3)
    for _ in range(300):
        mean = estimate(generator.exponential(1, 8) - generator.uniform(0, 1))
        assert (mean.p_value < 0.05) == mean.is_clear


def test_p_values_of_one_value_or_of_equal_ones():
    assert math.isnan(estimate([0.5]).p_value)
    equal = [0.5] * 6
    # Of the sign test: 2 of the 64 patterns of signs are as extreme as six of the same.
    assert (2 / 64, 1.0) == (estimate(equal).p_value, estimate([0.0, 0.0]).p_value)


def test_a_study_of_the_size_that_is_needed_detects_the_effect():
    spread = study_of(6, 0.7).spread
    homes = spread.needed(0.7, "home", units={"seed": 10})
    assert spread.detectable({"home": homes, "seed": 10}) <= 0.7
    assert spread.detectable({"home": homes - 1, "seed": 10}) > 0.7
    assert spread.needed(0.1, "seed") is None  # homes differ: seeds alone don't do


@pytest.mark.parametrize(
    ("shape", "design"), some([*product(BENCHMARK["SHAPES"], BENCHMARK["DESIGNS"])], 2)
)
def test_intervals_that_are_told_hold_the_truth(shape, design):
    for homes in BENCHMARK["HOMES"]:
        case = BENCHMARK["Case"](shape, homes, design)
        found = BENCHMARK["coverage"](case, 150)
        if homes < ENOUGH_UNITS:
            assert 1 == found.untold
        elif found.untold < 0.5:
            # 90 % or more, within 2 standard errors of 150 studies.
            assert 0.85 <= found.told


def test_a_doubt_names_the_units_and_how_many_more_would_do():
    doubt = estimate(np.arange(10.0), {"home": range(10)}).doubt
    missed = "with 10 homes, 35 % of studies miss a kind that makes up a tenth of all"
    assert f"{missed}; 19 more" in doubt
    assert not estimate(np.arange(29.0)).doubt


def test_few_seeds_are_doubted_only_where_they_matter():
    generator = np.random.default_rng(5)
    home, seed = np.divmod(np.arange(160), 4)
    of_home, of_seed = generator.normal(0, 1, 40), generator.normal(0, 1, 4)
    levels = {"home": home, "seed": seed}
    assert not estimate(of_home[home] + 0.01 * of_seed[seed], levels).doubt
    assert "4 seeds" in estimate(of_home[home] + 3 * of_seed[seed], levels).doubt


@pytest.mark.parametrize("values", [[0.0, 0.0, 0.0, 0.4], [0.99, 1.0, 1.0, 0.2], [0.0, 1.0]])
def test_an_interval_of_shares_is_within_0_and_1(values):
    free, limited = estimate(values), estimate(values, limits=(0.0, 1.0))
    assert free.low < 0 or free.high > 1
    assert 0 <= limited.low <= limited.mean <= limited.high <= 1


def test_values_outside_of_their_limits_are_not_cut():
    percent = [20.0, 40.0, 90.0]
    assert estimate(percent) == estimate(percent, limits=(0.0, 1.0))


def test_one_value_has_no_interval():
    mean = estimate([0.5], {"home": [0], "seed": [0]})
    assert 0.5 == mean.mean
    assert math.isnan(mean.low)


@pytest.mark.parametrize("values", [[], [math.nan, 1.0], [1.0, math.inf]])
def test_what_is_no_number_has_no_interval(values):
    mean = estimate(values)
    assert math.isnan(mean.mean)
    assert math.isnan(mean.low)
    assert math.isnan(mean.p_value)
    assert "no number" in mean.doubt
