"""Distances and scores: against slow twins, and what must hold of each."""

import math
import tracemalloc
from datetime import datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from tests.reference import presence as slow

from fleet2d.algorithms.presence.estimator import natural_log
from fleet2d.metrics.ltp_error import (
    earth_mover,
    jensen_shannon,
    kl_divergence,
    rank_correlation,
    room_gaps,
    steps_by_hour,
    steps_in_places,
    total_variation,
)
from fleet2d.metrics.rtp_score import (
    brier_score,
    calibration_error,
    classwise_error,
    groups_of,
    log_loss,
    murphy,
    reliability_curve,
    sharpness,
    skill,
    top_k,
)
from fleet2d.runtime.local_time import zone_of

weights = st.lists(st.integers(0, 20), min_size=1, max_size=9).filter(any)


@st.composite
def two(draw):
    """Two distributions over as many rooms."""
    one = draw(weights)
    other = draw(st.lists(st.integers(0, 20), min_size=len(one), max_size=len(one)).filter(any))
    return np.array(one) / sum(one), np.array(other) / sum(other)


@given(st.floats(1e-300, 1e300))
def test_logarithms_equal_the_library_to_the_last_digits(x):
    assert math.log(x) == pytest.approx(float(natural_log(x)), rel=1e-15, abs=1e-15)


@given(two())
def test_distances_are_their_definitions(pair):
    p, q = pair
    assert np.abs(p - q).sum() / 2 == pytest.approx(total_variation(p, q))
    smooth = (q + 0.01) / (1 + 0.01 * len(q))
    assert stats.entropy(p, smooth) == pytest.approx(kl_divergence(p, q, 0.01), abs=1e-12)
    js = sum(stats.entropy(each, (p + q) / 2, base=2) for each in pair) / 2
    assert js == pytest.approx(jensen_shannon(p, q), abs=1e-12)
    assert np.abs(p - q).tolist() == room_gaps(p, q).tolist()
    assert slow.kendall(p.tolist(), q.tolist()) == pytest.approx(float(rank_correlation(p, q)))


def test_distances_go_along_the_last_axis():
    p, q = np.random.default_rng(1).dirichlet(np.ones(4), (2, 5))
    for distance in (total_variation, jensen_shannon, kl_divergence, rank_correlation):
        expected = [float(distance(a, b)) for a, b in zip(p, q, strict=True)]
        assert expected == pytest.approx(distance(p, q).tolist())


@st.composite
def transport(draw):
    """Two distributions over some rooms, and walking distances between the rooms."""
    places = np.array(draw(st.lists(st.tuples(*[st.integers(0, 9)] * 2), min_size=1, max_size=9)))
    few = st.lists(st.integers(0, 5), min_size=len(places), max_size=len(places)).filter(any)
    here, there = np.array(draw(few)), np.array(draw(few))
    cost = np.abs(places[:, None] - places).sum(axis=2).astype(float)
    return here / here.sum(), there / there.sum(), cost


@given(transport())
def test_earth_mover_is_the_cheapest_of_all_flows(case):
    here, there, cost = case
    expected = slow.transport(there, here, cost)
    assert expected == pytest.approx(earth_mover(there, here, cost), abs=1e-7)


@given(st.integers(0, 10_000), st.integers(1, 40), st.integers(1, 6), st.integers(1, 20))
def test_scores_are_their_definitions(seed, count, places, masses):
    random = np.random.default_rng(seed)
    p, truth = random.dirichlet(np.ones(places), count), random.integers(0, places, count)
    is_true = np.eye(places)[truth]
    brier = ((p - is_true) ** 2).sum(axis=1)
    assert brier == pytest.approx(brier_score(p, truth), abs=1e-12)
    said = np.maximum(p[is_true > 0], 1e-6)
    assert -np.log(said) == pytest.approx(log_loss(p, truth))
    assert slow.classwise_error(p.tolist(), truth.tolist(), masses) == pytest.approx(
        classwise_error(p, truth, masses), abs=1e-12
    )
    assert stats.entropy(p, axis=1) == pytest.approx(sharpness(p), abs=1e-12)
    parts = murphy(p, truth, masses)
    assert brier.mean() == pytest.approx(parts.reliability - parts.resolution + parts.uncertainty)


@st.composite
def coarse(draw):
    """Forecasts in quarters, in which places are often equally likely."""
    places, count = draw(st.integers(1, 4)), draw(st.integers(1, 25))
    cuts = st.lists(st.integers(0, 4), min_size=places - 1, max_size=places - 1).map(sorted)
    rows = [np.diff([0, *draw(cuts), 4]) / 4 for _ in range(count)]
    return np.array(rows), np.array([draw(st.integers(0, places - 1)) for _ in range(count)])


