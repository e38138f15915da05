"""Interventions: what is done to a run from outside, kept in its manifest and done again."""

from datetime import datetime, timedelta

import pytest
from tests.scenes import everything, scenario

import fleet2d
from fleet2d.engine.intervention_queue import (
    OUTSIDE,
    SCRIPT,
    DueIntervention,
    InterventionQueue,
    PendingIntervention,
    read_record,
)
from fleet2d.errors import InputError, PlacementError, ScenarioError
from fleet2d.interventions import Put, Replan
from fleet2d.interventions.intervention import Trigger, parse_intervention
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import Event


def home(duration="20 min", **more):
    return scenario(
        duration,
        users={"ana": {"type": "meander"}},
        robots={"astro": {"type": "patrol", "dwell": "30 s"}},
        **more,
    )


def simulation(**more):
    return fleet2d.Simulation(home(**more))


def steer(run):
    """Do one of each."""
    run.advance(61)
    run.do(Put("ana", "kitchen", heading_deg=90))
    run.advance(100)
    run.do(Replan("astro"))
    run.advance(3)
    run.drive("astro")
    run.advance({"astro": run.plan("astro").go_to("kitchen").stay(timedelta(seconds=40))})
    run.advance({"astro": run.plan("astro").turn_by(0.5).stay(timedelta(hours=1))})


@pytest.mark.parametrize("max_span", [None, 1, 7])
def test_a_steered_run_is_done_again_from_its_manifest(max_span):
    steered = simulation()
    steer(steered)
    stored = steered.run()
    content = home()
    content["simulation"]["max_span"] = max_span
    interventions = stored.manifest["interventions"]
    again = fleet2d.Simulation(content, interventions=interventions).run()
    assert stored.digest == again.digest
    assert stored.digest != fleet2d.run(home()).digest
    assert ["put", "replan", "drive", "decide", "decide"] == [i["do"] for i in interventions]


def test_a_body_that_is_put_somewhere_is_there_at_once_and_nobody_else_changes():
    run, other = simulation(), simulation()
    for each in (run, other):
        each.advance(120)
    run.do(Put("astro", "bedroom"))
    for each in (run, other):
        each.advance(1)
    assert run.state["astro"]["room"].startswith("bedroom")
    assert run.state["ana"] == other.state["ana"]


@pytest.mark.parametrize(
    ("place", "error"),
    [("attic", PlacementError), ((-5.0, -5.0), PlacementError)],
)
def test_a_place_that_can_not_be_is_refused_and_nothing_is_done(place, error):
    run = simulation()
    run.advance(5)
    with pytest.raises(error):
        run.do(Put("ana", place))
    assert [] == run.run().manifest["interventions"]


def test_names_that_do_not_exist_are_refused_with_the_nearest():
    run = simulation()
    with pytest.raises(ScenarioError, match="did you mean 'ana'"):
        run.do(Replan("anna"))
    with pytest.raises(InputError, match="did you mean 'user_seen'"):
        run.run_until(event="user_sen")
    with pytest.raises(InputError, match="did you mean 'astro'"):
        run.run_until(event="user_seen", entity="asto")
    with pytest.raises(InputError, match="expected a time, got 'noon'"):
        run.run_until("noon")


def test_a_driven_body_without_a_plan_is_an_error_and_others_need_none():
    run = simulation()
    run.drive("astro")
    assert ["astro"] == run.pending()
    with pytest.raises(InputError, match="astro has to decide now"):
        run.advance({})
    with pytest.raises(InputError, match="isn't driven"):
        run.advance({"astro": run.plan("astro").stay(), "ana": run.plan("ana").stay()})


def test_an_outside_mind_takes_every_decision_and_no_other_step():
    run = simulation()
    run.drive("astro")
    steps = []
    while run.pending():
        steps.append(run.step)
        run.advance({"astro": run.plan("astro").stay(timedelta(seconds=100))})
    assert list(range(0, 1200, 100)) == steps
    assert run.done


def test_waiting_for_an_event_changes_nothing_and_ends_at_its_timeout():
    run = simulation()
    assert run.run_until(event="docks", timeout="5 min") is None
    assert 300 == run.step
    assert run.run().digest == fleet2d.run(home()).digest


def test_events_are_those_of_the_table_however_a_run_is_cut():
    table = fleet2d.run(everything("30 min")).pandas("events")
    run = fleet2d.Simulation(everything("30 min"))
    while not run.done:
        run.advance(97)
    events = run.events()
    assert table["step"].tolist() == [event.step for event in events]
    assert sorted(zip(table["step"], table["event"], strict=True)) == sorted(
        (event.step, str(event.event)) for event in events
    )
    assert [event for event in events if event.step >= 900] == run.events(since=900)


def test_interventions_are_read_as_they_are_written():
    content = {"do": "put", "step": 3, "entity": "ana", "to": [1.5, 2.0], "heading_deg": 5.0}
    step, fields = read_record(content)
    act = parse_intervention(fields)
    assert content == DueIntervention(step, OUTSIDE, 0, act).record


def test_a_lasting_intervention_lasts_its_time_after_each_event():
    """The end of the first ended those that had begun meanwhile, too."""
    interventions = InterventionQueue(Clock(datetime(2026, 1, 5), 1_000_000, 3600))
    dark = parse_intervention({"fault": "astro", "dark": True, "duration": "1 min"})
    trigger = Trigger(event="user_seen")
    due = DueIntervention(0, SCRIPT, 0, dark, "script.0")
    interventions.waiting.append(PendingIntervention(trigger, True, 0, due))
    for step in (9, 49):
        interventions.take_events([Event(step, "astro", "user_seen", "ana")])

    active = {}
    for step in (10, 50, 69, 70, 109, 110):
        list(interventions.take(step))
        active[step] = len(interventions.lasting)

    assert {10: 1, 50: 2, 69: 2, 70: 1, 109: 1, 110: 0} == active
