"""Damaged and forged folders of studies: one line says what is wrong, where, and what to do.

In a trial, 56 of 135 calls of `status`, `report` and `rerun` on damaged folders ended in errors of
libraries (`ArrowInvalid`, `JSONDecodeError`, `TypeError`), names with escapes steered the terminal,
and a forged record of a part deleted files elsewhere.
"""

import json
import random
import shutil
from functools import partial
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from tests.studies.scenes import SPEED, run, small
from tests.thorough import THOROUGH, some

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")

RESULTS = "results/000001.parquet"
TABLE = "tables/room_share/000001-*.parquet"
JSON = ("study.json",)
PLAN = "plan.parquet"
PARQUET = (PLAN, "scenarios.parquet", "variants.parquet", RESULTS, TABLE)
COMPARE = [{"metric": "sightings.ana", "against": {SPEED: 0.3}}]
STUDY = small(replicates=2, keep={"tables": ["room_share"]}, compare=COMPARE)


def _cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _flip(path, seed=1):
    content = bytearray(path.read_bytes())
    chance = random.Random(seed)
    for _ in range(8):
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    path.write_bytes(content)


def _as_folder(path):
    path.unlink()
    path.mkdir()


def _as_link(path):
    path.unlink()
    path.symlink_to("/nowhere/at/all")


BYTES = {
    "empty": lambda path: path.write_bytes(b"") and None,
    "cut": _cut,
    "flipped": _flip,
    "noise": lambda path: path.write_bytes(random.Random(2).randbytes(500)) and None,
    "zeros": lambda path: path.write_bytes(bytes(path.stat().st_size)) and None,
    "gone": Path.unlink,
    "folder": _as_folder,
    "link": _as_link,
}
VALUES = (None, [], {}, 7, "text", "\x1b[2J", [[1]], {"a": 1}, -(2**70))


def _set_value(path, key, value):
    content = json.loads(path.read_text())
    content[key] = value
    path.write_text(json.dumps(content))


def _with_number(table, number):
    """Return a table whose last row has another number of a variant."""
    numbers = [*table["variant"].to_pylist()[:-1], number]
    column = table.column_names.index("variant")
    return table.set_column(column, "variant", pa.array(numbers, pa.int32()))


def _forge(path, files):
    """Write results that name other files of tables."""
    metadata = {"fleet2d.tables": json.dumps(files)}
    pq.write_table(pq.read_table(path).replace_schema_metadata(metadata), path)


def _change_table(path, change):
    pq.write_table(change(pq.read_table(path)), path)


def _filled(table, column):
    """Return a table whose columns are all alike."""
    filled = pa.table(dict.fromkeys(table.column_names, column))
    return filled.replace_schema_metadata(table.schema.metadata)


TABLES = {
    "no columns": lambda table: table.select([]),
    "first column only": lambda table: table.select([0]),
    "last column only": lambda table: table.select([table.num_columns - 1]),
    "no rows": lambda table: table.slice(0, 0),
    "all text": lambda table: _filled(table, ["\x1b[2J"] * table.num_rows),
    "all lists": lambda table: _filled(table, [[1]] * table.num_rows),
    "all null": lambda table: _filled(table, pa.nulls(table.num_rows)),
}
CASES = [
    *((file, name, damage) for file in (*JSON, *PARQUET) for name, damage in BYTES.items()),
    *(
        ("study.json", f"{key}={value!r}", lambda p, k=key, v=value: _set_value(p, k, v))
        for key in ("format", "name", "columns", "populations", "tables", "compare", "source")
        for value in VALUES
    ),
    *(
        (RESULTS, f"tables={value!r}", lambda p, v=value: _forge(p, v))
        for value in (*VALUES, {"room_share": None}, {"room_share": "\x1b[2J"})
    ),
    *(
        (file, name, lambda p, c=change: _change_table(p, c))
        for file in PARQUET
        for name, change in TABLES.items()
    ),
    *(
        (
            file,
            f"number {number}",
            partial(_change_table, change=partial(_with_number, number=number)),
        )
        for file in (PLAN, RESULTS)
        for number in (-5, 2**31 - 1)  # the former took another's place
    ),
]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A study that ran to its end."""
    folder = tmp_path_factory.mktemp("studies") / "study"
    run(STUDY, folder)
    return folder


@pytest.fixture
def study(whole, tmp_path):
    """The same, to be damaged."""
    return shutil.copytree(whole, tmp_path / "study")


COMMANDS = (("status",), ("rerun", "1"), ("report",))


def run_again(fleet2d, study, **changes):
    """Run a study's file again, with changes to it, in the folder of its results."""
    Path("study.yaml").write_text(yaml.safe_dump({**STUDY, **changes}, sort_keys=False))
    arguments = ("--executor", "serial", "--quiet", "--out", str(study))
    return fleet2d("study", "run", "study.yaml", *arguments)


