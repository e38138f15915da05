"""A digest tells content apart, and nothing else."""

import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from tests.fuzz.changes import pieces
from tests.scenes import scenario
from tests.thorough import THOROUGH, examples

import fleet2d
from fleet2d.artifacts.manifest import FORMAT, Manifest, canonical
from fleet2d.artifacts.seal import digest_table, run_digest
from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.artifacts.verification import verify_run
from fleet2d.errors import ArtifactError, RunDirectoryError
from fleet2d.runs.run import open_run

from .tables import EVERY_KIND, part, rows_of_every_kind, stored

ROWS = rows_of_every_kind(500)


def digest(rows, **options) -> str | None:
    return stored(rows, **options).manifest.digest


@settings(max_examples=examples(25))
@given(pieces=st.integers(1, 60), flush_rows=st.integers(1, 700))
def test_digest_independent_of_chunking(pieces, flush_rows):
    assert digest(ROWS) == digest(ROWS, pieces=pieces, flush_rows=flush_rows)


def test_digest_table_independent_of_arrow_layout(tmp_path):
    store = stored(ROWS, directory=tmp_path / "run", flush_rows=64)
    table = open_run(tmp_path / "run").arrow("every_kind")
    one_piece = table.combine_chunks()
    slices = pa.concat_tables([table.slice(0, 13), table.slice(13, 101), table.slice(114)])
    plain_strings = table.set_column(
        7, pa.field("room", pa.string(), True), table["room"].cast(pa.string())
    )

    expected = digest_table(table, EVERY_KIND)
    assert expected == store.close_tables()["every_kind"]
    assert expected == digest_table(one_piece, EVERY_KIND)
    assert expected == digest_table(slices, EVERY_KIND)
    assert expected == digest_table(plain_strings, EVERY_KIND)


def _changed(name, value) -> Callable[[dict[str, Any]], dict[str, Any]]:
    def change(rows):
        values = rows[name].copy()
        values[123] = value
        return {**rows, name: values}

    return change


@pytest.mark.parametrize(
    "change",
    [
        _changed("step", 0),
        _changed("time", 1),
        _changed("count", 99),
        _changed("total", np.ma.masked),
        _changed("x", -0.0),
        _changed("gap", 77.0),
        _changed("said", "something else"),
        _changed("what", "lost"),
        lambda rows: {**rows, "true": ~rows["true"]},
        lambda rows: {**rows, "room": np.where(rows["room"] == -1, 0, rows["room"])},
        lambda rows: part(rows, 0, 499),
        lambda rows: part(rows, 1, 500),
        lambda rows: {name: values[::-1] for name, values in rows.items()},
    ],
)
def test_digest_changes_with_content(change):
    rows = {**ROWS, "what": ROWS["what"].copy()}
    rows["what"][123] = "seen"
    rows["total"] = rows["total"].copy()
    rows["total"][123] = 5

    assert digest(rows) != digest(change(rows))


def test_digest_changes_with_names_kinds_categories_and_order():
    def of(table, *columns: Column) -> str | None:
        spec = TableSpec(table, columns)
        return digest({column.name: [0, 1] for column in columns} | {"step": [0, 1]}, spec=spec)

    step, a, b = Column("step", "step"), Column("a", "int64"), Column("b", "int64")
    room = Column("a", "category", categories=("hall", "bath"))
    other = Column("a", "category", categories=("hall", "kitchen"))
    digests = [
        of("t", step, a),
        of("u", step, a),
        of("t", step, b),
        of("t", a, step),
        of("t", step, Column("a", "step")),
        of("t", step, Column("a", "int64", nullable=True)),
        of("t", step, room),
        of("t", step, other),
        of("t", step, a, b),
    ]

    assert len(digests) == len(set(digests))


NANS = np.array([0x7FF8000000000000, 0xFFF8000000000001], np.uint64).view(np.float64)


@pytest.mark.parametrize(
    ("column", "one", "other", "is_same"),
    [
        (Column("c", "string"), ["ab", "c"], ["a", "bc"], False),
        (Column("c", "float64", nullable=True), [np.nan, 1], [0.0, 1], False),
        (Column("c", "float64", nullable=True), NANS[[0, 0]], NANS[[1, 1]], True),
    ],
    ids=["where strings join", "a missing value and zero", "bits of nan"],
)
def test_digest_tells_values_apart_but_not_their_bits(column, one, other, is_same):
    spec = TableSpec("t", (Column("step", "step"), column))
    first, second = (digest({"step": [0, 1], "c": values}, spec=spec) for values in (one, other))
    assert is_same == (first == second)


