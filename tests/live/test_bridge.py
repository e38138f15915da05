"""Bridges: what arrives late, lost, wrong or too much; what is passed on; and its repetition."""

import re
import signal
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from tests.live.scenes import LIVE, place

import fleet2d
from fleet2d.engine import loop
from fleet2d.errors import InputError
from fleet2d.live import Bridge, LiveStep, from_iterator, open_peers, to_function


class Now:
    """A peer that sends messages before the steps for which it has some."""

    def __init__(self, messages):
        self.messages, self.frames, self.told, self.ended = (
            messages,
            list[LiveStep](),
            list[str](),
            "",
        )

    def open(self, simulation, post):
        self.post = post
        self._give(0)

    def _give(self, step):
        for message in self.messages.get(step, ()):
            self.post(message)

    def send(self, frame: LiveStep):
        self.frames.append(frame)
        self._give(frame.step + 1)

    def tell(self, text):
        self.told.append(text)

    def close(self, run):
        self.ended = run.status


def pose(k, **fields):
    x, y = place()
    return {"type": "pose", "entity": "ana", "x": x + 0.01 * k, "y": y, **fields}


def bridged(messages, **options) -> tuple[Any, Now, Bridge]:
    peer = Now(messages)
    out = options.pop("out", None)
    bridge = Bridge(fleet2d.Simulation(LIVE, out=out), [peer], speed=0, **options)
    return bridge.run(), peer, bridge


def test_ctrl_c_within_a_step_ends_the_run_after_it(monkeypatch):
    def press(_, span):
        if span.first == 3:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(loop, "PHASES", (press, *loop.PHASES))
    run, peer, _ = bridged({})

    assert ("interrupted", "interrupted") == (run.status, peer.ended)
    assert [0, 1, 2, 3] == [frame.step for frame in peer.frames]


def test_the_last_pose_of_a_step_is_where_the_body_is():
    run, peer, bridge = bridged({k: [pose(99), pose(k, heading_deg=90)] for k in range(10)})

    x, _ = place()
    assert [round(f.bodies["ana"]["x"] - x, 2) for f in peer.frames[:10]] == [
        round(0.01 * k, 2) for k in range(10)
    ]
    assert peer.frames[-1].bodies["ana"]["x"] == peer.frames[9].bodies["ana"]["x"]
    assert bridge.counts == {"received": 20, "applied": 10, "replaced": 10}
    assert run.status == peer.ended == "complete"


@pytest.mark.slow
def test_a_recorded_live_run_gives_the_same_digest(tmp_path):
    x, y = place()
    seen = {
        "type": "detections",
        "entity": "astro",
        "detections": [{"user": "ana", "x": x, "y": y}],
    }
    steer = {"type": "velocity", "entity": "astro", "forward": 0.2, "turn_deg": -20}
    messages = {
        0: [pose(0), seen, {"type": "reading", "sensor": "front_door", "on": True}],
        3: ["nonsense", pose(3), seen],
        7: [{"type": "goal", "entity": "astro", "to": list(place()), "heading_deg": 90}],
        9: [steer],
        10: [steer],
        12: [{"type": "goal", "entity": "astro", "to": "bathroom_1"}],
        20: [{"type": "cancel", "entity": "astro"}],
    }

    run, _, _ = bridged(messages, out=tmp_path / "run")

    assert run.tables["observations"].num_rows == 2
    headings = [act.get("heading_deg") for act in run.manifest["interventions"]]
    assert 90 in headings
    assert fleet2d.reproduce(tmp_path / "run").digest == run.digest


