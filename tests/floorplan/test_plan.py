import copy
import pickle

import numpy as np
import pytest
import shapely
from tests.reference.fields import squared_distance

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion


@pytest.fixture
def flat():
    """A kitchen and a bedroom with a wall of 20 cm and a door of 1 m between them."""
    rooms = [shapely.box(0, 0, 2, 3), shapely.box(2.2, 0, 5, 3), shapely.box(2, 1, 2.2, 2)]
    labels = [
        LabelledRegion(("Kitchen",), shapely.box(-0.1, -0.1, 2.1, 3.1)),
        LabelledRegion(("Bedroom", "Office"), shapely.box(2.1, -0.1, 5.1, 3.1)),
    ]
    return FloorPlan.build("flat", shapely.union_all(rooms), labels, entrance=(0.5, 0.5))


def test_anchor_is_the_deepest_cell_lowest_row_then_column(flat):
    for room in flat.rooms:
        depth = squared_distance(flat.room_of_cell == room.index)
        row, column = np.argwhere(depth == depth.max())[0]

        expected = flat.lattice.to_metres(flat.lattice.cell_centre(row, column)).tolist()
        assert expected == list(room.anchor_xy)


def test_room_at_finds_rooms_and_nothing_in_walls_or_outside(flat):
    rooms = [flat.room_at(x, y) for x, y in [(1, 1), (2.05, 1.5), (4, 2)]]

    assert ["kitchen_1", "kitchen_1", "bedroom_1"] == [room.name if room else "" for room in rooms]
    assert [None] * 4 == [flat.room_at(*at) for at in [(2.1, 0.5), (-3, 1), (1, 1e6), (9, -9)]]


def test_room_by_name_or_index(flat):
    assert flat.room("bedroom_1") is flat.room(1)


def test_room_of_another_name_is_refused_with_the_nearest(flat):
    with pytest.raises(FloorPlanError, match=r"did you mean 'bedroom_1'.*kitchen_1, bedroom_1"):
        flat.room("bedrom_1")
    with pytest.raises(FloorPlanError, match="its rooms are 0 to 1"):
        flat.room(2)


def test_plans_are_equal_by_content(flat):
    again = FloorPlan.build("flat", shapely.box(0, 0, 5, 3), entrance=(0.5, 0.5))
    other = FloorPlan.build("flat", shapely.box(0, 0, 5, 3.1), entrance=(0.5, 0.5))
    start_elsewhere = shapely.Polygon([(5, 3), (0, 3), (0, 0), (5, 0)])

    assert again == FloorPlan.build("flat", start_elsewhere, source="x", entrance=(0.5, 0.5))
    assert again not in (other, flat, FloorPlan.build("flat", shapely.box(0, 0, 5, 3)))
    assert hash(again) == hash(again.named("flat"))
    assert again != again.named("house")


def test_copies_are_the_plan_itself_and_pickles_equal_it(flat):
    assert flat is copy.deepcopy(flat)
    assert flat is copy.copy(flat)
    assert flat == pickle.loads(pickle.dumps(flat))


def test_arrays_of_a_plan_cannot_be_written(flat):
    for array in (flat.free, flat.room_of_cell):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1


def test_holes_and_separate_parts_are_kept_and_noted():
    house = shapely.difference(shapely.box(0, 0, 6, 6), shapely.box(2, 2, 4, 4))
    plan = FloorPlan.build("estate", shapely.union(house, shapely.box(10, 0, 12, 2)))

    assert 36 - 4 + 4 == pytest.approx(plan.area_m2)
    assert ["unknown_1"] == [room.name for room in plan.rooms]
    assert ("the free space is in 2 parts that nothing joins: 32.00, 4.00 m2",) == plan.notes
    assert plan.room_at(3, 3) is None


def test_plan_too_thin_for_its_cells_is_refused_with_what_to_do():
    """Known failure 7: coarse cells lost area without a word."""
    with pytest.raises(
        FloorPlanError, match=r"holds no cell of 1 m: choose a smaller floorplan\.cell"
    ):
        FloorPlan.build("closet", shapely.box(0.1, 0.1, 0.4, 0.9), cell=1.0)
    with pytest.raises(FloorPlanError, match=r"nothing is left of speck .*: choose a smaller"):
        FloorPlan.build("speck", shapely.box(0.1, 0.1, 0.105, 0.105), cell=1.0)


def test_rounding_that_would_change_the_area_is_refused(monkeypatch):
    """Known failure 7: an area that doesn't survive rounding is an error, not a surprise."""
    # No known outline snaps so badly, so snapping is replaced.
    import fleet2d.floorplan.mesh as module
    from fleet2d.floorplan.mesh import SnappedPolygon

    half = SnappedPolygon([shapely.box(0, 0, 2560, 6400)], -(2560.0 * 6400), 46080.0)
    monkeypatch.setattr(module, "snap_polygon", lambda _: half)
    outline = shapely.box(0.0003, 0, 4, 5)

    with pytest.raises(
        FloorPlanError, match=r"change its area by -10\.00 of 20\.00 m2: choose a sm"
    ):
        FloorPlan.build("flat", outline)


@pytest.mark.parametrize("cell", [0.01, 0.03, 0.05, 0.1, 0.2, 0.5, 1.0])
def test_area_of_a_slanted_plan_holds_at_any_cell_size(cell):
    """Known failure 7: area stays within the stated tolerance, the perimeter times two units."""
    turned = shapely.affinity.rotate(shapely.box(0, 0, 8, 5), 23, origin=(0, 0))

    plan = FloorPlan.build("turned", turned, cell=cell)

    assert abs(plan.area_m2 - 40) <= 26 * 2 / plan.lattice.units_per_m


def test_entrance_in_a_wall_is_refused_with_the_nearest_free_place():
    """Known failure 11: a place in a wall is an error that says where free space is."""
    with pytest.raises(
        FloorPlanError, match=r"at \(-1, 2\) m is not in free space: .*\(0\.03, 1\.98\)"
    ):
        FloorPlan.build("flat", shapely.box(0, 0, 5, 3), entrance=(-1, 2))


def test_repr_says_what_plan_it_is(flat):
    assert "<FloorPlan flat: 14.6 m2, 2 rooms, 104 x 64 cells of 0.05 m>" == repr(flat)
