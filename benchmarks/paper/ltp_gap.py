"""Fig. 7 left of the paper: how the long-term presence of each room comes near the truth by days.

    python benchmarks/paper/ltp_gap.py [--robots 100] [--days 30] [--figure gap.png]

One person, one home, many robots: patrols of several kinds and hangouts, each with draws of its
own, while the person lives the same month with each. The gap is that of share of time at home
between the estimate and where the person really was so far, per room; mean over robots, and the
band that holds 80 % of them. Prints how long the months took in all.
"""

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from lives import month, run_all


def robots(count: int) -> list[dict[str, Any]]:
    """Return so many robots: half on patrol, half hanging out, of several kinds."""
    kinds: list[dict[str, Any]] = [
        {"type": "patrol", "order": "random", "dwell": "5 min"},
        {"type": "hangout", "source": "ltp", "near": "room", "explore": 0.2},
        {"type": "patrol", "order": "random", "dwell": "15 min"},
        {"type": "hangout", "source": "ltp", "near": "path", "explore": 0.1},
        {"type": "patrol", "dwell": "30 min"},
        {"type": "hangout", "source": "ltp", "near": "path", "explore": 0.3, "period": "1 h"},
    ]
    return [kinds[i % len(kinds)] for i in range(count)]


def gaps(content: Mapping[str, Any]) -> dict[str, list[float]]:
    """Run a month; return the gap of each room after each day."""
    import fleet2d

    table = fleet2d.run(content).tables["gap"].to_pandas()
    mine = table[table["user"] == "ana"]
    return {str(room): rows["gap"].tolist() for room, rows in mine.groupby("room", observed=True)}


def main() -> None:
    """Run all, print the table, draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument("--days", type=int, default=30)
    parser.add_argument("--estimator", default="likelihood")
    parser.add_argument("--figure", type=Path, help="picture to write")
    arguments = parser.parse_args()
    contents = [
        month(
            robot,
            algorithms={"ltp": {"type": "long_term_presence", "estimator": arguments.estimator}},
            metrics={"gap": {"type": "ltp_gap", "of": "ltp", "period": "1 d"}},
            days=arguments.days,
            name=f"robot_{i}",
        )
        for i, robot in enumerate(robots(arguments.robots))
    ]
    began = time.perf_counter()
    found = run_all(gaps, contents)
    took = time.perf_counter() - began
    by_room = {room: np.array([one[room] for one in found]) for room in found[0]}
    days = [d for d in (1, 3, 7, 14, 21, 30, 60) if d <= arguments.days]
    print(f"{len(found)} robots, {arguments.days} days, {arguments.estimator}: mean gap of share")
    print(f"{'room':<20}" + "".join(f"{f'day {d}':>9}" for d in days))
    for room, values in by_room.items():
        print(f"{room:<20}" + "".join(f"{values[:, d - 1].mean():>9.3f}" for d in days))
    every = np.mean(list(by_room.values()), axis=0)
    print(f"{'all rooms':<20}" + "".join(f"{every[:, d - 1].mean():>9.3f}" for d in days))
    print(f"{len(found)} months in {took:.1f} s, on all cores")
    if arguments.figure:
        draw(by_room, arguments.figure)


def draw(by_room: Mapping[str, Any], path: Path) -> None:
    """Draw the mean gap of each room over days, and the band of all rooms' mean."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    for room, values in by_room.items():
        if values[:, -1].mean() > 0.002 or values[:, 0].mean() > 0.02:
            axes.plot(range(1, values.shape[1] + 1), values.mean(axis=0), lw=1, label=room)
    every = np.mean(list(by_room.values()), axis=0)
    low, high = np.quantile(every, [0.1, 0.9], axis=0)
    axes.fill_between(range(1, len(low) + 1), low, high, alpha=0.25, color="black", lw=0)
    axes.plot(range(1, len(low) + 1), every.mean(axis=0), lw=2, color="black", label="all rooms")
    axes.set_xlabel("day")
    axes.set_ylabel("gap of share of time at home")
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
