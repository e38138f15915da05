"""Smaller versions of a failing run: each fails in the same way, for the same reason."""

from datetime import datetime

import pytest
from tests.scenes import AGENDA, OWN, scenario

from fleet2d.interventions import Call, Put, ShutDoor
from fleet2d.testing.claim import Variant
from fleet2d.testing.failures import FailingCase, Shrinker, describe_trial
from fleet2d.testing.trials import MISSED, Body, Trial, run_trial

AGENDAS = {"type": "schedule", "days": AGENDA, "rest": "living_room"}
CAMERA = {"range": [0.3, 4], "angle_deg": 108}


def flat(duration="20 min", **sections) -> Variant:
    from fleet2d.scenario.load import load_scenario

    content = scenario(
        duration,
        users={"ana": AGENDAS, "ben": {"type": "meander"}},
        robots={
            "astro": {"camera": CAMERA, "behaviors": [{"type": "find", "user": "ana"}]},
            "bolt": {"type": "patrol", "dwell": "1 min"},
        },
        objects={"bath": {"type": "door", "doorway": "bathroom_1"}},
    )
    return Variant(load_scenario(content | sections), {"seed": 4})


def nothing(trial: Trial):
    """Expect what the scenario does."""


def smaller(variant: Variant, body: Body = nothing, tries=60) -> FailingCase:
    whole = run_trial(variant, body)
    assert whole.failures
    case = Shrinker(body, tries).shrink(whole)
    again = run_trial(case.variant, body, without=case.without)
    assert [f.text for f in again.failures] == [f.text for f in case.result.failures]
    return case


def test_it_keeps_the_violated_expectation_though_others_fail_in_less():
    def body(trial: Trial):
        trial.expect("never(room(bolt) == kitchen)", name="kitchen")
        trial.expect("eventually(room(ana) == storage, within=19 min)", name="storage")

    case = smaller(flat(), body)

    assert (case.failure.name, case.failure.kind) == ("kitchen", "")
    assert ["bolt"] == list(case.variant.scenario.robots)
    assert ["ana"] == list(case.variant.scenario.users), "whom the other names"


def test_it_keeps_the_interventions_that_a_missed_expectation_is_about():
    def body(trial: Trial):
        trial.do(Put("ben", "kitchen"))
        trial.do(ShutDoor("bath"))
        trial.do(Put("astro", "storage"))
        trial.run_until("07:05")
        trial.do(Call("astro", find="ana"))
        trial.expect("eventually(seen(ana, by=astro), within=4 min)", name="finds")

    case = smaller(flat(), body)

    assert (MISSED, "finds") == (case.failure.kind, case.failure.name)
    assert frozenset({0, 1}) == case.without, "the robot is still put away, and called"
    assert ["ana"] == list(case.variant.scenario.users)
    assert ["astro"] == list(case.variant.scenario.robots)


def test_it_keeps_the_kind_of_violation():
    def body(trial: Trial):
        trial.advance(600)
        if trial.state["bolt"]["room"] is not None:
            assert trial.scenario.users == {}, "one line"
        raise AssertionError("another line")

    case = smaller(flat(), body)

    assert "one line" in str(case.result.error)


def test_it_keeps_the_learning_that_the_failure_depends_on():
    learned = flat(
        "3 h",
        algorithms={"share": {"type": f"{OWN}:Share", "period": "10 min"}},
        robots={"bolt": {"type": "patrol", "dwell": "1 min", "camera": CAMERA}},
        users={"ana": {"type": "meander"}},
        expect={"knows": "always(implies(during(09:30-10:00), output(share.kitchen) > 0.9))"},
    )
    case = smaller(learned)

    assert datetime(2026, 1, 5, 7) == case.variant.scenario.simulation.start
    assert case.variant.scenario.algorithms


def test_learning_that_the_failure_does_not_depend_on_goes():
    other = flat(
        "3 h",
        algorithms={"share": {"type": f"{OWN}:Share", "period": "10 min"}},
        expect={"off": "never(during(09:30-09:31) and distance(bolt, kitchen) < 100 m)"},
    )
    case = smaller(other)

    assert {} == case.variant.scenario.algorithms
    assert datetime(2026, 1, 5, 9, 29) <= case.variant.scenario.simulation.start


@pytest.mark.parametrize("moment", ["14:40", "15:17"])
def test_it_begins_as_near_to_the_failure_as_it_can(moment):
    hour, minute = map(int, moment.split(":"))
    put = {"at": "14:21", "put": "bolt", "to": "kitchen"}
    hold = {"at": "14:21", "hold": "bolt"}
    lasts = f"{(hour * 60 + minute) - (14 * 60 + 21)} min"
    late = flat(
        "10 h",
        script=[{"at": "08:00", "put": "ana", "to": "kitchen"}, put, hold],
        expect={"moves": f"never(holds_for(room(bolt) == kitchen, {lasts}))"},
    )
    case = smaller(late)
    simulation = case.variant.scenario.simulation

    assert datetime(2026, 1, 5, 14, 20) <= simulation.start <= datetime(2026, 1, 5, 14, 21)
    assert {"bolt"} == case.variant.scenario.robots.keys()
    assert ["put", "hold"] == [entry.act.type_name for entry in case.variant.scenario.script]
    assert {} == case.variant.scenario.users


def test_what_must_come_by_the_end_keeps_its_time():
    late = flat("2 h", expect={"cleans": "eventually(room(bolt) == storage)"})
    whole = run_trial(late, nothing)
    case = Shrinker(nothing, 60).shrink(whole)

    assert late.scenario.simulation.duration == case.variant.scenario.simulation.duration


@pytest.mark.parametrize("fails_once", [True, False])
def test_a_report_says_when_the_failure_does_not_come_again(fails_once, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("fleet2d.viewing.figures.draw_failure", lambda *rest: drawn.append(rest))
    runs = []

    def body(trial: Trial):
        runs.append(trial)
        sign = "==" if len(runs) == 1 or not fails_once else "!="
        trial.expect(f"always(room(ana) {sign} storage)", name="stays")

    failing = run_trial(flat("1 min"), body)
    report = "\n".join(describe_trial(failing, body, tmp_path, 0, "again"))

    assert fails_once == ("it didn't fail again" in report)
    ((_, step, _, text, evidence),) = drawn
    (failure,) = failing.failures
    assert (failing.failing_step, failure.text) == (step, text)
    assert failure.evidence is not None
    assert failure.evidence is evidence