@pytest.mark.slow
@pytest.mark.parametrize(
    "number", some(range(len(CASES)), 7), ids=lambda n: f"{CASES[n][0]} {CASES[n][1]}"
)
def test_commands_say_in_one_line_what_is_damaged(study, tmp_path, fleet2d, number):
    file, _, damage = CASES[number]
    damage(next(study.glob(file)))
    # A report takes a second: of alike cases only some are reported.
    commands = COMMANDS if THOROUGH or number % 77 == 0 else COMMANDS[:2]
    for command, *arguments in commands:
        code, out, err = fleet2d("study", command, str(study), *arguments)
        assert "\x1b" not in out + err, (command, out, err)
        assert "Traceback" not in err, err
        if code:
            assert code in (1, 2), (command, code, err)
            lines = err.strip().splitlines()
            assert len(lines) == 1, err
            assert lines[0].startswith(("error: ", "not reproduced")), err


OF_ITS_PLAN = [n for n, case in enumerate(CASES) if case[0] == PLAN and case[1] in TABLES]


@pytest.mark.parametrize("number", sorted({*some(range(1, len(CASES)), 11), *OF_ITS_PLAN[3:5]}))
def test_the_study_runs_again_or_says_why_not(study, fleet2d, number):
    file, _, damage = CASES[number]
    damage(next(study.glob(file)))
    code, out, err = run_again(fleet2d, study)
    assert "Traceback" not in err, err
    assert "\x1b" not in out + err
    assert code == 0 or err.startswith("error: "), (code, err)


@pytest.mark.parametrize(
    ("file", "change", "command"),
    [
        ("study.json", "columns=[]", "report"),
        (RESULTS, "all null", "status"),
        (RESULTS, "number -5", "status"),
        (PLAN, "number -5", "status"),
    ],
)
def test_a_contradiction_within_a_file_is_named(study, fleet2d, file, change, command):
    """They ended in `KeyError: 'seed'` and `cannot convert float NaN to integer`."""
    next(damage for name, case, damage in CASES if (name, case) == (file, change))(study / file)

    code, _, err = fleet2d("study", command, str(study))

    assert (2, 1) == (code, err.count("\n"))
    assert f"{file} is damaged" in err


# --- Names and links ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["../precious", "/precious", "study.json", "results/../../precious"]
)
def test_forged_names_of_files_delete_nothing(study, fleet2d, name):
    """A record that named `../x` or an absolute path had that file deleted by `study run`."""
    precious = study.parent / "precious"
    precious.write_text("keep")
    _forge(study / RESULTS, {"room_share": str(precious) if name.startswith("/") else name})
    code, _, err = run_again(fleet2d, study)
    assert (0, "") == (code, err)  # the part is run again
    assert precious.read_text() == "keep"
    assert (study / "study.json").exists()


@pytest.mark.parametrize("link", ["results", "study.json.partial", "tables", "lock"])
def test_nothing_is_written_through_a_link(study, fleet2d, link):
    """`study.json.partial` as a link had its target overwritten."""
    outside = study.parent / "outside"
    outside.mkdir()
    (outside / "precious").write_text("keep")
    if (study / link).is_dir():
        shutil.rmtree(study / link)
    (study / link).symlink_to(outside / "precious" if "." in link or link == "lock" else outside)
    code, _, err = run_again(fleet2d, study, replicates=3)
    assert ["precious"] == [path.name for path in outside.iterdir()]
    assert (outside / "precious").read_text() == "keep"
    assert code == 0 or "is a link" in err


def test_names_with_escapes_are_printed_without(study, fleet2d):
    _set_value(study / "study.json", "name", "speeds\x1b[2J")
    code, out, _ = fleet2d("study", "status", str(study))
    assert (0, "speeds\\x1b[2J: 4 of 4 variants complete, 0 failed, 0 to run\n") == (code, out)


# --- Searches -------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("file", ["search.json", "trials.log"])
@pytest.mark.parametrize("damage", ["empty", "cut", "noise", "folder", "link"])
def test_a_damaged_search_is_refused_in_one_line(tmp_path, fleet2d, file, damage):
    """Damaged trials ended in errors of Optuna and of json."""
    pytest.importorskip("optuna")
    settings = {
        "search": {"speed": {"key": SPEED, "low": 0.2, "high": 1.0}},
        "objective": {"distance.astro": "maximize"},
        "trials": 1,
        "held_out": {"radius": [0.15]},
    }
    axes = {"radius": {"key": "robots.astro.radius", "values": [0.1, 0.15]}}
    study = small(axes=axes, replicates=1, tune=settings)
    Path("study.yaml").write_text(yaml.safe_dump(study, sort_keys=False))
    options = ("--executor", "serial", "--quiet", "--out", "search")
    arguments = ("study", "tune", "study.yaml", *options)
    assert fleet2d(*arguments)[0] == 0
    BYTES[damage](Path("search") / file)
    code, _, err = fleet2d(*arguments)
    assert "Traceback" not in err, err
    if code:
        assert (2, 1) == (code, len(err.strip().splitlines())), err
        assert err.startswith("error: ")
        assert "search" in err
