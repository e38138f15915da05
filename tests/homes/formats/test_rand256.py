import json

import numpy as np
import pytest

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.homes.formats.valetudo import (
    Valetudo,
    read_valetudo_charger,
    read_valetudo_path,
)

# An image of 40 x 30 pixels of 5 cm, in the middle of the map; a segment within walls.
WIDTH, HEIGHT, LEFT, TOP = 40, 30, 492, 497


def image():
    inside = [r * WIDTH + c for r in range(1, HEIGHT - 1) for c in range(1, WIDTH - 1)]
    walls = [r * WIDTH + c for r in range(HEIGHT) for c in range(WIDTH)]
    return {
        "position": {"top": TOP, "left": LEFT},
        "dimensions": {"height": HEIGHT, "width": WIDTH},
        "pixels": {"floor": [], "walls": sorted(set(walls) - set(inside))},
        "segments": {"count": 1, "id": [16], "pixels_seg_16": inside},
    }


def raw(**changes):
    return {
        "image": image(),
        "path": {"points": [[25600, 25700], [25700, 25700]]},
        "charger": [25600, 25700],
        **changes,
    }


def write(folder, content):
    path = folder / "raw.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


@pytest.mark.parametrize("wrap", [lambda m: m, lambda m: {"rand256": {"full_data": m}}])
def test_raw_map_is_read_with_segments_charger_and_path(tmp_path, wrap):
    path = write(tmp_path, wrap(raw(forbidden_zones=[[25500, 25500, 25600, 25500, 25600, 25600]])))

    plan = Valetudo(path=path).load()

    assert ["segment_16"] == [room.name for room in plan.rooms]
    assert plan.area_m2 == pytest.approx(38 * 28 * 0.05**2)
    x, y = read_valetudo_charger(path) or (0, 0)
    assert plan.room_at(x, y) == plan.rooms[0]
    assert (25.6, -25.5) == pytest.approx((x, y))
    assert 2 == len(read_valetudo_path(path))
    assert 1 == len(plan.no_go)


@pytest.mark.parametrize("wrap", [lambda m: m, lambda m: {"rand256": {"full_data": m}}])
def test_raw_map_is_recognized_by_its_content(tmp_path, wrap):
    path = write(tmp_path, wrap(raw()))

    assert load_floorplan(path) == Valetudo(path=path).load()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"image": {**image(), "position": {"top": "x", "left": 1}}}, "image.position.top"),
        ({"image": {**image(), "dimensions": {}}}, "image.dimensions has no key 'width'"),
        ({"image": {**image(), "segments": {"pixels_seg_1": [-1]}}}, "image.segments.pixels_seg_1"),
        ({"charger": [1, 2, 3]}, "charger is [1, 2, 3]"),
        ({"path": {"points": [[1]]}}, "path.points[0]"),
        ({"image": {**image(), "segments": {}}}, "it has no floor"),
    ],
)
def test_damaged_raw_map_is_refused(tmp_path, changes, message):
    with pytest.raises(FloorPlanError) as caught:
        Valetudo(path=write(tmp_path, {"rand256": raw(**changes)})).load()

    assert message in str(caught.value)


def test_vacuum_drove_on_the_floor_of_a_captured_map(shared_data):
    path = shared_data / "captured" / "vacuum" / "rand256_raw.json"
    if not path.exists():
        pytest.skip(f"there is no {path}")

    plan = load_floorplan(path)

    assert 1 == len(plan.polygons)
    inside = [plan.room_at(x, y) is not None for x, y in read_valetudo_path(path).tolist()]
    assert np.mean(inside) > 0.95
