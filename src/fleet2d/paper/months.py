"""The paper's results over months, each a study: presence by days, by gap, and under feedback."""

import json
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.errors import ComponentError, InputError
from fleet2d.metrics.rtp_score import ALL, GAPS
from fleet2d.studies import driver
from fleet2d.studies.answers import estimate
from fleet2d.studies.directory import Counts
from fleet2d.studies.executors import LocalExecutor
from fleet2d.studies.reader import Study, open_study
from fleet2d.studies.records import VariantRecord

PAPER_COLUMN = "the paper's"  # heading of the column of the paper's own figures


@dataclass(frozen=True)
class Table:
    """One table, with its cells as text.

    Attributes:
        title: Its title, with units.
        columns: The headings of its columns.
        rows: Its cells.
        notes: Notes to print below it.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Result:
    """One result of the paper, measured again.

    Attributes:
        name: Its name on the command line.
        title: Its title.
        tables: Its tables.
        numbers: The numbers of every single run, as JSON data.
    """

    name: str
    title: str
    tables: tuple[Table, ...]
    numbers: Mapping[str, Any] = field(default_factory=dict)

    def save(self, directory: Path) -> Path:
        """Write the numbers to `NAME.json` in a directory; return the path.

        Raises:
            InputError: The file can't be written.
        """
        from fleet2d import __version__

        path = directory / f"{self.name}.json"
        content = {"result": self.title, "fleet2d": __version__, **self.numbers}
        try:
            path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        except OSError as error:
            raise InputError(
                f"{path} can't be written: {error.strerror}; name another directory by --out"
            ) from error
        return path


def make_directory(directory: Path) -> None:
    """Create the directory for results, if there is none.

    Raises:
        InputError: It can't be created.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{directory} can't be created: {error.strerror}; name another directory by --out"
        ) from error


