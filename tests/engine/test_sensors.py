"""Sensors: on and off at the right step, past no wall, in any span, in a table of their own."""

from datetime import timedelta
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.engine.test_change_queue import home, stands, write_three_rooms
from tests.scenes import box, digests, run, table

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


@pytest.fixture(scope="module")
def stored(plan):
    return run(household(plan))


@pytest.mark.slow
def test_readings_are_the_same_for_every_span(plan, stored):
    assert {"hall", "contact", "plug"} <= set(table(stored, "sensors")["sensor"])
    for span in (1, 7):
        assert digests(stored) == digests(run(household(plan), max_span=span))


def test_algorithms_are_handed_the_readings(stored):
    said = table(stored, "collector")["said"]
    assert len(table(stored, "sensors")["step"]) == int(np.sum(said))


def test_contact_sensor_and_one_of_a_users_own_follow_the_door(stored):
    events = table(stored, "events")
    doors = [
        (int(step), {"opened": "OPEN", "shut": "CLOSE"}[event])
        for step, entity, event in zip(
            events["step"], events["entity"], events["event"], strict=True
        )
        if entity == "door" and step > 0
    ]
    assert doors == readings(stored, "contact")
    assert len(doors) >= 4
    words = {"OPEN": "FREE", "CLOSE": "SHUT"}
    expected = [(0, "SHUT"), *((step, words[word]) for step, word in doors)]
    assert expected == readings(stored, "latch")


def test_plug_is_on_while_somebody_stays_at_the_stove_and_a_little_after(stored):
    (on, began), (off, ended) = readings(stored, "plug")
    where = table(stored, "trajectories", entity="ana")
    there = np.flatnonzero((abs(where["x"] - 0.3) < 0.3) & (abs(where["y"] - 2.1) < 0.3))
    assert ("ON", "OFF") == (began, ended)
    assert there[0] < on <= there[0] + 2
    assert there[-1] + 25 < off <= there[-1] + 32
    assert "Cook" == table(stored, "sensors", sensor="plug")["activity"][0]


def test_motion_sensor_notices_who_walks_in_its_view_and_nobody_who_stands(stored):
    where = table(stored, "trajectories", entity="ana")
    moved = np.flatnonzero((np.diff(where["x"]) != 0) | (np.diff(where["y"]) != 0)) + 1
    hall = moved[(where["x"][moved] > 4.2) & (where["x"][moved] < 7.9)]
    said = readings(stored, "hall")
    ons = [step for step, state in said if state == "ON"]
    assert all(min(abs(hall - on)) <= 1 for on in ons)
    spans = [(a, b) for (a, _), (b, _) in zip(said[::2], said[1::2], strict=True)]
    assert all(any(a <= step <= b for a, b in spans) for step in hall.tolist())
    assert sum(b - a for a, b in spans) < 150


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
