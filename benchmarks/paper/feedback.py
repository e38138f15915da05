"""The feedback loop: what becomes of what a robot learns when it acts on what it learned.

    python benchmarks/paper/feedback.py [--seeds 30] [--days 30] [--figure loop.png]

Every estimator of long-term presence under every policy of the robot, over paired seeds: total
variation between the estimate at the end and where the person really was, given at home; mean and
95 % bootstrap interval over seeds. Under `hangout`, the robot hangs out by the estimator of that
column; under the other policies, all estimators watch the same robot.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lives import interval, month, run_all

ESTIMATORS = ("sighting_share", "exposure_ratio", "audit_only", "likelihood")
ALONE = [(estimator,) for estimator in ESTIMATORS]
POLICIES: dict[str, dict[str, Any]] = {
    "independent patrol": {"type": "patrol", "dwell": "10 min", "order": "random"},
    "hangout on its own": {"type": "hangout", "near": "room"},
    "follow": {"behaviors": [{"type": "follow"}, {"type": "patrol", "order": "random"}]},
    "opportunistic": {
        "behaviors": [{"type": "opportunistic"}, {"type": "patrol", "order": "random"}]
    },
}


def errors(content: Mapping[str, Any]) -> dict[str, float]:
    """Run a month; return the error of each estimator in it."""
    import fleet2d

    stored = fleet2d.run(content)
    return {name: stored.metrics[f"error_{name}"]["ana"]["tv"] for name in content["algorithms"]}


def watched(policy: str, estimators: tuple[str, ...], seed: int, days: int) -> dict[str, Any]:
    """Return a month in which these estimators learn."""
    robot = dict(POLICIES[policy])
    if robot.get("type") == "hangout":
        robot["source"] = estimators[0]
    return month(
        robot,
        algorithms={e: {"type": "long_term_presence", "estimator": e} for e in estimators},
        metrics={f"error_{e}": {"type": "ltp_error", "of": e} for e in estimators},
        seed=seed,
        days=days,
    )


def main() -> None:
    """Run all and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--days", type=int, default=30)
    parser.add_argument("--figure", type=Path, help="picture to write")
    arguments = parser.parse_args()
    cases = [
        (policy, estimators, seed)
        for policy, robot in POLICIES.items()
        for estimators in (
            [(e,) for e in ESTIMATORS] if robot.get("type") == "hangout" else [ESTIMATORS]
        )
        for seed in range(arguments.seeds)
    ]
    found = run_all(errors, [watched(*case, arguments.days) for case in cases])
    tv: dict[tuple[str, str], list[float]] = {}
    for (policy, _, _), row in zip(cases, found, strict=True):
        for estimator, error in row.items():
            tv.setdefault((policy, estimator), []).append(error)
    print(
        f"total variation after {arguments.days} days, {arguments.seeds} paired seeds: mean (95 %)"
    )
    print(f"{'':<22}" + "".join(f"{estimator:>24}" for estimator in ESTIMATORS))
    for policy in POLICIES:
        cells = [interval(tv[policy, estimator]) for estimator in ESTIMATORS]
        shown = "".join(f"{f'{m:.3f} ({lo:.3f} to {hi:.3f})':>24}" for m, lo, hi in cells)
        print(f"{policy:<22}{shown}")
    if arguments.figure:
        draw(tv, arguments.figure)


def draw(tv: Mapping[tuple[str, str], list[float]], path: Path) -> None:
    """Draw the means with their intervals."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 4), layout="constrained")
    for i, estimator in enumerate(ESTIMATORS):
        cells = [interval(tv[policy, estimator]) for policy in POLICIES]
        means = [m for m, _, _ in cells]
        ends = [[m - lo for m, lo, _ in cells], [hi - m for m, _, hi in cells]]
        at = [p + 0.2 * (i - 1.5) for p in range(len(POLICIES))]
        axes.bar(at, means, 0.18, yerr=ends, capsize=2, label=estimator.replace("_", " "))
    axes.set_xticks(range(len(POLICIES)), list(POLICIES))
    axes.set_ylabel("total variation from the truth")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
