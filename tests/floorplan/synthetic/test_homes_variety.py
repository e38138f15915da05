import pytest

import fleet2d
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.furnish import furnish
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.synthetic.source import Synthetic


def room_graph(plan: FloorPlan) -> object:
    """Return the types of the rooms, and the pairs of types that are linked."""
    kinds = [room.type for room in plan.rooms]
    links = [tuple(sorted(kinds[k] for k in link.rooms)) for link in plan.room_graph]
    return tuple(sorted(kinds)), tuple(sorted(links))


def test_small_flats_of_one_size_differ_in_rooms_and_links() -> None:
    usual = {room_graph(Synthetic(seed=seed, area_m2=50).load()) for seed in range(12)}
    varied = [Synthetic(seed=seed, area_m2=50, variety=1).load() for seed in range(12)]

    assert len(usual) <= 2
    assert len({room_graph(plan) for plan in varied}) >= 6
    assert all(40 <= plan.area_m2 <= 60 for plan in varied)


def test_no_variety_is_the_same_home_as_without_the_key() -> None:
    assert Synthetic(seed=5, area_m2=50).load() == Synthetic(seed=5, area_m2=50, variety=0).load()


@pytest.mark.parametrize("area", [18, 22, 26, 29.9])
def test_studios_are_one_room_to_live_and_sleep_in_and_a_bathroom(area: float) -> None:
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


def test_studio_with_a_bedroom_or_another_outline_is_refused() -> None:
    with pytest.raises(FloorPlanError, match="20 m2 can't have 1 bedroom"):
        Synthetic(area_m2=20, bedrooms=1).load()
    with pytest.raises(FloorPlanError, match=r"another floorplan\.outline"):
        Synthetic(area_m2=20, outline="U").load()
    with pytest.raises(ValueError, match="area_m2"):
        Synthetic(area_m2=17)


def test_people_sleep_in_the_living_room_of_a_furnished_studio() -> None:
    run = fleet2d.run(
        {
            "floorplan": {"type": "synthetic", "area_m2": 20, "seed": 2, "furnish": True},
            "simulation": {"duration": {"days": 1}, "seed": 3},
            "users": {"u": {"type": "routine", "persona": "works_from_home"}},
            "metrics": {"room_share": {}},
        }
    )

    assert run.metrics["room_share"]["u"]["living_room_0"] > 0.5
    assert not any("bedroom" in note for note in run.notes)
