"""How long homes take to read, and what comes of them beside what their files say.

    python benchmarks/homes.py speed DATA [--json FILE]   # milliseconds, the best of five
    python benchmarks/homes.py rooms DATA                 # a table of rooms and areas, in Markdown

DATA is the folder with `houseexpo`, `ros_maps` and `valetudo`. `speed` takes the fifty plans of
HouseExpo (from file to rooms, doorways and mesh), a map of 500 x 500 pixels of the ROS
`map_server` that is written for it, synthetic homes, furnishing, and for the jagged maps what is
visible from each cell. Kernels are compiled before. Times are of the processor: other work on the
machine doesn't count.

`rooms` sets the free area beside that which the file's outline encloses, and the rooms with a label
beside the file's boxes: how many there are, and their areas; a room with several labels counts for
each. Boxes overlap each other and the walls, so that their areas add up to more than there is.
"""

import argparse
import json
import statistics
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
import shapely

from fleet2d.floorplan.furnish import furnish
from fleet2d.floorplan.load import load_floorplan
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms.room import room_type, usual_type
from fleet2d.homes.synthetic.source import Synthetic
from fleet2d.kernels import rasterize_cells, regions_of_cells

ROUNDS = 5
HOMES = 50
ROS_KEYS = """resolution: 0.05
origin: [0, 0, 0]
occupied_thresh: 0.65
free_thresh: 0.196
negate: 0
"""


def main() -> None:
    arguments = _arguments()
    if arguments.what == "rooms":
        for line in room_table(arguments.data):
            print(line)
        return
    rows = list(speed(arguments.data))
    for name, value in rows:
        print(f"{name:<52}{value:>10.1f} ms")
    if arguments.json:
        arguments.json.write_text(json.dumps(dict(rows), indent=1) + "\n", encoding="utf-8")


def speed(data: Path) -> Iterable[tuple[str, float]]:
    """Yield what was timed, and how long it took [ms]."""
    plans = plan_times(data)
    yield f"HouseExpo, {len(plans)} plans: median", statistics.median(plans)
    yield f"HouseExpo, {len(plans)} plans: worst", max(plans)
    yield "ROS map of 500 x 500 pixels", ros_map_time()
    for path in _maps(data):
        yield f"map {path.parent.name}/{path.stem}", _best(lambda path=path: load_floorplan(path))
    homes = synthetic_times()
    yield f"synthetic home, seeds 0 to {HOMES - 1}: median", statistics.median(homes)
    yield f"synthetic home, seeds 0 to {HOMES - 1}: worst", max(homes)
    bare = [Synthetic(seed=seed).load() for seed in range(HOMES)]
    pieces = [_best(lambda plan=plan: furnish(plan), rounds=2) for plan in bare]
    yield "furnishing a synthetic home: median", statistics.median(pieces)
    for path, cells, took in region_times(data):
        yield f"visible from each of {cells} cells, {path.parent.name}/{path.stem}"[:52], took


def plan_times(data: Path) -> list[float]:
    """Return how long the plans of HouseExpo take, from file to rooms and mesh [ms]."""
    return [_best(lambda path=path: load_floorplan(path)) for path in _houseexpo(data)]


def ros_map_time() -> float:
    """Return how long a map of 500 x 500 pixels takes [ms]."""
    with tempfile.TemporaryDirectory() as folder:
        path = write_ros_map(Path(folder))
        return _best(lambda: load_floorplan(path))


def cluttered_map_time(data: Path) -> float:
    """Return how long a map of 844 x 1,700 pixels of offices full of clutter takes [ms]."""
    image = data.resolve() / "captured" / "clutter" / "map_with_clutter.png"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.yaml"
        path.write_text(f"image: {image}\n{ROS_KEYS}", encoding="utf-8")
        return _best(lambda: load_floorplan(path), rounds=2)


def synthetic_times() -> list[float]:
    """Return how long synthetic homes take, one for each seed [ms]."""
    return [_best(lambda seed=seed: Synthetic(seed=seed).load()) for seed in range(HOMES)]


def furnished_times() -> list[float]:
    """Return how long furnished synthetic homes take that were never made before [ms]."""
    Synthetic(seed=HOMES, furnish=True).plan()
    times = []
    for seed in range(HOMES):
        start = time.process_time()
        Synthetic(seed=seed, furnish=True).plan()
        times.append(1e3 * (time.process_time() - start))
    return times


