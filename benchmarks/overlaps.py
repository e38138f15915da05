"""How often bodies of a household are in each other's place: on one seat, or walking.

    python benchmarks/overlaps.py [SCENARIO] [KEY.PATH=VALUE]... [--seeds N]

A week of `examples/family.yaml` (or of another scenario), without and with `people_block: 3 s`. It
compares all bodies at each second: two share a place if both rest, nearer than 5 cm; they overlap
if their distance is less than both radii and at least one of them moves.
"""

import argparse
import itertools
import time
from datetime import timedelta
from pathlib import Path

import numpy as np

import fleet2d
from fleet2d.engine.simulation import Simulation
from fleet2d.runs.run import Run

FAMILY = Path(__file__).parents[1] / "examples" / "family.yaml"
SAME_M = 0.05


def main() -> None:
    """Print a line for each seed and setting."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenario", nargs="?", default=str(FAMILY))
    parser.add_argument("overrides", nargs="*", help="keys of it that are changed")
    parser.add_argument("--seeds", type=int, default=1, help="from 4 on")
    options = parser.parse_args()
    print("seed  people_block  on one place [s]  overlaps [s]  gives_way  processor [s]")
    for seed, block in itertools.product(range(4, 4 + options.seeds), ("null", "3 s")):
        begin = time.process_time()
        changes = [*options.overrides, f"simulation.people_block={block}"]
        run = fleet2d.run(options.scenario, *changes, seed=seed)
        seconds = time.process_time() - begin
        shared, overlaps = seconds_in_contact(run)
        gives_way = int((run.pandas("events")["event"] == "gives_way").sum())
        print(f"{seed:4}  {block:>12}  {shared:16}  {overlaps:12}  {gives_way:9}  {seconds:13.2f}")


def seconds_in_contact(run: Run) -> tuple[int, int]:
    """Return the seconds that two bodies share a place, and that they overlap as one walks."""
    actors = Simulation(run.manifest["scenario"]).actors
    radius = {name: actor.entity.radius for name, actor in actors.items()}
    poses = {name: run.path(name, every=timedelta(seconds=1)) for name in radius}
    shared = overlaps = 0
    for one, other in itertools.combinations(poses, 2):
        a, b = poses[one], poses[other]
        at_home = ~a.away & ~b.away
        apart = np.hypot(a.x - b.x, a.y - b.y)
        rests = np.ones(len(a.x), bool)
        for path in (a, b):
            rests[1:] &= (np.diff(path.x) == 0) & (np.diff(path.y) == 0)
        shared += int((at_home & rests & (apart < SAME_M)).sum())
        overlaps += int((at_home & ~rests & (apart < radius[one] + radius[other])).sum())
    return shared, overlaps


if __name__ == "__main__":
    main()
