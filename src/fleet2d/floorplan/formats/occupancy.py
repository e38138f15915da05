"""The free space in maps and drawings of pixels: cleaned of noise, checked, traced."""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import Field
from shapely import Polygon

from fleet2d.configuration.units import InputPath, Length
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.formats.raster import GreyPicture
from fleet2d.floorplan.lattice import MIN_CELL_M
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.source import PixelSource
from fleet2d.kernels import F64, Bool
from fleet2d.kernels.space import count_steps, label_parts, squared_distance, trace_rings

# Tolerance of decimal lengths in pixels: 0.3 m are six pixels of 0.05 m, and not 5.999….
TINY = 1e-9


UnknownGrey = Literal["auto", "none"] | Annotated[int, Field(ge=0, le=255)]
"""The shade that stands for unknown, from 0 to 255; `auto` to find it, `none` for no such shade."""

# The grey that map savers write for unknown.
SAVED_UNKNOWN = 205
# The ground around a home covers at least this share of the edge of a picture.
EDGE_SHARE = 0.5
# Area of lighter floor from which on a light grey may be unknown [m²].
FLOOR_M2 = 2.0
# A home smaller than this, and than this share of all that is drawn, is the inside of an object.
OBJECT_M2, OBJECT_SHARE = 8.0, 0.15


class OccupancySource(PixelSource):
    """A source of a floor plan made of free, occupied and unknown pixels; see `free_space`.

    Attributes:
        speck_area_m2: Groups of pixels smaller than this with free ones all round, such as the legs
            of a chair or lettering, become free; 0 keeps all.
        ray_width: Free space narrower than this doesn't lead on: it cuts off rays through windows
            and gaps in walls; 0 keeps all that is connected.
        path: The file.
    """

    speck_area_m2: float = Field(default=0.02, ge=0)
    ray_width: Length = Field(default=0.3, ge=0)

    path: InputPath

    def build(self, free: Polygon, pixel: float, source: str, notes: list[str]) -> FloorPlan:
        """Return the floor plan of free space [m] whose rooms and doorways the walls determine."""
        return FloorPlan.build(
            self.path.stem,
            free,
            cell=max(pixel, MIN_CELL_M) if self.cell is None else self.cell,
            source=source,
            doorways=None,
            regions_are="none",
            notes=notes,
        )


class PictureSource(OccupancySource):
    """A source whose pixels are shades of grey in a picture.

    Attributes:
        unknown_grey: Shade of what is unknown or outside though it is as light as floor, from 0 to
            255; auto: the one that most of the edge has; none: there is no such shade.
    """

    unknown_grey: UnknownGrey = "auto"

    def known(
        self, picture: GreyPicture, free: Bool, pixel: float, notes: list[str], *, saved: bool
    ) -> Bool:
        """Return the free pixels that aren't of the grey of unknown, nor darker than it.

        Args:
            picture: The picture.
            free: Pixels that are free by their shade, bool (rows, columns).
            pixel: Side of a pixel [m].
            notes: A note is added if pixels are taken for unknown.
            saved: Whether the grey that map savers write may stand for unknown anywhere.
        """
        if self.unknown_grey == "none":
            return free
        edge, share = picture.edge_grey()
        greys = [edge] if share >= EDGE_SHARE else []
        greys += [SAVED_UNKNOWN] if saved else []
        if self.unknown_grey != "auto":
            greys = [self.unknown_grey]
        for grey in greys:
            known: Bool = free & (picture.greys > grey)
            unknown = int(np.count_nonzero(free & (picture.greys == grey)))
            if unknown and np.count_nonzero(known) * pixel**2 >= FLOOR_M2:
                notes.append(
                    f"grey {grey} is taken for unknown, though it is as light as floor: {unknown}"
                    " pixels; unknown_grey: none takes it for floor"
                )
                return known
        return free

    def home(self, raw: "OccupancyMap", picture: GreyPicture, notes: list[str]) -> Polygon:
        """Return the home in an occupancy map [m], and add a note for each change.

        Raises:
            FloorPlanError: There is none, or what was found is the ground around it or the inside
                of an object.
        """
        free, changes = free_space(raw, speck_area_m2=self.speck_area_m2, ray_width=self.ray_width)
        self._refuse_outside(raw, free, picture)
        refuse_object(raw, free)
        notes += changes
        return free

    def _refuse_outside(self, raw: "OccupancyMap", free: Polygon, picture: GreyPicture) -> None:
        """Raise FloorPlanError if free space covers most of the edge of the picture."""
        rows, columns = raw.free.shape
        length = 2 * (rows + columns) * raw.pixel
        corners = np.array([(0, 0), (columns, 0), (columns, rows), (0, rows)], np.float64)
        edge = Polygon(raw.to_metres(corners)).exterior
        if float(edge.buffer(raw.pixel / 4).intersection(free.exterior).length) < length / 2:
            return
        grey, share = picture.edge_grey()
        raise FloorPlanError(
            "the free space runs along most of the edge of the picture: it is the ground around the"
            f" home, not the home. {share:.0%} of the edge has grey {grey}: if that is unknown, set"
            f" floorplan.unknown_grey={grey}; if dark pixels are floor, set negate"
        )


