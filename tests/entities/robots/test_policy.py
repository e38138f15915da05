"""Policies: what they observe, which actions they have, and what a robot does then."""

from datetime import datetime

import numpy as np
import pytest
from tests.entities.robots.robots import (
    OUT,
    assert_same_for_every_max_span,
    events,
    home_with,
    names,
)
from tests.scenes import run

import fleet2d
from fleet2d import Simulation
from fleet2d.engine.access import run_until_asked, situation_of
from fleet2d.entities.robots.policy import COLUMNS, Policy, SightingMemory
from fleet2d.errors import ComponentError, InputError
from fleet2d.interventions import Send
from fleet2d.kernels import SUB, SightingColumn
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.local_time import zone_of

AT = {name: number for number, name in enumerate(COLUMNS)}
CLASS = "tests.entities.robots.test_policy:Farthest"


class Farthest(Policy):
    """Go where it takes longest to go, unless somebody was seen lately."""

    def act(self, observation, mask):
        seen = observation[:, AT["seen_30min"]]
        scores = np.append(observation[:, AT["way"]] + 2 * seen, -1.0)
        return int(np.argmax(np.where(mask, scores, -np.inf)))


class Fixed(Policy):
    """Choose one action again and again."""

    action: int = 0

    def act(self, observation, mask):
        return self.action


def policy(task="hangout", **fields):
    return {"type": CLASS, "task": task, "period": "10 min", **fields}


def fixed(action, **fields):
    return {
        "type": f"{CLASS.partition(':')[0]}:Fixed",
        "action": action,
        "period": "10 min",
        **fields,
    }


def lives(content, choose):
    """Let a function of the simulation choose all actions; return the observations, too."""
    simulation, observations = Simulation(content), []
    while run_until_asked(simulation, "astro"):
        behavior = simulation.actors["astro"].behaviors[0]
        now = situation_of(simulation, "astro")
        observations.append(behavior.observe(now))
        behavior.given = choose(behavior, observations[-1], behavior.mask(now))
    return simulation, observations


@pytest.mark.slow
@pytest.mark.parametrize("task", ["hangout", "find", "patrol"])
def test_a_run_with_a_policy_is_the_same_for_every_max_span(task):
    stored = assert_same_for_every_max_span(home_with([policy(task, every="20 min")], "90 min"))

    assert {"hangout": "relocates", "find": "find_begins", "patrol": "visits"}[task] in names(
        stored
    )


@pytest.mark.parametrize("task", ["hangout", "find", "patrol"])
def test_actions_from_outside_repeat_the_run_of_the_policy(task):
    content = home_with([policy(task, every="20 min")], "90 min")
    simulation, _ = lives(content, lambda behavior, table, mask: behavior.act(table, mask))

    assert run(content).digest == simulation.finish().digest


def test_what_was_never_perceived_is_not_in_observations():
    """Two lives that differ only in where somebody is whom the robot never sees."""
    blind = {"camera": {"range": [0.2, 0.21], "angle_deg": 1}}
    places = ([7.0, 6.0], "bedroom")
    people = [
        {"type": "schedule", "days": [{"items": [{"at": "00:00", "place": place}]}]}
        for place in places
    ]
    ways = [
        lives(home_with([policy()], "3 h", ana, astro=blind), lambda *_: 2)[1] for ana in people
    ]

    assert len(ways[0]) > 10
    assert np.array_equal(*map(np.stack, ways))


def test_what_was_perceived_is_in_observations():
    simulation = Simulation(home_with([policy()], "2 h"))
    room = simulation.home.plan.room("bathroom_1").index
    first, _, now, *_ = lives(home_with([policy()], "2 h"), lambda *_: room)[1]
    columns = ["in_view", "seen_30min_0", "habit_now", "habit", "here"]

    assert 0 == first[:, AT["seen_30min"]].max()
    assert [1] * 5 == pytest.approx(now[room, [AT[name] for name in columns]], abs=0.01)
    assert 1 == now[:, AT["here"]].sum()


def test_observation_describes_the_home_and_pads_it():
    table = lives(home_with([policy(rooms=9)], "30 min"), lambda *_: 0)[1][0]
    plan = Simulation(home_with([policy()])).home.plan

    assert (9, len(COLUMNS)) == table.shape
    assert np.float32 == table.dtype
    assert [1] * 6 + [0] * 3 == table[:, AT["room"]].tolist()
    assert not table[6:, : AT["hour_sin"]].any()
    assert [plan.room("storage_1").index] == np.flatnonzero(table[:6, AT["reachable"]] == 0)
    assert 1 == table[plan.room("kitchen_1").index, AT["is_kitchen"]]
    assert pytest.approx(1) == table[:, AT["area"]].sum()
    assert np.abs(table).max() <= 1


def test_rooms_without_a_way_are_masked_and_rest_is_always_possible():
    masks = []
    lives(home_with([policy()], "30 min"), lambda _, __, mask: masks.append(mask) or 16)
    storage = Simulation(home_with([policy()])).home.plan.room("storage_1").index

    expected = [n < 6 and n != storage for n in range(16)]
    assert [*expected, True] == masks[0].tolist()


