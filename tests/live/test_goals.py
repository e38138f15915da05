"""Goals of live runs: what becomes of each is told, once for each end, to whoever listens."""

import json
import socket
from itertools import pairwise

import pytest
from tests.live.scenes import LIVE, place
from tests.live.test_bridge import Now

import fleet2d
from fleet2d.live import Bridge
from fleet2d.live.peers import UdpPeer

GOAL = {"type": "goal", "entity": "astro", "to": "kitchen_1", "id": "g1"}


def told(messages, **changes):
    """Return what was told of goals, without repetitions, in a run with messages before steps."""
    peer = Now(messages)
    Bridge(fleet2d.Simulation({**LIVE, **changes}), [peer], speed=0).run()
    states = [goal for frame in peer.frames for goal in frame.goals]
    return [s for i, s in enumerate(states) if i == 0 or s[:4] != states[i - 1][:4]]


def names(states) -> list[tuple[str, str]]:
    return [(state.id, str(state.state)) for state in states]


def test_a_goal_is_accepted_under_way_and_reached():
    states = told({0: [GOAL]}, simulation=LIVE["simulation"] | {"duration": "90 s"})

    assert names(states) == [("g1", "accepted"), ("g1", "under_way"), ("g1", "reached")]


def test_what_is_left_of_the_way_falls_to_nothing():
    peer = Now({0: [GOAL]})
    changes = "simulation.duration=90 s"
    Bridge(fleet2d.Simulation(LIVE, changes), [peer], speed=0).run()

    left = [g for f in peer.frames for g in f.goals if g.state == "under_way"]
    assert all(a.metres >= b.metres and a.seconds > b.seconds for a, b in pairwise(left))
    assert left[0].metres > 1 > left[-1].metres
    assert left[-1].seconds <= 1 == round(left[-2].seconds - left[-1].seconds)


@pytest.mark.parametrize(
    ("to", "reason"),
    [("kitchn", "kitchen"), ([50.0, 50.0], "wall"), ("ana_", "no")],
)
def test_an_impossible_goal_is_told_with_its_reason(to, reason):
    (state,) = told({0: [GOAL | {"to": to}]})

    assert state.state == "impossible"
    assert reason in state.detail


@pytest.mark.slow
def test_goals_end_by_others_by_poses_by_steering_and_when_they_are_withdrawn():
    x, y = place()
    other = GOAL | {"id": "g2", "to": "bathroom_1"}
    pose = {"type": "pose", "entity": "astro", "x": x, "y": y}
    steer = {"type": "velocity", "entity": "astro", "forward": 0.1}
    cancel = {"type": "cancel", "entity": "astro"}
    begun = [("g1", "accepted"), ("g1", "under_way"), ("g1", "cancelled")]

    assert names(told({0: [GOAL], 3: [other]}))[:5] == [
        *begun,
        ("g2", "accepted"),
        ("g2", "under_way"),
    ]
    assert names(told({0: [GOAL], 3: [pose]})) == begun
    assert names(told({0: [GOAL], 3: [steer]})) == begun
    assert names(told({0: [GOAL], 3: [cancel]})) == begun


def test_only_a_goal_that_a_body_has_is_withdrawn():
    bridge = Bridge(
        fleet2d.Simulation(LIVE),
        [Now({0: [GOAL], 2: [{"type": "cancel", "entity": "astro", "id": "g0"}]})],
        speed=0,
    )
    bridge.run()

    assert bridge.counts["wrong"] == 1
    assert "live: 1 wrong: astro has no goal 'g0'" in bridge.notes()


def test_two_goals_in_one_step_end_each_once():
    states = told({0: [GOAL, GOAL | {"id": "g2"}]})

    assert names(states)[:2] == [("g1", "impossible"), ("g2", "accepted")]
    assert states[0].detail == "another goal came at once"


def test_an_order_of_a_script_ends_a_goal():
    states = told({0: [GOAL]}, script=[{"at": "5 s", "hold": "astro"}])

    assert names(states)[-1] == ("g1", "cancelled")
    assert states[-1].detail == "the body has another order, or none"


def test_a_shut_door_blocks_a_goal_until_it_is_open():
    door = {"type": "door", "doorway": "bathroom_1", "open": False}
    simulation = LIVE["simulation"] | {"duration": "3 min"}
    opens = [{"at": "1 min", "open": "door"}]
    states = told(
        {0: [GOAL | {"to": "bathroom_1"}]},
        simulation=simulation,
        objects=LIVE["objects"] | {"door": door},
        script=opens,
    )

    assert [str(s.state) for s in states if s.state != "under_way"] == [
        "accepted",
        "blocked",
        "reached",
    ]
    assert "can't be reached" in next(s.detail for s in states if s.state == "blocked")


def test_a_robot_whose_battery_is_empty_is_blocked():
    robot = LIVE["robots"]["astro"] | {
        "battery": {"driving": "1 h", "standing": "2 h", "charging": "1 h", "charger": "any"}
    }
    states = told(
        {0: [GOAL]},
        robots={"astro": robot},
        script=[{"at": "5 s", "battery": "astro", "charge": 0}],
    )

    assert names(states)[-1] == ("g1", "blocked")
    assert states[-1].detail == "it can't move"


@pytest.mark.slow
def test_who_sends_a_datagram_hears_what_becomes_of_its_goal():
    peer = UdpPeer("127.0.0.1", 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as program:
        program.settimeout(5)
        simulation = fleet2d.Simulation(LIVE, "simulation.step=50 ms", "simulation.duration=2 s")

        def send():
            program.sendto(json.dumps(GOAL).encode(), ("127.0.0.1", peer.port))

        first = Now({})
        first.open = lambda *_: send()
        Bridge(simulation, [peer, first], speed=1).run()
        states = [json.loads(program.recv(1000))["state"] for _ in range(1)]

    assert states == ["accepted"]
