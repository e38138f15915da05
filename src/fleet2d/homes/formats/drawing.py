"""Floor plans drawn as a picture: dark walls on light ground, at a known scale."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field, TypeAdapter

from fleet2d.bounds import PICTURE_BYTES
from fleet2d.configuration.units import InputPath, Length, PositiveLength, Share
from fleet2d.errors import FloorPlanError, UnclearPlaceError
from fleet2d.floorplan.files import in_file, read_file
from fleet2d.floorplan.lattice import MAX_CELL_M
from fleet2d.floorplan.plan import FloorPlan, largest_part
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.homes.formats.cleaning import ROOM_M2, USUAL_DOOR_M, OccupancyMap
from fleet2d.homes.formats.drawn_walls import LINE_M, find_gaps, told_apart, wall_candidates
from fleet2d.homes.formats.occupancy import OBJECT_M2, PictureSource
from fleet2d.homes.formats.raster import GreyPicture, grey_picture
from fleet2d.kernels import Bool, label_parts, squared_distance
from fleet2d.storage.apart import apart

# Widths of gaps in outer walls that are tried in turn [m], from pixels to a door.
GAPS = (0.1, 0.2, 0.3, 0.45, 0.6, 0.9, 1.2)
# Wider ones, which are only reported [m].
WIDE_GAPS = (1.6, 2.2, 3.2, 4.8)
# Share of the floor that closing gaps must keep.
MOST = 0.8
# A shade darker than this at the edge of a picture is that of dark ground.
DARK_EDGE = 100
# Sides of a pixel that are tried to find doors [m], the fewest doors that tell the scale, and how
# near to a side that was tried it is.
TRIED_M = (0.0075, 0.011, 0.016, 0.024, 0.036, 0.005)
FEWEST_DOORS = 3
LIKELY_FACTOR = 1.25
# Share of what is dark that is lines if there are any, and of the enclosed space that is the home.
LINES_SHARE = 0.02
WHOLE = 0.6
# Side of a picture below which it is no home's [m].
SMALLEST_M = 1.0
# Pixels across the widest line, at least, for lines to be told from walls.
LINE_PIXELS = 2.3


class Image(PictureSource):
    """A drawing: dark walls on light ground.

    Attributes:
        path: The picture, PNG, JPEG or PGM.
        resolution: Side of a pixel, as a drawing has no scale.
        threshold: Share of white below which a pixel is wall.
        line_width: What is drawn thinner than this, such as text, dimensions, doors and furniture,
            is no wall, if thicker walls enclose the home; 0: all that is dark is wall.
        bridge_pixels: Width of the widest gap between two parts of the home that opens; 0 opens
            none, as furniture is drawn with thin lines, too.
        close_gaps: Width of the widest gap in outer walls that is closed, if the home would lose
            more than half of its floor through gaps; 0 closes none.
        negate: Whether walls are light on dark ground.
    """

    path: InputPath
    resolution: PositiveLength = Field(le=MAX_CELL_M)
    threshold: Share = 0.5
    line_width: Length = Field(default=LINE_M, ge=0, le=0.5)
    bridge_pixels: int = Field(default=0, ge=0, le=10)
    close_gaps: Length = Field(default=1.2, ge=0, le=5)
    negate: bool = False

    @classmethod
    def of_file(cls, **settings: Any) -> FloorPlanSource:
        """Return the source of a picture with its scale; without it, guess what that could be.

        Raises:
            FloorPlanError: The scale is missing.
        """
        path = settings["path"]
        if settings.get("resolution") is None:
            guess = guess_resolution(path)
            by_doors = (
                "" if guess is None else f": {guess[0]:g}, if its {guess[1]} doors are as usual"
            )
            raise FloorPlanError(
                f"{path} is an image, without its scale: name the YAML file that goes with the map"
                f" of a robot, such as {path.with_suffix('.yaml').name}; of a drawing, give the"
                f" metres per pixel as resolution{by_doors}"
            )
        return super().of_file(**settings)

    @classmethod
    def usual_cell(cls, settings: Mapping[str, Any]) -> float:
        """Return the side of a pixel."""
        side = TypeAdapter(PositiveLength).validate_python(settings.get("resolution"))
        return side * settings["scale"]

    @property
    def pixel(self) -> float:
        """Side of a pixel [m]."""
        return self.resolution * (self.scale or 1.0)

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read the drawing.

        Light pixels that are connected to the edge of the picture are outside, and so are pixels
        that aren't opaque. Of the rest, the largest connected part is the home, as in the map of a
        robot. The lower left corner of the picture is the origin.

        Raises:
            FloorPlanError: It can't be read, or no light space is enclosed by dark walls.
        """
        try:
            return self._read_home(files[self.path])
        except FloorPlanError:
            if not self.negate and self._is_negative(files[self.path]):
                raise FloorPlanError(
                    f"{self.path}: its walls are light on dark ground: set floorplan.negate=true,"
                    " or invert the picture"
                ) from None
            raise

    def _is_negative(self, content: bytes) -> bool:
        """Return whether the picture is a home with light and dark exchanged."""
        try:
            if grey_picture(content, self.path).edge_grey()[0] >= DARK_EDGE:
                return False
            self.model_copy(update={"negate": True})._read_home(content)
        except FloorPlanError:
            return False
        return True

    def _read_home(self, content: bytes) -> FloorPlan:
        picture = grey_picture(content, self.path)
        if self.negate:
            picture = replace(picture, values=picture.white - picture.values)
        with in_file(self.path):
            pixel = self.pixel
            if not 0 < pixel <= MAX_CELL_M:
                raise FloorPlanError(
                    f"resolution is {pixel:g} m per pixel: above 0 and at most {MAX_CELL_M:g} m is"
                    " expected"
                )
            light: Bool = picture.values >= self.threshold * picture.white
            if picture.clear is not None:
                light = light | picture.clear
            notes: list[str] = []
            found: list[str] = []
            inside = self.known(picture, light, pixel, found, saved=False)
            problem = None
            if inside is light:
                try:
                    inside = _inside(light, self.close_gaps, pixel, found)
                except FloorPlanError as error:
                    inside = np.zeros_like(light)
                    problem = error
            told = self._without_lines(picture, light, inside)
            if told is None and problem is not None:
                raise problem
            inside, walls, found = told or (inside, ~light, found)
            notes += found
            raw = OccupancyMap(inside[::-1], walls[::-1], pixel)
            free = self.home(raw, picture, notes)
            return self.build(free, pixel, f"drawing, {self.path.name}", notes)

    def _without_lines(
        self, picture: GreyPicture, light: Bool, enclosed: Bool
    ) -> tuple[Bool, Bool, list[str]] | None:
        """Return what walls enclose, the walls, and notes, if walls are told from thin lines.

        Else None: pixels are too large for that or the picture too small, nothing is thinner than
        `line_width`, or thicker walls don't enclose a home as large.

        Args:
            picture: The drawing.
            light: Pixels that are light, bool (rows, columns).
            enclosed: What all that is dark encloses, of the same shape.
        """
        pixel = self.pixel
        dark = ~light
        if pixel > self.line_width / LINE_PIXELS or min(dark.shape) * pixel < SMALLEST_M:
            return None
        home = largest_part(enclosed)
        for what, walls in wall_candidates(picture, dark, self.line_width, pixel):
            lines = np.count_nonzero(dark & ~walls)
            if lines < LINES_SHARE * np.count_nonzero(dark):
                continue
            if not told_apart(walls, self.line_width, pixel):
                continue
            gaps = find_gaps(walls, dark, pixel)
            closed = walls.copy()
            for gap in gaps:
                closed[gap.window] = True
            notes: list[str] = []
            try:
                inside = _inside(~closed, self.close_gaps, pixel, notes)
            except FloorPlanError:
                continue
            outside = ~closed & ~inside
            outer = [gap for gap in gaps if outside[gap.surrounding].any()]
            for among, is_open in ((gaps, True), (outer, False)):
                for gap in among:
                    inside[gap.window] = is_open
            inside &= ~walls
            area = np.count_nonzero(largest_part(inside))
            at_least = 0 if _frames(home, walls) else MOST * np.count_nonzero(home)
            if area < max(at_least, WHOLE * np.count_nonzero(inside), OBJECT_M2 / pixel**2):
                continue
            note = (
                f"walls {what}: thinner lines, of text, dimensions, doors or furniture, are left"
                f" out, and {len(outer)} windows and doors in outer walls are closed;"
                " line_width: 0 takes all that is dark for wall"
            )
            return inside, ~inside & ~outside, [note, *notes]
        return None


