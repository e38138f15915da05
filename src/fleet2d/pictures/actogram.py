"""An actogram: a row per simulated day, coloured by the room that somebody is in."""

from datetime import datetime, timedelta

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import Rectangle

from fleet2d.configuration.units import micros
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I16, I64
from fleet2d.palette import OTHER_COLOR, ROOM_COLORS, TEXT_COLOR
from fleet2d.pictures.overlay import HATCH_COLOR, QUIET_COLOR
from fleet2d.pictures.traces import BodyTrace
from fleet2d.runtime.clock import midnight_of

DAY_US = 86_400_000_000
BINS = 1440  # coloured intervals of a day
MARKS = 288  # intervals of a day with a mark, whose height is the share of sightings
# Rows are a few pixels high: their colours are deeper than those of the floor plan.
DEEPER = 1.9
GAPS_UP_TO = 75  # days; of longer runs, rows have no gaps between them
# The height of a mark where somebody was seen all the time, as a share of the row.
MARK_PART = 0.5
FAINTEST = 0.06  # the least height of a mark, as a share of that: a single sighting is visible

NOT_SIMULATED = -2


def room_color(plan: FloorPlan, index: int) -> tuple[float, float, float]:
    """Return the colour of a room in an actogram: deeper than on the floor plan."""
    pale = to_rgb(ROOM_COLORS.get(plan.rooms[index].type, OTHER_COLOR))
    red, green, blue = (max(0.0, 1 - DEEPER * (1 - part)) for part in pale)
    return red, green, blue


