import copy
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.reference import random as slow
from tests.strategies import quick

from fleet2d._core import BELL_MEAN, Bits, random_bits
from fleet2d.kernels import (
    BELL_STD,
    StepDraws,
    random_bell,
    random_bells,
    random_below,
    random_uniform,
)

keys = st.integers(0, 2**64 - 1)
counters = st.integers(0, 2**63 - 1)

# Outputs of the reference implementation (Vigna's splitmix64.c) for two seeds.
KNOWN = {
    1234567: [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ],
    0: [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F],
}


@pytest.mark.parametrize("seed", KNOWN)
def test_random_bits_are_the_published_outputs_of_splitmix64(seed):
    expected = KNOWN[seed]

    assert expected == [int(random_bits(np.uint64(seed), i)) for i in range(len(expected))]
    assert expected == slow.splitmix(seed, len(expected))


@quick
@given(keys, counters)
def test_random_bits_of_any_key_and_counter_equal_the_reference(key, counter):
    assert slow.random_bits(key, counter) == int(random_bits(np.uint64(key), counter))


@quick
@given(keys, counters, st.one_of(st.sampled_from([1, 2, 2**31 - 1]), st.integers(1, 2**31 - 1)))
def test_random_below_is_in_range_and_that_of_the_twin(key, counter, bound):
    drawn = int(random_below(np.uint64(key), counter, bound))

    assert 0 <= drawn < bound
    assert slow.random_below(key, counter, bound) == drawn


def test_random_below_the_largest_bound_does_not_overflow():
    """The product of 32 random bits and the bound needs 63 bits."""
    bound = 2**31 - 1
    of_ones, of_zeros = np.uint64(slow.key_of_word(2**64 - 1)), np.uint64(slow.key_of_word(0))

    assert bound - 1 == random_below(of_ones, 0, bound)
    assert random_below(of_zeros, 0, bound) == 0


@quick
@given(keys, counters)
def test_random_uniform_is_the_upper_53_bits(key, counter):
    drawn = float(random_uniform(np.uint64(key), counter))

    assert 0.0 <= drawn < 1.0
    assert slow.random_bits(key, counter) >> 11 == drawn * 2**53


@quick
@given(keys, counters)
def test_random_bell_is_the_sum_of_the_bytes(key, counter):
    assert slow.random_bell(key, counter) == int(random_bell(np.uint64(key), counter))


@pytest.mark.parametrize(("word", "expected"), [(0, -1020), (2**64 - 1, 1020), (255 << 56, -765)])
def test_random_bell_of_extreme_words(word, expected):
    """A word of ones has the largest sum: 2040, in lanes of sixteen bits."""
    key = np.uint64(slow.key_of_word(word))
    assert word == int(random_bits(key, 0))

    assert expected == int(random_bell(key, 0))


def test_random_bell_has_the_stated_moments():
    chances = slow.distribution_of_bell()

    assert 1 == sum(chances.values())
    assert 0 == sum(value * chance for value, chance in chances.items())
    assert 43690 == sum(value**2 * chance for value, chance in chances.items())
    assert (1020, 43690**0.5) == (BELL_MEAN, pytest.approx(BELL_STD, abs=1e-9))


@quick
@given(keys, counters, st.lists(st.integers(1, 2**31 - 1)))
def test_draws_of_a_step_equal_the_reference(key, step, bounds):
    draws = StepDraws(np.uint64(key), step)
    own_key = slow.random_bits(key, step)

    expected = [slow.random_below(own_key, i, bound) for i, bound in enumerate(bounds)]
    assert expected == [draws.below(bound) for bound in bounds]
    assert (slow.random_bits(own_key, len(bounds)) >> 11) / 2**53 == draws.uniform()


@quick
@given(keys, st.lists(st.integers(0, 30)))
def test_bits_of_a_draw_of_30_are_used_from_the_lowest(key, counts):
    bits, draws = Bits(StepDraws(np.uint64(key), 5)), StepDraws(np.uint64(key), 5)

    left = value = 0
    for count in counts:
        if left < count:
            value, left = draws.below(1 << 30), 30
        assert value % 2**count == bits.take(count)
        value, left = value >> count, left - count


@pytest.mark.parametrize("way", [copy.copy, lambda draws: pickle.loads(pickle.dumps(draws))])
def test_a_copy_of_draws_is_independent(way):
    draws = StepDraws(np.uint64(3), 5)
    draws.below(7)
    twin = way(draws)
    assert [draws.below(10**9) for _ in range(3)] == [twin.below(10**9) for _ in range(3)]


@quick
@given(keys, st.lists(counters))
def test_bell_shaped_draws_of_many_counters_are_those_of_each(key, many):
    draws = random_bells(np.uint64(key), np.array(many, np.int64))
    assert [random_bell(key, counter) for counter in many] == draws.tolist()
