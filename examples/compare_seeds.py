"""Paired comparison: the same home and the same people, once with one robot, once with two.

Every component has its own random streams, so adding a robot doesn't change what Ana does at any
step. All differences between the two runs of a seed are then due to the robot.

    python examples/compare_seeds.py [SEEDS]
"""

import sys
from datetime import timedelta

import numpy as np

import fleet2d

WEEK = "simulation.duration.days=7"
SECOND = {"bolt": {"type": "patrol", "order": "random", "dwell": "2 min", "start": "kitchen"}}


def main() -> None:
    """Compare the share of her time at home in which Ana is seen, over some seeds."""
    gains, seeds = [], int(sys.argv[1]) if len(sys.argv) > 1 else 5
    for seed in range(seeds):
        one = fleet2d.run(WEEK, seed=seed)
        two = fleet2d.run(WEEK, seed=seed, robots=SECOND)  # merged: astro stays
        life, again = (run.path("ana", every=timedelta(minutes=1)) for run in (one, two))
        assert np.array_equal(life.x, again.x)
        assert np.array_equal(life.y, again.y)
        before, after = one.metrics["sightings"]["ana"], two.metrics["sightings"]["ana"]
        gains.append(after - before)
        print(f"seed {seed}: seen {before:.2%} by one robot, {after:.2%} by two")
    spread = np.std(gains, ddof=1) / np.sqrt(len(gains))
    print(f"a second robot adds {np.mean(gains):.2%} ± {spread:.2%} (mean and standard error)")


if __name__ == "__main__":
    main()
