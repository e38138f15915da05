"""Forecasts against powers of matrices, resampled days against draws one by one."""

import numpy as np
import pytest

from fleet2d._core import random_bits
from fleet2d.kernels import advance, list_sightings, random_below, resampled


def test_a_forecast_is_the_row_of_the_power():
    transition = np.random.default_rng(2).dirichlet(np.ones(4), 4)
    for bins in (0, 1, 7, 300):
        expected = np.linalg.matrix_power(transition, bins)[2]
        forecast = advance(np.eye(4)[2].copy(), transition, bins)
        assert np.abs(expected - forecast).max() < 1e-12


def test_each_resample_draws_as_many_days_with_replacement():
    days = np.array([[1.0, 10.0], [2.0, 20.0], [4.0, 40.0]])
    key = np.uint64(7)
    sums = resampled(key, days, 50)
    for b in range(50):
        draws = np.uint64(random_bits(key, b))
        drawn = [int(random_below(draws, d, 3)) for d in range(3)]
        assert days[drawn].sum(axis=0).tolist() == sums[b].tolist()
    assert len(np.unique(sums[:, 0])) > 5


@pytest.mark.parametrize("seed", range(4))
def test_sightings_are_the_steps_with_each_user_in_each_room(seed):
    random = np.random.default_rng(seed)
    users, rooms, bins, bin_steps = 2, 3, 4, 5
    step = np.sort(random.integers(-5, 25, 60))  # some before the first bin, some behind the last
    index = random.integers(0, 20, 60).astype(np.int32)
    user, room = random.integers(-1, users, 20), random.integers(-1, rooms, 20)
    shape = (bins, users + 1, rooms)

    *where, counts = list_sightings(step, index, user, room, bin_steps, *shape)

    assert list(zip(*where, strict=True)) == sorted(set(zip(*where, strict=True)))
    seen = np.zeros(shape, np.int64)
    seen[where[1], where[0], where[2]] = counts
    rows = list(zip(step.tolist(), user[index].tolist(), room[index].tolist(), strict=True))
    for at, who, where in np.ndindex(seen.shape):
        steps = {s for s, u, r in rows if r == where and who in (u, users)}
        assert sum(s // bin_steps == at for s in steps) == seen[at, who, where]
    assert (counts > 0).all()
