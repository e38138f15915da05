"""Readings as a text file that tools for CASAS data read."""

import pytest
from tests.engine.test_sensors import household, plan  # noqa: F401  (a fixture)
from tests.scenes import run, scenario

from fleet2d.errors import RunDirectoryError
from fleet2d.live.exporters import Selection
from fleet2d.live.exporters.texts import export_casas
from fleet2d.logs.layout import read_casas


def test_file_has_a_line_per_reading_in_the_columns_of_casas(plan, tmp_path):  # noqa: F811
    stored = run(household(plan))
    path = tmp_path / "log.txt"
    text = export_casas(stored, path, Selection.of(stored))
    lines = path.read_text().splitlines()
    assert stored.tables["sensors"].num_rows == len(lines)
    assert f"{len(lines)} readings in {path}" == text
    rows = [line.split(" ") for line in lines]
    date, time, room, sensor, state, activity = next(row for row in rows if row[3] != "latch")
    assert ("2026-01-05", "hallway_1") == (date, room)
    assert sensor in {"hall", "contact"}
    assert state in {"ON", "OPEN"}
    assert time.startswith("00:0")
    assert activity


def test_reader_of_casas_logs_reads_it(plan, tmp_path):  # noqa: F811
    path = tmp_path / "log.txt"
    stored = run(household(plan))
    export_casas(stored, path, Selection.of(stored))
    assert read_casas(path)


def test_run_without_sensors_is_refused_with_what_to_do(tmp_path):
    stored = run(scenario("1 min"))
    with pytest.raises(RunDirectoryError, match="add objects that sense to its scenario"):
        export_casas(stored, tmp_path / "log.txt", Selection.of(stored))


def test_file_that_can_not_be_written_is_named(plan, tmp_path):  # noqa: F811
    stored = run(household(plan))
    with pytest.raises(RunDirectoryError, match=r"no/log\.txt can't be written"):
        export_casas(stored, tmp_path / "no" / "log.txt", Selection.of(stored))
