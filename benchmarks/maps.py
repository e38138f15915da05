"""How well homes survive what is done to their maps, and rooms are found as people see them.

    python benchmarks/maps.py damaged --maps 1000   # clean plans with defects, the plan as truth
    python benchmarks/maps.py captured              # real maps with true rooms, of ../shared/data
    python benchmarks/maps.py changed               # real maps turned, coarser, at other thresholds

A map is damaged by some of noise, rays, shut doors, furniture, rotation, another resolution, grey
for unknown, and threshold, all drawn from its number. Truth are the rooms of the clean
plan, found from its walls. Scores are the mean IoU of each true room with its best room, and recall
and precision at an IoU of 0.5.
"""

import argparse
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import shapely
from shapely import Polygon, affinity

import fleet2d
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.plan import FloorPlan
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
    height, width = (min(a, b) for a, b in zip(rooms.shape, truth.shape, strict=True))
    rooms, truth = rooms[:height, :width], truth[:height, :width]
    both = (rooms >= 0) & (truth >= 0)
    common = np.zeros((int(rooms.max()) + 1, int(truth.max()) + 1))
    np.add.at(common, (rooms[both], truth[both]), 1)
    of_room = np.bincount(rooms[rooms >= 0], minlength=len(common))
    of_truth = np.bincount(truth[truth >= 0], minlength=common.shape[1])
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
    x, y = np.meshgrid((np.arange(columns) + 0.5) * pixel, (np.arange(rows) + 0.5) * pixel)
    cells = plan.lattice.to_lattice(np.stack([x, y], axis=-1)) // 64
    inside = (cells >= 0).all(axis=-1)
    inside &= (cells[..., 1] < plan.lattice.rows) & (cells[..., 0] < plan.lattice.columns)
    labels = np.full((rows, columns), -1, np.int64)
    labels[inside] = plan.room_of_cell[cells[..., 1][inside], cells[..., 0][inside]]
    return labels[::-1]


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


def vacuum_rooms(path: Path) -> tuple[Labels, Labels]:
    """Return the rooms of a vacuum's floor found from its shape, and its segments."""
    segments = fleet2d.load_floorplan(path)
    plan = FloorPlan.build("walls", segments.free_space, doorways=None, regions_are="vacuum")
    rows, columns = segments.room_of_cell.shape
    x, y = segments.lattice.origin
    other = plan.lattice.origin
    row, column = (round((b - a) / 0.05) for a, b in zip((y, x), other[::-1], strict=True))
    found = np.full((rows, columns), -1, np.int64)
    height, width = (
        min(n, m)
        for n, m in zip(plan.room_of_cell.shape, (rows - row, columns - column), strict=True)
    )
    found[row : row + height, column : column + width] = plan.room_of_cell[:height, :width]
    unknown = [room.index for room in segments.rooms if room.name == "unknown_0"]
    truth = segments.room_of_cell.astype(np.int64)
    truth[np.isin(truth, unknown)] = -1
    return found, truth


def is_held_out(name: str) -> bool:
    """Return whether a map is of the half, by its name, by which no constant is to be chosen."""
    return sha256(name.removesuffix("_furnitures").encode()).digest()[0] % 2 == 1


def captured_table() -> None:
    """Print the scores of captured maps with true rooms."""
    from PIL import Image

    sets: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for kind, path, truth in pictures():
        grey, name = np.asarray(Image.open(path).convert("L")), path.stem
        with TemporaryDirectory() as folder:
            begin = time.process_time()
            try:
                plan = Ros.model_construct(path=write_map(Path(folder), grey, PIXEL_M)).load()
            except FloorPlanError as error:
                print(f"{path.name} is refused: {error}")
                sets[kind].append(dict.fromkeys((*SCORES, "rooms", "true"), 0.0) | {"name": name})
                continue
            seconds = time.process_time() - begin
        rooms = room_pixels(plan, PIXEL_M, *grey.shape)
        sets[kind].append({"name": name, "seconds": seconds, **score(rooms, truth())})
    captured = DATA / "captured" / "vacuum"
    for path in sorted([*captured.glob("*.json"), *(DATA / "valetudo").glob("*.json")]):
        if '"segment"' in path.read_text():  # else its rooms are found ones, too
            found, segments = vacuum_rooms(path)
            sets["vacuum"].append({"name": path.stem, **score(found, segments)})
    print("set, map                              IoU     R     P  rooms  true    s")
    for kind, rows in sets.items():
        for row in rows:
            print(f"  {row['name']:<32}{_scores([row])}{row.get('seconds', 0):>5.1f}")
        print(f"{kind:<34}{_scores(rows)}")
        print(f"{'    of them held out':<34}{_scores([r for r in rows if is_held_out(r['name'])])}")
    print("published: ROSE2 on its 11 cluttered maps IoU .69; morphological .52, Voronoi .52")


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
    parser.add_argument("what", choices=("damaged", "captured", "changed"))
    parser.add_argument("--maps", type=int, default=60, help="number of damaged maps")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    if options.what == "damaged":
        damaged_table(options.maps, options.workers)
    elif options.what == "captured":
        captured_table()
    else:
        changed_table()


if __name__ == "__main__":
    main()
