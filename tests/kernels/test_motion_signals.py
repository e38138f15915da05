"""Signals as stretches of equal value, against twins that go step by step."""

from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.kernels.scenes import breakpoints, following
from tests.reference import signals as slow

from fleet2d.kernels import (
    distances_between,
    distances_to_shape,
    sliding_max,
    speeds,
    until,
)

STEP_US = 1000
STEPS = 24
spot = st.integers(0, 40)
track = st.lists(st.tuples(st.integers(1, 6), spot, spot, st.booleans()), min_size=1, max_size=5)
bodies = st.lists(track, min_size=2, max_size=2)
value = st.sampled_from([-inf, -2.0, -1.0, 0.0, 1.0, 2.0, inf])
values = st.lists(value, min_size=1, max_size=14)


def timelines_of(tracks):
    rows = []
    for legs in tracks:
        times = np.cumsum([0, *(leg[0] for leg in legs[1:])]).tolist()
        moved = zip(times, legs, strict=True)
        rows.append([(time * STEP_US, x, y, 0, away) for time, (_, x, y, away) in moved])
    return following(list(map(breakpoints, rows)), STEP_US)


def poses_of(window, body):
    x, y, _, away, _ = window.dense(body, window.first, window.end)
    rows = zip(x.tolist(), y.tolist(), away.tolist(), strict=True)
    return [(x, y, bool(away)) for x, y, away in rows]


def dense(stretches, end=STEPS):
    start, numbers = stretches
    assert (numbers[1:] != numbers[:-1]).all(), "neighbours differ"
    return np.repeat(numbers, np.diff(np.append(start, end))).tolist()


def stretches(numbers):
    array = np.array(numbers)
    is_first = np.append(True, array[1:] != array[:-1])
    return np.flatnonzero(is_first), array[is_first]


@given(bodies)
def test_distances_between_bodies_equal_each_step(tracks):
    window = timelines_of(tracks).window(0, STEPS)
    pairs = zip(poses_of(window, 0), poses_of(window, 1), strict=True)
    assert [slow.distance(*pair) for pair in pairs] == dense(distances_between(window, 0, 1))


@given(bodies, st.lists(st.tuples(spot, spot, spot, spot), max_size=4))
def test_distances_to_a_shape_equal_each_step(tracks, boxes):
    edges = [
        edge
        for x0, y0, x1, y1 in boxes
        for edge in ((x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0))
    ]
    window = timelines_of(tracks).window(0, STEPS)
    expected = [slow.distance_to_shape(pose, edges) for pose in poses_of(window, 0)]
    rows = np.array(edges, np.int64).reshape(-1, 4)
    assert dense(distances_to_shape(window, 0, rows)) == pytest.approx(expected)


portals = st.lists(st.tuples(spot, spot, spot, spot, st.integers(0, 9)), max_size=2)


@given(bodies, st.integers(1, STEPS - 1), portals)
def test_speeds_go_on_from_window_to_window(tracks, cut, links):
    timelines = timelines_of(tracks)
    poses = poses_of(timelines.window(0, STEPS), 0)
    x, y, away = poses[cut - 1]
    nothing = np.zeros(0, np.int64)
    rows = np.array(links, np.int64).reshape(-1, 5)
    first = speeds(timelines.window(0, cut), 0, nothing, rows)
    second = speeds(timelines.window(cut, STEPS), 0, np.array([x, y, away], np.int64), rows)
    together = dense(first, cut) + dense((second[0] - cut, second[1]), STEPS - cut)
    assert [slow.speed(poses, step, links) for step in range(STEPS)] == together


@given(values, st.integers(-6, 6), st.integers(0, 9), value, value)
def test_the_greatest_value_of_a_window_equals_its_steps(numbers, low, length, before, after):
    expected = slow.sliding_max(numbers, low, low + length, before, after)
    result = sliding_max(*stretches(numbers), len(numbers), low, low + length, before, after)
    assert expected == dense(result, len(numbers))


@given(st.lists(st.tuples(value, value), min_size=1, max_size=12), value)
def test_until_is_the_best_of_all_steps_to_wait_for(pairs, after):
    hold, goal = ([pair[i] for pair in pairs] for i in (0, 1))
    steps = np.arange(len(pairs))
    result = until(steps, np.array(hold), np.array(goal), after)
    assert slow.until(hold, goal, after) == dense(result, len(pairs))
