"""Find: search for a person by what is believed, with a deadline, and a verdict."""

from itertools import permutations

import numpy as np
import pytest
from tests.entities.robots.robots import (
    SHARE,
    assert_same_for_every_max_span,
    events,
    home_with,
    names,
)
from tests.reference.search import play
from tests.scenes import path, run

import fleet2d
from fleet2d import Algorithm
from fleet2d.entities.robots.find import Sites
from fleet2d.entities.robots.search import SearchProblem, exact, order_by
from fleet2d.errors import InputError

POLICIES = ["random", "nearest", "likeliest", "greedy", "exact", "receding"]
OUT = {"type": "schedule", "days": [{"items": [{"at": "00:00", "away": True}]}]}
STAY = {"type": "patrol", "waypoints": [[1.0, 3.0]], "dwell": "1 d", "look_around": False}


class Told:
    """Where people are, as a presence algorithm says it."""

    def __init__(self, shares, away):
        self.shares, self.out = np.array(shares), away

    def share(self, user="anyone"):
        return self.shares

    def away(self, user):
        return self.out

    def at(self, time):
        return self

    def to_columns(self, rooms):
        return {"room": np.array(rooms, dtype=object), "share": self.shares}


class Oracle(Algorithm):
    """Says from the first minute on what the scenario tells it to."""

    rooms: dict[str, float]
    away: float = 0.0

    def update(self, history, state):
        known = [self.rooms.get(room.name, 0.0) for room in state.home.rooms]
        return Told([share / sum(known) for share in known], self.away)


def belief(**rooms):
    """An algorithm that knows."""
    away = rooms.pop("away", 0.0)
    oracle = {"type": f"{__name__}:Oracle", "period": "1 min", "rooms": rooms, "away": away}
    return {"algorithms": {"rtp": oracle}}


def search(policy="receding", **fields):
    return {
        "type": "find",
        "user": "ana",
        "policy": policy,
        "at": ["07:10"],
        "source": "rtp",
        **fields,
    }


@pytest.mark.parametrize("policy", POLICIES)
def test_every_policy_finds_who_is_at_home_and_stays_with_her(policy):
    content = home_with([search(policy), STAY], "30 min", **belief(kitchen_1=1, bathroom_1=1))
    stored = run(content)
    rows = [(name, step) for step, name, _ in events(stored) if name in ("find_begins", "found")]
    assert [("find_begins", 600), ("found", rows[-1][1])] == rows
    poses, end = path(stored, "astro"), rows[1][1]
    gap = np.hypot(poses.x - 7.0, poses.y - 6.0)
    assert gap[end : end + 60].min() < 1.6
    assert (poses.x[-1], poses.y[-1]) == pytest.approx((1.0, 3.0), abs=0.01)


def test_in_a_real_home_the_exact_order_is_the_best_of_all(shared_data):
    """Rooms, ways and looks as they are; chances by size, and drawn."""
    for name in ("bundled", *sorted((shared_data / "houseexpo").glob("*.json"))[:2]):
        content = home_with([search()], **belief(kitchen_1=1))
        content["floorplan"] = "bundled"
        if name != "bundled":
            content["floorplan"] = {"type": "houseexpo", "path": str(name)}
        content["robots"]["astro"].pop("start")
        content["users"]["ana"] = "meander"
        simulation = fleet2d.Simulation(content)
        astro = simulation.actors["astro"]
        sites = Sites(astro, 2)
        now = fleet2d.Situation(astro, 0)
        prior = np.random.default_rng(4).dirichlet(np.ones(len(sites)))
        whole = sites.problem(now, prior)
        few = np.arange(min(len(sites), 7))
        part = SearchProblem(
            whole.prior[few], whole.reach[few], whole.travel[np.ix_(few, few)],
            whole.look[few], whole.detect[few],
        )  # fmt: skip
        best = min(play(part, order).cost for order in permutations(few.tolist()))
        assert play(part, exact(part)).cost == pytest.approx(best)
        costs = {p: play(whole, order_by(p, whole, now.random("x"))).cost for p in POLICIES}
        assert costs["exact"] == min(costs.values())
        assert max(costs, key=lambda policy: costs[policy]) in ("random", "nearest")


def test_it_looks_first_where_it_is_told_to():
    times = []
    for room in ("bathroom_1", "bedroom_1"):
        stored = run(home_with([search("likeliest"), STAY], "30 min", **belief(**{room: 1})))
        times += [step for step, name, _ in events(stored) if name == "found"]
    assert times[0] + 10 < times[1]


