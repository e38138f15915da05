"""Replay of devices: the path in a robot vacuum's map, and a log of positions with times."""

import json

import numpy as np
import pytest
from tests.entities.robots.robots import events, home_with, names
from tests.scenes import path, run

import fleet2d
from fleet2d.errors import InputError
from fleet2d.homes.formats.valetudo import read_valetudo_path

MAP = "dreame_z10_named_rooms_and_paths.json"


def vacuum(file, duration="3 h", **fields):
    content = home_with([{"type": "retrace", "path": str(file), **fields}], duration)
    content["floorplan"] = {"type": "valetudo", "path": str(file)}
    content["users"] = {}
    content["robots"]["astro"].pop("start")
    return content


def test_it_drives_where_the_vacuum_drove(shared_data):
    file = shared_data / "valetudo" / MAP
    stored = run(vacuum(file))
    assert ["retraces", "retraced"] == names(stored)[:2]
    recorded, poses = read_valetudo_path(file), path(stored, "astro")
    driven = np.stack([poses.x, poses.y], axis=1)[: events(stored)[1][0]]
    gaps = [float(np.hypot(*(driven - point).T).min()) for point in recorded[::50]]
    # A body of 15 cm keeps off the walls along which the vacuum brushed; steps are 0.6 m.
    assert np.median(gaps) < 0.3
    assert np.quantile(gaps, 0.95) < 0.6


def test_a_map_without_a_path_and_one_of_another_home_are_refused(shared_data, tmp_path):
    file, bare = shared_data / "valetudo" / MAP, tmp_path / "bare.json"
    content = json.loads(file.read_text())
    content["entities"] = [e for e in content["entities"] if e["type"] != "path"]
    bare.write_text(json.dumps(content))
    with pytest.raises(InputError, match="holds no path"):
        fleet2d.Simulation(vacuum(bare))
    content = home_with([{"type": "retrace", "path": str(file), "reach": 0.1}])
    with pytest.raises(InputError, match="is this the home of that map"):
        fleet2d.Simulation(content)


def test_a_file_that_is_no_map_says_whose_it_is_and_what_reads_logs(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("time,x,y\n0,1.0,3.0\n")
    with pytest.raises(InputError, match=r"robots\.astro: .*log\.csv is a table.*'replay'"):
        fleet2d.Simulation(home_with([{"type": "retrace", "path": str(log)}]))


@pytest.mark.parametrize("head", ["time,x,y,heading", "time,x,y"])
def test_a_log_with_times_is_for_replay(tmp_path, head):
    rows = [(t, 1.0 + 0.1 * t, 3.0, 1.5708)[: head.count(",") + 1] for t in range(30)]
    file = tmp_path / "log.csv"
    file.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n")
    content = home_with([{"type": "replay", "path": str(file)}], "30 s")
    content["simulation"]["start"] = "2026-01-05T00:00"
    poses = path(run(content), "astro")
    assert poses.x[:29] == pytest.approx([row[1] for row in rows[:29]], abs=1e-3)
    expected = 1.5708 if "heading" in head else 0  # along the way
    assert poses.heading[5] == pytest.approx(expected, abs=2e-3)
