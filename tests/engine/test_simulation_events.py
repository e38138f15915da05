"""Waiting for events and listening to them: all that is stored, in order, at once."""

import copy
from typing import Any

import pytest

import fleet2d
from fleet2d.errors import InputError

DAY = {
    "extends": "bundled:paper",
    "simulation": {"duration": "1 d", "seed": 4},
    "objects": {
        "hall_motion": {"type": "motion_sensor", "at": [16.53, 7.73], "range": 4},
        "bath": {"type": "door", "doorway": "bathroom_1", "open": False, "closes_after": "10 s"},
    },
    "script": [{"at": "9 h", "open": "bath"}],
}
PATROL = [{"type": "opportunistic"}, {"type": "patrol"}]
WITHOUT_LEARNERS = {
    "algorithms": {"ltp": None},
    "metrics": {"ltp_error": None, "room_share": None},
    "robots": {"astro": {"behaviors": PATROL}},
}


def stored(run: Any) -> list[tuple[int, str, str]]:
    """Return what a run stored, by step: events, and readings of sensors."""
    events = [
        (row["step"], row["entity"] or "", row["event"]) for row in run.tables["events"].to_pylist()
    ]
    readings = [(row["step"], row["sensor"], "sensor") for row in run.tables["sensors"].to_pylist()]
    return sorted([*events, *readings])


@pytest.mark.parametrize("content", [DAY, DAY | WITHOUT_LEARNERS], ids=["learns", "only_lives"])
def test_a_listener_hears_all_that_is_stored(content):
    simulation = fleet2d.Simulation(content)
    heard: list[tuple[int, str, str]] = []
    simulation.listen(lambda events: heard.extend((e.step, e.entity, str(e.event)) for e in events))

    run = simulation.run()

    kinds = {event for _, _, event in heard}
    assert {"sensor", "opened", "activity"} <= kinds
    assert sorted(heard) == stored(run)
    assert [step for step, _, _ in heard] == sorted(step for step, _, _ in heard)


def test_a_listener_hears_events_in_the_order_of_the_table():
    simulation = fleet2d.Simulation(DAY)
    heard: list[tuple[int, str, str]] = []
    simulation.listen(
        lambda events: heard.extend(
            (e.step, e.entity, str(e.event)) for e in events if e.event != "sensor"
        )
    )

    table = simulation.run().tables["events"].to_pylist()

    assert heard == [(row["step"], row["entity"] or "", row["event"]) for row in table]


def test_a_listener_is_called_before_the_next_step():
    simulation = fleet2d.Simulation(DAY)
    late: list[int] = []
    simulation.listen(lambda events: late.extend(simulation.step - e.step for e in events))

    simulation.run()

    assert set(late) == {1}


def test_listening_does_not_change_the_run():
    simulation = fleet2d.Simulation(DAY)
    simulation.listen(lambda events: None)

    assert simulation.run().digest == fleet2d.run(DAY).digest


def test_a_listener_gets_only_its_kinds_and_may_intervene():
    content = DAY | {"robots": {"astro": {"behaviors": [{"type": "come"}, {"type": "patrol"}]}}}
    simulation = fleet2d.Simulation(content, "simulation.start=2026-01-05T07:00")

    def come(events: Any) -> None:
        for event in events:
            assert event.event == "sensor"
            simulation.do({"call": "astro", "to": "kitchen_1"})

    simulation.listen(come, ["sensor"])
    run = simulation.run()

    readings = run.tables["sensors"]["step"].to_pylist()
    called = [i["step"] for i in run.manifest["interventions"] if i["do"] == "call"]
    assert called
    assert called == [step + 1 for step in readings if step + 1 < 86400]


def test_a_copy_has_no_listener():
    simulation = fleet2d.Simulation(DAY)
    heard: list[Any] = []
    simulation.listen(heard.extend)

    twin = copy.deepcopy(simulation)
    twin.run()

    assert heard == []
    assert twin._state.awaited == frozenset()


def test_an_unknown_kind_is_refused_with_the_nearest_name():
    with pytest.raises(InputError, match="there is no event 'sensors': did you mean 'sensor'"):
        fleet2d.Simulation(DAY).listen(lambda events: None, ["sensors"])


@pytest.mark.parametrize("event", ["sensor", "opened", "activity", "user_seen"])
def test_running_until_an_event_stops_at_the_step_after_it(event):
    for content in (DAY, DAY | WITHOUT_LEARNERS):
        first = next(step for step, _, name in stored(fleet2d.run(content)) if name == event)
        simulation = fleet2d.Simulation(content)

        result = simulation.run_until(event=event)

        assert result is not None
        assert (result.step, simulation.step) == (first, first + 1)


def test_running_until_a_sensor_reports_names_its_state():
    simulation = fleet2d.Simulation(DAY)

    event = simulation.run_until(event="sensor", entity="hall_motion")

    assert event is not None
    assert event.detail == "ON"
    assert simulation.state["hall_motion"]["on"]


def test_a_copy_of_a_run_does_not_call_those_who_listen_to_rows():
    simulation = fleet2d.Simulation("bundled:paper", "simulation.duration=2 h", seed=4)
    tables: list[str] = []
    simulation.listen_rows(lambda table, row: tables.append(table))

    copy.deepcopy(simulation).run()

    assert not tables
