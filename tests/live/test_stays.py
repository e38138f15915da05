"""Sums of stays, against a slow twin that looks at each step."""

from collections import Counter
from datetime import timedelta
from functools import cache
from itertools import pairwise

import pytest

import fleet2d
from fleet2d.errors import InputError
from fleet2d.live.stays import stays_of, summary


@cache
def run() -> fleet2d.Run:
    return fleet2d.run(
        "bundled:family", "simulation.duration=30 h", "simulation.start=2026-01-05T06:10:00", seed=4
    )


def rooms(who):
    """Return the room of each step."""
    path = run().path(who, timedelta(seconds=1))
    names = [room.name for room in run().plan.rooms]
    return [
        "away" if away else names[room] for away, room in zip(path.away, path.room, strict=True)
    ]


@pytest.mark.parametrize("who", ["ana", "cleo", "astro"])
def test_rooms_are_summed_as_step_by_step(who):
    steps = rooms(who)
    rows = {row["name"]: row for row in summary(run(), who)}

    assert {name: round(n / 3600, 3) for name, n in Counter(steps).items()} == {
        name: row["hours"] for name, row in rows.items()
    }
    for name, row in rows.items():
        begins = [k for k, room in enumerate(steps) if room == name and steps[k - 1 : k] != [name]]
        assert row["stays"] == len(begins)
        assert row["first"] == run().clock.time(begins[0]).isoformat(sep=" ")
        last = max(k for k, room in enumerate(steps) if room == name)
        assert row["last"] == run().clock.time(last + 1).isoformat(sep=" ")
        assert row["longest_hours"] <= row["hours"]


def test_hours_are_shares_of_what_was_simulated_of_them():
    steps = rooms("cleo")
    inside = Counter()
    passed = Counter()
    for step, room in enumerate(steps):
        hour = run().clock.time(step).hour
        passed[hour] += 1
        inside[hour] += room == "away"

    rows = summary(run(), "cleo", "hour", "away")
    assert {row["hour"]: row["share"] for row in rows} == {
        hour: round(inside[hour] / n, 4) for hour, n in passed.items()
    }


@pytest.mark.parametrize("of", ["kitchen", "kitchen_1", "bedroom", "away"])
def test_days_split_stays_at_midnight(of):
    names = {room.name for room in run().plan.rooms if of in (room.name, room.type)} or {of}
    days = Counter()
    for step, room in enumerate(rooms("ana")):
        days[run().clock.time(step).date().isoformat()] += room in names

    rows = summary(run(), "ana", "day", of)
    assert {row["day"]: row["hours"] for row in rows} == {
        day: round(n / 3600, 3) for day, n in days.items() if n
    }


def test_activities_follow_each_other_to_the_end():
    stays = stays_of(run(), "ben", "activity")
    assert all(a.end == b.begin for a, b in pairwise(stays))
    assert stays[-1].end == run().clock.steps
    (sleep,) = [row for row in summary(run(), "ben", "activity") if row["name"] == "sleep"]
    assert 6 < sleep["longest_hours"] < 10


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("anna",), "did you mean 'ana'"),
        (("ana", "day", "kitchn"), "did you mean 'kitchen_1'"),
        (("ana", "hour"), "name a room, a kind of room or an activity"),
    ],
)
def test_a_wrong_question_is_told(arguments, message):
    with pytest.raises(InputError, match=message):
        summary(run(), *arguments)
