"""Measures the results of the paper again: speed, presence by days and by gap, the feedback loop.

    python examples/paper/reproduce.py [speed] [ltp-gap] [rtp-gap] [feedback] [--quick]
    python examples/paper/reproduce.py rtp-gap --logs data/activity   # of real people, too

It prints each table beside the paper's numbers, and writes numbers and pictures. Presence and the
feedback loop are studies, whose files stand beside this one. It needs the extras `study` and `viz`.
"""

import json
import math
import os
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from typing import Annotated, Any

import numpy as np
import polars as pl
import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from rich.console import Console
from rich.table import Table

import fleet2d
from fleet2d.configuration.documents import read_document
from fleet2d.configuration.problems import check_known, counted
from fleet2d.errors import ComponentError, Fleet2DError, InputError, os_errors_as
from fleet2d.floorplan.load import load_floorplan
from fleet2d.metrics.rtp_score import ALL, GAPS
from fleet2d.options import Workers
from fleet2d.runtime.clock import HOUR_S
from fleet2d.studies.answers import group_means
from fleet2d.studies.api import ExecutorName, study
from fleet2d.studies.executors import cores
from fleet2d.studies.figures import COLORS, DARK
from fleet2d.studies.intervals import UNLIMITED, Limits
from fleet2d.studies.progress import progress_bar
from fleet2d.studies.reader import Study
from fleet2d.viewing.film import draw_frames, stage_of
from fleet2d.viewing.pictures.floorplan import drawing_style, write_picture

