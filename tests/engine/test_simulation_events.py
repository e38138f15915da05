"""Waiting for events and listening to them: all that is stored, in order, at once."""

import copy
from functools import cache

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


def stored(run):
    """Return what a run stored, by step: events, and readings of sensors."""
    events = [
        (row["step"], row["entity"] or "", row["event"]) for row in run.tables["events"].to_pylist()
    ]
    readings = [(row["step"], row["sensor"], "sensor") for row in run.tables["sensors"].to_pylist()]
    return sorted([*events, *readings])


CONTENTS = {"learns": DAY, "only lives": DAY | WITHOUT_LEARNERS}


@cache
def whole(name):
    return fleet2d.run(CONTENTS[name])


@pytest.mark.parametrize("name", CONTENTS)
def test_a_listener_hears_all_that_is_stored_in_its_order_before_the_next_step(name):
    simulation = fleet2d.Simulation(CONTENTS[name])
    heard, late = [], set()

    def listen(events):
        heard.extend((e.step, e.entity, str(e.event)) for e in events)
        late.update(simulation.step - e.step for e in events)

    simulation.listen(listen)
    run = simulation.run()

    assert {"sensor", "opened", "activity"} <= {event for _, _, event in heard}
    assert sorted(heard) == stored(run)
    table = run.tables["events"].to_pylist()
    rows = [(row["step"], row["entity"] or "", row["event"]) for row in table]
    assert rows == [each for each in heard if each[2] != "sensor"]
    assert {1} == late
    assert whole(name).digest == run.digest


def test_a_listener_gets_only_its_kinds_and_may_intervene():
    content = DAY | {"robots": {"astro": {"behaviors": [{"type": "come"}, {"type": "patrol"}]}}}
    simulation = fleet2d.Simulation(content, "simulation.start=2026-01-05T07:00")

    def come(events):
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
    simulation = fleet2d.Simulation(DAY, "simulation.duration=10 h")
    heard = []
    simulation.listen(heard.extend)
    simulation.listen_rows(lambda table, row: heard.append(row))

    twin = copy.deepcopy(simulation)
    twin.run()

    assert heard == []
    assert twin._state.awaited == frozenset()


def test_an_unknown_kind_is_refused_with_the_nearest_name():
    with pytest.raises(InputError, match="there is no event 'sensors': did you mean 'sensor'"):
        fleet2d.Simulation(DAY).listen(lambda events: None, ["sensors"])


@pytest.mark.parametrize("event", ["sensor", "opened", "activity", "user_seen"])
@pytest.mark.parametrize("name", CONTENTS)
def test_running_until_an_event_stops_at_the_step_after_it(event, name):
    first = next(step for step, _, kind in stored(whole(name)) if kind == event)
    simulation = fleet2d.Simulation(CONTENTS[name])

    result = simulation.run_until(event=event)

    assert (result.step, simulation.step) == (first, first + 1)


def test_running_until_a_sensor_reports_names_its_state():
    simulation = fleet2d.Simulation(DAY)

    event = simulation.run_until(event="sensor", entity="hall_motion")

    assert event is not None
    assert event.detail == "ON"
    assert simulation.state["hall_motion"]["on"]
