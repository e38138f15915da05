"""Section V.A: the time of the paper's scenarios, beside the paper's own numbers.

Every row is measured in a process of its own on one core, `fleet2d run …`, which prepares the home,
simulates and stores the run; all of that counts. Rows that are watched draw the frames of a film,
in a process of their own, too. The paper's numbers are from its authors' machine, and show the
order of magnitude only.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from typing import Any

from fleet2d.configuration.documents import read_document
from fleet2d.configuration.problems import counted
from fleet2d.errors import InputError
from fleet2d.paper.results import PAPER_COLUMN, SPEED, PaperOptions, Result, table_of
from fleet2d.runtime.clock import HOUR_S
from fleet2d.studies.progress import progress_bar

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
    from fleet2d import run
    from fleet2d.pictures.floorplan import drawing_style
    from fleet2d.viewer.film import draw_frames, stage_of

    first = from_hour * HOUR_S
    end = first + count * period_s
    watched = run("bundled:paper", f"simulation.duration={end} s", seed=4)
    start_s = time.perf_counter()
    with drawing_style():
        stage = stage_of(watched, first, end, period_s)
        for _ in draw_frames(stage, first, stage.changes().nonzero()[0]):
            pass
    wall_s = {"draw": time.perf_counter() - start_s}
    return {"wall_s": wall_s, "simulated_s": count * period_s}


def read_table() -> dict[str, Any]:
    """Return the YAML beside this file: title, notes, rows."""
    return read_document(Path(__file__).with_suffix(".yaml")).data


def rows(options: PaperOptions, days: int) -> list[dict[str, Any]]:
    """Return the rows of the table, with all overrides of each.

    Raises:
        FloorPlanError: The map of `options` can't be read.
    """
    from fleet2d.floorplan.load import load_floorplan

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
