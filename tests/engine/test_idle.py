"""What has no effect in a run: behaviors without a turn, requests never made, events that never come."""

import pytest
from tests.scenes import AGENDA, scenario

import fleet2d

BATTERY = {"driving": "2 h", "standing": "4 h", "charging": "1 h", "charger": [0.5, 6.5]}
CAMERA = {"range": [0.2, 4], "angle_deg": 120}
PATROL = {"type": "patrol", "dwell": "10 s"}


def home(*behaviors, **sections):
    """Ana and astro, a robot with some behaviors, a battery and a camera."""
    astro = {"behaviors": list(behaviors), "battery": BATTERY, "camera": CAMERA}
    users = {"ana": {"type": "schedule", "days": AGENDA}}
    return scenario("10 min", users=users, robots={"astro": astro}, **sections)


def notes(document):
    """Return the notes of a run about astro and the script, up to its end."""
    found = fleet2d.run(document).manifest["notes"]
    return [note for note in found if note.startswith(("robots.astro:", "script"))]


@pytest.mark.parametrize(
    ("behaviors", "later"),
    [
        ([PATROL, {"type": "dock"}], "dock never gets"),
        ([PATROL, {"type": "hangout"}, {"type": "dock"}], "hangout and dock never get"),
        ([{"type": "dock", "rest": True}, PATROL], "patrol never gets"),
    ],
)
def test_a_behavior_after_one_that_always_has_a_plan_is_noted(behaviors, later):
    first = behaviors[0]["type"]

    assert notes(home(*behaviors)) == [
        f"robots.astro: {later} a turn, as {first} before always has a plan: put {first} last, or"
        " give it hours (when) or a cooldown"
    ]


@pytest.mark.parametrize(
    "behaviors",
    [
        [{"type": "dock"}, PATROL],
        [PATROL | {"cooldown": "1 min"}, {"type": "dock"}],
        [PATROL | {"when": "07:00-07:05"}, {"type": "dock"}],
    ],
)
def test_behaviors_that_all_get_a_turn_are_not_noted(behaviors):
    assert notes(home(*behaviors)) == []


def test_reactions_of_a_person_after_her_days_are_noted():
    days = {"type": "schedule", "days": AGENDA}
    users = {"ana": {"behaviors": [days, {"type": "reactions"}]}}
    simulation = fleet2d.Simulation(home(PATROL) | {"users": users})

    assert [note for note in simulation.notes if note.startswith("users.ana:")] == [
        "users.ana: reactions never gets a turn, as schedule before always has a plan: put schedule"
        " last, or give it hours (when) or a cooldown"
    ]


def test_a_behavior_whose_turn_comes_as_the_script_switches_one_off_is_not_noted():
    script = [{"at": "07:02", "switch_off": "astro", "behavior": "patrol"}]

    assert notes(home(PATROL, {"type": "dock"}, script=script)) == []


def test_interactions_that_no_behavior_asks_for_are_noted():
    tea = {"tea": {"to": "ana", "do": "offer", "at": ["07:05"]}}

    assert notes(home(PATROL, interactions=tea)) == [
        "robots.astro: none of its behaviors asks for what it wants by interactions, tea: add"
        " interact or opportunistic, or its requests only expire"
    ]
    assert notes(home({"type": "opportunistic"}, PATROL, interactions=tea)) == []


def test_an_entry_of_the_script_whose_event_never_comes_is_noted_at_the_end():
    script = [
        {"on": ["activity", "ana", "wash"], "replan": "astro"},
        {"on": ["came_home", "ana"], "replan": "astro"},
    ]
    document = home(PATROL, script=script)

    assert fleet2d.Simulation(document).notes == [
        note for note in fleet2d.run(document).manifest["notes"] if "script" not in note
    ]
    assert notes(document) == ["script.1: replan was never applied: no came_home ana came"]


def family(*members, **users):
    """Return what notes say of households: of ana, and of more users."""
    household = {"members": dict.fromkeys(members, "works_outside")}
    everybody = {"ana": {"type": "routine", "household": household}} | users
    simulation = fleet2d.Simulation(scenario("10 min", users=everybody))
    return [note for note in simulation.notes if "household" in note]


def test_a_member_of_a_household_who_is_no_user_is_noted():
    assert family("ana", "ben") == [
        "users.ana.household: ben is a member and no user: add users.ben, or leave ben out"
    ]
    assert family("ana") == []


def test_members_with_different_settings_of_their_household_are_noted():
    other = {"members": {"ana": "works_outside", "ben": "works_outside"}, "welcome": 0.1}
    found = family("ana", "ben", ben={"type": "routine", "household": other})
    advice = "give users.ben the same household, with the same settings"

    assert found[0] == f"users.ana.household: ben is a member, but lives apart: {advice}"
    assert family("ana", "ben", ben={"type": "routine", "household": other | {"welcome": 0}}) == []
