"""Habits: transitions by the hour lead to the shares of time of that hour."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fleet2d.algorithms.presence.chain_model import ChainHabits, steps_of
from fleet2d.kernels import StayModel

PLACES = 4


def model(seed, stages=1):
    """Somebody who goes on reversibly: from i to j with a chance in proportion to sqrt(p_j / p_i)."""
    random = np.random.default_rng(seed)
    p, pull = random.dirichlet(np.full(PLACES, 3.0)), random.random((PLACES, PLACES)) * 0.01
    leave = (pull + pull.T) * np.sqrt(p / p[:, None])
    np.fill_diagonal(leave, 0)
    leave = np.repeat(leave, stages, axis=0)
    onward = np.zeros((len(leave), 1))
    chance = leave.sum(axis=1)
    follow = np.concatenate([leave / chance[:, None], onward], axis=1)
    first = np.arange(PLACES + 1, dtype=np.uint64)
    spread, restless = np.ones(PLACES), np.zeros(PLACES)
    return StayModel(1 - chance, follow, spread, restless, first, 0.9)


def habits(seed, smoothing=0.0):
    """Hours of working days and weekends with shares of their own, of four weeks."""
    random = np.random.default_rng([seed, 1])
    p = stationary(model(seed))
    hours = random.dirichlet(p * 20, 168) * 240
    week = np.concatenate([hours, np.full((168, 1), 240.0)], axis=1)
    return ChainHabits(week, np.append(p * 240 * 168, 240.0 * 168), smoothing)


def stationary(of):
    return np.linalg.matrix_power(steps_of(of), 1 << 24)[0]


@given(st.integers(0, 500), st.integers(0, 6), st.integers(0, 23))
def test_without_evidence_the_filter_converges_to_the_shares_of_the_hour(seed, weekday, hour):
    of, known = model(seed), habits(seed)
    now = known.at(of, weekday, [hour])[0]
    days = known.week.reshape(7, 24, -1)[:, hour]
    expected = (days[:5] if weekday < 5 else days[5:]).sum(axis=0)
    drawn = expected[:-1] / expected[-1] / stationary(of)
    if drawn.min() > 1 / 19 and drawn.max() < 19 and now.stay.min() > 0.5:
        assert np.abs(stationary(now) - expected[:-1] / expected[-1]).max() < 1e-6
    assert np.abs(now.follow.sum(axis=1) - 1).max() < 1e-9
    assert (now.stay >= 0.5 - 1e-12).all()


def test_hours_that_are_alike_change_nothing():
    of, known = model(1), habits(1)
    same = known._replace(week=np.tile(known.total / 168, (168, 1)))
    now = same.at(of, 2, [12])[0]
    for part, before in zip(now, of, strict=True):
        assert np.abs(part - before).max() < 1e-9 if np.ndim(part) else part == before


def test_on_the_first_day_nothing_is_known_of_hours():
    of, known = model(2), habits(2)
    assert of is known._replace(total=known.total / known.total[-1] * 1439).at(of, 0, [0])[0]


def test_rates_of_an_hour_without_transitions_are_bounded():
    of, known = model(4), habits(4)
    week = known.week.copy()
    week[:, :-1] = 0
    week[:, 1] = 240
    now = known._replace(week=week).at(of, 3, [3])[0]
    assert np.isfinite(now.follow).all()
    assert stationary(now)[1] > 0.9
