"""Data sets from somebody else: forged tables and manifests, links, pipes, names outside."""

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.hostile.test_folders import attack, link_to_file, pipe, state_of
from tests.learning.datasets.small import made, make
from tests.thorough import some

from fleet2d.learning.datasets.reader import open_dataset
from fleet2d.learning.datasets.tables import SCHEMAS
from fleet2d.learning.datasets.tasks import leaderboard, windows
from fleet2d.studies.design import code_version

MANIFEST = "dataset.json"


@pytest.fixture(scope="module")
def whole():
    return made().root


@pytest.fixture
def copy(tmp_path, whole):
    return Path(shutil.copytree(whole, tmp_path / "set"))


@pytest.fixture
def elsewhere(tmp_path, whole):
    """A folder of the user, with what a link in a data set may lead to."""
    folder = Path(shutil.copytree(whole, tmp_path / "elsewhere"))
    (folder / "secret.txt").write_text("precious, and nobody's business")
    return folder


def verify(root):
    open_dataset(root).verify()


def learn(root):
    data = open_dataset(root)
    for window in windows(data, "train"):
        assert np.isfinite(window.features).all()


def score(root):
    leaderboard(open_dataset(root))


USES = {
    "make": make,
    "verify": verify,
    "train": learn,
    "leaderboard": score,
}


def link(path, elsewhere):
    path.symlink_to(elsewhere / path.name)


def endless(path, _):
    path.symlink_to("/dev/zero")


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize("trick", [link, link_to_file, endless, pipe])
@pytest.mark.parametrize("name", [MANIFEST, "train", "train/labels-00000.parquet"])
def test_a_link_or_a_pipe_is_refused(copy, elsewhere, name, trick, use):
    target = copy / name
    shutil.rmtree(target) if target.is_dir() else target.unlink()
    trick(target, elsewhere)
    message = attack(copy, elsewhere, USES[use])
    words = "is not a file, but a device or a pipe" if trick is pipe else "is a link"
    assert f"{target} {words}" in message


@pytest.mark.parametrize("name", ["train", "pictures", "unfinished", "README.md"])
@pytest.mark.parametrize("is_complete", [False, True])
def test_files_that_are_lacking_are_not_made_through_a_link(copy, elsewhere, name, is_complete):
    """They were written into the folder that the link leads to, with exit code 0."""
    (copy / "test" / "rooms-00000.parquet").unlink()
    if not is_complete:
        (copy / MANIFEST).unlink()
    target = copy / name
    if target.is_dir():
        shutil.rmtree(target)
    target.unlink(missing_ok=True)
    (elsewhere / "unfinished").mkdir()
    link(target, elsewhere)
    assert f"{target} is a link" in attack(copy, elsewhere, make)


def change(**changes):
    return lambda manifest: manifest.update(changes)


def lack(key):
    return lambda manifest: manifest.pop(key)


def add_file(name):
    record = {"rows": 1, "bytes": 1, "sha256": "0" * 64}
    return lambda manifest: manifest["files"].update({name: record})


def rename_split(name):
    def rename(manifest):
        manifest["splits"] = {name: 3}
        manifest["files"] = {
            old.replace("train/", f"{name}/"): file for old, file in manifest["files"].items()
        }

    return rename


def lack_table(manifest):
    manifest["files"] = {n: file for n, file in manifest["files"].items() if "rooms" not in n}


FORGED = {
    "m-outside-split": rename_split("../../outside"),
    "m-outside-abs": rename_split("/tmp/outside"),
    "m-verify-outside": add_file("../../../../../../etc/hostname"),
    "m-files-list": change(files=[1, 2]),
    "m-files-int": change(files={"train/runs-00000.parquet": 3}),
    "m-nofiles": lack("files"),
    "m-nosplits": lack("splits"),
    "m-splits-list": change(splits=["train"]),
    "m-noplan": lack("plan"),
    "m-escape": add_file("train/\x1b[31mred"),
    "m-nover": lack("versions"),
    "m-file": change(file=None),
    "m-lacks-table": lack_table,
    "m-format": change(format=99),
    "m-other": change(surprise=1),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_manifest_is_refused(copy, elsewhere, name):
    path = copy / MANIFEST
    manifest = json.loads(path.read_text())
    FORGED[name](manifest)
    path.write_text(json.dumps(manifest))
    before = state_of(copy.parent)
    for use in USES.values():
        message = attack(copy, elsewhere, use)
        assert message.startswith(f"{path} is ")
        assert message.isprintable()
    assert before == state_of(copy.parent)


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"format": 1, "format": 1}', "\xff", "", '{"format": NaN}', "[1]"]
)
def test_a_manifest_that_is_no_strict_json_is_refused(copy, elsewhere, text):
    (copy / MANIFEST).write_bytes(text.encode("latin1"))
    for use in USES.values():
        assert str(copy / MANIFEST) in attack(copy, elsewhere, use)


def test_a_manifest_of_many_files_is_bounded(copy, elsewhere):
    """3 million names took gigabytes."""
    (copy / MANIFEST).write_text(f'{{"files": "{"x" * (65 << 20)}"}}')
    assert "at most 67108864 are read" in attack(copy, elsewhere, verify)


