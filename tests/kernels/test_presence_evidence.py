"""Evidence in bins against the same with NumPy, to the last bit."""

from itertools import pairwise

import numpy as np
import pytest

from fleet2d.algorithms.presence.belief import with_anyone
from fleet2d.kernels import (
    PeoplePlaces,
    gather_views,
    sum_places,
    watched_views,
)


def views(seed, robots):
    """Return cells in view of some robots, many bins alike, and the patches that they are of."""
    random = np.random.default_rng(seed)
    room = np.repeat(np.arange(5), random.integers(1, 4, 5))
    cells = random.integers(0, 40, len(room))
    room_cells = np.maximum(np.bincount(room, cells, minlength=5).astype(np.int64), 1)
    most = random.integers(0, 2 + cells, (30, robots, len(room)))
    summed = random.integers(0, 61, most.shape) * most
    seen = np.stack([summed, most], axis=2)
    return seen[random.integers(0, 30, 200).repeat(3)], room, cells, room_cells


@pytest.mark.parametrize("robots", [0, 1, 3])
@pytest.mark.parametrize("seed", range(4))
def test_views_equal_numpy(seed, robots):
    cells, room, size, room_cells = views(seed, robots)
    first, of_patch = np.flatnonzero(np.diff(room, prepend=-1)), np.maximum(size, 1)
    summed, most = cells[:, :, 0], cells[:, :, 1].max(axis=1, initial=0)
    by_room = np.add.reduceat(summed, first, axis=2).max(axis=1, initial=0) / (room_cells * 60)
    shown = most / of_patch
    expected = (
        by_room,
        summed.max(axis=1, initial=0) / (of_patch * 60),
        shown,
        np.rint(np.minimum(shown, 1) * 255).astype(np.uint8),
    )

    result = gather_views(cells, room, size, room_cells, 60)

    for one, other in zip(expected, result, strict=True):
        assert one.dtype == other.dtype
        assert np.array_equal(one, other)


def test_half_a_part_is_rounded_to_the_even_one():
    room, size = np.zeros(1, np.int64), np.array([510])
    cells = np.array([1, 3, 5, 509])[:, None, None, None].repeat(2, axis=2)

    *_, parts = gather_views(cells, room, size, size, 1)

    assert [0, 2, 2, 254] == parts[:, 0].tolist()


@pytest.mark.parametrize("users", [1, 2, 4])
@pytest.mark.parametrize("seed", range(4))
def test_patches_with_an_unknown_person_are_not_watched(seed, users):
    random = np.random.default_rng(seed)
    shown = random.integers(0, 3, (12, 4)).astype(np.uint8)[random.integers(0, 12, 40)]
    user, bin_, patch = (random.integers(0, size, 60) for size in (users, 40, 4))
    steps = random.integers(1, 5, 60)

    view, views = watched_views(shown, user, bin_, patch, steps, users)

    expected = np.zeros((40, 5), np.uint8)
    for t, p in np.ndindex(shown.shape):
        here = (bin_ == t) & (patch == p)
        anybody, known = (steps[here & (user == users - 1)], steps[here & (user < users - 1)])
        is_unknown = users > 1 and anybody.sum() > known.sum()
        expected[t, p] = 0 if is_unknown else shown[t, p]
    assert np.array_equal(expected, views[view])
    assert np.array_equal(np.diff(view), (expected[1:] != expected[:-1]).any(axis=1))
    assert 0 == view[0]
    assert len(views) == view[-1] + 1


def values(chains, unknown, users):
    """Return what adds up of each bin, as an estimator in NumPy has it."""
    rows = with_anyone(list(chains), unknown) if users else chains[0][:, None]
    return np.concatenate([rows, rows * (1 - rows), np.ones((*rows.shape[:2], 1))], axis=2)


def together(stretches):
    """Return the stretches of people one after the other."""
    places, bins = (np.concatenate(parts) for parts in zip(*stretches, strict=True))
    begin = np.cumsum([0, *(len(lengths) for _, lengths in stretches)])
    return PeoplePlaces(places, bins, begin)


def chain_of(random, bins):
    """Return probabilities of places in stretches of up to five bins, and their lengths."""
    cuts = np.cumsum(random.integers(1, 6, bins))
    lengths = np.diff([0, *cuts[cuts < bins], bins])
    places = random.dirichlet(np.full(6, 0.1), len(lengths))
    places[::3] *= 1 + 1e-15  # sums are one up to rounding
    return places, lengths


@pytest.mark.parametrize("users", [0, 1, 2, 5])
@pytest.mark.parametrize("longest", [1, 7, 9, 60, 700])
def test_sums_by_hour_equal_numpy(users, longest):
    random = np.random.default_rng(users)
    ends = np.cumsum(random.integers(1, longest + 1, 9))
    stretches = [chain_of(random, int(ends[-1])) for _ in range(max(users, 1))]
    chains = np.stack([np.repeat(places, bins, axis=0) for places, bins in stretches])
    unknown = random.random((ends[-1], 5)) < 0.05
    first = np.array([0, *ends[:-1]])
    expected = np.add.reduceat(values(chains, unknown, users), first, axis=0)

    result = sum_places(together(stretches), unknown, users, first)

    assert np.array_equal(expected, result)
    for sums, (a, b) in zip(result, pairwise([0, *ends.tolist()]), strict=True):
        assert (sums[:, -1] == b - a).all()
