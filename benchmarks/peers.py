"""The same home in the simulators that people would pick instead of Fleet2D.

    python -m venv peers && peers/bin/pip install -r benchmarks/peers_requirements.txt
    peers/bin/python benchmarks/peers.py --plan 658e5214673c7a4e25b458e56bdb6144.json

Scene: the walls of that HouseExpo plan; one robot and N users who each go round six
waypoints for ever, at 0.5 m/s, in steps of 1 s. Neither peer plans a path here, so each
leg of the tour is straight and clear of walls. The robot senses one of:

* none: nothing;
* fov: who is within 108 degrees and 4.5 m of it (IR-SIM only);
* lidar: 109 beams, one per degree, over 108 degrees and 4.5 m;
* avoid: all agents see and avoid agents and walls (navground; with IR-SIM's RVO they get stuck).

An agent-step is one agent, robot or user, moved by one step. Each case has a process of
its own, so that a peer that is missing, crashes or hangs does not stop the others.
"""

import argparse
import importlib
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

Point = tuple[float, float]

# Garage, living room, hall, bedroom and back, through three doors and an opening.
TOUR: list[Point] = [(4.3, 8.5), (4.2, 3.0), (11.8, 4.3), (11.7, 9.0), (11.6, 4.3), (4.0, 2.7)]
# The goals of agent i are GOALS[i % 6], in this order; it starts at the last of them.
GOALS = [TOUR[i + 1 :] + TOUR[: i + 1] for i in range(len(TOUR))]
CLEARANCE = 0.35  # m from each leg to the walls: a body and some overshoot
STEP_S, SPEED, YAW_RATE, RADIUS = 1.0, 0.5, 1.5, 0.25  # s, m/s, rad/s, m: of every agent
TOLERANCE = SPEED * STEP_S  # m; nearer than half a step an agent may jump over its goal
FOV, RANGE, BEAMS = math.radians(108.0), 4.5, 109
REPEATS, USERS = 3, (1, 5)

LESS = "no routines, no paths planned, nothing stored to disk"
GHOSTS = "agents pass through each other, walls do not stop them"
WHO = "less: distances, not who is seen; more: 109 of them, walls and bodies occlude"
# Peer -> what is sensed -> what to keep in mind beside the figure.
CASES: dict[str, dict[str, tuple[str, ...]]] = {
    "navground": {
        "none": ("straight legs in a compiled loop, walls never looked at", GHOSTS, LESS),
        "lidar": (WHO, GHOSTS, LESS),
        "no_stops_in": (
            "more: avoidance (HL), collisions; bodies still overlap at 1 s, 0.1 s is usual",
            LESS,
        ),
    },
    "ir-sim": {
        "none": ("more: collisions tested, trajectories kept in memory", GHOSTS, LESS),
        "fov": ("less: sees through walls", "more: collisions tested", GHOSTS, LESS),
        "lidar": (WHO, "more: collisions tested", GHOSTS, LESS),
    },
}


@dataclass(frozen=True)
class PeerResult:
    """One peer in one case; the figures are 0 where `failure` says why."""

    name: str
    version: str
    case: str
    agent_steps_per_s: float = 0.0  # median
    setup_s: float = 0.0  # import, build the world, first step
    caveats: tuple[str, ...] = ()
    spread: float = 0.0  # (fastest - slowest) / median
    m_per_step: float = 0.0  # mean over agents and steps
    failure: str | None = None


@dataclass(frozen=True)
class Scene:
    """A peer's world, ready to run."""

    advance: Callable[[int], object]  # so many steps
    positions: Callable[[], list[tuple[float, ...]]]  # of all agents, metres
    sensed: Callable[[], float] | None  # a number that changes as the robot moves


def read_outline(plan: Path) -> list[Point]:
    """Vertices of the plan's one outline in metres, each once.

    Raises:
        ValueError: if a leg of the tour comes too close to a wall of this plan.
    """
    import shapely

    vertices = [(float(x), float(y)) for x, y in json.loads(plan.read_text())["verts"]]
    outline = [v for i, v in enumerate(vertices) if v != vertices[i - 1]]
    if not shapely.Polygon(outline).buffer(-CLEARANCE).covers(shapely.LinearRing(TOUR)):
        raise ValueError(f"{plan}: the tour is made for HouseExpo plan 658e5214…, use that one")
    return outline


