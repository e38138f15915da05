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
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.configuration.documents import read_document
from fleet2d.errors import InputError, extra
from fleet2d.paper.results import PAPER_COLUMN, SPEED, PaperOptions, Result, Table, counted
from fleet2d.runtime.clock import HOUR_S
from fleet2d.studies.progress import progress_bar

if TYPE_CHECKING:
    from fleet2d.engine.simulation import Simulation
    from fleet2d.kernels import F64, U8


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


def time_frames(period_s: int, count: int, from_hour: int = 0) -> dict[str, float]:
    """Draw frames of the base scenario; return the wall time and simulated over wall time.

    Set-up and simulated time before the first frame don't count.

    Args:
        period_s: The simulated time between two frames [s].
        count: The number of frames.
        from_hour: The hour of the first day at which they start.
    """
    from fleet2d.engine.simulation import Simulation

    duration_s = from_hour * HOUR_S + count * period_s
    simulation = Simulation("bundled:base", f"simulation.duration={max(duration_s, 60)} s", seed=4)
    simulation.advance(from_hour * HOUR_S)
    view = LiveView(simulation)
    view.frame()
    start_s = time.perf_counter()
    for _ in range(count):
        simulation.advance(period_s)
        view.frame()
    seconds = time.perf_counter() - start_s
    simulation.finish("interrupted")
    return {"seconds": seconds, "speedup": count * period_s / seconds}


TITLE = "Section V.A: time of the base scenario and its variants"
REAL_MAP = "real-world map"  # the row of the user's own map
PHASES = ("setup", "simulate", "save")
QUICK_FRAMES = 100
NO_NUMBER = "–"
NOTES = (
    "the paper builds a cache of visibility once per home, 1 h for a HouseExpo plan and 6 h for a"
    " real one; here nothing is built beforehand",
    f"{NO_NUMBER}: the paper has no number",
)


@dataclass(frozen=True)
class SpeedRow:
    """A row of the table of speeds: a scenario to time, and what the paper says of it.

    Attributes:
        case: The name of the scenario.
        overrides: Changes of the bundled base scenario.
        paper: The quotation from the paper.
        paper_speedup: Simulated time over wall time, if the paper has a number for it.
        frames: The arguments of `time_frames` for a home that is watched; None: unwatched.
    """

    case: str
    overrides: tuple[str, ...] = ()
    paper: str = NO_NUMBER
    paper_speedup: float | None = None
    frames: Mapping[str, int] | None = None


def rows(options: PaperOptions, days: int) -> list[SpeedRow]:
    """Return the rows of the table; the row of a real map is there if `options` name a map."""
    cases = []
    for row in read_document(Path(__file__).with_suffix(".yaml")).data["rows"]:
        months, users, frames = row.pop("months", 1), row.pop("users", None), row.get("frames")
        is_missing = row["case"] == REAL_MAP and options.map is None
        if is_missing or (not row.pop("quick", True) and options.quick):
            continue
        if frames and options.quick:
            frames["count"] = QUICK_FRAMES
        overrides = [] if frames else [f"simulation.duration.days={months * days}"]
        overrides += row.pop("overrides", [])
        if users:
            user = "{type: routine, persona: works_outside}"
            overrides.append(f"users={{{', '.join(f'user_{i}: {user}' for i in range(users))}}}")
        if row["case"] == REAL_MAP and options.map is not None:
            overrides += _home(options.map)
        case = row.pop("case").format(days=months * days)
        cases.append(SpeedRow(case, tuple(overrides), **row))
    return cases


def _home(path: Path) -> tuple[str, ...]:
    """Return the overrides that set a map as the floor plan.

    Raises:
        FloorPlanError: The map can't be read.
    """
    from fleet2d.floorplan.load import load_floorplan

    load_floorplan(path)  # raises an error before any row is measured
    kind = "ros" if path.suffix.lower() in (".yaml", ".yml") else "valetudo"
    return f"floorplan.type={kind}", f"floorplan.path={path.absolute()}"


def measure_rows(options: PaperOptions) -> Result:
    """Measure all rows, one process at a time."""
    runs, days = options.size(SPEED)
    cases, results = rows(options, days), []
    with _one_core(), progress_bar(show=sys.stderr.isatty()) as progress:
        task = progress.add_task(SPEED, total=len(cases)) if progress else None
        for row in cases:
            results.append(measure(row, runs))
            if progress and task is not None:
                progress.advance(task)
    notes = [*NOTES]
    if options.quick:
        notes.append("quick: short runs are mostly set-up")
    if options.map is None:
        notes.append("a real-world map is left out: name one by --map (a ROS or a vacuum's map)")
    table = Table(
        f"{counted(days, 'day')} with 1 user, if not stated otherwise; one core, median of"
        f" {counted(runs, 'run')}",
        ("scenario", "ours [s]", "process [s]", "x real time", "memory", PAPER_COLUMN),
        [_cells(row, result) for row, result in zip(cases, results, strict=True)],
        notes,
    )
    described = [{k: v for k, v in asdict(row).items() if k != "frames"} for row in cases]
    measured = [{**row, **result} for row, result in zip(described, results, strict=True)]
    numbers = {"days": days, "runs": runs, "rows": measured}
    return Result(SPEED, TITLE, (table,), numbers)


def measure(row: SpeedRow, runs: int) -> dict[str, Any]:
    """Measure a row: the seconds of each run, simulated over wall time, and memory [MB]."""
    if row.frames is not None:
        try:
            timings = [_draw_once(row.frames) for _ in range(runs)]
        except InputError as error:
            return {"failed": str(error)}
        return {
            "frames": row.frames["count"],
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


def _draw_once(frames: Mapping[str, int]) -> dict[str, float]:
    """Time the frames in a process of its own."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(time_frames, **frames).result()


@contextmanager
def _one_core() -> Iterator[None]:
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
        row.paper,
    )
