"""Furniture by rule: in free space, apart, off the doorways, and all rooms stay reachable."""

from collections import Counter

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from tests.meshed_homes import plan_files
from tests.strategies import homes, quick
from tests.thorough import some

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.furnish import RULES, furnish
from fleet2d.floorplan.furniture import FURNITURE, stand_furniture
from fleet2d.floorplan.furniture_places import (
    DOOR_CLEARANCE,
)
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.load import load_floorplan
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.space import BODY_RADIUS, Space

# Cells of less than this may become a pocket beside furniture: no body's length fits into it.
POCKET_M2 = 0.1


def of_type(plan, kind):
    """Return the objects of a type."""
    return [thing for thing in plan.objects if thing.type == kind]


def check_stands_free(empty, plan):
    free = plan.free_space.buffer(1e-6)
    added = plan.objects[len(empty.objects) :]
    assert all(shapely.covers(free, thing.footprint) for thing in added)
    overlaps = [
        (a.name, b.name)
        for i, a in enumerate(plan.objects)
        for b in plan.objects[:i]
        if shapely.intersection(a.footprint, b.footprint).area > 1e-9
    ]
    assert [] == overlaps


def check_ways(empty, plan):
    """Free places that were connected in the empty home still are."""
    before, after = Space(empty, BODY_RADIUS), Home(plan).space(BODY_RADIUS)
    cell = plan.lattice.cell
    for part in range(before.parts):
        was = before.part_of_cell == part
        rest = after.part_of_cell[was & (after.part_of_cell >= 0)]
        sizes = sorted(Counter(rest.tolist()).values())
        assert not [size for size in sizes[:-1] if size * cell**2 >= POCKET_M2]
    for room in empty.rooms:
        in_room = empty.room_of_cell == room.index
        if (in_room & (before.part_of_cell >= 0)).any():
            assert (in_room & (after.part_of_cell >= 0)).any()


def check_uses(plan):
    space = Home(plan).space(BODY_RADIUS)
    for thing in plan.objects:
        if thing.type in FURNITURE and FURNITURE[thing.type].uses:
            assert thing.uses
        for use in thing.uses:
            if use.approach is not None:
                point = plan.lattice.to_lattice(use.approach).tolist()
                assert space.part_at(*point) >= 0
                if use.posture == "stand":
                    assert (use.x, use.y) == use.approach


def check_all(empty, plan):
    check_stands_free(empty, plan)
    check_ways(empty, plan)
    check_uses(plan)


@pytest.mark.slow
def test_real_homes_and_maps_of_robots_are_furnished_without_harm(shared_data):
    homes = plan_files(shared_data)
    maps = [*shared_data.glob("ros_maps/*/map.yaml"), *shared_data.glob("valetudo/*.json")]
    assert 6 == len(maps)
    pieces = 0
    for path in [*homes, *some(maps, 3)]:
        empty = load_floorplan(path)
        plan = furnish(empty)
        check_all(empty, plan)
        pieces += len(plan.objects) * (path in homes)
    assert pieces > 14 * len(homes)


@pytest.mark.slow
@quick
@given(homes(), st.sampled_from(sorted(RULES)), st.integers(0, 3))
def test_furniture_never_disconnects_a_home(polygons, kind, seed):
    # A cell of the strategies' raster is a metre and a half here.
    free = shapely.union_all([shapely.transform(p, lambda xy: xy * 1.5 / 64) for p in polygons])
    x0, y0, x1, y1 = free.bounds
    left = LabelledRegion((kind,), shapely.box(x0 - 1, y0 - 1, (x0 + x1) / 2, y1 + 1))
    right = LabelledRegion(("Bedroom",), shapely.box((x0 + x1) / 2, y0 - 1, x1 + 1, y1 + 1))
    plan = FloorPlan.build("random", free, [left, right], 0.1)
    try:
        furnished = furnish(plan, seed)
    except FloorPlanError:
        return  # nobody fits into it
    check_all(plan, furnished)


def one_room(kind, width=5.0, depth=4.0):
    box = shapely.box(0, 0, width, depth)
    return FloorPlan.build("room", box, [LabelledRegion((kind,), box)])


