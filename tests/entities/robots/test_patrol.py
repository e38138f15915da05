"""Patrol: rounds through rooms and along waypoints."""

from itertools import groupby

import numpy as np
import pytest
from tests.scenes import path, run, scenario

import fleet2d
from fleet2d.errors import InputError

REACHABLE = ["living_room_1", "kitchen_1", "bedroom_1", "bathroom_1"]


def patrol(duration="1 h", **fields):
    robot = {
        "type": "patrol",
        "dwell": "1 min",
        "start": [1.0, 3.0],
        "start_heading_deg": 0,
        **fields,
    }
    return scenario(duration, robots={"astro": robot})


def stops(stored, still_s=55):
    """Where it stood for long, in order: x, y and for how many steps."""
    poses = path(stored, "astro")
    stops = []
    for key, steps in groupby(
        zip(poses.x.tolist(), poses.y.tolist(), poses.heading.tolist(), strict=True)
    ):
        count = sum(1 for _ in steps)
        if count >= still_s:
            stops.append((key[0], key[1], count))
    return stops


def room_names(stored):
    return [stored.plan.room_at(x, y).name for x, y, _ in stops(stored)]


def test_it_stops_in_every_room_in_turn_for_the_dwell():
    stored = run(patrol(rooms=["kitchen", "bathroom_1", "living_room"], look_around=False))
    visited = room_names(stored)
    assert len(visited) > 20
    assert ["kitchen_1", "bathroom_1", "living_room_1"] * 2 == visited[:6]
    for x, y, count in stops(stored)[:-1]:
        assert 60 <= count <= 62, (x, y)


def test_all_rooms_are_those_that_it_can_enter():
    names = room_names(run(patrol()))
    assert set(REACHABLE) <= set(names) <= {*REACHABLE, "unknown_1"}
    assert names[: len(set(names))] == sorted(set(names), key=names.index)


def test_it_stands_at_the_middle_of_a_room():
    stored = run(patrol("10 min", rooms=["bedroom"]))
    (x, y), *_ = [place[:2] for place in stops(stored)]
    assert (x, y) == pytest.approx(stored.plan.room("bedroom_1").anchor_xy, abs=0.1)


def test_waypoints_are_met_exactly():
    points = [(1.0, 1.0), (7.0, 1.0), (7.0, 6.0)]
    places = [place[:2] for place in stops(run(patrol(waypoints=points, look_around=False)))]
    for place, expected in zip(places[:6], points * 2, strict=True):
        assert place == pytest.approx(expected, abs=1e-3)


def test_a_look_around_is_one_whole_turn():
    content = patrol("3 min", waypoints=[[1.0, 3.0]], turn_rate_deg=36)
    poses = path(run(content), "astro")
    # It is there already: 10 s for the turn, then a minute, and so on.
    turned = np.unwrap(poses.heading)
    assert turned[10] == pytest.approx(2 * np.pi, abs=0.05)
    assert turned[5] == pytest.approx(np.pi, abs=0.05)
    assert turned[11:69] == pytest.approx(2 * np.pi, abs=0.05)
    assert turned[82] == pytest.approx(4 * np.pi, abs=0.1)
    still = path(run(content, "robots.astro.look_around=false"), "astro")
    assert 1 == len(set(still.heading.tolist()))


def test_random_order_visits_all_in_each_round_in_changing_order():
    points = [[1, 1], [7, 1], [7, 6], [1, 6], [4, 3]]
    stored = run(patrol("3 h", waypoints=points, order="random", look_around=False))
    # The last of a round may be the first of the next: then it stays twice as long.
    places = [(round(x), round(y)) for x, y, steps in stops(stored) for _ in range(steps // 60)]
    rounds = [places[i : i + 5] for i in range(0, len(places) - 5, 5)]
    assert len(rounds) > 10
    for one_round in rounds:
        assert {(1, 1), (7, 1), (7, 6), (1, 6), (4, 3)} == set(one_round)
    assert len({tuple(r) for r in rounds}) > 5


def test_a_room_named_twice_is_visited_once_a_round():
    names = room_names(run(patrol(rooms=["kitchen", ["kitchen_1", "any"], "bedroom"])))
    assert ["kitchen_1", "bedroom_1"] * 2 == names[:4]


def bent(**fields):
    """A synthetic home in which a part of a bedroom is out of view from the middle of it."""
    return {
        **scenario("5 min"),
        "floorplan": {"type": "synthetic", "seed": 1, "furnish": True},
        "robots": {
            "astro": {"camera": {"range": [0.3, 4.5]}, "behaviors": [{"type": "patrol", **fields}]}
        },
    }


def test_a_patrol_says_which_places_it_never_sees_and_stops_where_it_does():
    """In one of forty homes presence erred by a third: the bed was never in view."""
    by_middle = fleet2d.Simulation(bent()).actors["astro"]
    (note,) = by_middle.notes
    assert "living_room_1 (50% of its places: tv_1, bookshelf_1, dresser_1)" in note
    assert "stop_at: view" in note
    by_view = fleet2d.Simulation(bent(stop_at="view")).actors["astro"]
    assert [] == by_view.notes
    assert len(by_view.behaviors[0].stops) >= len(by_middle.behaviors[0].stops)


def test_a_robot_that_also_does_something_else_is_not_warned():
    content = bent()
    content["robots"]["astro"]["behaviors"].append({"type": "hangout"})
    assert [] == fleet2d.Simulation(content).actors["astro"].notes


def test_a_round_that_takes_no_time_does_not_hang_the_run():
    content = patrol("1 min", waypoints=[[1.0, 3.0]], dwell=0, look_around=False)
    assert 60 == run(content).manifest["steps"]


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"rooms": ["kitchen"], "waypoints": [[1, 1]]}, ["rooms", "waypoints", "one of them"]),
        ({"rooms": []}, ["nowhere to go"]),
        ({"rooms": "kitchen"}, ["robots.astro.rooms"]),
        ({"order": "backwards"}, ["order", "fixed", "random"]),
        ({"dwell": "-1 min"}, ["dwell", "0 or more"]),
        ({"rooms": ["storage"]}, ["robots.astro", "storage", "can't be reached", "living_room_1"]),
        ({"rooms": ["kichen"]}, ["robots.astro", "kichen", "did you mean 'kitchen", "bedroom_1"]),
        ({"waypoints": [[5.05, 1.0]]}, ["robots.astro", "5.05", "wall", "nearest free point"]),
        ({"waypoints": [[10.0, 1.0]]}, ["robots.astro", "can't be reached"]),
        ({"waypoints": [[1.0, 1.0, 0.0]]}, ["waypoints.0"]),
    ],
)
def test_rounds_that_can_not_be_made_are_refused_before_the_run(fields, words):
    with pytest.raises(InputError) as caught:
        fleet2d.Simulation(patrol(**fields))
    for word in words:
        assert word in str(caught.value)