@pytest.mark.parametrize(
    ("action", "reason"),
    [(4, "can't be reached"), (7, "doesn't exist"), (17, "from 0 to 16"), (-1, "from 0 to 16")],
)
def test_impossible_action_is_an_error_with_the_reason(action, reason):
    assert 4 == Simulation(home_with([policy()])).home.plan.room("storage_1").index
    with pytest.raises(ComponentError, match=f"robots.astro failed at step 0.*{reason}"):
        run(home_with([fixed(action)]))


def test_policy_without_a_file_says_what_to_give():
    with pytest.raises(ComponentError, match=r"file: hangout\.onnx"):
        run(home_with([{"type": "policy"}]))


@pytest.mark.parametrize(
    ("behavior", "robot", "message"),
    [
        ({"type": "policy", "file": "net.pt"}, {}, r"suffix \.onnx, got net\.pt"),
        (policy(rooms=4), {}, r"6 rooms.*set rooms: 6"),
        (policy(), {"camera": None}, "has no camera"),
    ],
)
def test_what_no_policy_can_work_with_is_refused(tmp_path, monkeypatch, behavior, robot, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "net.pt").touch()
    with pytest.raises(InputError, match=message):
        Simulation(home_with([behavior], astro=robot))


def test_search_ends_when_the_person_is_found_or_the_deadline_is_over():
    found = run(home_with([policy("find", every="20 min")], "30 min"))
    lost = run(home_with([policy("find", every="20 min", deadline="3 min")], "30 min", ana=OUT))

    assert ["find_begins", "found"] * 2 == names(found)
    assert ["find_begins", "gave_up"] * 2 == names(lost)


def test_who_was_interrupted_close_to_a_corner_may_still_go_to_all_rooms():
    """The middle of its cell wasn't free, so that no room had a way, and all were masked."""
    simulation = Simulation(home_with([policy()], "1 h"))
    run_until_asked(simulation, "astro")
    actor = simulation.actors["astro"]
    behavior = actor.behaviors[0]
    free = behavior.mask(situation_of(simulation, "astro"))
    plan = actor.space.plan
    cells = (plan.lattice.cell_centre(*cell) for cell in np.ndindex(plan.room_of_cell.shape))
    ways = ((xy, actor.space.distances(xy, behavior.poses.points)) for xy in cells)
    x, y = next(xy for xy, metres in ways if np.isinf(metres).all())
    actor.state = actor.state._replace(x=x, y=y)

    assert free.tolist() == behavior.poses.ways(17).mask.tolist()


def test_last_action_of_a_search_gives_it_up():
    content = home_with([fixed(16, task="find", every="20 min")], "30 min", ana=OUT)

    assert [(0, "find_begins"), (0, "gave_up"), (1200, "find_begins"), (1200, "gave_up")] == [
        (step, event) for step, event, _ in events(run(content))
    ]


@pytest.mark.parametrize(("chosen", "is_empty"), [(None, True), (16, False)])
def test_empty_battery_ends_all_decisions_and_rest_charges(chosen, is_empty):
    battery = {"driving": "10 min", "standing": "1 h", "charging": "30 min", "charger": "kitchen"}
    content = home_with([policy("patrol", dwell="1 s")], "4 h", astro={"battery": battery})
    choose = (lambda b, table, mask: b.act(table, mask)) if chosen is None else (lambda *_: chosen)
    simulation, tables = lives(content, choose)

    assert is_empty == simulation.actors["astro"].charge.is_empty
    assert is_empty == (min(table[0, AT["charge"]] for table in tables) < 0.9)


def test_order_is_carried_out_without_asking_the_policy():
    simulation = Simulation(home_with([policy()], "1 h"))
    simulation.do(Send("astro", "bedroom", duration="30 min"))

    assert ["astro"] == run_until_asked(simulation, "astro")
    assert simulation.step >= 1800


def test_a_robot_that_was_off_remembers_no_sightings():
    act = {"at": "08:00", "power": "astro", "state": "crash"}
    content = home_with([policy()], "3 h")
    content["script"] = [act]
    assert_same_for_every_max_span(content, 61)
    simulation = Simulation(content)
    simulation.run_until("08:02")
    memory = simulation.actors["astro"].recall()
    last = int(memory.rooms[0].max())
    assert last < 0 or last >= 3660
    simulation.run()
    assert memory is simulation.actors["astro"].recall()
    assert int(memory.rooms[0].max()) > 3660


def test_memory_counts_looks_by_the_hour_that_the_clock_reads():
    """Four hours over the night in which it reads an hour twice: a look each minute."""
    plan = fleet2d.load_floorplan("family_home")
    zone = zone_of("Europe/Berlin", datetime(2026, 10, 24), datetime(2026, 10, 26))
    memory = SightingMemory(plan, 1, Clock(zone.at(datetime(2026, 10, 25, 1)), 60_000_000, 240))
    row, column = np.argwhere(plan.room_of_cell >= 0)[0]
    rows = np.zeros((240, len(SightingColumn)), np.int64)
    rows[:, SightingColumn.STEP] = np.arange(240)
    rows[:, SightingColumn.X], rows[:, SightingColumn.Y] = column * SUB, row * SUB
    memory.take(rows[:, SightingColumn.STEP], np.arange(240, dtype=np.int32), rows)

    room = int(plan.room_of_cell[row, column])
    assert [60, 120, 60, 0] == memory.rooms.looks[0, room, 1:5].tolist()
    assert 239 == memory.rooms.last[0, room]
