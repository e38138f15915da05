"""An actogram: a row per simulated day, coloured by the room that somebody is in."""

from datetime import datetime, timedelta

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from fleet2d.floorplan.plan import FloorPlan
from fleet2d.palette import OTHER_COLOR, ROOM_COLORS, TEXT_COLOR
from fleet2d.view.page import HATCH_COLOR, QUIET_COLOR
from fleet2d.view.traces import Trace

DAY_US = 86_400_000_000
BINS = 1440  # pieces of a day that have a colour each
MARKS = 288  # pieces of a day that are marked as high as the share of them that somebody was seen
# The floor plan's colours are pale, for words are written on them; a row is a few pixels high.
DEEPER = 1.9
GAPS_UP_TO = 75  # days; with more, there is no space left between the rows
# The part of a row that a mark takes, from its bottom up, where somebody was seen all the time.
MARK_PART = 0.5
FAINTEST = 0.06  # the least share that a mark has the height of: a single sighting can be made out

NOT_SIMULATED = -2

Rooms = NDArray[np.int16]
Shares = NDArray[np.float64]


def room_color(plan: FloorPlan, index: int) -> tuple[float, float, float]:
    """Return the colour of a room in an actogram: the floor plan's, deeper."""
    pale = to_rgb(ROOM_COLORS.get(plan.rooms[index].type, OTHER_COLOR))
    red, green, blue = (max(0.0, 1 - DEEPER * (1 - part)) for part in pale)
    return red, green, blue


