"""By hand, from Python: how far to simulate, in all ways that scripts and expectations have."""

from datetime import datetime, timedelta

import pytest
from tests.scenes import AGENDA, scenario

import fleet2d
from fleet2d.errors import InputError
from fleet2d.expectations import always, distance, room


def home(duration="2 d"):
    people = {"ana": {"type": "schedule", "days": AGENDA, "rest": "living_room"}}
    return fleet2d.Simulation(scenario(duration, users=people, robots={"astro": "patrol"}))


TIMES = {
    "19:00": "2026-01-05T19:00",
    "tuesday 07:30": "2026-01-06T07:30",
    "weekdays 06:00": "2026-01-06T06:00",
    "2026-01-05T14:00": "2026-01-05T14:00",
    timedelta(minutes=31, seconds=7, milliseconds=500): "2026-01-05T07:31:08",
    "2 h": "2026-01-05T09:00",
    timedelta(hours=3): "2026-01-05T10:00",
    datetime(2026, 1, 5, 11): "2026-01-05T11:00",
    60: "2026-01-05T07:01",
    "2026-01-07T07:00": "2026-01-07T07:00",
}


@pytest.mark.parametrize(("when", "expected"), TIMES.items(), ids=map(str, TIMES))
def test_every_time_that_scripts_take_is_taken(when, expected):
    simulation = home()
    simulation.run_until(when)

    assert datetime.fromisoformat(expected) == simulation.time


@pytest.mark.parametrize(
    ("when", "words"),
    [
        ("1 h", "past: keep a copy.* now it is step 7200, 2026-01-05 09:00:00"),
        ("2026-01-05T07:30", "past: keep a copy"),
        (50, "past: keep a copy"),
        ("2026-01-08T07:00", "after the run"),
        ("3 d", "after the run"),
        ("wednesday 08:00", "after the run"),
        (200_000, "after the run"),
        ("soon", "expected a time"),
        ("25:00", "a time of day"),
    ],
)
def test_an_end_behind_or_after_the_run_is_an_error(when, words):
    simulation = home()
    simulation.run_until("09:00")

    with pytest.raises(InputError, match=words):
        simulation.run_until(when)
    assert datetime(2026, 1, 5, 9) == simulation.time


def test_it_runs_until_a_function_returns_true():
    simulation, slow = home("1 h"), home("1 h")
    came = simulation.run_until(
        lambda now: now.state["ana"]["room"] == "bathroom_1", timeout="20 min"
    )
    while slow.state["ana"]["room"] != "bathroom_1":
        slow.advance()

    assert came
    assert slow.step == simulation.step
    assert not simulation.run_until(lambda now: False, timeout="1 min")
    assert slow.step + 60 == simulation.step


def test_it_runs_until_a_condition_holds_and_stops_at_that_step():
    simulation, other = home("2 h"), home("2 h")
    verdict = simulation.run_until(room("ana") == "bathroom")
    other.run_until(lambda now: now.state["ana"]["room"] == "bathroom_1")

    assert verdict.holds
    assert other.step + 1 == simulation.step, "the next step is the one after it"
    assert simulation.verdicts() == {}, "the run knows nothing of it"
    assert not simulation.run_until("room(ana) == kitchen", timeout="1 min").decided
    assert simulation.run().digest == home("2 h").run().digest


def test_it_runs_until_an_expectation_is_decided():
    simulation = home("2 h")
    verdict = simulation.run_until(always(distance("astro", "kitchen") > 0.1), timeout="1 h")

    assert verdict.decided
    assert not verdict.holds
    assert verdict.violations[0].first + 1 == simulation.step
