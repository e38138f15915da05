"""Steering: a robot that moves at velocities, stops at walls and bodies, and is the same for every span."""

import math
from datetime import timedelta

import numpy as np
import pytest
from tests.thorough import some

import fleet2d

SCENE = {
    "extends": "bundled:paper",
    "simulation": {"duration": "20 s", "step": "0.1 s", "seed": 4, "start": "2026-01-05T12:00"},
    "users": {"ana": {"type": "live", "start": "office"}},
    "robots": {
        "astro": {
            "start": "living_room",
            "start_heading_deg": 0,
            "behaviors": [{"type": "live"}],
        }
    },
    "algorithms": {"ltp": None},
    "metrics": {"ltp_error": None},
}


def steered(*acts, **robot):
    changes = {"robots": {"astro": {**SCENE["robots"]["astro"], **robot}}}
    return fleet2d.run({**SCENE, **changes, "script": list(acts)})


def path(run):
    return run.path("astro", timedelta(seconds=0.1))


def test_a_command_moves_the_robot_for_its_duration_and_it_stands_then():
    walked = path(steered({"at": "1 s", "steer": "astro", "forward": 0.2, "duration": "2 s"}))

    along = walked.x - walked.x[0]
    assert np.allclose(along[[10, 20, 30, 31, 199]], [0, 0.2, 0.4, 0.4, 0.4], atol=1e-3)
    assert np.ptp(walked.y) < 1e-3


def test_a_row_of_short_commands_loses_nothing_to_rounding():
    acts = [{"at": f"{k / 10} s", "steer": "astro", "forward": 0.033} for k in range(100)]
    walked = path(steered(*acts))

    assert abs(walked.x[100] - walked.x[0] - 0.33) < 1e-3


def test_a_turn_on_an_arc_has_the_radius_of_speed_by_rate():
    act = {"at": "0 s", "steer": "astro", "forward": 0.2, "turn_deg": 90, "duration": "2 s"}
    walked = path(steered(act, turn_rate_deg=90))

    radius = 0.2 / math.radians(90)
    x, y = walked.x[20] - walked.x[0], walked.y[20] - walked.y[0]
    assert abs(math.hypot(x, y) - 2 * radius) < 5e-3
    assert abs(walked.heading[20] - math.pi) < 0.01


def test_a_robot_goes_back_and_turns_clockwise_with_negative_numbers():
    act = {"at": "0 s", "steer": "astro", "forward": -0.1, "turn_deg": -45, "duration": "1 s"}
    walked = path(steered(act))

    assert walked.x[10] < walked.x[0]
    assert abs(walked.heading[10] - (2 * math.pi - math.pi / 4)) < 0.01


def test_a_drive_limits_the_command_and_only_a_holonomic_one_goes_sideways():
    act = {"at": "0 s", "steer": "astro", "forward": 3, "left": 3, "duration": "1 s"}
    usual = path(steered(act, speed=0.3))
    sideways = path(steered(act, speed=0.3, drive={"type": "holonomic"}))

    assert abs(usual.x[10] - usual.x[0] - 0.3) < 2e-3
    assert abs(usual.y[10] - usual.y[0]) < 1e-3
    assert abs(sideways.y[10] - sideways.y[0] - 0.3 / math.sqrt(2)) < 2e-3


def test_a_drive_that_accelerates_does_so_across_commands():
    acts = [
        {"at": f"{k / 2} s", "steer": "astro", "forward": 0.4, "duration": "0.5 s"}
        for k in range(4)
    ]
    walked = path(steered(*acts, drive={"type": "trapezoidal", "acceleration": 0.2}))

    speeds = np.diff(walked.x)[:20] / 0.1
    assert speeds[0] < 0.05
    assert 0.3 < speeds[19] <= 0.401
    assert (np.diff(speeds) > -0.011).all()


def test_a_robot_stops_at_a_wall_and_may_back_off():
    acts = [
        {"at": "0 s", "steer": "astro", "forward": 1, "duration": "15 s"},
        {"at": "15 s", "steer": "astro", "forward": -1, "duration": "1 s"},
    ]
    run = steered(*acts, speed=1.0)
    walked = path(run)
    space = fleet2d.Simulation(SCENE).actors["astro"].space
    lattice = space.plan.lattice

    assert walked.x[149] == walked.x[120] > walked.x[0]
    assert walked.x[160] < walked.x[150]
    assert all(
        space.part_at(*lattice.point_at(at)) >= 0 for at in zip(walked.x, walked.y, strict=True)
    )


def test_a_robot_stops_in_front_of_a_person():
    start = fleet2d.Simulation(SCENE).state["astro"]
    ana = {"at": "0 s", "put": "ana", "to": [start["x"] + 1.0, start["y"]]}
    acts = [{"at": f"{k / 2} s", "steer": "astro", "forward": 0.5} for k in range(1, 12)]
    run = steered(ana, *acts, speed=0.5)
    astro = path(run)
    person = run.path("ana", timedelta(seconds=0.1))

    apart = np.hypot(astro.x - person.x, astro.y - person.y)[1:]
    radii = sum(a.entity.radius for a in fleet2d.Simulation(SCENE).actors.values())
    assert radii - 1e-3 <= apart.min() < radii + 0.05


@pytest.mark.parametrize("max_span", some([7, 1, 1000], 3))
def test_steered_runs_are_the_same_for_every_span(max_span):
    acts = [
        {"at": f"{k / 4} s", "steer": "astro", "forward": 0.3, "turn_deg": 40 * (-1) ** k}
        for k in range(40)
    ]
    scene = {**SCENE, "script": acts}
    digests = {fleet2d.run(scene, f"simulation.max_span={span}").digest for span in (max_span, 60)}
    assert len(digests) == 1
