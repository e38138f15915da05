"""Meander: the random walk."""

from datetime import timedelta
from typing import Any

import numpy as np
import pytest
from tests.scenes import OWN, path, run, scenario

from fleet2d.engine.simulation import Simulation
from fleet2d.entities.body import RandomWalk
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.placed_objects import POSTURES
from fleet2d.kernels import F64


def walker(duration: str = "30 min", step: str = "1 s", **fields: Any) -> dict[str, Any]:
    content = scenario(
        duration, users={"ben": {"type": "meander", **fields}}, simulation={"step": step}
    )
    content["artifacts"] = {"trajectories": "off"}
    return content


def walk(content: dict[str, Any]) -> tuple[F64, F64]:
    """Return the metres and the turn [deg] of each step."""
    poses = path(run(content), "ben")
    metres = np.sqrt(np.diff(poses.x) ** 2 + np.diff(poses.y) ** 2)
    return metres, np.rad2deg((np.diff(poses.heading) + np.pi) % (2 * np.pi) - np.pi)


def test_a_step_is_as_long_as_the_speed_says_or_nothing():
    metres, _ = walk(walker(speed=0.8))
    free = metres > 0
    assert metres[free] == pytest.approx(0.8, abs=2e-3)
    assert 0.2 < free.mean() < 1


def test_it_goes_where_it_heads():
    poses = path(run(walker(speed=0.8)), "ben")
    dx, dy = np.diff(poses.x), np.diff(poses.y)
    moved = (dx != 0) | (dy != 0)
    ahead = dx * np.cos(poses.heading[1:]) + dy * np.sin(poses.heading[1:])
    assert ahead[moved] == pytest.approx(0.8, abs=2e-3)


def test_turns_have_the_standard_deviation_asked_for():
    # At small steps, so that few are cut short by a wall and the choice of those is no bias.
    metres, turns = walk(walker("2 h", speed=0.02, turn_std_deg=20, turn_rate_deg=3600))
    assert (metres > 0).mean() > 0.9
    turns = turns[metres > 0]
    assert turns.std() == pytest.approx(20, rel=0.04)
    assert abs(turns.mean()) < 1


def test_the_spread_does_not_depend_on_the_step():
    content = walker("2 h", "250 ms", speed=0.02, turn_std_deg=20, turn_rate_deg=3600)
    metres, turns = walk(content)
    assert turns[metres > 0].std() == pytest.approx(20 * 0.5, rel=0.04)


def test_turns_keep_to_the_turn_rate_also_at_walls():
    metres, turns = walk(walker(turn_std_deg=90, turn_rate_deg=30))
    for kind in (metres > 0, metres == 0):
        assert np.abs(turns[kind]).max() <= 30
        assert np.abs(turns[kind]).max() > 28


def test_at_a_wall_it_turns_by_any_angle():
    metres, turns = walk(walker("8 h", turn_std_deg=5, turn_rate_deg=3600))
    blocked = turns[metres == 0]
    assert len(blocked) > 1000
    assert np.histogram(blocked, bins=4, range=(-180, 180))[0].min() > 0.2 * len(blocked)


def test_without_spread_it_walks_straight_on_to_the_next_wall():
    metres, turns = walk(walker(turn_std_deg=0))
    assert not turns[metres > 0].any()
    assert turns[metres == 0].any()


def test_it_gets_everywhere():
    poses = path(run(walker("8 h")), "ben")
    assert {0, 1, 2, 3} <= set(poses.room.tolist())
    assert 4 not in poses.room


def test_it_goes_on_from_where_another_behavior_left_it():
    content = walker()
    content["users"]["ben"] = {
        "behaviors": [
            {"type": f"{OWN}:Scripted", "script": [(7.0, 6.0), 30]},
            {"type": "meander"},
        ]
    }
    poses = path(run(content), "ben")
    there = np.abs(poses.x - 7) + np.abs(poses.y - 6) < 1e-3
    at = int(np.argmax(there))
    assert there[at : at + 30].all()
    assert not there[at + 90 :].all()
    moves = np.sqrt(np.diff(poses.x) ** 2 + np.diff(poses.y) ** 2)
    assert moves.max() < 1.01


def test_who_stays_at_walls_walks_less_and_is_near_them_for_most_of_the_time():
    """The published rule: 2,915 m a day and 75 % of the time within 0.3 m of a wall there."""
    metres, near = {}, {}
    for rule in ("turn", "stay"):
        walk = {"type": "meander", "turn_std_deg": 15, "at_walls": rule, "speed": 0.1}
        stored = run(scenario("1 d", users={"ana": walk}, floorplan={"type": "bundled"}))
        poses = path(stored, "ana")
        metres[rule] = float(np.hypot(np.diff(poses.x), np.diff(poses.y)).sum())
        space, lattice = Home(stored.plan).space(0.3), stored.plan.lattice
        points = lattice.to_lattice(np.stack([poses.x, poses.y], axis=1)[::60]).tolist()
        near[rule] = float(np.mean([space.part_at(x, y) < 0 for x, y in points]))
    assert metres["stay"] < 0.7 * metres["turn"]
    assert near["stay"] > near["turn"]


def test_who_sat_stands_for_as_long_as_it_walks():
    """The walk's plan said that it sat, so whatever followed the walk began sitting."""
    ana = {"behaviors": [{"type": f"{OWN}:Lounge"}, {"type": "meander"}]}
    furnished = {"type": "bundled", "furnish": True}
    now = Simulation(scenario("10 min", users={"ana": ana}, floorplan=furnished))
    postures = []
    for minute in (1, 5):
        now.run_until(timedelta(minutes=minute))
        ana_now = now._state.actors[0]
        postures.append(POSTURES[ana_now.posture_code(minute * 60 * 10**6)])
    assert ["sit", "stand"] == postures
    assert isinstance(ana_now.motion, RandomWalk)