def test_frames_have_every_event_and_row_of_the_run():
    x, y = place()
    seen = {
        "type": "detections",
        "entity": "astro",
        "detections": [{"user": "ana", "x": x, "y": y}],
    }
    reading = {"type": "reading", "sensor": "front_door", "on": True}

    run, peer, _ = bridged({2: [seen, reading], 9: [pose(0)]})

    events = [e for frame in peer.frames for e in frame.events]
    rows = [row for frame in peer.frames for row in frame.rows]
    stored = run.tables["events"].num_rows + run.tables["sensors"].num_rows
    assert len(events) == stored
    for table in ("observations", "sensors"):
        assert [row for name, row in rows if name == table] == run.tables[table].to_pylist()
    assert [f.step for f in peer.frames] == list(range(30))
    kinds = {message["type"] for frame in peer.frames for message in frame.messages}
    assert kinds == {"poses", "event", "row"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("message", "told"),
    [
        ("{", "wrong: not JSON"),
        ({"type": "dance"}, "wrong: "),
        (pose(0) | {"entity": "anna"}, "wrong: there is nobody named 'anna': did you mean 'ana'"),
        (pose(0) | {"x": 1e9}, "wrong: pose.x: "),
        (pose(0) | {"x": -90.0}, "wrong: ana would be "),
        (
            pose(0) | {"x": 9000.0, "y": 4000.0},
            "wrong: ana would be 9827.4 m from any place where its body fits by its coordinates: in mi",
        ),
        (pose(0) | {"speed": 3}, "wrong: "),
        ({"type": "reading", "sensor": "door", "on": True}, "wrong: there is no sensor 'door'"),
        (pose(0) | {"time": 5.0}, "late: a message was sent"),
        ("{" + '"a":[' * 100_000, "wrong: not JSON"),
    ],
)
def test_what_is_wrong_is_told_and_the_body_stands(message, told):
    run, peer, bridge = bridged({0: [pose(0)], 5: [message]})

    assert bridge.counts["received"] == 2
    assert bridge.counts["applied"] == 1
    assert len(peer.told) == 1
    assert peer.told[0].startswith(told)
    assert run.status == "complete"
    summary, reason = run.manifest["notes"][-2:]
    assert "live: 2 messages were received: 1 applied, 1 " in summary
    assert reason == f"live: 1 {peer.told[0]}"
    assert len({frame.bodies["ana"]["x"] for frame in peer.frames}) == 1


def test_reading_that_the_end_leaves_no_step_for_is_told():
    on, off = ({"type": "reading", "sensor": "front_door", "on": state} for state in (True, False))

    _, _, bridge = bridged({29: [on, off]})

    assert bridge.counts == {"received": 2, "applied": 1, "lost": 1}


def test_a_pulse_shorter_than_a_step_is_seen():
    """Of on and off in one step a sensor had only the last state, and both were applied."""
    on, off = ({"type": "reading", "sensor": "front_door", "on": state} for state in (True, False))

    run, _, bridge = bridged({2: [on, off, on, off], 6: [on, on], 8: [off]})

    rows = run.tables["sensors"].select(["step", "state"]).to_pylist()
    assert [(2, "ON"), (3, "OFF"), (6, "ON"), (8, "OFF")] == [
        (row["step"], row["state"]) for row in rows
    ]
    assert bridge.counts == {"received": 7, "applied": 5, "replaced": 2}


def test_a_flood_does_not_fill_the_memory():
    bridge = Bridge(fleet2d.Simulation(LIVE), [Now({})], speed=0, max_per_step=10)
    post = bridge._post_of(0)
    for k in range(1000):
        post(pose(k))
    assert bridge._inbox.qsize() == 100
    bridge.run()

    assert bridge.counts["received"] == 1000
    assert bridge.counts["applied"] == 1
    rest = [bridge.counts[why] for why in ("applied", "replaced", "too many")]
    assert sum(rest) == 1000
    assert rest[2] >= 900


@pytest.mark.slow
def test_a_body_stands_when_poses_stop_and_moves_when_they_arrive_again():
    told = []

    def messages() -> Iterator[dict[str, Any]]:
        yield pose(0)
        while not told:  # until it stands, however late a busy machine finds that
            time.sleep(0.01)
        yield pose(1)

    simulation = fleet2d.Simulation(LIVE)
    bridge = Bridge(simulation, [from_iterator(messages())], 20, silence_s=0.1, tell=told.append)
    run = bridge.run()

    assert told[:2] == ["ana: no pose arrived for 0.1 s: it stands", "ana: poses arrive again"]
    acts = [act["do"] for act in run.manifest["interventions"]]
    assert acts[:3] == ["put", "hold", "put"]


def test_a_body_that_decides_itself_refuses_poses():
    content = LIVE | {"users": {"ana": {"type": "routine", "persona": "retired"}}}
    peer = Now({0: [pose(0)]})

    Bridge(fleet2d.Simulation(content), [peer], speed=0).run()

    assert peer.told == [
        "wrong: ana decides itself where it goes: only a body with the behavior live gets poses"
    ]


