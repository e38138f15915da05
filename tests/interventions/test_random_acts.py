"""Interventions never make a run fail, whatever others have changed since they were requested."""

import random
from datetime import timedelta

import pytest
from tests.scenes import digests
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
KINDS = ("kitchen", "bedroom", "bathroom", "office", "living_room", "hallway", "laundry", "storage")


class Chance:
    """Draws interventions of all kinds, most of which are possible in the home."""

    def __init__(self, seed, simulation):
        self.random, self.simulation = random.Random(seed), simulation
        home = simulation.home
        self.rooms = [room.name for room in home.rooms]
        self.furniture = [item.name for item in home.objects]

    def one(self, *values):
        return self.random.choice(values)

    def point(self):
        room = self.random.choice(self.simulation.home.rooms)
        x, y = room.anchor_xy
        return [x + self.random.uniform(-2, 2), y + self.random.uniform(-2, 2)]

    def place(self):
        return self.one(self.point(), self.one(*self.rooms), self.one(*KINDS), "sofa", "bed")

    def robot(self):
        return str(self.one("astro", "bolt", "live"))

    def user(self):
        return str(self.one("ana", "ben", "gina"))

    def body(self):
        return str(self.one(self.user(), self.robot()))

    def lasting(self):
        return self.one({}, {"duration": "1 s"}, {"duration": "3 min"}, {"duration": "20 min"})

    def corners(self):
        x, y = self.point()
        return [[x, y], [x + 2, y], [x + 2, y + 1], [x, y + 1]]

    def plan(self, name):
        plan = self.simulation.plan(name).turn_by(0.5).stay(timedelta(seconds=40))
        return dict(data_of(plan))

    def keys(self):
        return self.one(
            {"behavior": "patrol", "keys": {"dwell": self.one("1 s", "5 min")}},
            {"behavior": "hangout", "keys": {"no_stops_in": [self.one(*KINDS)]}},
            {"behavior": "schedule", "keys": {"days": [{"on": "daily", "items": ITEMS[:1]}]}},
            {"behavior": "routine", "keys": {"persona": "retired"}},
        )

    def fields(self, verb):
        """The fields of an intervention, with its subject under its verb."""
        draw = {
            "put": lambda: {"put": self.body(), "to": self.place()},
            "send": lambda: {"send": self.body(), "to": self.place(), **self.lasting()},
            "hold": lambda: {"hold": self.body(), **self.lasting()},
            "release": lambda: {"release": self.body()},
            "replan": lambda: {"replan": self.body()},
            "configure": lambda: {"configure": self.body(), **self.keys()},
            "drive": lambda: {"drive": self.body()},
            "decide": lambda: {"decide": (name := self.body()), "plan": self.plan(name)},
            "away": lambda: {"away": self.user(), **self.lasting()},
            "call_home": lambda: {"call_home": self.user(), "to": self.place(), **self.lasting()},
            "guest": lambda: {"guest": "gina", "to": self.place(), "duration": "5 min"},
            "activity": lambda: {
                "activity": self.user(),
                "what": self.one("wash", "breakfast", "read", "dinner", "sleep"),
                **self.one({}, {"to": self.place()}),
                **self.lasting(),
            },
            "call": lambda: {
                "call": "astro",
                **self.one({"to": self.place()}, {"find": self.user()}, {"dock": True}),
            },
            "dismiss": lambda: {"dismiss": self.robot()},
            "keep_out": lambda: {
                "keep_out": self.robot(),
                "of": self.one(self.one(*KINDS), self.one(*self.rooms), [*KINDS[:3]]),
                **self.lasting(),
            },
            "battery": lambda: {"battery": "astro", "charge": self.one(0, self.random.random())},
            "power": lambda: {
                "power": self.robot(),
                **self.one({"state": "on"}, {"state": "crash"}, {"state": "update", **self.lasting()}, self.lasting()),
            },
            "switch_off": lambda: {
                "switch_off": self.body(),
                **self.one({"camera": True}, {"behavior": self.one("patrol", "routine", "dock")}),
                **self.lasting(),
            },
            "switch_on": lambda: {
                "switch_on": self.body(),
                **self.one({"camera": True}, {"behavior": self.one("patrol", "routine", "dock")}),
            },
            "fault": lambda: {
                "fault": self.robot(),
                **self.one(
                    {"wheels": True}, {"lost": True}, {"charger": True}, {"dark": True},
                    {"detection": 0.3},
                ),
                **self.lasting(),
            },
            "kidnap": lambda: {"kidnap": self.robot(), "to": self.place(), **self.lasting()},
            "relocalize": lambda: {"relocalize": self.robot()},
            "perceive": lambda: {
                "perceive": "live",
                "detections": [{"user": self.user(), "x": self.point()[0], "y": self.point()[1]}],
            },
            "suppress": lambda: {
                "suppress": self.robot(), "user": self.user(), **self.lasting()
            },
            "mistake": lambda: {
                "mistake": self.robot(), "user": "ana", "taken_for": "ben", **self.lasting()
            },
            "inject": lambda: {
                "inject": self.robot(), "user": "ana", "spot": self.point(), **self.lasting()
            },
            "reset": lambda: {"reset": "ltp"},
            "replace": lambda: {
                "replace": "ltp",
                **self.one({"rooms": {self.one(*self.rooms): 1}}, {"frozen": True}, {"withheld": True}),
                **self.lasting(),
            },
            "restore": lambda: {"restore": self.one("astro", "bolt", "contact", "ltp")},
            "change": lambda: {"change": self.one({"shut": "door"}, {"open": "door", "at": "30 min"})},
            "open": lambda: {"open": "door"},
            "shut": lambda: {"shut": "door"},
            "lock": lambda: {"lock": "door"},
            "unlock": lambda: {"unlock": "door"},
            "move": lambda: {
                "move": self.one(*self.furniture, "sofa_1"),
                "to": self.point(),
                "turn_deg": self.one(0, 45, 90),
            },
            "room": lambda: {"room": self.one(*self.rooms), "type": self.one(*KINDS)},
            "steer": lambda: {"steer": self.robot(), "forward": self.one(-0.2, 0.1, 0.5)},
            "lights": lambda: {
                "lights": self.one(*KINDS, "all"), "turn": self.one("on", "off")
            },
            "slow": lambda: {
                "slow": self.corners(), "speed": 0.2, "stop": "3 s", **self.lasting()
            },
            "report": lambda: {"report": "real", "says": self.one("on", "off")},
            "stick": lambda: {
                "stick": "contact", "says": self.one("on", "off", "silent"), **self.lasting()
            },
        }  # fmt: skip
        return dict(draw[verb]())

    def when(self):
        """When it happens: now; at a time; or at events, which others may have made impossible."""
        minute = self.simulation.step // 60 + self.random.randrange(1, 30)
        return self.one(
            {},
            {"at": f"{minute} min"},
            {"on": ["activity", self.user()]},
            {"on": "room_changed"},
            {"on": ["shut", "door"], "delay": "10 s"},
        )


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
