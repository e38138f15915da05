"""Robustness beside rtamt, the library for signal temporal logic, on random signals."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.expectations.test_temporal import dense, known_of
from tests.thorough import examples

from fleet2d.expectations import (
    always,
    at_end,
    eventually,
    holds_for,
    metric,
    once,
    since,
    until,
)  # fmt: skip

rtamt = pytest.importorskip("rtamt", reason="pip install rtamt: it is only compared with")

STEPS = 24
X, Y = metric("x"), metric("y")
# The formula of rtamt, the same here, and how many steps it looks ahead.
FORMULAS = [
    ("x >= 0.5", X >= 0.5, 0),
    ("(x >= 0.5) or (y <= 1)", (X >= 0.5) | (Y <= 1), 0),
    ("x >= y", X >= Y, 0),
    ("x - y <= 1", X - Y <= 1, 0),
    ("always[2:6](x >= 0.5)", always(X >= 0.5, within="2..6 s"), 6),
    ("eventually[2:6](x >= 0.5)", eventually(X >= 0.5, within="2..6 s"), 6),
    ("(x >= 0.5) until[2:5] (y >= 1)", until(X >= 0.5, Y >= 1, within="2..5 s"), 5),
    ("once[2:5](x >= 0.5)", once(X >= 0.5, within="2..5 s"), 0),
    ("(x >= 0.5) since (y >= 1)", since(X >= 0.5, Y >= 1), 0),
    ("(x >= 0.5) since[1:4] (y >= 1)", since(X >= 0.5, Y >= 1, within="1..4 s"), 0),
    (
        "always[0:3](eventually[0:2](x >= 0.5))",
        always(eventually(X >= 0.5, within="2 s"), within="3 s"),
        5,
    ),
]
signals = st.lists(
    st.floats(-3, 3, allow_nan=False).map(lambda value: round(value, 2)),
    min_size=STEPS, max_size=STEPS,
)  # fmt: skip


@cache
def specification_of(formula):
    specification = rtamt.StlDiscreteTimeSpecification()
    for name in ("x", "y", "out"):
        specification.declare_var(name, "float")
    specification.spec = f"out = {formula}"
    specification.parse()
    return specification


def theirs(formula, x, y):
    content = {"time": list(range(STEPS)), "x": x, "y": y}
    return np.array([value for _, value in specification_of(formula).evaluate(content)])


@pytest.mark.parametrize(
    ("formula", "expectation", "ahead"), FORMULAS, ids=[f[0] for f in FORMULAS]
)
@settings(max_examples=examples(25), deadline=None)
@given(x=signals, y=signals)
def test_robustness_equals_that_of_rtamt(formula, expectation, ahead, x, y):
    known = known_of({"x": x, "y": y}, STEPS, over=True)
    ours = np.array(dense(expectation.robustness(known, True)))

    # Near the end rtamt cuts windows; here the rest of a window is unknown.
    count = STEPS - ahead
    np.testing.assert_allclose(theirs(formula, x, y)[:count], ours[:count], atol=1e-12)


@given(x=signals)
def test_holds_for_is_historically(x):
    known = known_of({"x": x}, STEPS, over=True)
    ours = np.array(dense(holds_for(X >= 0.5, "3 s").robustness(known, True)))

    np.testing.assert_allclose(
        theirs("historically[0:3](x >= 0.5)", x, x)[3:], ours[3:], atol=1e-12
    )
    assert (ours[:3] == -np.inf).all(), "before that it hasn't held so long"
    assert at_end(X >= 0.5).robustness(known, True).at(0) == pytest.approx(x[-1] - 0.5)
