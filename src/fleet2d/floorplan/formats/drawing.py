"""Floor plans drawn as a picture: dark walls on light ground, at a known scale."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydantic import Field, TypeAdapter

from fleet2d.configuration.components import register
from fleet2d.configuration.units import InputPath, PositiveLength, Share
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.formats.files import in_file
from fleet2d.floorplan.formats.occupancy import (
    GreyPicture,
    OccupancyMap,
    OccupancySource,
    read_grey,
)
from fleet2d.floorplan.lattice import MAX_CELL_M, MIN_CELL_M
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import Bool
from fleet2d.kernels.space import label_parts


@register("floorplan", "image")
class Image(OccupancySource):
    """A drawing: dark walls on light ground.

    Attributes:
        path: The picture, PNG or PGM.
        resolution: Side of a pixel, as a drawing has no scale.
        threshold: Share of white below which a pixel is wall.
    """

    path: InputPath
    resolution: PositiveLength = Field(le=MAX_CELL_M)
    threshold: Share = 0.5

    @classmethod
    def usual_cell(cls, settings: Mapping[str, Any]) -> float:
        """Return the side of a pixel."""
        side = TypeAdapter(PositiveLength).validate_python(settings.get("resolution"))
        return max(side, MIN_CELL_M)

    def load(self) -> FloorPlan:
        """Read the drawing.

        Light pixels that are connected to the edge of the picture are outside, and so are pixels
        that aren't opaque. Of the rest, the largest connected part is the home, as in the map of a
        robot. The lower left corner of the picture is the origin.

        Raises:
            FloorPlanError: It can't be read, or no light space is enclosed by dark walls.
        """
        picture = read_grey(self.path)
        with in_file(self.path):
            if not 0 < self.resolution <= MAX_CELL_M:
                raise FloorPlanError(
                    f"resolution is {self.resolution:g} m per pixel: above 0 and at most"
                    f" {MAX_CELL_M:g} m is expected"
                )
            light = _light(picture, self.threshold)
            raw = OccupancyMap(_inside(light)[::-1], ~light[::-1], self.resolution)
            notes: list[str] = []
            free = self.free_space(raw, notes)
            return self.build(free, self.resolution, f"drawing, {self.path.name}", notes)


def _light(picture: GreyPicture, threshold: float) -> Bool:
    light: Bool = picture.values >= threshold * picture.white
    return light if picture.clear is None else light | picture.clear


def _inside(light: Bool) -> Bool:
    """Return the light pixels that are not connected to the edge of the picture.

    Raises:
        FloorPlanError: There are none.
    """
    part = label_parts(np.pad(light, 1, constant_values=True), False)[1:-1, 1:-1]
    inside: Bool = light & (part != 0)  # the first part is the margin
    if inside.any():
        return inside
    if not light.any():
        raise FloorPlanError("all of the picture is darker than threshold: set it lower")
    raise FloorPlanError(
        "no space is enclosed by walls: all that is light is joined to the edge of the picture."
        " Draw the outer walls without gaps, the front door shut; if walls are grey, set threshold"
        " higher"
    )
