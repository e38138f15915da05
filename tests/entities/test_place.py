"""Places: how they are read, kinds that a home lacks, and furniture of a person."""

from typing import Any

import numpy as np
import pytest
from tests.scenes import digests, path, run, scenario, table

import fleet2d
from fleet2d.engine.simulation import Simulation
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
        ("kitchen_1", "kitchen_1"),
        ("kitchen", "kitchen_1"),
        (["attic", "bathroom", "kitchen"], "bathroom_1"),
        (["storage", "bedroom"], "bedroom_1"),  # the first that can be reached
        ([7.0, 1.0], "kitchen_1"),
        ((7, 6), "bathroom_1"),
    ],
)
def test_a_place_is_the_first_that_there_is(place, room):
    body = actor()
    for moment in range(0, 10**8, 10**7):
        assert room == room_of(body, body.find(place, moment, "spot"))


def test_a_body_has_one_room_of_a_kind_however_it_is_listed():
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


def test_a_point_is_that_point_exactly():
    body = actor()
    assert [7.0, 1.0] == body.home.plan.lattice.to_metres(body.find([7.0, 1.0], 0, "spot")).tolist()


def test_any_is_every_room_that_can_be_reached():
    body = actor()
    rooms = {room_of(body, body.find(["attic", "any"], k, "spot")) for k in range(200)}
    assert {room.name for room in body.reachable_rooms()} == rooms
    assert "storage_1" not in rooms


def test_spots_fill_the_room_and_keep_the_radius_from_walls():
    body = actor(radius=0.5, start="bedroom")  # too wide for the doors
    xy = [body.home.plan.lattice.to_metres(body.find("bedroom", k, "spot")) for k in range(500)]
    assert min(x for x, _ in xy) == pytest.approx(0.5, abs=0.2)
    assert min(x for x, _ in xy) >= 0.5
    assert max(x for x, _ in xy) == pytest.approx(3.5, abs=0.2)
    assert max(x for x, _ in xy) <= 3.5


TWO_BEDROOMS = {"type": "bundled"}


def test_of_several_rooms_of_a_kind_a_body_has_its_own():
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


def test_the_same_moment_and_purpose_give_the_same_spot():
    one, other = actor(), actor()
    assert one.find("kitchen", 5, "spot") == other.find("kitchen", 5, "spot")
    assert one.find("kitchen", 5, "spot") != one.find("kitchen", 6, "spot")
    assert one.find("kitchen", 5, "spot") != one.find("kitchen", 5, "other")
    assert one.find("kitchen", 5, "spot") != actor(seed=5).find("kitchen", 5, "spot")
    assert one.find("kitchen", 5, "spot") != actor(name="eve").find("kitchen", 5, "spot")


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("attic", ["users.ana", "attic", "kitchen_1", "any"]),
        ("bedrom", ["did you mean 'bedroom", "bedroom_1"]),
        ("storage", ["storage", "can't be reached", "kitchen_1"]),
        ([5.05, 1.0], ["wall", "0.2 m", "nearest free point"]),
        ([0.1, 1.0], ["nearer", "radius", "nearest free point"]),
        ([10.0, 1.0], ["can't be reached"]),
        ([100.0, 1.0], ["nearest free point"]),
        ([2.4, 1.5], ["wall"]),  # in the pillar
    ],
)
def test_places_where_it_can_not_be_are_refused(place, words):
    with pytest.raises(PlacementError) as caught:
        actor().find(place, 0, "spot")
    for word in words:
        assert word in str(caught.value)


def test_the_nearest_free_point_that_an_error_names_is_one_that_will_do():
    body = actor()
    with pytest.raises(PlacementError) as caught:
        body.find([5.05, 1.0], 0, "spot")
    x, y = str(caught.value).rpartition("[")[2].rstrip("]").split(",")
    body.find([float(x), float(y)], 0, "spot")


NO_PLACES = [5, True, [], "", [1.0], [1, 2, 3], ["kitchen", 1], [1, "kitchen"], {"x": 1}]
OUT_OF_THIS_WORLD = [[float("nan"), 1.0], [1.0, float("inf")], [1e9, 1.0], [10**400, 1]]


@pytest.mark.parametrize("place", [*NO_PLACES, *OUT_OF_THIS_WORLD])
def test_what_is_no_place_is_refused(place):
    with pytest.raises(InputError) as caught:
        fleet2d.load_scenario(scenario(users={"ana": {"start": place}}))
    assert "users.ana.start" in str(caught.value)


BATTERY = {"driving": "2 h", "standing": "8 h", "charging": "1 h"}
FLAT = {"floorplan": {"type": "bundled", "furnish": True}}


def robot(*behaviors: Any, **body: Any) -> dict[str, Any]:
    return scenario("1 min", robots={"astro": {"behaviors": list(behaviors), **body}})


def notes(content: dict[str, Any]) -> str:
    return "; ".join(note for a in Simulation(content).actors.values() for note in a.notes)


def user(**fields: Any) -> dict[str, Any]:
    return scenario("1 min", users={"ana": fields})


@pytest.mark.parametrize(
    ("content", "note"),
    [
        (
            robot({"type": "hangout", "no_stops_in": ["garage", "bathroom"]}),
            "hangout.no_stops_in: left out",
        ),
        (robot({"type": "patrol", "rooms": ["kitchen", "garage"]}), "patrol.rooms: left out"),
        (user(type="room_sampling", shares={"kitchen": 1, "garage": 1}), "shares: left out"),
        (user(type="pet", rooms=["kitchen", "garage"]), "pet.rooms: left out"),
    ],
)
def test_a_kind_that_the_home_lacks_is_left_out_with_a_note(content, note):
    assert note in notes(content)
    assert "garage" in notes(content)