def region_times(data: Path) -> Iterable[tuple[Path, int, float]]:
    """Yield each jagged map, its number of free cells, and how long all their views take [ms]."""
    for path in _maps(data):
        plan = load_floorplan(path)
        cells = int(np.count_nonzero(plan.free))
        yield path, cells, _best(lambda plan=plan: look_around(plan), rounds=2)


def look_around(plan: FloorPlan) -> object:
    """Return what is visible from the middle of each free cell."""
    mesh, lattice = plan.mesh, plan.lattice
    triangles = rasterize_cells(mesh, lattice.rows, lattice.columns)
    return regions_of_cells(mesh, np.argwhere(triangles >= 0), triangles)


def write_ros_map(folder: Path, side: int = 500) -> Path:
    """Write a map of a synthetic home with noise, `side` pixels wide and high; return its YAML."""
    plan = Synthetic(seed=7, area_m2=186, bedrooms=3).load()
    lattice = plan.lattice
    image = np.full((side, side), 205, np.uint8)
    grey = np.where(plan.free, 254, 0).astype(np.uint8)
    rows, columns = min(side, lattice.rows), min(side, lattice.columns)
    image[:rows, :columns] = grey[:rows, :columns]
    pixels = np.random.default_rng(1).integers(0, side, (400, 2))
    image[pixels[:, 0], pixels[:, 1]] = 0
    header = f"P5\n{side} {side}\n255\n".encode()
    (folder / "map.pgm").write_bytes(header + image[::-1].tobytes())
    path = folder / "map.yaml"
    path.write_text(f"image: map.pgm\n{ROS_KEYS}", encoding="utf-8")
    return path


def room_table(data: Path) -> Iterable[str]:
    """Yield the lines of a table: each plan, and its rooms beside the source's labels."""
    yield "| plan | m²: file | here | labels | rooms | others | m² by label: file → here |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for path in _houseexpo(data):
        content = json.loads(path.read_text(encoding="utf-8"))
        outline = shapely.make_valid(shapely.Polygon(content["verts"]), method="structure")
        boxes = [
            (room_type(kind), abs((x1 - x0) * (y1 - y0)))
            for kind, found in (content.get("room_category") or {}).items()
            for x0, y0, x1, y1 in found
        ]
        yield _row(path.stem[:8], outline.area, boxes, load_floorplan(path))
    for path in sorted((data / "valetudo").glob("*.json")):
        layers = json.loads(path.read_text(encoding="utf-8"))["layers"]
        floor = [layer for layer in layers if layer["type"] in ("floor", "segment")]
        areas = [layer["metaData"]["area"] / 1e4 for layer in floor]  # of cm²
        rooms = [
            (usual_type(layer["metaData"].get("name") or "unknown"), area)
            for layer, area in zip(floor, areas, strict=True)
            if layer["type"] == "segment"
        ]
        yield _row(path.stem, sum(areas), rooms, load_floorplan(path))


def _row(name: str, area: float, labels: Sequence[tuple[str, float]], plan: FloorPlan) -> str:
    given: Counter[str] = Counter()
    found: Counter[str] = Counter()
    for kind, size in labels:
        given[kind] += size
    named = [room for room in plan.rooms if room.labels or room.type in given]
    for room in named:
        for kind in room.labels or (room.type,):
            found[kind] += room.area_m2
    kinds = dict.fromkeys([*given, *found])
    by_type = ", ".join(f"{kind} {given[kind]:.1f} → {found[kind]:.1f}" for kind in kinds)
    others = len(plan.rooms) - len(named)
    cells = (area, plan.area_m2, len(labels), len(named), others, by_type or "–")
    shown = (f"{value:.1f}" if isinstance(value, float) else str(value) for value in cells)
    return f"| {name} | {' | '.join(shown)} |"


def _houseexpo(data: Path) -> list[Path]:
    return sorted((data / "houseexpo").glob("*.json"))


def _maps(data: Path) -> list[Path]:
    return [
        *sorted((data / "ros_maps").glob("*/map.yaml")),
        *sorted((data / "valetudo").glob("*.json")),
    ]


def _best(work: Callable[[], object], rounds: int = ROUNDS) -> float:
    """Return the shortest time that the work took [ms], after one run that doesn't count."""
    work()
    times = []
    for _ in range(rounds):
        start = time.process_time()
        work()
        times.append(1e3 * (time.process_time() - start))
    return min(times)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("what", choices=("speed", "rooms"))
    parser.add_argument("data", type=Path, help="folder with houseexpo, ros_maps and valetudo")
    parser.add_argument("--json", type=Path, help="file to write the times to")
    return parser.parse_args()


if __name__ == "__main__":
    main()
