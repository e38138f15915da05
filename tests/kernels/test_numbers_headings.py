"""Headings against sines to sixty digits: neither libm nor rounding may show."""

import hashlib
from decimal import ROUND_HALF_EVEN, Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.reference import headings as slow
from tests.strategies import quick

from fleet2d._core import SINES
from fleet2d.kernels import (
    HALF_TURN,
    QUARTER,
    TURN,
    UNIT,
    cosine,
    half_sine,
    half_sines,
    heading_of,
    sine,
    turn_between,
    turned,
)

# Two libms differ by an ulp of the sine, times UNIT: 2**-53 * 2**30.
LIBM_ERROR = 2.0**-22


def test_sines_are_pinned():
    expected = "4c0e1da65ba03734026be97f8d3655689f8a33259be2b868f3f7511f9c5e3b28"

    assert (np.int64, (2 * QUARTER + 1,)) == (SINES.dtype, SINES.shape)
    assert expected == hashlib.sha256(SINES.astype("<i8").tobytes()).hexdigest()


def test_sines_are_rounded_to_nearest_and_no_libm_can_disagree():
    """No sine comes so near to the middle between two integers that an ulp would matter."""
    nearest_to_tie = 1.0
    for part in range(2 * QUARTER + 1):
        scaled = slow.sine(part) * UNIT
        rounded = scaled.to_integral_value(ROUND_HALF_EVEN)
        nearest_to_tie = min(nearest_to_tie, 0.5 - abs(float(scaled - rounded)))

        assert int(rounded) == SINES[part]

    assert nearest_to_tie > 100 * LIBM_ERROR


@pytest.mark.parametrize("shift", [0, 2 * TURN, -2 * TURN, 10 * TURN])
def test_half_sine_goes_round_the_whole_turn(shift):
    for part in range(0, 2 * TURN, 37):
        assert abs(int(half_sine(part + shift)) - slow.sine(part) * UNIT) <= Decimal("0.5")


@pytest.mark.parametrize("heading", [0, 1, 1023, 1024, 1025, 2048, 3071, 3072, 4095, -1, 5000])
def test_sine_and_cosine_equal_the_heading(heading):
    exact = slow.sine(2 * heading) * UNIT, slow.cosine(2 * heading) * UNIT

    assert abs(int(sine(heading)) - exact[0]) <= Decimal("0.5")
    assert abs(int(cosine(heading)) - exact[1]) <= Decimal("0.5")


@pytest.mark.parametrize(
    ("dx", "dy", "expected"),
    [
        (0, 0, 0),
        (2**20, -1, 0),
        (1, 2**20, 1024),
        (-(2**20), -1, 2048),
        (2**31, 2**31, 512),
        (2**31, -(2**31), 3584),
    ],
)
def test_heading_of_known_directions(dx, dy, expected):
    assert expected == heading_of(dx, dy)


def test_heading_of_small_vectors_is_the_nearest():
    reach = 12
    for dx in range(-reach, reach + 1):
        for dy in range(-reach, reach + 1):
            if dx or dy:
                assert {int(heading_of(dx, dy))} == slow.nearest_headings(dx, dy)


@quick
@given(st.integers(-(2**20), 2**20), st.integers(-(2**20), 2**20))
def test_heading_of_large_vectors_is_the_nearest(dx, dy):
    if dx == 0 and dy == 0:
        return
    assert {int(heading_of(dx, dy))} == slow.nearest_headings(dx, dy)


def test_heading_of_vectors_near_a_boundary_is_the_nearest():
    """The hardest vectors: up to 700 units long, all but in the middle between two headings."""
    rng = np.random.default_rng(5)
    for part in 2 * rng.integers(0, TURN, 60) + 1:
        c, s = float(slow.cosine(int(part))), float(slow.sine(int(part)))
        length = float(rng.integers(100, 700))
        x, y = round(length * c), round(length * s)
        around = [(x + i, y + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        dx, dy = min(around, key=lambda v: abs(v[0] * s - v[1] * c))

        assert {int(heading_of(dx, dy))} == slow.nearest_headings(dx, dy)


def test_no_lattice_vector_lies_right_between_two_headings():
    """So no tie is ever broken: the smallest such vector would be longer than any plan."""
    for part in range(1, 2 * TURN, 2):
        c, s = int(half_sine(part + 2 * QUARTER)), int(half_sine(part))

        assert max(abs(c), abs(s)) // np.gcd(c, s) > 2**15


@given(st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6))
def test_turn_between_leads_from_start_to_end(start, end):
    turn = int(turn_between(start, end))

    assert -HALF_TURN <= turn < HALF_TURN
    assert (start + turn - end) % TURN == 0


def test_the_table_of_a_whole_turn_has_the_sine_of_each_angle():
    assert [int(half_sine(i)) for i in range(2 * TURN)] == half_sines().tolist()


@quick
@given(st.integers(-(2**31), 2**31), st.integers(-(2**31), 2**31), st.integers(-9000, 9000))
def test_turned_points_are_the_nearest_to_the_exact_ones(x, y, angle):
    columns = (np.array([value], np.int64) for value in (x, y, angle))
    new_x, new_y = (int(column[0]) for column in turned(*columns))
    along, up = int(half_sine(angle + 2 * QUARTER)), int(half_sine(angle))
    assert abs(2 * (x * along - y * up - new_x * UNIT)) <= UNIT
    assert abs(2 * (x * up + y * along - new_y * UNIT)) <= UNIT