def rooms_by_day(trace: BodyTrace, start: datetime, step_us: int, steps: int) -> I16:
    """Return the room in each minute of each day, int16 (days, BINS); -1 away, -2 not simulated."""
    midnight = micros(start - midnight_of(start))
    days = -(-(midnight + steps * step_us) // DAY_US)
    begins = np.arange(days * BINS) * (DAY_US // BINS) - midnight
    ends = begins + DAY_US // BINS
    sample = np.clip((begins + ends) // 2 // trace.every_us, 0, len(trace.room) - 1)
    rooms = np.where((ends <= 0) | (begins >= steps * step_us), NOT_SIMULATED, trace.room[sample])
    return rooms.reshape(days, BINS).astype(np.int16)


def marks_by_day(seen: I64, start: datetime, step_us: int, days: int) -> F64:
    """Return the share of each interval of each day with sightings: float64 (days, MARKS).

    Args:
        seen: The steps with a sighting; duplicates count once.
        start: The start of the run.
        step_us: The length of a step [us].
        days: The number of days.
    """
    midnight = midnight_of(start)
    begins = np.unique(seen) * step_us + micros(start - midnight)
    edges = np.arange(days * MARKS + 1) * (DAY_US // MARKS)
    started = np.searchsorted(begins, edges)
    # All steps that start before an edge have ended by then, except possibly the last.
    last_start = np.append(begins, -step_us)[started - 1]
    overhang = np.where(started > 0, np.maximum(last_start + step_us - edges, 0), 0)
    shares: F64 = np.diff(started * step_us - overhang) / (DAY_US // MARKS)
    return shares.reshape(days, MARKS)


def mark_boxes(marks: F64, lift: float = 0.0) -> F64:
    """Return the marks of an actogram as boxes, float64 (n, 4, 2): hour of the day, row.

    The height of a mark is the share of its interval in which somebody was seen, so that the ink is
    proportional to the time; the least height is `FAINTEST`.

    Args:
        marks: The shares that `marks_by_day` returned.
        lift: The space between a mark and the end of the row [rows].
    """
    day, interval = np.nonzero(marks > 0)
    left, right = interval * (24 / MARKS), (interval + 1) * (24 / MARKS)
    bottom = day + 1 - lift
    top = bottom - MARK_PART * np.maximum(marks[day, interval], FAINTEST)
    corners = np.stack([left, top, right, top, right, bottom, left, bottom], axis=1)
    return corners.reshape(-1, 4, 2)


def hours_shown(rooms: I16) -> tuple[float, float]:
    """Return the hours of the day to show: all, or those of a run within one day."""
    simulated = np.flatnonzero((rooms != NOT_SIMULATED).any(axis=0))
    if len(rooms) > 1 or len(simulated) == 0:
        return 0.0, 24.0
    first, last = simulated[0] * 24 / BINS, (simulated[-1] + 1) * 24 / BINS
    if last - first > 12:
        return 0.0, 24.0
    return float(np.floor(first * 4) / 4), float(np.ceil(last * 4) / 4)


def draw_actogram(
    plan: FloorPlan, rooms: I16, marks: F64, start: datetime, axes: Axes, *, dates: bool
) -> None:
    """Draw an actogram.

    Args:
        plan: The home, for the colours of its rooms.
        rooms: The rooms that `rooms_by_day` returned.
        marks: The shares that `marks_by_day` returned.
        start: The start of the run.
        axes: The axes to draw on.
        dates: Whether to write the dates beside the rows.
    """
    days = len(rooms)
    table = np.ones((len(plan.rooms) + 2, 4))
    table[:-2, :3] = [room_color(plan, index) for index in range(len(plan.rooms))]
    table[-1, 3] = 0.0  # away: transparent over the hatching
    away = Rectangle(
        (0, 0), 24, days, facecolor="white", edgecolor=HATCH_COLOR, hatch="//////", lw=0
    )
    axes.add_patch(away)
    axes.imshow(
        table[rooms], extent=(0, 24, days, 0), aspect="auto", interpolation="nearest", zorder=1
    )
    gap = (1.1 if days <= 40 else 0.6) if days <= GAPS_UP_TO else 0.0  # points
    row = axes.bbox.height / axes.figure.dpi * 72 / max(1, days)
    # Marks keep a distance to the lines between rows, which are snapped to whole pixels.
    _draw_marks(marks, axes, (gap / 2 + 0.25) / row if gap else 0.0)
    if gap:
        axes.hlines(np.arange(1, days), 0, 24, color="white", lw=gap, zorder=3)
    axes.set(xlim=hours_shown(rooms), ylim=(days, 0))
    _label(axes, start, days, dates=dates)


def _draw_marks(marks: F64, axes: Axes, lift: float) -> None:
    """Draw a dark mark at the bottom of a row where somebody was seen."""
    boxes = PolyCollection([*mark_boxes(marks, lift)], facecolors=TEXT_COLOR, lw=0, zorder=2)
    boxes.set_snap(False)  # marks lower than a pixel are fainter, not a pixel high
    axes.add_collection(boxes, autolim=False)


def _label(axes: Axes, start: datetime, days: int, *, dates: bool) -> None:
    low, high = axes.get_xlim()
    is_wide = axes.bbox.width / axes.figure.dpi > 2.4  # inches
    step = (
        (3 if is_wide else 6)
        if high - low > 12
        else max(0.25, 2.0 ** np.ceil(np.log2((high - low) / 6)))
    )
    ticks = np.arange(np.ceil(low / step) * step, high + 1e-9, step)
    labels = [
        f"{tick:g}" if step >= 1 else f"{int(tick)}:{round(tick % 1 * 60):02d}" for tick in ticks
    ]
    axes.set_xticks(ticks, labels)
    axes.vlines(
        ticks[(ticks > low) & (ticks < high)], 0, days, color="white", lw=0.5, alpha=0.6, zorder=2.5
    )
    axes.tick_params(length=0, labelsize=7.5, labelcolor=QUIET_COLOR, pad=3)
    for side in axes.spines.values():
        side.set_visible(False)
    rows, names = _dated_rows(start, days)
    axes.set_yticks(rows, names if dates else [""] * len(rows))


def _dated_rows(start: datetime, days: int) -> tuple[list[float], list[str]]:
    """Return rows and their labels: each day, each Monday, or the first of each month."""
    dates = [start.date() + timedelta(days=day) for day in range(days)]
    if days <= 10:
        labelled = list(range(days))
    elif days <= GAPS_UP_TO:
        labelled = [day for day in range(days) if dates[day].weekday() == 0]
    else:
        labelled = [day for day in range(days) if dates[day].day == 1]
        labelled = labelled[:: 1 + len(labelled) // 24]
    by_month = days > GAPS_UP_TO
    names = []
    for day in labelled:
        date = dates[day]
        month = (
            f"{date:%b}"
            if not (by_month and (date.month == 1 or day == labelled[0]))
            else f"{date:%b %Y}"
        )
        names.append(month if by_month else f"{date:%a} {date.day} {date:%b}")
    return [day + 0.5 for day in labelled], names
