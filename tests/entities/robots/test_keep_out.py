"""Rooms that a robot never enters: its key `keep_out`."""

import numpy as np
import pytest
from tests.entities.robots.robots import assert_same_for_every_max_span, events, names, rooms_of
from tests.scenes import path, run, scenario

import fleet2d
from fleet2d.errors import PlacementError, ScenarioError

ROUNDS = {"type": "patrol", "dwell": "5 s"}
DOORWAYS = "unknown_1"
CAMERA = {"range": [0.2, 6], "angle_deg": 340}


def flat(*behaviors, keep_out=(), duration="1 h", **sections):
    """The flat with a robot: the way to its bathroom leads through the kitchen."""
    astro = {
        "start": [1.0, 3.0],
        "camera": CAMERA,
        "behaviors": list(behaviors) or [ROUNDS],
        "keep_out": list(keep_out),
        **sections.pop("astro", {}),
    }
    return scenario(duration, robots={"astro": astro}, **sections)


BEHAVIORS = {
    "patrol": [ROUNDS],
    "hangout": [{"type": "hangout", "source": "ltp", "near": "room", "period": "10 min"}],
    "find": [{"type": "find", "user": "ana", "every": "5 min", "distance": 0.5}, ROUNDS],
    "follow": [{"type": "follow", "user": "ana", "distance": 0.5}, ROUNDS],
    "opportunistic": [{"type": "opportunistic", "again": "1 min", "distance": 0.5}, ROUNDS],
    "interact": [{"type": "interact", "source": "ltp"}, ROUNDS],
    "explore": [{"type": "explore"}],
    "meander": [{"type": "meander"}],
    "scheduled": [{"type": "scheduled", "visits": [{"at": "07:20", "place": "bedroom"}]}, ROUNDS],
    "dock": [{"type": "dock", "threshold": "30 %"}, ROUNDS],
}  # fmt: skip


def lived_in(behavior, keep_out):
    """Two hours with a person who is about everywhere, and a robot with all reasons to follow."""
    return run(
        flat(
            *BEHAVIORS[behavior],
            keep_out=keep_out,
            duration="2 h",
            users={"ana": {"type": "meander"}},
            astro={"battery": {"driving": "1 h", "standing": "3 h", "charging": "20 min", "charger": [2.0, 3.5]}},
            algorithms={"ltp": {"type": "long_term_presence", "period": "10 min"}},
            interactions={"tea": {"do": "offer", "to": "ana", "at": ["07:10", "08:00"], "within": "1 h"}},
        )
    )  # fmt: skip


@pytest.mark.parametrize("behavior", BEHAVIORS)
def test_no_behavior_enters(behavior):
    assert not {"kitchen_1", "bathroom_1"} & set(rooms_of(lived_in(behavior, ["kitchen"])))


@pytest.mark.parametrize("behavior", ["patrol", "find", "follow", "explore"])
def test_behaviors_enter_a_room_that_is_not_forbidden(behavior):
    assert "kitchen_1" in rooms_of(lived_in(behavior, []))


@pytest.mark.slow
def test_the_family_s_robot_enters_neither_bedrooms_nor_bathrooms_in_a_week():
    week = fleet2d.run("bundled:family", "simulation.duration=7 d", seed=1)
    kinds = {room.name: room.type for room in week.plan.rooms}
    visited = {kinds.get(name, "") for name in rooms_of(week)}
    assert not {"bedroom", "bathroom"} & visited
    assert {"kitchen", "living_room", "entryway"} <= visited
    assert week.metrics["interactions"]


@pytest.mark.parametrize("keep_out", [["bedroom"], ["bedroom_1"]])
def test_rooms_are_given_by_kind_or_name(keep_out):
    visited = set(rooms_of(run(flat(keep_out=keep_out))))
    assert {"living_room_1", "kitchen_1", "bathroom_1"} == visited - {DOORWAYS}


