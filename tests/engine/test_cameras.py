"""Cameras in a run: those that wait for something end a span together, at the earliest of it."""

import copy
import re

import pytest
from tests.scenes import OWN, everything, scenario

import fleet2d
from fleet2d.algorithms.observations import SightingTable
from fleet2d.engine import loop
from fleet2d.engine.cameras import NOTHING
from fleet2d.engine.loop import PHASES, Span
from fleet2d.errors import PlacementError


class Glance:
    """A watcher that ends a span after so many steps, and counts those that it has looked at."""

    waits = True

    def __init__(self, stops):
        self.stops, self.next_step, self.looked = stops, 0, 0

    def limit(self, bodies, end):
        return min(end, self.next_step + self.stops)

    def take(self, bodies, end):
        self.looked += end - self.next_step
        self.next_step = end
        return ()

    def interruptions(self, events):
        return ()


class Idle(Glance):
    """One that doesn't wait for anything."""

    waits = False

    def limit(self, bodies, end):
        raise AssertionError


@pytest.mark.parametrize(
    "stops", [[9], [9, 9], [3, 9], [9, 3], [9, 5, 3], [3, 5, 9], [5, 3, 5, 1, 9]]
)
def test_those_who_wait_have_looked_at_the_same_steps(stops):
    state = fleet2d.Simulation(scenario())._state
    glances, idle = [Glance(stop) for stop in stops], Idle(1)
    state.watchers = [*glances, idle]
    span = Span(0, 9)
    loop.watch(state, span)
    assert min(stops) == span.end == state.bodies.step
    assert [span.end] * len(stops) == [glance.looked for glance in glances]
    assert 0 == idle.looked


def looks():
    """Four robots with cameras of all kinds, which wait for what they see."""
    content = everything("1 h")
    for name, radius in (("curio", 0.15), ("drift", 0.1)):
        camera = content["robots"][name]["camera"]
        behaviors = [{"type": f"{OWN}:Greet"}, {"type": "patrol"}]
        content["robots"][name] = {"camera": camera, "radius": radius, "behaviors": behaviors}
    astro = content["robots"]["astro"]
    astro["cameras"] = {
        "front": {**astro.pop("camera"), "latency": "2 s"},
        "rear": {"heading_deg": 180, "period": "3 s", "body_points": 4},
        "mast": {"pan": {"headings_deg": [-60, 0, 60], "dwell": "4 s"}},
    }
    astro["perception"] = {
        "false_positives": {"per_hour": 60},
        "identity": {"mistaken": 0.2},
        "detection": {"distance": 0.7, "memory": "10 s"},
    }
    return content


def observed(cameras):
    """Return all that cameras carry along and have perceived."""
    sightings = SightingTable.joined(cameras._sightings or [NOTHING])
    memory = [array.tolist() for array in cameras.memory]
    return cameras.next_step, memory, cameras.perceived.tolist(), sightings.rows().tolist()


@pytest.mark.slow
@pytest.mark.parametrize("method", ["line_of_sight", "flashlight"])
def test_a_span_ends_at_the_earliest_event_and_all_cameras_have_looked_up_to_it(method):
    """What a camera saw beyond the end of a span is as if it had never looked there."""
    simulation = fleet2d.Simulation({**looks(), "sight": {"method": {"type": method}}})
    state, beyond, ended = simulation._state, 0, 0
    while simulation.step < 600:
        span = Span(simulation.step, 600)
        for phase in PHASES[: PHASES.index(loop.watch)]:
            phase(state, span)
        ahead, whole = (copy.deepcopy(simulation)._state for _ in range(2))
        limits, end = [span.end], span.end
        for watcher in ahead.watchers:
            if watcher.waits:
                ahead.take(watcher, span.first)
                limits.append(watcher.limit(ahead.bodies, end))
        loop.watch(state, span)
        assert min(limits) == span.end == state.bodies.step
        ended += span.end < end
        beyond += max(limits[1:], default=0) > span.end
        for cameras, twin in zip(state.cameras, whole.cameras, strict=True):
            if cameras.waits:
                whole.take(twin, span.end)
                assert observed(twin) == observed(cameras)
        for phase in PHASES[PHASES.index(loop.watch) + 1 :]:
            phase(state, span)
    assert ended > 20
    assert beyond > 5


def test_every_draw_of_every_camera_has_a_stream_of_its_own():
    content = everything("1 min")
    robot = content["robots"]["astro"]
    robot["cameras"] = {"left": robot.pop("camera"), "right": {}}
    robot["perception"] = {"false_positives": {"per_hour": 1}, "attributes": {"activity": {}}}
    content["robots"]["curio"]["perception"] = robot["perception"]
    simulation = fleet2d.Simulation(content)
    keys = []
    for cameras in simulation._state.cameras:
        errors = cameras.errors
        used = errors.keys if cameras.errs else errors.keys[..., :1]
        keys += used.ravel().tolist() + errors.ghost_keys.ravel().tolist()
        keys += [key for sense in cameras.activity_senses for key in sense.keys.tolist()]
    assert len(keys) > 80
    assert len(set(keys)) == len(keys)


def remarks(**robot):
    """What is said of a robot's sight before the run."""
    content = scenario(users={"ana": "meander"}, robots={"astro": {"type": "meander", **robot}})
    return [note for note in fleet2d.Simulation(content).notes if "astro" in note]


SHARES = {"detection": {"visible_share": [[0, 0], [1, 1]]}}


@pytest.mark.parametrize(
    ("robot", "note"),
    [
        ({"camera": {"range": [300, 4500]}}, r"astro\.camera\.range begins at 300 m, and the home"),
        ({"camera": None, "perception": SHARES}, r"astro\.perception has no effect without a cam"),
        ({"perception": SHARES}, r"astro\.camera: .*visible_share needs body_points"),
        ({"camera": {"height": 1}}, r"astro\.camera\.height has no effect without sight\.heights"),
    ],
)
def test_settings_of_sight_without_effect_are_noted(robot, note):
    (text,) = remarks(**robot)

    assert re.search(note, text)


def test_settings_of_sight_that_have_an_effect_are_not_noted():
    assert [] == remarks(camera={"range": [0.3, 4.5], "body_points": 4}, perception=SHARES)


def test_a_spot_outside_the_home_is_refused():
    centimetres = {"false_positives": {"spots": [{"at": [400, 250], "per_hour": 1}]}}

    with pytest.raises(PlacementError, match=r"spots\.0: \(400, 250\) m is outside the home"):
        remarks(perception=centimetres)
