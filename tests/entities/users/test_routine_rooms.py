"""Where the bundled personas do what they do: no activity is in a room that it doesn't belong in."""

import json
from collections import Counter

import numpy as np
import polars as pl
import pytest
from tests.scenes import path, run, scenario
from tests.thorough import THOROUGH, some

from fleet2d.floorplan.native import Native
from fleet2d.routines.activity import NOT_LIVED_IN, catalogue
from fleet2d.routines.persona import bundled_names

DURATION = "7 d" if THOROUGH else "2 d"
SYNTHETIC = [{"type": "synthetic", "seed": i, "area_m2": 40 + 2 * i} for i in range(71)]


def resting(stored, name):
    """The minutes in which somebody rests on a spot at home: step, activity and room."""
    life = stored.path(name)  # every minute
    is_still = np.r_[False, (np.diff(life.x) == 0) & (np.diff(life.y) == 0)]
    poses = pl.DataFrame({"step": life.step, "room": life.room})
    events = stored.polars("events").filter(event="activity", entity=name)
    began = events.select("step", activity=pl.col("detail"))
    # A resident rests on the spot for some minutes until the next activity begins.
    rows = poses.filter(is_still & ~np.array(life.away)).sort("step")
    return rows.join_asof(began.sort("step"), on="step").drop_nulls()


def odd(floorplan):
    """What a household of all personas does where nobody lives, or two at once in private rooms."""
    household = {"members": {name: name for name in bundled_names()}}
    users = {name: {"type": "routine", "household": household} for name in bundled_names()}
    stored = run(scenario(DURATION, users=users, robots={}, floorplan=floorplan))
    kinds = dict(enumerate(room.type for room in stored.plan.rooms))
    rows = pl.concat([resting(stored, name) for name in users])
    done = rows.select("activity", kind=pl.col("room").replace_strict(kinds)).unique()
    misplaced = [
        (activity, kind)
        for activity, kind in done.iter_rows()
        if kind in NOT_LIVED_IN
        and kind not in catalogue()[activity].rooms
        and activity not in ("wash_hands", "rest")
    ]
    shared = rows.filter(rows.select("step", "room").is_duplicated())
    private = [kinds[room] for room in shared["room"] if kinds[room] in ("bathroom", "toilet")]
    return misplaced + [("shared", kind) for kind in private]


@pytest.mark.slow
def test_members_of_a_household_leave_the_bathroom_before_a_short_rest():
    """Who had washed hands for a moment during a rest finished it there, beside the next one."""
    household = {"members": {"ana": "retired", "ben": "retired"}}
    users = {name: {"type": "routine", "household": household} for name in household["members"]}
    stored = run(scenario("28 d", users=users, robots={}))
    rests = stored.polars("events").filter(detail="rest")
    room_ids = {name: path(stored, name).room for name in users}
    rooms = [
        stored.plan.rooms[room_ids[name][step]].type
        for name, step in rests.select("entity", "step").iter_rows()
    ]
    assert rooms.count("living_room") > 100
    assert "bathroom" not in rooms


@pytest.mark.slow
@pytest.mark.parametrize("name", some(range(29), 29))
def test_nothing_is_done_in_an_odd_room_of_a_real_home(shared_data, name):
    """Children played in bathrooms of 11 of 20 homes, up to an hour a day, while others showered."""
    plan = sorted((shared_data / "houseexpo").glob("*.json"))[name]
    assert [] == odd({"type": "houseexpo", "path": str(plan)})


@pytest.mark.slow
@pytest.mark.parametrize("floorplan", some(SYNTHETIC, 72), ids=lambda plan: plan["seed"])
def test_nothing_is_done_in_an_odd_room_of_a_synthetic_home(floorplan):
    assert [] == odd(floorplan)


HALL = [[0, 0], [9, 0], [9, 2], [0, 2]]
LEFT = [[0, 2.1], [4.4, 2.1], [4.4, 6], [0, 6]]
RIGHT = [[4.5, 2.1], [9, 2.1], [9, 6], [4.5, 6]]
DOORS = [[[1, 2], [1.9, 2], [1.9, 2.1], [1, 2.1]], [[6, 2], [6.9, 2], [6.9, 2.1], [6, 2.1]]]


def flat(folder, *uses, sofa_in="", **keys):
    """A hall with two rooms, each with its functions; perhaps a sofa in the left or right one."""
    rooms = [
        {"type": kinds[0], "labels": kinds, "polygon": polygon}
        for kinds, polygon in zip(uses, (HALL, LEFT, RIGHT), strict=True)
    ]
    plan = {"format": "fleet2d-floorplan", "version": 1, "free": [HALL, LEFT, RIGHT, *DOORS]}
    (folder / "flat.json").write_text(json.dumps(plan | {"rooms": rooms}))
    source = {"type": "native", "path": str(folder / "flat.json"), **keys}
    if sofa_in:
        at = {"left": [2, 5.4], "right": [7, 5.4]}[sofa_in]
        source["furniture"] = [{"type": "sofa", "at": at, "heading_deg": 270}]
    return source


def load(source):
    return Native(**{key: value for key, value in source.items() if key != "type"}).plan()


def minutes_of(activities, floorplan):
    """Minutes that a retired person and a child spend on some activities, by room."""
    users = {name: {"type": "routine", "persona": name} for name in ("retired", "child")}
    stored = run(scenario("5 d", users=users, robots={}, floorplan=floorplan))
    rows = pl.concat([resting(stored, name) for name in users])
    rooms = rows.filter(pl.col("activity").is_in(activities))["room"]
    return Counter(stored.plan.rooms[room].name for room in rooms)


KITCHEN_LIVING = ["Kitchen", "Living_Room"]


@pytest.mark.parametrize(
    ("uses", "sofa_in", "expected"),
    [
        ((["Hallway"], KITCHEN_LIVING, ["Bedroom"]), "", "kitchen_1"),
        ((["Hallway"], ["Dining_Room"], ["Bedroom"]), "left", "dining_room_1"),
        ((["Hallway"], ["Living_Room"], ["Kitchen"]), "right", "kitchen_1"),
        ((["Hallway"], ["Bedroom"], ["Bedroom"]), "right", "bedroom_2"),
    ],
    ids=["kitchen and living room", "largest day room", "sofa beside the room", "sofa"],
)
def test_people_watch_television_where_the_sofa_or_the_living_room_is(
    tmp_path, uses, sofa_in, expected
):
    minutes = minutes_of(("tv", "read"), flat(tmp_path, *uses, sofa_in=sofa_in))

    assert minutes[expected] > 0.9 * minutes.total()


@pytest.mark.parametrize("hall", ["Hallway", "Entryway"])
def test_nobody_plays_or_works_in_a_hall(tmp_path, hall):
    activities = ("play", "work_at_home", "study", "computer", "hobby", "games")

    minutes = minutes_of(activities, flat(tmp_path, [hall], ["Kitchen"], ["Bedroom"]))

    assert minutes.total() > 60
    assert minutes[f"{hall.lower()}_1"] < 0.02 * minutes.total()


def test_a_room_to_furnish_gets_the_furniture_of_all_its_functions(tmp_path):
    uses = (["Hallway"], KITCHEN_LIVING, ["Bedroom"])
    both = load(flat(tmp_path, *uses, furnish=True)).objects
    serving = load(flat(tmp_path, ["Hallway"], ["Dining_Room"], ["Bedroom"], furnish=True)).objects

    assert {"stove", "sofa"} <= {thing.type for thing in both}
    assert {"table", "sofa"} <= {thing.type for thing in serving}
