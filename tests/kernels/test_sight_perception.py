"""The kernels of perception against slow twins, and at their ends."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.sight.watching import scene
from tests.strategies import quick

import fleet2d.kernels as k
from fleet2d import _core
from fleet2d.kernels import heading_of
from fleet2d.sight.camera import Camera, error_tables
from fleet2d.sight.perception import Perception

KEY = np.uint64(12345)
VECTOR = st.tuples(st.integers(-9000, 9000), st.integers(-9000, 9000))


def table_of(**perception):
    """Return the table of one camera that sees as far as 10 m."""
    lens = Camera(range=(0.0, 10.0), body_points=3).lens(1280, 10**6)
    return error_tables([lens], [Perception.model_validate(perception)], scene()).table


@quick
@given(st.lists(st.integers(0, k.ONE), max_size=6).map(sorted), st.integers(0, k.ONE - 1))
def test_pick_is_the_first_outcome_above_the_draw(sums, draw):
    expected = next((i for i, end in enumerate(sums) if draw < end), len(sums))
    assert expected == _core.pick(np.array(sums, np.int64), draw)


def test_random_shares_equal_single_draws_and_uniform():
    counters = np.arange(20_000)
    shares = k.random_shares(KEY, counters)
    assert [_core.random_share(KEY, i) for i in range(50)] == shares[:50].tolist()
    assert ((shares >= 0) & (shares < k.ONE)).all()
    counts = np.bincount(shares * 16 // k.ONE, minlength=16)
    assert ((counts - 1250) ** 2 / 1250).sum() < 44  # 15 degrees of freedom: 1 in 10,000


MEMORY = table_of(detection={"memory": "30 s"})


@quick
@given(st.integers(0, 10_000))
def test_lasting_is_the_exponential_of_the_steps(steps):
    assert math.exp(-steps / 30) == pytest.approx(
        _core.persistence_chance(MEMORY, 0, steps) / k.ONE, abs=1e-7
    )


@quick
@given(VECTOR)
def test_opposite_headings_differ_by_half_a_turn(vector):
    """So that one search for a heading tells both where a user is and where the camera is."""
    dx, dy = vector
    if (dx, dy) != (0, 0):
        assert (heading_of(dx, dy) + 2048) % 4096 == heading_of(-dx, -dy)


CURVES = {
    "distance": [[0, 1], [8, 0.5]], "bearing": [[-180, 0.5], [180, 1]],
    "orientation": [[0, 1], [180, 0.5]], "posture": {"sit": 0.8, "lie": 0.3},
    "visible_share": [[0, 0.2], [1, 1]],
}  # fmt: skip
BY_ALL = table_of(detection=CURVES)


@quick
@given(VECTOR, st.integers(0, 4095), st.integers(0, 4095), st.integers(0, 2), st.integers(1, 4))
def test_steady_chance_is_the_product_of_its_factors(vector, heading, faces, posture, shown):
    dx, dy = vector
    metres = math.hypot(dx, dy) / 1280
    towards = math.degrees(math.atan2(dy, dx))
    bearing = (towards - heading * 360 / 4096 + 180) % 360 - 180 if metres else 0.0
    away = abs((faces * 360 / 4096 - towards) % 360 - 180) if metres else 0.0
    expected = (
        np.interp(metres, [0, 8], [1, 0.5])
        * np.interp(bearing, [-180, 180], [0.5, 1])
        * np.interp(away, [0, 180], [1, 0.5])
        * (1, 0.8, 0.3)[posture]
        * (0.2 + 0.8 * shown / 4)
    )
    chance = _core.steady_chance(BY_ALL, 0, heading, dx, dy, faces, posture, shown)
    if abs(bearing) < 179.8:  # else the sides of the seam differ
        assert expected == pytest.approx(chance / k.ONE, abs=3e-3)


def test_notice_chance_is_the_product_in_its_unit_and_1_is_sure():
    sure = _core.notice_chance(k.ONE, k.ONE, 2**53)
    assert 2**53 == sure
    assert 2**53 * 3 // 16 == _core.notice_chance(k.ONE * 3 // 4, k.ONE // 2, 2**52)
    assert 0 == _core.notice_chance(0, k.ONE, 2**53)


@quick
@given(VECTOR)
def test_the_farthest_distances_share_the_last_bin(vector):
    table = BY_ALL
    assert 0 <= _core.distance_bin(table, 0, *vector) < k.BINS
    assert k.BINS - 1 == _core.distance_bin(table, 0, 10**6, 10**6)


@quick
@given(VECTOR, st.integers(-2000, 2000), st.integers(0, 9000))
def test_turn_and_stretch_equals_trigonometry(vector, turn, target_length):
    dx, dy = vector
    distance = _core.length(dx, dy)
    if distance >= 100:
        angle = math.atan2(dy, dx) + 2 * math.pi * turn / 8192
        x, y = _core.turn_and_stretch(dx, dy, turn, distance, target_length)
        scale = math.hypot(dx, dy) / distance * target_length
        assert (scale * math.cos(angle), scale * math.sin(angle)) == pytest.approx((x, y), abs=1.6)


def test_a_user_at_the_camera_and_one_without_noise_stay_where_they_are():
    keys = np.zeros((1, 3, len(k.UserDraw)), np.uint64)
    noisy = table_of(attributes={"range_noise": 0.5, "bearing_noise_deg": 20})
    assert (0, 0) == _core.perceived_offset(noisy, keys, 0, 0, 7, 0, 0)
    assert (300, -40) == _core.perceived_offset(table_of(), keys, 0, 0, 7, 300, -40)


def test_range_noise_never_puts_somebody_behind_the_camera():
    keys = np.full((1, 3, len(k.UserDraw)), 5, np.uint64)
    table = table_of(attributes={"range_noise": 3})
    places = [_core.perceived_offset(table, keys, 0, 0, step, 400, 0) for step in range(2000)]
    assert 0 == min(x for x, _ in places)
    assert {0} == {y for _, y in places}


def test_the_perceived_posture_follows_from_the_draw():
    table = table_of(attributes={"posture": {"sit": {"stand": 0.25, "lie": 0.25}}})
    quarter = k.ONE // 4
    draws = (0, quarter - 1, quarter, 3 * quarter - 1, 3 * quarter, k.ONE - 1)
    assert [0, 0, 1, 1, 2, 2] == [_core.perceived_posture(table, 0, 1, draw) for draw in draws]
    assert [2, 2] == [_core.perceived_posture(table, 0, 2, draw) for draw in (0, k.ONE - 1)]