@pytest.mark.slow
def test_steps_begin_in_time():
    simulation = fleet2d.Simulation(LIVE, "simulation.step=50 ms", "simulation.duration=1 s")
    began = time.monotonic()

    bridge = Bridge(simulation, [to_function(id)], speed=2)
    bridge.run()

    assert time.monotonic() - began > 0.45
    assert len(bridge.lateness_s) == 20
    assert min(bridge.lateness_s) >= 0


def test_a_function_may_intervene():
    simulation = fleet2d.Simulation(LIVE)

    def send(frame: LiveStep):
        if frame.step == 3:
            simulation.do({"send": "astro", "to": "kitchen_1"})

    run = Bridge(simulation, [to_function(send)], speed=0).run()

    assert [act["step"] for act in run.manifest["interventions"]] == [4]


# Who sends what


GOAL = {"type": "goal", "entity": "astro", "to": "kitchen_1"}


@pytest.mark.parametrize(("gone", "options"), [(3, {"keeps_goals": True}), (2, {})])
def test_goals_stay_if_they_are_to_be_kept_or_another_client_is_gone(gone, options):
    bridge = Bridge(fleet2d.Simulation(LIVE), [Now({})], speed=0, **options)
    post = bridge._post_of(0)
    post(GOAL, 3)
    post(None, gone)

    assert [act["do"] for act in bridge.run().manifest["interventions"]] == ["send"]


@pytest.mark.parametrize("behavior", ["live", "patrol"])
def test_goals_of_a_client_that_is_gone_are_withdrawn_and_the_body_stands_or_decides(behavior):
    content = LIVE | {"robots": {"astro": {"behaviors": [{"type": behavior}]}}}
    peer = Now({0: [GOAL], 5: [None]})
    bridge = Bridge(fleet2d.Simulation(content), [peer], speed=0)
    run = bridge.run()

    assert [act["do"] for act in run.manifest["interventions"]] == ["send", "release"]
    assert peer.told == ["astro: who sent it to kitchen_1 is gone: the goal is withdrawn"]
    places = [(frame.bodies["astro"]["x"], frame.bodies["astro"]["y"]) for frame in peer.frames]
    assert len(set(places[:5])) > 1
    assert (len(set(places[6:])) == 1) == (behavior == "live")
    assert bridge.counts["withdrawn"] == 1


def test_clients_of_one_peer_count_their_own_messages():
    """The second one's number 0 came after the first one's 7, and was late."""
    bridge = Bridge(fleet2d.Simulation(LIVE), [Now({})], speed=0)
    post = bridge._post_of(0)
    post(GOAL | {"number": 7}, 1)
    post(pose(0, number=0), 2)
    bridge.run()

    assert bridge.counts["applied"] == 2
    assert not bridge.counts["late"]


SOURCE = "udp://127.0.0.1:9"


def sourced():
    astro = {
        "perceives": {"type": "live", "source": SOURCE},
        "behaviors": [{"type": "live", "source": SOURCE}],
    }
    sensor = {"type": "live_sensor", "room": "hallway", "source": SOURCE}
    return LIVE | {"robots": {"astro": astro}, "objects": {"front_door": sensor}}


def test_only_the_source_of_a_part_speaks_for_it():
    x, y = place()
    messages = [
        GOAL,
        {"type": "detections", "entity": "astro", "detections": [{"user": "ana", "x": x, "y": y}]},
        {"type": "reading", "sensor": "front_door", "on": True},
    ]
    source, other = Now({0: messages}), Now({1: [*messages, pose(0)]})

    bridge = Bridge(fleet2d.Simulation(sourced()), {SOURCE: source, "function": other}, speed=0)
    run = bridge.run()

    acts = [(act["do"], act["step"]) for act in run.manifest["interventions"]]
    assert acts == [("send", 0), ("perceive", 0), ("report", 0), ("put", 1)]
    assert other.told[0] == "wrong: astro takes messages of its source only, not of others"
    assert bridge.counts["wrong"] == 3
    assert fleet2d.run(sourced()).status == "complete"  # without its sources


def test_a_source_that_is_no_peer_is_refused():
    with pytest.raises(InputError, match=r"astro takes messages of udp://127.0.0.1:9, which isn't"):
        Bridge(fleet2d.Simulation(sourced()), [Now({})])


