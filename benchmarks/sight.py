"""How long sight takes in homes: regions, lines of sight, cells in view; and what others take.

    python benchmarks/sight.py [--data DIR] [--peers PEERS_PYTHON] [--json FILE]

Everything runs on one core; times are the best of several runs in this process, compiling left out.
DIR holds houseexpo/*.json, ros_maps/*/map.yaml and valetudo/*.json. `--peers` names a Python with
pyvispoly (CGAL's exact triangular expansion) and tcod (libtcod's symmetric shadow casting) of
peers_requirements.txt; they get the same walls and poses, and their answers are compared with ours.
NumPy is always compared with: every wall is tried for every line. sight_month.py measures sight in
a simulation, sight_proof.py compares many more answers.
"""

import argparse
import json
import math
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

PLANS = (
    "658e5214673c7a4e25b458e56bdb6144", "2deaa98e9acd1293d5224e25715c1393",
    "7e80c5f4c9905bc273560854d8abe916", "0cec4f261a11cb6d5e7518d695261b64",
    "ee0dd99281c8a273cc4395b4b8495848",
)  # fmt: skip
RANGE_M, HALF_ANGLE = 4.5, 1229  # 108 degrees
PAIR_M = 3.0
EYES, PAIRS, SHOWN = 200, 400_000, 64  # poses compared; pairs; points looked at from each place
REPEATS = 5


@dataclass
class Row:
    """One home: sizes, times, and disagreements with others."""

    home: str
    walls: int
    cells: int
    all_cells_s: float
    pieces: float  # of a region, mean
    megabytes: float  # of all regions
    query_ns: float = 0.0  # one line of sight, from ever new places
    looked_up_ns: float = 0.0  # one point in a region that is there already
    fill_us: float = 0.0  # cells in view of a pose
    by_lines_us: float = 0.0  # the same, by a line of sight to each cell
    kept_us: float = 0.0  # the same, of a pose that the flashlight has kept
    numpy_us: float = 0.0  # one line of sight, every wall tried
    mismatches: dict[str, str] = field(default_factory=dict)
    peers: dict[str, str] = field(default_factory=dict)


def best(work: Callable[[], Any], repeats: int = REPEATS) -> float:
    """Return the shortest time that the work took [s], after one run that doesn't count."""
    work()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def homes(data: Path) -> dict[str, Any]:
    """Return the floor plans: five of HouseExpo, the first re-traced at 5 cm, and real maps."""
    import fleet2d

    found = {f"{p[:4]}": fleet2d.load_floorplan(data / f"houseexpo/{p}.json") for p in PLANS}
    found[f"{PLANS[0][:4]} jagged"] = jagged(found[PLANS[0][:4]])
    for path in (
        data / "ros_maps/aws_small_house/map.yaml",
        data / "valetudo/dreame_z10_named_rooms_and_paths.json",
    ):
        name = path.parent.name if path.stem == "map" else path.stem[:10]
        found[name] = fleet2d.load_floorplan(path)
    return found


def jagged(plan: Any) -> Any:
    """Return a plan turned by 0.5 rad and traced along 5 cm pixels, as a robot's map would be."""
    import shapely

    import fleet2d

    free = plan.free_space
    free = shapely.affinity.rotate(free, 0.5, use_radians=True)
    x0, y0, x1, y1 = (math.floor(edge / 0.05) for edge in free.bounds)
    x, y = np.meshgrid(np.arange(x0, x1 + 2) * 0.05, np.arange(y0, y1 + 2) * 0.05)
    shapely.prepare(free)
    inside = shapely.contains_xy(free, x + 0.025, y + 0.025)
    boxes = shapely.box(x[inside], y[inside], x[inside] + 0.05, y[inside] + 0.05)
    whole = max(shapely.get_parts(shapely.union_all(boxes, grid_size=0.05)), key=shapely.area)
    return fleet2d.FloorPlan.build("jagged", shapely.simplify(whole, 0))


