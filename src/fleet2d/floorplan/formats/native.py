"""This project's own floor plan format: outlines, rooms, doors and objects, as JSON or YAML.

A plan that is written by `native_document` and read again at the same cell size is equal to it::

    {"format": "fleet2d-floorplan", "version": 1, "name": "flat",
     "free": [{"outline": [[0, 0], [5, 0], [5, 3], [0, 3]], "holes": []}],
     "rooms": [{"type": "kitchen", "polygon": [[0, 0], [2, 0], [2, 3], [0, 3]]}],
     "entrance": [4.5, 0.5]}

`native_file.PlanFile` has all keys.
"""

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import shapely
from shapely import Polygon

from fleet2d.configuration.components import register
from fleet2d.configuration.units import InputPath
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.formats.fields import shown_value, validate
from fleet2d.floorplan.formats.native_file import FORMAT, PLAN_FILE, VERSION, PlanFile, space_of
from fleet2d.floorplan.geometry.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.objects import PlacedObject, UsePlace
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.source import FloorPlanSource, in_file, read_document
from fleet2d.kernels import Bool


@register("floorplan", "native")
class Native(FloorPlanSource):
    """A plan in Fleet2D's own format.

    Attributes:
        path: The plan's JSON or YAML file.
    """

    mark: ClassVar = ("format", FORMAT)

    path: InputPath

    def load(self) -> FloorPlan:
        """Read the plan."""
        return read_native(self.path, self.cell)


def read_native(path: Path, cell: float = 0.05) -> FloorPlan:
    """Read a floor plan in Fleet2D's own format.

    Args:
        path: The file: YAML if its name ends in .yaml or .yml, else JSON.
        cell: Side of a grid cell [m].

    Raises:
        FloorPlanError: It can't be read, isn't in this format, or has no free space.
    """
    return native_plan(read_document(path), path, cell)


def native_plan(content: dict[str, Any], path: Path, cell: float = 0.05) -> FloorPlan:
    """Return the floor plan of a file's content.

    Raises:
        FloorPlanError: It isn't in this format, or has no free space.
    """
    with in_file(path):
        if content.get("format") != FORMAT:
            hint = " (it looks like HouseExpo: use type houseexpo)" if "verts" in content else ""
            raise FloorPlanError(f'no Fleet2D floor plan: "format" is not "{FORMAT}"{hint}')
        if content.get("version") != VERSION:
            version = shown_value(content.get("version"))
            raise FloorPlanError(
                f"version {version} of the format is not known: this Fleet2D reads {VERSION}"
            )
        return plan_of(validate(PLAN_FILE, {**content, "version": VERSION}), path, cell)


def plan_of(file: PlanFile, path: Path, cell: float) -> FloorPlan:
    """Return the floor plan of a file."""
    return FloorPlan.build(
        file.name or path.stem,
        space_of(file.free),
        [room.to_region() for room in file.rooms or ()],
        cell,
        source=f"Fleet2D floor plan, {path.name}",
        entrance=file.entrance,
        doorways=None if file.doorways is None else [d.to_line() for d in file.doorways],
        regions_are="none" if file.rooms is None else "exact",
        objects=[thing.to_object() for thing in file.objects],
        no_go=[area.polygon for area in file.no_go],
    )


def native_document(plan: FloorPlan) -> dict[str, Any]:
    """Return a plan as the mapping that `read_native` reads, of plain JSON data."""
    lattice = plan.lattice
    document: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "name": plan.name,
        "free": [_part_document(lattice, polygon) for polygon in plan.polygons],
        "rooms": [
            {
                "name": room.name,
                "type": room.type,
                "labels": list(room.labels),
                "region": [
                    _part_document(lattice, polygon)
                    for polygon in cell_polygons(plan.room_of_cell == room.index)
                ],
            }
            for room in plan.rooms
        ],
    }
    document["doorways"] = [
        {"name": d.name, "start": list(d.start), "end": list(d.end), "leaf": d.leaf}
        for d in plan.doorways
    ]
    if plan.objects:
        document["objects"] = [object_document(thing) for thing in plan.objects]
    if plan.no_go:
        document["no_go"] = [_area_document(area) for area in plan.no_go]
    if plan.entrance is not None:
        document["entrance"] = list(plan.entrance)
    return document


def object_document(thing: PlacedObject) -> dict[str, Any]:
    """Return an object as the mapping that `read_native` reads."""
    document: dict[str, Any] = {
        "name": thing.name,
        "type": thing.type,
        "footprint": _area_document(thing.footprint),
        "blocks": thing.blocks,
    }
    if thing.heading:
        document["heading"] = thing.heading
    if thing.uses:
        document["uses"] = [_use_document(use) for use in thing.uses]
    return document


def _use_document(use: UsePlace) -> dict[str, Any]:
    document = {"x": use.x, "y": use.y, "heading": use.heading, "posture": use.posture}
    return document if use.approach is None else {**document, "approach": list(use.approach)}


def _area_document(polygon: Polygon) -> Any:
    outline, *holes = (
        shapely.get_coordinates(ring)[:-1].tolist()
        for ring in (polygon.exterior, *polygon.interiors)
    )
    return {"outline": outline, "holes": holes} if holes else outline


def _part_document(lattice: Lattice, polygon: Polygon) -> dict[str, Any]:
    def metres(ring: shapely.LinearRing) -> Any:
        return lattice.to_metres(shapely.get_coordinates(ring)[:-1]).tolist()

    part = {"outline": metres(polygon.exterior)}
    if polygon.interiors:
        part["holes"] = [metres(hole) for hole in polygon.interiors]
    return part


def cell_polygons(mask: Bool) -> list[Polygon]:
    """Return the area of cells as polygons [lattice]: the union of their runs along the rows."""
    edges = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, first = np.nonzero(edges == 1)
    _, end = np.nonzero(edges == -1)
    corners = np.stack([first, row, end, row + 1]).astype(np.float64) * UNITS_PER_CELL
    return shapely.get_parts(shapely.union_all(shapely.box(*corners))).tolist()
