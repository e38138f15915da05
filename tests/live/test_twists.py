"""Speeds between two poses: of walks, turns, and on the way through stairs."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from tests.two_storeys import PLAN

import fleet2d
from fleet2d.kernels import Poses, sum_moves
from fleet2d.live.twists import twists


def speeds(tmp_path: Path, *moves: list[tuple[float, float, float]]) -> list[list[float]]:
    path = tmp_path / "house.json"
    path.write_text(json.dumps(PLAN))
    plan = fleet2d.load_floorplan(path)
    before, after = np.array(moves, np.float64).transpose(1, 0, 2)
    return np.round(twists(plan, before, after, 2.0), 3).tolist()


def test_speeds_are_those_of_the_frame_of_the_robot(tmp_path):
    found = speeds(
        tmp_path,
        [(1, 1, 0), (2, 1, 0)],
        [(1, 1, 0), (1, 2, math.pi / 2)],
        [(1, 1, math.pi), (2, 1, -math.pi + 0.2)],
        [(1, 1, 1), (1, 1, 1)],
    )

    assert found[0] == [0.5, 0.0, 0.0]
    assert found[1] == pytest.approx([0.5, 0.0, math.pi / 4], abs=1e-3)
    assert found[2] == pytest.approx([-0.5 * math.cos(0.2), 0.5 * math.sin(0.2), 0.1], abs=1e-3)
    assert found[3] == [0.0, 0.0, 0.0]


def test_stairs_have_no_length(tmp_path):
    """Their ends are 10 m apart in the plan, which was a speed of 5 m/s."""
    down, up = (0.5, 3.5, 0.0), (10.5, 3.5, 0.0)
    beyond = (9.0, 3.5, 0.0)

    found = speeds(tmp_path, [down, up], [up, down], [down, beyond])

    assert found[:2] == [[0.0, 0.0, 0.0]] * 2
    assert 0 < found[2][0] < 0.75


def test_a_walk_across_the_middle_between_the_ends_keeps_its_length(tmp_path):
    assert speeds(tmp_path, [(4.0, 1, 0), (5.0, 1, 0)]) == [[0.5, 0.0, 0.0]]


def test_a_move_is_as_long_as_metrics_have_it(tmp_path):
    path = tmp_path / "house.json"
    path.write_text(json.dumps(PLAN))
    plan = fleet2d.load_floorplan(path)
    draws = np.random.default_rng(4)
    ends = np.array([(0.5, 3.5), (10.5, 3.5)])
    before, after = (
        ends[draws.integers(2, size=200)] + draws.normal(0, 1.5, (200, 2)) for _ in range(2)
    )
    heading = np.zeros((200, 1))

    ahead, left, _ = twists(plan, np.hstack([before, heading]), np.hstack([after, heading]), 1.0).T

    unit = plan.lattice.units_per_m
    for number, move in enumerate(zip(before, after, strict=True)):
        x, y = plan.lattice.to_lattice(np.array(move)).T.copy()
        poses = Poses(x, y, np.zeros_like(x), np.zeros(2, np.uint8))
        length = sum_moves(poses, plan.portal_ends) / unit
        assert math.hypot(ahead[number], left[number]) == pytest.approx(length, abs=0.005)
