"""Section V.A: how long the paper's scenarios take, beside its own figures.

Every row is a process of its own on one core, `fleet2d run …`, that
stores the run, and builds whatever it needs of the home itself: set-up, simulating and saving
count. Rows that are watched are a process of their own, too. The paper's figures are from its
authors' machine: they tell the order of magnitude.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

from fleet2d.errors import InputError
from fleet2d.paper.months import Request, Tell
from fleet2d.paper.result import PAPER_COLUMN, Result, Table, counted
from fleet2d.paper.watched import FRAMES, Watching, watch

NAME = "speed"
TITLE = "Section V.A: time of the base scenario and its variants"
PHASES = ("setup", "simulate", "save")
CROWDS = (2, 5, 10, 20, 50)
SOME_CROWDS = (2, 5)  # of a quick one
NOT_TOLD = "–"
NOTES = (
    "the paper builds a cache of visibility once per home, 1 h for a HouseExpo plan and 6 h for a"
    " real one; here nothing is built beforehand",
    f"{NOT_TOLD}: no figure of the paper is known",
)


class Told(NamedTuple):
    """A figure of the paper, in words and as times real time, if that is known."""

    words: str
    speedup: float | None = None


UNKNOWN = Told(NOT_TOLD)
PAPER_BASE = Told("194 s: 45 load a prebuilt cache, 127 simulate; 13,000 x", 13_000)
PAPER_CROWDS = {50: Told("28 min, and all memory", 30 * 86_400 / (28 * 60))}
PAPER_WATCHED = Told("8 to 12 x", 10)
PAPER_CACHE = Told("6 h to build the cache")


@dataclass(frozen=True)
class Row:
    """A row of the table.

    Attributes:
        case: What runs.
        overrides: Changes to the bundled base scenario.
        paper: The paper's figure.
        watched: Simulated time between two frames; None: nobody watches.
    """

    case: str
    overrides: tuple[str, ...] = ()
    paper: Told = UNKNOWN
    watched: Watching | None = None


def rows(request: Request, days: int) -> list[Row]:
    """Return the rows; without a real map, its row is missing."""
    span = f"simulation.duration.days={days}"
    found = [
        Row("base: routine, presence, hangout", (span,), PAPER_BASE),
        Row(f"{2 * days} days", (f"simulation.duration.days={2 * days}",)),
        Row(
            "without robot algorithms",
            (
                span,
                "algorithms={}",
                "metrics={}",
                "robots.astro.behaviors=[{type: patrol, dwell: 10 min}]",
            ),
        ),
        Row("Flashlight", (span, "sight.method=flashlight")),
        Row("visibility polygons", (span, "sight.method=visibility_polygon"), PAPER_BASE),
    ]
    found += [
        Row(f"{count} users", (span, _people(count)), PAPER_CROWDS.get(count, UNKNOWN))
        for count in (SOME_CROWDS if request.quick else CROWDS)
    ]
    if request.map is not None:
        found.append(Row("real-world map", (span, *_home(request.map)), PAPER_CACHE))
    for watching in FRAMES:
        case = f"watched: a frame each {watching.words}"
        found.append(
            Row(case, (), PAPER_WATCHED, watching.shorter() if request.quick else watching)
        )
    return found


def _people(count: int) -> str:
    user = "{type: routine, persona: works_outside}"
    return "users={" + ", ".join(f"user_{i}: {user}" for i in range(count)) + "}"


def _home(path: Path) -> tuple[str, ...]:
    """Return the overrides by which a map is lived in.

    Raises:
        FloorPlanError: It can't be read.
    """
    from fleet2d.floorplan.load import load_floorplan

    load_floorplan(path)  # or says what is wrong with it
    kind = "ros" if path.suffix.lower() in (".yaml", ".yml") else "valetudo"
    return f"floorplan.type={kind}", f"floorplan.path={path.absolute()}"


def reproduce(request: Request, tell: Tell) -> Result:
    """Measure all rows, one process at a time."""
    runs, days = request.size(3, 30, 1, 2)
    cases, measured = rows(request, days), []
    with one_core():
        for number, row in enumerate(cases):
            tell(row.case, number, len(cases))
            measured.append(measure(row, runs))
        tell("rows", len(cases), len(cases))
    notes: tuple[str, ...] = NOTES
    if request.quick:
        notes += ("quick: short runs are mostly set-up",)
    if request.map is None:
        notes += ("a real-world map is left out: name one by --map (a ROS or a vacuum's map)",)
    table = Table(
        f"{counted(days, 'day')} with 1 user unless said otherwise; one core, median of"
        f" {counted(runs, 'run')}",
        ("scenario", "ours [s]", "process [s]", "x real time", "memory", PAPER_COLUMN),
        tuple(_cells(row, found) for row, found in zip(cases, measured, strict=True)),
        notes,
    )
    numbers = {
        "days": days,
        "runs": runs,
        "rows": [
            {
                "case": row.case,
                "paper": row.paper.words,
                "paper_speedup": row.paper.speedup,
                "overrides": list(row.overrides),
                **found,
            }
            for row, found in zip(cases, measured, strict=True)
        ],
    }
    return Result(NAME, TITLE, (table,), numbers)


def measure(row: Row, runs: int) -> dict[str, Any]:
    """Return what a row takes: seconds of each run, times of real time, and memory."""
    if row.watched is not None:
        try:
            seen = [_watch_once(row.watched) for _ in range(runs)]
        except InputError as error:
            return {"failed": str(error)}
        return {
            "frames": row.watched.frames,
            "seconds": [one["seconds"] for one in seen],
            "speedup": statistics.median(one["speedup"] for one in seen),
        }
    results = [run_once(row.overrides) for _ in range(runs)]
    failed = next((result["failed"] for result in results if "failed" in result), None)
    if failed is not None:
        return {"failed": failed}
    seconds = [sum(result["wall_s"][phase] for phase in PHASES) for result in results]
    memory = [result["peak_rss_mb"] for result in results if result["peak_rss_mb"] is not None]
    return {
        "seconds": seconds,
        "process_s": statistics.median(result["wall_s"]["total"] for result in results),
        "speedup": results[0]["simulated_s"] / statistics.median(seconds),
        "peak_mb": max(memory, default=None),
    }


def run_once(overrides: tuple[str, ...]) -> dict[str, Any]:
    """Run the base scenario with some changes in a process of its own; return what it says."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "fleet2d.cli", "run", *overrides, "--json", "--quiet"]
        done = subprocess.run(  # noqa: S603 - our own command
            [*command, "--out", str(Path(folder) / "run")],
            capture_output=True,
            text=True,
            check=False,
        )
    if done.returncode:
        return {"failed": done.stderr.strip().removeprefix("error: ")}
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def _watch_once(watching: Watching) -> dict[str, float]:
    """Watch in a process of its own."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(watch, watching).result()


@contextmanager
def one_core() -> Iterator[None]:
    """Keep this process, and those that it starts, on one core; where that can be asked for."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def _cells(row: Row, found: dict[str, Any]) -> tuple[str, ...]:
    if "failed" in found:
        return row.case, "failed", "", "", "", found["failed"]
    times, process, peak = found["seconds"], found.get("process_s"), found.get("peak_mb")
    middle = f"{statistics.median(times):.2f}"
    spread = f" ({min(times):.2f} to {max(times):.2f})" if len(times) > 1 else ""
    return (
        row.case,
        f"{found['frames']} frames in {middle}" if row.watched else middle + spread,
        "" if process is None else f"{process:.2f}",
        f"{found['speedup']:,.0f}",
        "" if peak is None else f"{peak:,.0f} MB",
        row.paper.words,
    )