def test_a_kind_that_is_there_but_out_of_reach_is_left_out_too():
    """Six of 1,103 homes refused the bundled scenario, for it avoids bathrooms."""
    content = robot({"type": "hangout", "no_stops_in": ["storage"]}, start="kitchen")
    assert "hangout.no_stops_in: left out" in notes(content)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            robot({"type": "hangout", "no_stops_in": ["bathroom_8"]}),
            ["hangout.no_stops_in", "bathroom_8"],
        ),
        (robot({"type": "patrol", "rooms": ["kitchen", "kitchn_1"]}), ["patrol.rooms", "kitchn_1"]),
        (robot({"type": "patrol", "rooms": ["garage"]}), ["patrol.rooms", "has none of these"]),
        (user(type="room_sampling", shares={"garage": 1}), ["room_sampling.shares", "garage"]),
    ],
)
def test_a_single_thing_that_is_not_there_is_refused_with_its_key(content, words):
    with pytest.raises(InputError) as failure:
        Simulation(content)
    assert all(word in str(failure.value) for word in ["astro" in content or "a", *words])


def test_an_activity_without_a_room_becomes_rest():
    own = {"pottery": {"rooms": ["garage"], "takes": "1 h"}}
    day = {"on": "daily", "wake": "06:30", "do": {"pottery": "07:30"}}
    persona = {"activities": own, "days": {"any_day": day}}
    assert "activities.pottery.rooms: left out" in notes(user(type="routine", persona=persona))


def test_an_item_of_a_schedule_in_a_room_that_is_not_there_is_left_out():
    items = [{"at": "08:00", "place": "garage"}, {"at": "09:00", "place": "kitchen"}]
    content = user(type="schedule", days=[{"items": items}])
    assert "schedule.days: left out" in notes(content)


def test_furniture_is_a_place_wherever_a_place_goes():
    items = [{"at": "00:00", "place": "sofa", "dwell": "1 d"}]
    users = {"ana": {"type": "schedule", "days": [{"items": items}], "start": "kitchen"}}
    robots = {"astro": {"behaviors": [{"type": "patrol", "rooms": ["desk", "bedroom"]}],
                        "battery": {**BATTERY, "charger": "charger_1"}}}  # fmt: skip
    stored = run({**scenario("10 min", users=users, robots=robots), **FLAT})
    sofa = next(o for o in stored.plan.objects if o.type == "sofa")
    ana = path(stored, "ana")
    uses = [(use.x, use.y) for use in sofa.uses]
    at = min((ana.x[-1] - x) ** 2 + (ana.y[-1] - y) ** 2 for x, y in uses)
    assert at < 0.01
    events = stored.pandas("events")
    assert sofa.name in set(events[events["event"] == "uses"]["detail"])


def test_a_name_that_is_nearly_a_piece_of_furniture_gets_that_as_a_hint():
    content = {
        **user(type="schedule", days=[{"items": [{"at": "08:00", "place": "soffa"}]}]),
        **FLAT,
    }
    with pytest.raises(InputError, match="sofa"):
        Simulation(content)


BED = {"object": "bed", "of": "ana"}


def bedside(user: Any, place: Any = BED, duration: str = "30 min") -> dict[str, Any]:
    """A robot that goes to a place, at home with Ana and Ben."""
    robot = {"type": "scheduled", "visits": [{"at": "02:05", "place": place}]}
    return scenario(
        duration,
        users={"ana": user, "ben": {"type": "routine", "persona": "student"}},
        robots={"astro": robot},
        floorplan={"type": "bundled", "furnish": True},
        simulation={"start": "2026-01-05T02:00"},
    )


def metres_to(stored: Any, name: str) -> float:
    """From the robot in the end to where a user is in the end."""
    robot, user = path(stored, "astro"), path(stored, "ana" if name == "ana" else name)
    return float(np.hypot(robot.x[-1] - user.x[-1], robot.y[-1] - user.y[-1]))


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_goes_to_the_bed_in_which_a_person_sleeps(seed):
    content = bedside({"type": "routine", "persona": "works_outside"})
    content["simulation"]["seed"] = seed
    stored = run(content)
    assert table(stored, "events", entity="ana", event="uses")["detail"][-1].startswith("bed")
    assert metres_to(stored, "ana") < 2


def test_a_schedule_lies_in_the_bed_that_a_robot_goes_to():
    ana = {"type": "schedule", "days": [{"items": [{"at": "00:00", "place": "bed"}]}]}
    assert metres_to(run(bedside(ana)), "ana") < 2


def test_somebody_goes_to_the_bed_of_who_comes_later_in_the_scenario():
    ana = {"type": "schedule", "days": [{"items": [{"at": "02:03", "place": "bed of ben"}]}]}
    content = bedside(ana)
    del content["robots"]
    used = table(run(content), "events", entity="ana", event="uses")["detail"].tolist()
    content["users"]["ana"]["days"][0]["items"][0]["place"] = {"object": "bed", "of": "ben"}
    assert used  # yesterday's, and today's
    assert all(name.startswith("bed") for name in used)
    assert digests(run(content))["events"] == digests(run(content, max_span=61))["events"]


def test_it_is_written_as_it_was():
    loaded = fleet2d.load_scenario(bedside({"type": "routine"}))
    assert loaded.robots["astro"].behaviors[0].visits[0].place == ("bed of ana",)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ({"object": "bed", "of": "anna"}, "no user 'anna'.*did you mean 'ana'"),
        ({"object": "bedd", "of": "ana"}, "did you mean 'bed'"),
        ({"object": "bed"}, "expected a place"),
    ],
)
def test_what_is_not_there_is_refused_with_the_nearest_name(place, words):
    with pytest.raises(InputError, match=words):
        fleet2d.Simulation(bedside({"type": "routine"}, place))
