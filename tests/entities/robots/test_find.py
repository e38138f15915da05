"""Find: search for a person by what is believed, with a deadline, and a verdict."""

from itertools import permutations
from typing import Any

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

    def __init__(self, shares: list[float], away: float) -> None:
        self.shares, self.out = np.array(shares), away

    def share(self, user: str = "anyone") -> Any:
        return self.shares

    def away(self, user: str) -> float:
        return self.out

    def at(self, time: Any) -> "Told":
        return self

    def to_columns(self, rooms: Any) -> Any:
        return {"room": np.array(rooms, dtype=object), "share": self.shares}


class Oracle(Algorithm):
    """Says from the first minute on what the scenario tells it to."""

    rooms: dict[str, float]
    away: float = 0.0

    def update(self, history: Any, state: Any) -> Told:
        known = [self.rooms.get(room.name, 0.0) for room in state.home.rooms]
        return Told([share / sum(known) for share in known], self.away)


def belief(**rooms: float) -> dict[str, Any]:
    """An algorithm that knows."""
    away = rooms.pop("away", 0.0)
    oracle = {"type": f"{__name__}:Oracle", "period": "1 min", "rooms": rooms, "away": away}
    return {"algorithms": {"rtp": oracle}}


def search(policy: str = "receding", **fields: Any) -> dict[str, Any]:
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
    stored = assert_same_for_every_max_span(content, 61)
    rows = [(name, step) for step, name, _ in events(stored) if name in ("find_begins", "found")]
    assert ["find_begins", "found"] == [name for name, _ in rows]
    assert 600 == rows[0][1]
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
    right = run(home_with([search("likeliest"), STAY], "30 min", **belief(bathroom_1=1)))
    wrong = run(home_with([search("likeliest"), STAY], "30 min", **belief(bedroom_1=1)))
    times = [
        next(step for step, name, _ in events(one) if name == "found") for one in (right, wrong)
    ]
    assert times[0] + 10 < times[1]


def test_it_gives_up_at_the_deadline():
    content = home_with([search(deadline="2 min"), STAY], "30 min", OUT, **belief(bathroom_1=1))
    stored = assert_same_for_every_max_span(content, 61)
    rows = [(step, name) for step, name, _ in events(stored)]
    assert [(600, "find_begins"), (720, "gave_up")] == rows


def test_it_says_not_at_home_once_all_is_looked_at_and_believed():
    stored = run(home_with([search(), STAY], "30 min", OUT, **belief(bathroom_1=1, away=0.6)))
    assert ["find_begins", "not_at_home"] == names(stored)
    surer = run(
        home_with([search(out_at=1), STAY], "30 min", OUT, **belief(bathroom_1=1, away=0.6))
    )
    assert ["find_begins", "gave_up"] == names(surer)


def test_while_nothing_says_where_people_are_somebody_may_be_out():
    blind = search(source=None, out_at=0.8, deadline="20 min")
    stored = assert_same_for_every_max_span(home_with([blind, STAY], "40 min", OUT), 61)
    assert ["find_begins", "not_at_home"] == names(stored)
    sure = run(home_with([{**blind, "out": 0}, STAY], "40 min", OUT))
    assert ["find_begins", "gave_up"] == names(sure)


def test_a_search_that_can_not_begin_in_time_is_left_out():
    visit = {
        "type": "scheduled",
        "visits": [{"at": "07:05", "place": "kitchen", "dwell": "20 min"}],
    }
    for late, begun in (("10 min", []), ("20 min", [1500])):
        content = home_with([visit, search(late=late), STAY], "40 min", **belief(bathroom_1=1))
        stored = assert_same_for_every_max_span(content, 61)
        steps = [step for step, name, _ in events(stored) if name == "find_begins"]
        assert steps == [pytest.approx(step, abs=20) for step in begun]
    often = {**search(at=["07:06", "07:10", "07:24"], late="5 min")}
    stored = run(home_with([visit, often, STAY], "40 min", **belief(bathroom_1=1)))
    assert 1 == names(stored).count("find_begins")  # the last of those that were due


def test_who_else_comes_into_view_does_not_make_it_look_anew():
    find = search("exact", source=None, at=[], every="10 min", out=0.9)
    content = home_with([find, STAY], "2 h", OUT, metrics={"time_to_find": {}})
    alone = run(content).metrics["time_to_find"]["astro"]
    content["users"] |= {name: {"type": "meander"} for name in ("ben", "cleo", "dan")}
    stored = assert_same_for_every_max_span(content, 61)
    among = stored.metrics["time_to_find"]["astro"]
    assert 1.0 == alone["out_told"] == among["out_told"]
    sightings = [name for _, name, _ in events(stored)].count("user_seen")
    assert sightings > 3 * among["searches"]
    assert among["out_mean"] < 1.1 * alone["out_mean"]


def test_who_is_in_view_is_found_at_once():
    content = home_with(
        [search(), STAY], "30 min", astro={"start": [5.5, 6.0]}, **belief(kitchen_1=1)
    )
    content["robots"]["astro"]["behaviors"][1]["waypoints"] = [[5.5, 6.0]]
    rows = [(step, name) for step, name, _ in events(run(content))]
    assert (600, "find_begins") in rows
    assert (600, "found") in rows


def test_anyone_and_intervals_and_no_source_will_do():
    every = {"type": "find", "every": "20 min", "deadline": "5 min"}
    stored = run(home_with([every, STAY], "1 h 10 min"))
    begun = [step for step, name, _ in events(stored) if name == "find_begins"]
    assert [1200, 2400, 3600] == begun
    assert 3 == names(stored).count("found")


def test_it_breaks_in_and_the_patrol_goes_on():
    patrol = {"type": "patrol", "rooms": ["kitchen", "bedroom", "living_room"], "dwell": "7 min"}
    stored = run(home_with([search(), patrol], "1 h", **belief(bathroom_1=1)))
    assert ["find_begins", "found"] == names(stored)


def test_a_distribution_of_an_own_algorithm_will_do():
    stored = run(home_with([search(source="share"), STAY], "30 min", algorithms=SHARE))
    assert "found" in names(stored)


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


def test_a_robot_without_a_camera_is_refused():
    with pytest.raises(InputError, match=r"robots\.astro.*no camera"):
        fleet2d.Simulation(home_with([search()], astro={"camera": None}, **belief(kitchen_1=1)))