def test_digest_known_value():
    """A change of how digests are taken makes every stored run differ: it must be meant."""
    spec = TableSpec("events", (Column("step", "step"), Column("what", "category")))

    expected = "6de7edc35f2ac33221b95a145472ec06cc6cab2c3ee48e2d33f64c78f045dc03"
    assert expected == digest({"step": [0, 5], "what": ["seen", "lost"]}, spec=spec)


def test_run_digest_independent_of_order_of_tables():
    assert run_digest({"a": "1", "b": "2"}) == run_digest({"b": "2", "a": "1"})
    assert run_digest({"a": "1", "b": "2"}) != run_digest({"a": "2", "b": "1"})


STORED_RUN = Path(__file__).parents[1] / "fixtures" / "run"
"""A run of each version of the format, which every later version must read."""

CHANGES = int(os.environ.get("FLEET2D_CHANGES", "100" if THOROUGH else "40"))
"""Random changes to bytes that are tried; 10,000 before a release."""


@pytest.fixture
def run(tmp_path):
    return Path(shutil.copytree(STORED_RUN, tmp_path / "run"))


def edited(directory: Path, change):
    """Change the content of a manifest, and write it as it is always written."""
    path = directory / "manifest.json"
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content, indent=2, sort_keys=True) + "\n")


def test_a_run_of_long_ago_is_read():
    stored_run = open_run(STORED_RUN)
    assert FORMAT == stored_run.manifest["format"]
    assert [] == stored_run.verify()
    assert [] == stored_run.notes
    assert 0 < stored_run.arrow("events").num_rows
    assert 0 < stored_run.metrics["distance"]["ana"]
    assert "kitchen" in {room.type for room in stored_run.plan.rooms}
    verification = verify_run(STORED_RUN)
    assert verification.same
    assert [] == verification.foreign
    assert stored_run.manifest["seal"]["digest"] == verification.digest


@settings(max_examples=CHANGES, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_change_of_bytes_is_noticed_and_its_file_named(run, data):
    path = data.draw(st.sampled_from(sorted(path for path in run.rglob("*") if path.is_file())))
    content = path.read_bytes()
    path.write_bytes(data.draw(pieces(content)))
    assume(path.read_bytes() != content)
    try:
        verification = verify_run(run)
    except (RunDirectoryError, ArtifactError) as error:
        assert path.name == "manifest.json"
        assert re.search("damaged|later Fleet2D|no digest", str(error))
    else:
        name = path.relative_to(run).as_posix()
        assert [key for key in verification.differing if key.startswith(name)]
    finally:
        path.write_bytes(content)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda m: m["metrics"]["distance"].update(ana=1.0), "metrics.distance"),
        (lambda m: m["notes"].append("all is well"), "notes"),
        (lambda m: m.update(start="2026-01-06T07:00:00"), "start"),
        (lambda m: m["scenario"]["users"].clear(), "scenario.users"),
        (lambda m: m["tables"]["events"].update(rows=3), "tables.events"),
        (lambda m: m["wall_s"].update(setup=0.0), "wall_s.setup"),
        (lambda m: m["metrics"].update(mine={}), "metrics.mine"),
        (lambda m: m["versions"].pop("numpy"), "versions.numpy"),
        (lambda m: m["seal"].update(digest="0" * 64), "seal"),
    ],
)
def test_a_changed_field_is_named(run, change, field):
    edited(run, change)
    assert [f"manifest.json: {field}"] == list(verify_run(run).differing)


def test_another_order_of_users_is_a_change(tmp_path):
    users = {"zoe": {"type": "meander"}, "ana": {"type": "meander"}}
    fleet2d.run(scenario("1 min", users=users), out=tmp_path / "run")
    path = tmp_path / "run" / "manifest.json"
    content = json.loads(path.read_text())
    content["scenario"]["users"] = dict(reversed(content["scenario"]["users"].items()))
    path.write_text(canonical(content))

    assert ["manifest.json: scenario.users"] == list(verify_run(tmp_path / "run").differing)


def test_a_table_may_not_hide_from_the_seal(run):
    edited(run, lambda m: m["seal"]["files"].pop("events.parquet"))
    differing = verify_run(run).differing
    assert "manifest.json: seal" in differing
    assert "events.parquet" in differing


