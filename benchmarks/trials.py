"""What a trial costs: an evening of four hours with two people and one robot, per seed, once warm.

python benchmarks/trials.py [SEEDS]
"""

import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

from fleet2d.expectations import always, distance, eventually, seen
from fleet2d.interventions import Call, Put, Send, ShutDoor
from fleet2d.testing.claim import Claim, Variant
from fleet2d.testing.trials import run_trial

EVENING = {
    "simulation": {"start": "2026-01-05T17:00", "duration": "4 h", "seed": 0},
    "floorplan": {"type": "bundled", "furnish": True},
    "users": {
        "ana": {"type": "routine", "persona": "works_outside"},
        "ben": {"type": "routine", "persona": "retired"},
    },
    "robots": {
        "astro": {
            "camera": {"range": [0.3, 4.5], "angle_deg": 108},
            "behaviors": [
                {"type": "find", "user": "ana"},
                {"type": "patrol", "cooldown": "30 min"},
            ],
        }
    },
    "objects": {"bath_door": {"type": "door", "doorway": "bathroom_2", "open": True}},
}


def bare(trial: Any) -> None:
    """An evening, and nothing expected of it."""
    trial.advance(trial.clock.steps)


def expecting(trial: Any) -> None:
    """The evening of the docs."""
    trial.run_until("19:00")
    trial.do(Put("ana", "kitchen"))
    trial.do(Send("ana", "sofa"))
    trial.do(ShutDoor("bath_door"))
    trial.do(Call("astro", find="ana"))
    trial.expect(eventually(seen("ana", by="astro"), within="4 min"))
    trial.expect(always(distance("astro", "ana") > 0.3), name="keeps off")


def times(body: Callable[[Any], None], seeds: int) -> list[float]:
    """Return how long a trial takes with each seed [ms]."""
    variant: Variant = Claim(EVENING).variants[0]
    spent = []
    for seed in range(seeds):
        began = time.process_time()
        run_trial(variant.with_seed(seed), body)
        spent.append(1e3 * (time.process_time() - began))
    return spent


def main() -> None:
    """Print the time of the processor per seed, by median."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    for name, body in (("evening", bare), ("with expectations", expecting)):
        first, *rest = times(body, seeds)
        print(
            f"{name:18} first {first:6.0f} ms, then {statistics.median(rest):5.1f} ms a seed "
            f"(median of {seeds - 1})"
        )


if __name__ == "__main__":
    main()
