"""Homes for the tests of meshes and sight: HouseExpo files, pieces of walls, shuffled meshes."""

import json
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon
from tests.thorough import some

from fleet2d.floorplan.mesh import build_mesh, snap_polygon
from fleet2d.kernels import I64, Mesh, rasterize_cells

SUB = 64
CELL_M = 0.05


class Home(NamedTuple):
    """Free space in lattice units, and all that is made of it.

    Attributes:
        polygons: The free space.
        walls: int64 (w, 4), ax, ay, bx, by of every piece of wall, free space on its left.
        mesh: The mesh of the free space.
        rows: Height, cells.
        columns: Width, cells.
    """

    polygons: list[Polygon]
    walls: I64
    mesh: Mesh
    rows: int
    columns: int

    @property
    def cells(self) -> I64:
        """The centres of all free cells: int64 (n, 2), x and y."""
        rows, columns = np.nonzero(rasterize_cells(self.mesh, self.rows, self.columns) >= 0)
        return np.stack([columns, rows], axis=1).astype(np.int64) * SUB + 33


def walls_of(polygons: Sequence[Polygon]) -> I64:
    """Return every wall of the polygons: int64 (w, 4), free space on its left, none ends flat."""
    walls: list[list[int]] = []
    for polygon in polygons:
        oriented = shapely.orient_polygons(polygon)
        for ring in (oriented.exterior, *oriented.interiors):
            points = [(int(x), int(y)) for x, y in ring.coords[:-1]]
            bends = [
                (x, y)
                for (px, py), (x, y), (nx, ny) in zip(
                    points[-1:] + points[:-1], points, points[1:] + points[:1], strict=True
                )
                if (x - px) * (ny - y) != (y - py) * (nx - x)
            ]
            walls += [[*a, *b] for a, b in zip(bends, bends[1:] + bends[:1], strict=True)]
    return np.array(walls, np.int64)


def home_of(polygons: Sequence[Any]) -> Home:
    """Return the home with this free space: even, positive lattice units."""
    walls = walls_of(polygons)
    columns, rows = (walls.reshape(-1, 2).max(axis=0) // SUB + 3).tolist()
    return Home(list(polygons), walls, build_mesh(polygons, columns, rows), rows, columns)


@cache
def houseexpo(path: Path) -> Home:
    """Return the home of a HouseExpo file, at cells of 5 cm."""
    corners = np.array(json.loads(path.read_text())["verts"])
    metres = corners - corners.min(axis=0) + 2 * CELL_M
    return home_of(snap_polygon(Polygon(metres / CELL_M * SUB)).polygons)


def plan_files(shared_data: Path) -> list[Path]:
    """Return every tenth of the fifty HouseExpo files, or all of them in a thorough test.

    The largest is not among the tenth: it is forty times as large as the others.
    """
    paths = sorted((shared_data / "houseexpo").glob("*.json"))
    assert len(paths) == 50
    return list(some(paths, 10))


def all_homes(shared_data: Path) -> Iterator[Home]:
    """Yield the homes of `plan_files`."""
    return map(houseexpo, plan_files(shared_data))


def transformed(home, turn):
    """Return the home with every corner moved by `turn`."""
    return home_of([shapely.transform(p, turn) for p in home.polygons])


def turns(home):
    """Yield the eight ways to turn and mirror the square that holds the home."""
    size = SUB * max(home.columns, home.rows)
    for mirrored in (False, True):
        for quarters in range(4):

            def turn(points, quarters=quarters, mirrored=mirrored):
                x, y = points[:, 0], points[:, 1]
                for _ in range(quarters):
                    x, y = size - y, x
                return np.stack([size - x if mirrored else x, y], axis=1)

            yield turn


def shuffled(mesh: Mesh, rng: np.random.Generator, rounds: int = 8) -> Mesh:
    """Return another mesh of the same free space: random flips of edges between two triangles."""
    triangles = mesh.triangles.tolist()
    for _ in range(rounds):
        edges = {(t[k], t[(k + 1) % 3]): i for i, t in enumerate(triangles) for k in range(3)}
        inner = [edge for edge in edges if edge[::-1] in edges]
        changed: set[int] = set()
        for i in rng.permutation(len(inner)).tolist():
            a, b = inner[i]
            pair = (edges[a, b], edges[b, a])
            if changed.intersection(pair):
                continue
            c, d = (next(v for v in triangles[side] if v not in (a, b)) for side in pair)
            flipped = [[c, a, d], [d, b, c]]
            if all(_turns_left(mesh.vertices, *corners) for corners in flipped):
                triangles[pair[0]], triangles[pair[1]] = flipped
                changed.update(pair)
    return meshed(mesh, triangles)


def _turns_left(vertices: I64, a: int, b: int, c: int) -> bool:
    (ax, ay), (bx, by), (cx, cy) = (vertices[i].tolist() for i in (a, b, c))
    return bool((bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > 0)


def meshed(mesh: Mesh, triangles: list[list[int]]) -> Mesh:
    """Return a mesh of other triangles over the vertices of `mesh`."""
    edges = {(t[k], t[(k + 1) % 3]): i for i, t in enumerate(triangles) for k in range(3)}
    neighbors = [[edges.get((t[(k + 1) % 3], t[k]), -1) for k in range(3)] for t in triangles]
    return Mesh(mesh.vertices, np.array(triangles, np.int32), np.array(neighbors, np.int32))


def awkward_points(home: Home, rng: np.random.Generator, count: int) -> I64:
    """Return about seven times `count` points, most of them where rounding would go wrong.

    Centres of free cells, middles of inner edges of the mesh, points in line with two corners,
    points on walls, corners, even lattice points anywhere.
    """
    vertices, cells = home.mesh.vertices, home.cells
    triangle, k = np.nonzero(home.mesh.neighbors >= 0)
    starts = vertices[home.mesh.triangles[triangle, k]]
    ends = vertices[home.mesh.triangles[triangle, (k + 1) % 3]]
    middles = (starts + ends) // 2
    first, second = rng.choice(vertices, (2, count))
    walls = rng.choice(home.walls, count)
    anywhere = rng.integers(0, [SUB * home.columns, SUB * home.rows], (count, 2))
    return np.concatenate(
        [
            rng.choice(cells, count) if len(cells) else anywhere,
            rng.choice(middles, count) if len(middles) else anywhere,
            2 * second - first,
            (first + second) // 2,
            (walls[:, :2] + walls[:, 2:]) // 2,
            rng.choice(vertices, count),
            anywhere // 2 * 2,
        ]
    ).astype(np.int64)


def behind_corners(home: Home, eye: I64, rng: np.random.Generator, count: int) -> I64:
    """Return points in line with `eye` and a corner: before the corner, behind it, and at it."""
    corners = rng.choice(home.mesh.vertices, count)
    away = corners - eye
    return np.concatenate([corners, corners + away, corners + away // 2, eye + away // 2])
