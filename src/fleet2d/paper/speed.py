"""Section V.A: the time of the paper's scenarios, beside the paper's own numbers.

Every row is measured in a process of its own on one core, `fleet2d run …`, which prepares the home,
simulates and stores the run; all of that counts. Rows that draw frames are processes of their own,
too. The paper's numbers are from its authors' machine, and show the order of magnitude only.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fleet2d.errors import InputError, extra
from fleet2d.paper.months import PAPER_COLUMN, OnProgress, PaperOptions, Result, Table, counted
from fleet2d.runtime.clock import DAY_S

if TYPE_CHECKING:
    from fleet2d.engine.simulation import Simulation
    from fleet2d.kernels import F64, U8


SECONDS_PER_HOUR = 3600


@dataclass(frozen=True)
class FrameSeries:
    """The frames of the bundled base scenario to draw.

    Attributes:
        unit: The simulated time between two frames, as a noun.
        period_s: The same [s].
        count: The number of frames.
        from_hour: The hour of the first day at which they start.
    """

    unit: str
    period_s: int
    count: int
    from_hour: int = 0

    def shorter(self) -> "FrameSeries":
        """Return the series with 100 frames."""
        return replace(self, count=100)


# An evening hour, second by second; and two days, minute by minute.
FRAMES = (FrameSeries("second", 1, 3600, from_hour=18), FrameSeries("minute", 60, 2880))


class LiveView:
    """Pictures of the home with everybody in it, at the current step of a simulation.

    There is no window: a frame is an array of pixels. The floor plan is drawn once and stored as
    pixels; a frame copies it, and draws the bodies and what the robots see on it.

    Example:
        >>> from fleet2d.engine.simulation import Simulation
        >>> simulation = Simulation("bundled:base", "simulation.duration=1 h", seed=4)
        >>> view = LiveView(simulation, width=320)
        >>> simulation.advance(60)
        >>> view.frame().shape[1:]
        (320, 4)
    """

    def __init__(self, simulation: "Simulation", width: int = 960) -> None:
        """Draw the floor plan.

        Args:
            simulation: The simulation to draw.
            width: The width of the picture [pixels].

        Raises:
            InputError: matplotlib is missing.
        """
        with extra("viz", "drawing needs matplotlib"):
            from matplotlib.backends.backend_agg import FigureCanvasAgg
            from matplotlib.figure import Figure
        from fleet2d.pictures.floorplan import figure_size, floorplan_axes

        self.simulation = simulation
        plan = simulation.home.plan
        size = figure_size(plan)
        figure = Figure(figsize=size, dpi=width / size[0])
        self._canvas: Any = FigureCanvasAgg(figure)
        self._axes: Any = figure.add_axes((0, 0, 1, 1))
        floorplan_axes(plan, self._axes, title=False)
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(figure.bbox)
        self._add_bodies()

    def _add_bodies(self) -> None:
        from matplotlib.patches import Circle, Polygon

        from fleet2d.palette import ROBOT_COLORS, USER_COLORS, VIEW_COLOR

        scenario = self.simulation.scenario
        self._robots = [name for name in scenario.robots if scenario.robots[name].camera]
        self._bodies, self._views = {}, {}
        for bucket, colors in ((scenario.users, USER_COLORS), (scenario.robots, ROBOT_COLORS)):
            for number, (name, entity) in enumerate(bucket.items()):
                color = colors[number % len(colors)]
                radius = max(float(entity.radius), 0.13)
                self._bodies[name] = Circle((0, 0), radius, fc=color, ec="white", lw=0.9)
        for name in self._robots:
            self._views[name] = Polygon(np.zeros((3, 2)), fc=VIEW_COLOR, ec="none", alpha=0.5)
        for artist in (*self._views.values(), *self._bodies.values()):
            artist.set_animated(True)
            self._axes.add_patch(artist)
        self._poses: dict[str, tuple[float, float, float]] = {}

    def frame(self) -> "U8":
        """Return the picture of the current step: RGBA, uint8 (height, width, 4)."""
        self._canvas.restore_region(self._background)
        state = self.simulation.state
        for name, view in self._views.items():
            robot = state[name]
            pose = (robot["x"], robot["y"], robot["heading"])
            if self._poses.get(name) != pose:  # the region changes with the pose only
                self._poses[name] = pose
                view.set_xy(self._outline(name, *pose))
            if not robot["away"]:
                self._axes.draw_artist(view)
        for name, body in self._bodies.items():
            if not state[name]["away"]:
                body.center = (state[name]["x"], state[name]["y"])
                self._axes.draw_artist(body)
        return np.asarray(self._canvas.buffer_rgba())

    def _outline(self, name: str, x: float, y: float, heading: float) -> "F64":
        """Return the outline of the largest visible part, float64 (n, 2) [m]."""
        import shapely

        from fleet2d.pictures.life import SightWalls, field_of_view

        home = self.simulation.home
        camera = self.simulation.scenario.robots[name].camera
        assert camera is not None
        lens = {"range": camera.range, "angle_deg": camera.angle_deg}
        region = field_of_view(SightWalls.of(home), np.array([x, y]), heading, lens)
        parts = shapely.get_parts(region).tolist()
        if not parts:
            return np.zeros((3, 2))
        largest = max(parts, key=lambda part: float(part.area))
        return shapely.get_coordinates(largest.exterior)


def time_frames(series: FrameSeries) -> dict[str, float]:
    """Draw frames of the base scenario; return the wall time and simulated over wall time.

    Set-up and simulated time before the first frame don't count.
    """
    from fleet2d.engine.simulation import Simulation

    duration_s = series.from_hour * SECONDS_PER_HOUR + series.count * series.period_s
    simulation = Simulation("bundled:base", f"simulation.duration={max(duration_s, 60)} s", seed=4)
    simulation.advance(series.from_hour * SECONDS_PER_HOUR)
    view = LiveView(simulation)
    view.frame()
    start_s = time.perf_counter()
    for _ in range(series.count):
        simulation.advance(series.period_s)
        view.frame()
    seconds = time.perf_counter() - start_s
    simulation.finish("interrupted")
    return {"seconds": seconds, "speedup": series.count * series.period_s / seconds}


NAME = "speed"
TITLE = "Section V.A: time of the base scenario and its variants"
PHASES = ("setup", "simulate", "save")
CROWDS = (2, 5, 10, 20, 50)
QUICK_CROWDS = (2, 5)
NO_NUMBER = "–"
NOTES = (
    "the paper builds a cache of visibility once per home, 1 h for a HouseExpo plan and 6 h for a"
    " real one; here nothing is built beforehand",
    f"{NO_NUMBER}: the paper has no number",
)


class PaperNumber(NamedTuple):
    """A number quoted from the paper.

    Attributes:
        text: The quotation.
        speedup: Simulated time over wall time, if the paper gives it.
    """

    text: str
    speedup: float | None = None


UNKNOWN = PaperNumber(NO_NUMBER)
PAPER_BASE = PaperNumber("194 s: 45 load a prebuilt cache, 127 simulate; 13,000 x", 13_000)
PAPER_CROWDS = {50: PaperNumber("28 min, and all memory", 30 * DAY_S / (28 * 60))}
PAPER_WATCHED = PaperNumber("8 to 12 x", 10)
PAPER_CACHE = PaperNumber("6 h to build the cache")


@dataclass(frozen=True)
class SpeedRow:
    """A row of the table of speeds: a scenario to time, and the paper's number for it.

    Attributes:
        case: The name of the scenario.
        overrides: Changes of the bundled base scenario.
        paper: The paper's number.
        frames: The frames to draw while it runs, as if watched; None: none.
    """

    case: str
    overrides: tuple[str, ...] = ()
    paper: PaperNumber = UNKNOWN
    frames: FrameSeries | None = None


def rows(options: PaperOptions, days: int) -> list[SpeedRow]:
    """Return the rows of the table; the row of a real map is there if `options` name a map."""
    span = f"simulation.duration.days={days}"
    cases = [
        SpeedRow("base: routine, presence, hangout", (span,), PAPER_BASE),
        SpeedRow(f"{2 * days} days", (f"simulation.duration.days={2 * days}",)),
        SpeedRow(
            "without robot algorithms",
            (
                span,
                "algorithms={}",
                "metrics={}",
                "robots.astro.behaviors=[{type: patrol, dwell: 10 min}]",
            ),
        ),
        SpeedRow("Flashlight", (span, "sight.method=flashlight")),
        SpeedRow("visibility polygons", (span, "sight.method=visibility_polygon"), PAPER_BASE),
    ]
    cases += [
        SpeedRow(f"{count} users", (span, _people(count)), PAPER_CROWDS.get(count, UNKNOWN))
        for count in (QUICK_CROWDS if options.quick else CROWDS)
    ]
    if options.map is not None:
        cases.append(SpeedRow("real-world map", (span, *_home(options.map)), PAPER_CACHE))
    for series in FRAMES:
        case = f"watched: a frame each {series.unit}"
        frames = series.shorter() if options.quick else series
        cases.append(SpeedRow(case, (), PAPER_WATCHED, frames))
    return cases


def _people(count: int) -> str:
    user = "{type: routine, persona: works_outside}"
    return "users={" + ", ".join(f"user_{i}: {user}" for i in range(count)) + "}"


def _home(path: Path) -> tuple[str, ...]:
    """Return the overrides that set a map as the floor plan.

    Raises:
        FloorPlanError: The map can't be read.
    """
    from fleet2d.floorplan.load import load_floorplan

    load_floorplan(path)  # raises an error before any row is measured
    kind = "ros" if path.suffix.lower() in (".yaml", ".yml") else "valetudo"
    return f"floorplan.type={kind}", f"floorplan.path={path.absolute()}"


def reproduce(options: PaperOptions, on_progress: OnProgress) -> Result:
    """Measure all rows, one process at a time."""
    runs, days = options.size(3, 30, 1, 2)
    cases, results = rows(options, days), []
    with one_core():
        for number, row in enumerate(cases):
            on_progress(row.case, number, len(cases))
            results.append(measure(row, runs))
        on_progress("rows", len(cases), len(cases))
    notes: tuple[str, ...] = NOTES
    if options.quick:
        notes += ("quick: short runs are mostly set-up",)
    if options.map is None:
        notes += ("a real-world map is left out: name one by --map (a ROS or a vacuum's map)",)
    table = Table(
        f"{counted(days, 'day')} with 1 user, if not stated otherwise; one core, median of"
        f" {counted(runs, 'run')}",
        ("scenario", "ours [s]", "process [s]", "x real time", "memory", PAPER_COLUMN),
        tuple(_cells(row, result) for row, result in zip(cases, results, strict=True)),
        notes,
    )
    numbers = {
        "days": days,
        "runs": runs,
        "rows": [
            {
                "case": row.case,
                "paper": row.paper.text,
                "paper_speedup": row.paper.speedup,
                "overrides": list(row.overrides),
                **result,
            }
            for row, result in zip(cases, results, strict=True)
        ],
    }
    return Result(NAME, TITLE, (table,), numbers)


def measure(row: SpeedRow, runs: int) -> dict[str, Any]:
    """Measure a row: the seconds of each run, simulated over wall time, and memory [MB]."""
    if row.frames is not None:
        try:
            timings = [_draw_once(row.frames) for _ in range(runs)]
        except InputError as error:
            return {"failed": str(error)}
        return {
            "frames": row.frames.count,
            "seconds": [timing["seconds"] for timing in timings],
            "speedup": statistics.median(timing["speedup"] for timing in timings),
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
    """Run the base scenario with changes in a process of its own; return its summary."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "fleet2d.cli", "run", *overrides, "--json", "--quiet"]
        process = subprocess.run(  # noqa: S603 - our own command
            [*command, "--out", str(Path(folder) / "run")],
            capture_output=True,
            text=True,
            check=False,
        )
    if process.returncode:
        return {"failed": process.stderr.strip().removeprefix("error: ")}
    return json.loads(process.stdout)


def _draw_once(series: FrameSeries) -> dict[str, float]:
    """Time the frames in a process of its own."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(time_frames, series).result()


@contextmanager
def one_core() -> Iterator[None]:
    """Pin this process and its children to one core, on systems that can."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


def _cells(row: SpeedRow, result: dict[str, Any]) -> tuple[str, ...]:
    if "failed" in result:
        return row.case, "failed", "", "", "", result["failed"]
    times, process, peak = result["seconds"], result.get("process_s"), result.get("peak_mb")
    middle = f"{statistics.median(times):.2f}"
    spread = f" ({min(times):.2f} to {max(times):.2f})" if len(times) > 1 else ""
    return (
        row.case,
        f"{result['frames']} frames in {middle}" if row.frames else middle + spread,
        "" if process is None else f"{process:.2f}",
        f"{result['speedup']:,.0f}",
        "" if peak is None else f"{peak:,.0f} MB",
        row.paper.text,
    )