@pytest.mark.parametrize(
    ("keep_out", "message"),
    [
        (["kitchn"], "kitchn.*kitchen"),
        (["bedroom_2"], "bedroom_2.*bedroom_1"),
        # In centimetres.
        ([{"area": [[100, 100], [300, 100], [300, 200]]}], "the area from .* no part of the floor"),
        (["living_room", "kitchen", "bathroom", "bedroom", "storage"], ""),
    ],
    ids=["no kind", "no name", "no floor", "everywhere"],
)
def test_what_leaves_no_sense_is_refused(keep_out, message):
    with pytest.raises(PlacementError, match=rf"robots\.astro.*keep_out.*{message}"):
        fleet2d.Simulation(flat(keep_out=keep_out, astro={"start": None}))


@pytest.mark.parametrize(
    ("keep_out", "camera", "notes"),
    [
        (["bedroom"], CAMERA, []),
        (["office"], CAMERA, ["this home has no office"]),
        (["kitchen"], CAMERA, ["no way is left to bathroom_1; passing: true of a room lets it through"]),
        ([{"room": "kitchen", "passing": True}], CAMERA, []),
        ([{"while": "asleep"}], CAMERA, []),
        ([{"while": "asleep"}], None, ["while: asleep has no effect without a camera"]),
    ],
)  # fmt: skip
def test_what_has_no_or_more_effect_is_noted(keep_out, camera, notes):
    said = fleet2d.Simulation(flat(keep_out=keep_out, astro={"camera": camera})).notes
    assert [f"robots.astro.keep_out: {note}" for note in notes] == [
        n for n in said if "keep_out" in n
    ]


@pytest.mark.parametrize("place", [[6.5, 3.1], [7.0, 6.0]])
def test_a_robot_put_where_it_must_not_be_leaves(place):
    """Also from the bathroom, whose only door leads to the kitchen, which is forbidden, too."""
    script = [{"at": "07:10", "put": "astro", "to": place}]
    content = flat(keep_out=["kitchen", "bathroom"], script=script)
    rooms = rooms_of(assert_same_for_every_max_span(content, 61))
    assert rooms[600] in ("kitchen_1", "bathroom_1")
    assert {"living_room_1", "bedroom_1", DOORWAYS} >= {*rooms[:600], *rooms[660:]}


def test_a_robot_cannot_start_where_it_must_not_be():
    with pytest.raises(
        PlacementError, match=r"\[1.0, 3.0\] is where it keeps out .*keep_out"
    ) as caught:
        run(flat(keep_out=["living_room"]))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "act", [{"call": "astro", "to": "kitchen"}, {"send": "astro", "to": "kitchen"}]
)
def test_it_cannot_be_sent_or_called_there(act):
    with pytest.raises(PlacementError, match=r"script\.0: .*'kitchen' can't be reached"):
        run(flat({"type": "come"}, keep_out=["kitchen"], script=[{"at": "07:10", **act}]))


@pytest.mark.parametrize(
    ("keep_out", "allowed"),
    [
        (["living_room", "kitchen", "bathroom"], {"bedroom_1", DOORWAYS}),
        (
            [{"room": "living_room", "during": "06:00-07:05"}],
            {"kitchen_1", "bathroom_1", "bedroom_1", DOORWAYS},
        ),
    ],
)
def test_a_robot_starts_elsewhere_if_no_place_is_given(keep_out, allowed):
    for seed in range(6):
        content = flat(keep_out=keep_out, astro={"start": None}, duration="5 min")
        assert allowed >= set(rooms_of(run(content, seed=seed)))


def test_a_robot_that_is_told_to_keep_out_of_all_other_rooms_stands_still():
    script = [{"at": "07:10", "keep_out": "astro", "of": ["living_room", "bedroom"]}]
    rooms = rooms_of(run(flat(keep_out=["kitchen"], script=script)))
    assert 1 == len(set(rooms[700:]))


def test_a_room_stays_forbidden_after_a_ban_of_it_ends():
    """And another one opens again."""
    script = [
        {"at": "07:10", "keep_out": "astro", "of": ["kitchen", "bedroom"], "duration": "10 min"}
    ]
    stored = run(flat(keep_out=["kitchen"], script=script))
    rooms = rooms_of(stored)
    assert "kitchen_1" not in rooms
    assert "bedroom_1" in rooms[:600]
    assert "bedroom_1" not in rooms[660:1200]
    assert "bedroom_1" in rooms[1200:]
    assert {"banned", "allowed"} <= set(names(stored))


