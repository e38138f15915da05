"""Bodies in each other's way: they wait, go round, squeeze past; the same for every span."""

import copy
from itertools import combinations

import numpy as np
import pytest
from tests.entities.robots.robots import assert_same_for_every_max_span
from tests.scenes import digests, everything, expecting, path, run, scenario, unmet
from tests.thorough import some

import fleet2d

BLOCK = {"people_block": "3 s"}
WALK = {"type": "tests.own_components:Scripted", "speed": 1.0}


def walker(start, *script, **more):
    """Somebody who follows a script."""
    return {**WALK, "start": start, "start_heading_deg": 0, "script": list(script), **more}


def home(duration="1 min", block=BLOCK, **sections):
    """The flat, in which bodies block each other's way."""
    return scenario(duration, simulation={**block}, **sections)


def gap(stored, one="ana", other="ben"):
    a, b = path(stored, one), path(stored, other)
    return np.hypot(a.x - b.x, a.y - b.y)


def gives_way(stored):
    rows = stored.pandas("events")
    rows = rows[rows["event"] == "gives_way"]
    return list(zip(rows["step"], rows["entity"], rows["detail"], strict=True))


CASES = {
    "one waits before somebody and then goes round": (
        {"ana": walker([1, 3], [4, 3], 60.0), "ben": {"start": [2.5, 3]}},
        """
        at_most(1, events(gives_way), per=day)
        eventually(events(gives_way, ana, detail=ben))
        always(distance(ana, ben) >= 0.4)
        at_end(distance(ana, [4, 3]) < 2 mm)
        eventually(holds_for(not moving(ana) and distance(ana, [1, 3]) > 0.3, 2 s), within=8 s)
        never(holds_for(not moving(ana) and distance(ana, [4, 3]) > 1.5, 4 s))
        """,
    ),
    # Ben stands in the doorway, too wide to be passed.
    "where there is no way round one squeezes past": (
        {
            "ana": walker([3.05, 3.1], [7.05, 3.1], 60.0),
            "ben": {"start": [5.05, 3.1], "radius": 0.3},
        },
        """
        eventually(distance(ana, ben) < 0.1)
        never(holds_for(distance(ana, ben) < 0.5, 2 s))
        at_end(distance(ana, [7.05, 3.1]) < 2 mm)
        """,
    ),
    "where somebody stands already one stops beside": (
        {"ana": walker([1, 3], [3, 3], 60.0), "ben": {"start": [3, 3]}},
        """
        always(distance(ana, ben) >= 0.4)
        at_end(distance(ana, ben) <= 0.6)
        """,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_how_people_get_past_each_other(name):
    users, expected = CASES[name]
    content = home(users=users, expect=expecting(expected))
    assert [] == unmet(assert_same_for_every_max_span(content, 61, 7, 1))


def test_somebody_who_is_gone_in_time_is_only_waited_for():
    """Ben crosses the way: ana stands for a moment, goes on, and is as late."""
    users = {
        "ana": walker([1, 3], [4, 3], 60.0),
        "ben": walker([2.8, 2.2], [2.8, 3.7], 60.0, start_heading_deg=90, speed=0.4),
    }
    stored = assert_same_for_every_max_span(home(users=users), 7, 1)
    alone = run(home(users={"ana": users["ana"]}))

    assert len(gives_way(stored)) == 1
    assert gap(stored).min() >= 0.39
    late = np.argmax(path(stored, "ana").x > 3.99) - np.argmax(path(alone, "ana").x > 3.99)
    assert 1 <= late <= 3


@pytest.mark.parametrize("starts", [(0.5, 4.5), (0.9, 4.1)], ids=["one waits first", "both wait"])
def test_of_two_who_meet_the_first_one_goes_round(starts):
    users = {
        "ana": walker([starts[0], 3], [4.5, 3], 60.0),
        "ben": walker([starts[1], 3], [0.5, 3], 60.0, start_heading_deg=180),
    }
    stored = assert_same_for_every_max_span(home(users=users), 61, 1)
    ana, ben = path(stored, "ana"), path(stored, "ben")

    assert {("ana", "ben"), ("ben", "ana")} == {row[1:] for row in gives_way(stored)}
    assert gap(stored).min() >= 0.35
    assert np.abs(ana.y - 3).max() > 0.3 > np.abs(ben.y - 3).max()
    assert (4.5, 0.5) == pytest.approx((ana.x[-1], ben.x[-1]), abs=1e-3)


def test_what_was_to_come_later_comes_in_time_after_a_rest():
    """The wait shortens the next stay, so that the plan is in time again."""
    users = {
        "ana": walker([1, 3], [4, 3], 20.0, [4, 1], 60.0),
        "ben": walker([2.5, 3], 5.0, [2.5, 3.7], 60.0),
    }
    alone = path(run(home(users={"ana": users["ana"]})), "ana")
    stored = run(home(users=users))

    assert 1 == [row[1] for row in gives_way(stored)].count("ana")
    assert (path(stored, "ana").y[20:] == alone.y[20:]).all()


def test_without_it_bodies_are_air():
    users = {"ana": walker([1, 3], [4, 3], 60.0), "ben": {"start": [3, 3]}}
    stored = run(home(block={}, users=users))

    assert [] == gives_way(stored)
    assert gap(stored).min() == 0


def test_robots_wait_for_each_other_and_for_people():
    robots = {
        "astro": walker([1, 3], [4, 3], 60.0, radius=0.15),
        "bolt": {"start": [2.5, 3], "start_heading_deg": 0},
    }
    stored = assert_same_for_every_max_span(
        home(robots=robots, users={"ana": {"start": [3.2, 3]}}), 7
    )

    assert "astro" in {row[1] for row in gives_way(stored)}
    assert gap(stored, "astro", "bolt").min() >= 0.3
    assert gap(stored, "bolt", "ana").min() >= 0.35
    assert gap(stored, "astro", "ana").min() >= 0.35


@pytest.mark.slow
@pytest.mark.parametrize("span", some([1, 61], 2))
def test_spans_do_not_show_where_bodies_block_each_other(span):
    content = everything("40 min")
    content["simulation"] |= BLOCK

    assert digests(run(content)) == digests(run(content, max_span=span))


def test_in_a_crowd_bodies_overlap_less_often():
    users = {name: {"type": "meander", "speed": 0.7} for name in ("ana", "ben", "cleo", "dora")}
    blocked, free = (run(home("40 min", block, users=users)) for block in (BLOCK, {}))
    seconds = [
        sum(int((gap(stored, *pair) < 0.4).sum()) for pair in combinations(users, 2))
        for stored in (blocked, free)
    ]

    assert seconds[0] * 5 < seconds[1]


def test_a_family_lives_its_day():
    """Seats, beds, doors and needs: nobody gets stuck, and days go on as they were planned."""
    member = {
        "type": "routine",
        "household": {"members": {"ana": "works_from_home", "ben": "retired", "cleo": "student"}},
    }
    content = {
        "simulation": {"start": "2026-01-05", "duration": "1 d", "seed": 4, **BLOCK},
        "floorplan": {"type": "bundled", "furnish": True},
        "users": dict.fromkeys(("ana", "ben", "cleo"), member),
        "robots": {"astro": {"type": "patrol", "dwell": "1 min"}},
    }
    stored = assert_same_for_every_max_span(content, 997)
    content["simulation"].pop("people_block")
    free = run(content)

    assert 10 < len(gives_way(stored)) < 2000
    for name in ("ana", "ben", "cleo"):
        activities = [
            rows[(rows["event"] == "activity") & (rows["entity"] == name)]["detail"].tolist()
            for rows in (stored.pandas("events"), free.pandas("events"))
        ]
        same = len(set(activities[0]) & set(activities[1])) / len(set(activities[1]))
        assert same > 0.8


@pytest.mark.parametrize("step", ["250 ms", "2 s"])
def test_steps_of_any_length_and_copies_give_the_same(step):
    users = {name: {"type": "meander", "speed": 0.7} for name in ("ana", "ben", "cleo")}
    robots = {
        "astro": {
            "type": "patrol",
            "dwell": "5 s",
            "gives_way": {},
            "camera": {"lost_after": "6 s"},
        }
    }
    content = home("5 min", {**BLOCK, "step": step}, users=users, robots=robots)
    content["sight"] = {"people_occlude": True}
    stored = assert_same_for_every_max_span(content, 61)
    simulation = fleet2d.Simulation(content)
    simulation.advance(83)

    assert digests(stored) == digests(copy.deepcopy(simulation).run()) == digests(simulation.run())
    assert gives_way(stored)