def refuse_object(raw: "OccupancyMap", free: Polygon) -> None:
    """Raise FloorPlanError if a home is far smaller than what is drawn around it."""
    if free.area >= OBJECT_M2 or not raw.occupied.any():
        return
    rows, columns = np.nonzero(raw.occupied)
    drawn = shapely.MultiPoint(np.stack([columns, rows], axis=1)).convex_hull
    drawn_m2 = drawn.area * raw.pixel**2
    if free.area < OBJECT_SHARE * drawn_m2:
        x, y = shapely.get_coordinates(free.representative_point())[0].tolist()
        raise FloorPlanError(
            f"the largest space that walls enclose has {free.area:.1f} m2, of {drawn_m2:.0f} m2"
            f" that are drawn: it is the inside of an object at ({x:.2f}, {y:.2f}) m, not a home."
            " Close the gaps in the outer walls, or set floorplan.close_gaps to the widest [m]"
        )


@dataclass(frozen=True)
class OccupancyMap:
    """A robot's map of a floor in pixels; pixels in neither mask are unknown.

    Attributes:
        free: Pixels known to be free, bool (rows, columns), the first row at the bottom.
        occupied: Pixels known to be occupied, of the same shape.
        pixel: Side of a pixel [m].
        origin: Where the lower left corner of the first pixel is (x, y) [m].
        turn: Cosine and sine of the angle from the x axis to the rows, counter-clockwise.
    """

    free: Bool
    occupied: Bool
    pixel: float
    origin: tuple[float, float] = (0.0, 0.0)
    turn: tuple[float, float] = (1.0, 0.0)

    def to_metres(self, xy: F64) -> F64:
        """Return places (column, row) from the lower left corner in metres (…, 2)."""
        cosine, sine = self.turn
        x, y = xy[..., 0] * self.pixel, xy[..., 1] * self.pixel
        turned = np.stack([x * cosine - y * sine, x * sine + y * cosine], axis=-1)
        return turned + np.array(self.origin)

    def crop(self) -> "OccupancyMap":
        """Return the part around the free pixels, with a margin of one pixel if the map has it."""
        rows, columns = (np.flatnonzero(self.free.any(axis=axis)) for axis in (1, 0))
        low = (max(int(columns[0]) - 1, 0), max(int(rows[0]) - 1, 0))
        window = (slice(low[1], int(rows[-1]) + 2), slice(low[0], int(columns[-1]) + 2))
        x, y = self.to_metres(np.array(low, np.float64)).tolist()
        # The kernels are compiled for this memory order.
        free, occupied = (np.ascontiguousarray(m[window]) for m in (self.free, self.occupied))
        return replace(self, free=free, occupied=occupied, origin=(x, y))


def free_space(
    raw: OccupancyMap, *, speck_area_m2: float, ray_width: float
) -> tuple[Polygon, list[str]]:
    """Return the home in an occupancy map, without noise, specks and rays.

    1. A group of pixels that are not free, surrounded by free ones and smaller than
       `speck_area_m2`, becomes free.
    2. Of the space that a disc of diameter `ray_width` reaches, the largest connected part is the
       home.
    3. Narrower space around it belongs to the home if all of it is within `ray_width` of the space
       that the disc reaches; if it leads further, only the part within half of that.

    Everything else is wall. The diameter of the disc is an odd number of pixels, so that all sides
    are treated alike: `ray_width` is rounded down to that.

    Args:
        raw: The map.
        speck_area_m2: Groups smaller than this are specks [m²]; 0 keeps all.
        ray_width: Diameter of the disc [m]; up to a pixel cuts nothing that is connected.

    Returns:
        The free space [m], with all walls on sides of pixels, and a note for each change.

    Raises:
        FloorPlanError: No space is free, or none is wide enough.
    """
    if not raw.free.any():
        raise FloorPlanError("no pixel is free: check negate, free_thresh and occupied_thresh")
    raw = raw.crop()
    specks, notes = _specks(raw, speck_area_m2)
    free = raw.free | specks
    home = _home(free, raw.pixel, ray_width)
    notes += _left_out(raw, free, home, ray_width)
    notes += _open_border(raw, home)
    return shapely.transform(outline(home), raw.to_metres), notes


