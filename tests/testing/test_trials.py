"""A trial's life: it ends when all is decided, and margins of different units compare."""

import pytest
from tests.scenes import AGENDA, scenario

from fleet2d.interventions import HoldStill, Put
from fleet2d.testing.claim import Claim
from fleet2d.testing.trials import Trial, comparable, run_trial

PEOPLE = {"ana": {"type": "schedule", "days": AGENDA, "rest": "living_room"}}
FLAT = Claim(scenario("2 h", users=PEOPLE, robots={"astro": "patrol"})).variants[0]


def test_a_trial_ends_when_all_expectations_are_decided():
    def soon(trial: Trial):
        trial.advance(100)
        trial.expect("eventually(distance(astro, ana) < 100 m, within=10 s)")

    def to_the_end(trial: Trial):
        trial.expect("always(distance(astro, ana) >= 0 m)")

    early, late = run_trial(FLAT, soon), run_trial(FLAT, to_the_end)
    assert early.holds
    assert late.holds
    assert 100 < early.steps < 400
    assert 7200 == late.steps


def test_all_that_fails_is_named_with_its_step_and_margin():
    def body(trial: Trial):
        trial.do(Put("ana", "kitchen"))
        trial.do(HoldStill("ana"))
        trial.advance(60)
        trial.expect("always(distance(astro, ana) > 30 m)", name="far")
        trial.expect("eventually(room(ana) == bathroom, within=1 min)", name="washes")
        trial.expect("never(room(ana) == bathroom)", name="dry")

    life = run_trial(FLAT, body)
    assert ["far", "washes"] == [failure.name for failure in life.failures]
    assert [60, 120] == [failure.step for failure in life.failures]
    assert -1 < life.failures[0].margin < 0
    assert life.failures[1].margin < 0
    assert 60 == life.failing_step


@pytest.mark.parametrize("without", [(), (0,), (1,)])
def test_interventions_can_be_left_out(without):
    rooms = []

    def body(trial: Trial):
        trial.do(Put("ana", "kitchen"))
        trial.do(Put("astro", "bathroom"))
        trial.advance()
        rooms.extend([trial.state["ana"]["room"], trial.state["astro"]["room"]])

    life = run_trial(FLAT, body, without=without)
    assert 2 == len(life.acts)
    assert (0 not in without) == (rooms[0] == "kitchen_1")
    assert (1 not in without) == (rooms[1] == "bathroom_1")


def test_margins_of_any_unit_compare():
    values = [comparable(value, 1.0) for value in (float("-inf"), -3, -0.1, 0.1, 3, float("inf"))]
    assert sorted(values) == values
    assert (-1, 1) == (values[0], values[-1])