def walls_of(plan: Any) -> Any:
    """Return the walls [lattice]: int64 (w, 4)."""
    parts = []
    for polygon in plan.polygons:
        for ring in (polygon.exterior, *polygon.interiors):
            corners = np.asarray(ring.coords).astype(np.int64)
            parts.append(np.concatenate([corners[:-1], corners[1:]], axis=1))
    return np.concatenate(parts)


def seen_by_numpy(walls: Any, eye: Any, points: Any) -> Any:
    """Return which points, all in free space, no wall hides from an eye in free space."""
    (qx, qy), (px, py), (ax, ay, bx, by) = eye, points.T[:, :, None], walls.T
    dx, dy = px - qx, py - qy
    side_a = np.sign(dx * (ay - qy) - dy * (ax - qx))
    side_b = np.sign(dx * (by - qy) - dy * (bx - qx))
    side_q = np.sign((bx - ax) * (qy - ay) - (by - ay) * (qx - ax))
    side_p = np.sign((bx - ax) * (py - ay) - (by - ay) * (px - ax))
    meet = np.ones(side_p.shape, bool)
    for q, p, a, b in ((qx, px, ax, bx), (qy, py, ay, by)):
        meet &= np.maximum(np.minimum(q, p), np.minimum(a, b)) <= np.minimum(
            np.maximum(q, p), np.maximum(a, b)
        )
    return ~((side_a * side_b <= 0) & (side_q * side_p <= 0) & meet).any(axis=1)


def measure(name: str, plan: Any, peers: str | None) -> Row:
    """Measure one home."""
    from fleet2d import Home
    from fleet2d.floorplan.plan import FloorPlan
    from fleet2d.kernels import rasterize_cells, regions_of_cells

    bare = Home(FloorPlan.build(name, plan.free_space, cell=plan.lattice.cell))  # no furniture
    mesh, lattice, rng = bare.walls, bare.plan.lattice, np.random.default_rng(1)
    triangles = rasterize_cells(mesh, lattice.rows, lattice.columns)
    cells = np.argwhere(triangles >= 0)
    regions = regions_of_cells(mesh, cells, triangles)
    start, right, _ = regions
    centres = cells[:, ::-1] * 64 + 33
    row = Row(
        home=name,
        walls=len(walls_of(bare.plan)),
        cells=len(cells),
        all_cells_s=best(lambda: regions_of_cells(mesh, cells, triangles)),
        pieces=len(right) / len(cells),
        megabytes=sum(array.nbytes for array in regions) / 1e6,
    )
    pairs = some_pairs(centres, lattice.units_per_m, rng)
    first = slice(0, start[1])
    region = (centres[0], *(array[first] for array in regions[1:]))
    measure_points(row, bare, pairs, region)
    headings = rng.integers(0, 4096, EYES).tolist()
    chosen = rng.choice(centres, EYES).tolist()
    poses = [(*xy, heading) for xy, heading in zip(chosen, headings, strict=True)]
    measure_cells(row, bare, poses)
    if peers:
        compare_peers(row, bare, poses, peers)
    return row


