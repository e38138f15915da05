"""Reading studies with polars, pandas, DuckDB and Arrow, and answers from them."""

import json
import math
import subprocess
import sys
from pathlib import Path

import duckdb
import polars as pl
import pyarrow.parquet as pq
import pytest
from tests.studies.scenes import SPEED, run, small

from fleet2d.errors import ArtifactError, ComponentError, InputError, RunDirectoryError
from fleet2d.metrics.sightings import Sightings
from fleet2d.studies.reader import Study, open_study

SIGHTINGS = "sightings.ana"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    keys = {
        "keep": {"tables": ["room_share", "observations"]},
        "compare": [{"metric": SIGHTINGS, "against": {SPEED: 0.3}}],
        "description": "Does a fast robot see more?",
    }
    return run(small(**keys), tmp_path_factory.mktemp("study") / "speeds")[1]


def test_variants_have_parameters_status_time_digest_and_metrics(study):
    frame = study.variants
    assert [SPEED, "seed", "status", "digest", "wall_s"] == [
        c for c in frame.columns if c in (SPEED, "seed", "status", "digest", "wall_s")
    ]
    assert SIGHTINGS in study.metrics
    assert (pl.Float64, pl.Int64) == (frame.schema[SPEED], frame.schema["seed"])
    assert frame[SIGHTINGS].is_between(0, 1).all()
    assert 6 == len(study.pandas())


def test_opening_loads_neither_the_simulator_nor_pandas(study):
    code = (
        "import sys, fleet2d\n"
        f"assert len(fleet2d.open_study({study.location!r}).variants) == 6\n"
        "heavy = ('fleet2d.engine', 'fleet2d.scenario', 'pandas', 'shapely')\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "[]\n" == done.stdout


@pytest.mark.slow
def test_running_does_not_load_pandas(tmp_path):
    code = (
        "import sys, fleet2d\n"
        "base = {'extends': 'bundled:paper', 'simulation': {'duration': '1 min'}}\n"
        f"fleet2d.study({{'base': base}}, {str(tmp_path / 'study')!r}, workers=1)\n"
        "print('pandas' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "False\n" == done.stdout


def test_a_table_of_all_variants_comes_with_their_parameters(study):
    rows = study.polars("room_share").collect()
    assert {"variant", "step", "time", "user", "room", SPEED, "seed"} <= set(rows.columns)
    assert set(range(6)) == set(rows["variant"])


def test_rows_are_those_of_the_run_itself(study):
    run = study.rerun(2)
    expected = run.polars("room_share").with_columns(pl.col(pl.Categorical).cast(pl.String))
    rows = pl.from_arrow(pa_rows(study, 2)).drop("variant")
    assert expected.rows() == rows.rows()


def pa_rows(study: Study, variant):
    import pyarrow.compute as pc

    return study.arrow("room_share").to_table(filter=pc.field("variant") == variant)


def test_any_parquet_reader_reads_it(study):
    assert 6 == pq.read_table(Path(study.location) / "variants.parquet").num_rows
    folder = Path(study.location) / "tables/room_share"
    rows = study.polars("room_share").collect().height
    assert rows == pq.read_table(str(folder)).num_rows
    assert rows == len(pl.read_parquet(folder / "*.parquet"))
    assert [(rows,)] == duckdb.sql(f"select count(*) from '{folder}/*.parquet'").fetchall()


def test_a_table_that_is_not_kept_is_named(study):
    with pytest.raises(ArtifactError, match="did you mean 'room_share'"):
        study.arrow("roomshare")


def test_a_metric_or_axis_that_is_not_there_is_named(study):
    with pytest.raises(InputError, match=f"did you mean '{SIGHTINGS}'"):
        study.paired("sighting.ana", {SPEED: 0.3})
    with pytest.raises(InputError, match="did you mean 'seed'"):
        study.paired(SIGHTINGS, {SPEED: 0.3}, by=["seeds"])
    with pytest.raises(InputError, match=r"has robots.astro.speed = 0.4"):
        study.paired(SIGHTINGS, {SPEED: 0.4})
    with pytest.raises(InputError, match="no axis 'sped'"):
        study.paired(SIGHTINGS, {"sped": 0.4})


def test_what_numbers_can_be_and_which_are_better_is_known(study):
    assert (0, 1) == study.limits("sightings.ana")
    assert (0, math.inf) == study.limits("distance.astro")
    assert (-math.inf, math.inf) == study.limits("unknown")
    assert ["higher", "", ""] == [
        study.better(metric) for metric in ("sightings.ana", "distance.astro", "unknown")
    ]


def test_a_study_whose_variants_all_failed_has_no_answers(tmp_path, monkeypatch):
    def fails(*_):
        raise ComponentError("no more memory")

    monkeypatch.setattr(Sightings, "update", fails)
    counts, failed = run(small(), tmp_path / "study")
    assert (6, 6) == (counts.total, counts.failed)
    with pytest.raises(InputError, match=r"has no complete variant, and so no 'sightings\.ana'"):
        failed.paired("sightings.ana", {SPEED: 0.3})


def test_a_scenario_of_a_study_runs_as_any_other(study):
    assert 0.6 == study.scenario(5)["robots"]["astro"]["speed"]
    with pytest.raises(RunDirectoryError, match="no variant 99"):
        study.scenario(99)


def test_a_variant_can_be_stored_with_more_artifacts(study, tmp_path):
    run = study.rerun(0, tmp_path / "run", artifacts={"events": True})
    assert "events" in run.tables
    assert (tmp_path / "run/manifest.json").exists()


def test_a_folder_without_a_study_is_refused(tmp_path):
    with pytest.raises(RunDirectoryError, match="holds no study"):
        open_study(tmp_path)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"columns": "seed"}, "columns.*valid tuple"),
        ({"metrics": {"sightings": {"unit": 3}}}, "sightings.unit.*valid string"),
        ({"color": "red"}, "color"),
        ({"compare": [{"metric": 3}]}, "PairedComparison"),
    ],
)
def test_a_description_with_other_types_is_damaged(study, tmp_path, change, reason):
    content = json.loads(Path(study.location, "study.json").read_text())
    (tmp_path / "study.json").write_text(json.dumps({**content, **change}))
    with pytest.raises(RunDirectoryError, match=rf"study\.json is damaged \(.*{reason}"):
        _ = open_study(tmp_path).comparisons


def test_values_of_a_population_can_be_compared(study):
    """Seeds are units of every other comparison, but not of one between seeds."""
    table = study.paired("sightings.ana", {"seed": 0})
    assert "n_seed" not in table.columns
    assert len(table) == study.variants["seed"].n_unique() - 1
