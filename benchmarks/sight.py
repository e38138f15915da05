"""How long sight takes: regions, lines of sight, cells in view, and the seen area over a month.

    python benchmarks/sight.py [--data DIR] [--peers PEERS_PYTHON] [--json FILE] [--no-month]

Everything runs on one core; times are the best of several runs in this process, compiling left out.
DIR holds houseexpo/*.json, ros_maps/*/map.yaml and valetudo/*.json. `--peers` names a Python with
numpy, pyvispoly (CGAL's exact triangular expansion) and tcod (libtcod's symmetric shadow casting)
installed; they get the same walls, the same poses, and their answers are compared with ours.
NumPy is always compared with: every wall is tried for every line.
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
    query_ns: float  # one line of sight, from ever new places
    looked_up_ns: float  # one point in a region that is there already
    fill_us: float  # cells in view of a pose
    by_lines_us: float  # the same, by a line of sight to each cell
    kept_us: float  # the same, of a pose that the flashlight has kept
    numpy_us: float  # one line of sight, every wall tried
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

    free = shapely.union_all([shapely.transform(p, plan.lattice.to_metres) for p in plan.polygons])
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
    from fleet2d.kernels.mesh import rasterize_cells
    from fleet2d.kernels.region import region_contains_points, regions_of_cells
    from fleet2d.kernels.seen import Reach, bench_for, cells_in_view
    from fleet2d.sight.flashlight import Flashlight
    from fleet2d.sight.line_of_sight import LineOfSight
    from fleet2d.sight.visibility_polygon import VisibilityPolygon

    assert isinstance(plan, FloorPlan)
    bare = Home(FloorPlan.build(name, _free(plan), cell=plan.lattice.cell))  # walls, no furniture
    plan, walls, mesh = bare.plan, walls_of(bare.plan), bare.walls
    lattice, rng = plan.lattice, np.random.default_rng(1)
    triangles = rasterize_cells(mesh, lattice.rows, lattice.columns)
    cells = np.argwhere(triangles >= 0)
    start, right, wall = regions_of_cells(mesh, cells, triangles)
    centres = cells[:, ::-1] * 64 + 33

    eyes, points = some_pairs(centres, lattice.units_per_m, rng)
    lines = compiled_lines()
    query = best(lambda: lines(mesh, eyes, points))
    first, many = centres[0], points[:20_000]
    piece = slice(0, start[1])
    looked_up = best(
        lambda: region_contains_points(mesh, *first.tolist(), right[piece], wall[piece], many)
    )
    few = [(eyes[i], points[i : i + SHOWN]) for i in range(0, 40 * SHOWN, SHOWN)]
    numpy_s = best(lambda: [seen_by_numpy(walls, eye, some) for eye, some in few], 1)

    reach = Reach(0, round(RANGE_M * lattice.units_per_m) ** 2, HALF_ANGLE)
    poses = [
        (*xy, int(heading))
        for xy, heading in zip(
            rng.choice(centres, EYES).tolist(), rng.integers(0, 4096, EYES), strict=True
        )
    ]
    bench = bench_for(mesh, lattice.rows, lattice.columns)
    flashlight = Flashlight(memory_mb=500)
    fill = best(lambda: [cells_in_view(mesh, *pose, reach, bench) for pose in poses])
    kept = best(lambda: [flashlight.cells(bare, *pose, reach) for pose in poses])
    some = poses[:20]
    by_lines = best(lambda: [LineOfSight().cells(bare, *pose, reach) for pose in some], 1)
    row = Row(
        home=name,
        walls=len(walls),
        cells=len(cells),
        all_cells_s=best(lambda: regions_of_cells(mesh, cells, triangles)),
        pieces=len(right) / len(cells),
        megabytes=(start.nbytes + right.nbytes + wall.nbytes) / 1e6,
        query_ns=query / len(eyes) * 1e9,
        looked_up_ns=looked_up / len(many) * 1e9,
        fill_us=fill / EYES * 1e6,
        by_lines_us=by_lines / len(some) * 1e6,
        kept_us=kept / EYES * 1e6,
        numpy_us=numpy_s / (len(few) * SHOWN) * 1e6,
    )
    wrong = sum(
        int((seen_by_numpy(walls, eye, some) != LineOfSight().visible(bare, *eye, some)).sum())
        for eye, some in few
    )
    row.mismatches["numpy"] = f"{wrong} of {len(few) * SHOWN} lines"
    polygons = VisibilityPolygon()
    wrong = sum(
        int((polygons.visible(bare, *eye, some) != LineOfSight().visible(bare, *eye, some)).sum())
        for eye, some in zip(eyes[::SHOWN], points.reshape(-1, SHOWN, 2), strict=True)
    )
    row.mismatches["polygon, line"] = f"{wrong} of {len(points)}"
    wrong = sum(
        int((LineOfSight().cells(bare, *p, reach) != flashlight.cells(bare, *p, reach)).sum())
        for p in some
    )
    row.mismatches["flashlight, line"] = f"{wrong} of {len(some) * plan.free.size} cells"
    if peers:
        compare_peers(row, bare, poses, reach, peers)
    return row


def _free(plan: Any) -> Any:
    import shapely

    return shapely.union_all([shapely.transform(p, plan.lattice.to_metres) for p in plan.polygons])


def some_pairs(centres: Any, units_per_m: float, rng: Any) -> tuple[Any, Any]:
    """Return pairs of free places within a few metres, SHOWN from each eye: (n, 2) each."""
    from fleet2d.kernels.mesh import CELL_CENTRE, SUB

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
    """Return a loop over pairs as the engine's: it locates the eye, then follows the line."""
    from fleet2d.kernels._jit import kernel
    from fleet2d.kernels.mesh import locate
    from fleet2d.kernels.sight import walk_line_of_sight

    @kernel
    def count(mesh: Any, eyes: Any, points: Any) -> int:
        vertices, triangles, neighbors = mesh.vertices, mesh.triangles, mesh.neighbors
        seen = 0
        for i in range(eyes.shape[0]):
            x, y = eyes[i, 0], eyes[i, 1]
            at = locate(mesh, x, y)
            seen += walk_line_of_sight(
                vertices, triangles, neighbors, x, y, at, points[i, 0], points[i, 1]
            )
        return seen

    return count


