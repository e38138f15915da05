"""How near a robot comes to people when it drives: as a ghost, by yielding, and with `gives_way`.

    python benchmarks/gives_way.py [--days 7] [--seeds 1]

Two people in the furnished bundled home, and a robot on patrol with a stop a minute. It counts the
times at which the robot, as it drives, gets nearer to a person than 0.75 m from centre to centre,
and than 0.35 m, where the bodies touch; those in which the person came nearer in that second, too,
stand behind.
"""

import argparse
from datetime import timedelta

import numpy as np

import fleet2d
from fleet2d.runs.run import Run

NEAR_M = (0.75, 0.35)
SCENARIO = {
    "extends": "bundled:paper",
    "floorplan": {"furnish": True},
    "users": {
        "ana": {"type": "routine", "persona": "works_from_home"},
        "ben": {"type": "routine", "persona": "retired"},
    },
    "robots": {"astro": {"behaviors": [{"type": "patrol", "dwell": "1 min"}]}},
    "algorithms": {"ltp": None},
    "metrics": {"ltp_error": None},
}
ROBOTS = {
    "ghost": "simulation.ghosts=true",
    "yields": "simulation.ghosts=false",
    "gives_way": "robots.astro.gives_way={}",
}


def main() -> None:
    """Print a line for each seed and setting."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--days", type=int, default=7)
    parser.add_argument("--seeds", type=int, default=1, help="from 4 on")
    options = parser.parse_args()
    print("seed  robot       nearer than 0.75 m   nearer than 0.35 m")
    duration = f"simulation.duration={options.days} d"
    for seed in range(4, 4 + options.seeds):
        for name, change in ROBOTS.items():
            run = fleet2d.run(SCENARIO, duration, change, seed=seed)
            cells = [approaches(run, near_m) for near_m in NEAR_M]
            text = "   ".join(f"{count:8} ({met} met)" for count, met in cells)
            print(f"{seed:4}  {name:9} {text}")


def approaches(run: Run, near_m: float) -> tuple[int, int]:
    """Return how often the robot drives nearer, and how often the person also came nearer then."""
    second = timedelta(seconds=1)
    robot, count, met = run.path("astro", every=second), 0, 0
    drives = np.hypot(np.diff(robot.x), np.diff(robot.y)) > 0
    for name in ("ana", "ben"):
        person = run.path(name, every=second)
        apart = np.hypot(person.x - robot.x, person.y - robot.y)
        without = np.hypot(person.x[:-1] - robot.x[1:], person.y[:-1] - robot.y[1:])
        at_home = ~(person.away[1:] | person.away[:-1])
        enters = at_home & drives & (apart[1:] < near_m) & (apart[:-1] >= near_m)
        count += int(enters.sum())
        met += int((enters & (without > apart[1:])).sum())
    return count, met


if __name__ == "__main__":
    main()
