"""Pictures of a run: its home with the lives in it, and an actogram, a row for each day."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I16, I64
from fleet2d.palette import ACCENT_COLOR, TEXT_COLOR, deep_color
from fleet2d.runs.run import Run
from fleet2d.runtime.clock import DAY_MINUTES, DAY_US, HOUR_US, midnight_of
from fleet2d.runtime.local_time import LocalTime, readings_of, stamp_us, wall_us
from fleet2d.viewing.pictures.floorplan import (
    DPI,
    drawing_style,
    floorplan_axes,
    scale_depth,
    short_name,
    write_picture,
)
from fleet2d.viewing.pictures.life import (
    HATCH_COLOR,
    LINE_IN,
    MAX_PLACES,
    QUIET_COLOR,
    BodyTrace,
    CameraView,
    Chip,
    Overlay,
    best_view,
    clear_names,
    draw_kept_out,
    draw_paths,
    draw_presence,
    draw_sightings,
    draw_view,
    places_of,
    texts_of,
    trace_of,
)

BINS = DAY_MINUTES  # coloured intervals of a day
# The number of intervals of a day with a mark, whose height is the share of sightings.
MARKS = 288
GAPS_UP_TO = 75  # days; of longer runs, rows have no gaps between them
# The height of a mark where somebody was seen all the time, as a share of the row.
MARK_PART = 0.5
# The minimum height of a mark, as a share of `MARK_PART`: a single sighting is visible.
MIN_MARK_HEIGHT = 0.06

NOT_SIMULATED = -2


def rooms_by_day(trace: BodyTrace, start: datetime, step_us: int, steps: int) -> I16:
    """Return the room in each minute of each day, int16 (days, BINS); -1 away, -2 not simulated."""
    midnight_us = wall_us(midnight_of(start))
    over_us = int(readings_of(start, np.array([steps * step_us - 1]))[0]) + 1
    days = -(-(over_us - midnight_us) // DAY_US)
    readings_us = midnight_us + np.arange(days * BINS) * (DAY_US // BINS)
    begins = readings_us - stamp_us(start)
    is_read = True
    if isinstance(start, LocalTime):  # an hour that the clock reads twice counts once
        begins = start.zone.moments(readings_us) - start.utc_us
        is_read = readings_of(start, begins) == readings_us
    ends = begins + DAY_US // BINS
    sample = np.clip((begins + ends) // 2 // trace.every_us, 0, len(trace.room) - 1)
    is_simulated = (ends > 0) & (begins < steps * step_us) & is_read
    rooms = np.where(is_simulated, trace.room[sample], NOT_SIMULATED)
    return rooms.reshape(days, BINS).astype(np.int16)


def marks_by_day(seen: I64, start: datetime, step_us: int, days: int) -> F64:
    """Return the share of each interval of each day with sightings: float64 (days, MARKS).

    Args:
        seen: The steps with a sighting; duplicates count once.
        start: The start of the run.
        step_us: The length of a step [us].
        days: The number of days.
    """
    midnight_us = wall_us(midnight_of(start))
    begins = np.unique(readings_of(start, seen * step_us)) - midnight_us
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
    proportional to the time; the minimum height is `MIN_MARK_HEIGHT`.

    Args:
        marks: The shares that `marks_by_day` returned.
        lift: The space between a mark and the end of the row [rows].
    """
    day, interval = np.nonzero(marks > 0)
    left = interval * (24 / MARKS)
    right = (interval + 1) * (24 / MARKS)
    bottom = day + 1 - lift
    top = bottom - MARK_PART * np.maximum(marks[day, interval], MIN_MARK_HEIGHT)
    corners = np.stack([left, top, right, top, right, bottom, left, bottom], axis=1)
    return corners.reshape(-1, 4, 2)


