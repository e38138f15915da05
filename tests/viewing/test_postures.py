"""Postures derived from key frames are those that the simulator had."""

from collections import Counter
from datetime import datetime
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest

import fleet2d
from fleet2d.floorplan.placed_objects import UsePlace
from fleet2d.runtime.clock import Clock
from fleet2d.viewing.postures import USED_WITHIN_M, Postures, postures_of

HOME = {"simulation": {"start": "2026-01-05", "duration": "20 h", "seed": 3}}
FURNISHED = {**HOME, "floorplan": {"type": "bundled", "furnish": True}}
PEOPLE = {"users": {"ana": {"type": "routine"}, "ben": {"type": "routine"}}}
WIDE = {"angle_deg": 360, "range": [0, 9], "detection": 1}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run whose cameras recorded the true postures of whom they saw."""
    scenario = {
        "extends": "bundled:family",
        "simulation": {"duration": "1 d", "seed": 3},
        "robots": {"astro": {"camera": None, "cameras": {"a": WIDE, "b": WIDE}, "keep_out": []}},
    }
    return fleet2d.run(scenario, out=tmp_path_factory.mktemp("postures") / "run")


@pytest.mark.slow
def test_postures_are_the_true_ones_wherever_there_is_furniture_for_them(run):
    postures = Postures(run, run.plan)
    step_us = run.manifest["step_us"]
    rests = np.array(
        [(u.x, u.y) for item in run.plan.objects for u in item.uses if u.posture != "stand"]
    )
    pairs = Counter()
    for row in run.tables["observations"].to_pylist():
        derived = postures.at(row["true_user"], row["step"] * step_us)
        posture = "stand" if derived is None else derived["posture"]
        if posture == "stand" and row["true_posture"] != "stand":
            far = np.hypot(*(rests - (row["true_x"], row["true_y"])).T).min()
            assert far >= USED_WITHIN_M
            continue
        pairs[posture, row["true_posture"]] += 1
    same = sum(count for (derived, true), count in pairs.items() if derived == true)
    assert pairs["sit", "sit"] > 1_000
    assert same > 0.99 * pairs.total(), pairs
    last = {}
    for row in postures_of(run, run.plan).to_pylist():
        end_us = run.manifest["steps"] * step_us
        assert last.get(row["user"], 0) <= row["time_us"] < row["end_us"] <= end_us
        last[row["user"]] = row["end_us"]
    assert set(last) == set(run.manifest["entities"]["users"])


def test_who_gets_up_and_is_stopped_on_the_way_does_not_sit_until_then():
    rows = [(0, 0, "track", 2.0), (60, 60, "track", 2.0), (65, 90, "planned", 8.0), (65, 65, "track", 3.0)]  # fmt: skip
    step, at_s, kind, x = zip(*rows, strict=True)
    start = np.datetime64("2026-01-05", "us")
    columns = {"entity": ["ana"] * 4, "y": [1.0] * 4, "away": [False] * 4, "kind": kind, "x": x}
    time = pa.array(start + np.array(at_s) * np.timedelta64(1, "s"), pa.timestamp("us"))
    manifest = {
        "step_us": 1_000_000, "steps": 100,
        "entities": {"users": ["ana"]},
    }  # fmt: skip
    frames = pa.table({**columns, "step": pa.array(step, pa.int64()), "time": time})
    clock = Clock(datetime(2026, 1, 5), step_us=1_000_000, steps=100)
    run = SimpleNamespace(tables={"key_frames": frames}, manifest=manifest, clock=clock)
    chair = SimpleNamespace(name="chair", uses=[UsePlace(x=2, y=1, heading=0, posture="sit")])
    plan = SimpleNamespace(objects=[chair])

    table = postures_of(run, plan)

    (row,) = table.to_pylist()
    assert (0, 60_000_000) == (row["time_us"], row["end_us"])


def test_people_sit_at_the_same_steps_in_a_home_with_a_time_zone(tmp_path):
    simulation = {**HOME["simulation"], "duration": "9 h"}
    here = fleet2d.run({**FURNISHED, **PEOPLE, "simulation": simulation}, out=tmp_path / "here")
    zoned = {**simulation, "time_zone": "Europe/Berlin"}
    there = fleet2d.run({**FURNISHED, **PEOPLE, "simulation": zoned}, out=tmp_path / "there")

    table = postures_of(there, there.plan)

    assert table.num_rows > 0
    assert table.equals(postures_of(here, here.plan))


@pytest.mark.parametrize(
    "scenario",
    [
        {**HOME, "floorplan": {"type": "bundled", "furnish": False}, **PEOPLE},
        {**FURNISHED, "robots": {"astro": {"type": "patrol"}}},
        {**FURNISHED, **PEOPLE, "artifacts": {"key_frames": False}},
    ],
    ids=["no furniture", "nobody", "no key frames"],
)
def test_without_furniture_people_or_key_frames_nobody_sits(scenario, tmp_path):
    scenario["simulation"] = {**HOME["simulation"], "duration": "10 min"}
    run = fleet2d.run(scenario, out=tmp_path / "run")
    table = postures_of(run, run.plan)
    if scenario["floorplan"].get("furnish"):
        assert table.num_rows == 0
    assert table.column_names[:3] == ["step", "time_us", "end_us"]
