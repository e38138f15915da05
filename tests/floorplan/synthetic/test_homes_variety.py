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
