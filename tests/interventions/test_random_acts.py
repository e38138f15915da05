"""Interventions never make a run fail, whatever others have changed since they were requested."""

import random
from datetime import timedelta

import pytest
from tests.scenes import digests, entries
from tests.thorough import some

import fleet2d
from fleet2d.entities.plan import data_of
from fleet2d.errors import InputError
from fleet2d.interventions.intervention import verbs

KEPT_OUT = {
    "extends": "bundled:paper",
    "simulation": {"duration": "30 min"},
    "script": [
        {"at": "1 min", "keep_out": "astro", "of": "kitchen", "duration": "10 min"},
        {"at": "5 min", "room": "kitchen_1", "type": "office"},
    ],
}


def events(run, kind):
    rows = run.tables["events"].to_pylist()
    return [(row["step"], row["detail"]) for row in rows if row["event"] == kind]


def test_05_a_room_of_another_type_than_when_it_was_forbidden_is_allowed_again():
    """The run failed at 00:11, when the intervention ended: there was no kitchen then."""
    run = fleet2d.run(KEPT_OUT)
    assert [(60, "kitchen_1")] == events(run, "banned")
    assert [(660, "kitchen_1")] == events(run, "allowed")
    assert [] == run.manifest["notes"]


def test_a_room_stays_forbidden_while_another_intervention_forbids_it():
    again = {"at": "2 min", "keep_out": "astro", "of": "kitchen_1", "duration": "20 min"}
    run = fleet2d.run({**KEPT_OUT, "script": [*KEPT_OUT["script"], again]})
    assert [(60 * 22, "kitchen_1")] == events(run, "allowed")


def test_what_was_forbidden_is_known_after_a_checkpoint(tmp_path):
    whole = fleet2d.run(KEPT_OUT)
    simulation = fleet2d.Simulation(KEPT_OUT)
    simulation.run_until(400)
    simulation.save(tmp_path / "state")
    assert digests(whole) == digests(fleet2d.Simulation.load(tmp_path / "state").run())


def test_an_activity_that_a_changed_behavior_has_no_longer_is_left():
    """The order asked for the behavior that does it, and there was none."""
    days = [{"on": "daily", "items": [{"at": "00:00", "place": "kitchen", "activity": "cook"}]}]
    other = [{"on": "daily", "items": [{"at": "00:00", "place": "office", "activity": "work"}]}]
    content = {
        "extends": "bundled:paper",
        "simulation": {"duration": "20 min"},
        "users": {"ana": {"type": "schedule", "days": days}},
        "script": [
            {"at": "1 min", "activity": "ana", "what": "cook"},
            {"at": "1 min", "configure": "ana", "behavior": "schedule", "keys": {"days": other}},
        ],
    }
    run = fleet2d.run(content)
    assert "work" in [detail for _, detail in events(run, "activity")]


@pytest.mark.slow
def test_what_was_learned_in_another_home_is_left_out(tmp_path):
    """The run failed at the step of the intervention."""
    content = {"extends": "bundled:paper", "simulation": {"duration": "13 h"}}
    other = {"floorplan": {"type": "synthetic", "seed": 1, "area_m2": 60}}
    fleet2d.run({**content, **other, "artifacts": {"learned": True}}, out=tmp_path / "run")
    learned = str(tmp_path / "run" / "learned" / "ltp.npz")
    run = fleet2d.run({**content, "script": [{"at": "1 h", "reset": "ltp", "learned": learned}]})
    assert "complete" == run.status
    (note,) = run.manifest["notes"]
    assert note.startswith(f"step 3600: script.0 was left out: learned: {learned}: algorithms.ltp")


# All of them, at random

