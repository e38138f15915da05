"""Faults of robots: what is lost, broken, carried off, or dismissed."""

import pytest
from tests.scenes import AGENDA, entries, expecting, scenario, table, unmet

import fleet2d
from fleet2d.errors import PlacementError, ScenarioError
from fleet2d.interventions import (
    Away,
    Dismiss,
    Fault,
    HoldStill,
    Kidnap,
    Release,
    SetBattery,
)

BATTERY = {"driving": "1 h", "standing": "2 h", "charging": "1 h", "charger": [0.5, 6.5]}


def home(script="", behaviors=None, **robot):
    robot = {"camera": {"range": [0.3, 5], "angle_deg": 200}, "battery": BATTERY, **robot}
    robot["behaviors"] = behaviors or [{"type": "patrol", "dwell": "10 s"}]
    users = {"ana": {"type": "schedule", "days": AGENDA, "rest": "living_room"}}
    return scenario("30 min", users=users, robots={"astro": robot}, script=entries(script))


DOCKS = {
    "behaviors": [{"type": "dock", "threshold": "60 %", "until": "90 %"}, {"type": "patrol"}],
    "battery": {**BATTERY, "charge": 0.55},
}
BEDROOM = {"type": "patrol", "rooms": ["bedroom"], "dwell": "1 h"}
CASES = {
    "a kidnapped robot stands where it was put until it knows its place": (
        "at: 5 min, kidnap: astro, to: bathroom, duration: 2 min",
        {},
        """
        always(implies(during(07:05-07:07), room(astro) == bathroom))
        never(during(07:06-07:07) and moving(astro))
        eventually(during(07:07-07:08) and moving(astro))
        """,
    ),
    "a lost robot stands until it knows its place": (
        "at: 5 min, fault: astro, lost: true, duration: 2 min",
        {},
        """
        never(during(07:06-07:07) and moving(astro))
        eventually(during(07:07-07:08) and moving(astro))
        """,
    ),
    "a charger charges": ("", DOCKS, "always(implies(during(07:08-07:12), battery(astro) > 55 %))"),
    "a broken charger does not charge until it is repaired": (
        "at: 3 min, fault: astro, charger: true, duration: 10 min",
        DOCKS,
        """
        never(during(07:08-07:12) and battery(astro) > 55 %)
        eventually(battery(astro) > 60 %)
        """,
    ),
    "a robot keeps out of a room until it may enter again": (
        "at: 10 min, keep_out: astro, of: kitchen, duration: 10 min",
        {"battery": None},
        """
        eventually(room(astro) == kitchen, within=10 min)
        never(during(07:11-07:20) and room(astro) == kitchen)
        eventually(during(07:20-07:30) and room(astro) == kitchen)
        after(events(banned, astro), events(allowed, astro), within=600..601 s)
        """,
    ),
    "a robot that is dismissed drops a search": (
        """
        at: 5 min, put: ana, to: storage
        at: 6 min, call: astro, find: ana
        at: 380 s, dismiss: astro
        """,
        {"behaviors": [{"type": "find", "user": "ana"}, BEDROOM]},
        """
        eventually(events(find_begins, astro), within=7 min)
        always(implies(during(07:12-07:30), room(astro) == bedroom))
        """,
    ),
    "a robot that is dismissed drops a visit": (
        """
        at: 6 min, call: astro, to: kitchen
        at: 380 s, dismiss: astro
        """,
        {"behaviors": [{"type": "come", "stay": "20 min"}, BEDROOM]},
        "always(implies(during(07:12-07:30), room(astro) == bedroom))",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_what_faults_do_to_a_robot(name):
    script, changes, expected = CASES[name]
    assert [] == unmet(fleet2d.run(home(script, **changes) | {"expect": expecting(expected)}))


def test_a_robot_that_is_dismissed_drops_whom_it_follows():
    behaviors = [{"type": "follow", "user": "ana"}, BEDROOM]
    simulation = fleet2d.Simulation(home("at: 380 s, dismiss: astro", behaviors))
    simulation.run_until(381)
    assert not simulation.actors["astro"].behaviors[0].busy()


ENTRIES_AND_OBJECTS = {
    "kidnap: astro, to: bathroom, duration: 2 min": Kidnap("astro", "bathroom", duration="2 min"),
    "hold: ana, posture: lie, duration: 1 min": HoldStill("ana", posture="lie", duration="1 min"),
    "fault: astro, charger: true, duration: 5 min": Fault("astro", charger=True, duration="5 min"),
    "dismiss: astro": Dismiss("astro"),
    "battery: astro, charge: 50 %": SetBattery("astro", "50 %"),
    "release: ana": Release("ana"),
    "away: ana, duration: 2 min": Away("ana", duration="2 min"),
}


def test_objects_do_the_same_as_entries_of_a_script():
    script = "\n".join(f"at: 5 min, {entry}" for entry in ENTRIES_AND_OBJECTS)
    simulation = fleet2d.Simulation(home())
    simulation.run_until("07:05")
    for intervention in ENTRIES_AND_OBJECTS.values():
        simulation.do(intervention)
    tables = [run.manifest["tables"] for run in (fleet2d.run(home(script)), simulation.run())]

    for name in ("trajectories", "observations", "events"):
        assert tables[0][name] == tables[1][name]


@pytest.mark.parametrize(
    ("script", "relocalizes", "steps"),
    [
        ("at: 5 min, kidnap: astro, to: bathroom, duration: 10 min", "20 s", [300, 320]),
        ("at: 5 min, fault: astro, lost: true", "20 s", [300, 320]),
        ("at: 5 min, kidnap: astro, to: bathroom, duration: 10 min", None, [300, 900]),
        (
            """
            at: 4 min, fault: astro, dark: true, duration: 2 min
            at: 5 min, kidnap: astro, to: bathroom, duration: 10 min
            """,
            "20 s",
            [300, 360],  # it tries at 320, 340 and 360
        ),
        (
            """
            at: 5 min, kidnap: astro, to: bathroom, duration: 10 min
            at: 6 min, relocalize: astro
            """,
            None,
            [300, 360],
        ),
    ],
    ids=["kidnapped", "lost", "not by sight", "in the dark", "told"],
)
def test_when_a_robot_that_lost_its_place_knows_it_again(script, relocalizes, steps):
    run = fleet2d.run(home(script, localization={"relocalizes": relocalizes}))
    rows = table(run, "events", entity="astro")
    events = list(zip(rows["step"], rows["event"].astype(str), strict=True))
    kinds = ("localization_lost", "relocalized")
    assert list(zip(steps, kinds, strict=True)) == [each for each in events if each[1] in kinds]


@pytest.mark.parametrize(
    ("script", "changes", "words"),
    [
        ("at: 5 min, hold: astro, posture: lie", {}, "there is no user 'astro'"),
        ("at: 5 min, fault: astro, charger: true", {"battery": None}, "has no battery"),
        ("at: 5 min, kidnap: astr, to: kitchen", {}, "did you mean 'astro'"),
        ("at: 5 min, keep_out: astro, of: kitchn", {}, "no room 'kitchn': did you mean 'kitchen'"),
        ("", {"camera": None, "localization": {"relocalizes": "1 s"}}, "it needs a camera"),
    ],
)
def test_what_cannot_fail_or_lie_is_refused(script, changes, words):
    with pytest.raises((PlacementError, ScenarioError), match=words):
        fleet2d.Simulation(home(script, **changes))


def test_a_kidnapped_robot_places_whom_it_sees_where_it_believes_to_be():
    """It is carried 2 m along x with its heading kept, so what it sees is perceived 2 m off."""
    content = scenario(
        users={"ana": {"type": "schedule", "days": [{"items": [{"at": "00:00", "place": [4.5, 2.0]}]}]}},
        robots={"astro": {"start": [1.0, 3.0], "start_heading_deg": 0, "camera": {"range": [0.1, 8], "angle_deg": 360}, "localization": {"relocalizes": "1 min"}}},
        script=[{"at": "07:02", "kidnap": "astro", "to": [3.0, 3.0], "duration": "5 min"}],
    )  # fmt: skip
    rows = table(fleet2d.run(content), "observations")
    off = (rows["x"] - rows["true_x"]).round(2)
    lost = (rows["step"] >= 120) & (rows["step"] < 180)
    assert {-2.0} == set(off[lost].tolist())
    assert {0.0} == set(off[~lost].tolist())
