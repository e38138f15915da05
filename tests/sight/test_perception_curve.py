"""Curves against their definitions in exact arithmetic."""

from decimal import Decimal
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from tests.strategies import quick

from fleet2d.kernels import ONE
from fleet2d.sight.perception import Curve, chance, cumulative, decay

SHARE = st.floats(0, 1)
PLACES = st.lists(st.floats(-50, 50), min_size=1, max_size=6, unique=True).map(sorted)


def line(rows, x):
    """Return a table's value at x: level outside, straight between two rows."""
    if x <= rows[0][0]:
        return Fraction(rows[0][1])
    for (x0, y0), (x1, y1) in pairwise(rows):
        if x < x1:
            part = (Fraction(x) - Fraction(x0)) / (Fraction(x1) - Fraction(x0))
            return Fraction(y0) + (Fraction(y1) - Fraction(y0)) * part
    return Fraction(rows[-1][1])


@quick
@given(PLACES, st.data())
def test_a_table_is_straight_between_its_rows_and_level_outside(places, data):
    rows = [(x, data.draw(SHARE)) for x in places]
    curve = Curve.model_validate(rows)
    for x in [*places, *data.draw(st.lists(st.floats(-60, 60), max_size=8))]:
        assert float(line(rows, x)) == pytest.approx(curve.at(x), abs=1e-9)


@quick
@given(st.floats(-20, 20), st.floats(0.01, 5), SHARE, st.floats(-30, 30))
def test_a_logistic_equals_its_formula(midpoint, width, top, x):
    values = Curve(midpoint=midpoint, width=width, top=top).at(x)
    step = (Decimal(x) - Decimal(midpoint)) / Decimal(width)
    expected = Decimal(top) / (1 + step.exp()) if step < 200 else Decimal(0)
    assert float(expected) == pytest.approx(values, abs=1e-12)


def test_a_number_is_the_same_everywhere_and_may_be_a_percentage():
    assert [0.3, 0.3, 0.3] == [Curve.model_validate(0.3).at(x) for x in (-9, 0, 9)]
    assert 0.3 == Curve.model_validate("30 %").at(0)


def test_two_rows_of_no_width_are_no_table():
    with pytest.raises(ValidationError, match="must ascend"):
        Curve.model_validate([[1, 0.2], [1, 0.9]])


@pytest.mark.parametrize(
    "data", [[], {}, {"midpoint": 3}, {"width": 1}, {"points": [[0, 1]], "midpoint": 1, "width": 1}]
)
def test_curves_that_are_neither_tables_nor_logistic_are_refused(data):
    with pytest.raises(ValidationError):
        Curve.model_validate(data)


@pytest.mark.parametrize(
    "form", [0.25, [[0, 1], [4, 0.5]], {"midpoint": 3, "width": 0.5, "top": 0.9}]
)
def test_a_curve_is_written_as_it_can_be_read(form):
    curve = Curve.model_validate(form)
    assert curve == Curve.model_validate(curve.model_dump(mode="json"))


def test_chances_are_shares_of_2_to_the_31():
    assert [0, ONE // 2, ONE] == Curve.model_validate([[0, 0], [2, 1]]).chances([-1, 1, 5]).tolist()
    assert ONE == chance(1.0)


def test_a_daily_curve_is_periodic():
    """Light at 23:30 and at 0:30 lies on the straight line from the last row to the first."""
    day = Curve.model_validate([[6, 0.2], [18, 1.0]]).around_the_clock()
    assert [0.6, 0.6] == pytest.approx([day.at(0), day.at(12)])
    assert day.at(23.5) == pytest.approx(day.at(-0.5))
    assert 1.0 == day.at(18)


def test_rows_at_both_ends_of_the_day_make_it_jump_at_midnight():
    day = Curve.model_validate([[0, 0], [24, 1]]).around_the_clock()
    assert [0.5, 0.999, 0.001] == pytest.approx([day.at(12), day.at(23.976), day.at(0.024)])


def test_a_single_row_is_used_all_day():
    assert 0.4 == Curve.model_validate([[12, 0.4]]).around_the_clock().at(3)


def test_decay_halves_at_the_half_life_and_ends_at_0():
    assert np.exp(-0.7) == pytest.approx(decay(Decimal("0.7")), rel=1e-15)
    assert 0 == chance(decay(Decimal(10**9)))


@quick
@given(st.dictionaries(st.sampled_from("abcd"), st.floats(0, 0.25)))
def test_cumulative_probabilities_ascend_to_their_sum(weights):
    sums = cumulative(weights, "abcd")
    assert sorted(sums) == sums
    assert sums[-1] == pytest.approx(sum(weights.values()) * ONE, abs=1)
