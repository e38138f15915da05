"""The paper's results over months: studies in YAML beside this file, and what their tables say."""

import json
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.table import Table

from fleet2d.configuration.documents import read_document
from fleet2d.configuration.problems import counted
from fleet2d.errors import ComponentError, InputError, os_errors_as
from fleet2d.metrics.rtp_score import ALL, GAPS
from fleet2d.studies.answers import group_means
from fleet2d.studies.api import make_executor, study

if TYPE_CHECKING:
    import polars as pl

    from fleet2d.studies.reader import Study

USER = "ana"  # in all studies
PAPER_COLUMN = "the paper's"  # heading of the column of the paper's own figures
SPEED, LTP_GAP, RTP_GAP, FEEDBACK = RESULTS = ("speed", "ltp-gap", "rtp-gap", "feedback")
SIZES = {SPEED: (3, 30), LTP_GAP: (100, 30), RTP_GAP: (10, 30), FEEDBACK: (30, 30)}
"""The number of months of each kind and their days, by result."""
QUICK_SIZES = {SPEED: (1, 2), LTP_GAP: (4, 3), RTP_GAP: (2, 3), FEEDBACK: (2, 3)}


@dataclass(frozen=True)
class Result:
    """One result of the paper, measured again.

    Attributes:
        name: Its name on the command line.
        title: Its title.
        tables: Its tables.
        numbers: The numbers of every single run, as JSON data.
        notes: Notes to print below the tables.
    """

    name: str
    title: str
    tables: Sequence[Table]
    numbers: Mapping[str, Any] = field(default_factory=dict)
    notes: Sequence[str] = ()

    def save(self, directory: Path) -> Path:
        """Write the numbers to `NAME.json` in a directory; return the path.

        Raises:
            InputError: The file can't be written.
        """
        from fleet2d import __version__

        path = directory / f"{self.name}.json"
        content = {"result": self.title, "fleet2d": __version__, **self.numbers}
        with os_errors_as(
            InputError, f"{path} can't be written", "; name another directory by --out"
        ):
            path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        return path


@dataclass(frozen=True)
class PaperOptions:
    """The size of the results.

    Attributes:
        quick: Whether to make small versions, to see that everything works.
        seeds: The number of months of each kind (runs of each row of the speed table); None: the
            default of the result.
        days: The days of a month; None: 30, or a few if `quick`.
        workers: The number of worker processes; 1: this process. Results don't depend on it.
        map: The map of a real home, for the speed table.
        folder: The folder of the studies.
    """

    quick: bool = False
    seeds: int | None = None
    days: int | None = None
    workers: int = 1
    map: Path | None = None
    folder: Path = Path("studies")

    def size(self, name: str) -> tuple[int, int]:
        """Return the number of months of a result and their days: as requested, else the defaults.

        Example:
            >>> PaperOptions(quick=True, days=5).size("feedback")
            (2, 5)
        """
        seeds, days = (QUICK_SIZES if self.quick else SIZES)[name]
        return self.seeds or seeds, self.days or days


