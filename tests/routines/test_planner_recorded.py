"""Recorded days: read, written, and followed from one to another."""

from itertools import pairwise

import pytest
from pydantic import ValidationError
from tests.routines.days import MONDAY

from fleet2d.routines.household import Household
from fleet2d.routines.life import Life, Lives
from fleet2d.routines.persona import Persona
from fleet2d.routines.planner import parse_day, write_day

DAYS = [
    "06:50 wash, 07:10 breakfast, 07:30 work, 17:00 cook, 18:00 tv, 22:30 sleep, 31:00 end",
    "07:00 wash, 07:20 breakfast, 07:50 work, 17:10 tv, 22:40 sleep, 26:10 wash, 26:20 sleep, 30:50 end",
    "07:10 wash, 07:25 breakfast, 09:00 read, 12:00 cook, 12:40 read, 17:05 tv, 23:00 sleep, 31:10 end",
]
SECONDS = "06:50 wash, 06:50:20 tv, 06:50:37 wash, 07:10:05 tv, 22:30 sleep, 31:00 end"


def persona(*days):
    template = {"on": "daily", "recorded": list(days or DAYS)}
    return Persona.model_validate({"needs": None, "errands": None, "days": {"any_day": template}})


@pytest.mark.parametrize("text", [*DAYS, SECONDS])
def test_a_day_is_written_as_it_is_read(text):
    assert text == write_day(parse_day(text))


def test_a_stay_of_seconds_lasts_as_recorded():
    life = Life(persona(SECONDS), 4, "users.ana")
    lengths = {e.end - e.begin for i in range(20) for e in life.day(MONDAY + i)}
    assert {17, 20} <= lengths
    assert min(lengths) == 17


def test_days_have_no_gap_and_end_asleep_when_the_next_begins():
    life = Life(persona(), 4, "users.ana")
    for i in range(200):
        day, after = life.day(MONDAY + i), life.day(MONDAY + i + 1)
        assert all(a.end == b.begin for a, b in pairwise(day))
        assert all(episode.begin < episode.end for episode in day)
        assert "sleep" == day[-1].activity
        assert day[-1].end == after[0].begin + 86_400


def test_most_days_are_like_no_recorded_one_and_hold_nothing_else():
    life = Life(persona(), 4, "users.ana")
    orders = {tuple(d.activity for d in life.day(MONDAY + i)) for i in range(200)}
    recorded = {parse_day(text).activities for text in DAYS}
    assert len(orders - recorded) >= 3
    assert {name for order in orders for name in order} == {n for day in recorded for n in day}


def test_members_of_a_household_keep_out_of_each_others_bathroom():
    members = {"ana": persona(), "ben": persona()}
    lives = Lives(Household(members=members), 4, MONDAY)
    for i in range(60):
        day = lives.day(MONDAY + i)
        busy = sorted((d.begin, d.end) for episodes in day.values() for d in episodes
                      if d.activity == "wash")  # fmt: skip
        assert all(a[1] <= b[0] for a, b in pairwise(busy))


def test_what_a_household_does_together_takes_the_place_of_what_would_be_done():
    joint = {"dinner": {"at": "19:00", "spread": "0 s", "on": "daily", "takes": "40 min"}}
    members = {"ana": persona(), "ben": persona()}
    day = Lives(Household(members=members, together=joint), 4, MONDAY).day(MONDAY + 3)
    dinners = {
        (d.begin, d.end) for episodes in day.values() for d in episodes if d.task == "dinner"
    }
    assert 1 == len(dinners)


@pytest.mark.parametrize(
    ("days", "words"),
    [
        (["07:00 wash, 06:00 sleep, 31:00 end"], "06:00 follows 07:00; write 30:00 if"),
        (["07:00 wash, 23:00 tv, 31:00 end"], "asleep"),
        (["7 wash"], "a time and an activity"),
        (["07:00:00:00 wash, 23:00 sleep, 31:00 end"], "a time and an activity"),
        (["07:00 wsh, 23:00 sleep, 31:00 end"], "wash"),
    ],
)
def test_what_is_no_recorded_day_is_refused(days, words):
    with pytest.raises(ValidationError, match=words):
        persona(*days)
