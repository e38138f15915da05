"""Encounters: beside a slow twin that goes from step to step."""

from typing import NamedTuple

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.scenes import scenario
from tests.thorough import examples

from fleet2d.engine.encounters import Encounters
from fleet2d.engine.simulation import Simulation
from fleet2d.entities.body import Bodies
from fleet2d.kernels import PoseBlock

UNITS = 1280  # lattice units per metre
LYING, SITTING = 2, 1
ALWAYS = {"turns": 1, "steps_aside": 1, "leaves": 1, "comes": 1}
CLOSE = {"notices": 2.5, "in_the_way": 0.9, "too_close": 0.7, "patience": "3 s"}


class Seen(NamedTuple):
    """A step as the twin sees it."""

    distance: float
    moved: bool
    posture: int
    away: bool


def simulation():
    user = {"behaviors": [{"type": "reactions", "manners": {**ALWAYS, **CLOSE}}]}
    return Simulation(scenario(users={"ana": user}, robots={"astro": {"type": "patrol"}}))


def twin(steps):
    """Say what happens, step by step."""
    result, near, coming, close, last = [], True, True, 0, float("inf")
    for k, step in enumerate(steps):
        gone = step.away or step.posture == LYING
        distance = float("inf") if gone else step.distance
        if distance > 2.5 * 1.25:
            near = True
        if distance > 0.9 * 1.5:
            coming = True
        close = close + 1 if distance <= 0.7 else 0
        if near and distance <= 2.5:
            result.append((k, "robot_near"))
            near = False
        drives_up = step.moved and distance < last and step.posture == 0
        if coming and distance <= 0.9 and drives_up:
            result.append((k, "robot_coming"))
            coming = False
        if close == 3:
            result.append((k, "robot_close"))
        last = distance
    return result


@st.composite
def meetings(draw):
    """Distances [cm], postures, and whether she is away, of some steps in a row."""
    legs = draw(st.lists(st.tuples(st.integers(5, 390), st.integers(1, 6)), min_size=1, max_size=8))
    result, at = [], 300
    for goal, count in legs:
        posture = draw(st.sampled_from([0, 0, 0, SITTING, LYING]))
        away = draw(st.integers(0, 9)) == 0
        result += [(at + (goal - at) * i // count, posture, away) for i in range(1, count + 1)]
        at = goal
    return result


class Given(Bodies):
    """Bodies whose poses are given at each step."""

    def __init__(self, poses):
        self.poses_at = poses

    def block(self, first, end):
        return PoseBlock(*(column[:, first:end] for column in self.poses_at))


@settings(max_examples=examples(80))
@given(meeting=meetings(), cuts=st.lists(st.integers(1, 7), max_size=40))
def test_what_happens_is_that_of_the_twin_however_a_run_is_cut(meeting, cuts):
    users, robots = _bodies()
    encounters = Encounters(users, robots)
    cm, posture, away = (np.array(column) for column in zip(*meeting, strict=True))
    # In the middle of the living room; the robot comes along its long side.
    here, y = round(4.7 * UNITS), round(3.1 * UNITS)
    robot = here - cm * UNITS // 100
    zero = np.zeros((2, len(cm)), np.int64)
    x = np.array([zero[0] + here, robot])
    of_user = np.array([[1], [0]])
    poses = (
        x,
        zero + y,
        zero,
        (of_user * away).astype(np.uint8),
        (of_user * posture).astype(np.int8),
    )
    bodies = Given(PoseBlock(*poses))
    result, first, sizes = [], 0, iter(cuts)
    while first < len(cm):
        end = encounters.limit(bodies, min(first + next(sizes, 5), len(cm)))
        assert first < end
        for row, event in encounters.interruptions(encounters.take(bodies, end)):
            assert 0 == row
            result.append((end - 1, event.event))
        assert end == encounters.next_step
        first = end
    moved = np.diff(robot, prepend=robot[0]) != 0
    columns = (abs(here - robot) / UNITS, moved, posture, away)
    assert twin([Seen(*step) for step in zip(*columns, strict=True)]) == result


_ACTORS = []


def _bodies():
    """Ana, who always reacts, and a robot; set up once."""
    if not _ACTORS:
        actors = simulation().actors
        _ACTORS.extend([actors["ana"], actors["astro"]])
    return _ACTORS[:1], _ACTORS[1:]


def test_nobody_is_watched_who_does_not_react():
    _, robots = _bodies()
    quiet = Simulation(scenario(users={"ana": {"type": "meander"}})).actors["ana"]
    encounters = Encounters([quiet], robots)
    assert [] == encounters.pairs
    assert not encounters.waits
    bodies = Given(PoseBlock(*np.zeros((5, 2, 17), np.int64)))
    assert 17 == encounters.limit(bodies, 17)
    assert () == encounters.take(bodies, 17)
