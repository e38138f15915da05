"""Values become plain JSON data."""

import datetime as dt
import hashlib
import json
import math
from pathlib import Path

import numpy as np
import pytest
from tests.scenes import run, scenario

from fleet2d.artifacts.manifest import InputRecord, Manifest, input_record, plain, versions
from fleet2d.errors import RunDirectoryError


def test_plain_has_words_for_what_models_hold():
    given = {
        "n": np.int32(3),
        "a": np.array([1.5, np.nan]),
        "d": dt.date(2026, 1, 5),
        "t": dt.timedelta(minutes=1),
        "p": Path("a"),
        "s": {"b", "a"},
        1: (True, None),
    }

    expected = {
        "n": 3,
        "a": [1.5, None],
        "d": "2026-01-05",
        "t": 60.0,
        "p": "a",
        "s": ["a", "b"],
        "1": [True, None],
    }
    assert expected == plain(given)


def test_manifest_is_sorted_and_strict_json(tmp_path):
    Manifest(metrics={"b": math.nan, "a": np.float64(math.inf)}).write(tmp_path)

    def refuse(word):
        pytest.fail(f"{word} is no JSON")

    text = (tmp_path / "manifest.json").read_text()
    content = json.loads(text, parse_constant=refuse)
    assert {"a": None, "b": None} == content["metrics"]
    assert sorted(content) == list(content)
    assert text == json.dumps(content, indent=2, sort_keys=True) + "\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is damaged"),
        ('{"format": 1, "status": "comp', "is damaged"),
        ("[]", "has no key 'format'"),
        ("{}", "has no key 'format'"),
        ('{"format": 1, "status": "complete"}', "lacks digest"),
        ('{"format": 99}', "written by a later Fleet2D"),
        ("\x00\xff", "is damaged"),
    ],
)
def test_damaged_manifest_is_named(tmp_path, text, message):
    (tmp_path / "manifest.json").write_bytes(text.encode("latin-1"))

    with pytest.raises(RunDirectoryError, match=message):
        Manifest.read(tmp_path)


def test_input_record_hashes_the_bytes(tmp_path):
    (tmp_path / "plan.json").write_bytes(b"walls")

    path = tmp_path / "plan.json"
    expected = InputRecord(path=str(path), sha256=hashlib.sha256(b"walls").hexdigest())
    assert expected == input_record(path)


def test_versions_name_all_that_numbers_depend_on():
    names = versions()

    expected = {"fleet2d", "numpy", "platform", "pyarrow", "python", "shapely"}
    assert expected == names.keys()
    assert np.__version__ == names["numpy"]


def test_fields_are_filled_from_what_the_engine_knows_of_a_run():
    users = {"ana": {"type": "meander"}, "ben": {}}
    stored = run(scenario("5 min", users=users, robots={"astro": {}}))
    manifest = Manifest.model_validate(stored.manifest)

    assert (4, 300, 300.0) == (manifest.seed, manifest.steps, manifest.simulated_s)
    assert (["ana", "ben"], ["astro"]) == (manifest.entities.users, manifest.entities.robots)
    idle = [note for note in manifest.notes if "has no behavior" in note]
    assert ["users.ben", "robots.astro"] == [note.split()[0] for note in idle]
    assert {"setup", "simulate", "save"} == manifest.wall_s.keys()
    assert 4 == manifest.scenario["simulation"]["seed"]