def test_a_wrong_address_of_a_source_is_refused():
    with pytest.raises(InputError, match="did you mean 'mqtt'"):
        fleet2d.Simulation(LIVE, "users.ana={type: live, source: 'mqt://nas:1'}")


def test_a_scenario_does_not_talk_to_other_machines_by_itself():
    changed = fleet2d.load_scenario(LIVE, "users.ana={type: live, source: 'mqtt://example.com'}")
    with pytest.raises(InputError, match="would talk to mqtt"):
        open_peers(changed)


HALLWAY = GOAL | {"to": "hallway_1", "id": "second"}
VELOCITY = {"type": "velocity", "entity": "astro", "forward": 0.1}
CANCEL = {"type": "cancel", "entity": "astro"}
ORDERED = {
    "a goal after a velocity": ([GOAL, VELOCITY, HALLWAY], "steer, send hallway_1", "replaced"),
    "a velocity after a goal": ([VELOCITY, GOAL, VELOCITY], "send kitchen_1, steer", "replaced"),
    "a goal after one that is withdrawn": ([GOAL, CANCEL, HALLWAY], "send hallway_1", "replaced"),
    "the same by its name": (
        [GOAL | {"id": "first"}, CANCEL | {"id": "first"}, HALLWAY], "send hallway_1", "replaced",
    ),
    "a pose that is refused": ([pose(1), pose(1) | {"x": -90.0}], "put", "wrong"),
    "a goal that is refused": ([GOAL, GOAL | {"to": "kitchn_1"}], "send kitchen_1", "wrong"),
    "a client that is gone": ([GOAL, None], "send kitchen_1, release", "withdrawn"),
    "a client that came back": ([GOAL, None, HALLWAY], "send hallway_1", "replaced"),
}  # fmt: skip


@pytest.mark.parametrize("case", ORDERED)
def test_messages_of_one_step_count_in_the_order_of_their_arrival(case):
    messages, acts, counted = ORDERED[case]
    run, peer, bridge = bridged({3: messages})

    done = run.manifest["interventions"]
    assert acts == ", ".join(
        f"{act['do']} {act['to']}" if act["do"] == "send" else act["do"] for act in done
    )
    assert len(messages) == bridge.counts["received"] + messages.count(None)
    assert bridge.counts["applied"] == len(done) - acts.count("release")
    assert bridge.counts[counted] == (2 if "withdrawn" in case or "name" in case else 1)
    assert len(peer.told) == (counted in ("wrong", "withdrawn"))


# Frames that don't fit


def test_a_pose_in_a_wall_is_moved_to_where_the_body_fits_and_told():
    home = fleet2d.Simulation(LIVE).actors["ana"]
    x, y = place()
    lattice, space = home.home.plan.lattice, home.space
    while space.part_at(*lattice.point_at((x, y))) >= 0:
        x += 0.01

    run, peer, bridge = bridged({0: [{"type": "pose", "entity": "ana", "x": x + 0.1, "y": y}]})

    (act,) = run.manifest["interventions"]
    assert act["to"][0] == pytest.approx(x, abs=0.05)
    assert bridge.counts["moved"] == 1
    assert re.fullmatch(r"moved: ana: a pose in or at a wall, by 0\.1\d m", peer.told[0])


def test_detections_outside_of_the_home_are_left_out_and_told():
    x, y = place()
    seen = [{"user": "ana", "x": x, "y": y}, {"user": "ana", "x": x + 50, "y": y}]
    message = {"type": "detections", "entity": "astro", "detections": seen}

    run, peer, bridge = bridged({0: [message], 1: [message | {"detections": seen[1:]}]})

    assert run.tables["observations"]["x"].to_pylist() == [pytest.approx(x, abs=1e-3)]
    assert re.match(
        r"outside: astro: detections are outside of the home, by up to \d+", peer.told[0]
    )
    assert bridge.counts["outside"] == 2


# What is odd


def test_each_reason_is_told_once_and_counted_in_the_summary():
    away = [pose(0) | {"x": 100.0 + k} for k in range(40)]
    unknown = [pose(0) | {"entity": "bob"}] * 3

    run, peer, bridge = bridged({k: [message] for k, message in enumerate([*away[:25], *unknown])})

    assert len(peer.told) == 2
    assert bridge.counts["wrong"] == 28
    assert run.manifest["notes"][-2:] == [f"live: 25 {peer.told[0]}", f"live: 3 {peer.told[1]}"]