# --- Peers -------------------------------------------------------------------------------------


def compare_peers(row: Row, home: Any, poses: list[Any], reach: Any, python: str) -> None:
    """Let peers look from the same poses, in a process of theirs, and compare the answers."""
    from fleet2d.sight.line_of_sight import LineOfSight
    from fleet2d.sight.region import VisibleRegion

    plan, lattice = home.plan, home.plan.lattice
    rings = [
        [np.asarray(r.coords)[:-1].tolist() for r in (p.exterior, *p.interiors)]
        for p in plan.polygons
    ]
    task = {
        "rings": rings,
        "free": plan.free.astype(int).tolist(),
        "eyes": [pose[:2] for pose in poses],
        "radius": round(RANGE_M / lattice.cell),
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "task.json"
        path.write_text(json.dumps(task))
        command = [python, __file__, "--child", str(path)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    if done.returncode:
        row.peers["peers"] = f"failed: {done.stderr.strip().splitlines()[-1:]}"
        return
    for name, answer in json.loads(done.stdout).items():
        if "failure" in answer:
            row.peers[name] = answer["failure"]
            continue
        if name == "CGAL":
            ours = [
                VisibleRegion(plan, *lattice.to_metres(pose[:2]).tolist()).area_m2
                * lattice.units_per_m**2
                for pose in poses
            ]
            off = np.abs(np.array(answer["areas"]) / ours - 1) > 1e-9
            differ = f"{int(off.sum())} of {len(ours)} areas differ"
        else:
            whole = reach._replace(half_angle=4096)
            ours_cells = [LineOfSight().cells(home, *pose, whole) for pose in poses[:50]]
            theirs = [np.zeros(plan.free.shape, bool) for _ in ours_cells]
            for mask, seen in zip(theirs, answer["cells"], strict=True):
                mask.flat[seen] = True
                mask &= plan.free  # it shows walls, too
            off_cells = sum(int((a != b).sum()) for a, b in zip(ours_cells, theirs, strict=True))
            total = sum(int((a | b).sum()) for a, b in zip(ours_cells, theirs, strict=True))
            differ = f"{off_cells / total:.2%} of {total} cells differ"
        row.peers[name] = f"{answer['us']:.1f} us a region, {differ}"


def child(path: Path) -> dict[str, Any]:
    """Look from all poses with each peer that is installed."""
    task = json.loads(path.read_text())
    found: dict[str, Any] = {}
    for name, look in (("CGAL", look_with_cgal), ("libtcod", look_with_tcod)):
        try:
            found[name] = look(task)
        except Exception as error:  # noqa: BLE001, whatever a peer does, the others go on
            found[name] = {"failure": f"not compared: {type(error).__name__}: {error}"}
    return found


def look_with_cgal(task: dict[str, Any]) -> dict[str, Any]:
    """Return the areas of the regions, and the time for one."""
    import pyvispoly as cgal  # type: ignore[import-not-found]

    calculators = []
    for rings in task["rings"]:
        parts = [cgal.Polygon([cgal.Point(x, y) for x, y in ring]) for ring in rings]
        calculators.append(
            (parts[0], cgal.VisibilityPolygonCalculator(cgal.PolygonWithHoles(parts[0], parts[1:])))
        )
    jobs = []
    for x, y in task["eyes"]:
        eye = cgal.Point(x, y)
        jobs += [(calc, eye) for outer, calc in calculators if outer.contains(eye)][:1]
    began = time.perf_counter()
    regions = [calculator.compute_visibility_polygon(eye) for calculator, eye in jobs]
    elapsed = time.perf_counter() - began
    areas = [float(region.area()) for region in regions]
    return {"us": elapsed / len(jobs) * 1e6, "areas": areas}


def look_with_tcod(task: dict[str, Any]) -> dict[str, Any]:
    """Return the cells in range of the first poses, and the time for one."""
    import tcod  # type: ignore[import-not-found]
    import tcod.map  # type: ignore[import-not-found]

    free = np.array(task["free"], dtype=bool)
    eyes = [(y // 64, x // 64) for x, y in task["eyes"]]
    style = {"radius": task["radius"], "algorithm": tcod.constants.FOV_SYMMETRIC_SHADOWCAST}
    tcod.map.compute_fov(free, eyes[0], **style)
    began = time.perf_counter()
    seen = [tcod.map.compute_fov(free, eye, **style) for eye in eyes]
    elapsed = time.perf_counter() - began
    return {
        "us": elapsed / len(eyes) * 1e6,
        "cells": [np.flatnonzero(mask).tolist() for mask in seen[:50]],
    }


# --- A month -----------------------------------------------------------------------------------


def month(repeats: int = REPEATS) -> dict[str, float]:
    """Return the time to simulate the base month [s], without and with what robots have seen."""
    from collections.abc import Set
    from typing import ClassVar

    import fleet2d
    from fleet2d.engine.simulation import Simulation

    class Exposed(fleet2d.Algorithm):
        """Adds up how much of each room was in view."""

        needs: ClassVar[Set[str]] = {"exposure"}

        def start(self, home: Any) -> None:
            self.sum = 0

        def update(self, history: Any, state: Any) -> None:
            self.sum = self.sum + history.exposure

    class Idle(fleet2d.Algorithm):
        """Does nothing: what an algorithm costs that asks for nothing."""

        def update(self, history: Any, state: Any) -> None:
            return None

    base = fleet2d.load_scenario(None, algorithms={})
    base = base.model_copy(update={"algorithms": {"idle": Idle()}})
    layers = fleet2d.load_scenario(None, "floorplan.layers={explored: {}}")
    layers = layers.model_copy(update={"algorithms": {"exposed": Exposed()}})
    last = fleet2d.load_scenario(None, "floorplan.layers={explored: {}, last_seen: {}}")
    last = last.model_copy(update={"algorithms": {"exposed": Exposed()}})
    cases = {
        "with an algorithm that does nothing": base,
        "explored and exposure": layers,
        "last seen besides": last,
    }
    times: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(repeats + 1):
        for name, scenario in cases.items():
            simulation = Simulation(scenario)
            began = time.perf_counter()
            simulation.run()
            times[name].append(time.perf_counter() - began)
    return {name: min(taken[1:]) for name, taken in times.items()}


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
    parser.add_argument("--no-month", action="store_true", help="leave out the month")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        print(json.dumps(child(options.child)))
        return
    print(f"{platform.processor() or platform.machine()}, Python {platform.python_version()}")
    rows = [measure(name, plan, options.peers) for name, plan in homes(options.data).items()]
    show(rows)
    if not options.peers:
        print("  peers: not compared, for --peers names no Python that has them")
    months = {} if options.no_month else month()
    for name, seconds in months.items():
        more = seconds / next(iter(months.values())) - 1
        print(f"base month, {name}: {seconds:.3f} s ({more:+.0%})")
    if options.json:
        figures = {"homes": [asdict(row) for row in rows], "month_s": months}
        options.json.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    sys.exit(main())