@given(coarse(), st.integers(1, 4), st.integers(1, 9))
def test_ties_are_shared_and_stay_together(case, k, masses):
    p, truth = case
    expected = [slow.among_best(row, t, k) for row, t in zip(p.tolist(), truth, strict=True)]
    assert expected == pytest.approx(top_k(p, truth, k).tolist())
    said = p[:, 0]
    groups = groups_of(said, masses)
    for g, group in enumerate(slow.in_groups(said.tolist(), masses)):
        assert group == np.flatnonzero(groups == g).tolist()
    assert slow.calibration_error(p.tolist(), truth.tolist(), masses) == pytest.approx(
        calibration_error(p, truth, masses), abs=1e-12
    )
    confidence, share, size = reliability_curve(said, truth == 0, masses)
    assert len(p) == size.sum()
    assert np.abs(share - confidence) @ size / len(p) == pytest.approx(
        slow.gaps(said.tolist(), (truth == 0).tolist(), masses), abs=1e-12
    )


@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 2)), min_size=1, max_size=40))
def test_parts_of_the_brier_score_equal_those_by_forecast(rows):
    """Three forecasts, which many groups tell apart however often each was made."""
    said = np.array([[0.2, 0.3, 0.5], [0.4, 0.4, 0.2], [0.9, 0.1, 0.0]])
    p, truth = said[[kind for kind, _ in rows]], np.array([t for _, t in rows])
    expected = slow.murphy(p.tolist(), truth.tolist())
    assert expected == pytest.approx(tuple(murphy(p, truth, masses=400)), abs=1e-12)


def test_scores_of_no_forecasts_and_of_impossible_ones():
    assert 0.0 == calibration_error(np.zeros((0, 3)), np.zeros(0, np.int64))
    assert math.log(1e6) == pytest.approx(log_loss(np.array([[1.0, 0.0]]), np.array([1]))[0])
    assert 0.0 == skill(1.0, 0.0)
    assert -1.0 == skill(2.0, 1.0)


ROOMS, STEPS = 3, 12


def poses(rooms):
    """Return the poses of a user who is in a room at each step, -1 for away."""
    room = np.array(rooms, np.int16)
    begin = np.flatnonzero(np.append(True, room[1:] != room[:-1]))
    visits = begin, np.append(begin[1:], STEPS), room[begin]
    time_in_rooms = np.bincount(room.astype(np.int64) % (ROOMS + 1), minlength=ROOMS + 1)
    return SimpleNamespace(room=room, visits=visits, time_in_rooms=time_in_rooms)


class History:
    """Steps of users, as metrics read them."""

    step_s = 600.0

    def __init__(self, users, first):
        self.first, self.end = first, first + STEPS
        self._poses = {str(i): poses(rooms) for i, rooms in enumerate(users)}

    def __len__(self):
        return STEPS

    def poses(self, user):
        return self._poses[user]


rooms_of_user = st.lists(st.integers(-1, ROOMS - 1), min_size=STEPS, max_size=STEPS)


zones = st.sampled_from(["", "Europe/Berlin", "Australia/Lord_Howe", "America/St_Johns"])


@given(st.lists(rooms_of_user, max_size=4), st.integers(0, 7 * 24 * 60), st.integers(0, 99), zones)
def test_steps_are_counted_by_place_and_hour(users, minute, first, zone):
    """As they are one by one, in runs that begin at any minute of a week, also as clocks change."""
    start = datetime(2010, 11, 2) + timedelta(minutes=minute)
    if zone:
        start = zone_of(zone, start, start + timedelta(days=9)).at(start)
    history, state = lived(users, first, start)
    expected = np.zeros((168, len(users) + 1, ROOMS + 1), np.int64)
    for step in range(STEPS):
        time = start + timedelta(seconds=(first + step) * History.step_s)
        hour = time.weekday() * 24 + time.hour
        rooms = [user[step] for user in users]
        for row, room in enumerate(rooms):
            expected[hour, row, room] += 1
        for room in set(rooms) - {-1} or {-1}:
            expected[hour, -1, room] += 1

    assert expected.tolist() == steps_by_hour(history, state).tolist()
    assert expected.sum(axis=0).tolist() == steps_in_places(history, state).tolist()


def lived(users, first, start):
    """A history of users, and the state of its run."""
    names = tuple(map(str, range(len(users))))
    state = SimpleNamespace(home=SimpleNamespace(rooms=range(ROOMS)), users=names, start=start)
    return History(users, first), state


def test_counts_of_many_users_take_memory_in_proportion():
    users = np.random.default_rng(0).integers(-1, ROOMS, (500, STEPS)).tolist()
    history, state = lived(users, 0, datetime(2026, 3, 2))

    tracemalloc.start()
    steps_in_places(history, state)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()

    assert peak < 20e6
