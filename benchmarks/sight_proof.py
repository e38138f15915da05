"""Compare sight with a look at every wall, in each home of a folder, where rounding would go wrong.

    python benchmarks/sight_proof.py [--data DIR] [--eyes N] [--seed N]

Every floor plan in DIR (houseexpo/*.json, ros_maps/*/map.yaml, valetudo/*.json) is turned by
quarter turns and mirrored, its doors are open, shut, or some of each. From each of N eyes, points
are looked at by a line of sight, back by another, in the visible region, and as cells in view.
The eyes and the points are mostly degenerate: in line with two corners, at corners, on walls, on
edges of the mesh. The truth is from trying every wall for every line, in integers, without a mesh.
Prints counts.
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.floorplan.mesh import Gates, build_mesh
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import (
    CELL_CENTRE,
    I64,
    SUB,
    Bool,
    Mesh,
    Reach,
    cells_in_view,
    mark_spans,
    pairs_in_sight,
    points_in_sight,
    region_contains_points,
    visible_region,
)

Turn = Callable[[Any], Any]

FILES = ("houseexpo/*.json", "ros_maps/*/map.yaml", "valetudo/*.json")
# Points that are tried against all walls at once: bounds the memory.
AT_ONCE = 256
ALL_ROUND = Reach(0, 1 << 40, 4096)
RESULTS = ("line of sight", "the line back", "visible region", "cells in view")


def seen_past_every_wall(walls: I64, doors: I64, x: int, y: int, points: I64) -> Bool:
    """Return which points are visible by the strict rule: every wall and every door is tried."""
    eye = np.array([[x, y]])
    if not inside(walls, eye)[0]:
        return np.zeros(len(points), np.bool_)
    solid = np.concatenate([walls, doors])
    parts = [points[i : i + AT_ONCE] for i in range(0, len(points), AT_ONCE)]
    return np.concatenate([inside(walls, p) & ~touches_any(solid, x, y, p) for p in parts])


def inside(walls: I64, points: I64) -> Bool:
    """Return for which points a ray to the right crosses an odd number of walls."""
    ax, ay, bx, by = walls.T
    x, y = points.T[:, :, None]
    turn = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    crossed = ((ay > y) != (by > y)) & np.where(by > ay, turn > 0, turn < 0)
    return np.asarray(crossed.sum(axis=1) % 2 == 1)


def touches_any(walls: I64, qx: int, qy: int, points: I64) -> Bool:
    """Return for which points the closed segment from q to the point touches a wall."""
    ax, ay, bx, by = walls.T
    px, py = points.T[:, :, None]
    dx, dy = px - qx, py - qy
    apart = np.maximum(np.minimum(qx, px), np.minimum(ax, bx)) > np.minimum(
        np.maximum(qx, px), np.maximum(ax, bx)
    )
    apart |= np.maximum(np.minimum(qy, py), np.minimum(ay, by)) > np.minimum(
        np.maximum(qy, py), np.maximum(ay, by)
    )
    side_a = np.sign(dx * (ay - qy) - dy * (ax - qx))
    side_b = np.sign(dx * (by - qy) - dy * (bx - qx))
    side_q = np.sign((bx - ax) * (qy - ay) - (by - ay) * (qx - ax))
    side_p = np.sign((bx - ax) * (py - ay) - (by - ay) * (px - ax))
    touches = ~apart & (side_a * side_b <= 0) & (side_q * side_p <= 0)
    return np.asarray(touches.any(axis=1))


def turns(size: int) -> Iterator[Turn]:
    """Yield the eight ways to turn and mirror a square."""
    for mirrored in (False, True):
        for quarters in range(4):

            def turn(points: Any, quarters: int = quarters, mirrored: bool = mirrored) -> Any:
                x, y = points[:, 0], points[:, 1]
                for _ in range(quarters):
                    x, y = size - y, x
                return np.stack([size - x if mirrored else x, y], axis=1)

            yield turn


def walls_of(polygons: Any) -> I64:
    """Return the walls of polygons: int64 (w, 4)."""
    rings = [ring for p in polygons for ring in (p.exterior, *p.interiors)]
    corners = [np.asarray(ring.coords).astype(np.int64) for ring in rings]
    return np.concatenate([np.concatenate([c[:-1], c[1:]], axis=1) for c in corners])


def door_lines(plan: FloorPlan) -> I64:
    """Return the lines of all doors: int64 (d, 2, 2)."""
    ends = [(doorway.start, doorway.end) for doorway in plan.doorways]
    return np.asarray(plan.lattice.to_lattice(ends) if ends else np.zeros((0, 2, 2)), np.int64)


def awkward(mesh: Mesh, walls: I64, eye: I64 | None, rng: np.random.Generator, count: int) -> I64:
    """Return points, most of them degenerate, about `count` of each kind."""
    corners = mesh.vertices
    triangle, k = np.nonzero(mesh.neighbors >= 0)
    a, b = corners[mesh.triangles[triangle, k]], corners[mesh.triangles[triangle, (k + 1) % 3]]
    first, second = rng.choice(corners, (2, count))
    wall = rng.choice(walls, count)
    low, high = walls.reshape(-1, 2).min(axis=0) - SUB, walls.reshape(-1, 2).max(axis=0) + SUB
    anywhere = rng.integers(low, high, (4 * count, 2))
    kinds = [
        rng.choice((a + b) // 2, count) if len(a) else anywhere[:1],
        2 * second - first, (first + second) // 2, (wall[:, :2] + wall[:, 2:]) // 2, first,
        anywhere[: 2 * count] // SUB * SUB + CELL_CENTRE, anywhere[2 * count :],
    ]  # fmt: skip
    if eye is not None:
        kinds += [second, 2 * second - eye, (second + eye) // 2, eye[None]]
    return np.concatenate(kinds)


def compare(mesh: Mesh, walls: I64, doors: I64, eye: I64, points: I64) -> tuple[I64, int]:
    """Return mismatches by line, line back, region and cells, and how many points are seen."""
    x, y = eye.tolist()
    expected = seen_past_every_wall(walls, doors, x, y, points)
    in_region = region_contains_points(mesh, x, y, *visible_region(mesh, x, y), points)
    columns, rows = (walls.reshape(-1, 2).max(axis=0) // SUB + 2).tolist()
    mask = np.zeros((rows, columns), np.bool_)
    mark_spans(cells_in_view(mesh, x, y, 0, ALL_ROUND, rows, columns), mask)
    column, row = points.T // SUB
    is_cell = ((points % SUB == CELL_CENTRE) & (points > 0)).all(axis=1)
    is_cell &= (column < columns) & (row < rows)
    wrong = [
        (points_in_sight(mesh, x, y, points) != expected).sum(),
        (pairs_in_sight(mesh, points, np.broadcast_to(eye, points.shape).copy()) != expected).sum(),
        (in_region != expected).sum(),
        (mask[row[is_cell], column[is_cell]] != expected[is_cell]).sum(),
    ]
    return np.array(wrong), int(expected.sum())


def check_plan(plan: FloorPlan, rng: np.random.Generator, eyes: int) -> tuple[I64, I64]:
    """Return mismatches, and the numbers of pairs, of pairs in sight and of arrangements."""
    wrong, counts = np.zeros(len(RESULTS), np.int64), np.zeros(3, np.int64)
    lines = door_lines(plan)
    size = 2 * SUB + int(walls_of(plan.polygons).max())
    for turn in turns(size + size % 2):
        polygons = [shapely.transform(p, turn) for p in plan.polygons]
        polygons = shapely.orient_polygons(polygons).tolist()
        walls, turned = walls_of(polygons), turn(lines.reshape(-1, 2)).reshape(-1, 2, 2)
        columns, rows = (walls.reshape(-1, 2).max(axis=0) // SUB + 3).tolist()
        ends = [tuple(end) for end in turned.reshape(-1, 2).tolist()]
        gates = Gates(
            build_mesh(polygons, columns, rows, ends), list(zip(ends[::2], ends[1::2], strict=True))
        )
        some = np.flatnonzero(rng.random(len(lines)) < 0.5).tolist()
        for shut in [[], list(range(len(lines))), some][: 3 if len(lines) else 1]:
            mesh, doors = gates.shut(shut), turned[shut].reshape(-1, 4)
            solid = np.concatenate([walls, doors])
            for eye in rng.permutation(awkward(mesh, solid, None, rng, eyes))[:eyes]:
                points = awkward(mesh, solid, eye, rng, 60)
                found, seen = compare(mesh, walls, doors, eye, points)
                wrong += found
                counts += (len(points), seen, 0)
            counts[2] += 1
    return wrong, counts


def main() -> int:
    """Check all plans; return 1 if anything differs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--eyes", type=int, default=12, help="eyes in each arrangement of a home")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    wrong, counts = np.zeros(len(RESULTS), np.int64), np.zeros(3, np.int64)
    plans = doors = 0
    began = time.perf_counter()
    for path in sorted(path for files in FILES for path in options.data.glob(files)):
        try:
            plan = load_floorplan(path)
        except FloorPlanError as error:
            print(f"{path.name} is no plan: {error}")
            continue
        found, pairs = check_plan(plan, rng, options.eyes)
        plans, doors = plans + 1, doors + len(plan.doorways)
        wrong, counts = wrong + found, counts + pairs
        if found.any():
            print(f"{path}: mismatches {dict(zip(RESULTS, found.tolist(), strict=True))}")
    pairs, seen, arrangements = counts.tolist()
    print(
        f"{plans} plans with {doors} doors, in {arrangements} arrangements: {pairs:,} pairs,"
        f" {seen:,} of them in sight, in {time.perf_counter() - began:.0f} s"
    )
    for name, number in zip(RESULTS, wrong.tolist(), strict=True):
        print(f"  {name}: {number} mismatches")
    return int(wrong.any())


if __name__ == "__main__":
    sys.exit(main())
