"""Which code of a scenario runs: one's own always, that of stored runs and studies if trusted."""

import json
import socket
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import yaml
from tests.studies.scenes import base

import fleet2d as package
from fleet2d.configuration.trust import (
    UntrustedCodeError,
    code_lines,
    code_of,
    running_code,
    stored_code,
)
from fleet2d.engine.interrupt import Interruptions
from fleet2d.entities.plan import data_of
from fleet2d.errors import ComponentError, ScenarioError
from fleet2d.interventions import Decide
from fleet2d.studies.reader import open_study

CODE = """
from pathlib import Path
import fleet2d
from fleet2d.entities.meander import Meander

Path("ran").touch()

class Walk(Meander):
    pass

class Count(fleet2d.Algorithm):
    def update(self, history, state):
        return {"n": 1.0}
"""


@pytest.fixture
def fleet2d(fleet2d):
    """The command line in a folder with a scenario, a study and a search with code of their own."""
    Path("mine.py").write_text(CODE)
    home = base(algorithms={"count": {"type": "mine:Count", "period": "1 min"}})
    home["users"]["ana"]["type"] = "mine:Walk"
    Path("home.yaml").write_text(yaml.safe_dump(home))
    study = {"base": "home.yaml", "axes": {"robots.astro.speed": [0.3]}, "replicates": 1}
    Path("study.yaml").write_text(yaml.safe_dump(study))
    search = {
        "trials": 1,
        "objective": {"distance.ana": "maximize"},
        "search": {"speed": {"key": "users.ana.speed", "low": 0.5, "high": 1.0}},
        "held_out": {"robots.astro.speed": [0.3]},
    }
    tuned = {**study, "axes": {"robots.astro.speed": [0.3, 0.6]}, "tune": search}
    Path("search.yaml").write_text(yaml.safe_dump(tuned))

    return fleet2d


SERIAL = ("--executor", "serial")


@pytest.mark.parametrize(
    "command",
    [
        ("study", "run", "study.yaml", *SERIAL),
        ("study", "run", "study.yaml", "--workers", "1"),
        ("study", "run", "study.yaml", "--dry-run"),
        pytest.param(("study", "tune", "search.yaml", *SERIAL), marks=pytest.mark.slow),
        ("run", "home.yaml", "--quiet"),
        ("validate", "home.yaml"),
    ],
)
def test_own_files_run_what_they_name(fleet2d, command):
    """`study run` refused one's own file while `run` had just executed its components."""
    code, _, err = fleet2d(*command)
    expected = 2 if command[0] == "validate" else 0  # a room of this home can't be reached
    assert (expected, True) == (code, Path("ran").exists()), err


def test_an_own_scenario_that_is_watched_runs_what_it_names(fleet2d):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = str(taken.getsockname()[1])
        _, _, err = fleet2d("view", "home.yaml", "--no-browser", "--port", port)
    assert f"port {port} can't be used" in err  # all but that is well
    assert Path("ran").exists()


def elsewhere(folder: Path, store: Path, name) -> Path:
    """Let a stored file name code that this process hasn't loaded, as from another machine."""
    other = folder / "other"
    other.mkdir()
    (other / "mine.py").write_text(CODE)
    path = store / name
    path.write_text(path.read_text().replace(f"{folder}/mine:", f"{other}/mine:"))
    (folder / "ran").unlink()
    return other / "mine.py"


def test_a_variant_of_a_stored_study_asks_for_trust(fleet2d, tmp_path, monkeypatch):
    assert 0 == fleet2d("study", "run", "study.yaml", *SERIAL)[0]
    assert 0 == fleet2d("study", "rerun", "studies/study", "0")[0]  # loaded already: its own code
    (tmp_path / "other").mkdir()
    theirs = tmp_path / "other" / "mine.py"
    theirs.write_text(CODE)
    study = open_study("studies/study")
    text = json.dumps(study.scenario(0)).replace(f"{tmp_path}/mine:", f"{tmp_path}/other/mine:")
    monkeypatch.setattr(type(study), "scenario", lambda *_: json.loads(text))
    Path("ran").unlink()

    code, _, err = fleet2d("study", "rerun", "studies/study", "0")
    assert (2, False) == (code, Path("ran").exists())
    assert "variant 0 of studies/study has code of its own, which would run:" in err
    assert f"  {theirs} (" in err
    with pytest.raises(UntrustedCodeError):
        study.rerun(0)
    assert study.rerun(0, trust=True).digest
    assert Path("ran").exists()

    (tmp_path / "third").mkdir()
    theirs.rename(tmp_path / "third" / "mine.py")
    text = text.replace("/other/", "/third/")
    _, _, err = fleet2d("study", "rerun", "studies/study", "0", "--trust")
    assert f"trusted, with all files in these folders:\n  {tmp_path}/third/mine.py (" in err


