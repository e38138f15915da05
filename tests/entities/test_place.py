"""Places: how a scenario names them, and where they are."""

from typing import Any

import pytest
from tests.scenes import scenario

import fleet2d
from fleet2d.entities.behavior import Actor
from fleet2d.errors import InputError, PlacementError


def actor(
    seed: int = 4, plan: dict[str, Any] | None = None, name: str = "ana", **body: Any
) -> Actor:
    content = scenario(users={name: {"start": [1.0, 3.0], **body}}, simulation={"seed": seed})
    if plan:
        content["floorplan"] = plan
    return fleet2d.Simulation(content).actors[name]


def room_of(body: Actor, point: tuple[int, int]) -> str:
    room = body.home.plan.room_at(*body.home.plan.lattice.to_metres(point).tolist())
    return room.name if room else "none"


@pytest.mark.parametrize(
    ("place", "room"),
    [
        ("kitchen_0", "kitchen_0"),
        ("kitchen", "kitchen_0"),
        (["attic", "bathroom", "kitchen"], "bathroom_0"),
        (["storage", "bedroom"], "bedroom_0"),  # the first that can be reached
        ([7.0, 1.0], "kitchen_0"),
        ((7, 6), "bathroom_0"),
    ],
)
def test_a_place_is_the_first_that_there_is(place: Any, room: str) -> None:
    body = actor()
    for moment in range(0, 10**8, 10**7):
        assert room == room_of(body, body.find(place, moment, "spot"))


def test_a_body_has_one_room_of_a_kind_however_it_is_listed() -> None:
    home = {"type": "bundled"}  # with three bedrooms
    for seed in range(6):
        body = actor(seed, home, start="any")
        lists = ("bedroom", ["bedroom", "any"], ["attic", "bedroom"])
        rooms = {room_of(body, body.find(place, 0, "spot")) for place in lists}
        assert 1 == len(rooms)
    rooms = {
        room_of(b, b.find("bedroom", 0, "spot"))
        for b in (actor(s, home, start="any") for s in range(12))
    }
    assert len(rooms) > 1


def test_a_point_is_that_point_exactly() -> None:
    body = actor()
    assert [7.0, 1.0] == body.home.plan.lattice.to_metres(body.find([7.0, 1.0], 0, "spot")).tolist()


def test_any_is_every_room_that_can_be_reached() -> None:
    body = actor()
    rooms = {room_of(body, body.find(["attic", "any"], k, "spot")) for k in range(200)}
    assert {room.name for room in body.reachable_rooms()} == rooms
    assert "storage_0" not in rooms


def test_spots_fill_the_room_and_keep_the_radius_from_walls() -> None:
    body = actor(radius=0.5, start="bedroom")  # too wide for the doors
    xy = [body.home.plan.lattice.to_metres(body.find("bedroom", k, "spot")) for k in range(500)]
    assert min(x for x, _ in xy) == pytest.approx(0.5, abs=0.2)
    assert min(x for x, _ in xy) >= 0.5
    assert max(x for x, _ in xy) == pytest.approx(3.5, abs=0.2)
    assert max(x for x, _ in xy) <= 3.5


TWO_BEDROOMS = {"type": "bundled"}


def test_of_several_rooms_of_a_kind_a_body_has_its_own() -> None:
    """The bundled home has two bathrooms at least; who lives there uses one of them."""
    kinds = [room.type for room in fleet2d.load_floorplan().rooms]
    kind = next(k for k in kinds if kinds.count(k) > 1)
    own = set()
    for seed in range(12):
        body = actor(seed, TWO_BEDROOMS, start="any")
        used = {room_of(body, body.find(kind, k * 10**9, f"spot {k}")) for k in range(20)}
        assert 1 == len(used)
        own |= used
    assert len(own) > 1


def test_the_same_moment_and_purpose_give_the_same_spot() -> None:
    one, other = actor(), actor()
    assert one.find("kitchen", 5, "spot") == other.find("kitchen", 5, "spot")
    assert one.find("kitchen", 5, "spot") != one.find("kitchen", 6, "spot")
    assert one.find("kitchen", 5, "spot") != one.find("kitchen", 5, "other")
    assert one.find("kitchen", 5, "spot") != actor(seed=5).find("kitchen", 5, "spot")
    assert one.find("kitchen", 5, "spot") != actor(name="eve").find("kitchen", 5, "spot")


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("attic", ["users.ana", "attic", "kitchen_0", "any"]),
        ("bedrom", ["did you mean 'bedroom", "bedroom_0"]),
        ("storage", ["storage", "can't be reached", "kitchen_0"]),
        ([5.05, 1.0], ["wall", "0.2 m", "nearest free point"]),
        ([0.1, 1.0], ["nearer", "radius", "nearest free point"]),
        ([10.0, 1.0], ["can't be reached"]),
        ([100.0, 1.0], ["nearest free point"]),
        ([2.4, 1.5], ["wall"]),  # in the pillar
    ],
)
def test_places_where_it_can_not_be_are_refused(place: Any, words: list[str]) -> None:
    with pytest.raises(PlacementError) as caught:
        actor().find(place, 0, "spot")
    for word in words:
        assert word in str(caught.value)


def test_the_nearest_free_point_that_an_error_names_is_one_that_will_do() -> None:
    body = actor()
    with pytest.raises(PlacementError) as caught:
        body.find([5.05, 1.0], 0, "spot")
    x, y = str(caught.value).rpartition("[")[2].rstrip("]").split(",")
    body.find([float(x), float(y)], 0, "spot")


@pytest.mark.parametrize(
    "place", [5, True, [], "", [1.0], [1, 2, 3], ["kitchen", 1], [1, "kitchen"], {"x": 1}]
)
def test_what_is_no_place_is_refused(place: Any) -> None:
    with pytest.raises(InputError) as caught:
        fleet2d.load_scenario(scenario(users={"ana": {"start": place}}))
    assert "users.ana.start" in str(caught.value)


@pytest.mark.parametrize(
    "place", [[float("nan"), 1.0], [1.0, float("inf")], [1e9, 1.0], [10**400, 1]]
)
def test_points_out_of_this_world_are_refused(place: Any) -> None:
    with pytest.raises(InputError) as caught:
        fleet2d.load_scenario(scenario(users={"ana": {"start": place}}))
    assert "users.ana.start" in str(caught.value)
