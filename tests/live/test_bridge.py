"""Bridges: what arrives late, lost, wrong or too much; what is passed on; and its repetition."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.live.scenes import LIVE, place

import fleet2d
from fleet2d.live import Bridge, LiveStep, from_iterator, to_function


class Now:
    """A peer that sends messages before the steps for which it has some."""

    def __init__(self, messages: dict[int, list[Any]]) -> None:
        self.messages, self.frames, self.told, self.ended = (
            messages,
            list[LiveStep](),
            list[str](),
            "",
        )

    def open(self, simulation: Any, post: Any) -> None:
        self.post = post
        self._give(0)

    def _give(self, step: int) -> None:
        for message in self.messages.get(step, ()):
            self.post(message)

    def send(self, frame: LiveStep) -> None:
        self.frames.append(frame)
        self._give(frame.step + 1)

    def tell(self, text: str) -> None:
        self.told.append(text)

    def close(self, run: Any) -> None:
        self.ended = run.status


def pose(k: int, **fields: Any) -> dict[str, Any]:
    x, y = place()
    return {"type": "pose", "entity": "ana", "x": x + 0.01 * k, "y": y, **fields}


def bridged(messages: dict[int, list[Any]], **options: Any) -> tuple[Any, Now, Bridge]:
    peer = Now(messages)
    out = options.pop("out", None)
    bridge = Bridge(fleet2d.Simulation(LIVE, out=out), [peer], speed=0, **options)
    return bridge.run(), peer, bridge


def test_poses_are_where_the_body_is() -> None:
    run, peer, bridge = bridged({k: [pose(k, heading_deg=90)] for k in range(10)})

    x, _ = place()
    assert [round(f.bodies["ana"]["x"] - x, 2) for f in peer.frames[:10]] == [
        round(0.01 * k, 2) for k in range(10)
    ]
    assert peer.frames[-1].bodies["ana"]["x"] == peer.frames[9].bodies["ana"]["x"]
    assert bridge.counts == {"received": 10, "applied": 10}
    assert run.status == peer.ended == "complete"


def test_a_recorded_live_run_gives_the_same_digest(tmp_path: Path) -> None:
    x, y = place()
    seen = {
        "type": "detections",
        "entity": "astro",
        "detections": [{"user": "ana", "x": x, "y": y}],
    }
    messages: dict[int, list[Any]] = {
        0: [pose(0), seen, {"type": "reading", "sensor": "front_door", "on": True}],
        3: ["nonsense", pose(3), seen],
        7: [{"type": "goal", "entity": "astro", "to": "kitchen_0"}],
    }

    run, _, _ = bridged(messages, out=tmp_path / "run")

    assert run.tables["observations"].num_rows == 2
    assert fleet2d.reproduce(tmp_path / "run").digest == run.digest


def test_frames_have_every_event_and_row_of_the_run() -> None:
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


@pytest.mark.parametrize(
    ("message", "told"),
    [
        ("{", "wrong: not JSON"),
        ("[1]", "wrong: "),
        ({"type": "dance"}, "wrong: "),
        (pose(0) | {"entity": "anna"}, "wrong: there is nobody named 'anna': did you mean 'ana'"),
        (pose(0) | {"x": 1e9}, "wrong: pose.x: "),
        (pose(0) | {"x": -90.0}, "wrong: "),
        (pose(0) | {"speed": 3}, "wrong: "),
        ({"type": "reading", "sensor": "door", "on": True}, "wrong: there is no sensor 'door'"),
        (pose(0) | {"time": 5.0}, "late: a message was sent"),
        ("{" + '"a":[' * 100_000, "wrong: not JSON"),
    ],
)
def test_what_is_wrong_is_told_and_the_body_stands(message: Any, told: str) -> None:
    run, peer, bridge = bridged({0: [pose(0)], 5: [message]})

    assert bridge.counts["received"] == 2
    assert bridge.counts["applied"] == 1
    assert len(peer.told) == 1
    assert peer.told[0].startswith(told)
    assert run.status == "complete"
    assert "live: 2 messages were received: 1 applied, 1 " in run.manifest["notes"][-1]
    assert len({frame.bodies["ana"]["x"] for frame in peer.frames}) == 1


def test_lost_and_late_messages_are_counted_by_their_numbers() -> None:
    numbers = [0, 1, 4, 3, 5]
    _, peer, bridge = bridged({k: [pose(k, number=n)] for k, n in enumerate(numbers)})

    assert bridge.counts == {"received": 5, "applied": 4, "lost": 2, "late": 1}
    assert peer.told == ["2 messages before number 4 are lost", "late: message 3 after 4"]


def test_of_a_flood_only_some_is_applied() -> None:
    flood = [{"type": "reading", "sensor": "front_door", "on": bool(k % 2)} for k in range(5000)]
    _, peer, bridge = bridged({0: flood}, max_per_step=100)

    assert bridge.counts == {"received": 5000, "applied": 100, "too many": 4900}
    assert len(peer.told) == 20


def test_only_the_last_pose_of_a_step_counts() -> None:
    _, peer, bridge = bridged({0: [pose(k) for k in range(50)]})

    assert bridge.counts == {"received": 50, "applied": 1, "replaced": 49}
    assert peer.frames[0].bodies["ana"]["x"] == pytest.approx(place()[0] + 0.49, abs=1e-3)


def test_a_body_stands_when_poses_stop_and_moves_when_they_arrive_again() -> None:
    told: list[str] = []

    def messages() -> Iterator[dict[str, Any]]:
        yield pose(0)
        time.sleep(0.4)
        yield pose(1)

    simulation = fleet2d.Simulation(LIVE)
    bridge = Bridge(simulation, [from_iterator(messages())], 20, silence_s=0.1, tell=told.append)
    run = bridge.run()

    assert told[:2] == ["ana: no pose arrived for 0.1 s: it stands", "ana: poses arrive again"]
    acts = [act["do"] for act in run.manifest["interventions"]]
    assert acts[:3] == ["put", "hold", "put"]


def test_a_body_that_decides_itself_refuses_poses() -> None:
    content = LIVE | {"users": {"ana": {"type": "routine", "persona": "retired"}}}
    peer = Now({0: [pose(0)]})

    Bridge(fleet2d.Simulation(content), [peer], speed=0).run()

    assert peer.told == [
        "wrong: ana decides itself where it goes: only a body with the behavior live gets poses"
    ]


def test_steps_begin_in_time() -> None:
    simulation = fleet2d.Simulation(LIVE, "simulation.step=50 ms", "simulation.duration=1 s")
    began = time.monotonic()

    bridge = Bridge(simulation, [to_function(id)], speed=2)
    bridge.run()

    assert time.monotonic() - began > 0.45
    assert len(bridge.lateness_s) == 20
    assert min(bridge.lateness_s) >= 0


def test_a_function_may_intervene() -> None:
    simulation = fleet2d.Simulation(LIVE)

    def send(frame: LiveStep) -> None:
        if frame.step == 3:
            simulation.intervene({"send": "astro", "to": "kitchen_0"})

    run = Bridge(simulation, [to_function(send)], speed=0).run()

    assert [act["step"] for act in run.manifest["interventions"]] == [4]
