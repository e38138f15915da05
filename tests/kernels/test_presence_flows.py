"""The earth mover's distance against its twin, to the last bit."""

import numpy as np
import pytest
from tests.reference.flows import earth_mover as slow_earth_mover

from fleet2d.kernels import earth_mover


@pytest.mark.parametrize("seed", range(40))
def test_earth_mover_equals_its_twin(seed):
    random = np.random.default_rng(seed)
    rows, places = random.integers(1, 30), random.integers(1, 14)
    start, end = random.dirichlet(np.full(places, random.uniform(0.2, 2)), (2, rows))
    if seed % 3 == 0:  # equal shares, as after whole days
        start, end = (np.rint(each * 8) / 8 for each in (start, end))
    at = random.uniform(0, 12, (places, 2)).round(seed % 3)  # some ways are equally long
    metres = np.abs(at[:, None] - at).sum(axis=2)

    expected = [slow_earth_mover(*pair, metres.tolist()) for pair in zip(start, end, strict=True)]

    assert expected == earth_mover(start, end, metres).tolist()


@pytest.mark.parametrize("places", [0, 1, 3])
def test_nothing_is_moved_onto_itself(places):
    share = np.full((2, places), 0.25)
    assert [0.0, 0.0] == earth_mover(share, share, np.ones((places, places))).tolist()
    assert [] == earth_mover(share[:0], share[:0], np.ones((places, places))).tolist()


def test_mass_that_has_no_place_to_go_stays():
    assert [2.0] == earth_mover(
        np.array([[3.0, 0]]), np.array([[0, 1.0]]), 2 - 2 * np.eye(2)
    ).tolist()


def test_wrong_arrays_are_refused():
    share, metres = np.full((2, 3), 1 / 3), np.zeros((3, 3))
    for arguments in ((share, share[:1], metres), (share, share, metres[:2])):
        with pytest.raises(ValueError, match="must be"):
            earth_mover(*arguments)
    for i in range(3):
        arguments = [share, share, metres]
        arguments[i] = np.full_like(arguments[i], np.nan)
        with pytest.raises(ValueError, match="finite"):
            earth_mover(*arguments)
    with pytest.raises(TypeError):
        earth_mover(share.astype(np.float32), share, metres)