def outline(free: Bool) -> Polygon:
    """Return the exact outline of pixels that are connected across sides.

    Args:
        free: bool (rows, columns).

    Returns:
        A polygon with holes; x in columns and y in rows, whole numbers.

    >>> outline(np.array([[True, True], [True, False]])).wkt
    'POLYGON ((0 0, 2 0, 2 1, 1 1, 1 2, 0 2, 0 0))'
    """
    corners, starts = trace_rings(free)
    ring_of_corner = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    rings = np.asarray(shapely.linearrings(corners.astype(np.float64), indices=ring_of_corner))
    outer = np.asarray(shapely.is_ccw(rings))
    (shell,) = rings[outer]
    return Polygon(shell, rings[~outer].tolist())


def _specks(raw: OccupancyMap, speck_area_m2: float) -> tuple[Bool, list[str]]:
    """Return the pixels of small groups that are surrounded by free ones, and a note."""
    # A margin around the map joins all groups that reach its edge.
    part = label_parts(~np.pad(raw.free, 1), True)[1:-1, 1:-1]
    sizes = np.bincount(part[~raw.free], minlength=1)
    small = (sizes > 0) & (sizes * raw.pixel**2 < speck_area_m2 - TINY)
    small[0] = False  # the part of the margin, which comes first
    area = float(sizes[small].sum()) * raw.pixel**2
    specks: Bool = ~raw.free & small[part]
    if not small.any():
        return specks, []
    return specks, [
        f"specks removed: {np.count_nonzero(small)} groups of pixels that are not free, each under"
        f" {speck_area_m2:g} m2 and with free space all round, are free now ({area:.2f} m2 in all)"
    ]


def _home(free: Bool, pixel: float, ray_width: float) -> Bool:
    """Return the pixels of the largest part that a disc reaches, and of what belongs to it."""
    across = math.floor(ray_width / pixel + TINY)
    reach = max((across + 1) // 2, 1)  # the disc covers what is nearer than this to its centre
    core = squared_distance(np.pad(free, 1))[1:-1, 1:-1] >= reach**2
    if not core.any():
        raise FloorPlanError(
            f"the free space is nowhere {ray_width:g} m wide: check the resolution, or set"
            " floorplan.ray_width lower"
        )
    part = label_parts(core, False)
    opened = squared_distance(part != np.argmax(np.bincount(part[core]))) < reach**2
    steps = count_steps(opened, free)
    narrow = steps > 0
    part = label_parts(narrow, False)
    depth = np.zeros(int(part.max()) + 2, np.int32)  # its last entry serves -1
    np.maximum.at(depth, part[narrow], steps[narrow])
    leads_on = depth > across
    return (steps >= 0) & (~leads_on[part] | (steps < reach))


def _left_out(raw: OccupancyMap, free: Bool, home: Bool, ray_width: float) -> list[str]:
    """Return notes on free space outside the home: joined by narrow passages, or not at all."""
    notes = []
    joined = count_steps(home, free) >= 0
    for mask, reason in (
        (joined & ~home, f"only passages narrower than {ray_width:g} m join"),
        (free & ~joined, "nothing joins"),
    ):
        if mask.any():
            part = label_parts(mask, False)
            sizes = np.bincount(part[mask])
            largest = part == np.argmax(sizes)
            middle = np.argwhere(largest)[:, ::-1].mean(axis=0) + 0.5
            x, y = raw.to_metres(middle).tolist()
            area, most = (float(n) * raw.pixel**2 for n in (sizes.sum(), sizes.max()))
            notes.append(
                f"left out: {area:.2f} m2 of free space, in pieces: {len(sizes)}, that {reason} to"
                f" the rest; the largest, {most:.2f} m2, is round ({x:.2f}, {y:.2f}) m"
            )
    return notes


def _open_border(raw: OccupancyMap, home: Bool) -> list[str]:
    """Return notes on the parts of the outline where the map ends without an obstacle."""
    notes = []
    inside, unknown = np.pad(home, 1), np.pad(~raw.free & ~raw.occupied, 1)
    neighbors = [np.roll(unknown, shift, axis) for axis in (0, 1) for shift in (1, -1)]
    sides = sum(int(np.count_nonzero(inside & beside)) for beside in neighbors)
    if sides:
        notes.append(
            f"{sides * raw.pixel:.2f} m of the walls are where free space meets unknown, without an"
            " obstacle"
        )
    edges = (home[0], home[-1], home[:, 0], home[:, -1])
    at_edge = sum(int(np.count_nonzero(edge)) for edge in edges)
    if at_edge:
        notes.append(
            f"the free space reaches the edge of the image along {at_edge * raw.pixel:.2f} m, which"
            " is taken for a wall"
        )
    return notes
