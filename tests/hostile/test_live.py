"""Runs that are changed from outside: no order of interventions fails them, no kill loses one."""

import json
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from datetime import timedelta

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.engine.test_repeat_resume import cut_off
from tests.scenes import AGENDA, OWN, scenario
from tests.thorough import examples, some

import fleet2d
from fleet2d.entities.plan import data_of
from fleet2d.errors import InputError
from fleet2d.interventions import Decide, HoldStill, Put, Send, StartActivity

USERS = ("ana", "ben", "gina")
ROBOTS = ("astro", "bolt")
BODIES = (*USERS, *ROBOTS)
# The storage has no door: a body that is put there can't leave it.
PLACES = (
    "kitchen",
    "bedroom",
    "bathroom",
    "living_room",
    "storage",
    "any",
    (1.0, 3.0),
    (10.0, 1.0),
)
CAMERA = {"range": [0.2, 4], "angle_deg": 120, "detection": 0.7, "lost_after": "4 s"}


def home(*, doors):
    """People and robots of all kinds; with doors that hinder them, or without."""
    objects = {
        "motion": {"type": "motion_sensor", "at": [6.0, 1.0], "range": "3 m"},
    }
    if doors:
        objects |= {
            "bath_door": {"type": "door", "doorway": "bathroom_1", "closes_after": "10 s"},
            "bath_contact": {"type": "contact_sensor", "of": "bath_door"},
        }
    battery = {
        "driving": "10 min",
        "standing": "30 min",
        "charging": "5 min",
        "charger": [0.5, 3.5],
    }
    behaviors = ["dock", {"type": "come", "stay": "10 s"}, "find", {"type": f"{OWN}:Greet"}]
    return scenario(
        "10 min",
        users={
            "ana": {"type": "schedule", "days": AGENDA, "rest": "living_room"},
            "ben": {"type": "meander"},
            "gina": "guest",
        },
        robots={
            "astro": {
                "camera": CAMERA,
                "battery": battery,
                "behaviors": [*behaviors, {"type": "patrol", "dwell": "20 s"}],
                "gives_way": {},
                "perception": {"false_positives": {"per_hour": 1}},
            },
            "bolt": {"camera": CAMERA, "type": "follow"},
        },
        objects=objects,
        algorithms={"share": {"type": f"{OWN}:Share", "period": "2 min"}},
        metrics={"sightings": {"period": "5 min"}},
    )


def any_of(*values):
    return st.sampled_from(values)


def act(verb, names, **fields):
    return st.fixed_dictionaries({verb: names}, optional=fields)


def does(**fields):
    return st.builds(dict, **fields)


true = st.just(True)
users, robots, bodies, places = (any_of(*names) for names in (USERS, ROBOTS, BODIES, PLACES))
durations = any_of("1 s", "7 s", "3 min")
lasting = {"duration": durations}
AREA = [[3.0, 1.0], [5.0, 1.0], [5.0, 3.5], [3.0, 3.5]]
KEYS = any_of({"dwell": "3 s"}, {"stay": "30 s"}, {"speed": 1.0}, {})
ACTS = st.one_of(
    does(put=bodies, to=places),
    act("send", bodies, **lasting).flatmap(lambda a: places.map(lambda to: {**a, "to": to})),
    act("hold", bodies, **lasting),
    act("release", bodies),
    act("replan", bodies),
    does(
        configure=robots,
        behavior=any_of("patrol", "follow"),
        keys=any_of({"cooldown": "1 min"}),
    ),
    act("drive", bodies),
    act("away", users, **lasting),
    act("call_home", users, to=places, **lasting),
    act("guest", users, to=places, **lasting),
    does(activity=users, what=any_of("wash", "breakfast", "read", "nap")),
    does(activity=users, what=any_of("wash", "nap"), to=places),
    does(call=robots, to=places),
    does(call=robots, find=users),
    does(call=robots, dock=true),
    does(battery=robots, charge=any_of(0.0, 0.01, 0.5, 1.0)),
    does(switch_off=robots, camera=true, duration=durations),
    does(switch_off=bodies, behavior=any_of("patrol", "dock", "follow", "schedule")),
    does(switch_on=bodies, behavior=any_of("patrol", "dock", "follow", "schedule")),
    does(fault=robots, wheels=true, duration=durations),
    does(fault=robots, dark=true),
    does(fault=robots, detection=any_of("0 %", 0.3)),
    act("restore", any_of(*ROBOTS, "motion", "share")),
    does(suppress=robots, user=users, duration=durations),
    does(mistake=robots, user=users, taken_for=any_of(*USERS, "unknown")),
    does(inject=robots, user=any_of(*USERS, "unknown"), spot=any_of((1.0, 3.0))),
    does(stick=any_of("motion"), says=any_of("on", "off", "silent")),
    act("reset", any_of("share")),
    does(replace=any_of("share"), frozen=true, duration=durations),
    does(replace=any_of("share"), withheld=true),
    act("open", any_of("bath_door")),
    act("shut", any_of("bath_door")),
    act("lock", any_of("bath_door")),
    act("unlock", any_of("bath_door")),
    does(room=any_of("kitchen_1"), type=any_of("bathroom")),
    does(hold=users, posture=any_of("lie", "sit"), duration=durations),
    does(configure=robots, behavior=any_of("patrol", "come", "follow"), keys=KEYS),
    does(lights=any_of("kitchen", "bedroom"), turn=any_of("on", "off")),
    does(slow=any_of(AREA), speed=any_of(0.01, 0.4), duration=durations),
    does(keep_out=robots, of=any_of("kitchen", "living_room"), duration=durations),
    does(fault=robots, charger=true, duration=durations),
    does(fault=robots, lost=true, duration=durations),
    act("kidnap", robots, to=places, **lasting),
    act("relocalize", robots),
    act("dismiss", robots),
    does(report=any_of("motion"), says=any_of("on", "off")),
)
WAITS = st.builds(
    lambda act, event, each, delay: {**act, "on": event, "each": each, "delay": delay},
    ACTS,
    any_of("activity", "user_seen", "called", "left_home", ["opened", "bath_door"], "sensor"),
    st.booleans(),
    any_of("0 s", "1 s", "9 s"),
)
# What is requested, and how many steps are simulated afterwards.
ORDERS = st.tuples(
    st.one_of(ACTS, WAITS, st.tuples(st.just("decide"), bodies, places)), any_of(0, 0, 1, 2, 13, 60)
)


