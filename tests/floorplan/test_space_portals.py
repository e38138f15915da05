"""A home of two storeys side by side, which stairs link for people."""

import json

import numpy as np
import pytest
from tests.scenes import path, run
from tests.scenes import scenario as lives

import fleet2d
from fleet2d.errors import FloorPlanError, ScenarioError
from fleet2d.floorplan.checkup import checkup
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.load import load_floorplan

STAIRS = {"start": [4.5, 3.5], "end": [8.5, 3.5], "takes": 14}
HOUSE = {
    "format": "fleet2d-floorplan",
    "version": 1,
    "free": [[[0, 0], [5, 0], [5, 4], [0, 4]], [[8, 0], [13, 0], [13, 4], [8, 4]]],
    "rooms": [
        {"type": "living_room", "polygon": [[0, 0], [3, 0], [3, 4], [0, 4]]},
        {"type": "kitchen", "polygon": [[3, 0], [5, 0], [5, 4], [3, 4]]},
        {"type": "bedroom", "polygon": [[8, 0], [11, 0], [11, 4], [8, 4]]},
        {"type": "bathroom", "polygon": [[11, 0], [13, 0], [13, 4], [11, 4]]},
    ],
    "portals": [STAIRS],
    "entrance": [0.5, 0.5],
}


def house(folder, **changes):
    path = folder / "house.json"
    path.write_text(json.dumps(HOUSE | changes))
    return path


def test_storeys_are_one_part_for_people_and_two_for_robots(tmp_path):
    home = Home(load_floorplan(house(tmp_path)))

    assert 2 == home.space(0.2).parts
    people = home.space(0.2, uses_portals=True)
    assert 1 == people.parts
    assert frozenset(range(4)) == people.rooms_of(0)


@pytest.mark.parametrize("period", ["1 s", "1 h"])
def test_stairs_are_no_way_through_the_plan(tmp_path, period):
    """Who went upstairs covered the metres between two storeys in the plan, at 26 m/s."""
    far = [[[x + 22 * (x >= 8), y] for x, y in ring] for ring in HOUSE["free"]]
    rooms = [HOUSE["rooms"][0], {"type": "bedroom", "polygon": far[1]}]
    stairs = {**STAIRS, "end": [30.5, 3.5]}
    plan = house(tmp_path, free=far, rooms=rooms, portals=[stairs])
    stays = [{"at": "08:00", "place": "living_room", "dwell": "5 min"}, {"place": "bedroom"}]
    scenario = {
        "simulation": {"start": "2026-01-05T08:00", "duration": "1 h", "seed": 1},
        "floorplan": {"type": "native", "path": str(plan)},
        "users": {"ana": {"type": "schedule", "days": [{"on": "daily", "items": stays}]}},
        "metrics": {"distance": {"period": period}},
        "expect": {
            "walks": "always(speed(ana) < 2 m/s)",
            "climbs": "eventually(room(ana) == bedroom)",
        },
    }
    done = fleet2d.run(scenario)
    assert {"walks": True, "climbs": True} == {
        n: v["holds"] for n, v in done.manifest["expectations"].items()
    }
    assert 5 < done.metrics["distance"]["ana"] / 24 < 20


def test_furniture_on_the_stairs_bars_them(tmp_path):
    box = {"type": "box", "footprint": [[3, 2], [5, 2], [5, 4], [3, 4]]}
    home = Home(load_floorplan(house(tmp_path, objects=[box])))

    assert 2 == home.space(0.2, uses_portals=True).parts


def test_way_leads_by_the_nearer_stairs(tmp_path):
    far = {"start": [0.5, 0.5], "end": [12.5, 0.5], "type": "lift"}
    plan = load_floorplan(house(tmp_path, portals=[STAIRS, far]))
    space, at = Home(plan).space(0.2, uses_portals=True), plan.lattice.point_at

    by_stairs = space.passings(at((4, 3)), at((9, 3)))
    by_lift = space.passings(at((1, 1)), at((12, 1)))

    assert [at((8.5, 3.5))] == [p.end for p in by_stairs]
    assert [at((12.5, 0.5))] == [p.end for p in by_lift]
    assert [at((0.5, 0.5))] == [p.end for p in space.passings(at((12, 1)), at((1, 1)))]


@pytest.mark.parametrize(
    ("end", "problem"),
    [([6.5, 1], "is in no room of house: the nearest free place is ("),
     ([1, 1], "a way leads from its one end to the other already")],
)  # fmt: skip
def test_portal_that_links_no_storeys_is_refused(tmp_path, end, problem):
    with pytest.raises(FloorPlanError) as caught:
        load_floorplan(house(tmp_path, portals=[STAIRS | {"end": end}]))

    assert problem in str(caught.value)