USER = "ana"  # in all studies
PAPER_COLUMN = "the paper's"  # heading of the column of the paper's own figures
SPEED, LTP_GAP, RTP_GAP, FEEDBACK = RESULTS = ("speed", "ltp-gap", "rtp-gap", "feedback")
SIZES = {SPEED: (3, 30), LTP_GAP: (100, 30), RTP_GAP: (10, 14), FEEDBACK: (30, 30)}
"""The number of months of each kind (homes of rtp-gap) and their days, by result."""
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
        path = directory / f"{self.name}.json"
        content = {"result": self.title, "fleet2d": fleet2d.__version__, **self.numbers}
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
        logs: The folder of the logs of real people, for rtp-gap; see `LOGS`.
        folder: The folder of the studies.
    """

    quick: bool = False
    seeds: int | None = None
    days: int | None = None
    workers: int = 1
    map: Path | None = None
    logs: Path | None = None
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
    if "home" in content["axes"]:
        content["axes"]["home"]["synthetic"] = seeds
        return content
    axis = content["axes"]["robot"]
    kinds = [robot for (robot,) in map(dict.values, axis["options"].values())]
    robots = {f"robot_{number}": kinds[number % len(kinds)] for number in range(seeds)}
    axis["options"] = {name: {f"robots.{name}": robot} for name, robot in robots.items()}
    return content


def run_months(name: str, options: PaperOptions, content: Mapping[str, Any] | None = None) -> Study:
    """Run the study of a result and open it; an interrupted study in a folder continues.

    Args:
        name: The name of the result, and of the folder of its study.
        options: The size.
        content: The study, if it isn't the one in the file of that name.

    Raises:
        ComponentError: A month failed.
        InputError: polars or scipy is missing, or the folder can't be used.
    """
    content = content or study_content(name, *options.size(name))
    folder = options.folder / name
    executor: ExecutorName = "serial" if options.workers == 1 else "local"
    months = study(
        content, folder, workers=options.workers, executor=executor, fail_fast=True, changed="redo"
    )
    if months.counts.failed:
        raise ComponentError(f"a month failed: {months.failures['error'][0]}")
    return months


def estimates(
    rows: pl.DataFrame,
    row: str,
    column: str,
    by: Sequence[str] = (),
    limits: Limits = UNLIMITED,
) -> pl.DataFrame:
    """Return the mean of `value` with its 95 % interval by two columns of a frame, in its order.

    Args:
        rows: The frame.
        row: A column.
        column: Another one.
        by: Columns of the units over which intervals hold; none: each value is one.
        limits: The least and the largest value that there can be.

    Returns:
        A frame with the two columns, `mean`, `low`, `high`, and `doubt`, why there is no interval.
    """
    means = group_means(rows, "value", (row, column), by, limits)
    return means.select(row, column, "mean", "low", "high", "doubt")


def table_of_means(
    title: str, means: pl.DataFrame, columns: Iterable[str], text: str = "{:.3f}"
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
    stored = pl.DataFrame(months.arrow("gap").to_table())  # rooms in the order of the plan
    rows = stored.filter(user=USER).sort("variant", "step", maintain_order=True)
    rooms = rows["room"].unique(maintain_order=True).to_list()
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


SIMULATED, REAL = "simulated", "real logs"
LOG_HOMES, LOG_DAYS = 3, 9
LOGS: Mapping[str, Mapping[str, Any]] = {
    "casas_al": {"path": "casas_al/events_10_days.txt"},
    "uci_adl_a": {"path": "uci_adl_a"},
    "kasteren_a": {"path": "kasteren/kast_houseA-ss.txt"},
    "kasteren_c": {
        "path": "kasteren/kast_houseC-ss.txt",
        "rooms": {
            "keys": None,
            "sink top flush": "bathroom",
            "cabinet signs/herb reed": None,
            "table scraps containers reed": None,
        },
    },
}
"""The logs of real people by name, as keys of `replay`; paths in the folder that `--logs` names."""


def rtp_gap(options: PaperOptions) -> Result:
    """Measure how often the room of a user is right, by the time since the last sighting.

    Real-time presence by several models and by the naive guess (the room of the last sighting) is
    scored every minute: the share of right rooms, and the log loss, which is a proper score. The
    result is the mean over homes and people with its interval, for simulated people and, if there
    are some, for logs of real ones.
    """
    homes, days = options.size(RTP_GAP)
    months = run_months(RTP_GAP, options)
    text = "{:.2f} ({:.2f} to {:.2f})"
    parts = {SIMULATED: gap_scores(months)}
    if options.logs is not None:
        replayed = run_months(f"{RTP_GAP}-logs", options, logs_content(options))
        parts[REAL] = gap_scores(replayed)
    tables = []
    means: dict[str, dict[str, Any]] = {}
    for part, scores in parts.items():
        size = f"{part}: {scores['home'].n_unique()} homes x {scores['person'].n_unique()} people"
        means[part] = {}
        for score, title in SCORES.items():
            rows = scores.filter(score=score)
            limits = (0.0, 1.0 if score == "top_1" else math.inf)
            found = estimates(rows, "model", "gap", ("home", "person"), limits)
            tables.append(table_of_means(f"{title}; {size}", found, (*GAPS, ALL), text))
            means[part][score] = found.to_dicts()
    numbers = {
        "homes": homes,
        "days": days,
        "means": means,
        "scores": {part: scores.to_dicts() for part, scores in parts.items()},
    }
    return Result(RTP_GAP, months.meta.description, tables, numbers, (months.meta.notes,))


def logs_content(options: PaperOptions) -> dict[str, Any]:
    """Return the study in which real people's logs are replayed, each in some homes."""
    assert options.logs is not None
    folder = options.logs.absolute()
    homes, days = options.size(RTP_GAP)
    content = study_content(RTP_GAP, min(homes, LOG_HOMES), min(days, LOG_DAYS))
    content["name"] = f"{RTP_GAP}-logs"
    content["axes"]["person"] = {
        "population": True,
        "options": {
            name: {
                "users.ana": {
                    **log,
                    "type": "replay",
                    "path": str(folder / log["path"]),
                }
            }
            for name, log in LOGS.items()
        },
    }
    return content


