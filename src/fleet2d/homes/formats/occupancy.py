"""The free space in maps and drawings of pixels: cleaned of noise, checked, traced."""

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import Field
from shapely import Polygon

from fleet2d.bounds import CORNERS, PICTURE_BYTES
from fleet2d.configuration.units import InputPath, Length
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.file_source import FileSource
from fleet2d.floorplan.lattice import MIN_CELL_M
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.homes.formats.cleaning import (
    OccupancyMap,
    bridge_gaps,
    home_pixels,
    note_left_out,
    remove_specks,
)
from fleet2d.homes.formats.pixels import PixelSource
from fleet2d.homes.formats.raster import GreyPicture
from fleet2d.kernels import Bool, trace_rings

UnknownGrey = Literal["auto", "none"] | Annotated[int, Field(ge=0, le=255)]
"""The shade that stands for unknown, from 0 to 255; `auto` to find it, `none` for no such shade."""

# The grey that map savers write for unknown.
SAVED_UNKNOWN = 205
# The ground around a home covers at least this share of the edge of a picture.
EDGE_SHARE = 0.5
# Shades of one ground differ by up to this in a JPEG picture or one that was enlarged.
SPREAD = 8
# Share of a picture that is unknown, at least.
UNKNOWN_SHARE = 0.05
# A shade is unknown, too, up to this share of the way from that of unknown to that of the floor.
RARE_SHARE = 0.25
# Area of lighter floor from which on a light grey may be unknown [m²].
FLOOR_M2 = 2.0
# A home smaller than this, and than this share of all that is drawn, is the inside of an object.
OBJECT_M2 = 8.0
OBJECT_SHARE = 0.15


class OccupancySource(PixelSource, FileSource):
    """A source of a floor plan made of free, occupied and unknown pixels; see `free_space`.

    Attributes:
        speck_area_m2: Groups of pixels smaller than this with free ones all round, such as the legs
            of a chair or lettering, become free; 0 keeps all.
        ray_width: Free space narrower than this doesn't lead on: it cuts off rays through windows
            and gaps in walls; 0 keeps all that is connected.
        bridge_pixels: Width of the widest gap between two parts of the home that opens, as at a
            threshold or a shut door; 0 opens none.
        simplify: How far straightened walls may be from the pixels; 0: exact walls, or a pixel
            where they have more corners than are read.
        path: The file.
    """

    speck_area_m2: float = Field(default=0.02, ge=0)
    ray_width: Length = Field(default=0.3, ge=0)
    bridge_pixels: int = Field(default=2, ge=0, le=10)
    simplify: Length = Field(default=0.0, ge=0)

    path: InputPath

    def clean(self, raw: OccupancyMap, notes: list[str]) -> Polygon:
        """Return the home in an occupancy map [m], and add a note for each change.

        Raises:
            FloorPlanError: There is none, or what was found is the inside of an object.
        """
        free, changes = free_space(raw, self.speck_area_m2, self.ray_width, self.bridge_pixels)
        refuse_object(raw, free)
        notes += changes
        return free

    def build(self, free: Polygon, pixel: float, source: str, notes: list[str]) -> FloorPlan:
        """Return the floor plan of a home in which walls determine the rooms and doorways.

        Args:
            free: The free space [m].
            pixel: Side of a pixel [m].
            source: The source, for readers.
            notes: Sentences on how it was read; one is added if walls are straightened.
        """
        tolerance = self.simplify
        corners = shapely.get_num_coordinates(free)
        if tolerance == 0 and corners > CORNERS.limit:
            tolerance = pixel
            notes.append(
                f"walls are straightened by up to a pixel, since they have {corners} corners;"
                f" {CORNERS.variable}={corners} in the environment keeps them exact"
            )
        if tolerance > 0:
            free = _simplify(free, tolerance, notes)
        return FloorPlan.build(
            name=self.path.stem,
            free=free,
            cell=max(pixel, MIN_CELL_M) if self.cell is None else self.cell,
            source=source,
            doorways=None,
            regions_are="none",
            notes=tuple(notes),
        )