def scenario(folder, **changes):
    floorplan = {"type": "native", "path": str(house(folder))}
    return {
        "simulation": {"start": "2026-01-05T06:00", "duration": {"hours": 2}, "seed": 4, **changes},
        "floorplan": floorplan,
        "users": {"ana": {"type": "routine", "persona": "works_outside"}},
        "robots": {
            "astro": {"start": [4, 3], "camera": {"range": [0, 9], "angle_deg": 360}},
            "bella": {"start": [9, 1], "camera": {"range": [0, 9], "angle_deg": 360}},
        },
        "artifacts": {"trajectories": "every step"},
    }


def test_people_climb_in_the_time_it_takes_and_are_seen_on_their_storey_only(tmp_path):
    run = fleet2d.run(scenario(tmp_path))

    rows = run.tables["trajectories"].to_pandas()
    rooms = {name: set(rows[rows.entity == name].room.dropna()) for name in ("astro", "bella")}
    assert {"kitchen_1"} == rooms["astro"]
    assert rooms["bella"] <= {"bedroom_1", "bathroom_1"}
    ana = rows[(rows.entity == "ana") & ~rows.away]
    x = ana.x.to_numpy()
    assert not ((x > 5) & (x < 8)).any()
    (jump, *_) = np.flatnonzero((x[1:] < 5) & (x[:-1] > 8)).tolist()
    assert [x[jump]] * 6 == x[jump - 5 : jump + 1].tolist()  # half of 14 s at either end
    assert [x[jump + 1]] * 6 == x[jump + 1 : jump + 7].tolist()
    seen = run.tables["observations"].to_pandas()
    assert set(seen.room[seen.robot == "astro"]) <= {"living_room_1", "kitchen_1"}
    assert {"bedroom_1"} <= set(seen.room[seen.robot == "bella"])


@pytest.mark.slow
def test_steps_and_spans_of_a_house_with_stairs_are_the_same(tmp_path):
    assert (
        fleet2d.run(scenario(tmp_path)).digest == fleet2d.run(scenario(tmp_path, max_span=1)).digest
    )


def test_portals_in_a_scenario_are_checked_where_they_stand(tmp_path):
    settings = scenario(tmp_path)
    settings["floorplan"]["portals"] = [{"ends": [[1, 1], [2, 2]]}]

    with pytest.raises((FloorPlanError, ScenarioError), match=r"floorplan.portals\[0\]"):
        fleet2d.run(settings)


def test_the_checkup_tells_what_a_robot_loses_that_climbs_no_stairs(tmp_path):
    (found,) = checkup(load_floorplan(house(tmp_path)))

    assert ("storeys", "odd") == (found.kind, found.severity)
    assert (
        "a robot that starts at (0.50, 0.50) m and climbs no stairs can't get to 20.0 m2 of"
        " 40.0 m2: bedroom_1, bathroom_1"
    ) == found.text


@pytest.mark.parametrize(
    ("climbs", "rooms"), [(False, {"kitchen_1"}), (True, {"kitchen_1", "bedroom_1"})]
)
def test_a_robot_gets_upstairs_if_it_climbs(tmp_path, climbs, rooms):
    floorplan = {"type": "native", "path": str(house(tmp_path))}
    rounds = {"type": "patrol", "rooms": ["kitchen", "bedroom"]}
    robots = {"astro": {"start": "kitchen", "climbs": climbs, "behaviors": [rounds]}}
    stored = run(lives("2 h", users={}, robots=robots, floorplan=floorplan))

    way = path(stored, "astro")
    still = (np.diff(way.x) == 0) & (np.diff(way.y) == 0)
    assert rooms == {stored.plan.rooms[r].name for r in np.array(way.room)[1:][still]}


def test_members_of_a_household_sleep_upstairs(tmp_path):
    floorplan = {"type": "native", "path": str(house(tmp_path)), "furnish": True}
    household = {"members": {"ana": "retired", "ben": "works_outside"}}
    users = {name: {"type": "routine", "household": household} for name in household["members"]}
    stored = run(lives("1 d", users=users, robots={}, floorplan=floorplan))

    for name in users:
        way = path(stored, name)
        asleep = slice(60, 4 * 60)  # everybody is in bed at 01:00
        rooms = [stored.plan.rooms[r].name for r in np.array(way.room)[asleep]]
        assert rooms.count("bedroom_1") > 0.9 * len(rooms)