def test_a_manifest_that_is_a_folder_is_refused(copy, elsewhere):
    (copy / MANIFEST).unlink()
    (copy / MANIFEST).mkdir()
    assert "can't be read" in attack(copy, elsewhere, verify)


# Tables


def constant(value):
    return lambda column: pa.array([value] * len(column), column.type)


def null(column):
    return pa.nulls(len(column), column.type)


def as_list(column):
    return pa.array([[value] for value in column.to_pylist()])


def alike(kind):
    """Ways of forging a column of a type."""
    forged = {"null": null, "list": as_list}
    if pa.types.is_floating(kind):
        return {**forged, "nan": constant(float("nan")), "huge": constant(3e38)}
    if pa.types.is_integer(kind):
        most = 2 ** (kind.bit_width - 1) - 1
        return {**forged, "most": constant(most), "negative": constant(-5), "zero": constant(0)}
    if pa.types.is_string(kind):
        return {**forged, "escape": constant("\x1b[31mred\x07"), "empty": constant("")}
    return forged


COLUMNS = [
    (table, field.name, way)
    for table, schema in SCHEMAS.items()
    for field in schema
    for way in alike(field.type)
]


def forge(root, table, change):
    for path in root.glob(f"*/{table}-*"):
        pq.write_table(change(pq.ParquetFile(path).read()), path)


@pytest.mark.slow
@pytest.mark.parametrize(("table", "column", "way"), some(COLUMNS, 3))
def test_a_forged_column_is_refused_or_harmless(copy, elsewhere, table, column, way):
    def change(content):
        index = content.column_names.index(column)
        new = alike(SCHEMAS[table].field(column).type)[way](content[column])
        return content.set_column(index, column, new)

    forge(copy, table, change)
    for use in (learn, score):
        message = attack(copy, elsewhere, use)
        assert message.isprintable()
        if way in ("nan", "huge", "negative", "list"):
            assert "make the data set again" in message


@pytest.mark.parametrize("table", SCHEMAS)
@pytest.mark.parametrize("damage", ["gone", "cut", "zero", "names", "missing", "empty"])
def test_a_damaged_table_is_refused_or_harmless(copy, elsewhere, table, damage):
    changes = {
        "names": lambda t: t.rename_columns([f"x{name}" for name in t.column_names]),
        "missing": lambda t: t.drop_columns([t.column_names[0]]),
        "empty": lambda t: t.slice(0, 0),
    }
    if damage in changes:
        forge(copy, table, changes[damage])
    for path in copy.glob(f"*/{table}-*"):
        if damage == "gone":
            path.unlink()
        elif damage in ("cut", "zero"):
            path.write_bytes(path.read_bytes()[: 200 if damage == "cut" else 0])
    for use in (learn, score):
        message = attack(copy, elsewhere, use)
        assert damage == "empty" or f"{table}-00000.parquet can't be read" in message


@pytest.mark.slow
def test_rows_that_take_little_room_in_a_file_are_bounded(copy, elsewhere):
    """60 million equal rows in a file of 2 MB filled the memory."""
    path = copy / "train" / "labels-00000.parquet"
    row = pq.ParquetFile(path).read().slice(0, 1).combine_chunks()
    many = row.take(pa.array([0] * 2_000_000, pa.int32()))
    with pq.ParquetWriter(path, row.schema, compression="zstd") as writer:
        for _ in range(30):
            writer.write_table(many)
    assert path.stat().st_size < 2 << 20
    assert "FLEET2D_MAX_TABLE_BYTES" in attack(copy, elsewhere, learn)


@pytest.mark.slow
def test_a_forged_record_or_part_of_an_unfinished_one_is_made_again_or_refused(copy, elsewhere):
    data = open_dataset(copy)
    (copy / MANIFEST).unlink()
    parts = copy / "unfinished"
    parts.mkdir()
    (parts / "plan.txt").write_text(f"{data.manifest.plan} {code_version()}")
    (parts / "train-00000.json").write_text('{"../secret": {"bytes": 0}}')
    with pa.OSFile(str(parts / "000000.arrow"), "wb") as file:
        for _ in SCHEMAS:
            with pa.ipc.new_stream(file, pa.schema([("x", pa.int8())])) as stream:
                stream.write_table(pa.table({"x": pa.array([1], pa.int8())}))
    assert "000000.arrow was damaged, and is deleted" in attack(copy, elsewhere, make)
    make(copy)
    assert [] == open_dataset(copy).verify()


def test_names_of_models_are_printed_without_control_characters(copy, capsys):
    from fleet2d.learning.datasets.command import _print_scores

    def change(content):
        index = content.column_names.index("model")
        names = [n.replace("last_seen", "\x1b[31mred") for n in content["model"].to_pylist()]
        return content.set_column(index, "model", pa.array(names))

    forge(copy, "beliefs", change)
    _print_scores(leaderboard(open_dataset(copy), ["rtp"]), "test")
    assert "\\x1b[31mred" in capsys.readouterr().out
