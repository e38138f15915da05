"""How far what estimators of presence say depends on where the patches of rooms end.

    python benchmarks/patches.py --seeds 10 --days 14

The same runs with patches of other sizes (`fleet2d.algorithms.evidence.SIDE_M`), a robot on rounds
of ten minutes a room in the bundled home: by how much the share of a room differs from that with
patches of 1 m.
"""

import argparse
import multiprocessing
from typing import Any

import fleet2d
from fleet2d.algorithms import evidence

SIDES = (0.7, 0.85, 1.2, 1.5)
ROUNDS = {"type": "patrol", "order": "random", "dwell": "10 min"}
Shares = dict[str, dict[str, float]]
ESTIMATORS = ("exposure_ratio", "likelihood")


def all_shares(seeds: int, days: int, side: float) -> list[Shares]:
    """Return the shares for each seed, of patches so long; runs of a process share theirs."""
    evidence.SIDE_M = side
    return [shares(seed, days) for seed in range(seeds)]


def shares(seed: int, days: int) -> Shares:
    """Return what each estimator says of Ana's rooms in the end."""
    metrics = {name: {"type": "ltp_gap", "of": name} for name in ESTIMATORS}
    algorithms: dict[str, Any] = {
        name: {"type": "long_term_presence", "estimator": name, "period": "1 d"}
        for name in ESTIMATORS
    }
    content = {
        "extends": "bundled:paper",
        "simulation": {"duration": {"days": days}, "seed": seed},
        "robots": {"astro": {"behaviors": [ROUNDS]}},
        "algorithms": {"ltp": None, **algorithms},
        "metrics": {"ltp_error": None, "room_share": None, **metrics},
        "artifacts": {"trajectories": "off", "observations": False, "events": False},
    }
    run = fleet2d.run(content)
    found = {}
    for name in ESTIMATORS:
        rows = run.pandas(name)
        last = rows[(rows["step"] == rows["step"].max()) & (rows["user"] == "ana")]
        found[name] = dict(zip(last["room"], last["share"], strict=True))
    return found


def main() -> None:
    """Print the differences."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--days", type=int, default=14)
    options = parser.parse_args()
    jobs = [(options.seeds, options.days, side) for side in (1.0, *SIDES)]
    with multiprocessing.get_context("spawn").Pool(2, maxtasksperchild=1) as pool:
        usual, *others = pool.starmap(all_shares, jobs, chunksize=1)
    print(
        f"{options.seeds} seeds, {options.days} days: points of a room's share, from those of 1 m"
    )
    for side, found in zip(SIDES, others, strict=True):
        for name in ESTIMATORS:
            gaps = [
                [abs(other[name][room] - before[name][room]) for room in other[name]]
                for before, other in zip(usual, found, strict=True)
            ]
            mean = sum(map(sum, gaps)) / sum(map(len, gaps))
            worst = [max(of_seed) for of_seed in gaps]
            print(
                f"{side:4.2f} m  {name:15} mean {100 * mean:.2f}, the worst room"
                f" {100 * sum(worst) / len(worst):.1f}, at most {100 * max(worst):.1f}"
            )


if __name__ == "__main__":
    main()
