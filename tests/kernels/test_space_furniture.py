"""Where groups of furniture can stand: the kernels are compared with slow, obvious twins."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.reference import furniture as slow
from tests.strategies import quick

from fleet2d.kernels import GroupRule, RoomFloor, corner_sums, group_places

SHAPES = [(1, 1), (1, 6), (6, 1), (4, 4), (5, 9)]
SMALL = GroupRule(width=2, depth=1, front=1, backed=0, corner=40, away=20, far=3)


def floor_of(shape, share, seed):
    """Return a random room, most of whose cells are free by a share, and what occupies it."""
    rng = np.random.default_rng(seed)
    whole = rng.random(shape) < share
    walls = [rng.random(shape) < 0.5 for _ in range(4)]
    floor = RoomFloor(
        holds=whole & (rng.random(shape) < share),
        whole=whole,
        before_walls=np.stack([corner_sums(wall) for wall in walls]),
        from_doors=rng.integers(-1, 30, shape),
    )
    return floor, rng.random(shape) > share


@pytest.mark.parametrize("shape", [(0, 0), (0, 3), (3, 0), *SHAPES])
@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_corner_sums_equal_the_slow_ones(shape, share):
    mask = np.random.default_rng(1).random(shape) < share

    assert slow.corner_sums(mask).tolist() == corner_sums(mask).tolist()


@quick
@given(
    st.sampled_from(SHAPES),
    st.sampled_from([0.0, 0.7, 0.9, 1.0]),
    st.integers(0, 1000),
    st.builds(
        GroupRule,
        width=st.integers(1, 5),
        depth=st.integers(1, 4),
        front=st.integers(0, 3),
        backed=st.integers(0, 4),
        corner=st.integers(0, 40),
        away=st.integers(0, 40),
        far=st.integers(1, 6),
    ),
)
def test_places_equal_the_slow_ones(shape, share, seed, group):
    floor, occupied = floor_of(shape, share, seed)

    expected = slow.group_places(floor, occupied, group)
    assert expected.tolist() == group_places(floor, occupied, group).tolist()


def test_group_larger_than_the_room_has_no_place():
    floor, occupied = floor_of((4, 6), 1.0, 0)
    nothing = np.zeros_like(occupied)

    assert len(group_places(floor, nothing, SMALL))
    assert 0 == len(group_places(floor, nothing, SMALL._replace(width=7)))
    assert 0 == len(group_places(floor, nothing, SMALL._replace(depth=6)))
    assert 0 == len(group_places(floor, nothing, SMALL._replace(front=6)))
    assert 0 == len(group_places(floor, ~nothing, SMALL))
