"""How close generated homes come to real plans, and how long one takes.

    python benchmarks/synthetic_homes.py PLANS [--variety 1] [--homes N] [--plans N]
        [--check] [--figure P] [--json J]
    python benchmarks/synthetic_homes.py faults [--homes 60] [--first SEED]

PLANS is a folder of plans, of which the first 1,000 by name are read. Where it has an INDEX.tsv, as
that of HouseExpo has, the kinds `empty` (no rooms), `tiny` (one room of a few metres) and `big` (no
homes: offices and floors of flats) are left out. All homes are drawn with default settings, seeds
from 0. Compared like with like: wall corners after the outline is simplified to 10 cm, because
HouseExpo's outlines are traced from pixels; doorways, and the graph of rooms that they make, as
each floor plan has them: those of its file, where that records doors, else those found in walls.
The last rows compare the outlines of small and large homes.

`faults` counts what an architect would refuse, by kind, and the processor time of furnished homes.
"""

import argparse
import csv
import json
import statistics
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from fleet2d.floorplan.checkup import checkup
from fleet2d.floorplan.load import load_floorplan
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.homes.synthetic.source import Synthetic

LEFT_OUT = ("empty", "tiny", "big")
TOLERANCE_M = 0.1
# One use under two names.
SAME = {"toilet": "bathroom", "child_room": "bedroom", "guest_room": "bedroom", "hall": "hallway"}
CORRIDORS = {"hallway", "hall", "entryway", "lobby", "corridor"}
OUTLINES = ("longest side [m]", "aspect ratio")
SIZES_OF = ("living_room", "kitchen", "dining_room", "bedroom", "bathroom", "office", "garage")

# The way from the front door to the living room leads through no others.
WAYS = {"entryway", "hallway", "living_room", "dining_room", "kitchen"}
HALL_M = (1.0, 1.6)
BATHROOM_M2 = (3.0, 9.0)
WINDOW_M = 0.8
MAX_SHARES = {"living_room": 0.5, "kitchen": 0.25}
ROUNDING = 0.051  # of lengths and areas on cells of 5 cm

Values = dict[str, list[float]]
PAD = 8  # cells around a home
CELL_M = 0.05


def main() -> None:
    arguments = _arguments()
    if arguments.plans_folder == Path("faults"):
        count_faults(range(arguments.first, arguments.first + arguments.homes))
        return
    real = measures(_plans(arguments.plans_folder, arguments.plans))
    report, synthetic = _compare(real, {"variety": arguments.variety}, arguments)
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    if arguments.figure:
        draw(real, synthetic, arguments.figure)


def _compare(
    real: Values, settings: dict[str, Any], arguments: argparse.Namespace
) -> tuple[dict[str, Any], Values]:
    """Print how close homes of some settings come to real plans; return the table and measures."""
    homes, seconds = generated(arguments.homes, settings)
    synthetic = measures(homes)
    rows = [_row(name, real[name], synthetic[name]) for name in real if name in synthetic]
    print(f"{len(real['area [m2]'])} real plans, {len(homes)} synthetic homes of {settings}")
    print(f"{'':<28}{'real plans: quartiles':>26}{'synthetic: quartiles':>26}{'KS':>8}{'n':>12}")
    for row in rows:
        print(_written(row))
    alike = len(homes) - len({plan.named("home").digest for plan in homes})
    print(f"alike: {alike}; with notes: {sum(bool(plan.notes) for plan in homes)}")
    if arguments.check:
        wrong = [plan.name for plan in homes if checkup(plan)]
        print(f"check-up: {len(wrong)} homes with findings {' '.join(wrong[:10])}".rstrip())
    low, middle, high = min(seconds), statistics.median(seconds), max(seconds)
    slow = float(np.percentile(seconds, 95))
    print(f"ms per home: {1e3 * middle:.1f} median, {1e3 * low:.1f} to {1e3 * high:.1f},", end=" ")
    print(f"95 % below {1e3 * slow:.1f}")
    return {"rows": rows, "seconds": {"min": low, "median": middle, "max": high}}, synthetic


