"""In which order should a robot look for Ana? Six policies of `find`, compared pair by pair.

The robot learns where she usually is. Four times a day it is called to find her. Then the
simulation is copied, and each copy continues with another policy, which explains all differences.

    python examples/compare_find.py [DAYS]
"""

import copy
import sys
from datetime import timedelta
from typing import Any

import numpy as np

from fleet2d import Simulation
from fleet2d.metrics.metric import kaplan_meier, quantile, restricted_mean

POLICIES = ("random", "nearest", "likeliest", "greedy", "exact", "receding")
CALLS, DEADLINE, SPEED = (10, 13, 18, 21), 300.0, 0.6
DAYS = range(5, 5 + int(sys.argv[1]) if len(sys.argv) > 1 else 17)
FIND = {"type": "find", "user": "ana", "source": "rtp", "at": [f"{h}:00" for h in CALLS]}


def main() -> None:
    """Look for Ana by every policy at every call; print a row for each policy."""
    behaviors = [{**FIND, "deadline": f"{DEADLINE} s"}, {"type": "hangout", "source": "ltp"}]
    history = Simulation(
        "bundled:paper",
        f"simulation.duration={DAYS.stop} d",
        seed=4,
        users={"ana": {"persona": "works_from_home"}},
        robots={"astro": {"behaviors": behaviors, "speed": SPEED}},
        algorithms={"rtp": {"type": "real_time_presence", "model": "hmm"}},
        metrics={"time_to_find": {"deadline": f"{DEADLINE} s"}},
    )
    rows = {policy: list[Any]() for policy in POLICIES}
    for call in (timedelta(days=day, hours=hour) for day in DAYS for hour in CALLS):
        history.run_until(call - timedelta(seconds=1))
        for policy in POLICIES if not history.state["ana"]["away"] else ():
            future = copy.deepcopy(history)
            astro = future.actors["astro"].behaviors
            astro[0] = astro[0].model_copy(update={"policy": policy})
            future.run_until(call + timedelta(seconds=DEADLINE + 1))
            rows[policy].append(future.finish().tables["time_to_find"].to_pylist()[-1])
    found = {p: np.array([row["end"] == "found" for row in rows[p]]) for p in POLICIES}
    ended = {p: np.array([row["seconds"] for row in rows[p]]) for p in POLICIES}
    calls, straight = len(rows["random"]), np.mean([r["ideal"] for r in rows["random"]]) / SPEED
    draws = np.random.default_rng(4).integers(calls, size=(10_000, calls))
    print(f"{calls} calls; straight to her would take {straight:.1f} s")
    print("policy     found  mean  median  ratio  saved against random [s], 95 % interval")
    for p in POLICIES:
        curve = kaplan_meier(ended[p].tolist(), found[p].tolist())
        mean, median = restricted_mean(curve, DEADLINE), quantile(curve, 0.5) or np.inf
        cut = [np.where(found[q], ended[q], DEADLINE) for q in ("random", p)]
        low, high = np.quantile((cut[0] - cut[1])[draws].mean(axis=1), [0.025, 0.975])
        print(f"{p:10} {found[p].mean():5.0%} {mean:5.0f} {median:7.0f}", end="")
        print(f" {mean / straight:6.1f}  {(cut[0] - cut[1]).mean():5.1f} [{low:.1f}, {high:.1f}]")


if __name__ == "__main__":
    main()
