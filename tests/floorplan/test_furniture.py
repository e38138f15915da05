"""The catalogue is sound, and pieces stand and are used where it says."""

import math

import pytest

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.furniture import FURNITURE, furniture_type, stand_furniture
from fleet2d.kernels import QUARTER, TURN

ALL = [pytest.param(furniture, id=furniture.type) for furniture in FURNITURE.values()]


@pytest.mark.parametrize("furniture", ALL)
def test_people_stand_beside_blocking_furniture_and_not_in_it(furniture):
    thing = stand_furniture(furniture.type, (0.0, 0.0))
    x0, y0, x1, y1 = thing.footprint.bounds
    for use in thing.uses:
        inside = x0 < use.x < x1 and y0 < use.y < y1
        if use.posture == "stand":
            assert inside == (furniture.type == "shower")
        else:
            assert abs(use.x) <= (x1 - x0) / 2 + 0.5
            assert abs(use.y) <= (y1 - y0) / 2 + 0.5


@pytest.mark.parametrize(
    ("heading", "x", "y", "facing"),
    [
        (0, 3.65, 2.0, math.pi),
        (QUARTER, 3.0, 2.65, 1.5 * math.pi),
        (2 * QUARTER, 2.35, 2.0, 0.0),
        (3 * QUARTER, 3.0, 1.35, 0.5 * math.pi),
    ],
)
def test_person_stands_before_a_stove_and_faces_it(heading, x, y, facing):
    (use,) = stand_furniture("stove", (3.0, 2.0), heading, (0.6, 0.6)).uses

    assert pytest.approx((x, y, facing)) == (use.x, use.y, use.heading)


def test_turning_a_piece_turns_its_footprint_and_its_uses():
    plain = stand_furniture("bed", (0.0, 0.0), 0, (1.6, 2.0))
    turned = stand_furniture("bed", (0.0, 0.0), TURN // 8, (1.6, 2.0))

    assert pytest.approx(plain.footprint.area) == turned.footprint.area
    for before, after in zip(plain.uses, turned.uses, strict=True):
        c = math.cos(math.pi / 4)
        expected = (c * before.x - c * before.y, c * before.x + c * before.y)
        assert pytest.approx(expected) == (after.x, after.y)
    assert pytest.approx(math.pi / 4) == turned.heading


def test_unknown_type_is_refused_with_the_nearest_name():
    with pytest.raises(FloorPlanError, match=r"'sofaa'.*did you mean 'sofa'"):
        furniture_type("sofaa")
