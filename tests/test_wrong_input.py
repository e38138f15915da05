"""Wrong input at the command line: the exit code, words to act on, no traceback, nothing half-written."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from tests.scenes import OWN, flat_path, fleet2d_process, scenario, write_flat

from fleet2d.artifacts import arrow, store
from fleet2d.runs.run import open_run


@pytest.fixture
def fleet2d(fleet2d, monkeypatch, tmp_path):
    """The command line in an empty folder within another one."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return fleet2d


def written(content, name="home.yaml") -> Path:
    """Write a scenario in the current folder."""
    path = Path(name)
    path.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
    return path


def small(**sections):
    return scenario(
        "5 min",
        **{
            "users": {"ana": {"type": "meander"}},
            "robots": {"astro": {"type": "patrol"}},
            **sections,
        },
    )


def changed(change):
    """The small scenario with sections replaced, and simulation keys merged."""
    content = small()
    for section, value in change.items():
        merge = section in ("simulation", "artifacts", "floorplan")
        content[section] = {**content[section], **value} if merge else value
    return content


def check(result: tuple[int, str, str], code, words, left):
    """Check exit code, words, that there is no traceback, and which files there are."""
    found, out, err = result
    assert code == found, err
    assert "" == out
    assert "Traceback" not in err
    for word in words:
        assert word in err, err
    assert left == {str(path) for path in Path().rglob("*")}


# --- The scenario ------------------------------------------------------------------------------

