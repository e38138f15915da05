"""What expectations are worth, and when they are violated, against a twin that goes step by step."""

import operator
from datetime import datetime, timedelta
from itertools import groupby

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.reference.expectations import robustness
from tests.thorough import examples

from fleet2d.expectations import (
    after,
    always,
    at_most,
    during,
    events,
    eventually,
    holds_for,
    implies,
    metric,
    moving,
    never,
    once,
    since,
    until,
)
from fleet2d.expectations.expectation import RunSignals, Trace
from fleet2d.expectations.verdict import verdict_of
from fleet2d.runtime.clock import Clock


def seconds(limit):
    """Return a limit in steps of a second as one of an expectation."""
    if isinstance(limit, tuple):
        return tuple(map(seconds, limit))
    return None if limit is None else timedelta(seconds=limit)


CLOCK = Clock(datetime(2026, 1, 5), 1_000_000, 1000)


def within(build):
    """What builds an expectation of a window that is given in steps."""
    return lambda *parts: build(*parts[:-1], within=seconds(parts[-1]))


BUILD = {
    "is": moving,
    "above": lambda name, limit: metric(name) > limit,
    "less": lambda one, other: metric(one) < metric(other),
    "not": operator.invert,
    "and": operator.and_,
    "or": operator.or_,
    "implies": implies,
    "holds_for": lambda part, steps: holds_for(part, f"{steps} s"),
    "once": within(once),
    "since": within(since),
    "always": within(always),
    "eventually": within(eventually),
    "until": within(until),
    "after": within(after),
}
atoms = st.sampled_from(
    [("is", "a"), ("is", "b"), ("above", "x", 0.5), ("above", "y", -0.5), ("less", "x", "y")]
)
some = st.integers(0, 6)
limit = st.none() | some | st.tuples(some, some).map(lambda pair: tuple(sorted(pair)))
formulas = st.recursive(
    atoms,
    lambda part: st.one_of(
        st.tuples(st.just("not"), part),
        st.tuples(st.sampled_from(["and", "or", "implies"]), part, part),
        st.tuples(st.sampled_from(["always", "eventually", "once"]), part, limit),
        st.tuples(st.sampled_from(["until", "since", "after"]), part, part, limit),
        st.tuples(st.just("holds_for"), part, st.integers(1, 4)),
    ),
    max_leaves=4,
)
truths = st.lists(st.integers(0, 1), min_size=14, max_size=14)
numbers = st.lists(st.sampled_from([-2.0, -1.0, 0.0, 1.0, 2.0]), min_size=14, max_size=14)


def built(formula):
    """Return a formula of the twin as an expectation."""
    if not isinstance(formula, tuple) or isinstance(formula[0], int):
        return formula
    word, *parts = formula
    if word in ("above", "less"):
        return BUILD[word](*parts)
    names = [p if isinstance(p, str) or not isinstance(p, tuple) else built(p) for p in parts]
    return BUILD[word](*names)


def trace_of(values, end):
    array = np.array(values[:end], np.float64)
    is_first = np.append(True, array[1:] != array[:-1])
    return Trace(np.flatnonzero(is_first), array[is_first], end)


def known_of(signals, end, *, over):
    names = {"a": moving("a"), "b": moving("b"), "x": metric("x"), "y": metric("y")}
    traces = {str(names[name]): trace_of(v, end) for name, v in signals.items() if name in names}
    return RunSignals(traces, {}, 0, end, over, CLOCK)


def dense(trace):
    return np.repeat(trace.value, np.diff(np.append(trace.start, trace.end))).tolist()


@settings(max_examples=examples(200))
@given(formulas, truths, truths, numbers, numbers, st.integers(1, 14), st.booleans(), st.booleans())
def test_the_robustness_of_each_step_equals_the_reference(formula, a, b, x, y, end, over, high):
    signals = {"a": a, "b": b, "x": x, "y": y}
    expected = [
        robustness(formula, signals, step, end, over=over, high=high) for step in range(end)
    ]
    known = known_of(signals, end, over=over)
    assert expected == dense(built(formula).robustness(known, high))


def violated(expectation, signals):
    known = known_of(signals, 14, over=True)
    return [(v.first, v.last) for v in verdict_of("", expectation, known).violations]


@given(numbers)
def test_violations_are_the_longest_stretches_that_fail(x):
    stretches = groupby(range(14), lambda step: x[step] > 0)
    steps = [list(steps) for holds, steps in stretches if not holds]
    expected = [(stretch[0], stretch[-1]) for stretch in steps]

    assert expected == violated(always(metric("x") > 0), {"x": x})
    assert expected == violated(never(~(metric("x") > 0)), {"x": x})


