"""Households: days that depend on each other, and periods in which people are away."""

from datetime import date, datetime
from itertools import pairwise

import pytest
from pydantic import ValidationError
from tests.routines.days import DAY_S, MONDAY, violations

from fleet2d.routines.activity import catalogue
from fleet2d.routines.household import Household, Period, with_absences
from fleet2d.routines.interruptions import without_interruptions
from fleet2d.routines.life import LONG_GONE_S, WELCOME, Lives
from fleet2d.routines.planner import Episode

CROWD = {
    "ana": "works_outside",
    "ben": "works_from_home",
    "cleo": "child",
    "dan": "night_shift",
    "eve": "student",
    "vera": "retired",
}
DINNER = {"dinner": {"at": "18:45", "spread": "10 min", "on": "daily", "takes": "35 min"}}


def lives(seed=4, members=CROWD, **more):
    household = Household.model_validate({"members": members, **more})
    return Lives(household, seed, MONDAY - 1)


def at_home(episode):
    return not catalogue()[episode.activity].away


def test_no_day_of_a_crowded_household_breaks_a_constraint():
    home = lives()
    for i in range(60):
        today, after = home.day(MONDAY + i), home.day(MONDAY + i + 1)
        for name, persona in home.household.members.items():
            faults = violations(persona, MONDAY + i, today[name], after[name])
            # Who finds the bathroom taken all the time does without.
            assert [] == [v for v in faults if "left out" not in v], name


def test_the_bathroom_is_planned_for_one_at_a_time_even_by_those_who_are_up_at_night():
    home = lives()
    used = sorted(
        (episode.begin + i * DAY_S, episode.end + i * DAY_S, name)
        for i in range(-1, 60)
        for name, day in home.day(MONDAY + i).items()
        for episode in day
        if catalogue()[episode.activity].exclusive
    )
    assert {name for _, _, name in used} == set(CROWD)
    assert [] == [(a, b) for a, b in pairwise(used) if a[1] > b[0]]


def test_what_is_done_together_begins_and_ends_at_one_time():
    home = lives(members={n: CROWD[n] for n in ("ana", "ben", "cleo")}, together=DINNER)
    begins = set()
    for i in range(100):
        planned = [e for day in home.day(MONDAY + i).values() for e in without_interruptions(day)]
        ((begin, _),) = {(e.begin, e.end) for e in planned if e.task == "dinner"}
        begins.add(begin)
    assert len(begins) > 50


def test_some_of_those_at_leisure_come_to_the_door_and_so_does_who_comes_home():
    home = lives(welcome=0.5)
    welcomed = came = 0
    for i in range(30):
        day = home.day(MONDAY + i)
        comings = {
            after.begin: name
            for name, episodes in day.items()
            for gone, after in pairwise(episodes)
            if at_home(after) and not at_home(gone) and gone.end - gone.begin >= LONG_GONE_S
        }
        came += len(comings)
        for episodes in day.values():
            assert all(a.end == b.begin for a, b in pairwise(episodes))
            welcomes = [episode for episode in episodes if episode.activity == WELCOME]
            assert all(episode.begin in comings for episode in welcomes)
            welcomed += len(welcomes)
    assert came / 2 < welcomed  # who comes home goes to the bathroom first at times


def test_nobody_comes_to_the_door_unless_asked_for():
    day = lives().day(MONDAY)
    assert all(episode.activity != WELCOME for episodes in day.values() for episode in episodes)


def test_members_are_away_on_trips_and_visitors_outside_their_visits():
    home = lives(
        trips={"ana": [["2026-01-06", "2026-01-08T12:00"]]},
        visits={"vera": [["2026-01-09T17:00", "2026-01-11T16:00"]]},
        away=[["2026-01-20", "2026-01-25"]],
    )

    def nights(name, *days):
        """Whether a member is at home at three in the night of some days."""
        at = 3 * 3600 + DAY_S
        found = []
        for day in days:
            episodes = home.day(date(2026, 1, day).toordinal() - 1)[name]
            found += [at_home(e) for e in episodes if e.begin <= at < e.end]
        return found

    assert [True, False, False, True] == nights("ana", 5, 6, 8, 9)
    assert [False, True, True, False] == nights("vera", 9, 10, 11, 12)
    assert [False] * len(CROWD) == [here for name in CROWD for here in nights(name, 22)]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"trips": {"zoe": []}}, ["trips", "zoe", "no member"]),
        ({"visits": {"anna": []}}, ["visits", "anna", "did you mean 'ana'"]),
        ({"welcome": 2}, ["welcome"]),
        ({"couples": [["ana", "zoe"]]}, ["zoe", "no member"]),
        ({"together": {"dance": {"at": "18:00", "on": "daily"}}}, ["dance", "no activity"]),
        ({"together": {"dinner": {"on": "daily"}}}, ["'at' or 'between'"]),
        ({"members": {}}, ["members"]),
    ],
)
def test_what_is_no_household_is_refused_in_plain_words(more, words):
    with pytest.raises(ValidationError) as caught:
        Household.model_validate({"members": CROWD, **more})
    for word in words:
        assert word in str(caught.value)


def test_days_before_the_first_are_not_made_up():
    with pytest.raises(ValueError, match="before the first day"):
        lives().day(MONDAY - 2)


MIDNIGHT = datetime(2026, 1, 5)
HOUR = 3600
DAY = [Episode("read", 7 * HOUR, 12 * HOUR), Episode("cook", 12 * HOUR, 13 * HOUR, "lunch")]


@pytest.mark.parametrize(
    ("away", "visits", "expected"),
    [
        ([("14:00", "15:00")], None, [("read", 7, 12), ("cook", 12, 13)]),
        ([("09:00", "10:00")], None, [("read", 7, 9), ("holiday", 9, 10), ("read", 10, 12), ("cook", 12, 13)]),
        ([("11:00", "23:00")], None, [("read", 7, 11), ("holiday", 11, 13)]),
        ([], [("08:00", "12:30")], [("holiday", 7, 8), ("read", 8, 12), ("cook", 12, 12.5), ("holiday", 12.5, 13)]),
        ([], [], [("holiday", 7, 13)]),
    ],
    ids=["none", "within an activity", "over several", "a visitor", "a visitor of another day"],
)  # fmt: skip
def test_a_day_is_cut_by_absences_and_visits(away, visits, expected):
    def periods(times):
        return [Period.model_validate([f"2026-01-05T{t}" for t in pair]) for pair in times]

    day = with_absences(DAY, MIDNIGHT, periods(away), None if visits is None else periods(visits))
    assert expected == [(e.activity, e.begin / HOUR, e.end / HOUR) for e in day]


@pytest.mark.parametrize(
    "data", [["2026-01-06", "2026-01-05"], ["2026-01-06", "2026-01-06"], ["soon", "later"], [1]]
)
def test_what_is_no_period_is_refused(data):
    with pytest.raises(ValidationError):
        Period.model_validate(data)