def hours_shown(rooms: I16) -> tuple[float, float]:
    """Return the hours of the day to show: all, or those of a run within one day."""
    simulated = np.flatnonzero((rooms != NOT_SIMULATED).any(axis=0))
    if len(rooms) > 1 or len(simulated) == 0:
        return 0.0, 24.0
    first = simulated[0] * 24 / BINS
    last = (simulated[-1] + 1) * 24 / BINS
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
    table[:-2, :3] = [to_rgb(deep_color(room.type)) for room in plan.rooms]
    table[-1, 3] = 0.0  # away: transparent over the hatching
    hatching: dict[str, Any] = {"facecolor": "white", "edgecolor": HATCH_COLOR, "hatch": "//////"}
    axes.add_patch(Rectangle((0, 0), 24, days, lw=0, **hatching))
    style: dict[str, Any] = {"aspect": "auto", "interpolation": "nearest", "zorder": 1}
    axes.imshow(table[rooms], extent=(0, 24, days, 0), **style)
    gap = 1.1 if days <= 40 else 0.6  # points
    if days > GAPS_UP_TO:
        gap = 0.0
    row = axes.bbox.height / axes.figure.dpi * 72 / max(1, days)
    # Marks keep a distance to the lines between rows, which are snapped to whole pixels.
    lift = (gap / 2 + 0.25) / row if gap else 0.0
    boxes = PolyCollection([*mark_boxes(marks, lift)], facecolors=TEXT_COLOR, lw=0, zorder=2)
    boxes.set_snap(False)  # marks lower than a pixel are fainter, not a pixel high
    axes.add_collection(boxes, autolim=False)
    if gap:
        axes.hlines(np.arange(1, days), 0, 24, color="white", lw=gap, zorder=3)
    axes.set(xlim=hours_shown(rooms), ylim=(days, 0))
    _label(axes, start, days, dates=dates)


def _label(axes: Axes, start: datetime, days: int, *, dates: bool) -> None:
    low, high = axes.get_xlim()
    is_wide = axes.bbox.width / axes.figure.dpi > 2.4  # inches
    step = 3 if is_wide else 6
    if high - low <= 12:
        step = max(0.25, 2.0 ** np.ceil(np.log2((high - low) / 6)))
    ticks = np.arange(np.ceil(low / step) * step, high + 1e-9, step)
    hours = [f"{tick:g}" for tick in ticks]
    if step < 1:
        hours = [f"{int(tick)}:{round(tick % 1 * 60):02d}" for tick in ticks]
    axes.set_xticks(ticks, hours)
    inner = ticks[(ticks > low) & (ticks < high)]
    axes.vlines(inner, 0, days, color="white", lw=0.5, alpha=0.6, zorder=2.5)
    axes.tick_params(length=0, labelsize=7.5, labelcolor=QUIET_COLOR, pad=3)
    axes.spines[:].set_visible(False)
    rows, names = _dated_rows(start, days)
    axes.set_yticks(rows, names if dates else [""] * len(rows))