ITEMS = [
    {"at": "07:02", "place": "bathroom", "dwell": "4 min", "activity": "wash"},
    {"place": "kitchen", "dwell": "10 min", "activity": "breakfast"},
    {"at": "07:30", "away": True, "activity": "errand"},
    {"at": "07:45", "place": "bedroom", "activity": "read"},
]
HOME = {
    "simulation": {"start": "2026-01-05T07:00", "duration": "1 h", "seed": 4},
    "floorplan": {"type": "bundled"},
    "users": {
        "ana": {"type": "routine", "persona": "works_outside"},
        "ben": {"type": "schedule", "days": [{"on": "daily", "items": ITEMS}]},
        "gina": "guest",
    },
    "objects": {
        "door": {"type": "door", "doorway": "bathroom_2"},
        "contact": {"type": "contact_sensor", "of": "door"},
        "real": {"type": "live_sensor", "room": "hallway"},
    },
    "robots": {
        "astro": {
            "battery": {
                "driving": "2 h",
                "standing": "10 h",
                "charging": "3 h",
                "charger": "hallway",
            },
            "camera": {"range": [0.3, 4.5], "angle_deg": 108, "detection": 0.95},
            "behaviors": [{"type": "dock"}, {"type": "come"}, {"type": "find"}, {"type": "patrol"}],
        },
        "bolt": {
            "camera": {"range": [0.3, 4]},
            "behaviors": [{"type": "hangout", "source": "ltp"}],
        },
        "live": {"perceives": "live", "type": "patrol"},
    },
    "algorithms": {"ltp": {"type": "long_term_presence", "estimator": "likelihood"}},
}


# Every way to write each intervention; a word of `Chance` is drawn.
ACTS = """
put: body, to: place
send: body, to: place, duration: lasting
hold: body, duration: lasting
release: body
replan: body
configure: body, behavior: patrol, keys: {dwell: 5 min}
configure: body, behavior: hangout, keys: {no_stops_in: [kind]}
configure: body, behavior: schedule, keys: {days: days}
configure: body, behavior: routine, keys: {persona: retired}
drive: body
decide: body, plan: plan
away: user, duration: lasting
call_home: user, to: place, duration: lasting
guest: gina, to: place, duration: 5 min
activity: user, what: doing, duration: lasting
activity: user, what: doing, to: place, duration: lasting
call: astro, to: place
call: astro, find: user
call: astro, dock: true
dismiss: robot
keep_out: robot, of: kind, duration: lasting
keep_out: robot, of: room, duration: lasting
keep_out: robot, of: [kitchen, bedroom, bathroom], duration: lasting
battery: astro, charge: 0
battery: astro, charge: share
power: robot, duration: lasting
power: robot, state: on
power: robot, state: crash
power: robot, state: update, duration: lasting
switch_off: body, camera: true, duration: lasting
switch_off: body, behavior: behavior, duration: lasting
switch_on: body, camera: true
switch_on: body, behavior: behavior
fault: robot, wheels: true, duration: lasting
fault: robot, lost: true, duration: lasting
fault: robot, charger: true, duration: lasting
fault: robot, dark: true, duration: lasting
fault: robot, detection: 0.3, duration: lasting
kidnap: robot, to: place, duration: lasting
relocalize: robot
perceive: live, detections: [{user: user, x: x, y: y}]
suppress: robot, user: user, duration: lasting
mistake: robot, user: ana, taken_for: ben, duration: lasting
inject: robot, user: ana, spot: point, duration: lasting
reset: ltp
replace: ltp, rooms: weights, duration: lasting
replace: ltp, frozen: true, duration: lasting
replace: ltp, withheld: true, duration: lasting
restore: restored
change: {shut: door}
change: {open: door, at: 30 min}
open: door
shut: door
lock: door
unlock: door
move: furniture, to: point, turn_deg: angle
room: room, type: kind
steer: robot, forward: speed
lights: kind, turn: switch
lights: all, turn: switch
slow: corners, speed: 0.2, stop: 3 s, duration: lasting
report: real, says: switch
stick: contact, says: silent, duration: lasting
stick: contact, says: switch, duration: lasting
"""
WORDS = {
    "user": ["ana", "ben", "gina"],
    "robot": ["astro", "bolt", "live"],
    "kind": ["kitchen", "bedroom", "bathroom", "office", "living_room", "hallway", "storage"],
    "lasting": [None, "1 s", "3 min", "20 min"],
    "doing": ["wash", "breakfast", "read", "dinner", "sleep"],
    "behavior": ["patrol", "routine", "dock"],
    "restored": ["astro", "bolt", "contact", "ltp"],
    "days": [[{"on": "daily", "items": ITEMS[:1]}]],
    "angle": [0, 45, 90],
    "speed": [-0.2, 0.1, 0.5],
    "switch": ["on", "off"],
}


