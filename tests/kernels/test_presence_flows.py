"""The earth mover's distance against a linear program."""

import numpy as np
import pytest
from tests.reference.presence import transport

from fleet2d.kernels import earth_mover


@pytest.mark.parametrize("seed", range(12))
def test_earth_mover_is_the_least_cost_of_any_flow(seed):
    random = np.random.default_rng(seed)
    rows, places = random.integers(1, 30), random.integers(1, 14)
    start, end = random.dirichlet(np.full(places, random.uniform(0.2, 2)), (2, rows))
    if seed % 3 == 0:  # equal shares, as after whole days
        start, end = (random.multinomial(8, each) / 8 for each in (start, end))
    at = random.uniform(0, 12, (places, 2)).round(seed % 3)  # some ways are equally long
    metres = np.abs(at[:, None] - at).sum(axis=2)

    expected = [transport(there, here, metres) for here, there in zip(start, end, strict=True)]

    assert expected == pytest.approx(earth_mover(start, end, metres).tolist(), abs=1e-9)


@pytest.mark.parametrize("places", [0, 1, 3])
def test_nothing_is_moved_onto_itself(places):
    share = np.full((2, places), 0.25)
    assert [0.0, 0.0] == earth_mover(share, share, np.ones((places, places))).tolist()
    assert [] == earth_mover(share[:0], share[:0], np.ones((places, places))).tolist()


def test_mass_that_has_no_place_to_go_stays():
    start, end = np.array([[3.0, 0]]), np.array([[0, 1.0]])
    assert [2.0] == earth_mover(start, end, 2 - 2 * np.eye(2)).tolist()


@pytest.mark.parametrize("seed", range(20))
def test_whole_masses_are_moved_for_a_whole_cost(seed):
    """To the last bit: nothing is rounded on the way to the least cost."""
    random = np.random.default_rng(seed)
    places = int(random.integers(1, 12))
    start, end = random.multinomial(40, np.full(places, 1 / places), (2, 9)).astype(float)
    at = random.integers(0, 9, (places, 2))  # many ways are equally long
    metres = np.abs(at[:, None] - at).sum(axis=2).astype(float)

    least = [transport(there, here, metres) for here, there in zip(start, end, strict=True)]

    assert np.rint(least).tolist() == earth_mover(start, end, metres).tolist()


def test_a_flow_is_undone_where_that_is_cheaper():
    """The nearest pair first would cost 1 + 9; crossing over costs 2 + 2."""
    metres = np.array([[0.0, 9, 1, 2], [9, 0, 2, 9], [1, 2, 0, 9], [2, 9, 9, 0]])
    start, end = np.array([[1.0, 1, 0, 0]]), np.array([[0.0, 0, 1, 1]])
    assert [4.0] == earth_mover(start, end, metres).tolist()
