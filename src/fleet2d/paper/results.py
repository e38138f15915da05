"""The paper's results over months: studies in YAML beside this file, and what their tables say."""

import json
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from rich.markup import escape
from rich.table import Table

from fleet2d.configuration.documents import read_document
from fleet2d.configuration.problems import counted
from fleet2d.errors import ComponentError, InputError, os_errors_as
from fleet2d.metrics.rtp_score import ALL, GAPS
from fleet2d.studies.api import study
from fleet2d.studies.intervals import estimate

if TYPE_CHECKING:
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
    table = Table(title=escape(title), title_justify="left", title_style="", show_edge=False)
    for number, head in enumerate(columns):
        is_text = head == PAPER_COLUMN
        justify: Literal["left", "right"] = "left" if is_text or not number else "right"
        table.add_column(escape(head), justify=justify, no_wrap=not is_text)
    for row in rows:
        table.add_row(*map(escape, row))
    return table


def study_content(name: str, seeds: int, days: int) -> dict[str, Any]:
    """Return the study file of a result with a number of months of each kind and their days."""
    content: dict[str, Any] = read_document(Path(__file__).with_name(f"{name}.yaml")).data
    content["base"]["simulation"]["duration"] = {"days": days}
    if "replicates" in content:
        content["replicates"] = seeds
        return content
    kinds = [robot for (robot,) in map(dict.values, content["axes"]["robot"]["options"].values())]
    content["axes"]["robot"]["options"] = {
        f"robot_{number}": {f"robots.robot_{number}": kinds[number % len(kinds)]}
        for number in range(seeds)
    }
    return content


def run_months(name: str, options: PaperOptions) -> "Study":
    """Run the study of a result and open it; an interrupted study in a folder continues.

    Raises:
        ComponentError: A month failed.
        InputError: polars or scipy is missing, or the folder can't be used.
    """
    months = study(
        study_content(name, *options.size(name)),
        options.folder / name,
        workers=options.workers,
        executor="serial" if options.workers == 1 else "local",
        fail_fast=True,
        changed="redo",
    )
    if months.counts.failed:
        raise ComponentError(f"a month failed: {months.failures['error'][0]}")
    return months


def interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Return the mean of values and the ends of its 95 % interval.

    Example:
        >>> interval([0.5, 0.5, 0.5])
        (0.5, 0.5, 0.5)
    """
    mean = estimate(values)
    return mean.mean, mean.low, mean.high


SHOWN_DAYS = (1, 3, 7, 14, 21, 30, 60)
LTP_NOTE = (
    "the paper's figure: gaps of the rooms that fall with the days, mean and band over 100 robot"
    " behaviors for one user and home; its numbers are not printed"
)


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
    low, high = np.quantile(overall, (0.1, 0.9), axis=0)
    means = dict(zip(rooms, gaps.mean(axis=1), strict=True))
    lines = {**means, "all rooms": overall.mean(axis=0), "  band, low": low, "  band, high": high}
    listed_days = [day for day in SHOWN_DAYS if day <= days]
    table = table_of(
        f"mean |estimated - true| share of time at home; {counted(robots, 'robot')},"
        f" {counted(days, 'day')}, likelihood",
        ("room", *(f"day {day}" for day in listed_days)),
        [(name, *(f"{line[day - 1]:.3f}" for day in listed_days)) for name, line in lines.items()],
    )
    speed = f"{robots * days} days of one home in {duration_s:.1f} s, {options.workers} at a time"
    numbers = {
        "robots": robots,
        "days": days,
        "estimator": "likelihood",
        "seconds": duration_s,
        "mean": {room: line.tolist() for room, line in means.items()},
        "all_rooms": {
            "mean": overall.mean(axis=0).tolist(), "low": low.tolist(), "high": high.tolist(),
        },
        "gaps": [dict(zip(rooms, gaps[:, i].tolist(), strict=True)) for i in range(robots)],
    }  # fmt: skip
    return Result(LTP_GAP, months.meta.description, (table,), numbers, (LTP_NOTE, speed))


MODELS = ("routine", "hmm", "semi_markov", "markov", "hour_of_week", "long_term")
NAIVE_GUESS = "naive"
SCORES = {"top_1": "share of right rooms", "log_loss": "log loss [nats], smaller is better"}
RTP_NOTE = (
    "the paper's figure: a model's accuracy above that of the naive guess, the more so the longer"
    " the user was out of sight; its numbers are not printed"
)


def rtp_gap(options: PaperOptions) -> Result:
    """Measure how often the room of a user is right, by the time since the last sighting.

    Real-time presence by several models and by the naive guess (the room of the last sighting) is
    scored every minute: the share of right rooms, and the log loss, which is a proper score. The
    result is the mean over seeds with its interval; each seed is a month of another life
    with a robot on patrol.
    """
    seeds, days = options.size(RTP_GAP)
    months = run_months(RTP_GAP, options)
    lives = [_scores(row) for row in months.variants.to_dicts()]
    means = {
        score: {
            model: {
                gap: interval([life[model][gap][score] for life in lives if gap in life[model]])
                for gap in (*GAPS, ALL)
                if any(gap in life[model] for life in lives)
            }
            for model in (*MODELS, NAIVE_GUESS)
        }
        for score in SCORES
    }
    tables = [
        table_of(
            f"{title}; {counted(seeds, 'seed')} of {counted(days, 'day')}",
            ("model", *GAPS, ALL),
            [
                (_words(model), *(f"{of[gap][0]:.3f}" if gap in of else "" for gap in (*GAPS, ALL)))
                for model, of in means[score].items()
            ],
        )
        for score, title in SCORES.items()
    ]
    numbers = {"seeds": seeds, "days": days, "means": means, "scores": lives}
    return Result(RTP_GAP, months.meta.description, tables, numbers, (RTP_NOTE,))


def _scores(row: Mapping[str, Any]) -> dict[str, dict[str, dict[str, float]]]:
    """Return the scores of one life by model and gap, the naive guess as one more model."""

    def value(model: str, gap: str, score: str) -> Any:
        if model == NAIVE_GUESS:
            model, score = MODELS[0], f"naive_{score}"
        return row.get(f"score_{model}.{USER}.{gap}.{score}")

    return {
        model: {
            gap: {score: value(model, gap, score) for score in SCORES}
            for gap in (*GAPS, ALL)
            if value(model, gap, "top_1") is not None
        }
        for model in (*MODELS, NAIVE_GUESS)
    }


NAIVE_ESTIMATOR = "sighting_share"
ESTIMATORS = (NAIVE_ESTIMATOR, "exposure_ratio", "audit_only", "likelihood", "fremen")
Errors = dict[str, dict[str, list[float]]]
"""The errors of all seeds, by policy of the robot and estimator."""


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
    errors: Errors = {}
    for row in months.variants.to_dicts():  # the seeds of a combination in order
        of_policy = errors.setdefault(row["robot"], {estimator: [] for estimator in ESTIMATORS})
        for estimator, values in of_policy.items():
            error = row.get(f"error_{estimator}.{USER}.tv")
            values += [] if error is None else [error]
    size = f"{counted(seeds, 'paired seed')} of {counted(days, 'day')}"
    tables = [
        _error_table(f"total variation from the truth at the end; {size}: mean (95 %)", errors),
        _error_table(
            f"the same less that of {_words(NAIVE_ESTIMATOR)} on the same seed, smaller is better:"
            " mean (95 %)",
            differences(errors),
        ),
    ]
    numbers = {"seeds": seeds, "days": days, "tv": errors}
    note = "the paper has no such table: it is what its figures of learning robots stand on"
    return Result(FEEDBACK, months.meta.description, tables, numbers, (note,))


def differences(errors: Errors) -> Errors:
    """Return the errors minus that of the naive estimator under the same policy and seed."""
    return {
        policy: {
            estimator: np.subtract(values, of[NAIVE_ESTIMATOR]).tolist()
            for estimator, values in of.items()
            if estimator != NAIVE_ESTIMATOR
        }
        for policy, of in errors.items()
    }


def _error_table(title: str, errors: Errors) -> Table:
    estimators = next(iter(errors.values()))
    rows = [
        (policy, *("{:.3f} ({:.3f} to {:.3f})".format(*interval(v)) for v in of.values()))
        for policy, of in errors.items()
    ]
    return table_of(title, ("robot", *map(_words, estimators)), rows)


def _words(name: str) -> str:
    return name.replace("_", " ")