def _dated_rows(start: datetime, days: int) -> tuple[list[float], list[str]]:
    """Return rows and their labels: each day, each Monday, or the first of each month."""
    first = start.date()
    dates = [first + timedelta(days=day) for day in range(days)]
    if days > GAPS_UP_TO:
        dates = [date for date in dates if date.day == 1]
        dates = dates[:: 1 + len(dates) // 24]
        names = [f"{date:%b}" if date.month > 1 else f"{date:%b %Y}" for date in dates]
        if dates:
            names[0] = f"{dates[0]:%b %Y}"
    else:
        if days > 10:
            dates = [date for date in dates if date.weekday() == 0]
        names = [f"{date:%a} {date.day} {date:%b}" for date in dates]
    return [(date - first).days + 0.5 for date in dates], names


MAX_BODIES = 4  # users with an actogram, and robots

# Sizes of the picture [in].
WIDTH = 10.67  # the largest; with a narrow plan the picture is narrower
EDGE = 0.32
HEADER = 0.82
FOOTER = 0.28  # space below the legends
GAP = 0.3
DATES = 0.78  # space beside the first actogram
CAPTION = 0.42  # space above each actogram
ACTOGRAMS = {0: 0.0, 1: 4.25, 2: 4.9, 3: 5.1, 4: 5.4}
# Minimum width of the plan with legend and header: alone, beside actograms.
MIN_LEFT_WIDTHS = (7.2, 3.7)
MAX_BODY_HEIGHT = 6.6
MIN_BODY_HEIGHTS = (2.3, 3.4)
MIN_ROW_HEIGHT = 0.08
TICKS = 0.24  # space below each actogram
MAX_ROW_HEIGHT = 0.55
SCALE_WORDS = 0.2  # space below the bar of the scale

SMALL = 7.5
NOTE = 8.5
SEPARATOR = " · "
WIDE_SEPARATOR = "   ·   "


@dataclass(frozen=True)
class PlottedObservations:
    """The observations of the users in the picture; all arrays have one row for each."""

    step: I64
    robot: NDArray[Any]
    user: NDArray[Any]
    xy: F64


def draw_run(run: Run, path: Path) -> None:
    """Draw a run to a PNG, SVG or PDF file; the same run gives the same bytes.

    On the left is the floor plan with the presence and paths of bodies and the sightings of robots,
    on the right an actogram for each of at most four users: a row per day, coloured by room.

    Args:
        run: A run, stored or in memory, complete or interrupted.
        path: The file, whose name ends with `.png`, `.svg` or `.pdf`. An existing file is replaced.

    Raises:
        InputError: The file name has another suffix, or the file can't be written.
        ArtifactError: The run has no floor plan.

    Example:
        >>> import fleet2d, tempfile
        >>> run = fleet2d.run(None, "simulation.duration=2 h", seed=4)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     draw_run(run, Path(folder) / "picture.png")
    """
    write_picture(path, lambda: _Picture(run).figure)


def run_figure(run: Run) -> Figure:
    """Return the picture of a run as a figure; see `draw_run`."""
    with drawing_style():
        return _Picture(run).figure


class _Picture:
    """The picture of a run: its data are collected, then drawn part by part."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.plan = run.plan
        clock = run.clock
        self.start = clock.start
        self.step_us = clock.step_us
        self.steps = clock.steps
        self.notes: list[str] = []
        self.users = self._traces("users", robot=False)
        self.robots = self._traces("robots", robot=True)
        self.notes += _notes_by_bodies([*self.users, *self.robots])
        self.observations = _observations(run, [user.name for user in self.users])
        self.rings = self._rings()
        self.views = list(self._views())
        self.panels = self.users or self.robots
        self._lay_out()
        self._header()
        self._life()
        self._actograms()
        for number, line in enumerate(reversed(self.note_lines)):
            self.overlay.write(EDGE, 0.2 + number * LINE_IN, line, NOTE)

    def _traces(self, bucket: str, *, robot: bool) -> list[BodyTrace]:
        names = self.run.manifest["entities"][bucket]
        if len(names) > MAX_BODIES:
            self.notes.append(f"{MAX_BODIES} of {len(names)} {bucket} are shown")
        if not self.steps:
            return []
        stored = (
            trace_of(self.run, self.plan, name, number, robot=robot)
            for number, name in enumerate(names[:MAX_BODIES])
        )
        traces = [trace for trace in stored if trace is not None]
        if names and not traces:
            self.notes.append(f"where {bucket} were is not stored")
        return traces

    def _rings(self) -> dict[str, F64]:
        """Return the places where each robot saw users; none if there are too many to draw."""
        places_of_robot = {
            robot.name: places_of(self.observations.xy[self.observations.robot == robot.name])
            for robot in self.robots
        }
        rings = {name: places for name, places in places_of_robot.items() if len(places)}
        count = sum(map(len, rings.values()))
        if count > MAX_PLACES:
            self.notes.append(f"the {count:,} places where robots saw users are not drawn")
            return {}
        return rings

    def _views(self) -> Iterator[CameraView]:
        for robot in self.robots:
            camera = self._body("robots", robot.name).get("camera")
            if camera is None:
                continue
            seen = self.observations
            rows = seen.robot == robot.name
            view = best_view(self.plan, robot, camera, seen.step[rows], seen.xy[rows])
            if view is not None:
                yield view

    def _body(self, bucket: str, name: str) -> dict[str, Any]:
        body = self.run.manifest["scenario"].get(bucket, {}).get(name, {})
        return dict(body)

    def _lay_out(self) -> None:
        """Choose the size of all parts, and create the figure."""
        self.days = [
            rooms_by_day(trace, self.start, self.step_us, self.steps) for trace in self.panels
        ]
        self._lay_out_plan()
        self.figure = Figure(figsize=(self.width, self.body), dpi=DPI, facecolor="white")
        self.overlay = Overlay(self.figure)
        self.life_lines = self.overlay.lines(self.left, list(self._life_chips()), SMALL)
        self.room_lines = self.overlay.lines(self.right - DATES, list(self._room_chips()), SMALL)
        # With few days, the legend starts in the space below their rows.
        days = MAX_ROW_HEIGHT * len(self.days[0]) if self.days else 0.0
        self.rows_high = min(self.body - CAPTION - TICKS, days)
        spare = self.body - CAPTION - TICKS - self.rows_high
        lines = max(len(self.life_lines), len(self.room_lines) - int(spare / LINE_IN))
        self.note_lines = self.overlay.wrap(self.notes, SEPARATOR, NOTE, self.width - 2 * EDGE)
        self.foot = FOOTER + LINE_IN * (lines + len(self.note_lines))
        self.height = HEADER + self.body + self.foot
        self.overlay.resize(self.width, self.height)

    def _lay_out_plan(self) -> None:
        """Choose the size of the plan, and with it that of the picture."""
        x0, y0, x1, y1 = self.plan.bounds
        edge = 0.03 * max(x1 - x0, y1 - y0)
        left = x0 - edge
        right = x1 + edge
        low = y0 - scale_depth(self.plan)
        high = y1 + edge
        self.right = ACTOGRAMS[len(self.panels)]
        beside = 2 * EDGE + self.right + (GAP if self.right else 0.0)
        most = WIDTH - beside
        least = MIN_LEFT_WIDTHS[len(self.panels) > 0]
        # The text under the scale bar has the same size in inches in any home.
        scale = min(most / (right - left), (MAX_BODY_HEIGHT - SCALE_WORDS) / (high - low))  # in/m
        low -= SCALE_WORDS / scale
        self.limits = (left, right, low, high)
        self.left = min(most, max(least, scale * (right - left)))
        days = len(self.days[0]) if self.days else 0
        rows = float(np.clip(CAPTION + TICKS + MIN_ROW_HEIGHT * days, *MIN_BODY_HEIGHTS))
        self.body = min(MAX_BODY_HEIGHT, max(rows, scale * (high - low)))
        self.width = self.left + beside

    def _axes(self, x: float, y: float, width: float, height: float) -> Any:
        """Add axes at a place [in]."""
        box = (x / self.width, y / self.height, width / self.width, height / self.height)
        return self.figure.add_axes(box)

    def _header(self) -> None:
        scenario = self.run.manifest["scenario"]
        top = self.height
        name = scenario.get("name") or "run"
        duration = _length(self.steps * self.step_us)
        overlay = self.overlay
        title = overlay.fit(name, 16, 4.0)
        x = overlay.write(EDGE, top - 0.42, title, 16, weight="bold")
        subtitle = f"{duration} in {short_name(self.plan.name)}"
        subtitle = overlay.fit(subtitle, 16, self.width - EDGE - x - 0.15)
        overlay.write(x + 0.12, top - 0.42, subtitle, 16, color=QUIET_COLOR)
        end = self.start + timedelta(microseconds=self.steps * self.step_us)
        digest = self.run.digest
        facts = [
            f"{_date(self.start)} to {_date(end)}",
            f"step {self.step_us / 1e6:g} s",
            f"seed {self.run.manifest['seed']}",
            f"digest {digest[:12]}" if digest else "no digest",
        ]
        line = WIDE_SEPARATOR.join(facts)
        x = overlay.write(EDGE, top - 0.66, line, 8.5, color=QUIET_COLOR)
        if self.run.status != "complete":
            style = {"color": ACCENT_COLOR, "weight": "bold"}
            overlay.write(x + 0.2, top - 0.66, self.run.status, 8.5, **style)

    def _life(self) -> None:
        axes = self._axes(EDGE, self.foot, self.left, self.body)
        axes.set_anchor("C")
        floorplan_axes(self.plan, axes, title=False)
        left, right, low, high = self.limits
        axes.set(xlim=(left, right), ylim=(low, high))
        clear_names(self.plan, self.views, axes)
        for robot in self.robots:
            draw_kept_out(self._kept_out(robot.name), robot.color, axes)
        for trace in (*self.robots, *self.users):
            draw_paths(trace, axes)
        for trace in self.users:
            draw_presence(self.plan, trace, axes)
        for robot in self.robots:
            if robot.name in self.rings:
                draw_sightings(self.rings[robot.name], robot.color, axes)
        for view in self.views:
            radius = self._body("robots", view.robot.name).get("radius", 0.15)
            draw_view(view, float(radius), axes)
        self.overlay.legend(EDGE, self.foot - 0.13, self.life_lines, SMALL)

    def _kept_out(self, robot: str) -> list[Any]:
        """Return the corners of the areas that a robot keeps out of, at some hours or always."""
        entries = self._body("robots", robot).get("keep_out", [])
        return [entry["area"] for entry in entries if entry["area"] is not None]

    def _life_chips(self) -> Iterator[Chip]:
        for user in self.users:
            yield Chip("spot", user.color, user.name)
            if len(user.legs):
                is_alone = len(self.users) == 1
                label = "ways walked" if is_alone else f"ways of {user.name}"
                yield Chip("way", user.color, label)
        for robot in self.robots:
            facts = filter(None, [robot.name, self._covers(robot.name)])
            yield Chip("way", robot.color, SEPARATOR.join(facts))
            if self._kept_out(robot.name):
                yield Chip("area", robot.color, f"{robot.name} keeps out")
        if self.rings:
            yield Chip("ring", self.robots[0].color, "seen here by a robot")
        for view in self.views:
            time = self.start + timedelta(microseconds=view.step * self.step_us)
            yield Chip("view", None, f"what {view.robot.name} sees, {_date(time)}")

    def _actograms(self) -> None:
        count = len(self.panels)
        if not count:
            return
        x = self.width - EDGE - self.right + DATES
        gap = 0.2
        width = (self.right - DATES - gap * (count - 1)) / count
        height = self.rows_high
        bottom = self.foot + self.body - CAPTION - height
        for number, (trace, rooms) in enumerate(zip(self.panels, self.days, strict=True)):
            left = x + number * (width + gap)
            axes = self._axes(left, bottom, width, height)
            steps = self.observations.step[self.observations.user == trace.name]
            marks = marks_by_day(steps, self.start, self.step_us, len(rooms))
            draw_actogram(self.plan, rooms, marks, self.start, axes, dates=number == 0)
            self._caption(trace, left, bottom + height, width)
        self.overlay.legend(x, bottom - TICKS - 0.13, self.room_lines, SMALL)

    def _caption(self, trace: BodyTrace, x: float, y: float, width: float) -> None:
        name = self.overlay.fit(trace.name, 9.5, width)
        self.overlay.write(x, y + 0.24, name, 9.5, color=trace.color, weight="bold")
        facts = [] if trace.robot else [f"{_percent(float(np.mean(trace.room >= 0)))} at home"]
        share = self._number("sightings", trace.name)
        if share is not None and self.robots:
            facts.append(f"{_percent(share)} of that seen")
        facts += filter(None, [self._covers(trace.name)])
        fit = self.overlay.fit
        while len(facts) > 1 and fit(SEPARATOR.join(facts), SMALL, width).endswith("…"):
            facts.pop()
        self.overlay.write(x, y + 0.09, SEPARATOR.join(facts), SMALL, color=QUIET_COLOR)

    def _room_chips(self) -> Iterator[Chip]:
        indices = {room for rooms in self.days for room in np.unique(rooms).tolist()}
        kinds = [self.plan.rooms[index].type for index in sorted(indices) if index >= 0]
        for kind in dict.fromkeys(kinds):
            yield Chip("room", deep_color(kind), kind.replace("_", " "))
        if -1 in indices:
            yield Chip("away", None, "away")
        if np.isin([user.name for user in self.users], self.observations.user).any():
            label = f"seen by a robot: height is the share of {DAY_MINUTES // MARKS} min"
            yield Chip("seen", "#dfe1e4", label)

    def _number(self, kind: str, body: str) -> float | None:
        """Return the number of the first metric of a type for a body; None if it has none."""
        configured = self.run.manifest["scenario"].get("metrics", {})
        for name, result in self.run.metrics.items():
            if configured.get(name, {}).get("type") == kind and isinstance(result, dict):
                value = result.get(body)
                return value if isinstance(value, int | float) else None
        return None

    def _covers(self, name: str) -> str:
        metres = self._number("distance", name)
        if metres is None:
            return ""
        return f"{metres / 1000:.1f} km a day" if metres >= 1000 else f"{metres:.0f} m a day"


def _observations(run: Run, users: list[str]) -> PlottedObservations:
    """Return the observations of some users."""
    if "observations" not in run.tables:
        none = np.zeros(0, np.int64)
        nobody = np.zeros(0, str)
        return PlottedObservations(none, nobody, nobody, np.zeros((0, 2)))
    table = run.tables["observations"]
    user = texts_of(table["user"])
    rows = np.isin(user, users)
    xy = np.stack([table["x"].to_numpy(), table["y"].to_numpy()], axis=1)
    step = table["step"].to_numpy()
    robot = texts_of(table["robot"])
    return PlottedObservations(step[rows], robot[rows], user[rows], xy[rows])


def _notes_by_bodies(traces: list[BodyTrace]) -> Iterator[str]:
    """Yield each note of traces once, with the names of the bodies that have it."""
    for note in dict.fromkeys(trace.note for trace in traces if trace.note):
        names = ", ".join(trace.name for trace in traces if trace.note == note)
        yield f"{names}: {note}"


def _date(time: datetime) -> str:
    return f"{time:%a} {time.day} {time:%b %Y %H:%M}"


def _length(us: int) -> str:
    for unit, size in (("day", DAY_US), ("hour", HOUR_US), ("minute", 60_000_000)):
        count = us / size
        if count >= 1:
            return f"{count:.3g} {unit if count == 1 else unit + 's'}"
    return f"{us / 1e6:g} s"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if share < 0.0995 else f"{100 * share:.0f} %"
