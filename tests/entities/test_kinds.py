"""One rule: kinds that a home lacks are left out with a note, single things are refused."""

from typing import Any

import pytest
from tests.scenes import path, run, scenario

from fleet2d.engine.simulation import Simulation
from fleet2d.errors import InputError

BATTERY = {"driving": "2 h", "standing": "8 h", "charging": "1 h"}
FLAT = {"floorplan": {"type": "bundled", "furnish": True}}


def robot(*behaviors: Any, **body: Any) -> dict[str, Any]:
    return scenario("1 min", robots={"astro": {"behaviors": list(behaviors), **body}})


def notes(content: dict[str, Any]) -> str:
    return "; ".join(note for a in Simulation(content).actors.values() for note in a.notes)


def user(**fields: Any) -> dict[str, Any]:
    return scenario("1 min", users={"ana": fields})


@pytest.mark.parametrize(
    ("content", "note"),
    [
        (robot({"type": "hangout", "avoid": ["garage", "bathroom"]}), "hangout.avoid: left out"),
        (robot({"type": "patrol", "rooms": ["kitchen", "garage"]}), "patrol.rooms: left out"),
        (user(type="room_sampling", shares={"kitchen": 1, "garage": 1}), "shares: left out"),
        (user(type="pet", rooms=["kitchen", "garage"]), "pet.rooms: left out"),
    ],
)
def test_a_kind_that_the_home_lacks_is_left_out_with_a_note(
    content: dict[str, Any], note: str
) -> None:
    assert note in notes(content)
    assert "garage" in notes(content)


def test_a_kind_that_is_there_but_out_of_reach_is_left_out_too() -> None:
    """Six of 1,103 homes refused the bundled scenario, for it avoids bathrooms."""
    content = robot({"type": "hangout", "avoid": ["storage"]}, start="kitchen")
    assert "hangout.avoid: left out" in notes(content)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (robot({"type": "hangout", "avoid": ["bathroom_7"]}), ["hangout.avoid", "bathroom_7"]),
        (robot({"type": "patrol", "rooms": ["kitchen", "kitchn_0"]}), ["patrol.rooms", "kitchn_0"]),
        (robot({"type": "patrol", "rooms": ["garage"]}), ["patrol.rooms", "has none of these"]),
        (user(type="room_sampling", shares={"garage": 1}), ["room_sampling.shares", "garage"]),
    ],
)
def test_a_single_thing_that_is_not_there_is_refused_with_its_key(
    content: dict[str, Any], words: list[str]
) -> None:
    with pytest.raises(InputError) as failure:
        Simulation(content)
    assert all(word in str(failure.value) for word in ["astro" in content or "a", *words])


def test_an_activity_without_a_room_becomes_rest() -> None:
    own = {"pottery": {"rooms": ["garage"], "takes": "1 h"}}
    day = {"on": "daily", "wake": "06:30", "do": {"pottery": "07:30"}}
    persona = {"activities": own, "days": {"any_day": day}}
    assert "activities.pottery.rooms: left out" in notes(user(type="routine", persona=persona))


def test_an_item_of_a_schedule_in_a_room_that_is_not_there_is_left_out() -> None:
    items = [{"at": "08:00", "place": "garage"}, {"at": "09:00", "place": "kitchen"}]
    content = user(type="schedule", days=[{"items": items}])
    assert "schedule.days: left out" in notes(content)


def test_furniture_is_a_place_wherever_a_place_goes() -> None:
    items = [{"at": "00:00", "place": "sofa", "dwell": "1 d"}]
    users = {"ana": {"type": "schedule", "days": [{"items": items}], "start": "kitchen"}}
    robots = {"astro": {"behaviors": [{"type": "patrol", "rooms": ["desk", "bedroom"]}],
                        "battery": {**BATTERY, "charger": "charger_0"}}}  # fmt: skip
    stored = run({**scenario("10 min", users=users, robots=robots), **FLAT})
    sofa = next(o for o in stored.plan.objects if o.type == "sofa")
    ana = path(stored, "ana")
    uses = [(use.x, use.y) for use in sofa.uses]
    at = min((ana.x[-1] - x) ** 2 + (ana.y[-1] - y) ** 2 for x, y in uses)
    assert at < 0.01
    events = stored.pandas("events")
    assert sofa.name in set(events[events["event"] == "uses"]["detail"])


def test_a_name_that_is_nearly_a_piece_of_furniture_gets_that_as_a_hint() -> None:
    content = {
        **user(type="schedule", days=[{"items": [{"at": "08:00", "place": "soffa"}]}]),
        **FLAT,
    }
    with pytest.raises(InputError, match="sofa"):
        Simulation(content)