class Chance:
    """Draws interventions of all kinds, most of which are possible in the home."""

    def __init__(self, seed, simulation):
        self.random = random.Random(seed)
        self.simulation = simulation
        self.rooms = simulation.home.rooms
        self.words = WORDS | {
            "body": [*WORDS["user"], *WORDS["robot"]],
            "room": [room.name for room in self.rooms],
            "furniture": [item.name for item in simulation.home.objects],
        }
        self.words["place"] = [*self.words["room"], *WORDS["kind"], "sofa", "bed"]

    def point(self):
        x, y = self.random.choice(self.rooms).anchor_xy
        return [x + self.random.uniform(-2, 2), y + self.random.uniform(-2, 2)]

    def corners(self):
        x, y = self.point()
        return [[x, y], [x + 2, y], [x + 2, y + 1], [x, y + 1]]

    def drawn(self, value, subject):
        """Draw what stands for a word, also within lists and mappings."""
        if isinstance(value, list):
            return [self.drawn(each, subject) for each in value]
        if isinstance(value, dict):
            return {key: self.drawn(each, subject) for key, each in value.items()}
        match value:
            case "point":
                return self.point()
            case "x" | "y":
                return self.point()["xy".index(value)]
            case "place" if self.random.random() < 0.4:
                return self.point()
            case "corners":
                return self.corners()
            case "share":
                return self.random.random()
            case "weights":
                return {self.drawn("room", subject): 1}
            case "plan":
                plan = self.simulation.plan(subject).turn_by(0.5)
                return dict(data_of(plan.stay(timedelta(seconds=40))))
        return self.random.choice(self.words.get(value, [value]))

    def fields(self, verb):
        """The fields of an intervention, with its subject under its verb."""
        ways = [line for line in ACTS.splitlines() if line.startswith(f"{verb}: ")]
        subject = None
        fields = {}
        (entry,) = entries(self.random.choice(ways))
        for key, value in entry.items():
            fields[key] = self.drawn(value, subject)
            subject = subject or fields[key]
        return {key: value for key, value in fields.items() if value is not None}

    def when(self):
        """When it happens: now; at a time; or at events, which others may have made impossible."""
        minute = self.simulation.step // 60 + self.random.randrange(1, 30)
        times = [
            {},
            {"at": f"{minute} min"},
            {"on": ["activity", self.drawn("user", None)]},
            {"on": "room_changed"},
            {"on": ["shut", "door"], "delay": "10 s"},
        ]
        return self.random.choice(times)


@pytest.mark.slow
@pytest.mark.parametrize("seed", some(range(40), 4))
def test_no_sequence_of_interventions_makes_a_run_fail(seed):
    simulation = fleet2d.Simulation(HOME)
    chance, names, applied = Chance(seed, simulation), sorted(verbs()), 0
    for _ in range(12):
        for verb in chance.random.sample(names, 12):
            try:
                simulation.do({**chance.fields(verb), **chance.when()})
            except InputError:  # refused before anything is done
                continue
            applied += 1
        simulation.run_until(simulation.step + 240)
    run = simulation.run()
    assert "complete" == run.status
    assert applied > 60
    expected = (" was left out: ", " walked into it ")  # somebody was put before a robot
    assert all(any(words in note for words in expected) for note in run.manifest["notes"])