def test_it_gives_up_at_the_deadline():
    content = home_with([search(deadline="2 min"), STAY], "30 min", OUT, **belief(bathroom_1=1))
    stored = assert_same_for_every_max_span(content, 61)
    rows = [(step, name) for step, name, _ in events(stored)]
    assert [(600, "find_begins"), (720, "gave_up")] == rows


@pytest.mark.parametrize(("fields", "end"), [
    ({"out_at": 0.9}, "not_at_home"),
    ({"out_at": 1}, "gave_up"),  # never sure
    # While nothing says where people are, somebody may be out, unless told otherwise.
    ({"source": None, "out_at": 0.8, "deadline": "20 min"}, "not_at_home"),
    ({"source": None, "out_at": 0.8, "deadline": "20 min", "out": 0}, "gave_up"),
])  # fmt: skip
def test_it_says_not_at_home_once_all_is_looked_at_and_believed(fields, end):
    content = home_with([search(**fields), STAY], "40 min", OUT, **belief(bathroom_1=1, away=0.6))
    assert ["find_begins", end] == names(assert_same_for_every_max_span(content, 61))


@pytest.mark.parametrize(
    ("late", "at", "begins"),
    [
        ("10 min", ["07:10"], []),
        ("20 min", ["07:10"], [1500]),
        ("5 min", ["07:06", "07:10", "07:24"], [1500]),  # the last of those that were due
    ],
)
def test_a_search_that_can_not_begin_in_time_is_left_out(late, at, begins):
    visits = [{"at": "07:05", "place": "kitchen", "dwell": "20 min"}]
    behaviors = [{"type": "scheduled", "visits": visits}, search(late=late, at=at), STAY]
    stored = run(home_with(behaviors, "40 min", **belief(bathroom_1=1)))
    steps = [step for step, name, _ in events(stored) if name == "find_begins"]
    assert begins == pytest.approx(steps, abs=20)


def test_who_else_comes_into_view_does_not_make_it_look_anew():
    find = search("exact", source=None, at=[], every="10 min", out=0.9)
    content = home_with([find, STAY], "2 h", OUT, metrics={"time_to_find": {}})
    alone = run(content).metrics["time_to_find"]["astro"]
    content["users"] |= {name: {"type": "meander"} for name in ("ben", "cleo", "dan")}
    stored = run(content)
    among = stored.metrics["time_to_find"]["astro"]
    assert 1.0 == alone["out_told"] == among["out_told"]
    assert [name for _, name, _ in events(stored)].count("user_seen") > 3 * among["searches"]
    assert among["out_mean"] < 1.1 * alone["out_mean"]


def test_who_is_in_view_is_found_at_once():
    stay = {**STAY, "waypoints": [[5.5, 6.0]]}
    there = {"start": [5.5, 6.0]}
    stored = run(home_with([search(), stay], "30 min", astro=there, **belief(kitchen_1=1)))
    begun_and_found = [step for step, name, _ in events(stored) if name.startswith("f")]
    assert [600, 600] == begun_and_found


def test_anyone_and_intervals_and_no_source_will_do():
    every = {"type": "find", "every": "20 min", "deadline": "5 min"}
    stored = run(home_with([every, STAY], "1 h 10 min"))
    begun = [step for step, name, _ in events(stored) if name == "find_begins"]
    assert [1200, 2400, 3600] == begun
    assert 3 == names(stored).count("found")


def test_it_breaks_in_and_the_patrol_goes_on():
    patrol = {"type": "patrol", "rooms": ["kitchen", "bedroom", "living_room"], "dwell": "7 min"}
    find = search(source="share")  # a distribution of an algorithm of one's own will do
    stored = run(home_with([find, patrol], "1 h", algorithms=SHARE))
    assert ["find_begins", "found"] == names(stored)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"every": "1 h"}, "not by both"),
        ({"policy": "magic"}, "policy"),
        ({"views": 0}, "views"),
        ({"deadline": 0}, "longer than 0"),
        ({"source": "rpt"}, "there is no algorithm 'rpt': did you mean 'rtp'"),
    ],
)
def test_bad_settings_are_refused(fields, words):
    with pytest.raises(InputError, match=words):
        fleet2d.Simulation(home_with([search(**fields)], **belief(kitchen_1=1)))


def test_an_output_that_says_nothing_of_rooms_is_an_error_that_names_it():
    algorithms = {"tick": {"type": "tests.own_components:Keeper", "period": "1 min"}}
    content = home_with([search(source="tick"), STAY], "30 min", algorithms=algorithms)
    with pytest.raises(
        fleet2d.ComponentError, match=r"robots\.astro.*'tick' has no room probabilities"
    ):
        run(content)
