"""Claims about rates: decided no more often wrongly than is said, against exact sums and by trying."""

from itertools import product

import numpy as np
import pytest

from fleet2d.errors import InputError
from fleet2d.kernels import Bool
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

DECISIONS = 10_000
CLAIMS = [(100, 0.95), (30, 0.9), (60, 0.5), (40, 1.0), (300, 0.98)]


def decisions(test: RateTest, rate: float, seed: int) -> Bool:
    """10,000 decisions about lives that hold with a rate: True where the claim is accepted."""
    draws = np.random.Generator(np.random.Philox(seed)).random((DECISIONS, test.seeds)) >= rate
    failures = np.cumsum(draws, axis=1)
    accepted = failures <= test.accept[1:]
    refused = failures >= test.refuse[1:]
    first = np.argmax(accepted | refused, axis=1)
    assert (accepted | refused).any(axis=1).all()  # each is decided at the last seed
    return accepted[np.arange(DECISIONS), first]


@pytest.mark.parametrize(("seeds", "holds"), CLAIMS)
def test_error_rates_of_ten_thousand_decisions_are_as_stated(seeds, holds):
    test = rate_test(seeds, holds)
    noise = 4 * np.sqrt(0.05 * 0.95 / DECISIONS)
    refusals_of_truth = 1 - decisions(test, holds, 1).mean()
    acceptances_of_untruth = decisions(test, test.alternative, 2).mean()
    assert refusals_of_truth <= test.error + noise
    assert acceptances_of_untruth <= test.error + noise
    assert decisions(test, test.alternative - 0.02, 3).mean() < acceptances_of_untruth + noise


def mean_seeds(test: RateTest, rate: float) -> float:
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


def test_clear_rates_stop_early():
    test = rate_test(100, 0.95)
    assert mean_seeds(test, 0.5) < 15
    assert mean_seeds(test, 1.0) < 60
    assert test.decide(20, 12) is False


def test_more_seeds_tell_nearer_rates():
    rates = [rate_test(seeds, 0.95).alternative for seeds in (20, 50, 100, 300)]
    assert sorted(rates) == rates


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
        rate_test(**settings)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.5, 0.8, 0.97])
def test_the_interval_of_a_rate_holds_it_in_95_of_100_cases(rate):
    held = np.random.Generator(np.random.Philox(5)).binomial(40, rate, 2000)
    inside = [low <= rate <= high for low, high in (rate_interval(int(k), 40) for k in held)]

    assert np.mean(inside) >= 0.95
    assert rate_interval(0, 10)[0] == 0.0
    assert rate_interval(10, 10)[1] == 1.0
    assert rate_interval(10, 10)[0] == pytest.approx(0.025 ** (1 / 10))


@pytest.mark.parametrize("held", [0, 1, 19, 20])
def test_the_interval_of_a_rate_is_within_0_and_1(held):
    low, high = rate_interval(held, 20)
    assert 0 <= low <= held / 20 <= high <= 1
    assert 0 < high - low < 1


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
