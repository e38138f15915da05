"""Names in letters of any script: which there are, and that a whole run is stored and read back by them."""

import json

import pytest
import yaml

import fleet2d
from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.errors import ArtifactError
from fleet2d.expectations.parse import parse_expectation
from fleet2d.storage.names import MOST_BYTES, problem_of

# German, Arabic, Russian, Japanese, Hindi (with vowel signs, which are marks), Greek, Hebrew, Korean.
NAMES = ("müller", "مريم", "Ольга", "花子", "हिंदी", "Ελένη", "שרה", "민수", "bolt-2", "a_1")


@pytest.mark.parametrize("name", NAMES)
def test_name_of_any_script_is_one(name):
    assert problem_of(name) is None


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("", "a letter first"),
        ("2nd", "a letter first"),
        ("_a", "a letter first"),
        ("a b", "must be letters"),
        ("a.b", "must be letters"),
        ("a/b", "must be letters"),
        ("a\u202eb", "must be letters"),  # which would turn the text round it
        ("\u0301a", "a letter first"),
        ("👩", "a letter first"),
        ("mu\u0308ller", "must be written müller"),
        ("ﬁona", "must be written fiona"),
        ("Ａna", "must be written Ana"),
        ("ü" * (MOST_BYTES // 2 + 1), "100 bytes at most"),
    ],
)
def test_what_is_no_name_is_said(name, problem):
    assert problem in (problem_of(name) or "")


def test_expectations_read_a_name_as_it_is():
    for name in NAMES:
        if "-" not in name:
            assert name in repr(parse_expectation(f"always(distance(astro, {name}) > 0.5 m)"))


SCENARIO = {
    "extends": "bundled:paper",
    "simulation": {"duration": "2 h", "start": "2026-01-05T17:00", "seed": 4},
    "users": {"ana": None, "müller": {"type": "routine"}, "مريم": {"type": "routine"}},
    "robots": {"astro": None, "ロボ": {"type": "patrol", "camera": {"range": [0, 4.5]}}},
    "algorithms": {"ltp": None, "присутствие": {"type": "long_term_presence"}},
    "metrics": {"ltp_error": {"of": "присутствие"}, "sightings": {}},
    "floorplan": {"layers": {"explored": {}, "स्थान": {"fill": 1}}, "type": "bundled"},
    "artifacts": {"learned": True},
    "expect": {"abstand": "always(distance(ロボ, müller) > 0.01 m)"},
}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the fonts of this machine")
def test_run_of_names_in_any_script_is_stored_reproduced_and_exported(fleet2d, tmp_path):
    folder = tmp_path / "Größe 1" / "بيت"
    folder.mkdir(parents=True)
    file = folder / "مريم.yaml"
    file.write_text(yaml.safe_dump(SCENARIO, allow_unicode=True), encoding="utf-8")
    run = folder / "lauf ß"

    assert 0 == fleet2d("run", str(file), "--out", str(run), "--quiet")[0]
    assert 0 == fleet2d("verify", str(run), "--again")[0]
    for name in ("posen ü.csv", "a.jsonl", "a.mcap", "seite ä.html"):
        code, out, err = fleet2d("export", str(run), str(folder / name), "--to", "10 min")
        assert 0 == code, (name, out, err)
        content = (folder / name).read_bytes()
        forms = ("مريم".encode(), json.dumps("مريم")[1:-1].encode())  # JSON has numbers of letters
        assert any(form in content for form in forms) or name.endswith((".mcap", ".html")), name
    code, out, _ = fleet2d("show", str(run), "--at", "day 1 18:00", "--out", str(folder / "ü.svg"))
    assert 0 == code, out


def test_tables_of_such_a_run_have_its_names(tmp_path):
    fleet2d.run(SCENARIO, out=tmp_path / "run")
    run = fleet2d.open_run(tmp_path / "run")
    assert {"müller", "مريم"} == set(run.metrics["sightings"])
    assert {"присутствие", "layer.explored.ロボ", "layer.स्थान"} <= set(run.tables)
    assert {"müller", "مريم", "ロボ"} == set(run.pandas("trajectories")["entity"])
    assert (tmp_path / "run" / "learned" / "присутствие.npz").is_file()


@pytest.mark.parametrize("name", ["", ".a", "-a", "a/b", "a b", "a\u202eb"])
def test_a_table_is_named_by_words_only(name):
    with pytest.raises(ArtifactError):
        TableSpec(name, (Column("step", "step"),))
