"""Scheduled: visits at times of the day, between which others have their way."""

from itertools import pairwise

import pytest
from tests.entities.robots.robots import assert_same_for_every_max_span, events, home_with, rooms
from tests.scenes import run

import fleet2d
from fleet2d.errors import InputError

VISITS = [
    {"at": "07:10", "place": "kitchen", "dwell": "5 min", "task": "sweep"},
    {"at": "07:30", "place": [1.0, 6.0], "dwell": "3 min"},
    {"at": "07:40", "place": "bathroom", "on": "weekend"},
]
REST = {"type": "patrol", "waypoints": [[1.0, 3.0]], "dwell": "1 d", "look_around": False}


def test_visits_are_made_at_their_times_and_days():
    content = home_with([{"type": "scheduled", "visits": VISITS}, REST])
    stored = assert_same_for_every_max_span(content)
    rows = [(step, detail) for step, name, detail in events(stored) if name == "visits"]
    assert ["sweep", "bedroom_1"] == [detail for _, detail in rows]
    assert 600 < rows[0][0] < 620
    assert 1800 < rows[1][0] < 1830
    assert ["living_room_1", "kitchen_1", "living_room_1", "bedroom_1", "living_room_1"] == rooms(
        stored
    )


def test_visits_are_made_anew_every_day():
    stored = run(home_with([{"type": "scheduled", "visits": VISITS[:1]}, REST], "3 d"))
    steps = [step for step, name, _ in events(stored) if name == "visits"]
    assert 3 == len(steps)
    assert {86400} == {b - a for a, b in pairwise(steps)}


def test_who_may_not_break_in_waits_and_leaves_out_what_is_too_late():
    patient = {"type": "scheduled", "visits": VISITS[:2], "preempts": False, "late": "12 min"}
    busy = {"type": "patrol", "waypoints": [[1.0, 3.0]], "dwell": "20 min", "look_around": False}
    stored = run(home_with([patient, busy]))
    rows = [(step // 60, detail) for step, name, detail in events(stored) if name == "visits"]
    # The first is made when the robot is free, 10 min late; the second would be 16 min late.
    assert [(20, "sweep")] == rows


GATE = {"gate": {"type": "door", "doorway": "living_room_1-kitchen_1"}}


@pytest.mark.parametrize(("opens", "visited"), [("07:25", True), ("07:50", False)])
def test_a_visit_behind_a_shut_door_is_made_once_it_is_open_or_left_out(opens, visited):
    agenda = [{"at": "07:00", "open": False}, {"at": opens, "open": True}]
    content = home_with(
        [{"type": "scheduled", "visits": VISITS[:1]}, REST],
        objects={"gate": {**GATE["gate"], "schedule": agenda}},
    )
    stored = assert_same_for_every_max_span(content, 61)
    rows = [(step, name) for step, name, _ in events(stored)]
    blocked = [(600, "way_blocked")]
    assert blocked == rows[:1]
    assert ["way_blocked", *["visits"] * visited] == [name for _, name in rows]
    if visited:
        assert 1500 < rows[1][0] < 1540


@pytest.mark.parametrize(
    ("visits", "words"),
    [
        ([], "visits"),
        ([{"at": "25:00", "place": "kitchen"}], "time of day"),
        ([{"at": "07:00", "place": "storage"}], "can't be reached"),
        ([{"at": "07:00", "place": "kichen"}], "did you mean 'kitchen"),
        ([{"at": "07:00", "place": "kitchen", "on": "someday"}], "on"),
    ],
)
def test_visits_that_can_not_be_made_are_refused(visits, words):
    with pytest.raises(InputError, match=words):
        fleet2d.Simulation(home_with([{"type": "scheduled", "visits": visits}]))