def stored(folder: Path) -> Path:
    """Store a run, as of another machine; return the file of its code."""
    package.run("home.yaml", seed=4, out=folder / "run")
    return elsewhere(folder, folder / "run", "manifest.json")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "made"),
    [
        (("show", "run"), "run/picture.png"),
        (("export", "run", "page.html"), "page.html"),
        (("export", "run", "a.gif", "--height", "120", "--to", "step 60"), "a.gif"),
    ],
)
def test_a_stored_run_is_shown_without_code_unless_a_body_needs_it(
    fleet2d, tmp_path, command, made
):
    theirs = stored(tmp_path)
    code, _, err = fleet2d(*command)
    assert not Path("ran").exists()
    if code:
        assert 2 == code
        assert f"{theirs} (users.ana" in err
        assert "algorithms" not in err
        code, _, err = fleet2d(*command, "--trust")
        assert f"  {theirs} (" in err
        assert "algorithms.count.type" in err  # it is asked once, for all of the run
    assert 0 == code, err
    assert Path(made).exists()


def test_a_path_of_a_stored_run_asks_for_trust_in_python_too(fleet2d, tmp_path):
    stored(tmp_path)
    run = package.open_run("run")
    for use in (lambda: run.path("ana"), lambda: package.judge("always(room(ana) != bath)", run)):
        with pytest.raises(UntrustedCodeError, match="which would run"):
            use()
    assert not Path("ran").exists()
    assert 0 < len(package.open_run("run", trust=True).path("ana").x)


def test_a_run_of_this_process_needs_no_trust(fleet2d, tmp_path):
    run = package.run("home.yaml", seed=4, out="run")
    assert run.trust
    assert 0 < len(run.path("ana").x)


INTERRUPT = """
from pathlib import Path
import numpy as np
import fleet2d

Path("ran").touch()

class Never(fleet2d.Interrupt):
    def holds(self, span):
        return np.zeros(span.poses.x.shape[1], bool)
"""


def half_a_run(name) -> package.Simulation:
    """A driven robot whose plan waits for an interrupt; the file in which it is isn't loaded."""
    Path("theirs.py").write_text(INTERRUPT)
    simulation = package.Simulation(
        "bundled:paper", "simulation.duration=20 min", seed=4, out="half"
    )
    simulation.drive("astro")
    simulation.do(
        Decide("astro", data_of(simulation.plan("astro").stay().interrupt_on("home_empty")))
    )
    simulation.advance(200)
    interruptions = simulation._state.find(Interruptions)
    waits = interruptions._held
    waits[next(iter(waits))[0], name] = False
    return simulation


@pytest.mark.parametrize(("command", "status"), [("resume", "interrupted"), ("verify --again", "complete")])  # fmt: skip
def test_an_interrupt_that_only_a_plan_from_outside_names_is_listed(
    fleet2d, tmp_path, command, status
):
    """A run directory from elsewhere named its code there, and `resume` ran it without a word."""
    half_a_run("home_empty").finish()
    path = Path("half/manifest.json")
    manifest = json.loads(path.read_text())
    manifest["interventions"][1]["plan"]["interrupts"] = [f"{tmp_path}/theirs:Never"]
    path.write_text(json.dumps({**manifest, "status": status}))
    code, _, err = fleet2d(*command.split(), "half")
    assert (2, False) == (code, Path("ran").exists())
    assert f"{tmp_path}/theirs.py (interventions.1.plan.interrupts.0)" in err


def test_an_interrupt_that_only_a_checkpoint_names_asks_for_trust(fleet2d, tmp_path):
    """Its code is imported when the run goes on, after the run was set up and looked harmless."""
    half_a_run(f"{tmp_path}/theirs:Never").finish()
    code, _, err = fleet2d("resume", "half")
    assert (1, False) == (code, Path("ran").exists())
    assert f"would run {tmp_path}/theirs.py, which is not trusted" in err


