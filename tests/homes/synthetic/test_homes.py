"""Homes by seed: valid, different from each other, and the same on every machine."""

import hashlib
import json
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import shapely
from tests.thorough import some

from fleet2d.errors import FloorPlanError
from fleet2d.homes.synthetic.generator import (
    MAX_CORRIDOR_SHARE,
    generate,
    outline_corners,
    outline_kind,
)
from fleet2d.homes.synthetic.program import SIZES, Style, Wishes
from fleet2d.homes.synthetic.slicing import boxes_overlap
from fleet2d.homes.synthetic.source import Synthetic

SEEDS = some(range(60), 3)
# They change when the generator draws other homes; then stored runs can't be reproduced.
DIGESTS = {
    0: "42e0fa15519d2021",
    1: "0c7080dd776aa053",
    7: "0fa7614fa4cef15d",
    12: "df3c6dc2f4a03095",
    133: "17ecde2844dcb812",
    2147483648: "95d8e3671f7f3d88",
}
PRIVATE = {"bedroom", "bathroom", "toilet", "wardrobe"}


@cache
def home(seed, **settings):
    return Synthetic(seed=seed, **settings).load()


def reachable_rooms(plan):
    links = [door.rooms for door in plan.doorways]
    reached = {plan.room_at(*plan.entrance).index}
    for _ in plan.rooms:
        reached |= {a for pair in links for a in pair if reached & set(pair)}
    return reached


def content(house):
    """The digest of the content of a floor plan, independent of how plans are stored."""
    gaps = [(*gap.wall, gap.low, gap.high, gap.leaf) for gap in (*house.gaps, house.front_door)]
    kinds = [brief.kind for brief in house.briefs]
    return hashlib.sha256(json.dumps([kinds, house.boxes, gaps]).encode()).hexdigest()[:16]


def house_of(seed):
    return generate(seed, Wishes(), Style())


def test_seed_whose_first_areas_fit_into_no_layout_gets_another_area():
    # 480 layouts of 386, 292, 394 and 277 m2 were drawn in vain for it: the data set that trains
    # the model `learned` has this home, and couldn't be made.
    assert Synthetic(seed=1022).load().rooms_of_type("bedroom")


@pytest.mark.parametrize("seed", SEEDS)
def test_home_is_in_one_part_for_a_body_and_every_room_can_be_reached_by_doorways(seed):
    plan = home(seed)
    assert () == plan.notes
    assert 1 == len(plan.polygons)
    assert set(range(len(plan.rooms))) == reachable_rooms(plan)
    # Free space that a disc of 0.25 m can be in stays in one part, with a piece in every room.
    scale = plan.lattice.units_per_m
    space = shapely.buffer(plan.polygons[0], -0.25 * scale, join_style="mitre")
    assert "Polygon" == space.geom_type
    for room in plan.rooms:
        assert shapely.intersects_xy(space, *plan.lattice.to_lattice(room.anchor_xy)), room.name


@pytest.mark.parametrize("seed", SEEDS)
def test_doorways_are_as_wide_as_a_body_needs_and_lead_where_they_should(seed):
    plan = home(seed)
    assert all(door.width_m >= 0.7 - 1e-9 for door in plan.doorways)
    front = next(door for door in plan.doorways if door.name == "front_door")
    assert 0.95 == pytest.approx(front.width_m)
    assert front.rooms[0] == front.rooms[1] == plan.room_at(*plan.entrance).index
    inner = [door for door in plan.doorways if door is not front]
    assert all(door.rooms[0] != door.rooms[1] for door in inner)
    # No route leads through a bathroom or a bedroom, except to a room that belongs to it.
    for room in (room for room in plan.rooms if room.type in PRIVATE):
        doors = [door for door in inner if room.index in door.rooms]
        others = {plan.rooms[sum(d.rooms) - room.index].type for d in doors}
        assert 1 == len(doors) or (room.type == "bedroom" and len(others - PRIVATE) <= 1)


