"""Life in a home: traces of bodies, fields of view, and text and legends over a figure."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import timedelta
from functools import partial
from math import pi
from operator import itemgetter
from typing import Any, Literal, NamedTuple

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import is_color_like, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle, Wedge
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from numpy.typing import NDArray

from fleet2d.artifacts.table import categories
from fleet2d.configuration.units import format_duration
from fleet2d.errors import ArtifactError, PlacementError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.lattice import Lattice
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I16, I64, Bool, Mesh
from fleet2d.palette import TEXT_COLOR, VIEW_COLOR, VIEW_EDGE, body_color
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import rebuild_path
from fleet2d.sight.fov import VisibleRegion, WallPlan
from fleet2d.viewing.pictures.floorplan import areas_of, directions, draw_cells

CHIP_IN = 0.15
LINE_IN = 0.215
SPACE_IN = 0.17
QUIET_COLOR = "#6b7078"
HATCH_COLOR = "#cfd2d6"


class Chip(NamedTuple):
    """An entry of a legend: a small picture and its label."""

    kind: Literal["room", "away", "area", "seen", "spot", "way", "ring", "view"]
    color: Any
    label: str


class Overlay:
    """Transparent axes over a whole figure, in inches from its lower left corner."""

    def __init__(self, figure: Figure) -> None:
        """Add the axes to the figure."""
        self._figure = figure
        self._canvas = FigureCanvasAgg(figure)
        self.axes: Axes = figure.add_axes((0, 0, 1, 1), zorder=10)
        self.axes.set_axis_off()
        self.resize(*figure.get_size_inches().tolist())

    def resize(self, width: float, height: float) -> None:
        """Change the size of the figure [in]."""
        self._figure.set_size_inches(width, height)
        self.axes.set(xlim=(0, width), ylim=(0, height))

    def write(self, x: float, y: float, line: str, size: float, **style: Any) -> float:
        """Write a line of text, with its baseline at y; return the x of its end."""
        style = {"color": TEXT_COLOR, "va": "baseline", **style}
        text = self.axes.text(x, y, line, fontsize=size, **style)
        return x + self._width(text)

    def _width(self, text: Text) -> float:
        """Return the width of a text [in]."""
        extent = text.get_window_extent(self._canvas.get_renderer())
        return float(extent.width) / float(self._figure.dpi)

    def _width_of(self, line: str, size: float) -> float:
        """Return the width that a line would have [in]."""
        text = self.axes.text(0, 0, line, fontsize=size)
        width = self._width(text)
        text.remove()
        return width

    def fit(self, line: str, size: float, width: float) -> str:
        """Return a line, shortened if it is wider than `width` inches."""
        shorter = (f"{line[:end].rstrip()}…" for end in range(len(line) - 1, 0, -1))
        lines = [line, *shorter]
        return next((each for each in lines if self._width_of(each, size) <= width), lines[-1])

    def wrap(self, parts: Sequence[str], separator: str, size: float, width: float) -> list[str]:
        """Return parts joined to lines of at most `width` inches; a longer part is shortened."""
        lines: list[str] = []
        for part in parts:
            longer = f"{lines[-1]}{separator}{part}" if lines else part
            if lines and self.fit(longer, size, width) == longer:
                lines[-1] = longer
            else:
                lines.append(self.fit(part, size, width))
        return lines

    def lines(self, width: float, chips: Sequence[Chip], size: float) -> list[list[Chip]]:
        """Return the chips of each line of a legend, for a width [in]."""
        lines: list[list[Chip]] = [[]]
        used = 0.0
        for entry in chips:
            label_width = width - _picture_width(entry)
            chip = entry._replace(label=self.fit(entry.label, size, label_width))
            chip_width = self._chip_width(chip, size)
            if lines[-1] and used + chip_width > width:
                lines.append([])
                used = 0.0
            lines[-1].append(chip)
            used += chip_width + SPACE_IN
        return lines

    def legend(self, x: float, y: float, lines: Sequence[Sequence[Chip]], size: float) -> None:
        """Draw lines of chips from (x, y) downwards."""
        for number, chips in enumerate(lines):
            left = x
            middle = y - number * LINE_IN
            for chip in chips:
                self._picture(chip, left, middle)
                style = {"color": QUIET_COLOR, "va": "center_baseline"}
                self.write(left + _picture_width(chip), middle, chip.label, size, **style)
                left += self._chip_width(chip, size) + SPACE_IN

    def _chip_width(self, chip: Chip, size: float) -> float:
        return _picture_width(chip) + self._width_of(chip.label, size)

    def _picture(self, chip: Chip, x: float, y: float) -> None:
        """Draw the picture of a chip, its left middle at (x, y)."""
        side = CHIP_IN
        axes = self.axes
        low = y - side / 2
        middle = (x + side / 2, y)
        if chip.kind in ("room", "seen"):
            axes.add_patch(Rectangle((x, low), side, side, facecolor=chip.color, lw=0))
        if chip.kind == "seen":
            for left, height in ((0.1, 0.2), (0.4, 0.7), (0.7, 0.45)):
                corner = (x + left * side, low)
                box = Rectangle(corner, 0.2 * side, height * side, facecolor=TEXT_COLOR, lw=0)
                axes.add_patch(box)
        if chip.kind in ("away", "area"):
            color = chip.color or HATCH_COLOR
            style: dict[str, Any] = {"facecolor": "white", "edgecolor": color, "lw": 0.5}
            axes.add_patch(Rectangle((x, low), side, side, hatch="////////", **style))
        if chip.kind == "spot":
            for part, alpha in ((0.62, 0.2), (0.42, 0.35), (0.24, 0.8)):
                axes.add_patch(Circle(middle, part * side, facecolor=chip.color, alpha=alpha, lw=0))
        if chip.kind == "way":
            line = [np.array([[x, y], [x + 1.6 * side, y]])]
            axes.add_collection(LineCollection(line, colors=chip.color, lw=1.3), autolim=False)
        if chip.kind == "ring":
            axes.add_patch(Circle(middle, 0.26 * side, fill=False, edgecolor=chip.color, lw=0.7))
        if chip.kind == "view":
            corner = (x + 0.1 * side, y)
            style = {"facecolor": VIEW_COLOR, "edgecolor": VIEW_EDGE, "lw": 0.7, "alpha": 0.8}
            axes.add_patch(Wedge(corner, 0.9 * side, -40, 40, **style))


def _picture_width(chip: Chip) -> float:
    """Return the width of the picture of a chip and of the space after it [in]."""
    return CHIP_IN * (1.6 if chip.kind == "way" else 1.0) + 0.06


SAMPLES = 40_000  # samples of a short run; longer ones have one a minute
SAMPLE_US = 60_000_000
# A random walk has a leg for each step: all of them would be slow to draw, and no legible picture.
LEGS = 1_500
WALKED_STEPS = 4_000_000
# Positions with a longer time between them are not connected by a line.
MAX_LEG_GAP_US = 5_000_000
# A position this near to the way between its neighbours is on it: a little more than rounding.
STRAIGHT_M = 0.003
NO_LEGS = np.zeros((0, 2, 2))


@dataclass(frozen=True)
class BodyTrace:
    """The samples of one body over a run; their arrays have the same length.

    Attributes:
        name: Its name in the scenario.
        color: Its colour.
        robot: Whether it is a robot.
        every_us: The time between two samples [us].
        step: The steps of the samples, int64 (n,).
        xy: The positions, float64 (n, 2) [m].
        heading: The headings, float64 (n,) [rad].
        room: The index of the room, -1 while away, int16 (n,).
        legs: Straight pieces of its paths without duplicates, float64 (m, 2, 2) [m].
        note: A remark on what the trace doesn't show exactly; empty if there is none.
    """

    name: str
    color: str
    robot: bool
    every_us: int
    step: I64
    xy: F64
    heading: F64
    room: I16
    legs: F64
    note: str = ""


NewTrace = Callable[..., BodyTrace]
"""Returns a trace of a body from its samples."""


def trace_of(run: Run, plan: FloorPlan, name: str, number: int, *, robot: bool) -> BodyTrace | None:
    """Return the trace of a body, None if nothing is stored of it.

    Args:
        run: The run.
        plan: Its home.
        name: The body.
        number: Its number among the users or robots, for its colour.
        robot: Whether it is a robot.
    """
    bucket = run.manifest["scenario"].get("robots" if robot else "users", {})
    color = bucket.get(name, {}).get("color")
    if not (isinstance(color, str) and is_color_like(color)):
        color = body_color(number, robot=robot)
    reason = "no key frames were stored"
    trace = partial(BodyTrace, name, color, robot)
    if "key_frames" in run.tables:
        try:
            return _from_key_frames(run, plan, name, trace)
        except ArtifactError as error:
            reason = str(error)
    return _from_trajectories(run, plan, name, trace, reason)


def _from_key_frames(run: Run, plan: FloorPlan, name: str, trace: NewTrace) -> BodyTrace:
    step_us = run.manifest["step_us"]
    steps = run.manifest["steps"]
    stride = max(1, min(SAMPLE_US, steps * step_us // SAMPLES) // step_us)
    every_us = stride * step_us
    path = rebuild_path(run, plan, name, timedelta(microseconds=every_us))
    xy = np.stack([path.x, path.y], axis=1)
    legs, note = _legs_of(run, plan, name)
    return trace(every_us, path.step, xy, path.heading, path.room, legs, note)


def _legs_of(run: Run, plan: FloorPlan, name: str) -> tuple[F64, str]:
    """Return the legs between the key frames of a body, and a remark if some are left out.

    For a random walk, the first `LEGS` legs are returned, or none if it is long.
    """
    keys = _rows(run, "key_frames", name, ("x", "y", "heading", "away"), "kind")
    if (keys["kind"] == "walk").any():
        step_us = run.manifest["step_us"]
        steps = run.manifest["steps"]
        if steps > WALKED_STEPS or step_us > MAX_LEG_GAP_US:
            return NO_LEGS, ""
        path = rebuild_path(run, plan, name, timedelta(microseconds=step_us))
        legs = _legs_between(np.stack([path.x, path.y], axis=1), path.away)
        if len(legs) <= LEGS:
            return legs, ""
        moving = np.flatnonzero((np.diff(path.x) != 0) | (np.diff(path.y) != 0))
        minutes = max(1, round(int(moving[LEGS]) * step_us / 6e7))
        return legs[:LEGS], f"only the ways of the first {minutes} min are drawn"
    # The end of a leg that was interrupted is only planned, and left out.
    is_real = keys["kind"] != "planned"
    away = keys["away"][is_real]
    xy = np.stack([keys["x"], keys["y"]], axis=1)[is_real]
    ends = _are_ends(xy, np.stack([keys["heading"][is_real], away], axis=1))
    legs = _legs_between(xy[ends], away[ends])
    # A patrol repeats the same paths for weeks: equal legs, to the centimetre, are drawn once.
    ends_cm = np.rint(legs.reshape(-1, 4) * 100)
    _, first = np.unique(ends_cm, axis=0, return_index=True)
    return legs[np.sort(first)], ""


def _from_trajectories(
    run: Run, plan: FloorPlan, name: str, trace: NewTrace, reason: str
) -> BodyTrace | None:
    """Return the samples of the table of trajectories; `reason` is for the note."""
    if "trajectories" not in run.tables:
        return None
    rows = _rows(run, "trajectories", name, ("step", "x", "y", "heading", "away"), "room")
    if len(rows["step"]) == 0:
        return None
    step_us = run.manifest["step_us"]
    gaps = np.diff(rows["step"])
    every_us = int(gaps[0] if len(gaps) else 1) * step_us
    xy = np.stack([rows["x"], rows["y"]], axis=1)
    index = {room.name: room.index for room in plan.rooms}
    room = np.array([index.get(word, -1) for word in rows["room"].tolist()], np.int16)
    legs = NO_LEGS
    if every_us <= MAX_LEG_GAP_US:
        legs = _legs_between(xy, rows["away"])[:LEGS]
    every = format_duration(timedelta(microseconds=every_us))
    note = f"{reason}: positions every {every}"
    return trace(every_us, rows["step"], xy, rows["heading"], room, legs, note)


def _rows(
    run: Run, table: str, name: str, columns: Sequence[str], category: str
) -> dict[str, NDArray[Any]]:
    """Return columns of the rows of a body; `category` is a column of texts."""
    content = run.tables[table]
    of_body = texts_of(content["entity"]) == name
    rows = {column: content[column].to_numpy()[of_body] for column in columns}
    rows[category] = texts_of(content[category])[of_body]
    return rows


def texts_of(column: Any) -> NDArray[np.str_]:
    """Return the text of each row of a column of texts, empty where it is null."""
    code, names = categories(column)
    return np.array([*names, ""])[code]


def _legs_between(xy: F64, away: Bool) -> F64:
    """Return the legs between positions, without those from and to an absence: (n, 2, 2) [m]."""
    legs = np.stack([xy[:-1], xy[1:]], axis=1)
    moves = (xy[:-1] != xy[1:]).any(axis=1)
    home = ~away.astype(bool)
    return legs[moves & home[:-1] & home[1:]]


def _are_ends(xy: F64, state: F64) -> Bool:
    """Return which positions end a straight way at constant state: bool (n,).

    Args:
        xy: Positions [m], float64 (n, 2).
        state: Values that change only at the ends of ways: float64 (n, k).
    """
    to = xy[1:-1] - xy[:-2]
    on = xy[2:] - xy[1:-1]
    way = xy[2:] - xy[:-2]
    goes_on = (to * on).sum(axis=1) > 0
    beside = np.abs(to[:, 0] * way[:, 1] - to[:, 1] * way[:, 0])
    is_straight = goes_on & (beside <= STRAIGHT_M * np.hypot(*way.T))
    is_same = (state[1:] == state[:-1]).all(axis=1)
    ends = np.ones(len(xy), np.bool_)
    ends[1:-1] = ~(is_straight & is_same[1:] & is_same[:-1])
    return ends


BLUR_M = 0.14  # standard deviation of the spot of a body, about its own size
REACH = 5  # radius of the blur [standard deviations]; with less, spots have square edges
MAX_OPACITY = 0.4  # the highest opacity of presence, at which the plan stays legible
# Time, in multiples of the mean over all cells, at which presence has half of that opacity.
HALF_OPACITY_TIME = 4.0
MAX_LEGS = 3_000  # legs drawn for a body
CANDIDATES = 60  # moments to compare when a view is chosen
# The number of places of sightings that are drawn, as more would hide the plan.
MAX_PLACES = 260
CLEAR_M = 0.5  # twice the space between a name and a robot
FAR_APART_M = 2.0
RIM_COLOR = "#ffffffb0"  # the rim of names


@dataclass(frozen=True)
class SightWalls:
    """The walls that block sight, with shut doors and tall furniture; see `field_of_view`."""

    sight_mesh: Mesh
    lattice: Lattice

    @classmethod
    def of(cls, home: Home) -> "SightWalls":
        """Return the walls of a home as it is now."""
        return cls(home.walls, home.plan.lattice)


@dataclass(frozen=True)
class CameraView:
    """The region that a camera sees at one moment.

    Attributes:
        robot: The robot of the camera.
        step: The step.
        xy: The position of the robot, float64 (2,) [m].
        heading: The heading of the robot [rad].
        outlines: The parts of the region, each float64 (n, 2) [m].
        users: The positions of the users that it sees, float64 (m, 2) [m].
    """

    robot: BodyTrace
    step: int
    xy: F64
    heading: float
    outlines: list[F64]
    users: F64


def draw_presence(plan: FloorPlan, trace: BodyTrace, axes: Axes) -> None:
    """Draw where a body spent its time; longer is more opaque."""
    samples = samples_by_cell(plan.lattice, trace.xy[trace.room >= 0])
    time = blurred(samples, BLUR_M / plan.lattice.cell) * plan.free
    image = np.empty((*time.shape, 4))
    image[..., :3] = to_rgb(trace.color)
    image[..., 3] = opacity(time, plan.free)
    draw_cells(plan, image, axes, interpolation="bilinear", zorder=3)


def samples_by_cell(lattice: Lattice, xy: F64) -> F64:
    """Return the number of positions, float64 (n, 2) [m], in each cell: float64 (rows, columns)."""
    cells = np.floor((xy - lattice.origin) / lattice.cell).astype(np.int64)
    column, row = np.clip(cells, 0, (lattice.columns - 1, lattice.rows - 1)).T
    counts = np.zeros((lattice.rows, lattice.columns))
    np.add.at(counts, (row, column), 1)
    return counts


def opacity(time: F64, free: Bool) -> F64:
    """Return the opacity of each cell for the time that a body spent there.

    It depends on the time relative to the mean over all free cells: equal times give a faint tint
    in homes of any size, and an hour at a table is visible beside a night in bed.

    Args:
        time: The time in each cell, in any unit, float64 (rows, columns).
        free: Whether a body can be in a cell, bool (rows, columns).

    Example:
        >>> everywhere = np.ones((2, 3))
        >>> opacity(everywhere, everywhere > 0).max().round(3)
        np.float64(0.08)
    """
    mean = time[free].mean() if free.any() else 0.0
    if mean <= 0:
        return np.zeros_like(time)
    ratio = time / mean
    return MAX_OPACITY * ratio / (ratio + HALF_OPACITY_TIME)


def draw_paths(trace: BodyTrace, axes: Axes) -> None:
    """Draw the paths of a body as thin lines."""
    # Many paths are drawn fainter than few: opacity adds up where they cross.
    darkest, faintest, enough = (0.6, 0.09, 60) if trace.robot else (0.3, 0.04, 60)
    legs = trace.legs[:: 1 + len(trace.legs) // (MAX_LEGS + 1)]
    alpha = min(darkest, max(faintest, enough / max(1, len(legs))))
    width = 0.9 if len(legs) <= 600 else 0.6
    lines = LineCollection(list(legs), colors=trace.color, lw=width, alpha=alpha, zorder=2.5)
    axes.add_collection(lines, autolim=False)


def places_of(spots: F64) -> F64:
    """Return the places of sightings rounded to 0.1 m, each once: float64 (n, 2) [m]."""
    return np.unique(np.rint(spots * 10), axis=0) / 10


def draw_sightings(places: F64, color: str, axes: Axes) -> None:
    """Draw a ring at each place where a robot saw a user."""
    style: dict[str, Any] = {"facecolors": "none", "linewidths": 0.45, "alpha": 0.6}
    x, y = places.T
    axes.scatter(x, y, s=7, edgecolors=color, zorder=3.5, **style)


def draw_view(view: CameraView, radius: float, axes: Axes) -> None:
    """Draw the region that a camera sees, the robot, and lines to the users in view."""
    color = view.robot.color
    draw_region(view.outlines, axes)
    dashes: dict[str, Any] = {"color": color, "lw": 0.9, "ls": (0, (2, 1.5))}
    ring: dict[str, Any] = {"ms": 5, "mfc": "white", "mec": color, "mew": 1.1}
    for user in view.users:
        axes.plot(*np.stack([view.xy, user], axis=1), zorder=4, **dashes)
        axes.plot(*user, "o", zorder=4.2, **ring)
    draw_robot(view.xy, view.heading, max(radius, 0.13), color, axes)


def draw_region(outlines: Sequence[F64], axes: Axes) -> None:
    """Draw a region that a camera sees, by the outlines of its parts [m]."""
    for outline in outlines:
        inside = Polygon(outline, facecolor=VIEW_COLOR, alpha=0.38, ec="none", zorder=2.2)
        edge = Polygon(outline, fill=False, edgecolor=VIEW_EDGE, lw=0.7, zorder=3.2)
        axes.add_patch(inside)
        axes.add_patch(edge)


def draw_robot(xy: F64, heading: float, radius: float, color: str, axes: Axes) -> None:
    """Draw a robot as a disc with a line to the front."""
    disc = Circle(xy.tolist(), radius, facecolor=color, edgecolor="white", lw=0.9, zorder=4.3)
    axes.add_patch(disc)
    front = xy + radius * directions(np.array(heading))
    nose = np.stack([xy, front], axis=1)
    axes.plot(*nose, color="white", lw=1.1, zorder=4.4, solid_capstyle="butt")


def draw_kept_out(areas: Iterable[Any], color: str, axes: Axes) -> None:
    """Hatch the areas that a robot keeps out of, given by their corners [m]."""
    style: dict[str, Any] = {"facecolor": "none", "edgecolor": color, "hatch": "////", "lw": 0.8}
    for corners in areas:
        axes.add_patch(Polygon(corners, linestyle="--", alpha=0.6, zorder=2.5, **style))


def clear_names(plan: FloorPlan, views: Sequence[CameraView], axes: Axes) -> None:
    """Keep the names of rooms legible: with a soft outline, away from robots and users."""
    places = [xy for view in views for xy in (view.xy, *view.users)]
    marks = np.array(places).reshape(-1, 2)
    canvas: Any = axes.figure.canvas
    pixels = axes.transData.inverted()
    for text in axes.texts:
        text.set_path_effects([withStroke(linewidth=2.0, foreground=RIM_COLOR)])
        box = text.get_window_extent(canvas.get_renderer())
        (x0, y0), (x1, y1) = pixels.transform(box.get_points()).tolist()
        x, y = text.get_position()
        room = plan.room_at(x, y)
        if room is None or not len(marks):
            continue
        shifts = [sign * 0.1 * k for k in range(1, 25) for sign in (-1, 1)]
        for shift in (0.0, *shifts):
            ends = (y0 + shift, y1 + shift)
            is_inside = all(plan.room_at(at, end) is room for at in (x0, x, x1) for end in ends)
            middle = [(x0 + x1) / 2, sum(ends) / 2]
            distance = abs(marks - middle) * 2
            is_covered = distance < (x1 - x0 + CLEAR_M, y1 - y0 + CLEAR_M)
            if (is_inside or shift == 0) and not is_covered.all(axis=1).any():
                text.set_position((x, y + shift))
                break


def best_view(
    plan: FloorPlan, robot: BodyTrace, camera: dict[str, Any], seen_at: I64, seen_xy: F64
) -> CameraView | None:
    """Return the moment that shows best what a robot sees, and what walls hide from it.

    That is the moment with the largest visible area that a wall limits, of those with a user in
    view if there are any.

    Args:
        plan: The home.
        robot: The robot.
        camera: Its camera, as in the scenario.
        seen_at: The steps at which it saw users, int64 (n,).
        seen_xy: The positions of these users, float64 (n, 2) [m].
    """
    index = np.flatnonzero(np.isin(robot.step, seen_at))
    if len(index) == 0:
        index = np.arange(len(robot.step))
    index = index[:: 1 + len(index) // CANDIDATES]
    near, far = camera["range"]
    sector_area = (far**2 - near**2) * np.deg2rad(camera["angle_deg"]) / 2
    scored: list[tuple[float, CameraView]] = []
    for i in index[robot.room[index] >= 0].tolist():
        step = int(robot.step[i])
        xy = robot.xy[i]
        heading = float(robot.heading[i])
        region = field_of_view(plan, xy, heading, camera)
        users = seen_xy[seen_at == step]
        score = region.area * (1.0 if region.area < 0.97 * sector_area else 0.3)
        if len(users):
            farthest_m = float(np.hypot(*(users - xy).T).max())
            score *= min(1.0, farthest_m / FAR_APART_M)
        view = CameraView(robot, step, xy, heading, outlines_of(region), users)
        scored.append((score, view))
    return max(scored, key=itemgetter(0))[1] if scored else None


def outlines_of(region: shapely.MultiPolygon) -> list[F64]:
    """Return the outlines of the parts of a region, each float64 (n, 2)."""
    return [shapely.get_coordinates(part.exterior) for part in region.geoms]


def field_of_view(
    plan: WallPlan, xy: F64, heading: float, camera: dict[str, Any]
) -> shapely.MultiPolygon:
    """Return the region that a camera sees from a place [m], within its range and angle."""
    try:
        visible = shapely.Polygon(VisibleRegion(plan, *xy.tolist()).polygon())
    except PlacementError:
        return shapely.MultiPolygon()
    near, far = camera["range"]
    angle_deg = camera["angle_deg"]
    if angle_deg >= 360:
        eye = shapely.Point(xy)
        sector = eye.buffer(far).difference(eye.buffer(near))
    else:
        half = np.deg2rad(angle_deg) / 2
        corners = max(3, round(half * 2 / pi * 180))
        angles = np.linspace(heading - half, heading + half, corners)
        arc = directions(angles)
        inner = [xy] if near == 0 else xy + near * arc[::-1]
        sector = shapely.Polygon(np.concatenate([xy + far * arc, inner]))
    cut = shapely.intersection(shapely.make_valid(visible), shapely.make_valid(sector))
    return shapely.MultiPolygon(areas_of(cut))


def blurred(image: F64, sigma: float) -> F64:
    """Return an image blurred by a Gaussian of standard deviation `sigma` [cells]."""
    reach = max(1, round(REACH * sigma))
    offsets = np.arange(-reach, reach + 1)
    weights = np.exp(-0.5 * (offsets / max(sigma, 1e-6)) ** 2)
    weights /= weights.sum()
    for axis in (0, 1):
        image = np.apply_along_axis(lambda line: np.convolve(line, weights), axis, image)
    return image[reach:-reach, reach:-reach]