class PictureSource(OccupancySource):
    """A source whose pixels are shades of grey in a picture.

    Attributes:
        unknown_grey: Shade of what is unknown or outside though it is as light as floor, from 0 to
            255; auto: the one that most of the edge has, that map savers write, or that furniture
            is filled with; none: there is no such shade.
    """

    bound = PICTURE_BYTES

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
        if self.unknown_grey == "none" or not free.any():
            return free
        if self.unknown_grey == "auto":
            edge, share = picture.edge_grey()
            spread = 0 if share >= EDGE_SHARE else SPREAD
            _, share = picture.edge_grey(spread)
            greys = [edge] if share >= EDGE_SHARE else []
            if saved:
                greys += [SAVED_UNKNOWN] * (picture.share(SAVED_UNKNOWN) > 0)
                greys += picture.filled_greys(free)
            counts = np.bincount(picture.greys[free], minlength=256)
            greys = [g for g in greys if counts[g + SPREAD :].sum() * pixel**2 >= FLOOR_M2]
            grey = limit = max(greys, default=0)
            if grey == edge:
                limit += spread
            if grey == SAVED_UNKNOWN and picture.share(grey) >= UNKNOWN_SHARE:
                # What a robot saw rarely, such as rays, is nearer to unknown than to the floor.
                limit = grey + int((1 + counts[grey + 1 :].argmax()) * RARE_SHARE)
        else:
            grey = limit = self.unknown_grey
        known: Bool = free & (picture.greys > limit)
        unknown = int(np.count_nonzero(free) - np.count_nonzero(known))
        if not unknown or np.count_nonzero(known) * pixel**2 < FLOOR_M2:
            return free
        notes.append(
            f"grey {grey} is taken for unknown, and so are shades up to {limit}, though they are as"
            f" light as floor: {unknown} pixels; unknown_grey: none takes them for floor"
        )
        return known

    def home(self, raw: OccupancyMap, picture: GreyPicture, notes: list[str]) -> Polygon:
        """Return the home in an occupancy map [m], and add a note for each change.

        Raises:
            FloorPlanError: There is none, or what was found is the ground around it or the inside
                of an object.
        """
        free = self.clean(raw, notes)
        rows, columns = raw.free.shape
        length = 2 * (rows + columns) * raw.pixel
        corners = np.array([(0, 0), (columns, 0), (columns, rows), (0, rows)], np.float64)
        edge = Polygon(raw.to_metres(corners)).exterior
        if float(edge.buffer(raw.pixel / 4).intersection(free.exterior).length) < length / 2:
            return free
        grey, share = picture.edge_grey()
        # What was taken for unknown is no longer free.
        lighter = picture.greys[::-1][raw.free] > grey
        if not lighter.all() and np.count_nonzero(lighter) * raw.pixel**2 >= FLOOR_M2:
            advice = f"if that is unknown, set floorplan.unknown_grey={grey}"
        else:
            advice = (
                "no shade tells it from the floor. Fill what is outside with grey 205, or crop it"
                " away; a drawing of walls is read by `type: image`"
            )
        raise FloorPlanError(
            "the free space runs along most of the edge of the picture: it is the ground around the"
            f" home, not the home. {share:.0%} of the edge has grey {grey}: {advice}; if dark"
            " pixels are floor, set negate"
        )


def refuse_object(raw: OccupancyMap, free: Polygon) -> None:
    """Raise FloorPlanError if a home is far smaller than what is drawn around it."""
    if free.area >= OBJECT_M2 or not raw.occupied.any():
        return
    rows = np.flatnonzero(raw.occupied.any(axis=1))
    first = raw.occupied[rows].argmax(axis=1)
    last = raw.occupied.shape[1] - 1 - raw.occupied[rows, ::-1].argmax(axis=1)
    ends = np.concatenate([np.stack([first, rows], axis=1), np.stack([last, rows], axis=1)])
    drawn = shapely.MultiPoint(ends).convex_hull  # of the first and last pixel of each row
    drawn_m2 = drawn.area * raw.pixel**2
    if free.area < OBJECT_SHARE * drawn_m2:
        x, y = shapely.get_coordinates(free.representative_point())[0].tolist()
        raise FloorPlanError(
            f"the largest space that walls enclose has {free.area:.1f} m2, of {drawn_m2:.0f} m2"
            f" that are drawn: it is the inside of an object at ({x:.2f}, {y:.2f}) m, not a home."
            " Close the gaps in the outer walls, or set floorplan.close_gaps to the widest [m]"
        )


def free_space(
    raw: OccupancyMap, speck_area_m2: float, ray_width: float, bridge_pixels: int = 0
) -> tuple[Polygon, list[str]]:
    """Return the home in an occupancy map, without noise, specks and rays.

    1. A group of pixels that are not free, surrounded by free ones and smaller than
       `speck_area_m2`, becomes free.
    2. Gaps of at most `bridge_pixels` between large parts open; see `bridge_gaps`.
    3. Of the space that a disc of diameter `ray_width` reaches, the largest connected part is the
       home.
    4. Narrower space around it belongs to the home if all of it is within `ray_width` of the space
       that the disc reaches; if it leads further, only the part within half of that.

    Everything else is wall. The diameter of the disc is an odd number of pixels, so that all sides
    are treated alike: `ray_width` is rounded down to that.

    Args:
        raw: The map.
        speck_area_m2: Groups smaller than this are specks [m²]; 0 keeps all.
        ray_width: Diameter of the disc [m]; up to a pixel cuts nothing that is connected.
        bridge_pixels: Largest width of a gap that opens [pixels]; 0 opens none.

    Returns:
        The free space [m], with all walls on sides of pixels, and a note for each change.

    Raises:
        FloorPlanError: No space is free, or none is wide enough.
    """
    if not raw.free.any():
        raise FloorPlanError("no pixel is free: check negate, free_thresh and occupied_thresh")
    raw = raw.crop()
    specks, notes = remove_specks(raw, speck_area_m2)
    raw = replace(raw, free=raw.free | specks)
    gaps, note = bridge_gaps(raw, bridge_pixels, ray_width=ray_width)
    free = raw.free | gaps
    notes += [note] * bool(note)
    home = home_pixels(free, raw.pixel, ray_width)
    notes += note_left_out(raw, free, home, ray_width)
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


def _open_border(raw: OccupancyMap, home: Bool) -> list[str]:
    """Return notes on the parts of the outline where the map ends without an obstacle."""
    notes = []
    inside = np.pad(home, 1)
    unknown = np.pad(~raw.free & ~raw.occupied, 1)
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


def _simplify(free: Polygon, tolerance: float, notes: list[str]) -> Polygon:
    """Return the polygon with fewer corners, if it stays valid."""
    simple: Polygon = shapely.simplify(free, tolerance, preserve_topology=True)
    if simple.is_empty or not simple.is_valid:
        notes.append(f"walls are exact: straightening them within {tolerance:g} m would cross them")
        return free
    before, after = (shapely.count_coordinates(polygon) for polygon in (free, simple))
    notes.append(
        f"walls were straightened within {tolerance:g} m: {after} corners instead of {before}, and"
        f" {simple.area - free.area:+.2f} m2"
    )
    return simple