# --- At hours, in areas, while somebody sleeps -------------------------------------------------


def test_at_hours_it_leaves_the_room_in_which_it_is_and_comes_back_later():
    """The hours begin while it is inside: it withdraws, and enters again when they end."""
    still = {"type": "patrol", "waypoints": [[2.5, 5.5]], "dwell": "1 d"}
    content = flat(
        still,
        keep_out=[{"room": "bedroom", "during": "07:10-07:20"}],
        astro={"start": [2.5, 5.5]},
        duration="25 min",
    )
    stored = assert_same_for_every_max_span(content, 61, 1)
    rooms = rooms_of(stored)
    assert {"bedroom_1"} == set(rooms[:600])
    assert "bedroom_1" not in rooms[630:1200]
    assert "bedroom_1" in rooms[1200:]
    assert "withdraws" in names(stored)


AREA = [[2.0, 2.8], [3.0, 2.8], [3.0, 3.9], [2.0, 3.9]]


def test_it_never_enters_a_drawn_area():
    stored = assert_same_for_every_max_span(flat(keep_out=[{"area": AREA}]), 61)
    for run_, grown, enters in ((stored, 0.14, False), (run(flat()), 0.0, True)):
        way = path(run_, "astro")
        beside = np.maximum(np.abs(way.x - 2.5) - 0.5, np.abs(way.y - 3.35) - 0.55)
        assert enters == (beside < grown).any()


def test_put_into_an_area_it_leaves():
    script = [{"at": "07:10", "put": "astro", "to": [2.5, 3.4]}]
    way = path(run(flat(keep_out=[{"area": AREA}], script=script)), "astro")
    inside = (way.x > 2) & (way.x < 3) & (way.y > 2.8) & (way.y < 3.9)
    assert inside[600]
    assert not inside[615:].any()


def test_it_may_pass_a_room_without_stops():
    """The bathroom is behind the kitchen."""
    stored = run(flat(keep_out=[{"room": "kitchen", "passing": True}]))
    way, rooms = path(stored, "astro"), np.array(rooms_of(stored))
    rests = (np.diff([way.x, way.y, way.heading]) == 0).all(axis=0)
    assert {"bathroom_1", "kitchen_1"} <= set(rooms)
    assert "kitchen_1" not in rooms[1:][rests]


def test_it_keeps_out_while_it_believes_that_somebody_sleeps_there():
    """Once it has seen Ana in bed it leaves her alone; when it sees her up, it comes again."""
    day = [
        {"at": "00:00", "place": "bed", "activity": "sleep"},
        {"at": "07:50", "place": "kitchen", "activity": "breakfast"},
    ]
    content = flat(keep_out=[{"while": "asleep"}], duration="2 h", astro={"start": "hallway"})
    content["floorplan"] = {"type": "bundled", "furnish": True}
    content["users"] = {"ana": {"type": "schedule", "days": [{"on": "daily", "items": day}]}}
    stored = assert_same_for_every_max_span(content, 61)
    in_bedroom = np.array(rooms_of(stored)) == rooms_of(stored, "ana")[0]
    seen = next(step for step, name, _ in events(stored) if name == "user_seen")
    assert seen < 40 * 60
    assert not in_bedroom[seen + 40 : 50 * 60].any()
    assert in_bedroom[60 * 60 :].any()


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"during": "22:00-07:00"}, "it says nowhere"),
        ({"room": "bedroom", "area": [[0, 0], [1, 0], [1, 1]]}, "not both"),
        ({"area": [[0, 0], [1, 1], [1, 0], [0, 1]]}, "sides cross"),
        ({"room": "kitchen", "passing": True, "during": "22:00-07:00"}, "without hours"),
        ({"room": "kitchen", "while": "awake"}, "asleep"),
        ({"rom": "kitchen"}, "room"),
    ],
)
def test_wrong_entries_are_refused(entry, words):
    with pytest.raises(ScenarioError, match=words):
        run(flat(keep_out=[entry]))