def table_of(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """Return a table: words to the left, numbers to the right."""
    table = Table(title=title, title_justify="left", title_style="", show_edge=False)
    for number, head in enumerate(columns):
        is_text = not number or head == PAPER_COLUMN
        table.add_column(head, justify="left" if is_text else "right", no_wrap=head != PAPER_COLUMN)
    for row in rows:
        table.add_row(*row)
    return table


def study_content(name: str, seeds: int, days: int) -> dict[str, Any]:
    """Return the study file of a result with a number of months of each kind and their days."""
    content: dict[str, Any] = read_document(Path(__file__).with_name(f"{name}.yaml")).data
    content["base"]["simulation"]["duration"] = {"days": days}
    if "replicates" in content:
        content["replicates"] = seeds
        return content
    axis = content["axes"]["robot"]
    kinds = [robot for (robot,) in map(dict.values, axis["options"].values())]
    robots = {f"robot_{number}": kinds[number % len(kinds)] for number in range(seeds)}
    axis["options"] = {name: {f"robots.{name}": robot} for name, robot in robots.items()}
    return content


def run_months(name: str, options: PaperOptions) -> "Study":
    """Run the study of a result and open it; an interrupted study in a folder continues.

    Raises:
        ComponentError: A month failed.
        InputError: polars or scipy is missing, or the folder can't be used.
    """
    content = study_content(name, *options.size(name))
    folder = options.folder / name
    executor = make_executor("serial" if options.workers == 1 else "local", options.workers)
    months = study(content, folder, executor=executor, fail_fast=True, changed="redo")
    if months.counts.failed:
        raise ComponentError(f"a month failed: {months.failures['error'][0]}")
    return months


def estimates(rows: "pl.DataFrame", row: str, column: str) -> "pl.DataFrame":
    """Return the mean of `value` with its 95 % interval by two columns of a frame, in its order.

    Returns:
        A frame with the two columns, `mean`, `low` and `high`.
    """
    return group_means(rows, "value", (row, column), ()).select(row, column, "mean", "low", "high")


def table_of_means(
    title: str, means: "pl.DataFrame", columns: Iterable[str], text: str = "{:.3f}"
) -> Table:
    """Return the table of `estimates`, a row for each value of the first column of the frame."""
    cells = {(row, column): text.format(*numbers) for row, column, *numbers in means.iter_rows()}
    rows = [
        (_words(name), *(cells.get((name, column), "") for column in columns))
        for name in dict.fromkeys(row for row, _ in cells)
    ]
    return table_of(title, (means.columns[0], *map(_words, columns)), rows)


def _words(name: str) -> str:
    return name.replace("_", " ")


SHOWN_DAYS = (1, 3, 7, 14, 21, 30, 60)


def ltp_gap(options: PaperOptions) -> Result:
    """Measure how the estimate of long-term presence converges over the days.

    One person, one home, many robots: patrols of several kinds, and hangouts that use what they
    learned. Each robot has random draws of its own, and the person lives the same month with each.
    The gap of a room is the difference between its estimated and its true share of time at home so
    far. The result is the mean over robots, and the band that contains 80 % of them.
    """
    robots, days = options.size(LTP_GAP)
    start_s = time.perf_counter()
    months = run_months(LTP_GAP, options)
    duration_s = time.perf_counter() - start_s
    rows = months.pandas("gap", columns=["variant", "step", "user", "room", "gap"])
    rows = rows[rows["user"] == USER].sort_values(["variant", "step"], kind="stable")
    rooms = rows["room"].unique().tolist()
    gaps = rows["gap"].to_numpy().reshape(robots, days, len(rooms))
    gaps = np.ascontiguousarray(np.moveaxis(gaps, 2, 0))  # shape: (rooms, robots, days)
    overall = gaps.mean(axis=0)
    mean, (low, high) = overall.mean(axis=0), np.quantile(overall, (0.1, 0.9), axis=0)
    band = {"mean": mean.tolist(), "low": low.tolist(), "high": high.tolist()}
    means = dict(zip(rooms, gaps.mean(axis=1).tolist(), strict=True))
    lines = {**means, "all rooms": band["mean"]}
    lines |= {f"  band, {end}": band[end] for end in ("low", "high")}
    listed_days = [day for day in SHOWN_DAYS if day <= days]
    table = table_of(
        f"mean |estimated - true| share of time at home; {counted(robots, 'robot')},"
        f" {counted(days, 'day')}, likelihood",
        ("room", *(f"day {day}" for day in listed_days)),
        [(name, *(f"{line[day - 1]:.3f}" for day in listed_days)) for name, line in lines.items()],
    )
    numbers = {
        "robots": robots,
        "days": days,
        "estimator": "likelihood",
        "seconds": duration_s,
        "mean": means,
        "all_rooms": band,
        "gaps": [dict(zip(rooms, gaps[:, i].tolist(), strict=True)) for i in range(robots)],
    }
    speed = f"{robots * days} days of one home in {duration_s:.1f} s, {options.workers} at a time"
    return Result(LTP_GAP, months.meta.description, [table], numbers, (months.meta.notes, speed))


NAIVE_GUESS = "naive"
NAIVE_SOURCE = "routine"  # the model beside whose scores those of the naive guess are read
SCORES = {"top_1": "share of right rooms", "log_loss": "log loss [nats], smaller is better"}


def rtp_gap(options: PaperOptions) -> Result:
    """Measure how often the room of a user is right, by the time since the last sighting.

    Real-time presence by several models and by the naive guess (the room of the last sighting) is
    scored every minute: the share of right rooms, and the log loss, which is a proper score. The
    result is the mean over seeds with its interval; each seed is a month of another life
    with a robot on patrol.
    """
    import polars as pl

    seeds, days = options.size(RTP_GAP)
    months = run_months(RTP_GAP, options)
    pattern = rf"^score_(?<model>\w+)\.{USER}\.(?<gap>[^.]+)\.(?<naive>naive_)?(?<score>\w+)$"
    is_naive = pl.col("naive").is_not_null()
    scores = (
        months.variants.unpivot(pl.selectors.starts_with("score_"), index="seed")
        .with_columns(pl.col("variable").str.extract_groups(pattern))
        .unnest("variable")
        .filter(pl.col("score").is_in(list(SCORES)) & pl.col("value").is_not_null())
        .filter(~is_naive | (pl.col("model") == NAIVE_SOURCE))
        .sort(is_naive, maintain_order=True)
        .with_columns(model=pl.when(is_naive).then(pl.lit(NAIVE_GUESS)).otherwise("model"))
        .select("score", "seed", "model", "gap", "value")
    )
    scores_of = scores.partition_by("score", as_dict=True)
    means = {score: estimates(scores_of[score,], "model", "gap") for score in SCORES}
    size = f"{counted(seeds, 'seed')} of {counted(days, 'day')}"
    tables = [
        table_of_means(f"{title}; {size}", means[score], (*GAPS, ALL))
        for score, title in SCORES.items()
    ]
    rows = {score: frame.to_dicts() for score, frame in means.items()}
    numbers = {"seeds": seeds, "days": days, "means": rows, "scores": scores.to_dicts()}
    return Result(RTP_GAP, months.meta.description, tables, numbers, (months.meta.notes,))


NAIVE_ESTIMATOR = "sighting_share"
ESTIMATORS = (NAIVE_ESTIMATOR, "exposure_ratio", "audit_only", "likelihood", "fremen")


def feedback(options: PaperOptions) -> Result:
    """Measure the error of estimators when the robot acts on their estimates.

    Every estimator of long-term presence is measured under every policy of the robot with the same
    seeds. The error is the total variation distance between the estimate at the end and the true
    shares of time at home: mean and 95 % interval over seeds, and the same of the
    difference to the naive estimator with each seed. A robot that hangs out uses the estimator of
    the column; with other policies all estimators watch the same robot.
    """
    seeds, days = options.size(FEEDBACK)
    months = run_months(FEEDBACK, options)
    columns = {estimator: f"error_{estimator}.{USER}.tv" for estimator in ESTIMATORS}
    errors = months.variants.select("robot", "seed", **columns)
    errors = errors.unpivot(index=["robot", "seed"], variable_name="estimator").drop_nulls()
    size = f"{counted(seeds, 'paired seed')} of {counted(days, 'day')}"
    text = "{:.3f} ({:.3f} to {:.3f})"
    means = estimates(errors, "robot", "estimator")
    less = estimates(differences(errors), "robot", "estimator")
    title = f"total variation from the truth at the end; {size}: mean (95 %)"
    less_title = (
        f"the same less that of {_words(NAIVE_ESTIMATOR)} on the same seed, smaller is better:"
        " mean (95 %)"
    )
    tables = [
        table_of_means(title, means, ESTIMATORS, text),
        table_of_means(less_title, less, ESTIMATORS[1:], text),
    ]
    numbers = {"seeds": seeds, "days": days, "means": means.to_dicts(), "tv": errors.to_dicts()}
    return Result(FEEDBACK, months.meta.description, tables, numbers, (months.meta.notes,))


def differences(errors: "pl.DataFrame") -> "pl.DataFrame":
    """Return the errors minus that of the naive estimator under the same policy and seed."""
    import polars as pl

    is_naive = pl.col("estimator") == NAIVE_ESTIMATOR
    naive = pl.col("value").filter(is_naive).first().over("robot", "seed")
    return errors.with_columns(pl.col("value") - naive).filter(~is_naive)
