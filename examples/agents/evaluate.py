"""Compare policies with the bundled behaviors, in homes and with people that they have never seen.

    pip install "fleet2d[gym,onnx]"
    python examples/agents/evaluate.py hangout [hangout.onnx] [--homes 30] [--search]

Each life is lived by everyone: the same home, person and days, so differences are paired. Printed
are means a day, and the difference to the first behavior with its 95 % interval. `--search` adds
robots that know more: one that tries every action in a branch of its life; for `find` one that
looks into rooms in the order that is optimal by its belief, and one that knows the right room.
"""

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np

from fleet2d import Simulation
from fleet2d.entities.robots.policy import COLUMNS
from fleet2d.learning.gym import RobotEnv, load_task, perceived_s
from fleet2d.learning.gym.task import Variants

LTP = {"ltp": {"type": "long_term_presence", "estimator": "likelihood"}}
BUNDLED: dict[str, dict[str, Any]] = {
    "hangout": {
        "hangout": {"type": "hangout"},
        "hangout, ltp": {"type": "hangout", "source": "ltp"},
        "hangout, ltp, view": {"type": "hangout", "source": "ltp", "near": "view"},
        "hangout, ltp, eager": {
            "type": "hangout",
            "source": "ltp",
            "near": "view",
            "hysteresis": 0.02,
            "moving": 0.01,
            "explore": 0.02,
        },
    },
    "find": {
        "find": {"type": "find", "every": "2 h", "deadline": "10 min", "out_at": 1.0},
        "find, ltp": {
            "type": "find",
            "every": "2 h",
            "deadline": "10 min",
            "out_at": 1.0,
            "source": "ltp",
        },
    },
}
BOUNDS = {
    "find": {"find, ltp, exact": BUNDLED["find"]["find, ltp"] | {"policy": "exact"}},
}
DAYS = 7
Choice = Callable[[Any, Any, RobotEnv], int]


def bundled(task: str, behavior: dict[str, Any], values: dict[str, Any], seed: int) -> list[float]:
    """Return what a bundled behavior makes of a life: see `terms`."""
    content = Variants(load_task(task)).load(values).scenario.resolved()
    content["simulation"]["seed"] = seed
    content["robots"]["astro"]["behaviors"] = [behavior]
    content["algorithms"] = LTP if "source" in behavior else {}
    simulation = Simulation(content)
    simulation.run_until(simulation.clock.steps)
    seen_s, events = perceived_s(simulation, "astro"), simulation.finish().arrow("events")
    return terms(task, seen_s, events.to_pylist())


def lived(task: str, choose: Choice, **settings: Any) -> list[float]:
    """Return what a policy makes of a life."""
    env = RobotEnv(task)
    observation, info = env.reset(options=settings)
    is_over = False
    while not is_over:
        action = choose(observation, info["action_mask"], env)
        observation, _, terminated, truncated, info = env.step(action)
        is_over = terminated or truncated
    seen_s = perceived_s(env.present.simulation, "astro")
    return terms(task, seen_s, env.run().arrow("events").to_pylist())


def terms(task: str, seen_s: float, events: list[dict[str, Any]]) -> list[float]:
    """Return the reward, and what it is made of, a day."""
    mine = [row for row in events if row["entity"] == "astro"]
    count = {name: sum(row["event"] == name for row in mine) for name in ("relocates", "explores")}
    if task == "hangout":
        moves = count["relocates"] + 2 * count["explores"]  # there, and back
        return [(seen_s / 60 - 2 * moves) / DAYS, seen_s / 60 / DAYS, moves / DAYS]
    begun, found, searching_s = None, 0, 0.0
    for row in mine:
        if row["event"] == "find_begins":
            begun = row["time"]
        elif begun is not None and row["event"] in ("found", "gave_up", "not_at_home"):
            searching_s += (row["time"] - begun).total_seconds()
            found, begun = found + (row["event"] == "found"), None
    return [(2 * found - searching_s / 60) / DAYS, found / DAYS, searching_s / 60 / DAYS]


def look_ahead(_: Any, mask: Any, env: RobotEnv) -> int:
    """Choose the best action of the next interval, by trying all: it knows the future."""
    futures = {int(action): env.branch().step(action)[1] for action in np.flatnonzero(mask)}
    return max(futures, key=lambda action: futures[action])


def in_true_room(_: Any, mask: Any, env: RobotEnv) -> int:
    """Choose the room in which the person is, to which no robot has access; else rest."""
    simulation = env.present.simulation
    people = (simulation.state[name] for name in simulation.scenario.users)
    rooms = [simulation.home.plan.room(p["room"]).index for p in people if p["room"] is not None]
    return next((room for room in rooms if mask[room]), len(mask) - 1)


def last_seen(observation: Any, mask: Any, _: RobotEnv) -> int:
    """Choose the room in which somebody was seen last, with the same actions as what is learned."""
    scores = np.append(observation[:, COLUMNS.index("seen_6h")], 0.0)
    return int(np.argmax(np.where(mask, scores, -np.inf)))


def learned(path: str) -> Choice:
    """Return the policy of an ONNX file."""
    import onnxruntime

    session = onnxruntime.InferenceSession(path)

    def choose(observation: Any, mask: Any, _: RobotEnv) -> int:
        scores = session.run(None, {"observation": observation[None]})[0][0]
        return int(np.argmax(np.where(mask, scores, -np.inf)))

    return choose


def main() -> None:
    """Let everyone live in every home; print a row for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", choices=list(BUNDLED))
    parser.add_argument("file", nargs="?", help="the learned policy; none: the others only")
    parser.add_argument("--homes", type=int, default=30)
    parser.add_argument("--search", action="store_true", help="also robots that know more: slow")
    arguments = parser.parse_args()
    task, homes = arguments.task, arguments.homes
    behaviors = BUNDLED[task] | (BOUNDS.get(task, {}) if arguments.search else {})
    policies: dict[str, Choice] = {"last seen": last_seen}
    if arguments.file:
        policies["learned"] = learned(arguments.file)
    if arguments.search:
        policies |= (
            {"knows the room": in_true_room} if task == "find" else {"looks ahead": look_ahead}
        )
    random, rows = np.random.default_rng(0), dict[str, list[list[float]]]()
    for home in range(homes):
        values = load_task(task).draw(random, "test") | {"floorplan.seed": 1000 + home}
        seed = int(random.integers(2**53))
        for name, behavior in behaviors.items():
            rows.setdefault(name, []).append(bundled(task, behavior, values, seed))
        for name, choose in policies.items():
            rows.setdefault(name, []).append(lived(task, choose, values=values, seed=seed))
    first = np.array(next(iter(rows.values())))
    for name, values_of in rows.items():
        results = np.array(values_of)
        gains = results[:, 0] - first[:, 0]
        half = 1.96 * gains.std(ddof=1) / np.sqrt(homes) if homes > 1 else np.inf
        means = ", ".join(f"{mean:.1f}" for mean in results.mean(axis=0))
        print(f"{name:<20} {means}   difference {gains.mean():+.1f} ± {half:.1f}")


if __name__ == "__main__":
    main()
