"""Runs that somebody rewrote and sealed anew: `verify` and `reproduce` vouch for none of them.

A seal is no signature. But it used to hide what the digests of the tables tell: tables that were
rewritten and sealed anew, with their digests in the manifest left as they were, passed both.
"""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.engine.test_repeat_resume import cut_off
from tests.scenes import everything
from tests.thorough import some

import fleet2d
from fleet2d.artifacts.manifest import Manifest
from fleet2d.artifacts.seal import digest_table, make_seal, run_digest
from fleet2d.artifacts.verification import verify_run
from fleet2d.engine.repeat import reproduce
from fleet2d.errors import ArtifactError, RunDirectoryError
from fleet2d.runs.run import open_run

Change = Callable[[pa.Table], pa.Table]


@pytest.fixture(scope="module")
def genuine(tmp_path_factory):
    directory = tmp_path_factory.mktemp("runs") / "genuine"
    fleet2d.run(everything("20 min"), out=directory)
    return directory


@pytest.fixture
def run(genuine, tmp_path):
    return Path(shutil.copytree(genuine, tmp_path / "run"))


def rewrite(run, table, change):
    """Rewrite a table with its metadata, as anybody could with pyarrow."""
    path = run / f"{table}.parquet"
    stored = pq.read_table(path)
    changed = change(stored)
    pq.write_table(changed.cast(stored.schema), path)


def seal_anew(run, change=lambda _: None):
    manifest = Manifest.read(run)
    change(manifest)
    manifest.seal = make_seal(manifest, run)
    manifest.write(run)


def with_column(table, name, values):
    at = table.column_names.index(name)
    return table.set_column(at, table.schema.field(at), pa.chunked_array([values]))


def moved(table):
    return with_column(table, "x", pa.array(table["x"].to_numpy() + 1.5))


def swapped(table):
    order = [*range(table.num_rows)]
    order[0], order[-1] = order[-1], order[0]
    return table.take(order)


FORGERIES = {
    "moved by 1.5 m": ("trajectories", moved),
    "moved key frames": ("key_frames", moved),
    "fewer rows": ("key_frames", lambda table: table.slice(0, table.num_rows - 1)),
    "no rows": ("observations", lambda table: table.slice(0, 0)),
    "a row twice": ("events", lambda table: pa.concat_tables([table, table.slice(0, 1)])),
    "another order": ("trajectories", swapped),
    "a minute later": (
        "events",
        lambda table: with_column(table, "step", pa.array(table["step"].to_numpy() + 60)),
    ),
}


def differing(run):
    verification = verify_run(run)
    assert verification.same == (not verification.differing)
    return list(verification.differing)


@pytest.mark.parametrize("name", FORGERIES)
def test_a_rewritten_table_under_a_new_seal_is_noticed(run, name):
    table, change = FORGERIES[name]
    rewrite(run, table, change)
    seal_anew(run)
    assert [f"{table}.parquet"] == differing(run)


@pytest.mark.parametrize("name", some(list(FORGERIES), 3))
def test_a_rewritten_table_under_a_new_seal_is_not_reproduced(run, name):
    table, change = FORGERIES[name]
    rewrite(run, table, change)
    seal_anew(run)
    result = reproduce(run)
    assert not result.same
    assert [table] == result.differing


def test_only_an_exact_repetition_notices_a_forgery_without_contradictions(run):
    """Digests of the forged rows, a digest of these digests, a seal: who has them, has another run."""

    def vouch(manifest):
        table = digest_table(pq.read_table(run / "trajectories.parquet"))
        record = manifest.tables["trajectories"].model_copy(update={"digest": table})
        manifest.tables["trajectories"] = record
        tables = {name: each.digest or "" for name, each in manifest.tables.items()}
        manifest.digest = run_digest(tables)

    before = verify_run(run)
    rewrite(run, "trajectories", moved)
    seal_anew(run, vouch)
    after = verify_run(run)
    assert after.same
    assert before.digest != after.digest
    result = reproduce(run)
    assert not result.same
    assert ["trajectories"] == result.differing


def record(manifest, **fields):
    manifest.tables["events"] = manifest.tables["events"].model_copy(update=fields)


def other_unit(manifest):
    columns = [
        column.model_copy(update={"unit": "km"}) for column in manifest.tables["events"].columns
    ]
    record(manifest, columns=columns)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (lambda m: record(m, rows=3), "events.parquet"),
        (lambda m: record(m, columns=[]), "events.parquet"),
        (other_unit, "events.parquet"),
        (lambda m: record(m, digest=None), "events.parquet"),
        (lambda m: setattr(m, "digest", "0" * 64), "manifest.json: digest"),
        (lambda m: m.tables.pop("events"), "manifest.json: digest"),
    ],
)
def test_a_manifest_that_contradicts_the_tables_is_noticed(run, change, name):
    seal_anew(run, change)
    assert name in differing(run)


def test_a_manifest_without_its_seal_is_not_verified(run, fleet2d):
    path = run / "manifest.json"
    content = json.loads(path.read_text())
    path.write_text(json.dumps({**content, "seal": None}))
    assert ["manifest.json: seal"] == differing(run)
    code, out, err = fleet2d("verify", run)
    assert (1, "") == (code, out)
    assert "manifest.json: seal is missing\n" == err
    del content["seal"]
    path.write_text(json.dumps(content))
    with pytest.raises(RunDirectoryError, match="it lacks seal"):
        verify_run(run)


def test_all_that_is_not_part_of_the_run_is_listed(run, tmp_path):
    """A lock, pictures that are none and whatever lay in `unfinished` went unmentioned."""
    (run / "unfinished").mkdir()
    (run / "unfinished" / "journal").write_text("of another run")
    (run / "unfinished" / "payload").write_text("?")
    (run / "run.lock").write_text("?")
    (run / "picture.png").symlink_to(tmp_path)
    (run / "picture.svg").mkdir()
    (run / "learned").mkdir(exist_ok=True)
    (run / "learned" / "more").mkdir()
    foreign = verify_run(run).foreign
    assert [
        "learned/more", "picture.png", "picture.svg", "run.lock", "unfinished/journal",
        "unfinished/payload",
    ] == foreign  # fmt: skip


def test_an_interrupted_run_may_have_what_is_needed_to_resume_it(tmp_path):
    simulation = fleet2d.Simulation(everything("20 min"), out=tmp_path / "run")
    simulation.run_until(600)
    simulation.finish()
    assert verify_run(tmp_path / "run").same
    assert [] == verify_run(tmp_path / "run").foreign
    (tmp_path / "run" / "unfinished" / "more").write_text("?")
    assert ["unfinished/more"] == verify_run(tmp_path / "run").foreign


def test_names_of_foreign_files_reach_no_terminal_unescaped(run):
    (run / "\x1b[2Jgone").write_text("?")
    (run / "\x1b[2J.parquet").write_text("?")
    assert [r"\x1b[2J.parquet", r"\x1b[2Jgone"] == verify_run(run).foreign
    assert r"no part of the run: \x1b[2J.parquet" in open_run(run).notes


def test_a_run_whose_status_was_raised_is_not_vouched_for(tmp_path):
    """A run that was cut off has no digest to compare with, whatever its status says."""
    simulation = fleet2d.Simulation(everything("20 min"), out=tmp_path / "run")
    simulation.run_until(600)
    run = cut_off(simulation)
    path = run / "manifest.json"
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"status": "complete"}))
    with pytest.raises(ArtifactError, match="no digest"):
        verify_run(run)
    with pytest.raises((ArtifactError, RunDirectoryError)):
        reproduce(run)
