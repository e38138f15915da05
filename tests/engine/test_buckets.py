"""Poses of a span, and cameras that look at them together."""

from typing import Any

import numpy as np
import pytest
from fleet2d.engine.buckets import PoseBlock, look_together, new_memory
from tests.scenes import everything, scenario

import fleet2d
from fleet2d.engine import buckets


@pytest.mark.parametrize(
    ("actors", "capacity"), [(0, 1 << 17), (1, 1 << 17), (2, 1 << 16), (32, 4096), (10**4, 4096)]
)
def test_a_block_is_as_long_as_a_cache_allows_but_never_short(actors: int, capacity: int) -> None:
    assert capacity == max(buckets.LEAST_STEPS, buckets.BLOCK_VALUES // max(1, actors))
    if actors <= 32:
        assert capacity == PoseBlock([None] * actors).capacity  # type: ignore[list-item]


def test_rows_of_a_block_are_views_and_end_where_asked() -> None:
    block = PoseBlock([None] * 3)  # type: ignore[list-item]
    poses = block.row(1, 5)
    poses.x[:] = range(5)
    assert [0, 1, 2, 3, 4] == block.x[1, :5].tolist()
    assert 3 == block.state(1, 3).x
    crowd = block.crowd(slice(1, 3), 4)
    assert (2, 4) == crowd.x.shape == crowd.posture.shape
    assert [0, 1, 2, 3] == crowd.x[0].tolist()
    assert (0, 4) == block.crowd(slice(0, 0), 4).x.shape


class Posed:
    """A plan that knows postures only."""

    def __init__(self, postures: list[tuple[int, int]], posture: str = "stand") -> None:
        self.postures, self.posture = postures, posture

    def posture_at(self, times_us: Any) -> Any:
        begins = [time for time, _ in self.postures]
        codes = np.array([0, *(code for _, code in self.postures)], np.int8)
        return codes[np.searchsorted(begins, times_us, side="right")]


def test_postures_are_written_and_forgotten_when_a_plan_has_none() -> None:
    block = PoseBlock([None])  # type: ignore[list-item]
    block.take_postures(0, 10, 4, Posed([(12, 2)], "lie"), 1)  # type: ignore[arg-type]
    assert [0, 0, 2, 2] == block.posture[0, :4].tolist()
    block.take_postures(0, 14, 3, Posed([]), 1)  # type: ignore[arg-type]
    assert [0, 0, 0, 0] == block.posture[0, :4].tolist()


def test_a_robot_that_has_seen_nobody_remembers_nothing() -> None:
    memory = new_memory(2, 3, 5)
    assert [-1] * 4 == memory.noticed.tolist()
    assert not memory.seen.any()
    assert (2, 5) == memory.backlog.shape[:2]
    assert not memory.waiting.any()


class Glance:
    """A camera that stops after so many steps, and remembers how many it has looked at."""

    def __init__(self, stops: int) -> None:
        self.stops = stops
        self.memory = (np.zeros(1, np.int64),)

    def look(self, block: object, first: int, count: int) -> int:
        done = min(self.stops, count)
        self.memory[0][0] += done
        return done


@pytest.mark.parametrize(
    "stops", [[9], [9, 9], [3, 9], [9, 3], [9, 5, 3], [3, 5, 9], [5, 3, 5, 1, 9]]
)
def test_cameras_that_look_together_have_looked_at_the_same_steps(stops: list[int]) -> None:
    eyes = [Glance(stop) for stop in stops]
    done = look_together(eyes, None, 0, 9)  # type: ignore[arg-type]
    assert min(stops) == done
    assert [done] * len(eyes) == [int(eye.memory[0][0]) for eye in eyes]


def test_every_draw_of_every_camera_has_a_stream_of_its_own() -> None:
    content = everything("1 min")
    robot = content["robots"]["astro"]
    robot["cameras"] = {"left": robot.pop("camera"), "right": {}}
    robot["perception"] = {"false_positives": {"per_hour": 1}, "attributes": {"activity": {}}}
    content["robots"]["curio"]["perception"] = robot["perception"]
    simulation = fleet2d.Simulation(content)
    keys: list[int] = []
    for eye in simulation._world.eyes:
        used = eye.errors.keys if eye.errs else eye.errors.keys[..., :1]
        keys += used.ravel().tolist() + eye.errors.ghost_keys.ravel().tolist()
        keys += [key for sense in eye.activity_senses for key in sense.keys.tolist()]
    assert len(keys) > 80
    assert len(set(keys)) == len(keys)


def test_a_run_without_users_or_without_robots_has_no_eyes() -> None:
    assert not fleet2d.Simulation(scenario(robots={"r": {}}))._world.eyes
    assert not fleet2d.Simulation(scenario(users={"ana": {}}))._world.eyes
