"""What learning when to ask is worth, and the loop of a greedy learner: tables and pictures.

    python benchmarks/timing.py [--out timing] [--lives 30] [--workers 2] [--pictures docs/images]

Runs `examples/studies/timing.yaml` in OUT/policies (270 runs) and, for the same lives, learners by
logistic regression that differ in one thing at a time in OUT/loop (180 runs); both go on where they
were stopped. Prints means, differences by life with 95 % intervals, and how often the learners of
the loop ask in each week; draws timing.png and timing_loop.png.
"""

import argparse
from pathlib import Path
from typing import Any

import polars as pl
import yaml
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import fleet2d
from fleet2d.studies.reader import Study

STUDIES = Path(__file__).parents[1] / "examples" / "studies"
MEASURE = "interactions.astro.ana."
VALUE, ANNOYANCE = MEASURE + "value", MEASURE + "mean_annoyance"
PAIRS = {
    "policies": ("as soon as it is due", "when she comes into view", "fixed times", "thompson",
                 "fixed times, no music", "greedy logistic"),
    "loop": ("greedy from 50 %", "greedy from 35 %"),
}  # fmt: skip
LEARNERS = {
    "greedy from 50 %": {"type": "logistic"},
    "explores from 50 %": {"type": "logistic", "explore": 0.1},
    "greedy from 35 %": {"type": "logistic", "ask_at": 0.35},
    "explores from 35 %": {"type": "logistic", "ask_at": 0.35, "explore": 0.1},
    "Thompson from 35 %": {"type": "thompson"},
    "two stages": {"type": "two_stage"},
}
COLORS = (
    "#aa3377", "#0077bb", "#009988", "#bbbbbb", "#ee7733", "#cc3311", "#33bbee", "#997700",
    "#555555",
)  # fmt: skip
WEEK_STEPS, WEEKS = 7 * 24 * 3600, 4


def policy_study(lives: int) -> dict[str, Any]:
    """Return `timing.yaml` with its first lives."""
    study: dict[str, Any] = yaml.safe_load((STUDIES / "timing.yaml").read_text())
    life = study["axes"]["life"]
    life["options"] = dict(list(life["options"].items())[:lives])
    return study | {"base": str(STUDIES / study["base"])}


def loop_study(lives: int) -> dict[str, Any]:
    """Return a study of learners in the first lives of `timing.yaml`."""
    study = policy_study(lives)
    options = {name: {"algorithms.when.policy": policy} for name, policy in LEARNERS.items()}
    return {
        "name": "the loop of a greedy learner",
        "base": study["base"],
        "axes": {"policy": {"options": options}, "life": study["axes"]["life"]},
        "replicates": 1,
        "keep": {"metrics": ["interactions.*"], "tables": ["interactions"]},
    }


def tell(study: Study, references: tuple[str, ...]) -> None:
    """Print the means of a study, and its differences to some policies."""
    columns = [MEASURE + name for name in ("value", "mean_annoyance", "asked", "woke")]
    means = [study.summary(column, ["policy"])["mean"].to_list() for column in columns]
    names = study.summary(VALUE, ["policy"])["policy"].to_list()
    print("policy: value, annoyance, asked, woken")
    for name, *row in zip(names, *means, strict=True):
        print(f"  {name:26}" + "".join(f"{number:8.2f}" for number in row))
    for metric in (VALUE, ANNOYANCE):
        for reference in references:
            print(f"{metric.rpartition('.')[2]} against {reference}")
            for row in study.paired(metric, {"policy": reference}).iter_rows(named=True):
                interval = f"{row['difference']:8.2f} ({row['low']:.2f} to {row['high']:.2f})"
                print(f"  {row['policy']:26}{interval}")


def asked_by_week(study: Study) -> pl.DataFrame:
    """Return how often each learner asks in each life and week: columns policy, life, 0 to 3."""
    week = (pl.col("asked_at") // WEEK_STEPS).alias("week")
    rows = study.polars("interactions").collect()
    counts = rows.group_by("policy", "life", week).len().sort("week")
    return counts.pivot(on="week", index=["policy", "life"], values="len").fill_null(0)


def draw_policies(study: Study, axes: Axes) -> None:
    """Draw value over annoyance: a dot for each life, a large one for the mean."""
    each = [study.summary(m, ["policy", "life"]) for m in (ANNOYANCE, VALUE)]
    means = [study.summary(m, ["policy"]) for m in (ANNOYANCE, VALUE)]
    for name, color in zip(means[0]["policy"].to_list(), COLORS, strict=True):
        x, y = (table.filter(pl.col("policy") == name)["mean"] for table in each)
        axes.plot(x, y, "o", color=color, ms=3, alpha=0.45, mec="none")
        x, y = (table.filter(pl.col("policy") == name)["mean"] for table in means)
        axes.plot(x, y, "o", color=color, ms=11, label=name, mec="white")
    axes.set_xlabel("mean annoyance")
    axes.set_ylabel("value of what was accepted in four weeks")


def draw_loop(weeks: pl.DataFrame, axes: Axes) -> None:
    """Draw how often learners ask in each week."""
    for name, color in zip(LEARNERS, COLORS[1:3] + COLORS[4:7] + COLORS[8:], strict=True):
        rows = weeks.filter(pl.col("policy") == name).select(map(str, range(WEEKS)))
        axes.plot(range(1, WEEKS + 1), rows.mean().row(0), "o-", color=color, label=name)
    axes.set_xticks(range(1, WEEKS + 1))
    axes.set_ylim(0)
    axes.set_xlabel("week")
    axes.set_ylabel("questions a week, mean over lives")


def main() -> None:
    """Run the studies, print their tables and draw the pictures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("timing"))
    parser.add_argument("--lives", type=int, default=30)
    parser.add_argument("--workers", type=int, default=None)
    parser.add_argument("--pictures", type=Path, default=None)
    arguments = parser.parse_args()
    out = arguments.out
    study = policy_study(arguments.lives)
    policies = fleet2d.study(study, out / "policies", workers=arguments.workers)
    tell(policies, PAIRS["policies"])
    loop = fleet2d.study(loop_study(arguments.lives), out / "loop", workers=arguments.workers)
    tell(loop, PAIRS["loop"])
    weeks = asked_by_week(loop)
    print("questions in weeks 1 to 4, and lives with at most one question in the last week")
    for name in LEARNERS:
        rows = weeks.filter(pl.col("policy") == name)
        means = rows.select(map(str, range(WEEKS))).mean().row(0)
        quiet = rows.filter(pl.col(str(WEEKS - 1)) <= 1).height
        print(f"  {name:26}" + "".join(f"{mean:7.1f}" for mean in means) + f"{quiet:5}")
    if arguments.pictures:
        arguments.pictures.mkdir(parents=True, exist_ok=True)
        for name, draw in {
            "timing": lambda axes: draw_policies(policies, axes),
            "timing_loop": lambda axes: draw_loop(weeks, axes),
        }.items():
            figure = Figure(figsize=(8, 4.9), dpi=100, layout="constrained")
            axes = figure.subplots()
            draw(axes)
            axes.spines[["top", "right"]].set_visible(False)
            axes.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False, fontsize=9)
            figure.savefig(arguments.pictures / f"{name}.png")


if __name__ == "__main__":
    main()
