"""A strip of time: a row for each body, coloured by the room that it is in."""

from collections.abc import Sequence
from datetime import timedelta
from typing import NamedTuple

import matplotlib.dates as mdates
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I16
from fleet2d.palette import TEXT_COLOR, deep_color
from fleet2d.pictures.life import HATCH_COLOR, QUIET_COLOR
from fleet2d.runs.run import Run
from fleet2d.viewer.facts.sightings import sightings_of

SEEN_PART = 0.22  # height of the marks of sightings at the foot of a row, as a share of it
ROW_PART = 0.86
MOST_SAMPLES = 100_000
LABEL_PART = 0.05  # stretches longer than this share of the strip have the name of their room


class StripRow(NamedTuple):
    """A row of a strip: the rooms of a body at equal intervals, -1 while away."""

    name: str
    color: str
    room: I16
    time: NDArray[np.datetime64]


def strip_rows(run: Run, colors: Sequence[tuple[str, str]]) -> list[StripRow]:
    """Return the rows of some bodies.

    Args:
        run: The run, or a part of one.
        colors: (name of a body, colour of its name) pairs.

    Raises:
        ArtifactError: The run stored no key frames.
    """
    step_us, steps = run.manifest["step_us"], run.manifest["steps"]
    interval = timedelta(microseconds=int(step_us * -(-steps // MOST_SAMPLES)))
    rows = []
    for name, color in colors:
        path = run.path(name, interval)
        rows.append(StripRow(name, color, path.room, path.time))
    return rows


def draw_strip(
    run: Run, plan: FloorPlan, rows: Sequence[StripRow], axes: Axes, *, names: bool = True
) -> None:
    """Draw a strip of time: a row for each body, coloured by the room that it is in.

    Args:
        run: The run, for its sightings.
        plan: Its home.
        rows: The rows that `strip_rows` returned.
        axes: The axes to draw on; their limits are set.
        names: Whether to write the names of rooms into long stretches.
    """
    begin, end = _limits(run)
    boxes: list[F64] = []
    faces: list[tuple[float, float, float]] = []
    for number, row in enumerate(rows):
        for start, stop, room in _stretches(row, end):
            low, high = number, number + ROW_PART
            boxes.append(np.array([[start, low], [stop, low], [stop, high], [start, high]]))
            faces.append(to_rgb(deep_color(plan.rooms[room].type) if room >= 0 else "#f1f2f4"))
            if names and room >= 0 and stop - start > LABEL_PART * (end - begin):
                name = plan.rooms[room].name.replace("_", " ")
                axes.text(
                    (start + stop) / 2,
                    number + 0.42,
                    name,
                    clip_on=True,
                    fontsize=6.5,
                    color=TEXT_COLOR,
                    ha="center",
                    va="center",
                )
    axes.add_collection(PolyCollection(boxes, facecolors=faces, lw=0, zorder=1), autolim=False)
    _mark_sightings(run, rows, axes)
    axes.set(xlim=(begin, end), ylim=(len(rows), -0.05))
    _label(axes, rows)


def _limits(run: Run) -> tuple[float, float]:
    start = np.datetime64(run.manifest["start"], "us")
    length = np.timedelta64(run.manifest["steps"] * run.manifest["step_us"], "us")
    begin, end = mdates.date2num([start, start + length]).tolist()
    return begin, end


def _stretches(row: StripRow, end: float) -> list[tuple[float, float, int]]:
    """Return start, end and room of the stretches in a row; times as matplotlib has them [days]."""
    cuts = np.append(0, np.flatnonzero(np.diff(row.room)) + 1)
    begins = mdates.date2num(row.time[cuts]).tolist()
    ends = [*begins[1:], end]
    return list(zip(begins, ends, row.room[cuts].tolist(), strict=True))


def _mark_sightings(run: Run, rows: Sequence[StripRow], axes: Axes) -> None:
    """Mark at the foot of a user's row when robots noticed the user."""
    start = np.datetime64(run.manifest["start"], "us")
    step = np.timedelta64(run.manifest["step_us"], "us")
    names = [row.name for row in rows]
    boxes = []
    for lane in sightings_of(run):
        if lane["user"] not in names:
            continue
        foot = names.index(lane["user"]) + ROW_PART
        begins = mdates.date2num(start + np.array(lane["first"]) * step)
        ends = mdates.date2num(start + (np.array(lane["last"]) + 1) * step)
        for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
            head = foot - SEEN_PART
            boxes.append([(begin, head), (end, head), (end, foot), (begin, foot)])
    axes.add_collection(PolyCollection(boxes, facecolors=TEXT_COLOR, lw=0, zorder=2), autolim=False)


def _label(axes: Axes, rows: Sequence[StripRow]) -> None:
    locator = mdates.AutoDateLocator(minticks=3, maxticks=10)
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(mdates.ConciseDateFormatter(locator))
    axes.xaxis.get_offset_text().set_visible(False)
    axes.set_yticks(np.arange(len(rows)) + ROW_PART / 2, [row.name for row in rows])
    axes.tick_params(length=0, labelsize=7.5, labelcolor=QUIET_COLOR, pad=3)
    for label, row in zip(axes.get_yticklabels(), rows, strict=True):
        label.set(color=row.color, fontweight="bold")
    for side in axes.spines.values():
        side.set_visible(False)
    axes.grid(axis="x", color=HATCH_COLOR, lw=0.4, zorder=0)
