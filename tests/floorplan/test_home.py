import copy

import pytest
import shapely

from fleet2d.errors import PlacementError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion

FREE = shapely.union_all([shapely.box(0, 0, 6, 3), shapely.box(8, 0, 10, 3)])


def home_with(*labels, entrance=None):
    """Return a home of 6 m and 2 m with rooms from x0 to x1 [m]."""
    regions = [LabelledRegion((name,), shapely.box(x0, 0, x1, 3)) for name, x0, x1 in labels]
    return Home(FloorPlan.build("test home", FREE, regions, entrance=entrance))


def way_out(home, part=0, radius=0.2):
    """Return the way out (x, y) [m]."""
    space = home.space(radius)
    at = home.way_out(space, part)
    assert part == space.part_at(*at)
    x, y = home.plan.lattice.to_metres(at).tolist()
    return x, y


def test_space_is_built_once_for_each_radius():
    home = home_with()

    assert home.space(0.2) is home.space(0.2)
    assert home.space(0.2) is not home.space(0.25)
    assert (0.2, 0.25) == (home.space(0.2).radius, home.space(0.25).radius)


def test_copy_of_a_home_changes_on_its_own_and_shares_its_spaces():
    home = home_with(("kitchen", 0, 3), ("bedroom", 3, 6))
    twin = copy.deepcopy(home)
    twin.use_room_as(twin.rooms[0], "Office")

    assert twin.space(0.2) is home.space(0.2)
    assert ("office", "kitchen") == (twin.rooms[0].type, home.rooms[0].type)


def test_way_out_is_the_free_place_nearest_to_the_entrance():
    x, y = way_out(home_with(("hallway", 0, 2), entrance=(5.99, 1.5)))

    assert abs(x - 5.775) < 0.05
    assert abs(y - 1.5) < 0.05


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        ([("kitchen", 0, 2), ("hallway", 2, 4), ("bedroom", 4, 6)], (2, 4)),
        ([("hallway", 0, 2), ("entryway", 2, 4), ("bedroom", 4, 6)], (2, 4)),
        ([("kitchen", 0, 2), ("bedroom", 2, 6)], (0, 2)),
        ([("bedroom", 0, 4), ("bathroom", 4, 6)], (0, 4)),
    ],
)
def test_way_out_without_an_entrance_is_in_the_likeliest_room(labels, expected):
    x, _ = way_out(home_with(*labels))

    assert expected[0] < x < expected[1]


def test_way_out_of_another_part_is_in_a_reachable_room():
    """Not where that part comes nearest to the hallway, which is out of reach."""
    home = home_with(("hallway", 0, 2), ("bedroom", 8, 9), ("kitchen", 9, 10))

    x, _ = way_out(home, part=1)

    assert 9 < x < 10


def test_way_out_of_a_missing_part_is_an_error():
    home = home_with(("kitchen", 0, 2))

    with pytest.raises(PlacementError, match=r"a body of radius 0\.2 m fits nowhere in test home"):
        home.way_out(home.space(0.2), 2)