def guess_resolution(path: Path) -> tuple[float, int] | None:
    """Return the side of a pixel [m] by which doors in a drawing are as wide as usual.

    Also the number of those doors. None if at no likely scale there are enough.
    """
    return apart(path, _guess, path, read_file(path, PICTURE_BYTES))


def _guess(path: Path, content: bytes) -> tuple[float, int] | None:
    for pixel in TRIED_M:
        try:
            image = Image.model_construct(path=path, resolution=pixel, cell=None)
            plan = image.read({path: content})
        except FloorPlanError:
            continue
        widths = sorted(door.width_m for door in plan.doorways)
        if len(widths) >= FEWEST_DOORS:
            factor = USUAL_DOOR_M / widths[len(widths) // 2]
            if 1 / LIKELY_FACTOR <= factor <= LIKELY_FACTOR:
                return float(f"{pixel * factor:.2g}"), len(widths)
    return None


def _frames(ground: Bool, walls: Bool) -> bool:
    """Return whether some pixels lie round all walls, as the ground in the frame of a drawing."""
    for axis in (0, 1):
        outer, inner = (np.flatnonzero(mask.any(axis=axis)) for mask in (ground, walls))
        if not len(outer) or outer[0] >= inner[0] or outer[-1] <= inner[-1]:
            return False
    return True


def _inside(light: Bool, close_gaps: float, pixel: float, notes: list[str]) -> Bool:
    """Return the light pixels inside the outer walls, whose gaps are closed if they lose the home.

    Gaps are closed if the largest enclosed space would have less than half of the area without
    them: at the smallest of `GAPS` that keeps most of it.

    Args:
        light: Pixels that aren't wall, bool (rows, columns).
        close_gaps: Width of the widest gap that is closed [m]; 0 closes none.
        pixel: Side of a pixel [m].
        notes: A note is added if gaps are closed.

    Raises:
        FloorPlanError: No space is enclosed.
    """
    inside = _enclosed(light, 0)
    widths = [width for width in (*GAPS, close_gaps) if pixel < width <= close_gaps]
    if widths:
        home = _largest(inside)
        at_most = _largest(_enclosed(light, widths[-1] / pixel))
        if home < at_most / 2 and at_most * pixel**2 >= OBJECT_M2:
            for width in widths:
                closed = _enclosed(light, width / pixel)
                if _largest(closed) >= MOST * at_most:
                    row, column = _first_gap(light, inside, closed)
                    lost = home * pixel**2
                    whole = at_most * pixel**2
                    notes.append(
                        f"gaps in the outer walls are closed up to a width of {width:g} m, since"
                        f" only {lost:.1f} m2 of {whole:.1f} m2 would be inside; one is at pixel"
                        f" ({column}, {row}); close_gaps: 0 leaves them open"
                    )
                    notes += _note_wide_gap(light, closed, close_gaps, pixel)
                    return closed
    if inside.any():
        return inside
    if not light.any():
        raise FloorPlanError("all of the picture is darker than threshold: set it lower")
    wider = [(width, _enclosed(light, width / pixel)) for width in WIDE_GAPS if width > close_gaps]
    at_most = max((_largest(closed) for _, closed in wider), default=0)
    for width, closed in wider:
        if _largest(closed) >= max(MOST * at_most, OBJECT_M2 / pixel**2):
            row, column = _first_gap(light, inside, closed)
            raise UnclearPlaceError(
                f"no space is enclosed by walls: one gap is at pixel ({column}, {row}), at most"
                f" {width:g} m wide. Draw the outer walls without gaps, or set"
                f" floorplan.close_gaps={width:g}",
                (column, row),
                width / pixel / 2,
            )
    raise FloorPlanError(
        "no space is enclosed by walls: all that is light is joined to the edge of the picture."
        " Draw the outer walls without gaps, the front door shut; if walls are grey, set threshold"
        " higher"
    )


def _note_wide_gap(light: Bool, closed: Bool, close_gaps: float, pixel: float) -> list[str]:
    """Return a note if a wider gap in an outer wall than is closed leaves out a whole room."""
    for width in (width for width in WIDE_GAPS[:2] if width > close_gaps):
        whole = _enclosed(light, width / pixel)
        room = largest_part(whole & ~closed)
        if (room_m2 := np.count_nonzero(room) * pixel**2) >= ROOM_M2:
            row, column = _first_gap(light, closed, room)
            return [
                f"{room_m2:.1f} m2 with a gap of at most {width:g} m in their outer wall, at pixel"
                f" ({column}, {row}), are taken for outside; close_gaps: {width:g} makes them a"
                " part of the home"
            ]
    return []


def _enclosed(light: Bool, gap: float) -> Bool:
    """Return the light pixels that a disc from outside doesn't reach; `gap` is its diameter."""
    if gap > 0:
        # Beyond the margin is ground, too.
        wide = np.pad(light, math.ceil(gap) + 1, constant_values=True)
        core = squared_distance(wide) >= (gap / 2) ** 2
        reached = label_parts(core, False) == 0
        margin = math.ceil(gap)
        outside = squared_distance(~reached) < (gap / 2) ** 2
        return light & ~outside[margin + 1 : -margin - 1, margin + 1 : -margin - 1]
    part = label_parts(np.pad(light, 1, constant_values=True), False)[1:-1, 1:-1]
    return light & (part != 0)  # the first part is the margin


def _largest(mask: Bool) -> int:
    """Return the number of pixels of the largest connected part."""
    return int(np.count_nonzero(largest_part(mask)))


def _first_gap(light: Bool, inside: Bool, closed: Bool) -> tuple[int, int]:
    """Return the (row, column) of a pixel at which the ground met what is inside now."""
    ground = np.pad(light & ~closed, 1)
    beside = ground[:-2, 1:-1] | ground[2:, 1:-1] | ground[1:-1, :-2] | ground[1:-1, 2:]
    row, column = np.argwhere(closed & ~inside & beside)[0].tolist()
    return row, column
