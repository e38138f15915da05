"""Pictures of a run: a moment, a stretch, heat maps, a strip of time."""

import textwrap
from datetime import timedelta
from pathlib import Path
from typing import Literal

import numpy as np

from fleet2d.errors import InputError, extra
from fleet2d.expectations.verdict import SignalCourse, VerdictEvidence
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64
from fleet2d.palette import TEXT_COLOR
from fleet2d.runs.moments import part_of_run
from fleet2d.runs.run import Run
from fleet2d.runtime.clock import DAY, midnight_of
from fleet2d.viewing.pictures.floorplan import (
    DPI,
    draw_cells,
    figure_size,
    floorplan_axes,
    picture,
    write_picture,
)
from fleet2d.viewing.pictures.layers import COLORS
from fleet2d.viewing.pictures.life import blurred, samples_by_cell
from fleet2d.viewing.pictures.run import run_figure
from fleet2d.viewing.run_facts import bodies_of
from fleet2d.viewing.stage import Stage, draw_strip

with extra("viz", "drawing needs matplotlib"):
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import PowerNorm
    from matplotlib.figure import Figure

FigureKind = Literal["life", "heat", "strip"]

BLUR_M = 0.15
SAMPLES = 40_000
HEIGHT_IN = 7.0

# Pictures of failures: the most signals drawn, heights of a signal and of the text, and the time
# shown around.
MAX_COURSES = 4
COURSE_IN = 1.05
HEAD_IN = 0.75
COURSE_S = 180
MARK_RGB = (0.84, 0.15, 0.16)


def draw_moment(run: Run, step: int, path: Path) -> None:
    """Draw a moment: positions, what is in view and noticed, and the paths of the last minute.

    Args:
        run: The run.
        step: The step to show.
        path: The file: .png, .svg or .pdf. An existing file is replaced.

    Raises:
        InputError: The run has no such step, or the file can't be written.
        ArtifactError: The run stored no key frames or no floor plan.
    """
    write_picture(path, lambda: moment_figure(run, step))


def draw_failure(
    run: Run, step: int, path: Path, text: str, evidence: VerdictEvidence | None
) -> None:
    """Draw the moment at which an expectation failed, with the rooms and signals in it.

    Rooms and distances are marked, and signals drawn over the minutes around the moment, each with
    its bound.

    Args:
        run: The run.
        step: The step at which it failed.
        path: The file: .png, .svg or .pdf. An existing file is replaced.
        text: The failure and its time, in words.
        evidence: The signals of the expectation; None: only the moment is drawn.

    Raises:
        InputError: The run has no such step, or the file can't be written.
        ArtifactError: The run stored no key frames or no floor plan.
    """
    courses = evidence.signals[:MAX_COURSES] if evidence is not None else ()
    width, height = figure_size(run.plan)
    lower = COURSE_IN * len(courses) + 0.35
    with picture(path, width, height + lower + HEAD_IN) as figure:
        whole = figure.get_figheight()
        axes = figure.add_axes((0.0, lower / whole, 1.0, height / whole))
        stage = Stage(run, max(0, step - _minute(run)), step + 1, axes)
        stage.show(step)
        if evidence is not None:
            _mark(run.plan, stage, evidence, axes)
        moment = f"{run.clock.time(step):%a %d %b %H:%M:%S}, step {step}"
        lines = [moment, *textwrap.wrap(text, round(width * 14))[:3]]
        figure.text(0.02, 1 - 0.08 / whole, "\n".join(lines), va="top", fontsize=8)
        for number, course in enumerate(courses):
            bottom = (lower - COURSE_IN * (number + 1)) / whole
            below = figure.add_axes((0.09, bottom, 0.88, (COURSE_IN - 0.3) / whole))
            _draw_course(run, course, step, below)
            if number == len(courses) - 1:
                below.set_xlabel("seconds from the failure", fontsize=6, labelpad=1)


def _mark(plan: FloorPlan, stage: Stage, evidence: VerdictEvidence, axes: Axes) -> None:
    """Mark the rooms of an expectation, and its distances between bodies."""
    rooms = [r.index for r in plan.rooms if evidence.places & {r.name, r.type}]
    mask = np.isin(plan.room_of_place, rooms)
    image = np.zeros((*mask.shape, 4))
    image[mask] = (*MARK_RGB, 0.22)
    draw_cells(plan, image, axes, zorder=2.2)
    poses = {b.facts["name"]: (b.path.x[-1], b.path.y[-1]) for b in stage.bodies}
    for body, other in evidence.distances:
        here = poses.get(body)
        there = other if isinstance(other, tuple) else poses.get(other)
        if here is not None and there is not None:
            ends = np.array([here, there])
            axes.plot(*ends.T, ls="--", lw=1.2, color=MARK_RGB, zorder=5)
            label = f"{np.hypot(*np.diff(ends, axis=0)[0]):.2f} m"
            middle = ends.mean(axis=0)
            box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}
            axes.annotate(label, middle, color=MARK_RGB, fontsize=8, zorder=6, bbox=box)


def _draw_course(run: Run, course: SignalCourse, step: int, axes: Axes) -> None:
    """Draw a signal over the minutes around a step, in seconds from it, with its bound."""
    seconds = int(run.manifest["step_us"]) / 1e6
    reach = round(COURSE_S / seconds)
    first = max(course.trace.first, step - reach)
    end = min(course.trace.end, step + reach)
    part = course.trace.since(first).until(end)
    at = (np.append(part.start, part.end) - step) * seconds
    value = np.where(np.isfinite(part.value), part.value, np.nan)
    axes.stairs(value, at, color=TEXT_COLOR, lw=1.2, baseline=None)
    if course.limit is not None:
        axes.axhline(course.limit, color=MARK_RGB, ls="--", lw=1)
    axes.axvline(0, color=MARK_RGB, lw=1)
    unit = f" [{course.unit}]" if course.unit else ""
    axes.set_title(f"{course.text}{unit}", fontsize=7, loc="left", pad=2)
    axes.tick_params(labelsize=6)