def test_a_simulation_takes_its_trust_into_threads(fleet2d, tmp_path):
    """`view` simulates in a thread, which has no command line that it could ask."""
    with running_code(allowed=False):
        simulation = half_a_run(f"{tmp_path}/theirs:Never")
    with ThreadPoolExecutor() as threads, pytest.raises(ComponentError, match="would run"):
        threads.submit(simulation.advance, 200).result()
    assert not Path("ran").exists()


def test_files_that_a_component_imports_from_beside_it_are_listed(tmp_path):
    (tmp_path / "mine.py").write_text("import theirs")
    (tmp_path / "theirs.py").write_text("")
    code = code_of({"type": f"{tmp_path}/mine:Own"})
    assert {f"{tmp_path}/mine.py": ["type"], f"{tmp_path}/theirs.py": ["type"]} == code


def test_all_of_a_program_is_listed(tmp_path):
    """Arguments weren't shown: `/bin/sh -c …` read as `/bin/sh`."""
    program = tmp_path / "my program"
    program.touch()
    long = "x" * 3000
    arguments = ["-c", f"id > ~/it; {long}", "\nNone of it has run\x1b[2J"]
    content = {"algorithms": {"p": {"command": str(program), "arguments": arguments}}}
    with pytest.raises(UntrustedCodeError) as caught, stored_code("it", content, trust=False):
        pass
    line = f"  '{program}' -c 'id > ~/it; {long}' '\\nNone of it has run\\x1b[2J'"
    assert f"{line} (algorithms.p.command)" in str(caught.value).splitlines()


def test_the_name_of_a_stored_run_is_escaped():
    content = {"algorithms": {"a": {"type": "mine:Own"}}}
    with (
        pytest.raises(UntrustedCodeError, match=r"^month\\x1b\[2J has code of its own"),
        stored_code("month\x1b[2J", content, trust=False),
    ):
        pass


def test_all_files_are_listed_however_many_they_are(tmp_path):
    content = {f"a{i}": {"type": f"{tmp_path}/mine{i}:Own"} for i in range(500)}
    with pytest.raises(UntrustedCodeError) as caught, stored_code("it", content, trust=False):
        pass
    assert all(f"{tmp_path}/mine{i}.py" in str(caught.value) for i in range(500))


@pytest.mark.parametrize("word", ["fetch", "", "a\0b", "x" * 5000, "/"])
def test_other_commands_are_no_programs(tmp_path, word):
    assert {} == code_of({"script": [{"call": "astro", "command": word}]})


def test_a_file_that_a_stored_scenario_extends_is_listed_and_its_code_asks(fleet2d, tmp_path):
    """A forged manifest may extend a file that names the code."""
    package.run("bundled:paper", "simulation.duration=1 min", seed=4, out="run")
    path = Path("run/manifest.json")
    manifest = json.loads(path.read_text())
    manifest["scenario"]["extends"] = f"{tmp_path}/home.yaml"
    path.write_text(json.dumps({**manifest, "inputs": []}))
    assert [f"  {tmp_path}/home.yaml (extends)"] == code_lines(manifest["scenario"])
    assert 2 == fleet2d("verify", "run", "--again")[0]
    with running_code(allowed=False), pytest.raises(ScenarioError, match="would run"):
        package.load_scenario(manifest["scenario"])
    assert not Path("ran").exists()


@pytest.mark.parametrize("name", ["mine:Über", "a/b/mine.py:C", "mine:A.B", "../x:Y", "ü.ö:ä"])
def test_no_name_of_code_hides_from_the_list(name):
    assert [["a.0.type"]] == list(code_of({"a": [{"type": name}]}).values())
    content = {"a": [{"type": name}]}
    with (
        pytest.raises(UntrustedCodeError, match=r"a\.0\.type"),
        stored_code("it", content, trust=False),
    ):
        pass


@pytest.mark.parametrize("text", ["08:00-22:00", "12:30", "a b:C", "mine:", ":C", "09:00"])
def test_other_texts_are_no_code(text):
    assert {} == code_of({"at": text})
