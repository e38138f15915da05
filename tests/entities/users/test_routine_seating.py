"""Seating: no two members of a household use the same place at furniture at the same time."""

import copy
import itertools
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from tests.scenes import digests, run, scenario, table

from fleet2d.engine.simulation import Simulation
from fleet2d.entities.users.routine import _stays
from fleet2d.routines.planner import FINISHES, INTERRUPTS, PLANNED, REST, RESUMES, Episode

FAMILY = Path(__file__).parents[3] / "examples" / "family.yaml"
EVENING = {
    "members": dict.fromkeys(("ana", "ben", "cleo", "dan"), "retired"),
    "together": {"dinner": {"at": "18:00", "spread": "1 min", "on": "daily", "takes": "40 min"}},
}


def household(shared, *names, **changes):
    users = {name: {"type": "routine", "household": shared} for name in names}
    home = {"floorplan": {"type": "bundled", "furnish": True}}
    return scenario(users=users, robots={}, **{"duration": "1 d", **home, **changes})


def seconds_on_one_place(result, *names):
    """The time that two people rest nearer to each other than 5 cm, every 10 s."""
    paths = {name: result.path(name, every=timedelta(seconds=10)) for name in names}
    total = 0
    for one, other in itertools.combinations(paths.values(), 2):
        rests = [np.r_[False, (np.diff(p.x) == 0) & (np.diff(p.y) == 0)] for p in (one, other)]
        near = np.hypot(one.x - other.x, one.y - other.y) < 0.05
        total += 10 * int((rests[0] & rests[1] & near & ~one.away & ~other.away).sum())
    return total


def test_two_people_on_one_seat():
    """Before, members of this family spent 7 to 12 hours a week on one place."""
    result = run(FAMILY, "simulation.duration=4 d", "robots.astro=null", "users.rex=null", seed=4)
    assert 0 == seconds_on_one_place(result, "ana", "ben", "cleo")


@pytest.mark.parametrize("kind", ["routine", "population"])
def test_people_without_a_household_may_have_places_of_their_own(kind):
    """Three who work at home sat on one chair at one desk for 15 hours a day, pair by pair."""
    user = {"type": kind} | ({"persona": "works_from_home"} if kind == "routine" else {})
    on_one_place = {}
    for own in (False, True):
        users = {name: {**user, "own_places": own} for name in ("ana", "ben", "cleo")}
        home = {"type": "bundled", "furnish": True}
        content = scenario("2 d", users=users, robots={}, floorplan=home)
        on_one_place[own] = seconds_on_one_place(run(content), *users)
    assert on_one_place[True] < 0.1 * on_one_place[False]
    assert on_one_place[True] < 2 * 900  # at a washbasin or a toilet


def test_more_people_than_places_leave_nobody_on_a_place_of_another():
    """Four retired people have one armchair; the others are on spots of the room."""
    chair = {"type": "armchair", "at": [11.3, 4.4], "name": "armchair"}
    home = {"type": "bundled", "furniture": [chair]}
    names = list(EVENING["members"])
    result = run(household(EVENING, *names, floorplan=home), seed=1)
    used = table(result, "events", event="uses")
    assert len(set(used["entity"][used["detail"] == "armchair"])) > 1
    paths = [result.path(name, every=timedelta(seconds=10)) for name in names]
    seat = [(np.hypot(p.x - 11.3, p.y - 4.4) < 0.05) & ~p.away for p in paths]
    assert 1 == np.sum(seat, axis=0).max()


def test_members_who_share_a_bedroom_and_are_no_couple_lie_on_places_of_their_own():
    """The home has three bedrooms, for four: two shared a place in bed all night."""
    names = list(EVENING["members"])
    result = run(household(EVENING, *names, simulation={"start": "2026-01-05T20:00"}), seed=1)
    assert 0 == seconds_on_one_place(result, *names)


def test_order_of_users_and_length_of_spans_change_nothing():
    names = list(EVENING["members"])
    forward = run(household(EVENING, *names), seed=2)
    for span in (61, 7200):
        assert digests(forward) == digests(
            run(household(EVENING, *names), f"simulation.max_span={span}", seed=2)
        )
    backward = run(household(EVENING, *reversed(names)), seed=2)
    for name in names:
        paths = [each.path(name, every=timedelta(minutes=1)) for each in (forward, backward)]
        assert np.array_equal(paths[0].x, paths[1].x)
        assert np.array_equal(paths[0].y, paths[1].y)


def test_members_who_are_not_in_the_scenario_take_no_place():
    """Ana is the last of four, and the only one in the home: the one armchair is hers."""
    chair = {"type": "armchair", "at": [11.3, 4.4], "name": "armchair"}
    home = {"type": "bundled", "furniture": [chair]}
    last = {"members": dict.fromkeys(("ben", "cleo", "dan", "ana"), "retired")}
    alone = run(household(last, "ana", floorplan=home), seed=1)
    assert "armchair" in table(alone, "events", event="uses", entity="ana")["detail"]


def test_branches_and_stored_states_have_the_same_places(tmp_path):
    simulation = Simulation(household(EVENING, *EVENING["members"]), seed=5)
    simulation.run_until(timedelta(hours=17))
    simulation.save(tmp_path / "state")
    branch, stored = copy.deepcopy(simulation), Simulation.load(tmp_path / "state")
    end = simulation.run().digest
    assert end == branch.run().digest
    assert end == stored.run().digest


def at(begin, end, role=PLANNED, activity="tv"):
    return Episode(activity, begin, end, role=role)


@pytest.mark.parametrize(
    ("episodes", "groups"),
    [
        ([at(0, 9)], [[0]]),
        ([at(0, 900), at(900, 960, INTERRUPTS, "drink"), at(960, 2000, RESUMES)], [[0, 2], [1]]),
        ([at(0, 900), at(900, 960, INTERRUPTS, "drink"), at(960, 2000, FINISHES)], [[0], [1], [2]]),
        ([at(0, 900), at(900, 960, activity=REST), at(960, 2000, activity="read")], [[0, 1], [2]]),
        ([at(0, 900, activity="work"), at(900, 960, INTERRUPTS), at(960, 2000, RESUMES)], [[0], [1], [2]]),
        ([at(0, 100, activity=REST), at(100, 200, INTERRUPTS), at(200, 900, RESUMES)], [[1], [2]]),
    ],
    ids=["one", "resumed", "finished", "short gap", "resumed after being out", "gap resumed"],
)  # fmt: skip
def test_what_is_done_in_one_place(episodes, groups):
    assert groups == _stays(episodes, lambda episode: episode.activity == "work")