def moment_figure(run: Run, step: int) -> Figure:
    """Return a figure of a moment; see `draw_moment`."""
    steps = run.manifest["steps"]
    if not 0 <= step < steps:
        raise InputError(f"the run has no step {step}: its last is {steps - 1}")
    width, height = figure_size(run.plan)
    figure = Figure(figsize=(width, height * 1.15), dpi=DPI, facecolor="white")
    first, end = _day_around(run, step)
    Stage(run, first, end, figure=figure).show(step)
    return figure


def moment_on_axes(run: Run, step: int, axes: Axes) -> None:
    """Draw a moment on axes, in metres; see `draw_moment`."""
    Stage(run, max(0, step - _minute(run)), step + 1, axes).show(step)


def _minute(run: Run) -> int:
    return max(1, round(60e6 / int(run.manifest["step_us"])))


def draw_stretch(run: Run, first: int, end: int, path: Path, kind: FigureKind = "life") -> None:
    """Draw a stretch of a run.

    Args:
        run: The run.
        first: Its first step.
        end: The step before which it ends.
        path: The file: .png, .svg or .pdf. An existing file is replaced.
        kind: `life`: paths and presence in the home, and rooms by day. `heat`: where people and
            robots spent their time. `strip`: a row per body, coloured by room.

    Raises:
        InputError: The file can't be written.
        ArtifactError: The run stored no key frames or no floor plan.
    """
    write_picture(path, lambda: stretch_figure(run, first, end, kind))


def stretch_figure(run: Run, first: int, end: int, kind: FigureKind = "life") -> Figure:
    """Return a figure of a stretch of a run; see `draw_stretch`."""
    part = part_of_run(run, first, end)
    if kind == "life":
        return run_figure(part)
    return _heat_figure(part) if kind == "heat" else strip_figure(part)


def strip_figure(part: Run) -> Figure:
    """Return a figure of a strip of time: a row per body."""
    bodies = bodies_of(part.manifest["scenario"], part.manifest["entities"])
    figure = Figure(figsize=(10.67, 0.7 + 0.34 * len(bodies)), dpi=DPI, facecolor="white")
    height = figure.get_figheight()
    axes = figure.add_axes((0.08, 0.32 / height, 0.9, 1 - 0.42 / height))
    draw_strip(part, part.plan, bodies, axes)
    return figure


def _heat_figure(part: Run) -> Figure:
    """Return a figure of where people, and where robots, spent their time."""
    entities = part.manifest["entities"]
    groups = [(bucket, entities[bucket]) for bucket in ("users", "robots") if entities[bucket]]
    if not groups:
        raise InputError("nobody lives in this run: there is no heat map to draw")
    width, height = figure_size(part.plan)
    scale = min(1.0, HEIGHT_IN / height)
    figure = Figure(figsize=(width * scale * len(groups), height * scale), dpi=DPI)
    share = 1 / len(groups)
    for number, (bucket, names) in enumerate(groups):
        axes = figure.add_axes((number * share, 0, share * 0.9, 1))
        colors = draw_heat(part, names, axes)
        label = "people" if bucket == "users" else "robots"
        axes.set_title(f"{label}: hours per day and m²", fontsize=10, color=TEXT_COLOR, y=0.94)
        bar = figure.add_axes(((number + 0.91) * share, 0.2, 0.012, 0.6))
        figure.colorbar(colors, cax=bar).ax.tick_params(labelsize=7)
    return figure


def draw_heat(run: Run, names: list[str], axes: Axes) -> ScalarMappable:
    """Draw where some bodies together spent their time, over their home.

    Args:
        run: The run, or a part of one.
        names: The bodies.
        axes: The axes to draw on, in metres.

    Returns:
        The colours of hours per day and m², for a colour bar.
    """
    plan = run.plan
    floorplan_axes(plan, axes, title=False)
    hours = _hours_per_m2(run, plan, names)
    high = float(hours.max()) or 1.0
    # The scale follows the square root: else hours in bed hide all other places.
    colors = ScalarMappable(PowerNorm(0.5, 0, high), COLORS)
    image = colors.to_rgba(hours)
    opacity = np.clip(np.sqrt(hours / high) * 3, 0, 0.85)
    image[..., 3] = opacity * plan.free
    draw_cells(plan, image, axes, interpolation="bilinear", zorder=2.1)
    return colors


def _hours_per_m2(run: Run, plan: FloorPlan, names: list[str]) -> F64:
    step_us = run.manifest["step_us"]
    steps = run.manifest["steps"]
    interval = timedelta(microseconds=int(step_us * -(-steps // SAMPLES)))
    lattice = plan.lattice
    time = np.zeros((lattice.rows, lattice.columns))
    for name in names:
        path = run.path(name, interval)
        xy = np.stack([path.x, path.y], axis=1)[~path.away]
        time += samples_by_cell(lattice, xy) * (24 / max(1, len(path.x)))
    return blurred(time, BLUR_M / lattice.cell) / lattice.cell**2


def _day_around(run: Run, step: int) -> tuple[int, int]:
    """Return the first step of the day of a step, and the first step after that day."""
    clock = run.clock
    midnight = midnight_of(clock.time(step))
    first = clock.step_at_or_after(clock.elapsed(midnight))
    end = clock.step_at_or_after(clock.elapsed(midnight + DAY))
    return max(0, first), min(clock.steps, end)