def measure_points(row: Row, home: Any, pairs: tuple[Any, Any], region: tuple[Any, ...]) -> None:
    """Measure and compare what tells whether a point is visible."""
    from fleet2d.kernels import region_contains_points
    from fleet2d.sight.cached_fov import VisibilityPolygon
    from fleet2d.sight.fov import LineOfSight

    (eyes, points), lines, walls = pairs, compiled_lines(), walls_of(home.plan)
    row.query_ns = best(lambda: lines(home.walls, eyes, points)) / len(eyes) * 1e9
    (x, y), right, wall = region
    many = points[:20_000]
    seconds = best(lambda: region_contains_points(home.walls, x, y, right, wall, many))
    row.looked_up_ns = seconds / len(many) * 1e9
    few = [(eyes[i], points[i : i + SHOWN]) for i in range(0, 40 * SHOWN, SHOWN)]
    seconds = best(lambda: [seen_by_numpy(walls, eye, some) for eye, some in few], 1)
    row.numpy_us = seconds / (len(few) * SHOWN) * 1e6
    line = LineOfSight()
    wrong = sum(
        int((seen_by_numpy(walls, eye, some) != line.visible(home, *eye, some)).sum())
        for eye, some in few
    )
    row.mismatches["NumPy and lines"] = f"{wrong} of {len(few) * SHOWN} lines"
    polygons = VisibilityPolygon()
    wrong = sum(
        int((polygons.visible(home, *eye, some) != line.visible(home, *eye, some)).sum())
        for eye, some in zip(eyes[::SHOWN], points.reshape(-1, SHOWN, 2), strict=True)
    )
    row.mismatches["polygons and lines"] = f"{wrong} of {len(points)} lines"


def measure_cells(row: Row, home: Any, poses: list[Any]) -> None:
    """Measure and compare what finds the cells in view of a pose."""
    from fleet2d.kernels import cells_in_view
    from fleet2d.sight import fov
    from fleet2d.sight.cached_fov import Flashlight
    from fleet2d.sight.fov import LineOfSight

    fov.MEMORY_BYTES = 500e6
    grid, reach = (home.plan.lattice.rows, home.plan.lattice.columns), reach_in(home)
    flashlight, line = Flashlight(), LineOfSight()
    fill = best(lambda: [cells_in_view(home.walls, *pose, reach, *grid) for pose in poses])
    kept = best(lambda: [flashlight.cells(home, *pose, reach) for pose in poses])
    some = poses[:20]
    by_lines = best(lambda: [line.cells(home, *pose, reach) for pose in some], 1)
    row.fill_us, row.kept_us = fill / len(poses) * 1e6, kept / len(poses) * 1e6
    row.by_lines_us = by_lines / len(some) * 1e6
    wrong = sum(
        int((line.cells(home, *p, reach) != flashlight.cells(home, *p, reach)).sum()) for p in some
    )
    row.mismatches["flashlight and lines"] = f"{wrong} of {len(some) * home.plan.free.size} cells"


def reach_in(home: Any) -> Any:
    """Return the camera's range and angle."""
    from fleet2d.kernels import Reach

    return Reach(0, round(RANGE_M * home.plan.lattice.units_per_m) ** 2, HALF_ANGLE)


