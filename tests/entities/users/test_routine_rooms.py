"""Where the bundled personas do what they do: no activity is in a room that it doesn't belong in."""

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from tests.scenes import path, run, scenario
from tests.thorough import THOROUGH, some

from fleet2d.floorplan.native import Native
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.routines.activity import NOT_LIVED_IN, catalogue
from fleet2d.routines.persona import bundled_names

DURATION = "7 d" if THOROUGH else "2 d"
SYNTHETIC = [{"type": "synthetic", "seed": i, "area_m2": 40 + 2 * i} for i in range(71)]


def minutes_still(floorplan: Mapping[str, Any]) -> Counter[tuple[str, str]]:
    """The life of a household of all personas: minutes on a spot, by activity and type of room.

    The key ("shared", type) counts the minutes of two people on a spot of one room.
    """
    household = {"members": {name: name for name in bundled_names()}}
    users = {name: {"type": "routine", "household": household} for name in bundled_names()}
    stored = run(scenario(DURATION, users=users, robots={}, floorplan=floorplan))
    events = stored.polars("events").filter(pl.col("event") == "activity")
    kinds = [room.type for room in stored.plan.rooms]
    minutes: Counter[tuple[str, str]] = Counter()
    people: Counter[tuple[int, int]] = Counter()
    for name in household["members"]:
        own = events.filter(pl.col("entity") == name)
        life = path(stored, name)
        times = np.array(life.time, "datetime64[us]")
        # A resident rests on the spot for some minutes until the next activity begins.
        which = np.searchsorted(own["time"].to_numpy(), times, side="right") - 1
        at_home = ~np.array(life.away) & (which >= 0)
        still = at_home & np.r_[False, (np.diff(life.x) == 0) & (np.diff(life.y) == 0)]
        activities = own["detail"].to_list()
        for minute in np.flatnonzero(still):
            room = int(life.room[minute])
            minutes[activities[which[minute]], kinds[room]] += 1
            people[minute, room] += 1
    for (_, room), count in people.items():
        minutes["shared", kinds[room]] += count > 1
    return minutes


def odd(minutes: Counter[tuple[str, str]]) -> dict[tuple[str, str], int]:
    """What is done in a room that nobody lives in and that it doesn't name, or by two in private."""
    return {
        (activity, kind): count
        for (activity, kind), count in minutes.items()
        if count
        and (
            kind in ("bathroom", "toilet")
            if activity == "shared"
            else kind in NOT_LIVED_IN
            and kind not in catalogue()[activity].rooms
            and activity not in ("wash_hands", "rest")
        )
    }


@pytest.mark.slow
def test_members_of_a_household_leave_the_bathroom_before_a_short_rest():
    """Who had washed hands for a moment during a rest finished it there, beside the next one."""
    household = {"members": {"ana": "retired", "ben": "retired"}}
    users = {name: {"type": "routine", "household": household} for name in household["members"]}
    stored = run(scenario("28 d", users=users, robots={}))
    events = stored.polars("events").filter(pl.col("detail") == "rest")
    kinds: Counter[str] = Counter()
    for name in users:
        room = path(stored, name).room
        steps = events.filter(pl.col("entity") == name)["step"].to_list()
        kinds.update(stored.plan.rooms[room[step]].type for step in steps)
    assert kinds["living_room"] > 100
    assert 0 == kinds["bathroom"]


@pytest.mark.slow
@pytest.mark.parametrize("name", some(range(29), 29))
def test_nothing_is_done_in_an_odd_room_of_a_real_home(shared_data, name):
    """Children played in bathrooms of 11 of 20 homes, up to an hour a day, while others showered."""
    plan = sorted((shared_data / "houseexpo").glob("*.json"))[name]
    assert odd(minutes_still({"type": "houseexpo", "path": str(plan)})) == {}


@pytest.mark.slow
@pytest.mark.parametrize("floorplan", some(SYNTHETIC, 72), ids=lambda plan: plan["seed"])
def test_nothing_is_done_in_an_odd_room_of_a_synthetic_home(floorplan):
    assert odd(minutes_still(floorplan)) == {}


