"""How well homes survive what is done to their maps, and rooms are found as people see them.

    python benchmarks/maps.py damaged --maps 1000   # clean plans with defects, the plan as truth
    python benchmarks/maps.py captured              # real maps with true rooms, of ../shared/data
    python benchmarks/maps.py held-out              # the same, limits chosen on other places' maps
    python benchmarks/maps.py changed               # real maps turned, coarser, at other thresholds

A map is damaged by some of noise, rays, shut doors, furniture, rotation, another resolution, grey
for unknown, and threshold, all drawn from its number. Truth are the rooms of the clean
plan, found from its walls. Scores are the mean IoU of each true room with its best room, and recall
and precision at an IoU of 0.5.
"""

import argparse
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from copy import deepcopy
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import MagicMock, patch

import numpy as np
import shapely
from shapely import Polygon, affinity

import fleet2d
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms import division, shape
from fleet2d.floorplan.rooms.shape import (
    IN_RAGGED_WALLS,
    IN_STRAIGHT_WALLS,
    OF_VACUUMS,
    Hills,
    Limits,
    divide_by_shape,
    find_hills,
    join_hills,
)
from fleet2d.homes.formats.ros import Ros
from fleet2d.kernels import label_parts

DATA = Path(__file__).parents[2] / "shared" / "data"
FREE, OCCUPIED = 254, 0
WALL_M = 0.15
PIXEL_M = 0.05
SCORES = ("iou", "recall", "precision")
Labels = np.ndarray[Any, np.dtype[np.int64]]


def score(rooms: Labels, truth: Labels) -> dict[str, float]:
    """Compare the rooms of pixels with the true ones; both have -1 where no room is.

    A room that lies less than a fifth in the truth doesn't count.
    """
    return score_of(*overlap(rooms, truth))


def overlap(rooms: Labels, truth: Labels) -> tuple[Labels, Labels, Labels]:
    """Return how many pixels each room has in common with each true one, and how many they have."""
    height, width = (min(a, b) for a, b in zip(rooms.shape, truth.shape, strict=True))
    rooms, truth = rooms[:height, :width], truth[:height, :width]
    both = (rooms >= 0) & (truth >= 0)
    common = np.zeros((int(rooms.max()) + 1, int(truth.max()) + 1), np.int64)
    np.add.at(common, (rooms[both], truth[both]), 1)
    of_room = np.bincount(rooms[rooms >= 0], minlength=len(common))
    of_truth = np.bincount(truth[truth >= 0], minlength=common.shape[1])
    return common, of_room, of_truth


def score_of(common: Labels, of_room: Labels, of_truth: Labels) -> dict[str, float]:
    """Return the scores of an overlap."""
    iou = common / (of_room[:, None] + of_truth[None] - common)
    counted = common.sum(axis=1) > 0.2 * of_room
    return {
        "iou": float(iou.max(axis=0).mean()),
        "recall": float((iou.max(axis=0) > 0.5).mean()),
        "precision": float((iou[counted].max(axis=1) > 0.5).mean()) if counted.any() else 0.0,
        "rooms": int(counted.sum()),
        "true": len(of_truth),
    }


def room_pixels(plan: FloorPlan, pixel: float, rows: int, columns: int) -> Labels:
    """Return the room of each pixel of a map with its corner at the origin, first row on top."""
    return np.append(plan.room_of_cell, -1).astype(np.int64)[
        cell_pixels(plan, pixel, rows, columns)
    ]


def cell_pixels(plan: FloorPlan, pixel: float, rows: int, columns: int) -> Labels:
    """Return the cell of each pixel, counted row by row, -1 outside of the plan; see above."""
    x, y = np.meshgrid((np.arange(columns) + 0.5) * pixel, (np.arange(rows) + 0.5) * pixel)
    cells = plan.lattice.to_lattice(np.stack([x, y], axis=-1)) // 64
    inside = (cells >= 0).all(axis=-1)
    inside &= (cells[..., 1] < plan.lattice.rows) & (cells[..., 0] < plan.lattice.columns)
    numbers = np.full((rows, columns), -1, np.int64)
    numbers[inside] = (cells[..., 1] * plan.lattice.columns + cells[..., 0])[inside]
    return numbers[::-1]


