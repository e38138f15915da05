"""The feedback loop: the error of estimators when the robot acts on their estimates.

Every estimator of long-term presence is measured under every policy of the robot with the same
seeds. The error is the total variation between the estimate at the end and the true shares of time
at home: mean and 95 % bootstrap interval over seeds, and the same of the difference to the naive
estimator with each seed. A robot that hangs out uses the estimator of the column; with other
policies all estimators watch the same robot.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fleet2d.paper.months import USER, OnProgress, PaperOptions, interval, month, run_study
from fleet2d.paper.result import Result, Table, counted

if TYPE_CHECKING:
    from fleet2d.studies.reader import Study

NAME = "feedback"
TITLE = "The feedback loop: error of long-term presence by what the robot does"
NAIVE = "sighting_share"
ESTIMATORS = (NAIVE, "exposure_ratio", "audit_only", "likelihood", "fremen")
PAPER = ("the paper has no such table: it is what its figures of learning robots stand on",)
# Rounds at fixed times, 12 min of each 2 h, for the estimator that uses audits only.
AUDIT_EVERY_H, AUDIT_MIN = 2, 12
AUDITS = [f"{hour:02}:00-{hour:02}:{AUDIT_MIN}" for hour in range(0, 24, AUDIT_EVERY_H)]
ROUNDS = {"type": "patrol", "order": "random", "dwell": "30 s", "when": AUDITS}
PATROL = {"type": "patrol", "order": "random", "dwell": "10 min"}
HANGOUT = {"type": "hangout", "near": "room"}


@dataclass(frozen=True)
class Policy:
    """A policy of the robot.

    Attributes:
        behaviors: The behaviors of the scenario, the most important first.
        uses_estimator: Whether a behavior uses the estimates.
    """

    behaviors: tuple[Mapping[str, Any], ...]
    uses_estimator: bool = False

    def robot(self, estimator: str) -> dict[str, Any]:
        """Return the settings of the robot; hangouts use the estimator."""
        return {
            "behaviors": [
                {**behavior, "source": estimator} if behavior["type"] == "hangout" else behavior
                for behavior in self.behaviors
            ]
        }


POLICIES = {
    "independent patrol": Policy((PATROL,)),
    "hangout, 10 % of moves at random": Policy(({**HANGOUT, "explore": 0.1},), uses_estimator=True),
    "hangout, 10 % rounds by the clock": Policy(
        (ROUNDS, {**HANGOUT, "explore": 0}), uses_estimator=True
    ),
    "follow, else patrol": Policy(({"type": "follow"}, PATROL)),
    "opportunistic, else patrol": Policy(({"type": "opportunistic"}, PATROL)),
}

Errors = dict[str, dict[str, list[float]]]
"""The errors of all seeds, by policy and estimator."""


def study_of(seeds: int, days: int) -> dict[str, Any]:
    """Return the study: all estimators together watch a robot that uses none of them.

    Policies that use an estimator run once with each, without the other estimators.
    """
    dependent = [name for name, policy in POLICIES.items() if policy.uses_estimator]
    rules = [
        {
            "when": {"robot": dependent, "estimator": estimator},
            "set": {
                f"{section}.{prefix}{absent}": None
                for section, prefix in (("algorithms", ""), ("metrics", "error_"))
                for absent in ESTIMATORS
                if absent != estimator
            },
        }
        for estimator in ESTIMATORS
    ]
    rules += [
        {
            "when": {"robot": policy, "estimator": estimator},
            "set": {"robots.astro.behaviors": POLICIES[policy].robot(estimator)["behaviors"]},
        }
        for policy in dependent
        for estimator in ESTIMATORS
    ]
    robots = {
        name: {"robots.astro.behaviors": policy.robot(NAIVE)["behaviors"]}
        for name, policy in POLICIES.items()
    }
    return {
        "base": month(
            {"behaviors": [PATROL]},
            algorithms={name: _algorithm(name) for name in ESTIMATORS},
            metrics={f"error_{name}": {"type": "ltp_error", "of": name} for name in ESTIMATORS},
            days=days,
        ),
        "axes": {
            "robot": {"options": robots},
            "estimator": {"options": {e: {} for e in ESTIMATORS}, "when": {"robot": dependent}},
        },
        "rules": rules,
        "replicates": seeds,
        "keep": {"metrics": [f"error_*.{USER}.tv"]},
    }


def _algorithm(estimator: str) -> dict[str, Any]:
    settings: dict[str, Any] = {"type": estimator}
    if estimator == "audit_only":
        settings |= {"every": f"{AUDIT_EVERY_H} h", "length": f"{AUDIT_MIN} min"}
    return {"type": "long_term_presence", "estimator": settings}


def errors(study: "Study") -> Errors:
    """Return the error of each estimator under each policy, by seed."""
    tv: Errors = {policy: {e: [] for e in ESTIMATORS} for policy in POLICIES}
    for row in study.variants.sort("seed").to_dicts():
        for estimator in ESTIMATORS:
            error = row.get(f"error_{estimator}.{USER}.tv")
            if error is not None:
                tv[row["robot"]][estimator].append(error)
    return tv


def reproduce(options: PaperOptions, on_progress: OnProgress) -> Result:
    """Run all months; return the tables of errors and of differences to the naive estimator."""
    seeds, days = options.size(30, 30, 2, 3)
    tv = errors(run_study(NAME, study_of(seeds, days), options, on_progress))
    size = f"{counted(seeds, 'paired seed')} of {counted(days, 'day')}"
    tables = (
        _table(
            f"total variation from the truth at the end; {size}: mean (95 %)", tv, ESTIMATORS, PAPER
        ),
        _table(
            f"the same less that of {_words(NAIVE)} on the same seed, smaller is better: mean"
            " (95 %)",
            differences(tv),
            ESTIMATORS[1:],
        ),
    )
    return Result(NAME, TITLE, tables, {"seeds": seeds, "days": days, "tv": tv})


def differences(tv: Errors) -> Errors:
    """Return the errors minus that of the naive estimator under the same policy and seed."""
    return {
        policy: {
            estimator: [error - naive for error, naive in zip(values, by[NAIVE], strict=True)]
            for estimator, values in by.items()
            if estimator != NAIVE
        }
        for policy, by in tv.items()
    }


def _table(
    title: str, values: Errors, estimators: tuple[str, ...], notes: tuple[str, ...] = ()
) -> Table:
    return Table(
        title,
        ("robot", *map(_words, estimators)),
        tuple((policy, *(_cell(by[e]) for e in estimators)) for policy, by in values.items()),
        notes,
    )


def _cell(values: list[float]) -> str:
    mean, low, high = interval(values)
    return f"{mean:.3f} ({low:.3f} to {high:.3f})"


def _words(estimator: str) -> str:
    return estimator.replace("_", " ")
