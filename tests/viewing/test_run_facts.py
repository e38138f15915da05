"""What the timeline marks covers the run, and says what the manifest and the table say."""

import itertools
import json
import math
from datetime import datetime

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fleet2d
from fleet2d.runs.run import Tables
from fleet2d.runtime.clock import Clock
from fleet2d.viewing import run_facts
from fleet2d.viewing.page_data import PageData
from fleet2d.viewing.run_facts import (
    expectation_marks,
    marks_of,
    sightings_of,
    skies_of,
    slow_floors,
)

STEPS = 1000


@given(st.lists(st.tuples(st.integers(0, STEPS - 1), st.integers(0, 50)), max_size=8))
def test_stretches_of_an_expectation_tile_the_run(starts):
    violations = sorted((first, min(STEPS - 1, first + length)) for first, length in starts)
    marks = expectation_marks("quiet", {"holds": not violations}, violations, STEPS)
    assert 0 == marks[0]["step"]
    assert STEPS == marks[-1]["end"]
    assert all(mark["end"] == following["step"] for mark, following in itertools.pairwise(marks))
    expected, violated = np.zeros(STEPS, bool), np.zeros(STEPS, bool)
    for first, last in violations:
        expected[first : last + 1] = True
    for mark in marks:
        violated[mark["step"] : mark["end"]] = mark["kind"] == "violated"
    assert (expected == violated).all()


@pytest.mark.parametrize(
    ("verdict", "kind"),
    [
        ({"holds": True, "decided": True}, "held"),
        ({"holds": True, "decided": False}, "open"),
        ({"holds": False, "decided": True}, "violated"),
        ({"holds": None, "decided": True}, "open"),
    ],
)
def test_expectation_without_violations_is_what_its_verdict_says(verdict, kind):
    (mark,) = expectation_marks("found", verdict, [], STEPS)
    assert (0, STEPS, kind) == (mark["step"], mark["end"], mark["kind"])


def test_marks_come_from_manifest_and_table():
    run = fleet2d.run("bundled:paper", "simulation.duration=1 min", seed=4)
    table = pa.table({"step": [5], "expectation": ["quiet"], "last_step": [9]})
    run.tables = Tables(["violations"], {"violations": table}.__getitem__)
    run.manifest["expectations"] = {"quiet": {"holds": False, "says": "quiet is violated"}}
    run.manifest["interventions"] = [
        {"do": "replan", "step": 3, "entity": "astro", "by": "script.0"}
    ]
    assert [
        ("interventions", 3, 4, "intervention", "replan astro (script.0)"),
        ("quiet", 0, 5, "held", "quiet is violated"),
        ("quiet", 5, 10, "violated", "quiet is violated"),
        ("quiet", 10, 60, "held", "quiet is violated"),
    ] == [
        tuple(mark[key] for key in ("lane", "step", "end", "kind", "label"))
        for mark in marks_of(run)
    ]


def test_slow_floors_last_as_long_as_they_were_put():
    clock = Clock(datetime(2026, 1, 5), 1_000_000, 3600)
    area = [[1.0, 1.0], [3.0, 1.0], [3.0, 3.0]]
    scenario = {"floorplan": {"slows": [{"area": area, "stop": "2 s"}]}}
    records = [
        {"do": "put", "step": 5, "entity": "ana"},
        {"do": "slow", "step": 60, "area": area, "speed": 0.5, "duration": "10 min"},
        {"do": "slow", "step": 3500, "area": area, "speed": 0.25, "stop": "1 s", "duration": "1 h"},
    ]
    assert [
        (0, 3600, "robots stop for 2 s"),
        (60, 660, "robots drive at 50%"),
        (3500, 3600, "robots drive at 25%, robots stop for 1 s"),
    ] == [(f["step"], f["end"], f["words"]) for f in slow_floors(scenario, records, clock)]


def test_sightings_are_the_same_however_they_are_read(run_dir, monkeypatch):
    whole = sightings_of(fleet2d.open_run(run_dir))
    monkeypatch.setattr(run_facts, "BATCH_ROWS", 7)
    assert whole == sightings_of(fleet2d.open_run(run_dir))
    run = fleet2d.open_run(run_dir)
    run.directory = None  # as a run in memory
    assert whole == sightings_of(run)
    assert sum(len(lane["first"]) for lane in whole) > 5


def test_light_of_each_day_is_that_of_the_sun_over_the_home():
    scenario = {"simulation": {"daylight": {"latitude": 52.5}}}

    winter, _ = skies_of(scenario, Clock(datetime(2026, 12, 21, 14), 3_600_000_000, 12))
    (summer,) = skies_of(scenario, Clock(datetime(2026, 6, 21), 1_000_000, 60))

    assert winter == pytest.approx((7.6, 8.6, 15.3, 16.3), abs=0.1)
    assert summer == pytest.approx((3.1, 4.1, 19.9, 20.9), abs=0.2)


def test_light_is_as_cameras_have_it_where_the_scenario_has_no_daylight():
    clock = Clock(datetime(2026, 1, 5), 1_000_000, 60)

    assert [(6.0, 8.0, 17.0, 19.0)] == skies_of({"simulation": {"daylight": None}}, clock)


def test_results_of_metrics_that_are_no_numbers_reach_the_page():
    run = fleet2d.run("bundled:paper", "simulation.duration=10 min")
    run.manifest["metrics"]["odd"] = {"error": math.nan, "parts": {"none": None, "text": "late"}}
    metrics = json.loads(PageData(run).facts_json)["metrics"]
    assert {"error": "nan", "parts": {"none": None, "text": "late"}} == metrics["odd"]