def test_missing_and_foreign_files_are_named(run):
    (run / "events.parquet").unlink()
    (run / "more.parquet").write_text("?")
    (run / "learned" / "more.npz").write_text("?")
    (run / "picture.png").write_text("a picture is no harm")
    (run / "ltp.parquet").unlink(missing_ok=True)
    (run / "ltp.parquet").symlink_to(STORED_RUN / "ltp.parquet")
    verification = verify_run(run)
    assert "is missing" == verification.differing["events.parquet"]
    assert ["learned/more.npz", "more.parquet"] == verification.foreign
    assert "is not a file any more" == verification.differing["ltp.parquet"]
    with pytest.raises(RunDirectoryError, match=r"ltp\.parquet is a link"):
        open_run(run)
    (run / "ltp.parquet").unlink()
    assert any("more.parquet" in note for note in open_run(run).notes)
    assert "more" not in open_run(run).tables


def test_an_unfinished_run_has_nothing_to_compare_with(tmp_path):
    Manifest().write(tmp_path)
    with pytest.raises(ArtifactError, match="no digest"):
        verify_run(tmp_path)
    with pytest.raises(RunDirectoryError, match="not a directory"):
        verify_run(tmp_path / "nothing")


# Manifests


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda m: m.update(steps="many"), ["steps", "'many'"]),
        (lambda m: m.update(steps=-1), ["steps", "-1"]),
        (lambda m: m.update(steps=True), ["steps", "True"]),
        (lambda m: m.update(status="fine"), ["status", "'complete'", "'fine'"]),
        (lambda m: m.update(start="yesterday"), ["start", "'yesterday'"]),
        (lambda m: m.update(stats="complete"), ["stats", "did you mean 'status'?"]),
        (lambda m: m.pop("scenario"), ["lacks scenario"]),
        (lambda m: m["tables"]["events"].update(rows=2.5), ["tables.events.rows", "2.5"]),
        (lambda m: m["tables"].update({"../../etc/x": {"rows": 0}}), ["tables.../../etc/x"]),
        (lambda m: m["tables"]["events"]["columns"][0].update(kind="blob"), ["tables.events.columns.0.kind", "'blob'"]),
        (lambda m: m["inputs"].append("/dev/zero"), ["inputs.0", "/dev/zero"]),
        (lambda m: m["entities"].update(users="ana"), ["entities.users", "'ana'"]),
        (lambda m: m["seal"]["files"].update({"../x": {"bytes": 1, "sha256": "0" * 64}}), ["seal.files.../x"]),
        (lambda m: m.update(notes=[["x" * 10_000]]), ["notes.0", "…"]),
        (lambda m: m.update(metrics=[]), ["metrics", "[]"]),
        (lambda m: m.update(digest="abc"), ["digest", "'abc'"]),
        # Pages, reports and pictures read these; they ended in tracebacks.
        (lambda m: m.update(step_us=0), ["step_us is 0"]),
        (lambda m: m.update(start=""), ["start is empty"]),
        (lambda m: m.update(start="2026-01-05T00:00:00+01:00"), ["start", "without a time zone"]),
        (lambda m: m.update(steps=10**15), ["end after the year 9999"]),
        (lambda m: m["scenario"]["users"]["ana"].update(radius=[0.2]), ["scenario.users.ana.radius"]),
        (lambda m: m["scenario"]["robots"]["astro"]["camera"].update(range=[1]), ["robots.astro.camera.range"]),
        (lambda m: m["scenario"]["robots"]["astro"]["camera"].update(angle_deg=1e9), ["camera.angle_deg"]),
        (lambda m: m["scenario"]["robots"]["astro"].update(behaviors=[["patrol"]]), ["astro.behaviors.0"]),
        (lambda m: m.update(interventions=[{"do": "put", "step": "3"}]), ["interventions.0.step"]),
        (lambda m: m.update(expectations={"quiet": {}}), ["expectations.quiet.expectation"]),
    ],
)  # fmt: skip
def test_an_edited_manifest_is_refused_with_the_field(run, change, words):
    edited(run, change)
    with pytest.raises(RunDirectoryError) as caught:
        open_run(run)
    for word in words:
        assert word in str(caught.value)
    assert len(str(caught.value)) < 1000
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('{"format": 2, "format": 2}', "'format' is given twice"),
        ('{"format": 2, "steps": NaN}', "NaN is not a number"),
        ('{"format": 2, "steps": 1e999}', "1e999 is too large"),
        ("[" * 100_000, "nested too deeply"),
        ('{"format": true}', "has no key 'format'"),
        ('{"format": ' + "9" * 5000 + "}", "damaged"),
    ],
)
def test_a_strange_text_is_refused(tmp_path, text, word):
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(RunDirectoryError, match=word):
        open_run(tmp_path)


def test_a_pipe_is_no_manifest(tmp_path):
    os.mkfifo(tmp_path / "manifest.json")
    with pytest.raises(RunDirectoryError, match="is not a file"):
        open_run(tmp_path)
