"""`fleet2d demo` tells in sentences what a run measured, and shows its page."""

import re
import sys
from collections import Counter

import numpy as np
import pytest

import fleet2d as package
from fleet2d.runs.run import open_run
from fleet2d.viewing import demo

DAY = ("simulation.duration=1 d", "metrics={sightings: {}, distance: {}, time_to_find: {}}")


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    """A day of a family whose robot reminds and searches."""
    return package.run("bundled:family", *DAY, out=tmp_path_factory.mktemp("family"))


@pytest.fixture
def short(monkeypatch):
    """Let the demo take a day of the bundled home."""
    set_up = demo.set_up
    monkeypatch.setattr(demo, "set_up", lambda _, *more, **wrong: set_up([*DAY], *more, **wrong))


def test_sentences_tell_what_the_run_measured(family):
    first, *sentences = demo.sentences(family)

    assert first.startswith("1 d of Ana, Ben, Cleo and Astro, simulated in ")
    metres = family.metrics["distance"]
    assert f"Astro drove {metres['astro']:,.0f} m a day." in sentences
    events = family.tables["events"]["event"].to_pylist()
    assert f"Astro found Cleo in {events.count('found')} of 1 searches." in sentences


def test_sentence_tells_how_long_each_person_was_seen_awake(family):
    events = family.tables["events"].to_pylist()
    awake, seen = (np.zeros(family.manifest["steps"], bool) for _ in range(2))
    for event in events:  # what holds from a step on holds to the end, or to what is said next
        of_ana = event["entity"] == "ana"
        if of_ana and event["event"] == "activity":
            awake[event["step"] :] = event["detail"] != "sleep"
        elif event["user"] == "ana" and event["event"] in ("user_seen", "user_lost"):
            seen[event["step"] :] = event["event"] == "user_seen"
    assert not any(event["entity"] == "ana" and event["event"] == "left_home" for event in events)

    saw = next(sentence for sentence in demo.sentences(family) if " saw " in sentence)

    share = f"{100 * seen[awake].mean():.0f} %"
    assert re.fullmatch(
        rf"Astro saw Ana for {share}, Ben for \d+ % and Cleo for \d+ %"
        " of the time they were at home and awake.",
        saw,
    )


def test_time_out_of_the_home_and_asleep_is_no_waking_time_at_home():
    said = [
        (10, "ana", "activity", None, "tv"),
        (20, "astro", "user_seen", "ana", ""),
        (30, "bolt", "user_seen", "ana", ""),
        (40, "astro", "user_lost", "ana", ""),
        (45, "astro", "user_seen", "ben", ""),
        (50, "bolt", "user_lost", "ana", ""),
        (60, "ana", "left_home", None, ""),
        (80, "ana", "came_home", None, ""),
        (90, "ana", "activity", None, "sleep"),
    ]
    columns = ("step", "entity", "event", "user", "detail")
    events = [dict(zip(columns, row, strict=True)) for row in said]

    assert 30 / 60 == demo._waking_share("ana", events, 100)
    assert None is demo._waking_share("ben", events, 100)


def test_sentences_tell_how_people_answered(family):
    kinds = Counter((e["event"], e["detail"]) for e in family.tables["events"].to_pylist())
    pattern = r"Astro (reminded|greeted) (\w+) (once|(\d+) times) \((\w+)\): (.*)\."
    said = [found for s in demo.sentences(family) if (found := re.fullmatch(pattern, s))]

    assert {"reminded Cleo", "greeted Ben"} <= {f"{one[1]} {one[2]}" for one in said}
    for _, person, _, times, name, answers in (one.groups() for one in said):
        detail = f"{name} {person.lower()}"
        assert kinds["asks", detail] == int(times or 1)
        assert kinds["asks", detail] == sum(map(int, re.findall(r"\d+", answers)))
        for outcome in ("accepted", "declined", "ignored"):
            count = kinds[outcome, detail]
            assert (f"{count} {outcome}" in answers) == bool(count)


def test_a_search_that_ended_at_somebody_else_is_no_find():
    ends = ["found", "false", "found", "gave_up"]
    searches = [{"robot": "astro", "user": "cleo", "end": end} for end in ends]
    others = [{"robot": "bolt", "user": "cleo", "end": "found"}]

    (sentence,) = demo._searches("astro", [*searches, *others])

    said = "Astro found Cleo in 2 of 4 searches, and took somebody else for Cleo in 1."
    assert said == sentence


def test_sentence_tells_how_wrong_beliefs_were_at_first_and_at_the_end():
    run = package.run("bundled:paper", "simulation.duration=3 d")
    errors = [row["tv"] for row in run.tables["ltp_error"].to_pylist() if row["user"] == "ana"]

    sentences = list(demo.sentences(run))

    first, last = f"{100 * errors[0]:.0f} %", f"{100 * errors[-1]:.0f} %"
    learned = f"At first, what was learned put {first} of Ana's time into wrong rooms"
    assert f"{learned}; in the end {last}." in sentences


def test_sentences_leave_out_what_the_run_did_not_measure():
    run = package.run(
        "bundled:paper", "simulation.duration=1 h", "metrics=null", "robots=null", "algorithms=null"
    )

    (only,) = demo.sentences(run)

    assert only.startswith("1 h of Ana, simulated in ")


@pytest.mark.usefixtures("short")
def test_demo_without_the_page_ends_with_the_place_of_the_run(fleet2d, tmp_path):
    code, out, err = fleet2d("demo", "--no-view", "--out", "shown")

    assert (0, "") == (code, err)
    assert out.endswith("stored in shown\n")
    told = list(demo.sentences(open_run("shown")))
    assert told == out.splitlines()[: len(told)]


@pytest.mark.usefixtures("short")
def test_demo_without_the_extra_says_how_to_get_it(fleet2d, monkeypatch):
    monkeypatch.setitem(sys.modules, "fleet2d.viewing.page_server", None)
    monkeypatch.delitem(sys.modules, "fleet2d.viewing.page_server")
    monkeypatch.setitem(sys.modules, "uvicorn", None)

    code, out, _ = fleet2d("demo", "--out", "shown")

    assert 0 == code
    assert 'no page: this needs uvicorn: pip install "fleet2d[view]"' in out


@pytest.mark.usefixtures("short")
def test_demo_shows_the_page_of_its_run_in_a_new_folder(fleet2d, monkeypatch):
    shown = []
    monkeypatch.setattr("fleet2d.viewing.command.view", shown.append)

    code, out, _ = fleet2d("demo")

    assert 0 == code
    ((directory,),) = shown
    assert out.endswith(f"stored in {directory}\n")
    assert open_run(directory).status == "complete"