def test_a_flood_of_different_reasons_is_bounded():
    names = [chr(ord("a") + k // 26) + chr(ord("a") + k % 26) for k in range(200)]
    run, peer, bridge = bridged({0: [pose(0) | {"entity": f"x{name}"} for name in names]})

    assert bridge.counts["wrong"] == 200
    assert len(peer.told) == 20
    assert len([note for note in run.manifest["notes"] if note.startswith("live: ")]) == 21


@pytest.mark.parametrize("off_s", [-60.0, 60.0])
def test_a_message_of_another_time_is_left_out(off_s):
    _, peer, bridge = bridged({0: [pose(0, time=time.time() + off_s)]})

    assert bridge.counts == {"received": 1, "late": 1}
    told = r"dated (60|59)\.\d s ahead" if off_s > 0 else r"sent 60\.\d s ago"
    assert re.search(told, peer.told[0])


def test_a_message_before_the_last_one_of_its_body_is_late(monkeypatch):
    now = time.time()
    # The clock stands still: else a busy machine takes so long that the first one is late, too.
    clock = SimpleNamespace(time=lambda: now, monotonic=time.monotonic)
    monkeypatch.setattr("fleet2d.live.bridge.time", clock)
    messages = {0: [pose(0, time=now - 0.1)], 1: [pose(5, time=now - 0.2)]}
    _, peer, bridge = bridged(messages)

    assert bridge.counts == {"received": 2, "applied": 1, "late": 1}
    assert peer.told == ["late: ana: a message was sent before the last one"]


@pytest.mark.slow
def test_an_iterator_that_fails_is_told_in_a_line(capfd):
    def messages() -> Iterator[dict[str, Any]]:
        yield pose(0)
        raise ValueError("no more")

    told = []
    simulation = fleet2d.Simulation(LIVE)
    bridge = Bridge(simulation, [from_iterator(messages())], 20, tell=told.append)
    bridge.run()

    assert told[0] == "errors: a thread ended: ValueError: no more"
    assert bridge.counts["errors"] == 1
    assert "Traceback" not in capfd.readouterr().err


FLOOD = [{"type": "reading", "sensor": "front_door", "on": bool(k % 2)} for k in range(5000)]
AFAR = dict(zip("xy", place("bedroom_1"), strict=True))
COUNTED = {
    "lost and late by their numbers": (
        {k: [pose(k, number=n)] for k, n in enumerate([0, 1, 4, 3, 5])},
        {"received": 5, "applied": 4, "lost": 2, "late": 1},
        ["lost: 2 messages before number 4", "late: message 3 after 4"],
    ),
    "a flood": (
        {0: FLOOD},
        {"received": 5000, "applied": 2, "replaced": 998, "too many": 4000},
        ["too many: more than 1000 messages in a step"],
    ),
    "a body that jumps": (
        {k: [pose(0) | (AFAR if k % 2 else {})] for k in range(4)},
        {"received": 4, "applied": 4, "jumps": 3},
        [r"jumps: ana: a pose is \d+\.\d m from the one 1 s before"],
    ),
    "what is refused is tried so often": (
        {3: [GOAL, *[GOAL | {"to": "kitchn_1"}] * 200]},
        {"received": 201, "wrong": 100, "replaced": 101},
        ["wrong: .* did you mean 'kitchen_1'.*"],
    ),
}


@pytest.mark.parametrize("case", COUNTED)
def test_what_is_odd_is_counted_and_told(case):
    messages, counts, told = COUNTED[case]
    _, peer, bridge = bridged(messages)

    assert bridge.counts == counts
    assert len(peer.told) == len(told)
    for text, expected in zip(peer.told, told, strict=True):
        assert re.fullmatch(expected, text)


@pytest.mark.parametrize(("step", "second"), [(1, "applied"), (0, "replaced")])
def test_two_programs_that_send_poses_of_one_body_are_told(step, second):
    first, other = Now({0: [pose(0)]}), Now({step: [pose(1)]})
    bridge = Bridge(fleet2d.Simulation(LIVE), [first, other], speed=0)
    bridge.run()

    assert first.told == ["of two senders: ana: poses of two programs arrive: name its source"]
    assert bridge.counts[second] == 1 + (second == "applied")