def types(plan):
    return Counter(thing.type for thing in plan.objects)


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("bedroom", {"bed", "wardrobe"}),
        ("child_room", {"single_bed", "wardrobe", "desk"}),
        ("living_room", {"sofa", "tv", "coffee_table"}),
        ("dining_room", {"table", "chair"}),
        ("kitchen", {"stove", "sink", "fridge", "kitchen_counter"}),
        ("bathroom", {"toilet", "washbasin", "shower"}),
        ("office", {"desk", "chair", "bookshelf"}),
        ("laundry", {"washing_machine"}),
        ("storage", {"shelf"}),
    ],
)
def test_room_gets_what_its_type_needs(kind, expected):
    plan = one_room(kind)

    assert expected <= set(types(furnish(plan)))
    assert furnish(plan, 3) == furnish(plan, 3)


def test_kitchen_stands_along_one_wall():
    plan = furnish(one_room("kitchen"))
    line = [of_type(plan, kind)[0] for kind in ("stove", "sink", "fridge")]

    assert 1 == len({thing.heading for thing in line})


def test_bed_has_its_head_at_a_wall_and_the_tv_faces_the_sofa():
    (bed,) = of_type(furnish(one_room("bedroom")), "bed")
    back = np.array(bed.footprint.centroid.coords[0]) - 1.0 * np.array(
        [np.cos(bed.heading), np.sin(bed.heading)]
    )
    assert min(back[0], 5 - back[0], back[1], 4 - back[1]) < 0.2
    plan = furnish(one_room("living_room"))
    sofa, tv = of_type(plan, "sofa")[0], of_type(plan, "tv")[0]
    assert pytest.approx(np.pi) == abs(sofa.heading - tv.heading)


def test_rooms_of_no_known_type_get_nothing():
    assert () == furnish(one_room("unknown")).objects
    assert () == furnish(one_room("yoga_studio")).objects


def test_density_zero_leaves_only_essential_furniture():
    plan = one_room("bedroom")

    assert {"bed", "nightstand", "wardrobe"} == set(types(furnish(plan, density=0)))
    assert set(types(furnish(plan, density=0))) < set(types(furnish(plan, density=10)))


@pytest.mark.parametrize("density", [-1, float("nan"), 11])
def test_density_out_of_range_is_refused(density):
    with pytest.raises(FloorPlanError, match="density"):
        furnish(one_room("bedroom"), density=density)


def test_room_that_holds_something_is_left_alone():
    box = shapely.box(0, 0, 5, 4)
    chair = stand_furniture("chair", (1.0, 1.0))
    region = LabelledRegion(("bedroom",), box)
    plan = FloorPlan.build("room", box, [region], objects=[chair])

    assert ["chair_1"] == [thing.name for thing in furnish(plan).objects]


@pytest.mark.slow
def test_nothing_stands_before_a_doorway():
    rooms = [shapely.box(0, 0, 4, 4), shapely.box(4.15, 0, 8, 4)]
    gap = shapely.box(4, 1.5, 4.15, 2.4)
    regions = [
        LabelledRegion((kind,), box.buffer(0.075, join_style="mitre"))
        for kind, box in zip(("bedroom", "kitchen"), rooms, strict=True)
    ]
    plan = FloorPlan.build("two", shapely.union_all([*rooms, gap]), regions)
    before = shapely.box(4 - DOOR_CLEARANCE + 0.1, 1.5, 4.15 + DOOR_CLEARANCE - 0.1, 2.4)
    for seed in range(10):
        furnished = furnish(plan, seed)
        assert len(furnished.objects) >= 5
        covered = shapely.union_all([thing.footprint for thing in furnished.objects])
        assert shapely.intersection(before, covered).area < 1e-9


def test_charger_stands_once_in_the_hallway():
    plan = furnish(load_floorplan())
    chargers = of_type(plan, "charger")

    assert 1 == len(chargers)
    at = chargers[0].footprint.centroid
    room = plan.room_at(at.x, at.y)
    assert "hallway" == room.type


def test_home_that_nobody_fits_into_is_refused():
    with pytest.raises(FloorPlanError, match="fits nowhere"):
        furnish(one_room("bedroom", 0.4, 3.0))
