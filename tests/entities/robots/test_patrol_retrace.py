"""Replay of devices: the path in a robot vacuum's map, and a log of positions with times."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyarrow.csv import read_csv
from pyarrow.parquet import write_table
from tests.entities.robots.robots import assert_same_for_every_max_span, events, home_with, names
from tests.scenes import path, run

import fleet2d
from fleet2d.errors import InputError
from fleet2d.homes.formats.valetudo import read_valetudo_path

MAP = "dreame_z10_named_rooms_and_paths.json"


def vacuum(file: Path, duration: str = "3 h", **fields: Any) -> dict[str, Any]:
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


def test_the_same_for_every_max_span(shared_data):
    assert_same_for_every_max_span(vacuum(shared_data / "valetudo" / MAP, "20 min"), 61)


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


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
@pytest.mark.parametrize("with_heading", [False, True])
def test_a_log_with_times_is_for_replay(tmp_path, with_heading, suffix):
    rows = [(t, 1.0 + 0.1 * t, 3.0, 1.5708) for t in range(30)]
    head = "time,x,y,heading" if with_heading else "time,x,y"
    lines = [",".join(map(str, row if with_heading else row[:3])) for row in rows]
    file = tmp_path / f"log.{suffix}"
    file.with_suffix(".csv").write_text("\n".join([head, *lines]) + "\n")
    if suffix == "parquet":
        write_table(read_csv(file.with_suffix(".csv")), file)
    content = home_with([{"type": "replay", "path": str(file)}], "30 s")
    content["simulation"]["start"] = "2026-01-05T00:00"
    poses = path(run(content), "astro")
    assert poses.x[:29] == pytest.approx([row[1] for row in rows[:29]], abs=1e-3)
    if with_heading:
        assert poses.heading[5] == pytest.approx(1.5708, abs=2e-3)