def generated(count: int, settings: dict[str, Any]) -> tuple[list[FloorPlan], list[float]]:
    """Return homes by seed, and how long each took [s]; kernels are compiled before."""
    Synthetic(**settings).load()
    homes, seconds = [], []
    for seed in range(count):
        start = time.perf_counter()
        homes.append(Synthetic(seed=seed, **settings).load())
        seconds.append(time.perf_counter() - start)
    return homes, seconds


def measures(plans: Iterable[FloorPlan]) -> Values:
    """Return what is compared: for each measure its values over all plans or rooms."""
    found: Values = {name: [] for name in ("area [m2]", "rooms", "bedrooms", "bathrooms")}
    found |= {f"{kind} [m2]": [] for kind in SIZES_OF}
    found |= {
        name: []
        for name in (
            "convexity of rooms", "corridor share", "doorways", "doorway width [m]",
            "doors with a leaf", "degree of rooms", "wall corners", "outline corners",
            "compactness",
            *(f"{measure}, {size}" for measure in OUTLINES for size in ("<= 200 m2", "> 200 m2")),
        )
    }  # fmt: skip
    for plan in plans:
        kinds = [SAME.get(room.type, room.type) for room in plan.rooms]
        found["area [m2]"].append(plan.area_m2)
        found["rooms"].append(len(plan.rooms))
        found["bedrooms"].append(kinds.count("bedroom"))
        found["bathrooms"].append(kinds.count("bathroom"))
        for kind, room in zip(kinds, plan.rooms, strict=True):
            if kind in SIZES_OF:
                found[f"{kind} [m2]"].append(room.area_m2)
        found["convexity of rooms"] += [convexity(plan, room.index) for room in plan.rooms]
        halls = [room.area_m2 for room in plan.rooms if room.type in CORRIDORS]
        found["corridor share"].append(sum(halls) / plan.area_m2)
        size = "> 200 m2" if plan.area_m2 > 200 else "<= 200 m2"
        x0, y0, x1, y1 = plan.bounds
        short, long = sorted((x1 - x0, y1 - y0))
        for measure, value in zip(OUTLINES, (long, long / short), strict=True):
            found[f"{measure}, {size}"].append(value)
        inner = [door for door in plan.doorways if len(set(door.rooms)) == 2]
        found["doorway width [m]"] += [door.width_m for door in inner]
        found["doors with a leaf"].append(sum(door.leaf for door in inner))
        pairs = {frozenset(door.rooms) for door in inner}
        if pairs:
            found["doorways"].append(len(pairs))
            found["degree of rooms"] += [
                float(sum(room.index in pair for pair in pairs)) for room in plan.rooms
            ]
        shape = shapely.union_all(plan.polygons)
        outline = _outline(shape, plan.lattice.units_per_m)
        found["wall corners"].append(_corners(shape, TOLERANCE_M * plan.lattice.units_per_m))
        found["outline corners"].append(_corners(outline, 0.2 * plan.lattice.units_per_m))
        found["compactness"].append(outline.area / shapely.envelope(outline).area)
    return {name: values for name, values in found.items() if values}


def count_faults(seeds: Sequence[int]) -> None:
    """Print how many homes have which fault, and the processor time of a furnished home."""
    counts: Counter[str] = Counter()
    seconds = []
    faulty = 0
    for seed in seeds:
        start = time.process_time()
        plan = Synthetic(seed=seed, furnish=True).plan()
        seconds.append(time.process_time() - start)
        found = set(faults(plan))
        counts.update(found)
        faulty += bool(found)
    print(f"{faulty} of {len(seeds)} homes have faults")
    for fault, number in counts.most_common():
        print(f"  {number:3} {fault}")
    print(f"  {1e3 * statistics.median(seconds):.0f} ms of processor time for a furnished home")


