"""How fast data sets are made: labelled days of homes for each second of one core.

    python benchmarks/datasets.py                # 64 runs of ten days, and windows into torch
    python benchmarks/datasets.py --runs 4       # to see that it works
    python benchmarks/datasets.py --loop models  # the table of a study, models_in_the_loop.yaml

Times are processor times, so that other programs disturb them less; run it on a machine that does
nothing else all the same. Each figure is the best of several runs in the same home but the first,
which is the time of a home; then comes a whole data set, from its file to the last byte.
"""

import argparse
import resource
import tempfile
import time
from itertools import islice
from pathlib import Path
from typing import Any

import fleet2d
from fleet2d.engine.simulation import Simulation
from fleet2d.learning.datasets.generate import dataset
from fleet2d.learning.datasets.specification import DatasetPlan, PlannedRun, plan_dataset
from fleet2d.learning.datasets.tables import tables_of

DAYS = 10
ROUNDS, RANDOM = "rounds, 10 min a room", "rounds in random order, 10 min a room"
ROBOTS: dict[str, dict[str, Any]] = {
    ROUNDS: {"behaviors": [{"type": "patrol", "dwell": "10 min"}]},
    RANDOM: {"behaviors": [{"type": "patrol", "order": "random", "dwell": "10 min"}]},
    "rounds, 1 min a room": {"behaviors": [{"type": "patrol", "dwell": "1 min"}]},
    "hangout": {
        "behaviors": [
            {"type": "patrol", "dwell": "0 s", "cooldown": "4 h"},
            {"type": "hangout", "source": "ltp", "near": "view", "period": "1 h"},
        ]
    },
}


def source(
    robot: str, runs: int, days: int = DAYS, seen_every: str | None = None, **changes: Any
) -> dict[str, Any]:
    """Return a data set of furnished synthetic homes, each of which has eight runs."""
    algorithms = {} if robot == "hangout" else {"algorithms": {"ltp": None}}
    homes = {"synthetic": -(-runs // 8), "first": 1000, "settings": {"furnish": True}}
    train = {
        "runs": runs,
        "homes": [homes],
        "households": [["works_outside"], ["retired"], ["student", "child"]],
    }
    base = {
        "extends": "bundled:paper",
        "simulation": {"duration": {"days": days}},
        "robots": {"astro": ROBOTS[robot]},
        **algorithms,
        **({"sight": {"seen_every": seen_every}} if seen_every else {}),
    }
    return {"base": base, "splits": {"train": train}, "beliefs": ["routine"], **changes}


def seconds(plan: DatasetPlan, planned: PlannedRun) -> float:
    """Return the processor time of a run, and of its tables [s]."""
    begin = time.process_time()
    tables_of(Simulation(planned.scenario).run(), planned, plan.file.labels)
    return time.process_time() - begin


def runs_alone(robot: str, days: int, repeats: int, **changes: Any) -> None:
    """Print the days a second of runs without the making of homes, and the time of a home."""
    plan = plan_dataset(source(robot, 8, days, **changes))
    planned = [plan.run("train", k) for k in range(3)]
    first = seconds(plan, planned[0])
    best = [min(seconds(plan, run) for _ in range(repeats)) for run in planned]
    words = "".join(f", {name} {value}" for name, value in changes.items())
    print(
        f"{robot}{words}: {days * len(best) / sum(best):.1f} days/s; a home {first - best[0]:.2f} s"
    )


def whole(runs: int, days: int) -> None:
    """Print the days a second of a data set, from its file to the last byte."""

    def used() -> float:
        usages = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        return sum(usage.ru_utime + usage.ru_stime for usage in usages)

    with tempfile.TemporaryDirectory() as folder:
        begin = used()
        made = dataset(source(ROUNDS, runs, days), Path(folder) / "made", workers=1)
        took = used() - begin
        size = sum(file.bytes for file in made.manifest.files.values())
    print(f"whole data set of {runs} runs: {runs * days / took:.1f} days/s of processor time;")
    print(f"  {size / runs / days / 1000:.0f} kB a day")


def fresh(days: int, windows: int) -> None:
    """Print how many days a second come as windows into torch, simulated on the fly."""
    try:
        from fleet2d.learning.datasets.torch_data import fresh_windows
    except ImportError as error:
        print(f"windows into torch: left out, {error}")
        return
    stream = iter(fresh_windows(source(ROUNDS, 8, days), "train"))
    next(stream)
    begin = time.process_time()
    for _ in islice(stream, windows):
        pass
    took = time.process_time() - begin
    a_day = 24 * 60 / 7
    print(f"windows into torch: {windows / a_day / took:.1f} days of a person a second, on the fly")


LOOP = {
    "co_presence.astro.ana": "hangout",
    "reach_time.astro.ana.mean": "hangout",
    "travel.astro.relocations": "hangout",
    "time_to_find.astro.success": "find",
    "time_to_find.astro.mean": "find",
}


def loop(folder: str) -> None:
    """Print the models of a study in the loop: means, and intervals of differences to `routine`."""
    study = fleet2d.open_study(folder)
    print(f"{study.variants['home'].n_unique()} homes; model: {', '.join(LOOP)}")
    for (model,), own in study.variants.group_by("model", maintain_order=True):
        cells = []
        for metric, task in LOOP.items():
            mean = own.filter(task=task)[metric].mean()
            table = study.paired(metric, {"model": "routine"}, ["home"], ["task"])
            ends = table.filter(model=model, task=task).select("low", "high").rows()
            intervals = [f"({low:+.3f} to {high:+.3f})" for low, high in ends]
            cells.append(" ".join(["-" if mean is None else f"{mean:.3f}", *intervals]))
        print(f"{model}: {' | '.join(cells)}")


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=64, help="of the whole data set")
    parser.add_argument("--loop", metavar="DIR", help="print the table of a study, and no more")
    options = parser.parse_args()
    if options.loop:
        loop(options.loop)
        return
    runs = options.runs
    days, repeats = (1, 1) if runs < 8 else (DAYS, 5)
    for robot in ROBOTS:
        runs_alone(robot, days, repeats)
    runs_alone(RANDOM, days, repeats, seen_every="5 s")
    runs_alone(ROUNDS, days, repeats, beliefs=[])
    runs_alone(ROUNDS, days, repeats, beliefs=["routine", "learned"])
    whole(runs, days)
    fresh(days, 1000 if runs < 8 else 20_000)


if __name__ == "__main__":
    main()
