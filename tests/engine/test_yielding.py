"""Robots keep clear of people and of each other; the odd cases, and 300 random homes full of them."""

from itertools import combinations, product

import numpy as np
import pytest
import shapely
from tests.entities.robots.robots import assert_same_for_every_max_span
from tests.scenes import box, entries, expecting, path, run, unmet, write_plan
from tests.scenes import scenario as of_ghosts
from tests.thorough import some

import fleet2d
from fleet2d.entities.behavior import Situation
from fleet2d.errors import ScenarioError
from fleet2d.runtime.determinism import Draws

WALK = {"type": "tests.own_components:Scripted"}


def scenario(duration, **sections):
    """A scenario in the flat, in which robots yield."""
    simulation = {"ghosts": False} | sections.pop("simulation", {})
    return of_ghosts(duration, simulation=simulation, **sections)


def robot(start, *script, **more):
    """A robot that follows a script: places, and times to stay [s]."""
    return {**WALK, "start": start, "script": list(script), "camera": None, **more}


def person(start, *script, **more):
    return {**WALK, "start": start, "script": list(script), "speed": 1.0, **more}


def nearest(stored, one, other, until=None):
    """The smallest gap between two bodies at home, from the stored paths; below 0 they overlap [m]."""
    a, b = path(stored, one), path(stored, other)
    gaps = np.hypot(a.x - b.x, a.y - b.y) - radius(stored, one) - radius(stored, other)
    return float(gaps[:until][~(a.away | b.away)[:until]].min(initial=np.inf))


def radius(stored, name):
    config = stored.manifest["scenario"]
    return {**config["users"], **config["robots"]}[name]["radius"]


def told(stored, *kinds):
    rows = stored.pandas("events")
    rows = rows[rows["event"].isin(kinds)]
    return list(zip(rows["step"], rows["event"], rows["entity"], rows["detail"], strict=True))


def ends_at(stored, name):
    way = path(stored, name)
    return round(float(way.x[-1]), 2), round(float(way.y[-1]), 2)


def corridor(folder, low=1.25, high=1.75):
    """Two rooms, and a corridor of five metres between them, through which one robot fits."""
    boxes = {
        "kitchen": box(0, 0, 3, 3),
        "corridor": box(3, low, 8, high),
        "bedroom": box(8, 0, 11, 3),
    }
    space = shapely.union_all([shapely.Polygon(each) for each in boxes.values()])
    outline = [list(corner) for corner in space.exterior.coords[:-1]]
    return {"type": "native", "path": write_plan(folder, outline, boxes)}