WRONG: dict[str, tuple[dict[str, Any] | str, list[str]]] = {
    "empty": ("", ["home.yaml", "empty"]),
    "only comments": ("# nothing yet\n", ["home.yaml", "empty"]),
    "no YAML": ("simulation: {duration: [\n", ["home.yaml:2", "not valid YAML"]),
    "a list": ("- simulation\n", ["home.yaml", "list"]),
    "binary": ("\x00\x01", ["home.yaml"]),
    "no duration": ("floorplan: bundled\nsimulation: {}\n", ["simulation.duration"]),
    "unknown section": (small() | {"user": {}}, ["home.yaml:", "'user'", "did you mean 'users'"]),
    "unknown key": (
        changed({"simulation": {"durations": "1 h"}}),
        ["home.yaml:", "simulation", "'durations'", "did you mean 'duration'"],
    ),
    "unknown key of a camera": (
        changed({"robots": {"astro": {"type": "patrol", "camera": {"angle": 90}}}}),
        ["home.yaml:", "robots.astro.camera", "'angle'", "did you mean 'angle_deg'"],
    ),
    "unknown key of a behavior": (
        changed({"robots": {"astro": {"type": "patrol", "dwel": 5}}}),
        ["robots.astro", "'dwel'", "did you mean 'dwell'"],
    ),
    "unknown type": (
        changed({"users": {"ana": {"type": "meandr"}}}),
        ["users.ana", "'meandr'", "did you mean 'meander'", "schedule"],
    ),
    "unknown metric": (changed({"metrics": {"sighting": {}}}), ["metrics.sighting", "did you mean 'sightings'"]),
    "wrong type": (changed({"users": {"ana": {"speed": [1, 2]}}}), ["home.yaml:", "users.ana.speed", "speed"]),
    "wrong type of a section": (changed({"users": ["ana"]}), ["users"]),
    "wrong unit": (
        changed({"users": {"ana": {"speed": "3 kg"}}}),
        ["users.ana.speed", "unknown unit 'kg'", "'3 kg'", "m/s"],
    ),
    "wrong unit of time": (
        changed({"simulation": {"duration": "3 months"}}),
        ["simulation.duration", "unknown unit 'months'", "14 d"],
    ),
    "negative": (changed({"simulation": {"duration": "-3 d"}}), ["simulation.duration", "0 or more"]),
    "not a number": (changed({"users": {"ana": {"radius": float("nan")}}}), ["users.ana.radius", "finite"]),
    "too fast": (changed({"users": {"ana": {"speed": 1e300}}}), ["users.ana.speed", "20"]),
    "too slow": (changed({"users": {"ana": {"speed": 1e-300, "type": "meander"}}}), ["users.ana.speed"]),
    "turns too slowly": (changed({"robots": {"r": {"turn_rate_deg": 1e-300}}}), ["robots.r.turn_rate_deg"]),
    "a camera that sees to the moon": (
        changed({"robots": {"r": {"type": "patrol", "camera": {"range": [0, 3.8e8]}}}}),
        ["robots.r.camera", "range"],
    ),
    "a wild walk": (
        changed({"users": {"ana": {"type": "meander", "turn_std_deg": 1e300}}}),
        ["users.ana", "turn_std_deg"],
    ),
    "a range the wrong way": (
        changed({"robots": {"r": {"camera": {"range": [4, 1]}}}}), ["robots.r.camera", "range", "below"]
    ),
    "a seed below 0": (changed({"simulation": {"seed": -1}}), ["simulation.seed"]),
    "two entities of one name": (
        changed({"users": {"ana": {}}, "robots": {"ana": {}}}), ["robots.ana", "a user named 'ana'"]
    ),
    "a name that is none": (changed({"users": {"ana maria": {}}}), ["users", "ana maria", "letters"]),
    "start in a wall": (
        changed({"users": {"ana": {"start": [5.05, 1.0]}}}),
        ["users.ana", "5.05", "wall", "nearest free point is ["],
    ),
    "unreachable room": (
        changed({"robots": {"astro": {"type": "patrol", "rooms": ["storage"]}}}),
        ["robots.astro", "'storage'", "can't be reached", "kitchen_1"],
    ),
    "unknown room": (
        changed({"users": {"ana": {"start": "kichen"}}}),
        ["users.ana", "'kichen'", "did you mean 'kitchen", "bedroom_1"],
    ),
    "too wide": (changed({"users": {"ana": {"radius": 2}}}), ["radius", "2 m", "smaller"]),
    "no such plan": (changed({"floorplan": {"path": "nowhere.json"}}), ["floorplan.path", "no such file", "nowhere.json"]),
    "a plan that is a folder": (changed({"floorplan": {"path": "/"}}), ["floorplan.path", "folder"]),
    "a cell of nothing": (changed({"floorplan": {"cell": 0}}), ["cell"]),
    "a cell beyond the home": (changed({"floorplan": {"cell": 50}}), ["cell"]),
    "an interval between steps": (changed({"artifacts": {"trajectories": "1.5 s"}}), ["artifacts.trajectories", "multiple"]),
    "a step longer than the run": (changed({"simulation": {"step": "1 h"}}), ["simulation.duration", "shorter than one step"]),
    "a circle": (
        changed({"algorithms": {"a": {"type": f"{OWN}:Share", "reads": ["b"]}, "b": {"type": f"{OWN}:Share", "reads": ["a"]}}}),
        ["cycle", "a reads b", "b reads a"],
    ),
    "reads what is missing": (
        changed({"algorithms": {"a": {"type": f"{OWN}:Share", "reads": ["ltp"]}}}),
        ["algorithms.a.reads", "'ltp'", "no algorithm"],
    ),
    "a module that is missing": (changed({"users": {"ana": {"type": "mine:Walk"}}}), ["users.ana", "mine", "no module"]),
    "a class that is missing": (changed({"users": {"ana": {"type": f"{OWN}:Walk"}}}), ["users.ana", "Walk"]),
    "a class of another kind": (changed({"users": {"ana": {"type": f"{OWN}:Share"}}}), ["users.ana", "not a behavior"]),
    "a base that is missing": (small() | {"extends": "base.yaml"}, ["extends", "base.yaml"]),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_scenario_is_refused(fleet2d, case):
    content, words = WRONG[case]
    scenario_file = written(content)
    for command in (["validate", scenario_file], ["run", scenario_file, "--out", "out/run"]):
        check(fleet2d(*command), 2, ["error:", *words], {"home.yaml"})


def test_a_missing_scenario_is_refused(fleet2d):
    written(small())
    check(
        fleet2d("run", "hom.yaml"),
        2,
        ["error:", "hom.yaml", "there is no file", "did you mean 'home.yaml'"],
        {"home.yaml"},
    )


def test_a_folder_for_a_scenario_is_refused(fleet2d):
    Path("home").mkdir()
    check(fleet2d("run", "home"), 2, ["error:", "home", "folder"], {"home"})


# --- The floor plan ----------------------------------------------------------------------------

PLANS = {
    "no JSON": ("{", ["plan.json", "not JSON", "line 1"]),
    "not HouseExpo": ('{"walls": []}', ["plan.json", "not a HouseExpo plan", "verts"]),
    "a list": ("[1, 2]", ["plan.json", "a list"]),
    "our own format": (json.dumps({"format": "fleet2d-floorplan"}), ["plan.json", "native"]),
    "no area": ('{"verts": [[0, 0], [4, 0], [2, 0]]}', ["plan.json", "no area"]),
    "two points": ('{"verts": [[0, 0], [4, 0]]}', ["plan.json", "at least 3"]),
    "text for numbers": ('{"verts": [["a", 0], [4, 0], [4, 4]]}', ["plan.json", "verts[0]", "not a number"]),
    "not finite": ('{"verts": [[NaN, 0], [4, 0], [4, 4]]}', ["plan.json", "verts[0]", "finite"]),
    "in millimetres": ('{"verts": [[0, 0], [4e6, 0], [4e6, 4e6]]}', ["plan.json", "metres"]),
    "a dollhouse": ('{"verts": [[0, 0], [0.02, 0], [0.02, 0.02], [0, 0.02]]}', ["plan.json", "cell", "metres"]),
}  # fmt: skip


@pytest.mark.parametrize("case", PLANS)
def test_a_file_that_is_no_home_is_refused(fleet2d, case):
    text, words = PLANS[case]
    Path("plan.json").write_text(text)
    left = {"plan.json"}
    houseexpo = ["floorplan.type=houseexpo", "floorplan.path=plan.json"]
    check(fleet2d("run", *houseexpo, "--out", "out"), 2, ["error:", *words], left)


@pytest.mark.parametrize(
    "case", [name for name in PLANS if name not in ("our own format", "not HouseExpo")]
)
def test_what_is_no_home_is_not_drawn(fleet2d, case):
    text, words = PLANS[case]
    Path("plan.json").write_text(text)
    check(fleet2d("show", "plan.json", "--out", "plan.png"), 2, ["error:", *words], {"plan.json"})


def test_what_is_not_there_is_not_drawn(fleet2d):
    check(fleet2d("show", "nothing.json"), 2, ["error:", "nothing.json"], set())
    check(fleet2d("show", "famly_home"), 2, ["error:", "did you mean 'family_home'"], set())


def test_a_picture_of_an_unknown_kind_is_refused(fleet2d):
    check(fleet2d("show", flat_path(), "--out", "plan.doc"), 2, ["error:", ".png", ".svg"], set())


def test_a_picture_where_nobody_may_write_is_refused(fleet2d):
    Path("file").write_text("")
    result = fleet2d("show", flat_path(), "--out", "file/plan.png")
    check(result, 2, ["error:", "file/plan.png"], {"file"})


# --- Where to store ----------------------------------------------------------------------------


def test_a_run_directory_that_exists_is_left_alone(fleet2d):
    scenario_file = written(small())
    assert 0 == fleet2d("run", scenario_file, "--out", "run", "--quiet")[0]
    before = {path: path.stat().st_mtime_ns for path in Path("run").iterdir()}
    left = {"home.yaml", "run", *map(str, before)}
    check(
        fleet2d("run", scenario_file, "--out", "run"),
        2,
        ["error:", "run", "not empty", "--out"],
        left,
    )
    assert before == {path: path.stat().st_mtime_ns for path in Path("run").iterdir()}


def test_a_path_below_a_file_is_refused(fleet2d):
    scenario_file = written(small())
    result = fleet2d("run", scenario_file, "--out", "home.yaml/deep/run")
    check(result, 2, ["error:", "home.yaml", "not a directory", "--out"], {"home.yaml"})


@pytest.mark.skipif(os.name != "posix" or os.getuid() == 0, reason="root may write anywhere")
def test_a_directory_that_can_not_be_written_is_refused(fleet2d):
    scenario_file = written(small())
    Path("locked").mkdir(mode=0o555)
    result = fleet2d("run", scenario_file, "--out", "locked/run")
    check(result, 2, ["error:", "locked", "may not write", "--out"], {"home.yaml", "locked"})


@pytest.mark.skipif(
    not os.access("/proc", os.R_OK), reason="no /proc, where nobody can make a folder"
)
def test_a_directory_that_nobody_can_make_is_refused(fleet2d):
    scenario_file = written(small())
    result = fleet2d("run", scenario_file, "--out", "/proc/fleet2d/run")
    check(result, 2, ["error:", "/proc/fleet2d", "--out"], {"home.yaml"})


def no_space(*args, **kwargs):
    raise OSError(28, "No space left on device")


def test_a_disk_that_is_full_fails_with_exit_1(fleet2d, monkeypatch):
    scenario_file = written(small())
    monkeypatch.setattr(arrow.ParquetTable, "write", no_space)
    code, out, err = fleet2d("run", scenario_file, "--out", "run")
    assert (1, "") == (code, out)
    for word in ("error:", "disk is full", "artifacts", "--out"):
        assert word in err
    assert "Traceback" not in err
    assert "failed" == json.loads(Path("run/manifest.json").read_text())["status"]
    assert [] == list(Path("run").glob("*.parquet"))


def test_a_disk_full_from_the_start_fails_with_exit_1_and_leaves_nothing(fleet2d, monkeypatch):
    scenario_file = written(small())
    write = store.write_atomically

    def full(path: Path, content):
        if path.name == "floorplan.json":
            no_space()
        write(path, content)

    monkeypatch.setattr(store, "write_atomically", full)
    result = fleet2d("run", scenario_file, "--out", "deep/run")
    check(result, 1, ["error:", "disk is full", "--out"], {"home.yaml"})


@pytest.fixture
def tiny_disk(tmp_path):
    """A disk of 64 kB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(disk)]
    try:
        mounted = subprocess.run(command, capture_output=True, check=False).returncode == 0
    except OSError:
        mounted = False
    if not mounted:
        pytest.skip("no right to mount a small disk")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


def test_a_real_disk_that_is_full_fails_with_exit_1(fleet2d, tiny_disk):
    scenario_file = written(small(artifacts={"trajectories": "every step"}))
    code, _, err = fleet2d(
        "run", scenario_file, "simulation.duration=3 d", "--out", tiny_disk / "run"
    )
    assert 1 == code
    assert "disk is full" in err
    assert "Traceback" not in err
    manifest = tiny_disk / "run" / "manifest.json"
    assert not manifest.exists() or json.loads(manifest.read_text())["status"] != "complete"


# --- Components that fail ----------------------------------------------------------------------

COMPONENTS = """
import numpy as np
from fleet2d import Algorithm, Behavior, RoomDistribution

class Raises(Algorithm):
    def update(self, history, state):
        raise RuntimeError("no model today")

class NotANumber(Algorithm):
    def update(self, history, state):
        return {"mean": np.nan}

class WrongLength(Algorithm):
    def update(self, history, state):
        return RoomDistribution([1.0, 2.0])

class ReadsMissing(Algorithm):
    def update(self, history, state):
        return state.outputs["ltp"]

class Peeks(Algorithm):
    def update(self, history, state):
        return {"x": history.poses("ana").x}

class Trips(Behavior):
    def decide(self, now):
        if now.step > 100:
            raise RuntimeError("stumbled")
        return now.plan().go_to("any")

class Lost(Behavior):
    def decide(self, now):
        return now.plan().go_to("attic")

class Nonsense(Behavior):
    def decide(self, now):
        return "kitchen"
"""

FAILING = {
    "algorithms.mine": {
        "Raises": ["at step 59", "RuntimeError", "no model today"],
        "NotANumber": ["'mean'", "not finite"],
        "WrongLength": ["2 shares", "6 rooms"],
        "ReadsMissing": ["no algorithm 'ltp'", "ltp"],
        "Peeks": ["'ana'", "only metrics know where users are"],
    },
    "users.ana": {
        "Trips": ["at step 1", "RuntimeError", "stumbled"],
        "Lost": ["at step 0", "no room 'attic'", "kitchen_1"],
        "Nonsense": ["decide() returned 'kitchen'"],
    },
}
CASES = [(path, name) for path, names in FAILING.items() for name in names]


@pytest.mark.parametrize(("where", "name"), CASES, ids=[name for _, name in CASES])
def test_a_component_that_fails_is_named_with_exit_1(fleet2d, where, name):
    Path("mine.py").write_text(COMPONENTS)
    bucket, entry = where.split(".")
    fields = {"type": f"mine:{name}", **({"period": "60 s"} if bucket == "algorithms" else {})}
    content = small()
    content[bucket] = {**content.get(bucket, {}), entry: fields}
    scenario_file = written(content)
    code, out, err = fleet2d("run", scenario_file, "--out", "run")
    assert (1, "") == (code, out)
    assert "Traceback" not in err
    for word in ("error:", where, *FAILING[where][name]):
        assert word in err
    # What was stored until then is readable and says that it is not whole.
    assert "failed" == json.loads(Path("run/manifest.json").read_text())["status"]


def test_a_metric_that_fails_leaves_what_was_stored_before(fleet2d):
    Path("mine.py").write_text(
        "from fleet2d import Metric\n\n\nclass Breaks(Metric):\n"
        "    def update(self, history, state):\n        raise RuntimeError('no ruler')\n"
    )
    content = small()
    content["metrics"] = {"broken": {"type": "mine:Breaks", "period": "60 s"}}
    code, _, err = fleet2d("run", written(content), "--out", "run")
    assert 1 == code
    assert "metrics.broken" in err
    run = open_run("run")
    assert "failed" == run.status
    assert run.tables["key_frames"].num_rows > 0
    assert [] == run.verify()


def test_a_module_that_fails_to_import_is_named(fleet2d):
    Path("mine.py").write_text("raise RuntimeError('half written')")
    scenario_file = written(small(users={"ana": {"type": "mine:Walk"}}))
    code, _, err = fleet2d("run", scenario_file, "--out", "run")
    assert 2 == code
    for word in ("users.ana", "mine:Walk", "RuntimeError", "half written"):
        assert word in err
    assert not Path("run").exists()


def test_a_module_that_fails_to_import_is_told_once(fleet2d):
    Path("mine.py").write_text("x = 1\ny = z\n")
    users = {"ana": {"type": "mine:Walk"}, "bob": "mine:Sit"}
    scenario_file = written(small(users=users, algorithms={"a": "mine:Count"}))
    code, _, err = fleet2d("validate", scenario_file)
    assert 2 == code
    assert 1 == err.count("NameError")
    assert "users.ana.type: can't import 'mine:Walk': mine.py:2: NameError: name 'z'" in err


# --- The command line itself -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "--seed", "text"], ["--seed", "integer"]),
        (["run", "--seed", "-1"], ["seed"]),
        (["run", "home.yaml", "simulation.duration"], ["'simulation.duration'", "no '='", "key.path=value"]),
        (["run", "home.yaml", "simulation.duration="], ["'simulation.duration='", "no value"]),
        (["run", "home.yaml", "simulation..x=1"], ["key is empty"]),
        (["run", "home.yaml", "simulation.durations=1 h"], ["durations", "did you mean 'duration'"]),
        (["run", "home.yaml", "users.ana.speed=fast"], ["users.ana.speed=fast", "expected a speed"]),
        (["validate", "home.yaml", "simulation.duration=7"], ["7 has no unit: write '7 d', '7 h', '7 min' or '7 s'"]),
        (["validate", "home.yaml", "robots.astro.behaviors[0].dwell=1 h"], ["write robots.astro.behaviors.0.dwell=1 h"]),
        (["validate", "home.yaml", "simulation/seed=3"], ["write simulation.seed=3"]),
        (["validate", "home.yaml", "seed=3"], ["unknown key 'seed'", "Write simulation.seed"]),
        (["validate", "home.yaml", "astro.speed=1"], ["unknown key 'astro'", "Write robots.astro"]),
        (["validate", "home.yaml", "users=[ana]"], ["expected a mapping of keys, got ['ana']: write {ana: …}"]),
        (["validate", "home.yaml", "users={null: routine}"], ["null is not text in YAML: choose another name"]),
        (["validate", "home.yaml", "users={007: routine}"], ["the name '007' must be letters"]),
        (["validate", "home.yaml", "robots.astro.behaviors=hangout"], ["expected a list, got 'hangout': write [hangout]"]),
        (["validate", "home.yaml", "expect={a: never(room(astro) = bathroom)}"], ["write never(room(astro) == bathroom)"]),
        (["validate", "home.yaml", "expect={a: always(speed(astro) => 1 && moving(astro))}"], ["write always(speed(astro) >= 1 and moving(astro))"]),
        (["validate", "home.yaml", "robots.astro.camera.range=0.3,4.5"], ["expected a list like [0"]),
        (["validate", "home.yaml", "robots.asto.speed=0.3"], ["there is no robots.asto", "did you mean 'astro'"]),
        (["validate", "home.yaml", "robots.astro.camera.range=4.5"], ["expected a list like [0"]),
        (["validate", "floorplan=nope.json"], ["override 'floorplan=nope.json': floorplan.type", "to read a file write {type: TYPE, path: nope.json} with one of ", "houseexpo", "valetudo"]),
        (["validate", "floorplan.path=he.json"], ["unknown key 'path'", "is a key of", "houseexpo", "give floorplan.type, too"]),
        (["validate", "bundled:rounds", "robots.astro.dwell=5 min"], ["unknown key 'dwell'", "robots.astro.behaviors.0.dwell"]),
        (["run", "home.yaml", "users.bob=null"], ["users.bob", "none of this name", "ana"]),
        (["run", "home.yaml", "robots.astro.behaviors.3.dwell=5 s"], ["behaviors.3"]),
        (["run", "home.yaml", "other.yaml"], ["'other.yaml'", "no '='"]),
        (["run", "home.yaml", "--fast"], ["--fast"]),
        (["rum"], ["rum"]),
        (["verify", "home.yaml", "--again"], ["home.yaml", "file"]),
        (["verify", "nothing", "--again"], ["nothing", "does not exist"]),
        (["verify"], ["RUN_DIR"]),
        (["convert", "nothing.yaml", "new.yaml"], ["nothing.yaml"]),
    ],
)  # fmt: skip
def test_a_wrong_call_is_refused(fleet2d, arguments, words):
    written(small())
    check(fleet2d(*arguments), 2, words, {"home.yaml"})


def test_a_process_ends_with_the_same_code_and_words(tmp_path):
    """The same through the real entry point."""
    done = fleet2d_process("run", "nothing.yaml", cwd=tmp_path)
    assert 2 == done.returncode
    assert "" == done.stdout
    assert done.stderr.startswith("error: ") or "\nerror: " in done.stderr
    assert "nothing.yaml" in done.stderr
    assert "Traceback" not in done.stderr
    assert [] == list(tmp_path.iterdir())


def test_a_flat_that_moved_is_named_by_the_file_that_names_it(fleet2d):
    Path("plans").mkdir()
    plan = write_flat(Path("plans"))
    content = small()
    content["floorplan"]["path"] = str(plan)
    scenario_file = written(content)
    assert "" == fleet2d("validate", scenario_file)[2]  # one of its rooms has no door
    plan.unlink()
    check(
        fleet2d("validate", scenario_file),
        2,
        ["home.yaml:", "floorplan.path", "flat.json"],
        {"home.yaml", "plans"},
    )
