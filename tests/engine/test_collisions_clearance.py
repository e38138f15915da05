"""Giving way: robots stop before people, wait, go round; the same for every span."""

import numpy as np
import pytest
from tests.entities.robots.robots import (
    OUT,
    assert_same_for_every_max_span,
    events,
    home_with,
    names,
    rooms,
)
from tests.entities.robots.test_find import belief
from tests.scenes import path, run

import fleet2d
from fleet2d.errors import InputError

GIVES_WAY = {"distance": 0.4, "patience": "10 s"}
TO_AND_FRO = {
    "type": "patrol",
    "waypoints": [[1.0, 3.5], [4.5, 3.5]],
    "dwell": "20 s",
    "look_around": False,
}
KEPT = 0.2 + 0.15 + 0.4


def stands(x, y):
    return {"type": "schedule", "days": [{"items": [{"at": "00:00", "place": [x, y]}]}]}


def polite(ana, behaviors=None, duration="10 min", **fields):
    return home_with(
        behaviors or [TO_AND_FRO], duration, ana, astro={"gives_way": {**GIVES_WAY, **fields}}
    )


def gap(stored):
    one, other = path(stored, "astro"), path(stored, "ana")
    return np.hypot(one.x - other.x, one.y - other.y)


def test_it_waits_before_somebody_and_then_goes_round():
    stored = assert_same_for_every_max_span(polite(stands(3.0, 3.2)), 61, 7, 1)
    assert "gives_way" in names(stored)
    assert gap(stored).min() > 0.35
    astro = path(stored, "astro")
    assert astro.x.max() > 4.4
    assert astro.x[400:].min() < 1.1


def test_it_comes_no_nearer_while_it_is_patient():
    stored = run(polite(stands(2.8, 3.5), patience="1 h"))
    assert gap(stored).min() >= KEPT - 0.01
    assert 1 == names(stored).count("gives_way")


def own_approaches(stored, user="ana"):
    """How near the robot's own moves bring it to where somebody was, of those that bring it nearer [m]."""
    one, other = path(stored, "astro"), path(stored, user)
    before = np.hypot(one.x[:-1] - other.x[:-1], one.y[:-1] - other.y[:-1])
    after = np.hypot(one.x[1:] - other.x[:-1], one.y[1:] - other.y[:-1])
    return after[(after < before - 1e-9) & ~other.away[:-1]]


@pytest.mark.parametrize(
    "behaviors",
    [["meander"], [TO_AND_FRO], ["opportunistic", "patrol"], ["follow", "patrol"]],
    ids=["meander", "patrol", "opportunistic", "follow"],
)
def test_it_never_drives_into_anybody_in_a_crowd(behaviors):
    stored = assert_same_for_every_max_span(polite("meander", behaviors, "20 min"), 61)
    assert "gives_way" in names(stored)
    assert own_approaches(stored).min() >= 0.35
    rude = run(home_with(behaviors, "20 min", "meander"))
    assert own_approaches(rude).min() < 0.35


def test_it_never_drives_into_anybody_in_a_furnished_home():
    member = {
        "type": "routine",
        "household": {"members": {"ana": "works_from_home", "ben": "retired"}},
    }
    content = {
        "simulation": {"start": "2026-01-05", "duration": "1 d", "seed": 4},
        "floorplan": {"type": "bundled", "furnish": True},
        "users": {"ana": member, "ben": member},
        "robots": {"astro": {"behaviors": [{"type": "patrol", "dwell": "1 min"}], "gives_way": {}}},
    }
    stored = run(content)
    nearest = [own_approaches(stored, user) for user in ("ana", "ben")]
    assert min(result.min() for result in nearest) >= 0.35
    # Nearer than it likes it comes only where it has waited, and there is no more room.
    assert sum(int((result < KEPT - 0.01).sum()) for result in nearest) < 20


IN_THE_DOOR = {"type": "tests.own_components:Scripted", "start": [5.05, 3.1], "speed": 1.0}


@pytest.mark.parametrize(("stays", "gives_up"), [(60.0, False), (1200.0, True)])
def test_it_waits_at_a_door_and_gives_up_where_nobody_moves(stays, gives_up):
    patrol = {**TO_AND_FRO, "waypoints": [[2.0, 3.1], [7.0, 3.1], [1.0, 6.0]]}
    ana = {**IN_THE_DOOR, "script": [stays, [7.0, 1.0], 1200.0]}
    stored = assert_same_for_every_max_span(polite(ana, [patrol], "10 min"), 61, 1)
    assert own_approaches(stored).min() >= 0.4
    assert ("gives_up" in names(stored)) == gives_up
    assert ("kitchen_1" in rooms(stored)) != gives_up
    assert "bedroom_1" in rooms(stored)  # the stop behind the one that it leaves out
    steps = [step for step, name, _ in events(stored) if name in ("gives_way", "gives_up")]
    if gives_up:
        assert 120 <= steps[1] - steps[0] <= 133  # it looks ever more seldom


def test_a_place_that_is_taken_is_left_alone_until_it_thinks_again():
    hangout = {"type": "hangout", "source": "rtp", "explore": 0, "period": "30 min"}
    content = polite(OUT, [hangout], "2 h", gives_up="1 min")
    content |= belief(bathroom_1=1)
    free = run(content)
    x, y = path(free, "astro").x[-1], path(free, "astro").y[-1]
    content["users"]["ana"] = {"type": "schedule", **stands(float(x), float(y))}
    stored = assert_same_for_every_max_span(content, 61)
    steps = [step for step, name, _ in events(stored) if name == "gives_up"]
    assert 3 <= len(steps) <= 4  # once in half an hour
    assert gap(stored).min() > 0.4


def test_a_look_that_was_held_up_counts_as_one():
    """Find looks on elsewhere, though it waited for somebody on the way."""
    find = {"type": "find", "user": "ben", "at": ["07:01"], "deadline": "8 min"}
    still = {"type": "patrol", "waypoints": [[1.0, 3.0]], "dwell": "1 d", "look_around": False}
    content = polite(stands(3.0, 3.0), [find, still], "12 min", patience="3 s")
    content["users"]["ben"] = OUT
    result = run(content)
    assert "gives_way" in names(result)
    assert {"kitchen_1", "bedroom_1", "bathroom_1"} <= visited(result)


def visited(stored):
    """The rooms that the robot was in."""
    poses = path(stored, "astro")
    return {stored.plan.rooms[room].name for room in set(poses.room.tolist()) if room >= 0}


def test_events_at_the_begin_of_a_plan_are_told_though_it_waits():
    find = {"type": "find", "user": "ben", "at": ["07:02"], "deadline": "2 min"}
    still = {"type": "patrol", "waypoints": [[3.0, 3.5]], "dwell": "1 d", "look_around": False}
    content = polite(stands(3.6, 3.5), [find, still], patience="1 min")
    content["robots"]["astro"]["start"] = [3.0, 3.5]
    content["users"]["ben"] = OUT
    stored = assert_same_for_every_max_span(content, 61)
    assert ["find_begins", "gave_up"] == [n for n in names(stored) if n != "gives_way"]


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"distance": -1}, "distance"),
        ({"patience": 0}, "longer than 0"),
        ({"gives_up": 0}, "longer than 0"),
        ({"politeness": 1}, "unknown key"),
    ],
)
def test_bad_settings_are_refused(fields, words):
    with pytest.raises(InputError, match=words):
        fleet2d.Simulation(polite("meander", **fields))