def request(run, order):
    """Request something; nothing may go wrong but that it is refused."""
    try:
        if isinstance(order, tuple):
            _, name, place = order
            run.drive(name)
            run.do(Decide(name, data_of(run.plan(name).go_to(place).stay(timedelta(seconds=20)))))
        else:
            run.do(order)
    except InputError:
        pass


@pytest.mark.slow
@pytest.mark.parametrize("doors", [False, True])
@settings(max_examples=examples(50))
@given(orders=st.lists(ORDERS, max_size=12))
def test_no_intervention_lets_a_run_fail(doors, orders):
    """A plan for a body that was then put elsewhere, or a room without a way out, ended the run."""
    run = fleet2d.Simulation(home(doors=doors))
    for order, steps in orders:
        request(run, order)
        run.advance(steps)
    stored = run.run()
    again = fleet2d.Simulation(home(doors=doors), interventions=stored.manifest["interventions"])
    assert stored.digest == again.run().digest


def decide(run):
    run.drive("astro")
    run.do(Decide("astro", data_of(run.plan("astro").go_to("kitchen").stay())))


def put(run):
    run.do(Put("astro", "bedroom"))


@pytest.mark.parametrize(
    ("orders", "room"),
    [
        ((decide, put), "bedroom_1"),
        ((put, decide), "kitchen_1"),
        ((put, decide, put), "bedroom_1"),
        ((decide, lambda run: run.do(HoldStill("astro")), put), "bedroom_1"),
        ((decide, lambda run: run.do(Send("astro", "bathroom"))), "bathroom_1"),
        ((lambda run: run.do(Send("astro", "bathroom")), decide), "kitchen_1"),
    ],
)
def test_the_last_of_several_orders_counts(orders, room):
    """A plan and then a place at the same step failed the run: it "doesn't begin here and now"."""
    content = scenario("10 min", robots={"astro": {"type": "patrol"}})
    run = fleet2d.Simulation(content)
    run.advance(60)
    for order in orders:
        order(run)
    run.advance(120)
    assert room == run.state["astro"]["room"]
    stored = run.run()
    again = fleet2d.Simulation(content, interventions=stored.manifest["interventions"]).run()
    assert stored.digest == again.digest


def test_an_intervention_that_has_become_impossible_is_left_out():
    run = fleet2d.Simulation(home(doors=False))
    run.advance(10)
    run.drive("ana")
    run.do(StartActivity("ana", "wash"))  # by a behavior, which no longer decides
    stored = run.run()
    (note,) = (note for note in stored.manifest["notes"] if "left out" in note)
    assert note.startswith("step 10: the intervention activity was left out: ana has no activity")


