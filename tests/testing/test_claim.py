"""Claims about rates: decided no more often wrongly than is said, against exact sums."""

from itertools import product

import numpy as np
import pytest
from scipy.stats import binomtest

from fleet2d.errors import InputError
from fleet2d.testing.claim import (
    Claim,
    RateTest,
    SetUpError,
    nested_rate_interval,
    rate_interval,
    rate_test,
    seeds_for,
    steps_of,
)

CLAIMS = [(100, 0.95), (30, 0.9), (60, 0.5), (40, 1.0), (300, 0.98)]


def mean_seeds(test: RateTest, rate):
    """The exact mean number of seeds until a decision if this is the true rate."""
    mean, undecided = 0.0, 1.0
    for accepted, refused, _ in steps_of(test.accept, test.refuse, rate):
        mean += undecided
        undecided -= accepted + refused
    return mean


@pytest.mark.parametrize("error", [0.01, 0.05, 0.2])
@pytest.mark.parametrize(("seeds", "holds"), CLAIMS)
def test_exact_error_rates_are_as_stated(seeds, holds, error):
    test = rate_test(seeds, holds, error)
    assert 1 - test.acceptance(holds) <= error + 1e-12
    assert test.acceptance(test.alternative) <= error + 1e-12
    assert test.alternative < test.holds


@pytest.mark.parametrize("rate", [0.95, 0.6])
def test_acceptance_is_the_sum_over_all_outcomes(rate):
    """The slow twin: every outcome of ten seeds, one after the other."""
    test = rate_test(10, 0.9, 0.2)
    accepted, looked = 0.0, 0.0
    for outcome in product((True, False), repeat=10):
        chance = float(np.prod([rate if held else 1 - rate for held in outcome]))
        for number in range(1, 11):
            verdict = test.decide(number, outcome[:number].count(False))
            if verdict is not None:
                accepted += chance * verdict
                looked += chance * number
                break
    assert accepted == pytest.approx(test.acceptance(rate), abs=1e-12)
    assert looked == pytest.approx(mean_seeds(test, rate), abs=1e-9)


def test_a_claim_of_every_seed_ends_with_the_first_failure():
    test = rate_test(100)
    assert test.decide(3, 1) is False
    assert test.decide(99, 0) is None
    assert test.decide(100, 0) is True


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"seeds": 0}, "1 to 10,000"),
        ({"seeds": 10, "holds": 1.5}, "up to 1"),
        ({"seeds": 10, "holds": 0}, "above 0"),
        ({"seeds": 10, "error": 0.7}, "below 0.5"),
        ({"seeds": 3, "holds": 0.5}, "take 5 seeds or more"),
        ({"seeds": 1, "holds": 0.9}, "take 2 seeds or more"),
    ],
)
def test_wrong_numbers_are_refused(settings, words):
    with pytest.raises(InputError, match=words):
        rate_test(**settings)


@pytest.mark.parametrize(("held", "trials"), [(0, 10), (1, 20), (19, 20), (20, 20)])
def test_the_interval_of_a_rate_is_the_exact_one_of_the_binomial_distribution(held, trials):
    expected = binomtest(held, trials).proportion_ci(0.95, "exact")
    assert rate_interval(held, trials) == pytest.approx((expected.low, expected.high), abs=1e-9)


def test_trials_that_share_no_home_are_independent():
    outcomes = [True] * 9 + [False]
    assert rate_interval(9, 10) == nested_rate_interval([[held] for held in outcomes])
    assert rate_interval(9, 10) == nested_rate_interval([outcomes])  # seeds of one scenario


def test_trials_that_share_homes_tell_less_the_more_homes_differ():
    alike = nested_rate_interval([[True] * 3 + [False]] * 5)
    different = nested_rate_interval([[True] * 4] * 3 + [[True] * 3 + [False]] + [[False] * 4])
    assert alike == rate_interval(15, 20)
    assert different[1] - different[0] > 1.3 * (alike[1] - alike[0])
    # Whether homes differ isn't known if nothing ever failed, or nothing ever held.
    assert rate_interval(4, 4) == nested_rate_interval([[True] * 10] * 4)
    assert rate_interval(0, 4) == nested_rate_interval([[False] * 10] * 4)


def test_the_interval_of_a_rate_holds_it_where_homes_differ():
    generator = np.random.Generator(np.random.Philox(6))
    inside = alone = 0
    for _ in range(300):
        rates = generator.beta(3, 1, 10)  # of homes; the mean is 0.75
        held = generator.random((10, 8)) < rates[:, None]
        low, high = nested_rate_interval(held.tolist())
        inside += low <= 0.75 <= high
        low, high = rate_interval(int(held.sum()), held.size)
        alone += low <= 0.75 <= high
    assert inside >= 0.9 * 300
    assert alone < 0.9 * 300


@pytest.mark.parametrize(("holds", "other"), [(1.0, 0.9), (0.9, 0.7), (0.95, 0.8)])
def test_so_many_seeds_would_do_and_one_less_would_not(holds, other):
    needed = seeds_for(holds, other)

    assert needed is not None
    assert rate_test(needed, holds).alternative >= other
    assert rate_test(needed - 1, holds).alternative < other


@pytest.mark.slow
def test_a_claim_that_shows_nothing_is_refused_with_the_seeds_that_would_do():
    with pytest.raises(
        SetUpError,
        match=r"99 % can't be told from 90 % with 5 seeds, which show nothing.*; 63 would do",
    ):
        Claim(None, seeds=tuple(range(5)), holds=0.99).prepare()
    with pytest.raises(
        SetUpError, match=r"95 % can't be told from 90 % with 50 seeds; \d+ would do"
    ):
        Claim(None, seeds=tuple(range(50)), holds=0.95, width=0.05).prepare()
    Claim(None, seeds=tuple(range(50)), holds=0.95, width=0.2).prepare()
