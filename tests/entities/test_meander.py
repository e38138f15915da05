"""Meander: the random walk."""

from typing import Any

import numpy as np
import pytest

from tests.scenes import OWN, path, run, scenario


def walker(duration: str = "30 min", step: str = "1 s", **fields: Any) -> dict[str, Any]:
    content = scenario(duration, users={"ben": {"type": "meander", **fields}}, simulation={"step": step})
    content["artifacts"] = {"trajectories": "off"}
    return content


def turns_deg(heading: np.ndarray) -> np.ndarray:
    return np.rad2deg((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi)


def test_a_step_is_as_long_as_the_speed_says_or_nothing() -> None:
    poses = path(run(walker(speed=0.8)), "ben")
    moves = np.hypot(np.diff(poses.x), np.diff(poses.y))
    free = moves > 0
    assert moves[free] == pytest.approx(0.8, abs=2e-3)
    assert 0.02 < free.mean() < 1


def test_turns_have_the_standard_deviation_asked_for() -> None:
    heading = path(run(walker("2 h", turn_std_deg=20, turn_rate_deg=3600)), "ben").heading
    turns = turns_deg(heading)
    assert turns.std() == pytest.approx(20, rel=0.04)
    assert abs(turns.mean()) < 1


def test_the_spread_does_not_depend_on_the_step() -> None:
    fine = path(run(walker("2 h", "250 ms", turn_std_deg=20, turn_rate_deg=3600)), "ben").heading
    assert turns_deg(fine).std() == pytest.approx(20 * 0.5, rel=0.04)


def test_turns_keep_to_the_turn_rate() -> None:
    turns = turns_deg(path(run(walker(turn_std_deg=90, turn_rate_deg=30)), "ben").heading)
    assert np.abs(turns).max() <= 30
    assert np.abs(turns).max() > 29


def test_without_spread_it_walks_straight_on() -> None:
    heading = path(run(walker(turn_std_deg=0)), "ben").heading
    assert 1 == len(set(heading.tolist()))


def test_it_gets_everywhere() -> None:
    poses = path(run(walker("8 h")), "ben")
    assert {0, 1, 2, 3} <= set(poses.room.tolist())
    assert 4 not in poses.room


def test_it_goes_on_from_where_another_behavior_left_it() -> None:
    content = walker()
    content["users"]["ben"] = {
        "behaviors": [{"type": f"{OWN}:Scripted", "script": [(7.0, 6.0), 30]}, {"type": "meander"}]
    }
    poses = path(run(content), "ben")
    at = next(k for k in range(len(poses.x)) if abs(poses.x[k] - 7) + abs(poses.y[k] - 6) < 1e-3)
    left = next(k for k in range(at, len(poses.x)) if poses.x[k] != poses.x[at])
    assert 30 <= left - at <= 35
    assert np.hypot(np.diff(poses.x), np.diff(poses.y)).max() < 1.01