def faults(plan: FloorPlan) -> Iterator[str]:
    """Yield the faults of a home."""
    yield from faults_of_ways(plan)
    yield from faults_of_sizes(plan)
    outside = outside_of(plan)
    for room in plan.rooms:
        cells = plan.room_of_cell == room.index
        if {"kitchen", "dining_room"} & set(room.labels):
            lit = (ndimage.binary_dilation(np.pad(cells, PAD), iterations=3) & outside).sum()
            if lit * CELL_M < WINDOW_M:
                yield f"a {room.type} at no outer wall"
        if room.type == "hallway":
            width = 2 * CELL_M * float(ndimage.distance_transform_edt(np.pad(cells, 1)).max())
            if not HALL_M[0] - 2 * ROUNDING <= width <= HALL_M[1] + 2 * ROUNDING:
                yield f"a hall outside of {HALL_M[0]} to {HALL_M[1]} m"


def faults_of_ways(plan: FloorPlan) -> Iterator[str]:
    """Yield what is wrong with the ways to the living room."""
    kinds = [room.type for room in plan.rooms]
    front = plan.room_at(*plan.entrance) if plan.entrance else None
    reached = {front.index} if front is not None else set()
    for _ in plan.rooms:
        pairs = [door.rooms for door in plan.doorways if reached & set(door.rooms)]
        reached |= {i for pair in pairs for i in pair if kinds[i] in WAYS}
    if kinds.index("living_room") not in reached:
        yield "the way to the living room leads through a garage, storage or private room"
    if {"living_room", "garage"} in [{kinds[i] for i in door.rooms} for door in plan.doorways]:
        yield "a garage that opens to the living room"


def faults_of_sizes(plan: FloorPlan) -> Iterator[str]:
    """Yield what is wrong with the areas of the rooms."""
    area_of = {room.type: room.area_m2 for room in plan.rooms}
    living = area_of["living_room"]
    for room in plan.rooms:
        if room.type == "bathroom" and not BATHROOM_M2[0] <= room.area_m2 <= BATHROOM_M2[1]:
            yield f"a bathroom outside of {BATHROOM_M2[0]:g} to {BATHROOM_M2[1]:g} m2"
        if room.type != "garage" and room.area_m2 > living:
            yield "a room larger than the living room"
    for kind, most in MAX_SHARES.items():
        if "bedroom" in area_of and area_of.get(kind, 0.0) > most * plan.area_m2:
            yield f"a {kind} of more than {most:.0%} of the home"


def outside_of(plan: FloorPlan) -> NDArray[np.bool_]:
    """Return the cells outside of a home, whose inner walls and doors are closed."""
    free = np.pad(plan.room_of_cell >= 0, PAD)
    closed = ndimage.binary_closing(free, iterations=3)
    parts, _ = ndimage.label(~closed)
    outside: NDArray[np.bool_] = parts == parts[0, 0]
    return outside


def convexity(plan: FloorPlan, room: int) -> float:
    """Return the area of a room over that of its convex hull, 1 for a rectangle."""
    rows, columns = np.nonzero(plan.room_of_cell == room)
    corners = [np.column_stack((columns + x, rows + y)) for x in (0, 1) for y in (0, 1)]
    return len(rows) / float(shapely.MultiPoint(np.concatenate(corners)).convex_hull.area)


def _outline(shape: Any, unit: float) -> shapely.Polygon:
    """Return a home as seen from outside: walls and doorways closed, its front door's niche cut."""
    shape = shape.buffer(0.2 * unit, join_style="mitre").buffer(-0.7 * unit, join_style="mitre")
    parts = shapely.get_parts(shape.buffer(0.5 * unit, join_style="mitre"))
    return shapely.Polygon(max(parts, key=lambda part: part.area).exterior)