@pytest.mark.parametrize("seed", SEEDS)
def test_rooms_are_of_sensible_shapes_and_the_kitchen_is_by_where_people_eat(seed):
    house = house_of(seed)
    assert not boxes_overlap(house.boxes)
    for index, brief in enumerate(house.briefs):
        # A room may have a corridor or a niche; its largest part is as wide as its type needs.
        boxes = [box for box in house.boxes if box.room == index]
        largest = max(boxes, key=lambda box: box.clear_area)
        assert min(largest.clear) >= 20 * SIZES[brief.kind].side
        assert all(min(box.clear) >= 18 for box in boxes)
    halls = sum(b.clear_area for b in house.boxes if house.briefs[b.room].kind == "hallway")
    assert halls <= MAX_CORRIDOR_SHARE * sum(box.clear_area for box in house.boxes)
    plan = home(seed)
    kinds = [
        {label for i in door.rooms for label in plan.rooms[i].labels} for door in plan.doorways
    ]
    assert any("kitchen" in k and k & {"living_room", "dining_room"} for k in kinds)
    baths = [room.area_m2 for room in plan.rooms if room.type == "bathroom"]
    assert max(baths) < plan.room("living_room_1").area_m2


@pytest.mark.parametrize("seed", DIGESTS)
def test_seed_gives_the_home_that_it_gives_on_every_machine(seed):
    assert DIGESTS[seed] == content(house_of(seed))


@pytest.mark.parametrize(
    ("area", "bedrooms", "bathrooms"),
    [(36, 1, 1), (62, 2, 1), (90, 2, 2), (120, 3, 2), (186, 3, 2), (240, 5, 3), (300, 4, 3)],
)
def test_area_and_rooms_are_as_requested(area, bedrooms, bathrooms):
    for seed in range(4):
        plan = home(seed, area_m2=area, bedrooms=bedrooms, bathrooms=bathrooms)
        types = [room.type for room in plan.rooms]
        assert area == pytest.approx(plan.area_m2, rel=0.05)
        assert (bedrooms, bathrooms) == (types.count("bedroom"), types.count("bathroom"))
        assert {"living_room", "kitchen"} <= {label for room in plan.rooms for label in room.labels}


@pytest.mark.parametrize("outline", ["rectangle", "L", "T", "U"])
def test_outline_is_the_requested_one(outline):
    for seed in range(6):
        house = generate(seed, Wishes(area_m2=140, bedrooms=3), Style(outline=outline))
        assert outline == outline_kind(outline_corners(house.boxes))


def test_widths_and_open_plan_are_as_requested():
    settings = {"area_m2": 130, "bedrooms": 3, "door_width": 0.9, "corridor_width": 1.4}
    halls = []
    for seed in range(6):
        house = generate(seed, Wishes(130, 3), Style(None, True, 28, 18))
        halls += [b for b in house.boxes if house.briefs[b.room].kind == "hallway"]
        plan = home(seed, open_plan=True, **settings)
        for door in plan.doorways:
            types = {plan.rooms[index].type for index in door.rooms}
            if types == {"hallway", "bedroom"}:
                assert 0.9 == pytest.approx(door.width_m)
            if types <= {"living_room", "dining_room", "kitchen"} and door.name != "front_door":
                assert not door.leaf
                assert door.width_m > 1.5
    assert {28} == {min(box.clear) for box in halls}


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"area_m2": 30, "bedrooms": 8}, "30 m2 can't have 8 bedrooms"),
        ({"area_m2": 30, "bedrooms": 8}, "30 m2 fits 1 bedroom"),
        ({"area_m2": 40, "garage": True}, "at least"),
        ({"area_m2": 450, "bedrooms": 1}, "more bedrooms"),
        ({"bedrooms": 1, "bathrooms": 5}, "at most 3 bathrooms"),
    ],
)
def test_contradiction_is_refused_with_what_would_fit(settings, words):
    with pytest.raises(FloorPlanError, match=words):
        Synthetic(**settings).load()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"area_m2": 10}, "area_m2"),
        ({"area_m2": 17}, "area_m2"),
        ({"bedrooms": 0}, "bedrooms"),
        ({"seed": -1}, "seed"),
        ({"corridor_width": "300 cm"}, "corridor_width\n *expected a width of 0.9 m to 2 m, got 3"),
        ({"door_width": 0.1}, "door_width\n *expected a width of 0.7 m to 1.2 m, got 0.1"),
    ],
)
def test_setting_out_of_range_is_refused_with_its_limits(settings, message):
    with pytest.raises(ValueError, match=message):
        Synthetic(**settings)


def test_areas_spread_as_those_of_real_homes_do():
    from fleet2d.homes.synthetic.program import Choices, settle_wishes

    areas = sorted(
        settle_wishes(Wishes(), Choices(seed, "wishes"), Style()).area_m2 for seed in range(800)
    )
    quartiles = np.percentile(areas, [25, 50, 75]).tolist()
    assert [89, 141, 206] == pytest.approx(quartiles, rel=0.08)
    assert all(low <= high for low, high in pairwise(areas))
