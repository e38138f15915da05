"""The feedback loop: what becomes of what a robot learns when it acts on what it learned.

Every estimator of long-term presence under every policy of the robot, over paired seeds: total
variation between the estimate at the end and where the person really was, given at home; mean and
95 % bootstrap interval over seeds, and the same of each seed's difference to the naive estimator.
Where the robot hangs out, it goes by the estimator of the column; elsewhere all estimators watch
the same robot.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fleet2d.paper.months import USER, Request, Tell, interval, month, run_all
from fleet2d.paper.result import Result, Table, counted

NAME = "feedback"
TITLE = "The feedback loop: error of long-term presence by what the robot does"
NAIVE = "sighting_share"
ESTIMATORS = (NAIVE, "exposure_ratio", "audit_only", "likelihood", "fremen")
PAPER = ("the paper has no such table: it is what its figures of learning robots stand on",)
# Rounds by the clock: 12 min of each 2 h, a tenth of the time; they are what audits see.
AUDIT_EVERY_H, AUDIT_MIN = 2, 12
AUDITS = [f"{hour:02}:00-{hour:02}:{AUDIT_MIN}" for hour in range(0, 24, AUDIT_EVERY_H)]
ROUNDS = {"type": "patrol", "order": "random", "dwell": "30 s", "when": AUDITS}
PATROL = {"type": "patrol", "order": "random", "dwell": "10 min"}
HANGOUT = {"type": "hangout", "near": "room"}


@dataclass(frozen=True)
class Policy:
    """What a robot does.

    Attributes:
        behaviors: As in a scenario, the most important first.
        acts: Whether it goes by an estimator.
    """

    behaviors: tuple[Mapping[str, Any], ...]
    acts: bool = False

    def robot(self, estimator: str) -> dict[str, Any]:
        """Return the robot, which goes by an estimator if it goes by any."""
        return {
            "behaviors": [
                {**behavior, "source": estimator} if behavior["type"] == "hangout" else behavior
                for behavior in self.behaviors
            ]
        }


POLICIES = {
    "independent patrol": Policy((PATROL,)),
    "hangout, 10 % of moves at random": Policy(({**HANGOUT, "explore": 0.1},), acts=True),
    "hangout, 10 % rounds by the clock": Policy((ROUNDS, {**HANGOUT, "explore": 0}), acts=True),
    "follow, else patrol": Policy(({"type": "follow"}, PATROL)),
    "opportunistic, else patrol": Policy(({"type": "opportunistic"}, PATROL)),
}

Case = tuple[str, tuple[str, ...], int]
Errors = dict[str, dict[str, list[float]]]  # by policy and estimator, of each seed


def watched_month(policy: str, estimators: tuple[str, ...], seed: int, days: int) -> dict[str, Any]:
    """Return a month in which these estimators learn; the robot goes by the first, if by any."""
    return month(
        POLICIES[policy].robot(estimators[0]),
        algorithms={name: _algorithm(name) for name in estimators},
        metrics={f"error_{name}": {"type": "ltp_error", "of": name} for name in estimators},
        seed=seed,
        days=days,
    )


def _algorithm(estimator: str) -> dict[str, Any]:
    chosen: dict[str, Any] = {"type": estimator}
    if estimator == "audit_only":
        chosen |= {"every": f"{AUDIT_EVERY_H} h", "length": f"{AUDIT_MIN} min"}
    return {"type": "long_term_presence", "estimator": chosen}


def errors(content: Mapping[str, Any]) -> dict[str, float]:
    """Run a month; return the error of each estimator in it."""
    import fleet2d

    stored = fleet2d.run(content)
    return {name: stored.metrics[f"error_{name}"][USER]["tv"] for name in content["algorithms"]}


def reproduce(request: Request, tell: Tell) -> Result:
    """Run all months; return the tables of errors and of differences to the naive estimator."""
    seeds, days = request.size(30, 30, 2, 3)
    cases = cases_of(range(seeds))
    found = run_all(errors, [watched_month(*case, days) for case in cases], request, tell)
    return compared(cases, found, days)


def cases_of(seeds: Iterable[int]) -> list[Case]:
    """Return the months, seed by seed: policy, the estimators in it, and seed."""
    return [
        (policy, estimators, seed)
        for seed in seeds
        for policy, does in POLICIES.items()
        for estimators in ([(e,) for e in ESTIMATORS] if does.acts else [ESTIMATORS])
    ]


def compared(cases: Sequence[Case], found: Sequence[Mapping[str, float]], days: int) -> Result:
    """Return the tables of the errors that were found."""
    tv: Errors = {policy: {e: [] for e in ESTIMATORS} for policy in POLICIES}
    for (policy, _, _), row in zip(cases, found, strict=True):
        for estimator, error in row.items():
            tv[policy][estimator].append(error)
    seeds = len({seed for _, _, seed in cases})
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
    """Return the errors less that of the naive estimator under the same policy and seed."""
    return {
        policy: {
            estimator: [mine - naive for mine, naive in zip(values, by[NAIVE], strict=True)]
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
        tuple((policy, *(_shown(by[e]) for e in estimators)) for policy, by in values.items()),
        notes,
    )


def _shown(values: list[float]) -> str:
    mean, low, high = interval(values)
    return f"{mean:.3f} ({low:.3f} to {high:.3f})"


def _words(estimator: str) -> str:
    return estimator.replace("_", " ")