WAIT = {"on": ["activity", "ana", "wash"], "hold": "astro", "duration": "2 min"}
LATER = {"at": "07:05", "send": "ana", "to": "kitchen"}


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [1, 300])
@pytest.mark.parametrize("act", [WAIT, LATER, {**WAIT, "each": True, "delay": "9 s"}])
def test_what_waits_for_its_time_survives_a_kill(tmp_path, act, seconds):
    """An intervention that waited for an event was lost if no checkpoint had been written yet."""

    def steered(**more):
        run = fleet2d.Simulation(home(doors=False), **more)
        run.advance(20)
        run.do(act)
        return run

    whole = steered().run()
    assert 1 == len(whole.manifest["interventions"])
    killed = steered(out=tmp_path / "run")
    killed.advance(seconds)
    resumed = fleet2d.resume(cut_off(killed))
    assert whole.digest == resumed.digest
    assert whole.manifest["interventions"] == resumed.manifest["interventions"]
    assert fleet2d.reproduce(tmp_path / "run").same


@pytest.mark.parametrize("checkpoint", ["off", "1 min"])
def test_what_has_happened_after_a_wait_happens_once(tmp_path, checkpoint):
    """From the last checkpoint on, the wait and its record in the manifest both took effect."""

    def steered(**more):
        content = home(doors=False)
        content["artifacts"]["checkpoint"] = checkpoint
        run = fleet2d.Simulation(content, **more)
        run.do(WAIT)
        run.advance(165)
        run.do(Put("ana", "kitchen"))
        run.advance(10)
        return run

    whole = steered().run()
    killed = steered(out=tmp_path / "run")
    assert killed._keeper is not None
    killed._keeper.commit(killed._state)
    resumed = fleet2d.resume(cut_off(killed))
    assert whole.digest == resumed.digest
    assert ["hold", "put"] == [act["do"] for act in whole.manifest["interventions"]]
    assert whole.manifest["interventions"] == resumed.manifest["interventions"]


def test_only_events_after_a_request_count():
    """What cameras had seen before, which became known late, was taken for the event."""
    content = home(doors=False)
    run = fleet2d.Simulation(content)
    run.advance(400)
    run.do({"on": "user_seen", "replan": "bolt"})
    stored = run.run()
    records = stored.manifest["interventions"]
    assert [] == [record for record in records if record["step"] <= 400]
    assert stored.digest == fleet2d.Simulation(content, interventions=records).run().digest


class Page:
    """A page of a running simulation, in a process of its own."""

    def __init__(self, out):
        command = [sys.executable, "-m", "fleet2d.cli", "view", "bundled:paper", "--no-browser"]
        options = ["--seed", "4", "--out", str(out), "simulation.duration=20 d"]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen([*command, *options], stdout=pipe, stderr=pipe, text=True)
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().strip().rstrip("/")
        self.frames = 0

    def order(self, action, target="", value=0, **place):
        content = {
            "action": action,
            "target": target,
            "value": value,
            "x": 2.0,
            "y": 2.0,
            "key": "",
            "text": "",
            **place,
        }
        origin = "/".join(self.address.split("/")[:3])
        headers = {"content-type": "application/json", "Origin": origin}
        url, data = f"{self.address}/live/0/order", json.dumps(content).encode()
        urllib.request.urlopen(urllib.request.Request(url, data, headers)).read()

    def watch(self):
        """Read the stream of frames until the server ends it."""
        with urllib.request.urlopen(f"{self.address}/live/0/frames") as stream:
            for _ in stream:
                self.frames += 1


@pytest.mark.slow
@pytest.mark.parametrize("number", some([signal.SIGINT, signal.SIGTERM], 2))
def test_a_signal_with_an_open_page_is_one_line_and_loses_nothing(number, tmp_path):
    """Ctrl-C printed the traceback of the server; SIGTERM ended it before the run was closed."""
    page = Page(tmp_path / "run")
    deadline = time.monotonic() + 20
    while True:  # until the server listens
        try:
            page.order("step", value=600)
            break
        except OSError:
            assert time.monotonic() < deadline
            time.sleep(0.05)
    watcher = threading.Thread(target=page.watch, daemon=True)
    watcher.start()
    for action, x in (("call", 2.0), ("place", 3.0), ("call", 3.5), ("place", 2.0)):
        page.order(action, "astro", x=x)  # failed the run: four clicks while it was paused
    page.order("resume")
    while not page.frames:
        time.sleep(0.01)
    page.process.send_signal(number)
    _, errors = page.process.communicate(timeout=20)
    assert 130 == page.process.returncode
    (line,) = errors.splitlines()
    assert line.startswith("interrupted at 2026-01-")
    assert line.endswith(f"continue it by `fleet2d resume {tmp_path / 'run'}`")
    resumed = fleet2d.resume(tmp_path / "run")
    orders = ["send", "put", "hold", "send", "put", "hold"]
    assert orders == [act["do"] for act in resumed.manifest["interventions"]]
    assert fleet2d.reproduce(tmp_path / "run").same
