"""Chambers: the parts into which passages cut the free space of a floor plan."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from shapely import Polygon

from fleet2d.floorplan.geometry.gates import Gates, Segment
from fleet2d.floorplan.geometry.lattice import Lattice
from fleet2d.floorplan.geometry.mesh import build_mesh
from fleet2d.kernels import F64, I32, I64, Bool
from fleet2d.kernels.space import WALL, Mesh, label_triangles, rasterize_cells, spread_labels

MIN_CHAMBER_M2 = 0.8
"""Least area of a chamber; smaller ones, such as space in a thick wall, are joined to others."""


@dataclass(frozen=True)
class Link:
    """A passage between two chambers.

    Attributes:
        line: Number of its line among those given.
        chambers: The chambers on its two sides.
    """

    line: int
    chambers: tuple[int, int]


@dataclass(frozen=True)
class Chambers:
    """Free space, cut at passages.

    Attributes:
        of_cell: The chamber of each free cell, -1 elsewhere, int32 (rows, columns).
        count: Number of chambers; each has a cell.
        links: The passages that separate two of them.
    """

    of_cell: I32
    count: int
    links: tuple[Link, ...]


def cut_chambers(
    lattice: Lattice,
    polygons: Sequence[Polygon],
    mesh: Mesh,
    free: Bool,
    segments: Sequence[Segment],
    min_area_m2: float = MIN_CHAMBER_M2,
) -> Chambers:
    """Cut free space at passages.

    A passage with the same chamber on both sides is ignored. So is the widest passage of a chamber
    that is too small.

    Args:
        lattice: Of the plan.
        polygons: Free space [lattice].
        mesh: The same, in triangles.
        free: Free cells, bool (rows, columns).
        segments: The passages [lattice], exactly from wall to wall; they don't touch each other.
        min_area_m2: Chambers smaller than this are joined to others [m²].
    """
    corners = {(x, y) for x, y in mesh.vertices.tolist()}
    jambs = [end for segment in segments for end in segment if end not in corners]
    if jambs:
        mesh = build_mesh(polygons, lattice.columns, lattice.rows, corners=jambs)
    gates = Gates(mesh, segments)
    shut = gates.shut(range(len(segments)))
    part = label_triangles(shut.neighbors)
    sides = _sides(gates.mesh, shut, part, segments)
    areas = _areas(shut, part) / lattice.units_per_m**2
    lengths = [(x1 - x0) ** 2 + (y1 - y0) ** 2 for (x0, y0), (x1, y1) in segments]
    joined = _join_small(areas, sides, lengths, min_area_m2)
    triangle = rasterize_cells(shut, lattice.rows, lattice.columns)
    chamber = np.append(joined[part], -1).astype(np.int32)[triangle]  # the last serves -1
    if (free & (chamber < 0)).any():  # the centre of a cell on a passage has no triangle
        chamber = spread_labels(chamber, free)
    return _number_chambers(chamber, free, joined, sides)


def _sides(
    open_mesh: Mesh, shut_mesh: Mesh, part: I32, segments: Sequence[Segment]
) -> list[tuple[int, int]]:
    """Return the parts on the two sides of each passage."""
    number = {frozenset(segment): i for i, segment in enumerate(segments)}
    parts_beside: list[list[int]] = [[] for _ in segments]
    for triangle, edge in np.argwhere(
        (open_mesh.neighbors != WALL) & (shut_mesh.neighbors == WALL)
    ):
        ends = open_mesh.triangles[triangle, [edge, (edge + 1) % 3]]
        (x0, y0), (x1, y1) = open_mesh.vertices[ends].tolist()
        parts_beside[number[frozenset(((x0, y0), (x1, y1)))]].append(int(part[triangle]))
    return [(min(parts), max(parts)) for parts in parts_beside]


def _areas(mesh: Mesh, part: I32) -> F64:
    """Return the area of each part, square lattice units."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    total = np.zeros(int(part.max()) + 1, np.int64)
    np.add.at(total, part, doubled)
    return total / 2


def _join_small(
    areas: F64,
    sides: Sequence[tuple[int, int]],
    lengths: Sequence[int],
    min_area_m2: float,
) -> I64:
    """Join small parts to others; return for each part the lowest part of its chamber."""
    owner = np.arange(len(areas))
    total = areas.copy()
    while True:
        inner = [i for i, (a, b) in enumerate(sides) if owner[a] != owner[b]]
        small = [
            (total[owner[part]], -lengths[i], i)
            for i in inner
            for part in sides[i]
            if total[owner[part]] < min_area_m2
        ]
        if not small:
            return owner
        a, b = (int(owner[part]) for part in sides[min(small)[2]])
        low, high = min(a, b), max(a, b)
        total[low] += total[high]
        owner[owner == high] = low


def _number_chambers(
    chamber: I32,
    free: Bool,
    joined: I64,
    sides: Sequence[tuple[int, int]],
) -> Chambers:
    """Return the chambers numbered by their first cells, row by row."""
    lost = free & (chamber < 0)
    if lost.any():  # free cells that share no side with others
        chamber = np.where(lost, len(joined), chamber).astype(np.int32)
    chamber_of_free = chamber[free]
    first = np.full(len(joined) + 1, -1)
    first[chamber_of_free[::-1]] = np.arange(len(chamber_of_free))[::-1]  # the last write wins
    kinds = np.flatnonzero(first >= 0)
    number = np.full(len(joined) + 2, -1, np.int32)
    number[kinds[np.argsort(first[kinds], kind="stable")]] = np.arange(len(kinds))
    links = []
    for line, parts in enumerate(sides):
        a, b = (int(number[joined[part]]) for part in parts)
        if a != b and min(a, b) >= 0:
            links.append(Link(line, (min(a, b), max(a, b))))
    return Chambers(number[chamber], len(kinds), tuple(links))
