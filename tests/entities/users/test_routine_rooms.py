"""Where the bundled personas do what they do: no activity is in a room that it doesn't belong in."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from tests.scenes import path, run, scenario
from tests.thorough import THOROUGH, some

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
def test_members_of_a_household_leave_the_bathroom_before_a_short_rest() -> None:
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
def test_nothing_is_done_in_an_odd_room_of_a_real_home(shared_data: Path, name: int) -> None:
    """Children played in bathrooms of 11 of 20 homes, up to an hour a day, while others showered."""
    plan = sorted((shared_data / "houseexpo").glob("*.json"))[name]
    assert odd(minutes_still({"type": "houseexpo", "path": str(plan)})) == {}


@pytest.mark.slow
@pytest.mark.parametrize("floorplan", some(SYNTHETIC, 72), ids=lambda plan: plan["seed"])
def test_nothing_is_done_in_an_odd_room_of_a_synthetic_home(floorplan: dict[str, Any]) -> None:
    assert odd(minutes_still(floorplan)) == {}
