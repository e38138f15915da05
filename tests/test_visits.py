"""Visits: how people move about a home, counted alike in logs and in simulated lives."""

import statistics

import numpy as np
import pytest
from benchmarks.visits import (
    ActivityTrace,
    RoomTrace,
    Visits,
    count_visits,
    measure,
    spread,
    stays,
    traces_of_log,
    traces_of_persona,
)
from tests.thorough import THOROUGH

from fleet2d.learning.fit.timeline import ks_distance
from fleet2d.routines.persona import bundled_names

KINDS = ("away", "bathroom", "hallway", "kitchen", "living_room")
HOUR = 3600


def trace(*pieces: tuple[str, int]) -> RoomTrace:
    """A day from midnight: kinds of rooms and seconds, the last one until midnight."""
    rooms = np.full(86_400, KINDS.index(pieces[-1][0]), np.int16)
    at = 0
    for kind, length in pieces[:-1]:
        rooms[at : at + length] = KINDS.index(kind)
        at += length
    return RoomTrace(rooms, KINDS)


def test_passing_through_a_room_is_no_visit():
    day = trace(("kitchen", HOUR), ("hallway", 60), ("bathroom", 5), ("living_room", 0))
    assert ["kitchen", "living_room"] == [stay.kind for stay in stays(*day)]


def test_a_short_way_there_and_back_is_a_short_visit_and_a_return():
    day = trace(("living_room", 10 * HOUR), ("bathroom", 100), ("living_room", 0))
    assert Visits([1], [1], [1], [1], [0]) == count_visits(*day)


def test_a_long_visit_is_neither():
    day = trace(("living_room", 10 * HOUR), ("kitchen", HOUR), ("living_room", 0))
    assert Visits([0], [0], [0], [0], [0]) == count_visits(*day)


def test_coming_home_is_counted_and_a_night_visit_is_none_of_the_daytime():
    day = trace(("living_room", HOUR), ("bathroom", 200), ("away", 9 * HOUR), ("living_room", 0))
    assert Visits([1], [0], [0], [0], [1]) == count_visits(*day)


@pytest.fixture(scope="module")
def real_homes(shared_data):
    logs = ("casas_al/events_10_days.txt", "uci_adl_a")
    return [count_visits(*traces_of_log(shared_data / "activity" / log)[0]) for log in logs]


@pytest.mark.slow
@pytest.mark.parametrize("name", bundled_names())
def test_a_persona_moves_about_as_people_of_real_homes_do(name, real_homes):
    low, high = spread(real_homes)
    counted = count_visits(*traces_of_persona(name, 14, 4)[0])
    for field, a, b, values in zip(Visits._fields, low, high, counted, strict=True):
        assert a <= statistics.mean(values) <= b, field


@pytest.mark.parametrize("name", ["retired", "works_from_home"])
def test_who_is_at_home_goes_to_the_bathroom_in_the_daytime(name):
    counted = count_visits(*traces_of_persona(name, 14, 4)[0])
    assert 3 <= statistics.mean(counted.bathroom_daytime) <= 8


def test_an_outing_a_night_and_meals_are_measured():
    rooms = trace(("living_room", 10 * HOUR), ("away", HOUR), ("hallway", 5), ("kitchen", 0))
    seconds = np.full(86_400, 1, np.int16)
    seconds[: 7 * HOUR], seconds[8 * HOUR : 9 * HOUR], seconds[12 * HOUR : 13 * HOUR] = 0, 2, 3
    found = measure(rooms, ActivityTrace(seconds, ("sleep", "read", "breakfast", "snack")))
    assert ([1.0], [2.0], [1.0]) == (found.outings, found.meals, found.main_meals)
    assert (HOUR + 5) / HOUR == found.away_h[0]
    assert ([7.0], [7.0], [24.0]) == (found.sleep_h, found.wake_h, found.bed_h)
    assert ([3.0], [0.0]) == (found.transitions, found.short)


@pytest.mark.slow
@pytest.mark.parametrize("name", bundled_names() if THOROUGH else ["works_outside"])
def test_rooms_are_left_as_soon_as_in_a_real_home(name, shared_data):
    """Without short stays they are .28 to .31 from those of CASAS AL; UCI ADL A's are .42 from these."""
    log = traces_of_log(shared_data / "activity" / "casas_al/events_10_days.txt")
    real, plain, lively = (
        np.sort(measure(*traces).stays_min)
        for traces in (
            log,
            traces_of_persona({"extends": name, "needs": {"pick_up": None}}, 14, 4),
            traces_of_persona(name, 14, 4),
        )
    )
    assert ks_distance(lively, real) < 0.20 < ks_distance(plain, real)