def gap_scores(months: Study) -> pl.DataFrame:
    """Return the scores of each model and of the naive guess by gap, home and person."""
    pattern = rf"^score_(?<model>\w+)\.{USER}\.(?<gap>[^.]+)\.(?<naive>naive_)?(?<score>\w+)$"
    is_naive = pl.col("naive").is_not_null()
    return (
        months.variants.unpivot(pl.selectors.starts_with("score_"), index=["home", "person"])
        .with_columns(pl.col("variable").str.extract_groups(pattern))
        .unnest("variable")
        .filter(pl.col("score").is_in(list(SCORES)) & pl.col("value").is_not_null())
        .filter(~is_naive | (pl.col("model") == NAIVE_SOURCE))
        .sort(is_naive, maintain_order=True)
        .with_columns(model=pl.when(is_naive).then(pl.lit(NAIVE_GUESS)).otherwise("model"))
        .select("score", "home", "person", "model", "gap", "value")
    )


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


def differences(errors: pl.DataFrame) -> pl.DataFrame:
    """Return the errors minus that of the naive estimator under the same policy and seed."""
    is_naive = pl.col("estimator") == NAIVE_ESTIMATOR
    naive = pl.col("value").filter(is_naive).first().over("robot", "seed")
    return errors.with_columns(pl.col("value") - naive).filter(~is_naive)


# --- Speed, section V.A -------------------------------------------------------------------------
#
# Every row is measured in a process of its own on one core, `fleet2d run …`, which prepares the
# home, simulates and stores the run; all of that counts. Rows that are watched draw the frames of
# a film, in a process of their own, too. The paper's numbers are from its authors' machine, and
# show the order of magnitude only.

REAL_MAP = "real-world map"  # the row of the user's own map
PHASES = ("setup", "simulate", "save", "draw")
QUICK_FRAMES = 100
NO_NUMBER = "–"


def time_frames(period_s: int, count: int, from_hour: int = 0) -> dict[str, Any]:
    """Draw frames of a film of the base scenario; return its wall and simulated time, as a run's.

    The run that is watched is simulated before, which doesn't count.

    Args:
        period_s: The simulated time between two frames [s].
        count: The number of frames.
        from_hour: The hour of the first day at which they start.
    """
    first = from_hour * HOUR_S
    end = first + count * period_s
    watched = fleet2d.run("bundled:paper", f"simulation.duration={end} s", seed=4)
    start_s = time.perf_counter()
    with drawing_style():
        stage = stage_of(watched, first, end, period_s)
        for _ in draw_frames(stage, first, stage.changes().nonzero()[0]):
            pass
    wall_s = {"draw": time.perf_counter() - start_s}
    return {"wall_s": wall_s, "simulated_s": count * period_s}


def read_table() -> dict[str, Any]:
    """Return the table of speeds: title, notes, rows."""
    return read_document(Path(__file__).with_name("speed.yaml")).data


def rows(options: PaperOptions, days: int) -> list[dict[str, Any]]:
    """Return the rows of the table, with all overrides of each.

    Raises:
        FloorPlanError: The map of `options` can't be read.
    """
    cases: list[dict[str, Any]] = []
    for row in read_table()["rows"]:
        is_real = row["case"] == REAL_MAP
        frames = row.get("frames")
        users = row.get("users")
        if (is_real and options.map is None) or (options.quick and not row.get("quick", True)):
            continue
        overrides = [] if frames else [f"simulation.duration.days={row.get('months', 1) * days}"]
        overrides += row.get("overrides", [])
        if users:
            user = "{type: routine, persona: works_outside}"
            overrides.append(f"users={{{', '.join(f'user_{i}: {user}' for i in range(users))}}}")
        if is_real and options.map is not None:
            load_floorplan(options.map)  # raises an error before any row is measured
            kind = "ros" if options.map.suffix.lower() in (".yaml", ".yml") else "valetudo"
            overrides += [f"floorplan.type={kind}", f"floorplan.path={options.map.absolute()}"]
        if frames and options.quick:
            frames["count"] = QUICK_FRAMES
        case = row["case"].format(days=row.get("months", 1) * days)
        cases.append({"paper": NO_NUMBER, **row, "case": case, "overrides": overrides})
    return cases