def rooms_by_day(trace: Trace, start: datetime, step_us: int, steps: int) -> Rooms:
    """Return the room in each minute of each day, int16 (days, BINS); -1 away, -2 not simulated."""
    midnight = (start - start.replace(hour=0, minute=0, second=0, microsecond=0)) // timedelta(
        microseconds=1
    )
    days = -(-(midnight + steps * step_us) // DAY_US)
    begins = np.arange(days * BINS) * (DAY_US // BINS) - midnight
    ends = begins + DAY_US // BINS
    sample = np.clip((begins + ends) // 2 // trace.every_us, 0, len(trace.room) - 1)
    rooms = np.where((ends <= 0) | (begins >= steps * step_us), NOT_SIMULATED, trace.room[sample])
    return rooms.reshape(days, BINS).astype(np.int16)


def marks_by_day(seen: NDArray[np.int64], start: datetime, step_us: int, days: int) -> Shares:
    """Return the share of each piece of each day that steps of `seen` fill, float (days, MARKS)."""
    midnight = start.replace(hour=0, minute=0, second=0, microsecond=0)
    # Two robots that see somebody in the same step see no more of the day than one.
    begins = np.unique(seen) * step_us + (start - midnight) // timedelta(microseconds=1)
    edges = np.arange(days * MARKS + 1) * (DAY_US // MARKS)
    begun = np.searchsorted(begins, edges)
    # Of the steps begun by an edge all but the last have ended.
    last = np.append(begins, -step_us)[begun - 1]
    before = begun * step_us - np.where(begun > 0, np.maximum(last + step_us - edges, 0), 0)
    shares: Shares = np.diff(before) / (DAY_US // MARKS)
    return shares.reshape(days, MARKS)


def mark_boxes(marks: Shares, lift: float = 0.0) -> NDArray[np.float64]:
    """Return the marks of an actogram as boxes, float64 (n, 4, 2): hour of the day, row.

    A mark is as high as the share of its piece of the day in which somebody was seen, so that the
    ink is in proportion to the time; only the least are as high as `FAINTEST`.

    Args:
        marks: Of `marks_by_day`.
        lift: How far the boxes stand above the row's end, in rows.
    """
    day, piece = np.nonzero(marks > 0)
    left, right = piece * (24 / MARKS), (piece + 1) * (24 / MARKS)
    bottom = day + 1 - lift
    top = bottom - MARK_PART * np.maximum(marks[day, piece], FAINTEST)
    corners = np.stack([left, top, right, top, right, bottom, left, bottom], axis=1)
    return corners.reshape(-1, 4, 2)


def hours_shown(rooms: Rooms) -> tuple[float, float]:
    """Return the hours of the day to show: all, or of a run within one day those it lasts."""
    simulated = np.flatnonzero((rooms != NOT_SIMULATED).any(axis=0))
    if len(rooms) > 1 or len(simulated) == 0:
        return 0.0, 24.0
    first, last = simulated[0] * 24 / BINS, (simulated[-1] + 1) * 24 / BINS
    if last - first > 12:
        return 0.0, 24.0
    return float(np.floor(first * 4) / 4), float(np.ceil(last * 4) / 4)


def draw_actogram(
    plan: FloorPlan, rooms: Rooms, marks: Shares, start: datetime, axes: Axes, *, dates: bool
) -> None:
    """Draw an actogram.

    Args:
        plan: The home, for the colours of its rooms.
        rooms: Of `rooms_by_day`.
        marks: Of `marks_by_day`.
        start: When the run starts.
        axes: Where to draw.
        dates: Whether to write the dates beside the rows.
    """
    days = len(rooms)
    table = np.ones((len(plan.rooms) + 2, 4))
    table[:-2, :3] = [room_color(plan, index) for index in range(len(plan.rooms))]
    table[-1, 3] = 0.0  # away: the hatching shows
    away = Rectangle(
        (0, 0), 24, days, facecolor="white", edgecolor=HATCH_COLOR, hatch="//////", lw=0
    )
    axes.add_patch(away)
    axes.imshow(
        table[rooms], extent=(0, 24, days, 0), aspect="auto", interpolation="nearest", zorder=1
    )
    gap = (1.1 if days <= 40 else 0.6) if days <= GAPS_UP_TO else 0.0  # points
    row = axes.bbox.height / axes.figure.dpi * 72 / max(1, days)
    # The lines between rows are moved to whole pixels: the marks stand clear of them.
    _draw_marks(marks, axes, (gap / 2 + 0.25) / row if gap else 0.0)
    if gap:
        axes.hlines(np.arange(1, days), 0, 24, color="white", lw=gap, zorder=3)
    axes.set(xlim=hours_shown(rooms), ylim=(days, 0))
    _label(axes, start, days, dates=dates)


def _draw_marks(marks: Shares, axes: Axes, lift: float) -> None:
    """Draw a dark mark at the bottom of a row where somebody was seen."""
    boxes = PolyCollection([*mark_boxes(marks, lift)], facecolors=TEXT_COLOR, lw=0, zorder=2)
    boxes.set_snap(False)  # a mark lower than a pixel shall be fainter, not a pixel high
    axes.add_collection(boxes, autolim=False)


def _label(axes: Axes, start: datetime, days: int, *, dates: bool) -> None:
    low, high = axes.get_xlim()
    wide = axes.bbox.width / axes.figure.dpi > 2.4  # inches
    step = (
        (3 if wide else 6)
        if high - low > 12
        else max(0.25, 2.0 ** np.ceil(np.log2((high - low) / 6)))
    )
    ticks = np.arange(np.ceil(low / step) * step, high + 1e-9, step)
    words = [
        f"{tick:g}" if step >= 1 else f"{int(tick)}:{round(tick % 1 * 60):02d}" for tick in ticks
    ]
    axes.set_xticks(ticks, words)
    axes.vlines(
        ticks[(ticks > low) & (ticks < high)], 0, days, color="white", lw=0.5, alpha=0.6, zorder=2.5
    )
    axes.tick_params(length=0, labelsize=7.5, labelcolor=QUIET_COLOR, pad=3)
    for side in axes.spines.values():
        side.set_visible(False)
    rows, names = _dated_rows(start, days)
    axes.set_yticks(rows, names if dates else [""] * len(rows))


def _dated_rows(start: datetime, days: int) -> tuple[list[float], list[str]]:
    """Return where dates stand: at Mondays, or every day, or the first of each month."""
    dates = [start.date() + timedelta(days=day) for day in range(days)]
    if days <= 10:
        chosen = list(range(days))
    elif days <= GAPS_UP_TO:
        chosen = [day for day in range(days) if dates[day].weekday() == 0]
    else:
        chosen = [day for day in range(days) if dates[day].day == 1]
        chosen = chosen[:: 1 + len(chosen) // 24]
    months = days > GAPS_UP_TO
    names = []
    for day in chosen:
        date = dates[day]
        month = (
            f"{date:%b}"
            if not (months and (date.month == 1 or day == chosen[0]))
            else f"{date:%b %Y}"
        )
        names.append(month if months else f"{date:%a} {date.day} {date:%b}")
    return [day + 0.5 for day in chosen], names
