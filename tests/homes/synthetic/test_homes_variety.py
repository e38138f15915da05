from functools import cache

import pytest
from tests.homes.synthetic.test_homes import PRIVATE
from tests.thorough import some

import fleet2d
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.checkup import checkup
from fleet2d.floorplan.furnish import furnish
from fleet2d.floorplan.home import Home
from fleet2d.homes.synthetic.source import Synthetic

SEEDS = some(range(200), 10)


@cache
def home(seed, **settings):
    return Synthetic(seed=seed, **settings).load()


def room_graph(plan):
    """Return the types of the rooms, and the pairs of types that are linked."""
    kinds = [room.type for room in plan.rooms]
    links = [tuple(sorted(kinds[k] for k in link.rooms)) for link in plan.room_graph]
    return tuple(sorted(kinds)), tuple(sorted(links))


@pytest.mark.slow
def test_small_flats_of_one_size_differ_in_rooms_and_links():
    usual = {room_graph(home(seed, area_m2=50)) for seed in range(15)}
    varied = [home(seed, area_m2=50, variety=1) for seed in range(15)]

    assert len(usual) <= 4
    assert len({room_graph(plan) for plan in varied}) >= 11
    assert all(40 <= plan.area_m2 <= 60 for plan in varied)


@pytest.mark.slow
@pytest.mark.parametrize("area", [18, 22, 26, 29.9])
def test_studios_are_one_room_to_live_and_sleep_in_and_a_bathroom(area):
    kinds = set()
    for seed in range(6):
        plan = Synthetic(seed=seed, area_m2=area).load()
        (living,) = plan.rooms_of_type("bedroom")
        third = plan.rooms[2].type
        kinds.add(third)

        assert plan.area_m2 == pytest.approx(area, rel=0.05)
        assert ["living_room", "bathroom"] == [room.type for room in plan.rooms[:2]]
        assert (living.type, len(plan.rooms)) == ("living_room", 3)
        assert 1 == len(plan.rooms_of_type("kitchen"))
        assert 1 == Home(plan).space(0.25).parts
        assert 1 == sum(door.name == "front_door" for door in plan.doorways)
        things = {thing.type for thing in furnish(plan).objects_in(living)}
        assert {"bed", "single_bed"} & things
        assert third == "kitchen" or {"stove", "sink", "fridge"} & things
    assert kinds <= {"kitchen", "entryway"}
    assert area < 24 or len(kinds) == 2


def test_studio_with_a_bedroom_or_another_outline_is_refused():
    with pytest.raises(FloorPlanError, match="20 m2 can't have 1 bedroom"):
        Synthetic(area_m2=20, bedrooms=1).load()
    with pytest.raises(FloorPlanError, match=r"another floorplan\.outline"):
        Synthetic(area_m2=20, outline="U").load()


def test_people_sleep_in_the_living_room_of_a_furnished_studio():
    run = fleet2d.run(
        {
            "floorplan": {"type": "synthetic", "area_m2": 20, "seed": 2, "furnish": True},
            "simulation": {"duration": {"days": 1}, "seed": 3},
            "users": {"u": {"type": "routine", "persona": "works_from_home"}},
            "metrics": {"room_share": {}},
        }
    )

    assert run.metrics["room_share"]["u"]["living_room_1"] > 0.5
    assert not any("bedroom" in note for note in run.notes)


@pytest.mark.parametrize("seed", SEEDS)
def test_home_is_whole_and_no_way_leads_through_a_private_room(seed):
    plan = home(seed)
    assert () == plan.notes
    assert 1 == Home(plan).space(0.25).parts
    assert not checkup(plan)
    assert {"living_room", "kitchen", "bedroom", "bathroom"} <= {
        kind for room in plan.rooms for kind in room.labels
    }
    inner = [door for door in plan.doorways if door.name != "front_door"]
    for room in plan.rooms:
        doors = [door for door in inner if room.index in door.rooms]
        kinds = {plan.rooms[sum(door.rooms) - room.index].type for door in doors}
        assert doors
        assert (
            room.type not in PRIVATE
            or 1 == len(doors)
            or (room.type == "bedroom" and len(kinds - PRIVATE) <= 1)
            or (room.type == "bathroom" and "laundry" not in kinds)
        )


@pytest.mark.slow
def test_large_homes_are_no_longer_than_28_m():
    for seed in range(6):
        x0, y0, x1, y1 = home(seed, area_m2=250).bounds
        assert max(x1 - x0, y1 - y0) < 28


@pytest.mark.parametrize("seed", SEEDS)
def test_home_has_rooms_that_an_architect_would_draw(seed):
    plan = home(seed)
    kinds = [room.type for room in plan.rooms]
    ways = {"entryway", "hallway", "living_room", "dining_room", "kitchen"}
    reached = {plan.room_at(*plan.entrance).index}
    for _ in plan.rooms:
        pairs = [door.rooms for door in plan.doorways if reached & set(door.rooms)]
        reached |= {i for pair in pairs for i in pair if kinds[i] in ways}

    assert kinds.index("living_room") in reached
    others = [room.area_m2 for room in plan.rooms if room.type != "garage"]
    assert max(others) == plan.room("living_room_1").area_m2
    baths = [room.area_m2 for room in plan.rooms if room.type == "bathroom"]
    assert all(3 <= area <= 9 for area in baths)