def navground_scene(outline: list[Point], users: int, sensing: str) -> Scene:
    """The scene in navground."""
    core: Any = importlib.import_module("navground.core")
    sim: Any = importlib.import_module("navground.sim")
    world = sim.World()
    for i, vertex in enumerate(outline):
        world.add_wall(core.LineSegment(outline[i - 1], vertex))
    lidar = sim.state_estimations.LidarStateEstimation(RANGE, -FOV / 2, FOV, BEAMS)
    for i in range(users + 1):
        goals = GOALS[i % len(GOALS)]
        kinematics = core.kinematics.OmnidirectionalKinematics(SPEED, YAW_RATE)
        if sensing == "no_stops_in":
            behavior = core.behaviors.HLBehavior(kinematics, RADIUS)
            sensors = [sim.state_estimations.BoundedStateEstimation(RANGE)]
        else:
            behavior = core.behaviors.DummyBehavior(kinematics, RADIUS)
            # Without a state to write to, navground skips its sensors.
            behavior.environment_state_type = "Sensing"
            sensors = [lidar] if sensing == "lidar" and i == 0 else []
        behavior.optimal_speed = SPEED
        behavior.heading = core.Behavior.Heading.velocity
        task = sim.tasks.WaypointsTask(goals, True, TOLERANCE)
        agent = sim.Agent(RADIUS, behavior, kinematics, task, sensors)
        agent.ignore_collisions = sensing != "no_stops_in"
        agent.pose = core.Pose2(goals[-1], 0.0)
        world.add_agent(agent)

    state = world.agents[0].behavior.environment_state
    return Scene(
        advance=lambda steps: world.run(steps, STEP_S),
        positions=lambda: [tuple(map(float, agent.position)) for agent in world.agents],
        sensed=(lambda: float(sum(lidar.read_ranges(state)))) if sensing == "lidar" else None,
    )


def irsim_scene(outline: list[Point], users: int, sensing: str) -> Scene:
    """The scene in IR-SIM."""
    irsim: Any = importlib.import_module("irsim")
    robots: list[dict[str, Any]] = [
        {
            "kinematics": {"name": "omni_angular"},
            "shape": {"name": "circle", "radius": RADIUS},
            "state": [*goals[-1], 0.0],
            "goal": [[x, y, 0.0] for x, y in goals],
            "goal_threshold": TOLERANCE,
            "vel_min": [-SPEED, -SPEED, -YAW_RATE],
            "vel_max": [SPEED, SPEED, YAW_RATE],
            # It turns at full rate or not at all: finer than half a step's turn, it would swing.
            "behavior": {"name": "dash", "loop": True, "angle_tolerance": YAW_RATE * STEP_S / 2},
        }
        for goals in (GOALS[i % len(GOALS)] for i in range(users + 1))
    ]
    if sensing == "fov":
        robots[0] |= {"fov": FOV, "fov_radius": RANGE}
    if sensing == "lidar":
        lidar = {"name": "lidar2d", "range_max": RANGE, "angle_range": FOV, "number": BEAMS}
        robots[0]["sensors"] = [lidar]
    width, height = (math.ceil(max(axis)) for axis in zip(*outline, strict=True))
    world: dict[str, Any] = {"width": width, "height": height, "step_time": STEP_S}
    world["collision_mode"] = "unobstructed"  # by default, agents who meet stop for ever
    # One line for all walls: an object for each would be slower.
    walls = {"shape": {"name": "linestring", "vertices": [*outline, outline[0]]}}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "world.yaml"
        document = {"world": world, "robot": robots, "obstacle": [walls]}
        path.write_text(json.dumps(document))  # JSON is YAML
        env = irsim.make(str(path), headless=True, log_level="ERROR")

    def look() -> float:
        return float(sum(map(env.robot_list[0].fov_detect_object, env.robot_list[1:])))

    def advance(steps: int) -> None:
        for _ in range(steps):
            env.step()
            if sensing == "fov":
                look()  # not part of IR-SIM's step: it answers when asked

    sensed = {"fov": look, "lidar": lambda: float(env.get_lidar_scan()["ranges"].sum())}
    return Scene(
        advance=advance,
        positions=lambda: [tuple(map(float, r.state[:2, 0])) for r in env.robot_list],
        sensed=sensed.get(sensing),
    )


def check_it_lives(scene: Scene, steps: int = 300) -> float:
    """Mean metres moved per agent-step: a scene that stands still would only look fast.

    Raises:
        RuntimeError: if agents hardly move, or the sensor always reads the same.
    """
    moved, last, values = 0.0, scene.positions(), set[float]()
    for _ in range(steps):
        scene.advance(1)
        now = scene.positions()
        moved += sum(map(math.dist, last, now)) / len(now) / steps
        values.add(scene.sensed() if scene.sensed else len(values))
        last = now
    if moved < 0.5 * SPEED * STEP_S or len(values) < 2:
        raise RuntimeError(f"stands still: {moved:.3f} m per step, {len(values)} sensor readings")
    return moved


