"""Meander: the random walk."""

from datetime import timedelta

import numpy as np
import pytest
from tests.scenes import OWN, path, run, scenario

from fleet2d.engine.simulation import Simulation
from fleet2d.entities.body import RandomWalk
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.placed_objects import POSTURES


def walker(duration="30 min", step="1 s", **fields):
    content = scenario(
        duration, users={"ben": {"type": "meander", **fields}}, simulation={"step": step}
    )
    content["artifacts"] = {"trajectories": "off"}
    return content


def walk(content):
    """Return the metres and the turn [deg] of each step."""
    poses = path(run(content), "ben")
    metres = np.sqrt(np.diff(poses.x) ** 2 + np.diff(poses.y) ** 2)
    return metres, np.rad2deg((np.diff(poses.heading) + np.pi) % (2 * np.pi) - np.pi)


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


def test_it_goes_on_from_where_another_behavior_left_it():
    content = walker()
    scripted = {"type": f"{OWN}:Scripted", "script": [(7.0, 6.0), 30]}
    content["users"]["ben"] = {"behaviors": [scripted, {"type": "meander"}]}
    poses = path(run(content), "ben")
    there = np.hypot(poses.x - 7, poses.y - 6) < 1e-3
    at = int(np.argmax(there))
    assert there[at : at + 30].all()
    assert not there[at + 90 :].all()
    assert np.hypot(np.diff(poses.x), np.diff(poses.y)).max() < 1.01


def test_who_stays_at_walls_walks_less_and_is_near_them_for_most_of_the_time():
    """The published rule: 2,915 m a day and 75 % of the time within 0.3 m of a wall there."""
    metres, near = [], []
    for rule in ("stay", "turn"):
        walk = {"type": "meander", "turn_std_deg": 15, "at_walls": rule, "speed": 0.1}
        stored = run(scenario("1 d", users={"ana": walk}, floorplan={"type": "bundled"}))
        poses = path(stored, "ana")
        metres.append(np.hypot(np.diff(poses.x), np.diff(poses.y)).sum())
        space, lattice = Home(stored.plan).space(0.3), stored.plan.lattice
        points = lattice.to_lattice(np.stack([poses.x, poses.y], axis=1)[::60]).tolist()
        near.append(np.mean([space.part_at(*point) < 0 for point in points]))
    assert metres[0] < 0.7 * metres[1]
    assert near[0] > near[1]


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
