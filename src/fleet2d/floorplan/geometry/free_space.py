"""Put the free space of a plan on the lattice."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.geometry.lattice import Lattice
from fleet2d.floorplan.geometry.mesh import GRID, SnappedPolygon, snap_polygon

# Number of parts of which a note lists the areas.
PARTS_LISTED = 5

# Distance at which a coordinate counts as on the lattice, for rounding of decimals [lattice].
LATTICE_TOLERANCE = 1e-6


def free_on_lattice(
    name: str, free: Polygon | MultiPolygon, cell: float
) -> tuple[Lattice, list[Polygon]]:
    """Put free space [m] on the lattice, in canonical order, so that equal walls make equal plans.

    Args:
        name: Name of the plan, for messages.
        free: The free space between the walls [m].
        cell: Side of a cell [m].

    Returns:
        The lattice that covers it, and the free space on it.

    Raises:
        FloorPlanError: It encloses no area, or would lose more of it than rounding explains.
    """
    if free.is_empty or not free.area > 0:
        raise FloorPlanError(
            f"the outline of {name} encloses no area: check that its points go round the free space"
        )
    first = Lattice.around(free.bounds, cell)
    snapped = _on_walls(free, first.units_per_m)
    if not snapped.polygons:
        raise FloorPlanError(
            f"nothing is left of {name} ({free.area:.3g} m2) at cells of {cell:g} m: choose a"
            " smaller floorplan.cell, and check that the file is in metres"
        )
    if abs(snapped.area_change) > snapped.tolerance:
        change = snapped.area_change / first.units_per_m**2
        raise FloorPlanError(
            f"rounding the walls of {name} to cells of {cell:g} m would change its area by"
            f" {change:+.2f} of {free.area:.2f} m2: choose a smaller floorplan.cell, and check that"
            " the outline doesn't run over itself"
        )
    # The lattice of the snapped walls, so that a plan and its stored copy agree.
    corners = shapely.total_bounds(snapped.polygons) / first.units_per_m
    lattice = Lattice.around(tuple(corners.tolist()), cell)
    shift = lattice.to_lattice((0.0, 0.0))
    moved = [shapely.transform(polygon, lambda xy: xy + shift) for polygon in snapped.polygons]
    return lattice, canonical_order(moved)


def canonical_order(polygons: Sequence[Polygon]) -> list[Polygon]:
    """Return polygons and their rings in canonical order."""
    normal = shapely.orient_polygons(shapely.normalize(polygons))
    return sorted(normal.tolist(), key=lambda p: shapely.get_coordinates(p).tolist())


def _on_walls(free: Polygon | MultiPolygon, units_per_m: float) -> SnappedPolygon:
    """Snap free space [m] to even lattice units; free space that is there already stays as it is.

    Snapping is not idempotent, as a wall that moves may come near another corner, but a stored plan
    must be read back unchanged.
    """
    exact = shapely.transform(free, lambda xy: xy * units_per_m)
    even = shapely.transform(exact, lambda xy: 2 * np.rint(xy / 2))
    moved = np.abs(shapely.get_coordinates(even) - shapely.get_coordinates(exact)).max()
    if moved < LATTICE_TOLERANCE and even.is_valid:
        parts = shapely.get_parts(even)
        return SnappedPolygon(parts.tolist(), even.area - exact.area, GRID * exact.length)
    return snap_polygon(exact)


def part_notes(lattice: Lattice, polygons: Sequence[Polygon]) -> list[str]:
    """Return a note with the areas of the parts of free space, if there are several."""
    if len(polygons) == 1:
        return []
    areas = sorted((p.area / lattice.units_per_m**2 for p in polygons), reverse=True)
    sizes = ", ".join(f"{area:.2f}" for area in areas[:PARTS_LISTED])
    more = ", …" if len(areas) > PARTS_LISTED else ""
    return [f"the free space is in {len(areas)} parts that nothing joins: {sizes}{more} m2"]