def measure_rows(options: PaperOptions) -> Result:
    """Measure all rows, one process at a time."""
    runs, days = options.size(SPEED)
    content = read_table()
    cases = rows(options, days)
    with _one_core(), progress_bar(show=sys.stderr.isatty()) as progress:
        shown = progress.track(cases, description=SPEED)
        measured = [{**row, **measure(row, runs)} for row in shown]
    notes = content["notes"]
    if options.quick:
        notes.append("quick: short runs are mostly set-up")
    if options.map is None:
        notes.append("a real-world map is left out: name one by --map (a ROS or a vacuum's map)")
    table = table_of(
        f"{counted(days, 'day')} with 1 user, if not stated otherwise; one core, median of"
        f" {counted(runs, 'run')}",
        ("scenario", "ours [s]", "process [s]", "x real time", "memory", PAPER_COLUMN),
        map(_cells, measured),
    )
    numbers = {"days": days, "runs": runs, "rows": measured}
    return Result(SPEED, content["description"], (table,), numbers, notes)


def measure(row: Mapping[str, Any], runs: int) -> dict[str, Any]:
    """Measure a row: the seconds of each run, simulated over wall time, and memory [MB]."""
    try:
        if "frames" in row:
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                results = [pool.submit(time_frames, **row["frames"]).result() for _ in range(runs)]
        else:
            results = [run_once(row["overrides"]) for _ in range(runs)]
    except InputError as error:
        return {"failed": str(error)}
    seconds = [sum(result["wall_s"].get(phase, 0) for phase in PHASES) for result in results]
    measured = {"seconds": seconds, "speedup": results[0]["simulated_s"] / median(seconds)}
    if "frames" not in row:
        measured["process_s"] = median(result["wall_s"]["total"] for result in results)
        memory = filter(None, (result["peak_rss_mb"] for result in results))
        measured["peak_mb"] = max(memory, default=None)
    return measured


