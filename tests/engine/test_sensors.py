"""Sensors: on and off at the right step, past no wall, in any span, in a table of their own."""

from datetime import timedelta
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.engine.test_change_queue import home, stands, write_three_rooms
from tests.scenes import box, digests, expecting, run, table, unmet

import fleet2d
from fleet2d import Algorithm, InputError
from fleet2d.entities.sensor import Sensor, SensorState


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    lies = {"x": 10, "y": 0.7, "heading": 0, "posture": "lie", "approach": [10, 1.8]}
    bed = {"name": "bed", "type": "bed", "footprint": box(9, 0, 11, 1.4), "uses": [lies]}
    cooks = {"x": 0.3, "y": 2.1, "heading": 1.57, "posture": "stand"}
    stove = {"name": "stove", "type": "stove", "footprint": box(0, 2.4, 0.6, 3), "uses": [cooks]}
    return write_three_rooms(tmp_path_factory.mktemp("rooms"), bed, stove)


def visits(*items):
    agenda = [{"at": at, "place": place, "activity": what} for at, place, what in items]
    return {"type": "schedule", "days": [{"items": agenda}]}


def readings(stored, sensor):
    rows = table(stored, "sensors", sensor=sensor)
    return list(zip(rows["step"].tolist(), rows["state"].tolist(), strict=True))


class Collector(Algorithm):
    """Counts what the sensors said."""

    def update(self, history, state):
        return {"said": len(history.readings.step), "on": int(history.readings.on.sum())}


class Latch(Sensor):
    """Reports that a door is shut."""

    of: str
    words: ClassVar[tuple[str, str]] = ("SHUT", "FREE")

    def watch(self, door):
        self.door = door

    def place(self, home):
        return home.rooms[home.doors[self.door].rooms[1]].name

    def sense(self, view, home):
        steps = np.arange(view.steps if self.door in home.shut else 0) + view.first
        return steps, np.full(len(steps), -1)


class Nap(fleet2d.Behavior):
    """Lies down for two minutes, and gets up for good."""

    def decide(self, now):
        plan = now.plan().use("bed").stay(timedelta(minutes=2))
        return plan.go_to([9, 2.4]).stay()


def household(plan):
    day = visits(
        ("00:05", [6, 1.45], "Step_Out"),
        ("00:10", [9.5, 2.4], "Sleep"),
        ("00:20", [0.3, 2.1], "Cook"),
        ("00:40", [2, 1.45], "Relax"),
    )
    return home(
        plan,
        "1 h",
        users={"ana": day},
        objects={
            "hall": {"type": "motion_sensor", "at": [6, 2.9], "range": "5 m", "hold": "10 s"},
            "door": {"type": "door", "doorway": "bathroom_1", "open": False, "closes_after": "5 s"},
            "contact": {"type": "contact_sensor", "of": "door"},
            "latch": {"type": f"{__name__}:Latch", "of": "door"},
            "plug": {"type": "smart_plug", "of": "stove", "hold": "30 s"},
            "bed_sensor": {"type": "occupancy_sensor", "of": "bed"},
        },
        algorithms={"collector": {"type": f"{__name__}:Collector", "period": "10 min"}},
    )


EXPECTED = """
    after(moving(ana) and distance(ana, [6.0, 1.5]) < 1.8, sensor(hall), within=1 s)
    never(sensor(hall) and not once(moving(ana) and distance(ana, hallway) < 0.5, within=12 s))
    never(sensor(contact) and not door(door))
    never(door(door) and not sensor(contact))
    never(sensor(latch) and door(door))
    never(not sensor(latch) and not door(door))
    eventually(door(door))
    after(distance(ana, [0.3, 2.1]) < 0.1, sensor(plug), within=2 s)
    never(sensor(plug) and not once(distance(ana, [0.3, 2.1]) < 0.3, within=32 s))
    always(implies(once(distance(ana, [0.3, 2.1]) < 0.1, within=25 s) and once(sensor(plug), within=1 min), sensor(plug)))
"""  # fmt: skip