def test_a_signal_on_its_limit_is_on_the_side_of_the_comparison():
    known = known_of({"x": [1.0] * 14}, 14, over=True)

    assert verdict_of("", always(metric("x") >= 1), known).holds
    assert not verdict_of("", always(metric("x") > 1), known).holds
    assert verdict_of("", always(metric("x") > 1), known).content()["robustness"] == 0


def test_a_missing_value_is_on_neither_side():
    known = known_of({"x": [float("nan"), *[1.0] * 13]}, 14, over=True)

    assert verdict_of("", always(metric("x") > 0), known).violations[0][:2] == (0, 0)
    assert verdict_of("", never(metric("x") < 0), known).holds


def test_after_names_each_occasion_that_was_missed_and_by_how_much():
    a, b = [0] * 14, [0] * 14
    a[1] = a[5] = 1
    b[2] = 1
    expectation = after(moving("a"), moving("b"), within="3 s")
    verdict = verdict_of("", expectation, known_of({"a": a, "b": b}, 14, over=True))

    assert [(v.first, v.last) for v in verdict.violations] == [(5, 8)]
    assert (verdict.occasions, verdict.slack_s) == (2, -6.0)
    b[7] = 1
    verdict = verdict_of("", expectation, known_of({"a": a, "b": b}, 14, over=True))
    assert (verdict.holds, verdict.slack_s) == (True, 1.0)


def test_occasions_cut_by_the_end_of_the_run_do_not_count():
    a = [0] * 12 + [1, 0]
    expectation = after(moving("a"), moving("b"), within="3 s")
    verdict = verdict_of("", expectation, known_of({"a": a, "b": [0] * 14}, 14, over=True))

    assert (verdict.holds, verdict.slack_s, verdict.occasions) == (None, None, 0)
    assert verdict.untested == "its trigger came only too near to the end"
    assert str(verdict).endswith("is untested: its trigger came only too near to the end")
    whole = after(moving("a"), moving("b"), within="1 s")
    verdict = verdict_of("", whole, known_of({"a": a, "b": [0] * 13 + [1]}, 14, over=True))
    assert (verdict.holds, verdict.occasions) == (True, 1)


def test_an_expectation_is_decided_as_soon_as_nothing_can_change_it():
    b = [0, 0, 0, 1] + [0] * 10
    expectation = eventually(moving("b"), within="5 s")

    def at(end):
        verdict = verdict_of("", expectation, known_of({"b": b}, end, over=False))
        return verdict.holds, verdict.decided

    assert [at(3), at(4)] == [(True, False), (True, True)]
    b[3] = 0
    assert [at(5), at(6)] == [(True, False), (False, True)]


@pytest.mark.parametrize(("times", "holds"), [(2, False), (3, True)])
def test_at_most_counts_each_event_of_an_hour(times, holds):
    steps = [0, 1, 1, 5000, 7300]
    counts = [float(steps.count(step)) for step in range(8000)]
    expectation = at_most(times, events("calls"), per="hour")
    known = RunSignals({str(events("calls")): trace_of(counts, 8000)}, {}, 0, 8000, True, CLOCK)
    verdict = verdict_of("", expectation, known)

    assert verdict.holds is holds
    if not holds:
        first, last, worst, _ = verdict.violations[0]
        assert (first, last, worst) == (1, timedelta(hours=1).seconds - 1, -1.0)


@pytest.mark.parametrize("condition", [during("00:00-24:00"), during("00:00-24:00") | moving("a")])
def test_each_event_counts_by_itself_under_a_condition_too(condition):
    """Those of neighbouring steps, and several at one step, counted once."""
    steps = [10, 11, 11, 12, 600]
    counts = trace_of([float(steps.count(step)) for step in range(1000)], 1000)
    signals = {str(events("calls")): counts, str(moving("a")): trace_of([0.0] * 1000, 1000)}
    known = RunSignals(signals, {}, 0, 1000, True, CLOCK)

    assert [10, 11, 11, 12, 600] == (events("calls") & condition).occasions(known).tolist()
    assert not verdict_of("", at_most(4, condition & events("calls")), known).holds
    assert not verdict_of("", at_most(9, events("calls") | events("calls")), known).holds


@pytest.mark.parametrize(
    "expectation",
    [
        at_most(0, moving("a") & during("03:00-04:00")),
        never(holds_for(moving("a") & during("03:00-04:00"), "1 min")),
        never(moving("a") & during("00:00-00:01"), within=("2 min", "4 min")),
    ],
)
def test_hours_that_the_run_never_reaches_leave_what_is_in_them_untested(expectation):
    known = RunSignals({str(moving("a")): trace_of([1.0] * 1000, 1000)}, {}, 0, 1000, True, CLOCK)

    verdict = verdict_of("", expectation, known)
    assert verdict.holds is None
    assert "never came" in verdict.untested