HALL = [[0, 0], [9, 0], [9, 2], [0, 2]]
LEFT = [[0, 2.1], [4.4, 2.1], [4.4, 6], [0, 6]]
RIGHT = [[4.5, 2.1], [9, 2.1], [9, 6], [4.5, 6]]
DOORS = [[[1, 2], [1.9, 2], [1.9, 2.1], [1, 2.1]], [[6, 2], [6.9, 2], [6.9, 2.1], [6, 2.1]]]


def flat(folder: Path, *uses: list[str], sofa_in: str = "", **keys: Any) -> dict[str, Any]:
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


def load(source: dict[str, Any]) -> FloorPlan:
    return Native(**{key: value for key, value in source.items() if key != "type"}).plan()


def minutes_of(activities: tuple[str, ...], floorplan: dict[str, Any]) -> Counter[str]:
    """Minutes that a retired person and a child spend on some activities, by room."""
    users = {name: {"type": "routine", "persona": name} for name in ("retired", "child")}
    stored = run(scenario("5 d", users=users, robots={}, floorplan=floorplan))
    events = stored.polars("events").filter(pl.col("event") == "activity")
    minutes: Counter[str] = Counter()
    for name in users:
        own = events.filter(pl.col("entity") == name)
        life = path(stored, name)
        times = np.array(life.time, "datetime64[us]")
        which = np.searchsorted(own["time"].to_numpy(), times, side="right") - 1
        still = np.r_[False, (np.diff(life.x) == 0) & (np.diff(life.y) == 0)]
        details = own["detail"].to_list()
        for minute in np.flatnonzero(~np.array(life.away) & (which >= 0) & still):
            if details[which[minute]] in activities:
                minutes[stored.plan.rooms[life.room[minute]].name] += 1
    return minutes


def most(minutes: Counter[str]) -> tuple[str, float]:
    room, count = minutes.most_common(1)[0]
    return room, count / minutes.total()


KITCHEN_LIVING = ["Kitchen", "Living_Room"]


@pytest.mark.parametrize(
    ("uses", "sofa_in", "expected"),
    [
        ((["Hallway"], KITCHEN_LIVING, ["Bedroom"]), "", "kitchen_1"),
        ((["Hallway"], ["Kitchen"], ["Bedroom"]), "", "kitchen_1"),
        ((["Hallway"], ["Dining_Room"], ["Bedroom"]), "left", "dining_room_1"),
        ((["Hallway"], ["Living_Room"], ["Kitchen"]), "right", "kitchen_1"),
        ((["Hallway"], ["Bedroom"], ["Bedroom"]), "right", "bedroom_2"),
    ],
    ids=[
        "a kitchen that is a living room, too",
        "the largest day room serves",
        "and has the sofa",
        "the sofa comes before the room",
        "the sofa decides between bedrooms",
    ],
)
def test_people_watch_television_where_the_sofa_or_the_living_room_is(
    tmp_path, uses, sofa_in, expected
):
    room, share = most(minutes_of(("tv", "read"), flat(tmp_path, *uses, sofa_in=sofa_in)))

    assert expected == room
    assert share > 0.9


@pytest.mark.parametrize("hall", ["Hallway", "Hall", "Entryway", "Lobby"])
def test_nobody_plays_or_works_in_a_hall(tmp_path, hall):
    uses = ([hall], ["Kitchen"], ["Bedroom"])
    activities = ("play", "work_at_home", "study", "computer", "hobby", "games")

    minutes = minutes_of(activities, flat(tmp_path, *uses))

    assert minutes.total() > 60
    assert minutes[f"{hall.lower()}_1"] < 0.02 * minutes.total()


def test_a_room_to_furnish_gets_the_furniture_of_all_its_functions(tmp_path):
    uses = (["Hallway"], KITCHEN_LIVING, ["Bedroom"])
    both = load(flat(tmp_path, *uses, furnish=True)).objects
    serving = load(flat(tmp_path, ["Hallway"], ["Dining_Room"], ["Bedroom"], furnish=True)).objects

    assert {"stove", "sofa"} <= {thing.type for thing in both}
    assert {"table", "sofa"} <= {thing.type for thing in serving}
