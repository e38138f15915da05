"""Chains of presence against the sum over all paths, resampled days against draws one by one."""

import numpy as np
import pytest
from tests.reference import presence as slow

from fleet2d.kernels.presence import advance, backward, count_sightings, forward, resampled
from fleet2d.kernels.random import random_below, random_bits


@pytest.mark.parametrize("seed", range(4))
def test_filter_and_smoother_are_the_sums_over_all_paths(seed: int) -> None:
    random = np.random.default_rng(seed)
    transition = random.dirichlet(np.ones(3), 3)
    start, likely = random.dirichlet(np.ones(3)), random.random((6, 3)) * 5
    scale, pairs = np.empty(6), np.zeros((3, 3))
    filtered = forward(transition, start, likely, scale)
    smoothed = backward(transition, start, likely, filtered, scale, np.ones(6), pairs)
    expected = slow.chain_posterior(transition, start, likely)
    for found, wanted in zip((filtered, smoothed, pairs), expected, strict=True):
        assert np.abs(found - wanted).max() < 1e-12


def test_weights_count_expected_steps_only() -> None:
    random = np.random.default_rng(1)
    transition, start = random.dirichlet(np.ones(3), 3), np.full(3, 1 / 3)
    likely, scale = random.random((5, 3)), np.empty(5)
    filtered = forward(transition, start, likely, scale)
    found = []
    for weight in (np.ones(5), np.array([1.0, 1, 1, 0, 0]), np.array([0.0, 0, 0, 1, 1])):
        pairs = np.zeros((3, 3))
        found.append((backward(transition, start, likely, filtered, scale, weight, pairs), pairs))
    assert np.array_equal(found[0][0], found[1][0])
    assert np.abs(found[0][1] - found[1][1] - found[2][1]).max() < 1e-12


def test_evidence_that_no_state_explains_tells_nothing() -> None:
    likely = np.array([[0.0, 0.0], [1.0, 1.0]])
    found = forward(np.full((2, 2), 0.5), np.array([1.0, 0.0]), likely, np.empty(2))
    assert [[0.5, 0.5], [0.5, 0.5]] == found.tolist()


def test_a_forecast_is_the_row_of_the_power() -> None:
    transition = np.random.default_rng(2).dirichlet(np.ones(4), 4)
    for bins in (0, 1, 7, 300):
        expected = np.linalg.matrix_power(transition, bins)[2]
        found = advance(np.eye(4)[2].copy(), transition, bins)
        assert np.abs(expected - found).max() < 1e-12


def test_each_sum_is_that_of_as_many_days_drawn_with_replacement() -> None:
    days = np.array([[1.0, 10.0], [2.0, 20.0], [4.0, 40.0]])
    key = np.uint64(7)
    found = resampled(key, days, 50)
    for b in range(50):
        draws = np.uint64(random_bits(key, b))
        drawn = [int(random_below(draws, d, 3)) for d in range(3)]
        assert days[drawn].sum(axis=0).tolist() == found[b].tolist()
    assert len(np.unique(found[:, 0])) > 5


@pytest.mark.parametrize("seed", range(4))
def test_sightings_are_the_steps_with_each_user_in_each_room(seed: int) -> None:
    random = np.random.default_rng(seed)
    users, rooms, bins, bin_steps = 2, 3, 4, 5
    step = np.sort(random.integers(-5, 25, 60))  # some before the first bin, some behind the last
    user, room = random.integers(-1, users, 60), random.integers(-1, rooms, 60)
    seen = np.zeros((bins, users + 1, rooms), np.int64)

    count_sightings(step, user, room, bin_steps, seen)

    rows = list(zip(step.tolist(), user.tolist(), room.tolist(), strict=True))
    for at, who, where in np.ndindex(seen.shape):
        steps = {s for s, u, r in rows if r == where and who in (u, users)}
        assert sum(s // bin_steps == at for s in steps) == seen[at, who, where]
