"""How often off-policy intervals from one life contain what other policies have in simulated lives.

    python benchmarks/off_policy_coverage.py [--lives 120] [--days 14] [--jobs 2]

Each life is lived under a policy that asks with probability 1/2. From its log three estimators tell
how many yeses a policy that asks mostly by day, or mostly by night, would get in a day. The truth
is the mean over the same lives, lived under that policy. A row is a way of answering and a policy,
a cell the share of lives whose 95 % interval contains the truth, and the mean error.
"""

import argparse
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any

import numpy as np

import fleet2d
from fleet2d.algorithms.timing import HOURS, TimingPolicy
from fleet2d.kernels import F64
from fleet2d.studies.intervals import MeanEstimate
from fleet2d.studies.off_policy import (
    LoggedOpportunities,
    doubly_robust,
    inverse_propensity,
    read_opportunities,
)

DAY_HOURS = range(8, 21)
# Answers that leave no trace: opportunities are independent given the person's life.
WITHOUT_MEMORY = {
    "recency": {"at_once": 0},
    "burden": {"each": 0},
    "attitude": {"novelty": 0, "habit": 0, "trust": 0, "annoyance": 0},
    "months": {"annoyed_by": 0},
}
ANSWERS: dict[str, dict[str, Any]] = {"without memory": WITHOUT_MEMORY, "default": {}}
# Probabilities of asking by day and by night.
LOGGED = (0.5, 0.5)
TARGETS = {
    "mostly by day": (0.9, 0.1),
    "rather by day": (0.7, 0.3),
    "rather by night": (0.3, 0.7),
    "mostly by night": (0.1, 0.9),
}


class DayAndNight(TimingPolicy):
    """Asks with one probability by day and another by night."""

    by_day: float
    by_night: float

    def chances(self) -> F64:
        """Return the probabilities by hour."""
        return np.broadcast_to(rates(self.by_day, self.by_night)[:, None], (HOURS, self.rooms))


def rates(by_day: float, by_night: float) -> F64:
    """Return the probability of asking at each hour: float64 (24,)."""
    hourly = np.full(HOURS, by_night)
    hourly[list(DAY_HOURS)] = by_day
    return hourly


def live(days: int, answers: str, policy: tuple[float, float], seed: int) -> LoggedOpportunities:
    """Return the opportunities of a life: an offer an hour, considered once."""
    behaviors = [
        {"type": "interact", "timing": "when", "look": "1 h", "again": 0, "patience": "10 s"},
        {"type": "patrol"},
    ]
    offer = {"do": "greet", "to": "ana", "every": "1 h", "within": "59 min", "tries": 1}
    run = fleet2d.run(
        {
            "extends": "bundled:paper",
            "simulation": {"duration": {"days": days}, "seed": seed},
            "users": {"ana": {"persona": "retired", "answers": ANSWERS[answers]}},
            "robots": {"astro": {"behaviors": behaviors}},
            "algorithms": {
                "ltp": None,
                "when": {
                    "type": "timing",
                    "policy": DayAndNight(by_day=policy[0], by_night=policy[1]),
                },
            },
            "metrics": None,
            "interactions": {"hello": offer},
        }
    )
    return read_opportunities(run)


def estimates(log: LoggedOpportunities, policy: tuple[float, float]) -> dict[str, MeanEstimate]:
    """Return what each estimator tells about another policy."""
    hour = log.step // 3600 % HOURS
    # Before the first answer every policy asks.
    target = np.where(log.chance == 1, 1.0, rates(*policy)[hour])
    is_day = np.isin(hour, DAY_HOURS)
    yes = [log.reward[log.asked & (is_day == side)] for side in (False, True)]
    by_night, by_day = (float(each.mean()) if len(each) else 0.0 for each in yes)
    return {
        "inverse propensity": inverse_propensity(log, target),
        "normalized": inverse_propensity(log, target, normalized=True),
        "doubly robust": doubly_robust(log, target, np.where(is_day, by_day, by_night)),
        "no correction": inverse_propensity(log, log.chance),
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--lives", type=int, default=120)
    parser.add_argument("--days", type=int, default=14)
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    with ProcessPoolExecutor(arguments.jobs) as pool:

        def lives(answers: str, policy: tuple[float, float]) -> list[Any]:
            one: Callable[[int], Any] = partial(live, arguments.days, answers, policy)
            return list(pool.map(one, range(1, 1 + arguments.lives), chunksize=4))

        for answers in ANSWERS:
            logs = lives(answers, LOGGED)
            for name, policy in TARGETS.items():
                other = lives(answers, policy)
                truth = float(np.mean([log.reward.sum() / log.days for log in other]))
                told = [estimates(log, policy) for log in logs]
                cells = []
                for method in told[0]:
                    own = [each[method] for each in told]
                    covered = np.mean([each.low <= truth <= each.high for each in own])
                    error = np.mean([each.mean for each in own]) - truth
                    cells.append(f"{method} {100 * covered:.1f} % ({error:+.2f})")
                print(f"{answers}, {name}, truth {truth:.2f}: {', '.join(cells)}", flush=True)


if __name__ == "__main__":
    main()
