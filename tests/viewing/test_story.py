"""Moments of a run that are worth a look."""

from datetime import datetime
from types import SimpleNamespace
from typing import Any

import pyarrow as pa
import pytest

import fleet2d
from fleet2d.runtime.clock import Clock
from fleet2d.viewing.story import story_of

HOUR = 3600
START = datetime(2026, 1, 5)


def told(*rows: tuple[float, str, str, str | None, str], **tables: pa.Table) -> dict[str, Any]:
    """Return the story of three days with these events, at hours since the start, by title."""
    names = ("step", "entity", "event", "user", "detail")
    steps = [(round(hours * HOUR), *rest) for hours, *rest in rows]
    columns = {name: [row[i] for row in steps] for i, name in enumerate(names)}
    events = pa.table({**columns, "user": pa.array(columns["user"], pa.string())})
    run = SimpleNamespace(
        tables={"events": events, **tables},
        clock=Clock(START, 1_000_000, 3 * 24 * HOUR),
        manifest={
            "entities": {"users": ["ana"], "robots": ["astro"]},
            "scenario": {"metrics": {name: {"type": "ltp_error"} for name in tables}},
        },
    )
    return {moment["title"]: moment for moment in story_of(run)}  # type: ignore[arg-type]


def test_first_yes_is_the_first_that_was_accepted():
    story = told(
        (8, "astro", "asks", None, "vitamins ana"),
        (9, "astro", "accepted", None, "vitamins ana"),
        (33, "astro", "accepted", None, "walk ana"),
    )

    assert 9 * HOUR == story["The first yes"]["step"]
    assert "Ana accepts what Astro asks: vitamins" == story["The first yes"]["words"]


def test_longest_search_is_told_when_it_found_somebody():
    story = told(
        (8, "astro", "find_begins", None, "ana"),
        (8.01, "astro", "found", None, "ana"),
        (20, "astro", "find_begins", None, "ana"),
        (20.05, "astro", "found", None, "ana"),
        (30, "astro", "find_begins", None, "ana"),
    )

    assert "Astro finds Ana after 3 min 0 s" == story["The longest search"]["words"]
    assert round(20.05 * HOUR) == story["The longest search"]["step"]


def test_time_asleep_and_out_is_not_out_of_view():
    story = told(
        (0, "ana", "activity", None, "sleep"),
        (7, "ana", "activity", None, "breakfast"),
        (7.5, "astro", "user_seen", "ana", ""),
        (8, "astro", "user_lost", "ana", ""),
        (9, "ana", "left_home", None, ""),
        (17, "ana", "came_home", None, ""),
        (18.5, "astro", "user_seen", "ana", ""),
        (22, "ana", "activity", None, "sleep"),
    )

    longest = story["The longest out of view"]
    assert "Ana is up and at home, and out of view for 1 h 30 min" == longest["words"]
    assert 17 * HOUR == longest["step"]


def test_who_is_seen_by_one_of_two_robots_is_in_view():
    story = told(
        (6, "ana", "activity", None, "breakfast"),
        (6, "astro", "user_seen", "ana", ""),
        (7, "bot", "user_seen", "ana", ""),
        (8, "astro", "user_lost", "ana", ""),
        (12, "bot", "user_lost", "ana", ""),
        (13, "bot", "user_seen", "ana", ""),
    )

    assert story["The longest out of view"]["words"].endswith("for 1 h 0 min")


@pytest.mark.parametrize(
    ("hours", "bed"),
    [
        pytest.param(
            {22.5: "sleep", 28: "toilet", 28.1: "sleep", 31: "breakfast",
             47.75: "sleep", 55: "breakfast"},
            "23:45", id="getting up at night",
        ),
        pytest.param(
            {21: "sleep", 21.5: "tv", 23.25: "sleep", 31: "breakfast",
             46: "sleep", 55: "breakfast"},
            "23:15", id="a nap in the evening",
        ),
    ],
)  # fmt: skip
def test_one_goes_to_bed_once_a_night(hours, bed):
    story = told(*((hour, "ana", "activity", None, what) for hour, what in hours.items()))

    assert f"Ana goes to bed at {bed}" == story["The latest night"]["words"]


def test_bed_after_midnight_is_later_than_before():
    story = told(
        (23.5, "ana", "activity", None, "sleep"),
        (31, "ana", "activity", None, "breakfast"),
        (49, "ana", "activity", None, "sleep"),
        (56, "ana", "activity", None, "breakfast"),
    )

    assert "Ana goes to bed at 01:00" == story["The latest night"]["words"]


def test_beliefs_have_settled_where_the_error_stays_near_its_last_value():
    errors = [0.8, 0.4, 0.21, 0.3, 0.21, 0.2, 0.2]
    steps = [hour * HOUR for hour in range(6, 48, 6)]
    table = pa.table({"step": steps, "user": ["ana"] * 7, "tv": errors})

    settled = told(ltp_error=table)["The beliefs have settled"]

    assert 30 * HOUR == settled["step"]
    assert (
        "They are wrong by less than 22 % from here on, and by 20 % at the end" == settled["words"]
    )


def test_run_without_events_has_no_story():
    assert {} == told()


def test_home_without_people_has_no_story():
    run = fleet2d.run(
        "bundled:paper",
        "simulation.duration=1 h",
        "users=null",
        "algorithms=null",
        "metrics=null",
        "robots.astro.behaviors=[patrol]",
    )

    assert [] == story_of(run)


@pytest.mark.slow
def test_story_is_in_the_order_of_its_moments():
    run = fleet2d.run("bundled:family", "simulation.duration=4 d")

    steps = [moment["step"] for moment in story_of(run)]

    assert len(steps) >= 4
    assert sorted(steps) == steps
