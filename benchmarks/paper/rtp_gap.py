"""Fig. 7 right of the paper: how often the room is told right, by how long ago the user was seen.

    python benchmarks/paper/rtp_gap.py [--seeds 10] [--days 30] [--figure rtp.png]

Real-time presence by several models and by the naive guess (the room of the last sighting), scored
every minute by bin of last-seen gap: share told right, and log loss, which is a proper score. Mean
over seeds, each a month of another life with a robot on patrol.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from lives import month, run_all

MODELS = ("hmm", "semi_markov", "markov", "hour_of_week", "long_term")
GAPS = ("0-1 min", "1-5 min", "5-15 min", "15-60 min", "1-4 h", "over 4 h", "all")
NAIVE = "naive"

Scores = dict[str, dict[str, dict[str, float]]]


def scores(content: Mapping[str, Any]) -> Scores:
    """Run a month; return the scores by model and gap."""
    import fleet2d

    stored = fleet2d.run(content)
    return {name: stored.metrics[f"score_{name}"]["ana"] for name in content["algorithms"]}


def table(found: list[Scores], score: str) -> dict[str, list[float]]:
    """Return the mean of a score over seeds, by model, in the order of GAPS."""

    def mean(name: str, gap: str, key: str) -> float:
        values = [one[name][gap][key] for one in found if gap in one[name]]
        return float(np.mean(values)) if values else float("nan")

    rows = {name: [mean(name, gap, score) for gap in GAPS] for name in found[0]}
    return rows | {NAIVE: [mean(MODELS[0], gap, f"naive_{score}") for gap in GAPS]}


def main() -> None:
    """Run all, print the tables, draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--days", type=int, default=30)
    parser.add_argument("--figure", type=Path, help="picture to write")
    arguments = parser.parse_args()
    contents = [
        month(
            {"type": "patrol", "order": "random", "dwell": "5 min"},
            algorithms={
                m: {"type": "real_time_presence", "model": m, "period": "5 min"} for m in MODELS
            },
            metrics={f"score_{m}": {"type": "rtp_score", "of": m} for m in MODELS},
            seed=seed,
            days=arguments.days,
        )
        for seed in range(arguments.seeds)
    ]
    found = run_all(scores, contents)
    for score, what in (("top_1", "share told right"), ("log_loss", "log loss [nats]")):
        print(f"{what}, by last-seen gap; {arguments.seeds} months of {arguments.days} days")
        print(f"{'':<16}" + "".join(f"{gap:>11}" for gap in GAPS))
        for name, values in table(found, score).items():
            print(f"{name:<16}" + "".join(f"{value:>11.3f}" for value in values))
    if arguments.figure:
        draw(table(found, "top_1"), arguments.figure)


def draw(rows: Mapping[str, list[float]], path: Path) -> None:
    """Draw the share told right by gap."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    for name, values in rows.items():
        style = {"color": "black", "ls": "--"} if name == NAIVE else {}
        axes.plot(GAPS[:-1], values[:-1], "o-", label=name.replace("_", " "), **style)
    axes.set_xlabel("time since the user was last seen")
    axes.set_ylabel("share told right")
    axes.set_ylim(0, 1)
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