def measure(name: str, plan: Path, users: int, sensing: str, seconds: float) -> PeerResult:
    """Time a case: the median of `REPEATS` runs that take about `seconds` each."""

    def timed(steps: int) -> float:
        start = time.perf_counter()
        scene.advance(steps)
        return time.perf_counter() - start

    outline, start = read_outline(plan), time.perf_counter()
    scene = {"navground": navground_scene, "ir-sim": irsim_scene}[name](outline, users, sensing)
    scene.advance(1)
    setup = time.perf_counter() - start
    moved = check_it_lives(scene)
    steps = 100
    while (elapsed := timed(steps)) < 0.1 * seconds:  # too short to tell the rate
        steps *= 4
    steps = max(1, round(1.1 * seconds / elapsed * steps))
    rates = [steps * (users + 1) / timed(steps) for _ in range(REPEATS)]
    rate, spread = statistics.median(rates), (max(rates) - min(rates)) / statistics.median(rates)
    case, caveats = f"{users} user(s), {sensing}", CASES[name][sensing]
    return PeerResult(name, version(name), case, rate, setup, caveats, spread, moved)


def measure_navground(plan: Path, users: int, sensing: str, seconds: float) -> PeerResult:
    """Measure navground in this process; `sensing` is none, lidar or avoid."""
    return measure("navground", plan, users, sensing, seconds)


def measure_irsim(plan: Path, users: int, sensing: str, seconds: float) -> PeerResult:
    """Measure IR-SIM in this process; `sensing` is none, fov or lidar."""
    return measure("ir-sim", plan, users, sensing, seconds)


def measure_apart(name: str, users: int, sensing: str, options: argparse.Namespace) -> PeerResult:
    """Measure one case in a process of its own, whatever becomes of it."""
    flags = ["--plan", str(options.plan), "--seconds", str(options.seconds)]
    command = [options.python, __file__, *flags, "--child", name, str(users), sensing]
    limit = 60.0 + 3.0 * REPEATS * options.seconds
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit)
        if done.returncode == 0:  # the last line is ours; a peer may print before it
            return PeerResult(**json.loads(done.stdout.strip().splitlines()[-1]))
        reason = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
    except subprocess.TimeoutExpired:
        reason = f"took more than {limit:.0f} s"
    verdict = "not installed" if reason.startswith("ModuleNotFoundError") else "failed"
    return PeerResult(name, "?", f"{users} user(s), {sensing}", failure=f"{verdict}: {reason}")


def print_table(results: list[PeerResult], against: float | None) -> None:
    """Print the figures, then what each peer does more and less."""
    heads = "agent-steps/s  spread  set-up s  m/step" + ("  Fleet2D x" if against else "")
    print(f"{'peer':17}{'case':19} {heads}")
    for r in results:
        row = f"{r.agent_steps_per_s:14,.0f}{r.spread:8.0%}{r.setup_s:10.3f}{r.m_per_step:8.2f}"
        if against and not r.failure:
            row += f"{against / r.agent_steps_per_s:11.2f}"
        print(f"{f'{r.name} {r.version}':17}{r.case:19}{f'  {r.failure}' if r.failure else row}")
    print("\nOnly the robot has fov or lidar, so users dilute its cost. Each peer:")
    for name, cases in CASES.items():
        for sensing, caveats in cases.items():
            print(f"  {name}, {sensing}: {'; '.join(caveats)}")


def main() -> None:
    """Parse the command line, measure every case, print."""
    parser = argparse.ArgumentParser(description="Fleet2D's scene in navground and IR-SIM")
    parser.add_argument("--plan", type=Path, required=True, help="HouseExpo plan 658e5214… (JSON)")
    parser.add_argument("--seconds", type=float, default=3.0, help="per repeat (default 3)")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has the peers")
    parser.add_argument("--against", type=float, help="Fleet2D's agent-steps per second")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--child", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        name, users, what = options.child
        done = measure(name, options.plan, int(users), what, options.seconds)
        print(json.dumps(asdict(done)))  # one line, for `measure_apart`
        return
    todo = [(name, users, what) for name in CASES for what in CASES[name] for users in USERS]
    results = [measure_apart(*case, options) for case in todo]
    machine = f"{os.cpu_count()} cores, 1-minute load {os.getloadavg()[0]:.1f} at the end"
    if options.json:
        print(json.dumps({"machine": machine, "results": [asdict(r) for r in results]}, indent=2))
    else:
        print(f"{machine}; {REPEATS} repeats of {options.seconds:g} s, median\n")
        print_table(results, options.against)


if __name__ == "__main__":
    main()
