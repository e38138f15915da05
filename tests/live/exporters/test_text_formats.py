"""CSV and JSON Lines have the poses and the rows that the run stored."""

import json

import pandas as pd
import pytest
from tests.live.exporters.worlds import NAMES, day, part, poses, rows

import fleet2d
from fleet2d.errors import RunDirectoryError
from fleet2d.live.exporters.texts import export_csv, export_jsonl


def test_csv_has_the_pose_of_each_body_at_each_time(tmp_path):
    export_csv(day(), tmp_path / "day.csv", part())

    table = pd.read_csv(tmp_path / "day.csv", parse_dates=["time"], engine="pyarrow")
    assert table["step"].is_monotonic_increasing
    for name in NAMES:
        home = table[(table["entity"] == name) & ~table["away"]]
        found = home[["step", "x", "y", "heading"]].itertuples(index=False, name=None)
        assert poses(name) == list(found)
    away = table[table["away"]]
    assert {"ana", "ben"} == set(away["entity"])
    assert away[["x", "y", "room"]].isna().all(axis=None)
    assert pd.Timestamp("2026-01-05 06:00") == table["time"].min()


def test_a_run_without_bodies_has_no_poses_to_write(tmp_path):
    empty = fleet2d.run({"simulation": {"duration": "1 min"}, "floorplan": "bundled"})
    with pytest.raises(RunDirectoryError, match="neither users nor robots"):
        export_csv(empty, tmp_path / "day.csv", part())


def test_json_lines_have_all_records_in_order_of_time(tmp_path):
    export_jsonl(day(), tmp_path / "day.jsonl", part())

    lines = [json.loads(line) for line in (tmp_path / "day.jsonl").read_text().splitlines()]
    assert sorted(line["step"] for line in lines) == [line["step"] for line in lines]
    for name in NAMES:
        found = [one for one in lines if one["record"] == "pose" and one["entity"] == name]
        keys = ("step", "x", "y", "heading")
        assert poses(name) == [tuple(p[key] for key in keys) for p in found if not p["away"]]
    for table in ("events", "observations", "ltp"):
        found = [dict(line) for line in lines if line["record"] == table]
        expected = [{k: v for k, v in row.items() if v is not None} for row in rows(table)]
        for one in found:
            del one["record"]
        assert [row | {"time": row["time"].isoformat()} for row in expected] == found
