"""Make the table of a task: everybody lives the same lives in homes that no training had.

    pip install "fleet2d[gym,onnx]" sb3-contrib onnxscript
    python examples/agents/table.py hangout-v1

Trained are `--seeds` policies by `train.py`, in `--models`, unless their files are there already.
Printed are means a day over the homes of the split `test` (seeds 1000 to 1029 of the synthetic
homes; training has 0 to 59, and the policy that is kept is chosen in 500 to 509), and the
difference to the first row with its 95 % interval, paired by life.
"""

import argparse
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import bounds
import numpy as np

from fleet2d import Simulation
from fleet2d.entities.robots.ask_policy import ASK_COLUMNS
from fleet2d.entities.robots.policy import COLUMNS
from fleet2d.learning.gym import RobotEnv, load_task
from fleet2d.learning.gym.task import METRIC, Variants

FIRST_HOME = {"validation": 500, "test": 1000}
VALIDATION_HOMES = 10
ROOMS_TO_LEAVE = ["bedroom", "bathroom"]
LTP = {"ltp": {"type": "long_term_presence", "estimator": "likelihood"}}
Choice = Callable[[Any, Any, RobotEnv], int]
Behaviors = list[dict[str, Any]]
AT = {name: number for number, name in enumerate(COLUMNS)}
ASK_AT = {name: number for number, name in enumerate(ASK_COLUMNS)}

# Bundled behaviors


def with_ltp(**behavior: Any) -> dict[str, Any]:
    """Return a behavior that reads long-term presence."""
    return {"source": "ltp", **behavior}


EAGER = {"near": "view", "hysteresis": 0.02, "moving": 0.01, "explore": 0.02}
FIND = {"type": "find", "every": "2 h", "deadline": "10 min", "out_at": 1.0}
WAITS = with_ltp(type="hangout", near="view", no_stops_in=ROOMS_TO_LEAVE)


def asking(policy: Any = None, **behavior: Any) -> tuple[Behaviors, dict[str, Any]]:
    """Return a robot that asks by a policy of `timing`, and its algorithms."""
    asks = with_ltp(type="interact", **behavior)
    if policy is None:
        return [asks, WAITS], {}
    return [{**asks, "timing": "when"}, WAITS], {"when": {"type": "timing", "policy": policy}}


HOURS = [9, 10, 11, 17, 18, 19, 20]
BUNDLED: dict[str, dict[str, tuple[Behaviors, dict[str, Any]]]] = {
    "hangout": {
        "`hangout`": ([{"type": "hangout"}], {}),
        "`hangout` by `ltp`, eager, out of bedrooms": (
            [with_ltp(type="hangout", **EAGER, no_stops_in=ROOMS_TO_LEAVE)],
            {},
        ),
    },
    "find": {
        "`find`": ([FIND], {}),
        "`find` by `ltp`": ([with_ltp(**FIND)], {}),
        "`find` by `ltp`, by day, from outside": (
            [with_ltp(**FIND, no_stops_in=ROOMS_TO_LEAVE, when="08:00-22:30")],
            {},
        ),
    },
    "patrol": {
        "`patrol`": ([{"type": "dock"}, {"type": "patrol"}], {}),
        "`patrol`, every two hours by day": (
            [{"type": "dock"}, {"type": "patrol", "when": "08:00-22:30", "cooldown": "2 h"}],
            {},
        ),
    },
    "interact": {
        "as soon as it is due": asking(),
        "when seen": asking(seek=False),
        "fixed times": asking({"type": "fixed_times", "hours": HOURS}),
        "thompson": asking("thompson"),
        "two stages": asking("two_stage"),
    },
}

# Policies that choose as what is learned does


def best_room(scores: Any, mask: Any) -> int:
    """Return the possible room with the highest score; the last action if none has one above 0."""
    return int(np.argmax(np.where(mask, np.append(scores, 1e-6), -np.inf)))


def hour_of(observation: Any) -> float:
    """Return the hour of the day, 0 to 24."""
    angle = np.arctan2(observation[0, AT["hour_sin"]], observation[0, AT["hour_cos"]])
    return float(angle / (2 * np.pi) * 24 % 24)


