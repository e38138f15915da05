"""What is done to people and robots by hand: where they are then, and what they do."""

import pytest
from tests.scenes import AGENDA, digests, entries, expecting, scenario, unmet

import fleet2d
from fleet2d.errors import ScenarioError
from fleet2d.interventions import (
    LetIn,
)


def home(*script, **more):
    battery = {"driving": "2 h", "standing": "10 h", "charging": "1 h", "charger": [0.5, 3.5]}
    behaviors = [
        {"type": "dock"},
        {"type": "come", "stay": "2 min"},
        {"type": "find"},
        {"type": "patrol", "dwell": "20 s"},
    ]
    return scenario(
        "1 h",
        users={
            "ana": {"type": "schedule", "days": AGENDA, "rest": "living_room"},
            "gina": "guest",
        },
        robots={"astro": {"battery": battery, "behaviors": behaviors}},
        objects={"bath_door": {"type": "door", "doorway": "bathroom_1"}},
        script=list(script),
        **more,
    )


CASES = {
    "who is sent goes on foot, stays, and is left to itself in the end": (
        "at: 1 min, send: ana, to: kitchen, duration: 5 min",
        """
        always(speed(ana) < 1.5)
        always(implies(during(07:02-07:06), room(ana) == kitchen))
        never(during(07:03-07:06) and moving(ana))
        eventually(during(07:06-07:12) and moving(ana))
        """,
    ),
    "who is held stands still and is released": (
        """
        at: 2 min, hold: astro
        at: 12 min, release: astro
        """,
        """
        never(during(07:03-07:12) and moving(astro))
        eventually(during(07:12-07:14) and moving(astro))
        """,
    ),
    "who is sent away comes home when called, though the agenda has her out from 07:30 on": (
        """
        at: 1 min, away: ana
        at: 4 min, call_home: ana, to: kitchen
        """,
        """
        always(implies(during(07:03-07:04), away(ana)))
        always(implies(during(07:06-08:00), room(ana) == kitchen))
        """,
    ),
    "an activity is done where the agenda has it, and recorded": (
        "at: 10 min, activity: ana, what: wash, duration: 5 min",
        """
        eventually(during(07:10-07:12) and activity(ana) == wash)
        always(implies(during(07:12-07:15), room(ana) == bathroom))
        """,
    ),
    "a guest comes, stays and leaves": (
        "at: 10 min, guest: gina, to: kitchen, duration: 5 min",
        """
        always(implies(during(07:00-07:10), away(gina)))
        always(implies(during(07:12-07:15), room(gina) == kitchen))
        always(implies(during(07:18-08:00), away(gina)))
        """,
    ),
    "a robot comes when called, waits, and goes on patrol": (
        "at: 5 min, call: astro, to: bedroom",
        """
        always(implies(during(07:06-07:07), room(astro) == bedroom))
        never(during(07:06-07:07) and moving(astro))
        eventually(during(07:08-07:11) and moving(astro))
        """,
    ),
    "a robot finds whom it is called to find, and docks when called": (
        """
        at: 0 s, put: ana, to: bedroom
        at: 0 s, hold: ana
        at: 2 min, call: astro, find: ana
        at: 12 min, battery: astro, charge: 50 %
        at: 12 min, call: astro, dock: true
        """,
        """
        eventually(events(found, astro, detail=ana), within=12 min)
        eventually(events(docks, astro), within=17 min)
        eventually(events(charged, astro))
        """,
    ),
    "a robot with little charge goes to its charger": (
        "at: 5 min, battery: astro, charge: 0.1",
        "eventually(events(docks, astro), within=10 min)",
    ),
    "stuck wheels hold a robot, and the call waits": (
        """
        at: 2 min, fault: astro, wheels: true, duration: 10 min
        at: 2 min, call: astro, to: bedroom
        """,
        """
        never(during(07:03-07:12) and moving(astro))
        eventually(during(07:12-07:14) and room(astro) == bedroom)
        """,
    ),
    "a behavior that is switched off is not asked": (
        "at: 3 min, switch_off: astro, behavior: patrol, duration: 10 min",
        """
        never(during(07:04-07:13) and moving(astro))
        eventually(during(07:13-07:16) and moving(astro))
        """,
    ),
    "who is sent behind a locked door waits until it is open": (
        """
        at: 0 s, put: ana, to: kitchen
        at: 0 s, shut: bath_door
        at: 0 s, lock: bath_door
        at: 1 min, send: ana, to: bathroom
        at: 3 min, unlock: bath_door
        """,
        """
        never(during(07:01-07:03) and room(ana) == bathroom)
        eventually(events(way_blocked, ana))
        eventually(during(07:03-07:05) and room(ana) == bathroom)
        """,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_what_a_script_does_to_bodies(name):
    script, expected = CASES[name]
    assert [] == unmet(fleet2d.run(home(*entries(script), expect=expecting(expected))))


def test_only_guests_are_let_in():
    with pytest.raises(ScenarioError, match="ana is not a guest"):
        fleet2d.Simulation(home()).do(LetIn("ana"))


MANY = """
at: 2 min, send: ana, to: kitchen, duration: 5 min
at: 3 min, call: astro, to: bedroom
at: 10 min, guest: gina, duration: 10 min
at: 15 min, fault: astro, wheels: true, duration: 90 s
at: 20 min, switch_off: astro, behavior: patrol, duration: 5 min
at: 22 min, call: astro, find: ana
at: 30 min, battery: astro, charge: 0.15
at: 40 min, put: astro, to: bathroom
at: 41 min, call: astro, dock: true
"""


def test_spans_are_invisible():
    whole, *others = (fleet2d.run(home(*entries(MANY)), max_span=span) for span in (None, 1, 7))
    assert 9 == len(whole.manifest["interventions"])
    assert [digests(whole)] * 2 == [digests(other) for other in others]