@pytest.fixture(scope="module")
def stored(plan):
    return run(household(plan) | {"expect": expecting(EXPECTED)})


def test_sensors_say_what_happens_before_them_and_algorithms_are_handed_it(stored):
    rows = table(stored, "sensors")
    assert [] == unmet(stored)
    assert "Cook" == rows["activity"][rows["sensor"] == "plug"][0]
    assert len(rows["step"]) == int(np.sum(table(stored, "collector")["said"]))


@pytest.mark.slow
def test_readings_are_the_same_for_every_span(plan, stored):
    for span in (1, 7, 100):
        other = digests(run(household(plan), max_span=span))
        assert other.keys() - digests(stored).keys() == set()
        assert all(digests(stored)[name] == other[name] for name in other if name != "run")


@pytest.mark.parametrize(
    ("sensor", "is_open", "hears"),
    [
        ({"at": [6, 1.45], "range": "9 m"}, False, False),
        ({"at": [6, 1.45], "range": "9 m"}, True, True),
        ({"at": [2, 0.01], "heading_deg": 90, "angle_deg": 170}, False, True),
        ({"at": [2, 0.01], "heading_deg": -90, "angle_deg": 170}, False, False),
    ],
    ids=["behind a door", "past an open one", "before it", "behind its back"],
)
def test_motion_sensor_sees_past_no_door_and_only_what_it_faces(plan, sensor, is_open, hears):
    objects = {
        "pir": {"type": "motion_sensor", **sensor},
        "door": {"type": "door", "doorway": "kitchen_1", "open": is_open},
    }
    users = {"ana": {"type": "meander", "start": [2, 1.5]}}
    assert hears == bool(readings(run(home(plan, "5 min", users=users, objects=objects)), "pir"))


def test_bed_is_occupied_while_somebody_lies_in_it(plan):
    naps = {**stands(9, 2.4), "behaviors": [{"type": f"{__name__}:Nap"}]}
    sensor = {"bed_sensor": {"type": "occupancy_sensor", "of": "bed"}}
    simulation = fleet2d.Simulation(home(plan, "5 min", users={"ana": naps}, objects=sensor))
    simulation.advance(60)
    assert {"on": True} == simulation.state["bed_sensor"]
    (on, _), (off, _) = readings(simulation.run(), "bed_sensor")
    assert on < 15
    assert 120 <= off - on <= 126


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        ({"type": "contact_sensor", "of": "gate"}, "objects.s.of: there is no door 'gate'"),
        ({"type": "occupancy_sensor", "of": "sofa"}, "no object 'sofa'.*bed"),
        ({"type": "smart_plug", "of": "cart"}, "cart has no place to use it from"),
        ({"type": "motion_sensor", "at": [50, 50]}, "outside the home"),
    ],
)
def test_sensor_of_what_is_not_there_is_refused(plan, sensor, message):
    with pytest.raises(InputError, match=message):
        fleet2d.Simulation(home(plan, users={"ana": stands(6, 1.4)}, objects={"s": sensor}))


@given(st.sets(st.integers(0, 39)), st.integers(0, 6), st.lists(st.integers(1, 15), min_size=40))
def test_sensor_goes_off_when_it_was_quiet_for_its_hold(excited, hold, spans):
    state, readings, begin = SensorState(hold), [], 0
    for length in spans:
        end = min(40, begin + length)
        steps = np.array([s for s in sorted(excited) if begin <= s < end], np.int64)
        readings += [(r.step, r.on) for r in state.read(steps, np.zeros_like(steps), end)]
        begin = end
    expected, on, last = [], False, 0
    for step in range(40):
        if step in excited:
            if not on:
                expected.append((step, True))
            on, last = True, step
        elif on and step > last + hold:
            expected.append((step, False))
            on = False
    assert expected == readings