def public(observation: Any) -> Any:
    """Return which rooms are neither bedrooms nor bathrooms."""
    private = observation[:, AT["is_bedroom"]] + observation[:, AT["is_bathroom"]]
    return observation[:, AT["room"]] * (1 - private)


def clock(observation: Any, mask: Any, _: RobotEnv) -> int:
    """Wait in the largest bedroom from 22:30 to 8:00, else in the largest living room."""
    is_night = not 8 <= hour_of(observation) < 22.5
    kind = AT["is_bedroom" if is_night else "is_living"]
    return best_room(observation[:, kind] * (1 + observation[:, AT["area"]]), mask)


def living_room(observation: Any, mask: Any, _: RobotEnv) -> int:
    """Wait in the largest living room, day and night."""
    return best_room(observation[:, AT["is_living"]] * (1 + observation[:, AT["area"]]), mask)


def last_seen(observation: Any, mask: Any, _: RobotEnv) -> int:
    """Go to the room, no bedroom or bathroom, in which somebody was seen last."""
    return best_room(observation[:, AT["seen_6h"]] * public(observation), mask)


def hours(observation: Any, mask: Any, _: RobotEnv) -> int:
    """Go to the room, no bedroom or bathroom, in which most was seen in this hour of the day.

    Without any sightings in this hour it is the one with most of all; without those, the largest.
    """
    scores = observation[:, AT["habit_now"]] + 1e-2 * observation[:, AT["habit"]]
    return best_room((scores + 1e-4 * observation[:, AT["area"]]) * public(observation), mask)


def hours_by_day(observation: Any, mask: Any, env: RobotEnv) -> int:
    """Do as `hours` from 8:00 to 22:30, and give up at night."""
    by_day = 8 <= hour_of(observation) < 22.5
    return hours(observation, mask, env) if by_day else len(mask) - 1


def round_by_day(observation: Any, mask: Any, _: RobotEnv) -> int:
    """Go to the room, from 8:00 to 22:30, that was visited least lately; charge at half."""
    rests = observation[0, AT["charge"]] < 0.5 or not 8 <= hour_of(observation) < 22.5
    if rests:
        return len(mask) - 1
    return best_room((1.1 - observation[:, AT["visited_6h"]]) * observation[:, AT["room"]], mask)


def in_true_room(_: Any, mask: Any, env: RobotEnv) -> int:
    """Go to the room in which the person is, knowing it; give up a search that is worth nothing."""
    simulation = env.present.simulation
    for name in simulation.scenario.users:
        place = simulation.state[name]["room"]
        room = None if place is None else simulation.home.plan.room(place)
        if room is not None and room.type not in bounds.PRIVATE_ROOMS and mask[room.index]:
            return int(room.index)
    return len(mask) - 1


def by_day(observation: Any, mask: Any, _: RobotEnv) -> int:
    """Ask for the most valuable from 9 to 21 o'clock, once an hour for each person."""
    is_day = 9 <= hour_of_asking(observation) < 21
    rested = 1 - observation[:, ASK_AT["asked_1h"]] if is_day else np.zeros(len(observation))
    return best_room((rested >= 0.5) * observation[:, ASK_AT["worth"]], mask)


def careful(observation: Any, mask: Any, _: RobotEnv) -> int:
    """Ask for what is worth more than it costs, by the answers so far at this hour.

    As the policy `two_stage`, without exploration beyond its imagined answers.
    """
    worth = observation[:, ASK_AT["worth"]]
    value = 2 * worth / np.maximum(1 - worth, 1e-9)
    gain = observation[:, ASK_AT["yes_now"]] * value - (1 - observation[:, ASK_AT["time_now"]])
    is_rested = observation[:, ASK_AT["asked_1h"]] < 0.5
    by_day = 8 <= hour_of_asking(observation) < 22
    return best_room((gain - 0.7) * is_rested * by_day, mask)