def write_map(folder: Path, pixels: Any, pixel: float, free_thresh: float = 0.196) -> Path:
    """Write a map of the ROS map_server."""
    rows, columns = pixels.shape
    image = f"P5\n{columns} {rows}\n255\n".encode() + pixels.astype(np.uint8).tobytes()
    (folder / "map.pgm").write_bytes(image)
    path = folder / "map.yaml"
    path.write_text(
        f"image: map.pgm\nresolution: {pixel}\norigin: [0, 0, 0]\nnegate: 0\n"
        f"occupied_thresh: 0.65\nfree_thresh: {free_thresh}\n"
    )
    return path


# --- Clean plans with defects --------------------------------------------------------------------


def clean_plan(number: int) -> FloorPlan:
    """Return a plan: of HouseExpo, where the data is, and a synthetic one otherwise."""
    files = sorted((DATA / "houseexpo").rglob("*.json"))
    if number % 2 and files:
        return fleet2d.load_floorplan(files[number // 2 % len(files)])
    return fleet2d.load_floorplan(f"synthetic:{number}")


class Damage:
    """A map of a plan and what is wrong with it."""

    def __init__(self, number: int) -> None:
        self.draw = np.random.default_rng(number)
        self.names: list[str] = []
        plan = clean_plan(number)
        self.pixel = float(self.draw.choice([0.025, 0.05, 0.1])) if self.hit("resolution") else 0.05
        angle = float(self.draw.uniform(0, 90)) if self.hit("rotation") else 0.0
        free = affinity.rotate(plan.free_space, angle, origin=(0, 0))
        x0, y0, x1, y1 = free.bounds
        shift = (-x0 + 1.0, -y0 + 1.0)
        self.free = affinity.translate(free, *shift)
        self.doors = [
            affinity.translate(
                affinity.rotate(shapely.LineString([d.start, d.end]), angle, origin=(0, 0)), *shift
            )
            for d in plan.doorways
        ]
        self.shape = (int((y1 - y0 + 2) / self.pixel), int((x1 - x0 + 2) / self.pixel))

    def hit(self, name: str) -> bool:
        """Draw whether a defect occurs, and note its name."""
        if self.draw.random() < 0.35:
            self.names.append(name)
            return True
        return False

    def raster(self, shape: Any) -> Any:
        """Return the pixels with their centre in a shape, bool (rows, columns), first row below."""
        rows, columns = self.shape
        x, y = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
        shapely.prepare(shape)
        return shapely.contains_xy(shape, x * self.pixel, y * self.pixel)

    def truth(self) -> FloorPlan:
        """Return the clean plan, its rooms found from its walls."""
        return FloorPlan.build("truth", self.free, doorways=None, regions_are="none")

    def write(self, folder: Path) -> Path:
        """Write the damaged map."""
        free = self.raster(self.free)
        wall = self.raster(self.free.buffer(WALL_M)) & ~free
        if self.doors and self.hit("shut door"):
            door = self.doors[int(self.draw.integers(len(self.doors)))]
            shut = self.raster(door.buffer(0.6 * self.pixel, cap_style="flat"))
            free, wall = free & ~shut, wall | shut
        if self.hit("furniture"):
            for _ in range(int(self.draw.integers(3, 10))):
                box = self.box(0.1, 1.2)
                if all(box.distance(door) > 0.6 for door in self.doors):
                    wall |= self.raster(box) & free
            free &= ~wall
        if self.hit("rays"):
            for _ in range(int(self.draw.integers(1, 5))):
                beam = self.ray()
                free |= self.raster(beam)
            wall &= ~free
        grey = int(self.draw.integers(150, 230)) if self.hit("grey") else 205
        pixels = np.where(free, FREE, np.where(wall, OCCUPIED, grey))
        if self.hit("noise"):
            chance = self.draw.random(pixels.shape)
            pixels = np.where(chance < 0.002, OCCUPIED, np.where(chance > 0.998, FREE, pixels))
        thresh = float(self.draw.choice([0.1, 0.25, 0.3])) if self.hit("threshold") else 0.196
        return write_map(folder, pixels[::-1], self.pixel, thresh)

    def place(self) -> Any:
        """Return a random place in the home."""
        x0, y0, x1, y1 = self.free.bounds
        while True:
            place = shapely.Point(self.draw.uniform(x0, x1), self.draw.uniform(y0, y1))
            if self.free.contains(place):
                return place

    def box(self, least: float, most: float) -> Polygon:
        """Return a box of furniture somewhere."""
        at, (width, depth) = self.place(), self.draw.uniform(least, most, 2)
        return shapely.box(at.x, at.y, at.x + width, at.y + depth)

    def ray(self) -> Polygon:
        """Return a beam that leaves the home through a wall."""
        at, angle = self.place(), self.draw.uniform(0, 2 * np.pi)
        end = (at.x + 12 * np.cos(angle), at.y + 12 * np.sin(angle))
        return shapely.LineString([(at.x, at.y), end]).buffer(self.draw.uniform(0.03, 0.12))


def damaged(number: int) -> dict[str, Any]:
    """Read one damaged map."""
    damage = Damage(number)
    with TemporaryDirectory() as name:
        path = damage.write(Path(name))
        begin = time.process_time()
        try:
            plan = Ros(path=path).load()
        except FloorPlanError as error:
            return {"number": number, "defects": damage.names, "refused": str(error)}
        seconds = time.process_time() - begin
    rows, columns = damage.shape
    truth = damage.truth()
    rooms = room_pixels(plan, damage.pixel, rows, columns)
    result = score(rooms, room_pixels(truth, damage.pixel, rows, columns))
    whole = plan.area_m2 >= 0.85 * max(part.area for part in shapely.get_parts(damage.free))
    outside = plan.free_space.difference(damage.free.buffer(0.3)).area / plan.area_m2
    return {
        **result, "number": number, "defects": damage.names, "seconds": seconds,
        "whole": whole, "nonsense": outside > 0.3,
    }  # fmt: skip


def damaged_table(maps: int, workers: int) -> None:
    """Print the scores by defect."""
    by_defect: dict[str, list[dict[str, Any]]] = defaultdict(list)
    with ProcessPoolExecutor(workers) as pool:
        for row in pool.map(damaged, range(maps), chunksize=4):
            for defect in (*row["defects"], "all") if row["defects"] else ("none", "all"):
                by_defect[defect].append(row)
    print("defect        maps    IoU      R      P   whole  nonsense  refused  max s")
    for defect, rows in sorted(by_defect.items(), key=lambda item: (item[0] == "all", item[0])):
        read = [row for row in rows if "refused" not in row]
        shares = "".join(f"{np.mean([r[key] for r in read]):>7.2f}" for key in SCORES)
        whole, nonsense = np.mean([r["whole"] for r in read]), sum(r["nonsense"] for r in read)
        slowest = max(row["seconds"] for row in read)
        print(
            f"{defect:<12}{len(rows):>6}{shares}{whole:>8.1%}{nonsense:>10}"
            f"{len(rows) - len(read):>9}{slowest:>7.1f}"
        )
    worst = sorted((r for r in by_defect["all"] if "refused" not in r), key=lambda r: r["iou"])[:5]
    print(
        "worst:",
        *(f"{row['number']} {row['iou']:.2f} {row['defects']}" for row in worst),
        sep="\n  ",
    )


# --- Captured maps with true rooms ---------------------------------------------------------------


def grey_truth(path: Path) -> Labels:
    """Return the rooms of a picture: white areas between dark lines, from 1 m² on."""
    from PIL import Image

    part = label_parts(np.ascontiguousarray(np.asarray(Image.open(path).convert("L")) > 250), False)
    sizes = np.bincount(part[part >= 0])
    number = np.where(sizes * 0.05**2 >= 1, np.cumsum(sizes * 0.05**2 >= 1) - 1, -1)
    return np.append(number, -1)[part]


def color_truth(path: Path) -> Labels:
    """Return the rooms of a picture: one colour a room, black is nothing."""
    from PIL import Image

    rgb = np.asarray(Image.open(path).convert("RGB")).astype(np.int64)
    code = (rgb * (65536, 256, 1)).sum(axis=-1)
    values, index, counts = np.unique(code, return_inverse=True, return_counts=True)
    is_room = (values > 0) & (counts >= 300)
    return np.where(is_room, np.cumsum(is_room) - 1, -1)[index.reshape(code.shape)]


def pictures() -> Iterator[tuple[str, Path, Callable[[], Labels]]]:
    """Yield the set, the map and the truth of each captured map."""
    captured = DATA / "captured"
    for truth in sorted((captured / "buildings").glob("*_gt_segmentation.png")):
        name = truth.name.removesuffix("_gt_segmentation.png")
        for kind, file in (("bare", f"{name}.png"), ("furnished", f"{name}_furnitures.png")):
            yield f"buildings, {kind}", truth.with_name(file), lambda truth=truth: grey_truth(truth)
    for truth in sorted((captured / "clutter").glob("*_truth.png")):
        name = truth.name.replace("_truth", "")
        yield "clutter", truth.with_name(name), lambda truth=truth: color_truth(truth)


@dataclass(frozen=True)
class Captured:
    """A captured map with true rooms.

    Attributes:
        kind: The set that it is of.
        name: Its name.
        plan: What was made of it, or None if it was refused.
        truth: The true room of each pixel, -1 for none.
        cells: The plan's cell of each pixel, counted row by row, -1 for none.
        seconds: How long it took.
    """

    kind: str
    name: str
    plan: FloorPlan | None
    truth: Labels
    cells: Labels
    seconds: float = 0.0

    @property
    def scores(self) -> dict[str, Any]:
        """How its rooms agree with the true ones."""
        found = dict.fromkeys((*SCORES, "rooms", "true"), 0.0)
        if self.plan:
            found = score(np.append(self.plan.room_of_cell, -1)[self.cells], self.truth)
        return {"name": self.name, "seconds": self.seconds, **found}


def captured() -> Iterator[Captured]:
    """Yield the captured maps."""
    from PIL import Image

    for kind, path, truth in pictures():
        grey = np.asarray(Image.open(path).convert("L"))
        with TemporaryDirectory() as folder:
            begin = time.process_time()
            try:
                plan = Ros.model_construct(path=write_map(Path(folder), grey, PIXEL_M)).load()
            except FloorPlanError as error:
                print(f"{path.name} is refused: {error}")
                yield Captured(kind, path.stem, None, truth(), np.full(grey.shape, -1))
                continue
            seconds = time.process_time() - begin
        cells = cell_pixels(plan, PIXEL_M, *grey.shape)
        yield Captured(kind, path.stem, plan, truth(), cells, seconds)
    vacuums = DATA / "captured" / "vacuum"
    for path in sorted([*vacuums.glob("*.json"), *(DATA / "valetudo").glob("*.json")]):
        if '"segment"' in path.read_text():  # else its rooms are found ones, too
            yield of_vacuum(path)


def of_vacuum(path: Path) -> Captured:
    """Return the floor of a vacuum, its rooms found from its shape, with its segments as truth."""
    segments = fleet2d.load_floorplan(path)
    plan = FloorPlan.build("walls", segments.free_space, doorways=None, regions_are="vacuum")
    rows, columns = segments.room_of_cell.shape
    away = (np.array(segments.lattice.origin) - plan.lattice.origin) / plan.lattice.cell
    column, row = np.rint(away).astype(int).tolist()
    r, c = np.mgrid[row : row + rows, column : column + columns]
    inside = (r >= 0) & (c >= 0) & (r < plan.lattice.rows) & (c < plan.lattice.columns)
    cells = np.where(inside, r * plan.lattice.columns + c, -1)
    unknown = [room.index for room in segments.rooms if room.name == "unknown_1"]
    truth = segments.room_of_cell.astype(np.int64)
    truth[np.isin(truth, unknown)] = -1
    return Captured("vacuum", path.stem, plan, truth, cells)


def captured_table() -> None:
    """Print the scores of captured maps with true rooms."""
    sets: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for item in captured():
        sets[item.kind].append(item.scores)
    print("set, map                              IoU     R     P  rooms  true    s")
    for kind, rows in sets.items():
        for row in rows:
            print(f"  {row['name']:<32}{_scores([row])}{row['seconds']:>5.1f}")
        print(f"{kind:<34}{_scores(rows)}")
    print("published: ROSE2 on its 11 cluttered maps IoU .69; morphological .52, Voronoi .52")


# --- Limits that are chosen on the maps of other places -------------------------------------------

SAME_PLACE = {
    "intel": ("lab_intel", "intel_map", "map23"),
    "freiburg": ("Freiburg52_scan", "freiburg_building52"),
    "1c": ("1c_1096_areacleanup", "1c_1096_fullcleanup"),
    "z10": ("z10_1056_paths", "dreame_z10_named_rooms_and_paths"),
    "x40": ("l10su_1058_goto_target", "dreame_x40_named_rooms"),
    "viomi": ("viomi_v6_41_no_path", "viomi_v7_47_cleaned_segment_ids"),
}
"""Maps of one place, which are left out together."""
NECKS = (0.6, 0.65, 0.7, 0.75, 0.8)
MOUTHS = (0.0, 0.25, 0.3, 0.35, 0.4)
FURNITURE_M2 = (0.2, 0.3, 0.4, 0.5)
"""Sizes up to which a free-standing obstacle narrows no space, chosen like necks and mouths."""
DIVIDED_BY = {
    IN_STRAIGHT_WALLS: "passages, then shape",
    IN_RAGGED_WALLS: "shape alone",
    OF_VACUUMS: "shape alone",
}
"""Maps that are divided in one way share their necks and mouths."""
Choice = tuple[float, float, float]
Scored = dict[Choice, dict[str, float]]


def place_of(name: str) -> str:
    """Return the place that a map shows."""
    name = name.removesuffix("_furnitures")
    return next((place for place, maps in SAME_PLACE.items() if name in maps), name)


def scores_by_limits(captured: Captured) -> tuple[str, Scored]:
    """Return by what a map is divided, and the scores of its rooms by what is chosen."""
    divide = MagicMock(wraps=divide_by_shape)
    with patch.object(division, "divide_by_shape", divide):
        kind = "vacuum" if captured.kind == "vacuum" else "none"
        FloorPlan.build("map", captured.plan.free_space, doorways=None, regions_are=kind)
    rooms, cell, own = divide.call_args.args
    scored = {}
    for furniture_m2 in FURNITURE_M2:
        with patch.object(shape, "FURNITURE_M2", furniture_m2):
            hill, hills = find_hills(rooms, cell)
        pixels = np.append(hill, -1)[captured.cells].astype(np.int64)
        common = overlap(pixels, captured.truth)
        for limits, scores in by_limits(hills, cell, own.least_m2, *common):
            scored[furniture_m2, limits.neck, limits.mouth] = scores
    return DIVIDED_BY[own], scored


def by_limits(
    hills: Hills, cell: float, least_m2: float, common: Labels, of_hill: Labels, of_truth: Labels
) -> Iterator[tuple[Limits, dict[str, float]]]:
    """Yield the scores of the rooms that hills make, by limits; see `overlap`."""
    for neck, mouth in product(NECKS, MOUTHS):
        limits = Limits(neck, mouth, least_m2)
        part = join_hills(deepcopy(hills), cell, limits)[: len(of_hill)]
        _, part = np.unique(part, return_inverse=True)
        joined = np.zeros((int(part.max()) + 1, len(of_truth)))
        np.add.at(joined, part, common)
        yield limits, score_of(joined, np.bincount(part, of_hill), of_truth)


def held_out_table() -> None:
    """Print the scores of maps at the limits that are best for the maps of all other places."""
    maps = [(item, *scores_by_limits(item)) for item in captured() if item.plan]
    tables: dict[str, dict[str, list[dict[str, Any]]]] = defaultdict(lambda: defaultdict(list))
    for divided_by in dict.fromkeys(DIVIDED_BY.values()):
        same = [(item, scored) for item, by, scored in maps if by == divided_by]
        fitted = best_choice(scored for _, scored in same)
        print(f"{divided_by}: {len(same)} maps, fitted to all of them {fitted}")
        for item, scored in same:
            others = [s for other, s in same if place_of(other.name) != place_of(item.name)]
            chosen = best_choice(others)
            tables[item.kind]["held out"].append(scored[chosen])
            tables[item.kind]["fitted"].append(scored[fitted])
            print(f"  {item.name:<32}{_scores([scored[chosen]])}  {chosen}")
    for kind, table in tables.items():
        for name, rows in table.items():
            print(f"{kind + ', ' + name:<34}{_scores(rows)}")


def best_choice(maps: Iterable[Scored]) -> Choice:
    """Return the furniture, neck and mouth with the highest mean of `quality`."""
    scores = list(maps)
    return max(scores[0], key=lambda choice: np.mean([quality(m[choice]) for m in scores]))


def quality(scores: dict[str, float]) -> float:
    """Return the mean of IoU and F1, the harmonic mean of recall and precision."""
    recall, precision = scores["recall"], scores["precision"]
    f1 = 2 * recall * precision / (recall + precision) if recall else 0.0
    return (scores["iou"] + f1) / 2


# --- Captured maps that are changed --------------------------------------------------------------


def changed_maps(
    grey: Labels,
) -> Iterator[tuple[str, Labels, float, float, Callable[[Labels], Labels]]]:
    """Yield changed maps: name, pixels, pixel [m], free_thresh, and what changes labels back."""
    from PIL import Image

    def turned(labels: Any, degrees: float, fill: int, mode: str) -> Any:
        picture = Image.fromarray(labels.astype(np.int32), mode)
        return np.asarray(picture.rotate(degrees, Image.Resampling.NEAREST, True, fillcolor=fill))

    rows, columns = grey.shape

    def turn_back(labels: Labels) -> Labels:
        back = turned(labels, -17, -1, "I")
        top, left = (back.shape[0] - rows) // 2, (back.shape[1] - columns) // 2
        return back[top : top + rows, left : left + columns].astype(np.int64)

    edge = int(np.bincount(np.concatenate([grey[0], grey[-1]])).argmax())
    yield "turned by 17 deg", turned(grey, 17, edge, "I"), PIXEL_M, 0.196, turn_back
    half = grey[: rows // 2 * 2, : columns // 2 * 2].reshape(rows // 2, 2, columns // 2, 2)
    coarse = half.min(axis=(1, 3))  # an obstacle anywhere in a pixel
    yield "half the resolution", coarse, 2 * PIXEL_M, 0.196, lambda a: a.repeat(2, 0).repeat(2, 1)
    for thresh in (0.096, 0.296):
        yield f"free_thresh {thresh}", grey, PIXEL_M, thresh, lambda labels: labels


def changed_table() -> None:
    """Print how the rooms of changed maps agree with those of the maps as they are."""
    from PIL import Image

    def rooms(pixels: Labels, pixel: float, thresh: float) -> Labels:
        with TemporaryDirectory() as folder:
            path = write_map(Path(folder), pixels, pixel, thresh)
            return room_pixels(Ros.model_construct(path=path).load(), pixel, *pixels.shape)

    scores: dict[str, list[float]] = defaultdict(list)
    for kind, path, _ in pictures():
        grey = np.asarray(Image.open(path).convert("L")).astype(np.int64)
        original = rooms(grey, PIXEL_M, 0.196)
        for name, pixels, pixel, thresh, back in changed_maps(grey):
            try:
                found = back(rooms(pixels, pixel, thresh))
            except FloorPlanError as error:
                print(f"{path.name}, {name}, is refused: {error}")
                found = np.full(original.shape, -1)
            agreement = score(found, original)["iou"] if found.max() >= 0 else 0.0
            for maps in (kind, "all"):
                scores[f"{maps}: {name}"].append(agreement)
    for name, values in sorted(scores.items()):
        print(f"{name:<45} IoU {np.mean(values):.2f}, least {min(values):.2f}")


def _scores(rows: list[dict[str, Any]]) -> str:
    means = "".join(f"{np.mean([row[key] for row in rows]):>6.2f}" for key in SCORES)
    return means + "".join(f"{sum(row[key] for row in rows):>6.0f}" for key in ("rooms", "true"))


def main() -> None:
    """Run a benchmark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("damaged", "captured", "held-out", "changed"))
    parser.add_argument("--maps", type=int, default=60, help="number of damaged maps")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    if options.what == "damaged":
        damaged_table(options.maps, options.workers)
    elif options.what == "captured":
        captured_table()
    elif options.what == "held-out":
        held_out_table()
    else:
        changed_table()


if __name__ == "__main__":
    main()