def _corners(shape: Any, tolerance: float) -> float:
    """Return how many corners a shape has."""
    rings = shapely.get_rings(shapely.get_parts(shapely.simplify(shape, tolerance)))
    return float(sum(len(ring.coords) - 1 for ring in rings))


def ks_distance(first: Sequence[float], second: Sequence[float]) -> float:
    """Return the two-sample Kolmogorov-Smirnov distance: 0 the same, 1 nothing in common."""
    values = np.concatenate([first, second])
    shares = [
        np.searchsorted(np.sort(sample), values, side="right") / len(sample)
        for sample in (first, second)
    ]
    return float(np.abs(shares[0] - shares[1]).max())


def draw(real: Values, synthetic: Values, path: Path) -> None:
    """Draw the distributions of real plans and synthetic homes, one panel a measure."""
    from matplotlib.figure import Figure

    from fleet2d.viewing.pictures.floorplan import drawing_style

    names = [name for name in real if name in synthetic]
    columns = 5
    rows = -(-len(names) // columns)
    with drawing_style():
        figure = Figure(figsize=(2.9 * columns, 2.2 * rows), dpi=110, layout="constrained")
        for number, name in enumerate(names):
            axes = figure.add_subplot(rows, columns, number + 1)
            drawn = ((real[name], "#3b4048", "real"), (synthetic[name], "#2f6fc8", "synthetic"))
            for values, color, label in drawn:
                ordered = np.sort(values)
                shares = np.arange(1, len(ordered) + 1) / len(ordered)
                axes.step(ordered, shares, color=color, label=label)
            distance = ks_distance(real[name], synthetic[name])
            axes.set_title(f"{name}  KS {distance:.2f}", fontsize=9)
            axes.set_xlim(0, 1.05 * float(np.percentile([*real[name]], 98)) + 1)
            axes.tick_params(labelsize=7)
            if not number:
                axes.legend(fontsize=7, frameon=False)
        figure.savefig(path)


def _row(name: str, real: Sequence[float], synthetic: Sequence[float]) -> dict[str, Any]:
    def quartiles(values: Sequence[float]) -> list[float]:
        found: list[float] = np.percentile(values, [25, 50, 75]).tolist()
        return found

    return {
        "measure": name,
        "real": quartiles(real),
        "synthetic": quartiles(synthetic),
        "ks": ks_distance(real, synthetic),
        "n": [len(real), len(synthetic)],
    }


def _written(row: dict[str, Any]) -> str:
    def three(values: list[float]) -> str:
        digits = 2 if max(values) < 5 else 1
        return " / ".join(f"{value:.{digits}f}" for value in values)

    n = f"{row['n'][0]}, {row['n'][1]}"
    return (
        f"{row['measure']:<28}{three(row['real']):>26}{three(row['synthetic']):>26}"
        f"{row['ks']:>8.2f}{n:>14}"
    )


def _plans(folder: Path, most: int) -> list[FloorPlan]:
    index = folder / "INDEX.tsv"
    if index.exists():
        with index.open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file, delimiter="\t"))
        paths = [folder / f"{row['id']}.json" for row in rows if row["kind"] not in LEFT_OUT]
    else:
        paths = sorted(path for path in folder.iterdir() if path.is_file())
    return [load_floorplan(path) for path in paths[:most]]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "plans_folder", type=Path, metavar="PLANS", help="folder of plans; or faults"
    )
    parser.add_argument("--variety", type=float, default=0.0)
    parser.add_argument("--plans", type=int, default=1000, help="the most real plans to read")
    parser.add_argument("--homes", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="the first seed for faults")
    parser.add_argument("--check", action="store_true", help="give each home a check-up, too")
    parser.add_argument("--figure", type=Path, help="PNG to draw the distributions to")
    parser.add_argument("--json", type=Path, help="file to write the table to")
    return parser.parse_args()


if __name__ == "__main__":
    main()
