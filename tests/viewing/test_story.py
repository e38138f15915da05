"""Moments of a run that are worth a look."""

from datetime import datetime
from types import SimpleNamespace

import pyarrow as pa
import pytest

import fleet2d
from fleet2d.runtime.clock import Clock
from fleet2d.viewing.story import story_of

HOUR = 3600
START = datetime(2026, 1, 5)


def told(*rows, **tables):
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


@pytest.mark.parametrize(
    ("title", "hour", "words", "events"),
    [
        pytest.param("The first yes", 9, "Ana accepts what Astro asks: vitamins", """
            8 astro asks - vitamins ana
            9 astro accepted - vitamins ana
            33 astro accepted - walk ana""", id="what was only asked is no yes"),
        pytest.param("The longest search", 20.05, "Astro finds Ana after 3 min 0 s", """
            8 astro find_begins - ana
            8.01 astro found - ana
            20 astro find_begins - ana
            20.05 astro found - ana
            30 astro find_begins - ana""", id="a search that found nobody is none"),
        pytest.param("The longest out of view", 17, "out of view for 1 h 30 min", """
            0 ana activity - sleep
            7 ana activity - breakfast
            7.5 astro user_seen ana
            8 astro user_lost ana
            9 ana left_home -
            17 ana came_home -
            18.5 astro user_seen ana
            22 ana activity - sleep""", id="time asleep and out is not out of view"),
        pytest.param("The longest out of view", 12, "for 1 h 0 min", """
            6 ana activity - breakfast
            6 astro user_seen ana
            7 bot user_seen ana
            8 astro user_lost ana
            12 bot user_lost ana
            13 bot user_seen ana""", id="who is seen by one of two robots is in view"),
        pytest.param("The latest night", 47.75, "Ana goes to bed at 23:45", """
            22.5 ana activity - sleep
            28 ana activity - toilet
            28.1 ana activity - sleep
            31 ana activity - breakfast
            47.75 ana activity - sleep
            55 ana activity - breakfast""", id="getting up at night"),
        pytest.param("The latest night", 23.25, "Ana goes to bed at 23:15", """
            21 ana activity - sleep
            21.5 ana activity - tv
            23.25 ana activity - sleep
            31 ana activity - breakfast
            46 ana activity - sleep
            55 ana activity - breakfast""", id="a nap in the evening"),
        pytest.param("The latest night", 49, "Ana goes to bed at 01:00", """
            23.5 ana activity - sleep
            31 ana activity - breakfast
            49 ana activity - sleep
            56 ana activity - breakfast""", id="after midnight is later than before"),
    ],
)  # fmt: skip
def test_moment_is_told_of_events(title, hour, words, events):
    rows = []
    for line in events.split("\n")[1:]:
        at, entity, event, user, *detail = line.split()
        rows.append((float(at), entity, event, None if user == "-" else user, " ".join(detail)))

    moment = told(*rows)[title]

    assert round(hour * HOUR) == moment["step"]
    assert moment["words"].endswith(words)


def test_beliefs_have_settled_where_the_error_stays_near_its_last_value():
    errors = [0.8, 0.4, 0.21, 0.3, 0.21, 0.2, 0.2]
    steps = [hour * HOUR for hour in range(6, 48, 6)]
    table = pa.table({"step": steps, "user": ["ana"] * 7, "tv": errors})

    settled = told(ltp_error=table)["The beliefs have settled"]

    assert 30 * HOUR == settled["step"]
    assert (
        "They are wrong by less than 22 % from here on, and by 20 % at the end" == settled["words"]
    )


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
    assert {} == told()


@pytest.mark.slow
def test_story_is_in_the_order_of_its_moments():
    run = fleet2d.run("bundled:family", "simulation.duration=4 d")

    steps = [moment["step"] for moment in story_of(run)]

    assert len(steps) >= 4
    assert sorted(steps) == steps
