"""How homes are drawn: symbols fill their pieces, floors follow from types of rooms."""

import pytest

from fleet2d.floorplan.furniture import FURNITURE
from fleet2d.palette import ROOM_COLORS
from fleet2d.viewing.look import ACTIVITIES, CARPETED, TILES, symbol_names, symbol_of

SIZES = [
    (name, wide, deep)
    for name, kind in FURNITURE.items()
    for wide in kind.width
    for deep in kind.depth
]


def test_every_symbol_is_of_a_type():
    assert symbol_names() - {"glass"} <= set(FURNITURE)


@pytest.mark.parametrize(("name", "wide", "deep"), SIZES)
def test_symbol_is_within_its_piece_at_every_size(name, wide, deep):
    shapes = symbol_of(name, wide, deep)
    assert shapes
    for shape in shapes:
        left, bottom, right, top = shape["at"]
        assert all(abs(x) <= wide / 2 + 1e-3 for x in (left, right)), shape
        assert all(abs(y) <= deep / 2 + 1e-3 for y in (bottom, top)), shape
        assert shape["fill"] or shape["edge"]


def test_floors_are_of_types_of_rooms():
    assert {*TILES, *CARPETED} <= set(ROOM_COLORS)


def test_activity_is_of_one_kind():
    activities = [each for _, of_kind in ACTIVITIES.values() for each in of_kind]
    assert len(activities) == len(set(activities))