def hour_of_asking(observation: Any) -> float:
    """Return the hour of the day of an observation of interactions."""
    angle = np.arctan2(observation[0, ASK_AT["hour_sin"]], observation[0, ASK_AT["hour_cos"]])
    return float(angle / (2 * np.pi) * 24 % 24)


CHOICES: dict[str, dict[str, Choice]] = {
    "hangout": {
        "`clock`": clock,
        "living room": living_room,
        "last seen": last_seen,
        "`hours`": hours,
    },
    "find": {"last seen": last_seen, "`hours`": hours_by_day, "knows the room": in_true_room},
    "patrol": {"round by day": round_by_day},
    "interact": {"by day": by_day, "careful": careful},
}


def learned(path: Path) -> Choice:
    """Return the policy of an ONNX file."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(path, options)

    def choose(observation: Any, mask: Any, _: RobotEnv) -> int:
        scores = session.run(None, {"observation": observation[None]})[0][0]
        return int(np.argmax(np.where(mask, scores, -np.inf)))

    return choose


# Lives


def life_of(task: str, split: str, home: int) -> dict[str, Any]:
    """Return the options of a reset for a home of a split: what varies, and the seed."""
    random = np.random.default_rng([FIRST_HOME[split], home])
    values = load_task(task).draw(random, "test")
    values["floorplan.seed"] = FIRST_HOME[split] + home
    return {"values": values, "seed": int(random.integers(2**53))}


def bundled(task: str, robot: tuple[Behaviors, dict[str, Any]], life: dict[str, Any]) -> Any:
    """Return the terms of a life of a robot with bundled behaviors."""
    behaviors, algorithms = robot
    content = Variants(load_task(task)).load(life["values"]).scenario.resolved()
    content["simulation"]["seed"] = life["seed"]
    content["robots"]["astro"]["behaviors"] = behaviors
    content["algorithms"] = algorithms | (LTP if "ltp" in str(behaviors) else {})
    simulation = Simulation(content)
    simulation.run_until(simulation.clock.steps)
    return simulation.finish().metrics[METRIC]["astro"]


def lived(task: str, choose: Choice, life: dict[str, Any]) -> Any:
    """Return the terms of a life of a robot whose policy chooses."""
    env = RobotEnv(task, split="test")
    observation, info = env.reset(options=life)
    is_over = False
    while not is_over:
        action = choose(observation, info["action_mask"], env)
        observation, _, terminated, truncated, info = env.step(action)
        is_over = terminated or truncated
    return env.present.terms("astro")


def reward_of(weights: Mapping[str, float], terms: Mapping[str, float]) -> float:
    """Return the reward of a life by its terms."""
    return sum(weight * terms[name] for name, weight in weights.items())


def known_life(task: str, life: dict[str, Any]) -> dict[str, float | Choice]:
    """Return the bound of the reward of a life and, of hangout, the best plan that knows it."""
    weights = load_task(task).reward
    env = RobotEnv(task, split="test")
    env.reset(options=life)
    stations = bounds.stations_of(env) if task == "hangout" else None
    scenario = env.present.simulation.scenario
    run = bounds.rested_life(env, **life)
    people = [bounds.person_of(run, name) for name in scenario.users]
    if stations is not None:
        plan = bounds.hangout_plan(people, stations, weights)
        return {"bound": bounds.hangout_bound(people, stations, weights), "knows the life": plan}
    if task == "interact":
        return {"bound": bounds.interact_bound(run, scenario.interactions, weights)}
    if task == "find":
        return {"bound": bounds.find_bound(people, weights, 7200, 600)}
    return {"bound": bounds.patrol_bound(len(run.plan.rooms), run.clock.steps, weights)}


def live_in(home: int, task: str, files: list[Path], split: str, others: bool) -> dict[str, Any]:
    """Let everybody live in a home; return the reward of each and its terms, a day."""
    life = life_of(task, split, home)
    weights = load_task(task).reward
    lives: dict[str, Any] = {}
    known: dict[str, Any] = {}
    if others:
        known = known_life(task, life)
        lives |= {name: bundled(task, robot, life) for name, robot in BUNDLED[task].items()}
    choices = {**(CHOICES[task] if others else {}), **{str(path): learned(path) for path in files}}
    if "knows the life" in known:
        choices["knows the life"] = known["knows the life"]
    lives |= {name: lived(task, choose, life) for name, choose in choices.items()}
    rows = {name: [reward_of(weights, terms), *terms.values()] for name, terms in lives.items()}
    if known:
        rows["bound"] = [known["bound"], *(np.nan for _ in bounds.TERMS)]
    days = Variants(load_task(task)).load(life["values"]).scenario.simulation.duration / bounds.DAY
    return {name: np.array(row) / days for name, row in rows.items()}


def means(
    task: str, files: list[Path], split: str, homes: int, workers: int, *, others: bool = True
) -> dict[str, Any]:
    """Return the rows of everybody: rewards and terms a day, float64 (homes, 1 + terms)."""
    live = partial(live_in, task=task, files=files, split=split, others=others)
    if workers > 1:
        with ProcessPoolExecutor(workers) as pool:
            lives = list(pool.map(live, range(homes)))
    else:
        lives = [live(home) for home in range(homes)]
    return {name: np.stack([life[name] for life in lives]) for name in lives[0]}


def print_table(task: str, rows: Mapping[str, Any]) -> None:
    """Print a row for each robot."""
    shown = list(load_task(task).reward)
    columns = [1 + list(bounds.TERMS).index(name) for name in shown]
    first = next(iter(rows.values()))
    print(f"| robot | reward | {' | '.join(f'`{name}`' for name in shown)} | difference |")
    print(f"| --- |{' ---: |' * (len(shown) + 2)}")
    for name, values in rows.items():
        gains = values[:, 0] - first[:, 0]
        half = 1.96 * gains.std(ddof=1) / np.sqrt(len(gains)) if len(gains) > 1 else np.inf
        cells = [f"{values[:, 0].mean():.1f}"]
        cells += ["" if name == "bound" else f"{values[:, c].mean():.1f}" for c in columns]
        cells.append("" if values is first else f"{gains.mean():+.1f} ± {half:.1f}")
        print(f"| {name} | {' | '.join(cells)} |")


def main() -> None:
    """Train, choose by validation, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", choices=[f"{task}-v1" for task in BUNDLED])
    parser.add_argument("--decisions", type=int, default=300_000, help="of the training of each")
    parser.add_argument("--seeds", type=int, default=3, help="number of policies that are trained")
    parser.add_argument("--homes", type=int, default=30)
    parser.add_argument("--workers", type=int, default=1, help="processes that live")
    parser.add_argument("--models", type=Path, default=Path("models"), help="folder of the files")
    arguments = parser.parse_args()
    task = arguments.task.removesuffix("-v1")
    arguments.models.mkdir(exist_ok=True)
    files = [
        arguments.models / f"{task}-{arguments.decisions}-{seed}.onnx"
        for seed in range(arguments.seeds)
    ]
    for seed, path in enumerate(files):
        if not path.exists():
            import train  # which needs PyTorch

            train.export(train.train(task, arguments.decisions, seed, verbose=0), path)
    best = None
    if len(files) > 1:
        validated = means(
            task, files, "validation", VALIDATION_HOMES, arguments.workers, others=False
        )
        best = max(files, key=lambda path: validated[str(path)][:, 0].mean())
    rows = means(task, files, "test", arguments.homes, arguments.workers)
    trained = [rows.pop(str(path)) for path in files]
    if trained:
        rows[f"PPO, mean of {len(files)} seeds" if best else "PPO"] = np.mean(trained, axis=0)
        print("PPO by seed:", ", ".join(f"{each[:, 0].mean():.1f}" for each in trained))
    if best is not None:
        rows["PPO, chosen by validation"] = trained[files.index(best)]
    for name in ("knows the life", "bound"):
        if name in rows:
            rows[name] = rows.pop(name)
    print_table(task, rows)


if __name__ == "__main__":
    main()
