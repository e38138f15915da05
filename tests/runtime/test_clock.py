"""The clock: steps, moments and local times."""

from datetime import datetime, timedelta

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fleet2d.runtime.clock import Clock

START = datetime(2026, 3, 28, 23, 59, 59, 500_000)


def test_a_simulated_day_has_24_hours_also_when_clocks_are_changed():
    clock = Clock(START, 3_600_000_000, 48)
    assert datetime(2026, 3, 29, 23, 59, 59, 500_000) == clock.time(24)


def test_times_of_many_steps_are_those_of_each():
    clock = Clock(START, 333_333, 100)
    steps = np.array([0, 1, 7, 99])
    assert [clock.time(k) for k in steps.tolist()] == clock.times(steps).tolist()


def test_elapsed_is_exact_and_negative_before_the_start():
    clock = Clock(START, 1, 1)
    assert -500_000 == clock.elapsed(datetime(2026, 3, 28, 23, 59, 59))
    assert 1 == clock.elapsed(START + timedelta(microseconds=1))


@given(st.integers(0, 10**15), st.integers(1, 10**9))
def test_the_first_step_not_before_a_moment(moment, step_us):
    step = Clock(START, step_us, 1).step_at_or_after(moment)
    assert step * step_us >= moment
    assert (step - 1) * step_us < moment


def test_a_thousand_years_are_exact():
    clock = Clock(datetime(2026, 1, 1), 1_000_000, 365_250 * 86400)
    last = clock.time(clock.steps)
    assert 365_250 == (last - clock.start).days
    assert last == clock.times(np.array([clock.steps])).tolist()[0]
