"""`fleet2d demo` tells in sentences what a run measured, and shows its page."""

import re
import sys
from pathlib import Path
from typing import Any

import pytest
from tests.scenes import Cli

import fleet2d as package
from fleet2d.runs.run import open_run
from fleet2d.viewing import demo

DAY = ("simulation.duration=1 d", "metrics={sightings: {}, distance: {}, time_to_find: {}}")


@pytest.fixture(scope="module")
def family(tmp_path_factory: pytest.TempPathFactory) -> package.Run:
    """A day of a family whose robot reminds and searches."""
    return package.run("bundled:family", *DAY, out=tmp_path_factory.mktemp("family"))


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the demo take a day of the bundled home."""
    set_up = demo.set_up
    monkeypatch.setattr(demo, "set_up", lambda _, *more, **wrong: set_up([*DAY], *more, **wrong))


def test_sentences_tell_what_the_run_measured(family: package.Run) -> None:
    first, *sentences = demo.sentences(family)

    assert first.startswith("1 d with Ana, Ben, Cleo and Astro took ")
    seen, metres = (family.metrics[name] for name in ("sightings", "distance"))
    shares = [f"{name} in {100 * seen[name.lower()]:.0f} %" for name in ("Ana", "Ben", "Cleo")]
    saw = f"Astro saw {shares[0]}, {shares[1]} and {shares[2]}"
    assert f"{saw} of the time at home, nights included." in sentences
    assert f"Astro drove {metres['astro']:,.0f} m a day." in sentences
    events = family.tables["events"]["event"].to_pylist()
    asked = f"Astro asked {events.count('asks')} times: {events.count('accepted')} accepted, "
    (requests,) = (sentence for sentence in sentences if sentence.startswith(asked))
    total, *parts = map(int, re.findall(r"\d+", requests))
    assert total == sum(parts)
    assert f"Astro found Cleo in {events.count('found')} of 1 searches." in sentences


def test_a_search_that_ended_at_somebody_else_is_no_find() -> None:
    ends = ["found", "false", "found", "gave_up"]
    searches = [{"robot": "astro", "user": "cleo", "end": end} for end in ends]
    others = [{"robot": "bolt", "user": "cleo", "end": "found"}]

    (sentence,) = demo._searches("astro", [*searches, *others])

    said = "Astro found Cleo in 2 of 4 searches, and took somebody else for Cleo in 1."
    assert said == sentence


def test_sentence_tells_how_wrong_beliefs_were_at_first_and_at_the_end() -> None:
    run = package.run("bundled:paper", "simulation.duration=3 d")
    errors = [row["tv"] for row in run.tables["ltp_error"].to_pylist() if row["user"] == "ana"]

    sentences = list(demo.sentences(run))

    first, last = f"{100 * errors[0]:.0f} %", f"{100 * errors[-1]:.0f} %"
    believed = "What was believed of their rooms was wrong by"
    assert f"{believed} {first} for Ana at first, and by {last} at the end." in sentences


def test_sentences_leave_out_what_the_run_did_not_measure() -> None:
    run = package.run(
        "bundled:paper", "simulation.duration=1 h", "metrics=null", "robots=null", "algorithms=null"
    )

    (only,) = demo.sentences(run)

    assert only.startswith("1 h with Ana took ")


@pytest.mark.usefixtures("short")
def test_demo_without_the_page_ends_with_the_place_of_the_run(fleet2d: Cli, tmp_path: Path) -> None:
    code, out, err = fleet2d("demo", "--no-view", "--out", "shown")

    assert (0, "") == (code, err)
    assert out.endswith("stored in shown\n")
    told = list(demo.sentences(open_run("shown")))
    assert told == out.splitlines()[: len(told)]


@pytest.mark.usefixtures("short")
def test_demo_without_the_extra_says_how_to_get_it(
    fleet2d: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "fleet2d.viewing.page_server", None)
    monkeypatch.delitem(sys.modules, "fleet2d.viewing.page_server")
    monkeypatch.setitem(sys.modules, "uvicorn", None)

    code, out, _ = fleet2d("demo", "--out", "shown")

    assert 0 == code
    assert 'no page: this needs uvicorn: pip install "fleet2d[view]"' in out


@pytest.mark.usefixtures("short")
def test_demo_shows_the_page_of_its_run_in_a_new_folder(
    fleet2d: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[Any] = []
    monkeypatch.setattr("fleet2d.viewing.command.view", shown.append)

    code, out, _ = fleet2d("demo")

    assert 0 == code
    ((directory,),) = shown
    assert out.endswith(f"stored in {directory}\n")
    assert open_run(directory).status == "complete"
