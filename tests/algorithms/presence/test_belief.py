"""Presence: what it says, what it refuses, and the rows that it becomes."""

import copy
from datetime import datetime, timedelta

import numpy as np
import pytest

from fleet2d.algorithms.presence.belief import Presence, WeeklyPresence, slot_of_week
from fleet2d.algorithms.presence.estimator import DayCounts
from fleet2d.errors import ComponentError

NOON = datetime(2026, 1, 5, 12)


def some(**changes):
    values = {
        "users": ("ana",),
        "home": np.array([[0.75, 0.25], [0.5, 0.5]]),
        "away": np.array([0.5, 0.25]),
        "time": NOON,
    }
    return Presence(**{**values, **changes})


def test_rooms_and_away_of_a_user_and_of_anyone():
    presence = some()
    assert ("ana", "anyone") == presence.names
    assert [0.75, 0.25] == presence.share("ana").tolist()
    assert [0.5, 0.5] == presence.share().tolist()
    assert 0.25 == presence.away()
    assert [0.375, 0.125, 0.5] == presence.with_away("ana").tolist()
    assert presence.low() is None
    assert presence.high() is None


def test_intervals_of_shares_leave_out_that_of_away():
    low = np.array([[0.5, 0.125, 0.25], [0.25, 0.375, 0.0]])
    presence = some(interval=(low, low + 0.5))
    assert [0.5, 0.125] == presence.low("ana").tolist()
    assert [0.75, 0.875] == presence.high().tolist()


def test_frozen_arrays_never_change_and_are_not_copied():
    presence = some()
    assert presence is copy.deepcopy(presence)
    assert presence is presence.at(NOON + timedelta(days=1))
    with pytest.raises(ValueError, match="read-only"):
        presence.share("ana")[0] = 1


def test_presence_of_an_unknown_user_is_refused_by_name():
    with pytest.raises(ComponentError, match=r"'anna'.*There are: ana, anyone"):
        some().share("anna")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"home": np.array([[0.75, 0.5], [0.5, 0.5]])}, "'ana' is not a distribution.*1.25"),
        ({"home": np.array([[0.5, 0.5], [np.nan, 0.5]])}, "'anyone' is not a distribution.*nan"),
        ({"home": np.array([[1.5, -0.5], [0.5, 0.5]])}, "'ana' is not a distribution"),
        ({"away": np.array([-0.1, 0.5])}, "'ana'.*away -0.1"),
        ({"away": np.array([0.5])}, "of shape"),
        ({"home": np.array([[0.5, 0.5]])}, "needs shares of shape"),
    ],
)
def test_what_is_no_distribution_is_refused(changes, words):
    with pytest.raises(ComponentError, match=words):
        some(**changes)


def test_presence_has_a_row_for_each_user_and_room_and_for_away():
    columns = some().to_columns(["hall", "bath"])
    rows = list(zip(*(columns[name] for name in ("user", "room", "share")), strict=True))
    assert [
        ("ana", "hall", 0.75), ("ana", "bath", 0.25), ("ana", "away", 0.5),
        ("anyone", "hall", 0.5), ("anyone", "bath", 0.5), ("anyone", "away", 0.25),
    ] == rows  # fmt: skip
    ends = np.zeros((2, 3)), np.ones((2, 3))
    with_ends = some(interval=ends).to_columns(["hall", "bath"])
    assert ["user", "room", "share", "low", "high"] == list(with_ends)
    assert [0.0] * 6 == with_ends["low"].tolist()
    with pytest.raises(ComponentError, match="2 rooms, but the home has 3"):
        some().to_columns(["a", "b", "c"])


def test_each_hour_of_the_week_has_its_own():
    first = np.linspace(0, 1, 168)
    home = np.stack([first, 1 - first], axis=-1)[:, None].repeat(2, axis=1)
    presence = WeeklyPresence(("ana",), (home, np.zeros((168, 2))), NOON)
    assert presence.share("ana")[0] == first[12]
    assert presence.at(NOON + timedelta(days=8)).share("ana")[0] == first[36]
    assert np.array_equal(home[:, 0], presence.by_hour_of_week("ana"))
    assert 0 == slot_of_week(datetime(2026, 1, 5))
    assert 167 == slot_of_week(datetime(2026, 1, 4, 23, 59, 59))


@pytest.mark.parametrize("half_life", [None, 2.0])
def test_sums_by_day_and_hour_equal_those_of_numpy(half_life):
    random = np.random.default_rng(1)
    days = random.choice([100, 101, 103, 109, 110], 300)
    day, minute = np.divmod(np.sort(days * 1440 + random.integers(0, 1440, 300)), 1440)
    values = random.random(300)
    counts = DayCounts((1,), half_life)
    for part in np.split(np.arange(300), range(17, 300, 17)):
        counts.add(day[part], minute[part], values[part, None])

    weighted = values * 0.5 ** ((110 - day) / (half_life or np.inf))
    hour = (day - 1) % 7 * 24 + minute // 60
    assert weighted.sum() == pytest.approx(counts.total[0])
    assert [100, 101, 103, 109] == counts.days
    by_day = np.bincount(day, weighted)[counts.days]
    assert by_day == pytest.approx(np.ravel(counts.weighted_days))
    assert np.bincount(hour, weighted, 168) == pytest.approx(counts.by_hour_of_week[:, 0])