IN_CORRIDOR = {
    "butler": robot([3.5, 1.5], [7.5, 1.5], 30.0, [1.0, 1.0], 900.0),
    "guard": robot([7.5, 1.5], [3.5, 1.5], 30.0, [1.0, 2.0], 900.0),
    "third": robot([8.5, 1.5], [5.0, 1.5], 30.0, [1.0, 1.5], 900.0),
}
CASES = {
    # The complaint: two on the same spot for an hour.
    "two on one spot part and never meet again": (
        {"robots": {"butler": robot([2, 3]), "guard": robot([2, 3])}},
        """
        always(distance(butler, guard) >= 0.3, within=10 s..1 h)
        at_end(distance(butler, [2, 3]) < 1 cm or distance(guard, [2, 3]) < 1 cm)
        """,
    ),
    "one that is put into another moves out of it": (
        {
            "robots": {"butler": robot([1, 3]), "guard": robot([4, 1])},
            "users": {"ana": person([4, 3])},
            "script": entries("at: 1 min, put: guard, to: [1.1, 3.0]"),
        },
        """
        eventually(distance(butler, guard) < 0.3)
        always(distance(butler, guard) >= 0.3, within=70 s..1 h)
        """,
    ),
    "two who meet in a corridor of one's width both get through": (
        {
            "robots": {
                "butler": robot([1.0, 1.5], [10.0, 1.5], 900.0),
                "guard": robot([10.5, 1.5], [1.0, 1.5], 900.0),
            },
            "floorplan": None,
        },
        """
        always(distance(butler, guard) >= 0.3)
        eventually(distance(butler, [10.0, 1.5]) < 1 cm, within=4 min)
        eventually(distance(guard, [1.0, 1.5]) < 1 cm, within=4 min)
        """,
    ),
    # The one without the right of way is hemmed in by a third: the other one has to back off.
    "one that is caught in the corridor ends the deadlock with an event": (
        {"robots": IN_CORRIDOR, "floorplan": None},
        """
        always(distance(butler, guard) >= 0.3)
        always(distance(butler, third) >= 0.3)
        always(distance(guard, third) >= 0.3)
        eventually(events(deadlock))
        never(during(07:14-07:15) and (speed(butler) > 0.01 or speed(guard) > 0.01))
        never(during(07:14-07:15) and speed(third) > 0.01)
        """,
    ),
    "a person asleep before the door is waited for, and the stop is skipped": (
        {
            "robots": {"butler": robot([1.0, 1.5], [10.0, 1.5], 60.0, [1.0, 2.5], 9000.0)},
            "users": {"ana": person([3.3, 1.5])},
            "floorplan": None,
        },
        """
        always(distance(butler, ana) >= 0.35)
        eventually(events(gives_way, butler, detail=ana) and during(07:02-07:03))
        after(events(gives_way, butler), events(gives_up, butler, detail=ana), within=1 h)
        """,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_how_robots_yield(name, tmp_path):
    sections, expected = CASES[name]
    content = scenario("1 h", expect=expecting(expected)) | sections
    if "floorplan" in sections:
        content["floorplan"] = corridor(tmp_path)
    assert [] == unmet(assert_same_for_every_max_span(content, 61, 1))


@pytest.mark.parametrize("people_block", [None, "3 s"])
def test_two_robots_that_go_to_one_spot_stop_beside_each_other(people_block):
    robots = {"butler": robot([1, 1], [3, 3], 600.0), "guard": robot([4, 1], [3, 3], 600.0)}
    content = scenario("5 min", robots=robots, simulation={"people_block": people_block})
    stored = assert_same_for_every_max_span(content, 61, 1)
    assert 0 <= nearest(stored, "butler", "guard")
    assert ends_at(stored, "butler") == (3.0, 3.0)
    assert np.hypot(*(np.array(ends_at(stored, "guard")) - 3)) < 0.6


def test_ghosts_pass_through_each_other():
    robots = {"butler": robot([1, 3], [4, 3], 60.0), "guard": robot([2.5, 3])}
    stored = run(scenario("1 min", robots=robots, simulation={"ghosts": True}))
    assert nearest(stored, "butler", "guard") < 0
    assert not told(stored, "gives_way", "overlaps")


def test_robots_that_are_drawn_begin_apart():
    robots = {f"r{i}": {"start": "bathroom", "camera": None} for i in range(6)}
    stored = run(scenario("10 s", robots=robots))
    assert all(nearest(stored, *pair) >= 0 for pair in combinations(robots, 2))


def test_five_robots_queue_at_one_charger():
    battery = {"driving": "40 min", "standing": "3 h", "charging": "10 min", "charger": [1.0, 3.0]}
    behaviors = [
        {"type": "dock", "threshold": "60 %", "until": "80 %"},
        {"type": "patrol", "dwell": "30 s"},
    ]
    one = {"battery": {**battery, "charge": "50 %"}, "camera": None, "behaviors": behaviors}
    robots = {f"r{i}": {**one, "start": "living_room"} for i in range(5)}
    stored = assert_same_for_every_max_span(scenario("3 h", robots=robots), 61)
    assert all(nearest(stored, *pair) >= 0 for pair in combinations(robots, 2))
    assert {entity for _, _, entity, _ in told(stored, "charged")} == set(robots)


def test_a_robot_leaves_in_time_for_a_person_whose_life_stays_the_same():
    users = {"ana": person([0.6, 3], 20.0, [4.4, 3], 20.0, [0.6, 3], 20.0)}
    stored = assert_same_for_every_max_span(
        scenario("2 min", users=users, robots={"butler": robot([2.5, 3])}), 61, 1
    )
    ghost = run(scenario("2 min", users=users, robots={"butler": robot([2.5, 3])}, simulation={"ghosts": True}))  # fmt: skip
    assert nearest(stored, "butler", "ana") >= 0 > nearest(ghost, "butler", "ana")
    assert (path(stored, "ana").x == path(ghost, "ana").x).all()
    assert ends_at(stored, "butler") == (2.5, 3.0)
    assert not told(stored, "overlaps")


def test_what_a_log_forces_is_counted_and_told(tmp_path):
    log = tmp_path / "ana.csv"
    rows = [f"2026-01-05T07:00:{s:02},{3.0 if s < 30 else 1.0},3.0" for s in range(60)]
    log.write_text("time,x,y\n" + "\n".join(rows))
    users = {"ana": {"type": "replay", "path": str(log), "gaps": "hold"}}
    robots = {"butler": robot([1.0, 3.0], speed=0.02)}
    stored = assert_same_for_every_max_span(scenario("50 s", users=users, robots=robots), 7, 1)
    assert nearest(stored, "butler", "ana") < 0
    assert [("overlaps", "butler", "ana")] == [row[1:] for row in told(stored, "overlaps")]
    assert "robots.butler: ana walked into it 1 time" in stored.manifest["notes"]


def test_who_yields_is_a_rule_that_can_be_replaced():
    def yields(rule):
        battery = {"driving": "2 h", "standing": "10 h", "charging": "3 h", "charger": [1, 1]}
        robots = {
            "butler": robot([1, 3], [4, 3], 60.0, battery=battery),
            "guard": robot([4, 3], [1, 3], 60.0, battery={**battery, "charge": "30 %"}),
        }
        content = scenario("1 min", robots=robots, simulation={"right_of_way": rule})
        stored = assert_same_for_every_max_span(content, 1)
        assert nearest(stored, "butler", "guard") >= 0
        return {entity for _, _, entity, _ in told(stored, "gives_way")}

    assert {"guard"} == yields("listed")
    assert {"butler"} == yields("low_battery")
    with pytest.raises(ScenarioError, match="low_batery"):
        yields("low_batery")


def yielding_of(simulation):
    """What lets the robots of a run yield."""
    found = simulation._state.yielding
    assert found is not None
    return found


def test_the_second_of_two_blocked_robots_does_not_swap_the_right_of_way_back():
    """Each of two that blocked the other ended the deadlock, a second apart, and so none did."""
    robots = {"butler": robot([1, 3]), "guard": robot([4, 3])}
    yielding = yielding_of(fleet2d.Simulation(scenario("1 min", robots=robots)))
    before = yielding._first_now(0)
    yielding._swap(0, 1, 0)
    yielding._swap(1, 0, 1)
    assert (yielding._first_now(1) != before).any()
    yielding._swap(1, 0, 10)
    assert (yielding._first_now(10) == before).all()


def test_who_goes_first_drives_round_another_one_that_stands():
    """It stopped before it every two seconds, until the deadlock was ended."""
    robots = {"butler": robot([1, 3], [4, 3], 60.0), "guard": robot([2, 3])}
    simulation = fleet2d.Simulation(scenario("1 min", robots=robots))
    simulation.advance(1)
    butler = simulation._state.actors[0]
    now = Situation(butler, simulation.step, (), {})
    ((_, plan),) = yielding_of(simulation)._plans(now, simulation.step, 1)
    track = plan.finish().breakpoints
    goal = butler.home.plan.lattice.point_at((4.0, 3.0))
    assert (int(track.x[-1]), int(track.y[-1])) == goal
    stands = (np.diff(track.x) == 0) & (np.diff(track.y) == 0) & (np.diff(track.time) >= 2_000_000)
    assert not stands[:2].any()


# --- Random homes ------------------------------------------------------------------------------


def random_scenario(number):
    """One to ten robots, none to six people, doors and interventions, in the flat."""
    draws = Draws(np.uint64(51), number)
    behaviors = [
        {"type": "patrol", "dwell": "5 s"},
        {"type": "patrol", "dwell": "1 min", "order": "random"},
        {"type": "meander"},
        {"type": "hangout", "period": "5 min"},
        {"type": "explore"},
    ]
    robots = {
        f"r{i}": {
            "camera": {"range": [0.2, 4], "angle_deg": 120},
            "radius": 0.1 + 0.05 * draws.below(4),
            "speed": 0.3 + 0.3 * draws.below(3),
            "behaviors": [behaviors[draws.below(len(behaviors))]],
        }
        for i in range(1 + draws.below(10))
    }
    users = {}
    for i in range(draws.below(7)):
        kinds = [
            {"type": "meander", "speed": 0.7},
            {"type": "room_sampling", "shares": {"kitchen": 0.5, "living_room": 0.5}},
            person([1.0, 3.0], 5.0, [7.0, 3.1], 20.0, [1.0, 1.0], 600.0),
        ]
        users[f"u{i}"] = kinds[draws.below(len(kinds))]
    script = [
        {"at": "07:01", "hold": "r0", "duration": "40 s"},
        {"at": "07:02", "send": "r0", "to": "kitchen", "duration": "1 min"},
        {"at": "07:03", "keep_out": "r0", "of": "kitchen", "duration": "1 min"},
        {"at": "07:02:30", "shut": "door"},
    ]
    objects = {"door": {"type": "door", "doorway": [5.05, 3.1]}}
    chosen = [act for act in script if draws.below(2)]
    return scenario("6 min", robots=robots, users=users, script=chosen, objects=objects)


@pytest.mark.slow
@pytest.mark.parametrize("number", sorted({*some(range(300), 25), 100, 107}))
def test_in_random_homes_robots_overlap_with_nobody_who_does_not_walk_into_them(number):  # fmt: skip
    content = random_scenario(number)
    stored = run(content)
    robots, users = content["robots"], content["users"]
    for pair in combinations(robots, 2):
        assert nearest(stored, *pair) >= 0, pair
    # Until somebody walks into it, no robot overlaps with the person.
    forced = {(entity, detail): step for step, _, entity, detail in reversed(told(stored, "overlaps"))}  # fmt: skip
    for pair in product(robots, users):
        assert nearest(stored, *pair, forced.get(pair)) >= 0, pair
    assert run(content, max_span=7).digest == stored.digest


@pytest.mark.slow
@pytest.mark.parametrize("number", some(range(300, 340), 8))
def test_in_random_homes_every_robot_reaches_a_goal_or_says_why_not(number):
    content = random_scenario(number)
    for one in content["robots"].values():
        one["behaviors"] = [{"type": "patrol", "dwell": "5 s"}]
    content["users"] = dict(list(content["users"].items())[:2])
    content["script"] = []
    content["simulation"]["duration"] = "20 min"
    stored = fleet2d.run(content)
    reasons = {entity for _, _, entity, _ in told(stored, "gives_up", "way_blocked", "deadlock", "overlaps")}  # fmt: skip
    for name in content["robots"]:
        way = path(stored, name)
        moved = np.hypot(np.diff(way.x), np.diff(way.y)).sum()
        rooms = set(np.asarray(way.room).tolist())
        assert moved > 2 or name in reasons, name
        assert len(rooms) > 1 or name in reasons, name