def run_once(overrides: list[str]) -> dict[str, Any]:
    """Run the base scenario with changes in a process of its own; return its summary.

    Raises:
        InputError: The run failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "fleet2d.cli", "run", *overrides, "--json", "--quiet"]
        command += ["--out", str(Path(folder) / "run")]
        process = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    if process.returncode:
        raise InputError(process.stderr.strip().removeprefix("error: "))
    return json.loads(process.stdout)


@contextmanager
def _one_core() -> Iterator[None]:
    """Pin this process and its children to one core, on systems that can."""
    cores = os.sched_getaffinity(0) if hasattr(os, "sched_setaffinity") else set()
    if cores:
        os.sched_setaffinity(0, {min(cores)})
    try:
        yield
    finally:
        if cores:
            os.sched_setaffinity(0, cores)


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    if "failed" in row:
        return row["case"], "failed", "", "", "", row["failed"]
    times = row["seconds"]
    peak = row.get("peak_mb")
    middle = f"{median(times):.2f}"
    spread = f" ({min(times):.2f} to {max(times):.2f})" if len(times) > 1 else ""
    return (
        row["case"],
        f"{row['frames']['count']} frames in {middle}" if "frames" in row else middle + spread,
        f"{row['process_s']:.2f}" if "process_s" in row else "",
        f"{row['speedup']:,.0f}",
        "" if peak is None else f"{peak:,.0f} MB",
        row["paper"],
    )


# --- Pictures -----------------------------------------------------------------------------------

DPI = 150
SIZE = (8.4, 4.4)
PALE = "#b9bec6"
DRAWN_GAPS = GAPS[:-1]  # without `never seen`, which is no time
ROOMS = 6  # with the largest gaps, which get a colour and a name; other rooms are pale


def draw(result: Result, path: Path) -> None:
    """Draw a result to a file; the same numbers give the same bytes.

    Raises:
        InputError: The name ends with neither `.png` nor `.svg`, or the file can't be written.
    """
    write_picture(path, lambda: DRAWERS[result.name](result.numbers))


def _figure() -> tuple[Figure, Axes]:
    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    axes = figure.subplots()
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def draw_speed(numbers: Mapping[str, Any]) -> Figure:
    """Draw the speed of each row in times real time."""
    figure, axes = _figure()
    rows = [row for row in numbers["rows"] if "speedup" in row][::-1]
    speedups = [row["speedup"] for row in rows]
    positions = np.arange(len(rows))
    axes.barh(positions, speedups, 0.62, color=COLORS[1])
    for y, value in zip(positions, speedups, strict=True):
        axes.text(value * 1.12, float(y), f"{value:,.0f}", va="center", fontsize=8, color=DARK)
    axes.set_yticks(positions, [row["case"] for row in rows], fontsize=8)
    axes.set(xlabel="times real time", xscale="log", xlim=(1, max(speedups) * 8))
    pairs = zip(rows, positions, strict=True)
    markers = [(row["paper_speedup"], y) for row, y in pairs if "paper_speedup" in row]
    axes.plot(
        *zip(*markers, strict=True), "D", ms=5, color=COLORS[0], label="the paper's", ls="none"
    )
    axes.legend(frameon=False, fontsize=8, loc="upper right", bbox_to_anchor=(1, 1.06))
    return figure


def draw_ltp_gap(numbers: Mapping[str, Any]) -> Figure:
    """Draw the gap of each room over days, and of all rooms with their band over robots."""
    figure, axes = _figure()
    days = np.arange(1, numbers["days"] + 1)
    by_size = sorted(numbers["mean"].items(), key=lambda item: -float(np.mean(item[1])))
    for number, (room, line) in enumerate(by_size):
        is_large = number < ROOMS
        color = COLORS[number] if is_large else PALE
        label = room if is_large else ("other rooms" if number == ROOMS else None)
        axes.plot(days, line, lw=1.1, color=color, label=label, zorder=3 if is_large else 2)
    overall = numbers["all_rooms"]
    label = f"all rooms, band of 80 % of {numbers['robots']} robots"
    axes.fill_between(days, overall["low"], overall["high"], color=DARK, alpha=0.18, lw=0, zorder=1)
    axes.plot(days, overall["mean"], lw=2.2, color=DARK, label=label, zorder=4)
    axes.set(xlabel="day", ylabel="|estimated − true| share of time at home")
    axes.set(xlim=(1, max(2, numbers["days"])), ylim=(0, None))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(frameon=False, fontsize=8)
    return figure


HIGHEST_LOSS = 3.0  # of the figure [nats]: that of the naive guess leaves it


def draw_rtp_gap(numbers: Mapping[str, Any]) -> Figure:
    """Draw the share of right rooms and the log loss by gap, with intervals."""
    parts = numbers["means"]
    figure = Figure(figsize=(11, 4.4 * len(parts)), dpi=DPI, layout="constrained")
    grid = figure.subplots(len(parts), len(SCORES), squeeze=False)
    for panels, (part, scores) in zip(grid, parts.items(), strict=True):
        for axes, (score, title) in zip(panels, SCORES.items(), strict=True):
            rows = pl.DataFrame(scores[score]).filter(pl.col("gap").is_in(DRAWN_GAPS))
            models = rows.partition_by("model", as_dict=True, maintain_order=True)
            for number, ((model,), own) in enumerate(models.items()):
                mean, low, high = own.select("mean", "low", "high").to_numpy().T
                x = [DRAWN_GAPS.index(gap) + 0.07 * (number - 3) for gap in own["gap"]]
                ends = np.nan_to_num((mean - low, high - mean))
                axes.errorbar(
                    x, mean, ends, marker="o", ms=4, lw=1.2, label=_words(model),
                    color=DARK if model == NAIVE_GUESS else COLORS[number],
                )  # fmt: skip
            axes.set_xticks(range(len(DRAWN_GAPS)), DRAWN_GAPS, fontsize=8)
            axes.set(title=part, ylabel=title, xlabel="time since the user was last seen")
            axes.set_ylim(0, 1 if score == "top_1" else HIGHEST_LOSS)
            axes.spines[["top", "right"]].set_visible(False)
    grid[0, 0].legend(frameon=False, fontsize=8)
    return figure


def draw_feedback(numbers: Mapping[str, Any]) -> Figure:
    """Draw the mean errors of estimators under each policy, with intervals."""
    figure, axes = _figure()
    estimators = pl.DataFrame(numbers["means"]).partition_by("estimator", maintain_order=True)
    for number, of in enumerate(estimators):
        x = np.arange(len(of)) + 0.16 * (number - (len(estimators) - 1) / 2)
        mean, low, high = of.select("mean", "low", "high").to_numpy().T
        label = of["estimator"][0].replace("_", " ")
        ends = (mean - low, high - mean)
        axes.bar(x, mean, 0.15, yerr=ends, color=COLORS[number], label=label, ecolor=DARK)
    policies = [textwrap.fill(name, 18) for name in estimators[0]["robot"]]
    axes.set_xticks(range(len(policies)), policies, fontsize=8)
    axes.set(ylabel="total variation from the truth", ylim=(0, None))
    axes.legend(frameon=False, fontsize=8, ncols=2)
    return figure


# --- The command --------------------------------------------------------------------------------

WIDTH = 200  # of lines in a file [characters]
MEASURES: Mapping[str, Callable[[PaperOptions], Result]] = {
    SPEED: measure_rows,
    LTP_GAP: ltp_gap,
    RTP_GAP: rtp_gap,
    FEEDBACK: feedback,
}
DRAWERS: Mapping[str, Callable[[Mapping[str, Any]], Figure]] = {
    SPEED: draw_speed,
    LTP_GAP: draw_ltp_gap,
    RTP_GAP: draw_rtp_gap,
    FEEDBACK: draw_feedback,
}


def reproduce(
    results: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[speed|ltp-gap|rtp-gap|feedback]...",
            help="Results to measure; left out: all four.",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Directory for numbers and pictures.")] = Path("paper"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Small versions: all in about a minute.")
    ] = False,
    seeds: Annotated[
        int | None,
        typer.Option(min=1, help="Months of each kind: seeds, robots of ltp-gap, runs of speed."),
    ] = None,
    days: Annotated[int | None, typer.Option(min=1, help="Days of a month.")] = None,
    workers: Workers = None,
    real_map: Annotated[
        Path | None,
        typer.Option("--map", help="A real home, for speed: a ROS map's YAML file, or a vacuum's."),
    ] = None,
    logs: Annotated[
        Path | None,
        typer.Option(help="The folder of real people's logs, for rtp-gap: see LOGS in this file."),
    ] = None,
) -> None:
    """Repeat the measurements of the paper, and print them beside its figures."""
    for name in results or ():
        check_known(name, "result", MEASURES, InputError)
    options = PaperOptions(quick, seeds, days, workers or cores(), real_map, logs, out / "studies")
    with os_errors_as(InputError, f"{out} can't be created", "; name another directory by --out"):
        out.mkdir(parents=True, exist_ok=True)  # an error is shown before hours of work
    width = None if sys.stdout.isatty() else WIDTH
    console = Console(soft_wrap=True, width=width, highlight=False, markup=False)
    for name in [name for name in RESULTS if name in (results or RESULTS)]:
        result = MEASURES[name](options)
        console.print(f"\n{result.title}")
        for table in result.tables:
            console.print(table)
        for note in result.notes:
            console.print(f"note: {note}")
        typer.echo(result.save(out))
        picture = out / f"{name}.png"
        draw(result, picture)
        typer.echo(picture)


def main() -> None:
    """Run the command; an error of the input is one line."""
    try:
        typer.run(reproduce)
    except Fleet2DError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