def some_pairs(centres: Any, units_per_m: float, rng: Any) -> tuple[Any, Any]:
    """Return pairs of free places within a few metres, SHOWN from each eye: (n, 2) each."""
    from fleet2d.kernels import CELL_CENTRE, SUB

    eyes = np.repeat(rng.choice(centres, PAIRS // SHOWN), SHOWN, axis=0)
    free = {tuple(cell) for cell in (centres // SUB).tolist()}
    limit = round(PAIR_M * units_per_m)
    points = np.empty_like(eyes)
    for i, eye in enumerate(eyes.tolist()):
        while True:
            x, y = (eye + rng.integers(-limit, limit, 2)).tolist()
            near = math.dist(eye, (x, y)) <= limit
            if near and (x // SUB, y // SUB) in free:
                points[i] = x // SUB * SUB + CELL_CENTRE, y // SUB * SUB + CELL_CENTRE
                break
    return eyes, points


def compiled_lines() -> Callable[..., int]:
    """Return what counts the pairs in sight: it locates each eye, then follows the line."""
    from fleet2d.kernels import pairs_in_sight

    return lambda mesh, eyes, points: int(pairs_in_sight(mesh, eyes, points).sum())


# --- Peers -------------------------------------------------------------------------------------


def compare_peers(row: Row, home: Any, poses: list[Any], python: str) -> None:
    """Let peers look from the same poses, in a process of theirs, and compare the answers."""
    plan = home.plan
    task = {
        "rings": [
            [np.asarray(r.coords)[:-1].tolist() for r in (p.exterior, *p.interiors)]
            for p in plan.polygons
        ],
        "free": plan.free.astype(int).tolist(),
        "eyes": [pose[:2] for pose in poses],
        "radius": round(RANGE_M / plan.lattice.cell),
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "task.json"
        path.write_text(json.dumps(task))
        command = [python, str(Path(__file__).with_name("sight_peers.py")), str(path)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    if done.returncode:
        row.peers["peers"] = f"failed: {done.stderr.strip().splitlines()[-1:]}"
        return
    for name, answer in json.loads(done.stdout).items():
        if "failure" in answer:
            row.peers[name] = answer["failure"]
            continue
        differ = areas_differ if name == "CGAL" else cells_differ
        row.peers[name] = f"{answer['us']:.1f} us a pose, {differ(home, poses, answer)}"


def areas_differ(home: Any, poses: list[Any], answer: dict[str, Any]) -> str:
    """Say how many visible areas differ."""
    from fleet2d.sight.fov import VisibleRegion

    lattice = home.plan.lattice
    ours = [
        VisibleRegion(home.plan, *lattice.to_metres(pose[:2]).tolist()).area_m2
        * lattice.units_per_m**2
        for pose in poses
    ]
    off = np.abs(np.array(answer["areas"]) / ours - 1) > 1e-9
    return f"{int(off.sum())} of {len(ours)} areas differ"


def cells_differ(home: Any, poses: list[Any], answer: dict[str, Any]) -> str:
    """Say how many of the cells that either has in view differ."""
    from fleet2d.sight.fov import LineOfSight

    whole, free = reach_in(home)._replace(half_angle=4096), home.plan.free
    off = total = 0
    for pose, seen in zip(poses, answer["cells"], strict=False):
        theirs = np.zeros(free.shape, bool)
        theirs.flat[seen] = True
        theirs &= free  # it shows walls, too
        ours = LineOfSight().cells(home, *pose, whole)
        off, total = off + int((ours != theirs).sum()), total + int((ours | theirs).sum())
    return f"{off / total:.2%} of {total} cells differ"


def show(rows: list[Row]) -> None:
    """Print the table."""
    print(
        f"{'home':<16}{'walls':>6}{'cells':>8}{'all cells':>11}{'a region':>10}{'pieces':>8}"
        f"{'MB':>6}{'a line':>9}{'look-up':>9}{'cells of a pose: fill':>23}{'lines':>9}{'kept':>8}"
        f"{'NumPy line':>12}"
    )
    for r in rows:
        print(
            f"{r.home:<16}{r.walls:>6}{r.cells:>8}{1e3 * r.all_cells_s:>8.1f} ms"
            f"{1e6 * r.all_cells_s / r.cells:>7.2f} us{r.pieces:>8.1f}{r.megabytes:>6.1f}"
            f"{r.query_ns:>6.0f} ns{r.looked_up_ns:>6.0f} ns{r.fill_us:>20.1f} us"
            f"{r.by_lines_us:>6.0f} us{r.kept_us:>5.1f} us{r.numpy_us:>9.1f} us"
        )
    print("\nmismatches, and peers (their time for all that is visible from a pose):")
    for r in rows:
        parts = [f"{name}: {what}" for name, what in (r.mismatches | r.peers).items()]
        print(f"  {r.home}: {'; '.join(parts)}")


def main() -> None:
    """Measure, print, and store."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--peers", help="a Python with pyvispoly and tcod installed")
    parser.add_argument("--json", type=Path, help="where to store the figures")
    options = parser.parse_args()
    print(f"{platform.processor() or platform.machine()}, Python {platform.python_version()}")
    rows = [measure(name, plan, options.peers) for name, plan in homes(options.data).items()]
    show(rows)
    if not options.peers:
        print("  peers: not compared, for --peers names no Python that has them")
    if options.json:
        figures = {"homes": [asdict(row) for row in rows]}
        options.json.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    sys.exit(main())