def counted(number: int, noun: str) -> str:
    """Return a number with its noun.

    Example:
        >>> counted(1, "day"), counted(30, "day")
        ('1 day', '30 days')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"


OnProgress = Callable[[str, int, int], None]
"""A function that receives progress: the name of the phase, the finished steps, and all steps."""

CAMERA = {"range": [0.3, 4.5], "angle_deg": 108, "detection": 0.95}
USER = "ana"
START = "2026-01-05"
SEED = 4


@dataclass(frozen=True)
class PaperOptions:
    """The size of the results.

    Attributes:
        quick: Whether to make small versions, to see that everything works.
        seeds: The number of months of each kind (runs of each row of the speed table); None: the
            default of the result.
        days: The days of a month; None: 30, or a few if `quick`.
        workers: The number of worker processes; results don't depend on it.
        map: The map of a real home, for the speed table.
        folder: The folder of the studies; None: a temporary folder.
    """

    quick: bool = False
    seeds: int | None = None
    days: int | None = None
    workers: int = 1
    map: Path | None = None
    folder: Path | None = None

    def size(self, seeds: int, days: int, quick_seeds: int, quick_days: int) -> tuple[int, int]:
        """Return the number of months and their days: as requested, else the defaults.

        Example:
            >>> PaperOptions(quick=True, days=3).size(30, 30, 2, 5)
            (2, 3)
        """
        if self.quick:
            seeds, days = quick_seeds, quick_days
        return self.seeds or seeds, self.days or days


def month(
    robot: Mapping[str, Any] | None = None,
    *,
    algorithms: Mapping[str, Any],
    metrics: Mapping[str, Any],
    days: int = 30,
) -> dict[str, Any]:
    """Return the scenario of a month in the bundled home with one person, who works outside.

    Args:
        robot: The settings of the robot astro; None: there is no robot.
        algorithms: The section `algorithms`.
        metrics: The section `metrics`.
        days: The duration [days].
    """
    return {
        "simulation": {"start": START, "duration": {"days": days}, "seed": SEED},
        "floorplan": {"type": "bundled"},
        "users": {USER: {"type": "routine", "persona": "works_outside"}},
        "robots": {} if robot is None else {"astro": {"camera": CAMERA, **robot}},
        "algorithms": dict(algorithms),
        "metrics": dict(metrics),
    }


def run_study(
    name: str, content: Mapping[str, Any], options: PaperOptions, on_progress: OnProgress
) -> Study:
    """Run a study of months and open it; an interrupted study in a folder continues.

    Args:
        name: The name of the study.
        content: The content of the study file.
        options: The number of processes, and the folder.
        on_progress: Receives the progress.

    Raises:
        InputError: The folder holds results of other code; or polars or scipy is missing.
    """
    checked = driver.check_study({"name": name, **content})
    observer = _ProgressObserver(on_progress)
    run_options = driver.RunOptions(fail_fast=True, changed="redo", observer=observer)
    folder = options.folder or Path(tempfile.mkdtemp(prefix="fleet2d-paper-"))
    counts = driver.run_study(checked, folder / name, LocalExecutor(options.workers), run_options)
    study = open_study(folder / name)
    if counts.failed:
        raise ComponentError(f"a month failed: {study.failures['error'][0]}")
    return study


class _ProgressObserver(driver.Observer):
    """Reports the progress of a study: its homes, then its months."""

    def __init__(self, on_progress: OnProgress) -> None:
        self._report, self._finished, self._total = on_progress, 0, 0

    def on_check(self, done: int, total: int) -> None:
        """Report the number of checked homes."""
        self._report("homes", done, total)

    def on_start(self, counts: Counts, workers: int) -> None:
        """Report the number of months that are complete."""
        self._finished, self._total = counts.complete, counts.total
        self._report("months", self._finished, self._total)

    def on_result(self, record: VariantRecord) -> None:
        """Report one more month."""
        self._finished += 1
        self._report("months", self._finished, self._total)


def ignore_progress(phase: str, done: int, total: int) -> None:
    """Receive progress and do nothing."""


def interval(values: Iterable[float]) -> tuple[float, float, float]:
    """Return the mean of values and the ends of its 95 % interval.

    Example:
        >>> interval([0.5, 0.5, 0.5])
        (0.5, 0.5, 0.5)
    """
    mean = estimate(list(values))
    return mean.mean, mean.low, mean.high


LTP_GAP = "ltp-gap"
LTP_TITLE = "Fig. 7 left: gap of long-term presence by days"
ESTIMATOR = "likelihood"
BAND = (0.1, 0.9)
SHOWN_DAYS = (1, 3, 7, 14, 21, 30, 60)
LTP_NOTES = (
    "the paper's figure: gaps of the rooms that fall with the days, mean and band over 100 robot"
    " behaviors for one user and home; its numbers are not printed",
)

KINDS: tuple[dict[str, Any], ...] = (
    {"type": "patrol", "order": "random", "dwell": "10 min"},
    {"type": "hangout", "source": "ltp", "near": "room", "explore": 0.2},
    {"type": "patrol", "order": "random", "dwell": "20 min"},
    {"type": "hangout", "source": "ltp", "near": "path", "explore": 0.1},
    {"type": "patrol", "dwell": "30 min"},
    {"type": "hangout", "source": "ltp", "near": "path", "explore": 0.3, "period": "1 h"},
)

Gaps = dict[str, list[float]]
"""The gap of each room after each day, by room."""


def ltp_study(robots: int, days: int) -> dict[str, Any]:
    """Return the study: robots of even numbers patrol, robots of odd numbers hang out.

    Each has a name of its own, and so random draws of its own.
    """
    base = month(
        algorithms={"ltp": {"type": "long_term_presence", "estimator": ESTIMATOR, "period": "4 h"}},
        metrics={"gap": {"type": "ltp_gap", "of": "ltp", "period": "1 d"}},
        days=days,
    )
    options = {
        f"robot_{number}": {
            f"robots.robot_{number}": {"camera": CAMERA, **KINDS[number % len(KINDS)]}
        }
        for number in range(robots)
    }
    return {"base": base, "axes": {"robot": {"options": options}}, "keep": {"tables": ["gap"]}}


def gaps(study: "Study") -> list[Gaps]:
    """Return the gap of each room after each day, by robot."""
    rows = study.pandas("gap", columns=["variant", "step", "user", "room", "gap"])
    rows = rows[rows["user"] == USER].sort_values(["variant", "step"], kind="stable")
    return [
        {room: group["gap"].tolist() for room, group in robot_rows.groupby("room", sort=False)}
        for _, robot_rows in rows.groupby("variant")
    ]


def reproduce_ltp_gap(options: PaperOptions, on_progress: OnProgress) -> Result:
    """Measure how the estimate of long-term presence converges over the days.

    One person, one home, many robots: patrols of several kinds, and hangouts that use what they
    learned. Each robot has random draws of its own, and the person lives the same month with each.
    The gap of a room is the difference between its estimated and its true share of time at home so
    far. The result is the mean over robots, and the band that contains 80 % of them.
    """
    robots, days = options.size(100, 30, 4, 3)
    start_s = time.perf_counter()
    robot_gaps = gaps(run_study(LTP_GAP, ltp_study(robots, days), options, on_progress))
    duration_s = time.perf_counter() - start_s
    rooms = {room: np.array([each[room] for each in robot_gaps]) for room in robot_gaps[0]}
    means = {room: values.mean(axis=0) for room, values in rooms.items()}
    overall = np.mean(list(rooms.values()), axis=0)
    low, high = np.quantile(overall, BAND, axis=0)
    listed_days = [day for day in SHOWN_DAYS if day <= days]
    lines = {**means, "all rooms": overall.mean(axis=0), "  band, low": low, "  band, high": high}
    table = Table(
        f"mean |estimated - true| share of time at home; {counted(robots, 'robot')},"
        f" {counted(days, 'day')}, {ESTIMATOR}",
        ("room", *(f"day {day}" for day in listed_days)),
        tuple(
            (name, *(f"{line[day - 1]:.3f}" for day in listed_days)) for name, line in lines.items()
        ),
        (
            *LTP_NOTES,
            f"{robots * days} days of one home in {duration_s:.1f} s, {options.workers} at a time",
        ),
    )
    numbers = {
        "robots": robots,
        "days": days,
        "estimator": ESTIMATOR,
        "seconds": duration_s,
        "mean": {room: line.tolist() for room, line in means.items()},
        "all_rooms": {
            "mean": overall.mean(axis=0).tolist(), "low": low.tolist(), "high": high.tolist(),
        },
        "gaps": robot_gaps,
    }  # fmt: skip
    return Result(LTP_GAP, LTP_TITLE, (table,), numbers)


RTP_GAP = "rtp-gap"
RTP_TITLE = "Fig. 7 right: accuracy of real-time presence by last-seen gap"
MODELS = ("routine", "hmm", "semi_markov", "markov", "hour_of_week", "long_term")
NAIVE_GUESS = "naive"
SCORES = {"top_1": "share of right rooms", "log_loss": "log loss [nats], smaller is better"}
RTP_NOTES = (
    "the paper's figure: a model's accuracy above that of the naive guess, the more so the longer"
    " the user was out of sight; its numbers are not printed",
)

Scores = dict[str, dict[str, dict[str, float]]]
"""Scores of one life: by model, gap and name of the score."""
Means = dict[str, dict[str, dict[str, tuple[float, float, float]]]]
"""Means with the ends of their intervals: by name of the score, model and gap."""


def rtp_study(seeds: int, days: int) -> dict[str, Any]:
    """Return the study: one life for each seed, with all models; the patrol uses none of them."""
    base = month(
        {"type": "patrol", "order": "random", "dwell": "5 min"},
        algorithms={
            model: {"type": "real_time_presence", "model": model, "period": "1 h"}
            for model in MODELS
        },
        metrics={
            f"score_{model}": {"type": "rtp_score", "of": model, "period": "1 h"}
            for model in MODELS
        },
        days=days,
    )
    return {"base": base, "replicates": seeds, "keep": {"metrics": [f"score_*.{USER}.*"]}}


def scores(study: "Study") -> list[Scores]:
    """Return the scores of each life by model and gap, the naive guess as one more model."""
    return [_scores_of(row) for row in study.variants.to_dicts()]


def _scores_of(row: Mapping[str, Any]) -> Scores:
    of_model: Scores = {name: {} for name in (*MODELS, NAIVE_GUESS)}
    for model in MODELS:
        for gap in (*GAPS, ALL):
            prefix = f"score_{model}.{USER}.{gap}"
            if row.get(f"{prefix}.top_1") is not None:
                of_model[model][gap] = {score: row[f"{prefix}.{score}"] for score in SCORES}
    for gap in of_model[MODELS[0]]:
        prefix = f"score_{MODELS[0]}.{USER}.{gap}"
        of_model[NAIVE_GUESS][gap] = {score: row[f"{prefix}.naive_{score}"] for score in SCORES}
    return of_model


def means(lives: list[Scores]) -> Means:
    """Return the mean of each score over seeds, with its interval."""
    return {
        score: {
            name: {
                gap: interval(life[name][gap][score] for life in lives if gap in life[name])
                for gap in (*GAPS, ALL)
                if any(gap in life[name] for life in lives)
            }
            for name in (*MODELS, NAIVE_GUESS)
        }
        for score in SCORES
    }


def reproduce_rtp_gap(options: PaperOptions, on_progress: OnProgress) -> Result:
    """Measure how often the room of a user is right, by the time since the last sighting.

    Real-time presence by several models and by the naive guess (the room of the last sighting) is
    scored every minute: the share of right rooms, and the log loss, which is a proper score. The
    result is the mean over seeds with its bootstrap interval; each seed is a month of another life
    with a robot on patrol.
    """
    seeds, days = options.size(10, 30, 2, 3)
    lives = scores(run_study(RTP_GAP, rtp_study(seeds, days), options, on_progress))
    by_score = means(lives)
    tables = tuple(
        Table(
            f"{title}; {counted(seeds, 'seed')} of {counted(days, 'day')}",
            ("model", *GAPS, ALL),
            tuple(
                (name.replace("_", " "), *(_score(by_gap.get(gap)) for gap in (*GAPS, ALL)))
                for name, by_gap in by_score[score].items()
            ),
            RTP_NOTES if score == "top_1" else (),
        )
        for score, title in SCORES.items()
    )
    numbers = {"seeds": seeds, "days": days, "means": by_score, "scores": lives}
    return Result(RTP_GAP, RTP_TITLE, tables, numbers)


def _score(value: tuple[float, float, float] | None) -> str:
    return "" if value is None else f"{value[0]:.3f}"


FEEDBACK = "feedback"
FEEDBACK_TITLE = "The feedback loop: error of long-term presence by what the robot does"
NAIVE_ESTIMATOR = "sighting_share"
ESTIMATORS = (NAIVE_ESTIMATOR, "exposure_ratio", "audit_only", "likelihood", "fremen")
FEEDBACK_NOTES = (
    "the paper has no such table: it is what its figures of learning robots stand on",
)
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


def feedback_study(seeds: int, days: int) -> dict[str, Any]:
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
        name: {"robots.astro.behaviors": policy.robot(NAIVE_ESTIMATOR)["behaviors"]}
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


def reproduce_feedback(options: PaperOptions, on_progress: OnProgress) -> Result:
    """Measure the error of estimators when the robot acts on their estimates.

    Every estimator of long-term presence is measured under every policy of the robot with the same
    seeds. The error is the total variation distance between the estimate at the end and the true
    shares of time at home: mean and 95 % bootstrap interval over seeds, and the same of the
    difference to the naive estimator with each seed. A robot that hangs out uses the estimator of
    the column; with other policies all estimators watch the same robot.
    """
    seeds, days = options.size(30, 30, 2, 3)
    tv = errors(run_study(FEEDBACK, feedback_study(seeds, days), options, on_progress))
    size = f"{counted(seeds, 'paired seed')} of {counted(days, 'day')}"
    tables = (
        _error_table(
            f"total variation from the truth at the end; {size}: mean (95 %)",
            tv,
            ESTIMATORS,
            FEEDBACK_NOTES,
        ),
        _error_table(
            f"the same less that of {_words(NAIVE_ESTIMATOR)} on the same seed, smaller is better:"
            " mean (95 %)",
            differences(tv),
            ESTIMATORS[1:],
        ),
    )
    return Result(FEEDBACK, FEEDBACK_TITLE, tables, {"seeds": seeds, "days": days, "tv": tv})


def differences(tv: Errors) -> Errors:
    """Return the errors minus that of the naive estimator under the same policy and seed."""
    return {
        policy: {
            estimator: [
                error - naive for error, naive in zip(values, by[NAIVE_ESTIMATOR], strict=True)
            ]
            for estimator, values in by.items()
            if estimator != NAIVE_ESTIMATOR
        }
        for policy, by in tv.items()
    }


def _error_table(
    title: str, values: Errors, estimators: tuple[str, ...], notes: tuple[str, ...] = ()
) -> Table:
    return Table(
        title,
        ("robot", *map(_words, estimators)),
        tuple((policy, *(_error(by[e]) for e in estimators)) for policy, by in values.items()),
        notes,
    )


def _error(values: list[float]) -> str:
    mean, low, high = interval(values)
    return f"{mean:.3f} ({low:.3f} to {high:.3f})"


def _words(estimator: str) -> str:
    return estimator.replace("_", " ")
