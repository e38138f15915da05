"""The files that a user's module imports, found in its text."""

import json
import socket
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import yaml
from tests.studies.scenes import base

import fleet2d as package
from fleet2d import cli
from fleet2d.configuration.trust import Trust, check_code, code_of, restrict, with_imports
from fleet2d.errors import ComponentError, ScenarioError
from fleet2d.studies.reader import open_study


def names(folder: Path, *files: str) -> list[str]:
    paths = with_imports([folder / name for name in files], folder)
    return [path.relative_to(folder).as_posix() for path in paths]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with `a.py`, `b.py` and the package `p` of `p.c` and `p.q.d`."""
    for name in ("a", "b", "p/__init__", "p/c", "p/q/__init__", "p/q/d"):
        path = tmp_path / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return tmp_path


@pytest.mark.parametrize(
    ("text", "imported"),
    [
        ("import numpy, os.path, b", ["b.py"]),
        ("from b import speed as s", ["b.py"]),
        ("def late():\n    if True:\n        import b", ["b.py"]),
        ("import p.c", ["p/__init__.py", "p/c.py"]),
        ("from p import c", ["p/__init__.py", "p/c.py"]),
        ("from .p.q import d", ["p/__init__.py", "p/q/__init__.py", "p/q/d.py"]),
        ("from . import b", ["b.py"]),
        ("from p import *", ["p/__init__.py"]),
        ("import a", []),
        ("from ................................. import x", []),
        ("import b as", []),  # it can't be imported
        ("x = '\\d'", []),  # without a warning
        ("(" * 10_000, []),
        ("\0", []),
    ],
)
def test_each_file_beside_a_module_is_found(folder: Path, text: str, imported: list[str]) -> None:
    (folder / "a.py").write_text(text)
    assert ["a.py", *imported] == names(folder, "a.py")


def test_files_that_import_each_other_are_found_once(folder: Path) -> None:
    (folder / "a.py").write_text("import b")
    (folder / "b.py").write_text("import a, p.q.d")
    (folder / "p/q/d.py").write_text("from .. import c")
    every = {"a.py", "b.py", "p/__init__.py", "p/c.py", "p/q/__init__.py", "p/q/d.py"}
    found = names(folder, "a.py", "b.py")
    assert (every, len(every)) == (set(found), len(found))


Result = tuple[int, str, str]
Cli = Callable[..., Result]

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
def fleet2d(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Cli:
    """The command line in a folder with a scenario, a study and a search with code of their own."""
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(CODE)
    home = base(algorithms={"count": {"type": "mine:Count", "period": "1 min"}})
    home["users"]["ana"]["type"] = "mine:Walk"
    Path("home.yaml").write_text(yaml.safe_dump(home))
    study = {"base": "home.yaml", "axes": {"robots.astro.speed": [0.3]}, "replicates": 1}
    Path("study.yaml").write_text(yaml.safe_dump(study))
    search = {
        "trials": 1,
        "objectives": {"distance.ana": "maximize"},
        "search": {"speed": {"key": "users.ana.speed", "low": 0.5, "high": 1.0}},
        "held_out": {"robots.astro.speed": [0.3]},
    }
    tuned = {**study, "axes": {"robots.astro.speed": [0.3, 0.6]}, "tune": search}
    Path("search.yaml").write_text(yaml.safe_dump(tuned))

    def call(*arguments: str) -> Result:
        monkeypatch.setattr(sys, "argv", ["fleet2d", *arguments])
        with pytest.raises(SystemExit) as caught:
            cli.main()
        out, err = capsys.readouterr()
        return int(caught.value.code or 0), out, err

    return call


def stored_elsewhere(folder: Path) -> Path:
    """A run of the scenario whose code this process hasn't loaded, as another machine sends it."""
    other = folder / "other"
    other.mkdir()
    (other / "mine.py").write_text(CODE)
    run = folder / "run"
    package.run("home.yaml", seed=4, out=run)
    path = run / "manifest.json"
    text = path.read_text().replace(f"{folder}/mine:", f"{other}/mine:")
    path.write_text(text)
    (folder / "ran").unlink()
    return other / "mine.py"


SERIAL = ("--executor", "serial")


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (("study", "run", "study.yaml", *SERIAL), "study.yaml has components of its own"),
        (("study", "run", "study.yaml", "--dry-run"), "study.yaml has components of its own"),
        (("tune", "search.yaml", *SERIAL), "search.yaml has components of its own"),
        (("view", "home.yaml", "--no-browser"), "the scenario has components of its own"),
    ],
)
def test_code_of_a_scenario_is_listed_and_not_run(
    fleet2d: Cli, tmp_path: Path, command: tuple[str, ...], words: str
) -> None:
    code, _, err = fleet2d(*command)
    assert (2, False) == (code, Path("ran").exists())
    assert words in err
    assert f"{tmp_path}/mine.py (" in err
    assert "algorithms.count.type" in err
    assert "users.ana.type" in err
    assert f"--trust {tmp_path}/mine.py" in err


def test_a_study_whose_code_is_named_runs(fleet2d: Cli) -> None:
    code, out, err = fleet2d("study", "run", "study.yaml", *SERIAL, "--trust", "mine.py")
    assert (0, "1 of 1 variants complete in studies/study\n", "") == (code, out, err)
    assert Path("ran").exists()


@pytest.mark.slow
def test_a_study_of_a_bundled_scenario_has_no_code(fleet2d: Cli) -> None:
    """Its name has the form of a component's, `bundled.py` and the class `base`."""
    study = {"base": "bundled:base", "axes": {"robots.astro.speed": [0.3]}, "replicates": 1}
    Path("study.yaml").write_text(yaml.safe_dump(study))
    assert 0 == fleet2d("study", "run", "study.yaml", "--dry-run")[0]
    Path("bundled.py").touch()
    assert "bundled.py" in fleet2d("study", "run", "study.yaml", "--dry-run")[2]


def test_workers_trust_what_the_command_line_trusts(fleet2d: Cli) -> None:
    command = ("study", "run", "study.yaml", "--workers", "1", "--trust-dir", ".")
    assert (0, "1 of 1 variants complete in studies/study\n", "") == fleet2d(*command)


def test_a_variant_of_a_stored_study_asks_for_trust(fleet2d: Cli, tmp_path: Path) -> None:
    assert 0 == fleet2d("study", "run", "study.yaml", *SERIAL, "--trust", "mine.py")[0]
    other = tmp_path / "other"
    other.mkdir()
    (other / "mine.py").write_text(CODE)
    study = open_study("studies/study")
    scenario = json.loads(
        json.dumps(study.scenario(0)).replace(f"{tmp_path}/mine:", f"{other}/mine:")
    )
    Path("ran").unlink()
    with pytest.raises(ScenarioError, match="which would run"), restrict(Trust()):
        package.run(scenario)
    assert not Path("ran").exists()
    assert 0 == fleet2d("study", "rerun", "studies/study", "0")[0]  # loaded already: its own code


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "made"),
    [
        (("show", "run"), "run/picture.png"),
        (("report", "run"), "run/report.html"),
        (("export", "run", "--html", "page.html"), "page.html"),
        (("film", "run", "--out", "a.gif", "--height", "120", "--to", "step 60"), "a.gif"),
    ],
)
def test_a_stored_run_is_shown_without_code_unless_a_body_needs_it(
    fleet2d: Cli, tmp_path: Path, command: tuple[str, ...], made: str
) -> None:
    theirs = stored_elsewhere(tmp_path)
    code, _, err = fleet2d(*command)
    assert not Path("ran").exists()
    if code:
        assert 2 == code
        assert f"{theirs} (users.ana" in err
        assert "algorithms" not in err
        code, _, err = fleet2d(*command, "--trust", str(theirs))
    assert 0 == code, err
    assert Path(made).exists()


def test_a_path_of_a_stored_run_asks_for_trust_in_python_too(fleet2d: Cli, tmp_path: Path) -> None:
    theirs = stored_elsewhere(tmp_path)
    run = package.open_run("run")
    with pytest.raises(ScenarioError, match="which would run"):
        run.path("ana")
    assert not Path("ran").exists()
    with restrict(Trust.of([theirs])):
        assert 0 < len(run.path("ana").x)


def test_a_scenario_whose_code_is_named_is_watched(fleet2d: Cli) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = str(taken.getsockname()[1])
        view = ("view", "home.yaml", "--no-browser", "--port", port, "--trust", "mine.py")
        _, _, err = fleet2d(*view)
    assert f"port {port} can't be used" in err  # all but that is well
    assert Path("ran").exists()


INTERRUPT = """
from pathlib import Path
import numpy as np
import fleet2d

Path("ran").touch()

class Never(fleet2d.Interrupt):
    def holds(self, span):
        return np.zeros(span.poses.x.shape[1], bool)
"""


def half_a_run(name: str) -> package.Simulation:
    """A driven robot whose plan waits for an interrupt; the file in which it is isn't loaded."""
    Path("theirs.py").write_text(INTERRUPT)
    simulation = package.Simulation("simulation.duration=20 min", seed=4, out="half")
    simulation.drive("astro")
    simulation.decide("astro", simulation.plan("astro").stay().interrupt_on("home_empty"))
    simulation.advance(200)
    waits = simulation._state.interruptions._held
    waits[next(iter(waits))[0], name] = False
    return simulation


@pytest.mark.parametrize(("command", "status"), [("resume", "interrupted"), ("reproduce", "complete")])  # fmt: skip
def test_an_interrupt_that_only_a_plan_from_outside_names_is_listed(
    fleet2d: Cli, tmp_path: Path, command: str, status: str
) -> None:
    """A run directory from elsewhere named its code there, and `resume` ran it without a word."""
    half_a_run("home_empty").finish()
    path = Path("half/manifest.json")
    manifest = json.loads(path.read_text())
    manifest["interventions"][1]["plan"]["interrupts"] = [f"{tmp_path}/theirs:Never"]
    path.write_text(json.dumps({**manifest, "status": status}))
    code, _, err = fleet2d(command, "half")
    assert (2, False) == (code, Path("ran").exists())
    assert f"{tmp_path}/theirs.py (interventions.1.plan.interrupts.0)" in err


def test_an_interrupt_that_only_a_checkpoint_names_asks_for_trust(
    fleet2d: Cli, tmp_path: Path
) -> None:
    """Its code is imported when the run goes on, after the run was set up and looked harmless."""
    half_a_run(f"{tmp_path}/theirs:Never").finish()
    code, _, err = fleet2d("resume", "half")
    assert (1, False) == (code, Path("ran").exists())
    assert f"would run {tmp_path}/theirs.py: name it by --trust if you trust it" in err


def test_a_simulation_takes_its_trust_into_threads(fleet2d: Cli, tmp_path: Path) -> None:
    """`view` simulates in a thread, which has no command line that it could ask."""
    with restrict(Trust()):
        simulation = half_a_run(f"{tmp_path}/theirs:Never")
    with ThreadPoolExecutor() as threads, pytest.raises(ComponentError, match="would run"):
        threads.submit(simulation.advance, 200).result()
    assert not Path("ran").exists()


def test_a_file_that_a_component_imports_is_listed_and_must_be_named(
    fleet2d: Cli, tmp_path: Path
) -> None:
    """`--trust mine.py` ran what lay beside it, which nobody was asked to read."""
    Path("theirs.py").write_text(INTERRUPT)
    Path("mine.py").write_text(f"{CODE}\nimport theirs\n".replace('Path("ran").touch()', ""))
    run = ("study", "run", "study.yaml", *SERIAL, "--trust", "mine.py")
    code, _, err = fleet2d(*run)
    assert (2, False) == (code, Path("ran").exists())
    assert f"--trust {tmp_path}/theirs.py" in err
    assert f"--trust {tmp_path}/mine.py" not in err
    assert 0 == fleet2d(*run, "--trust", "theirs.py")[0]
    assert Path("ran").exists()


@pytest.mark.parametrize("name", ["mine:Über", "a/b/mine.py:C", "mine:A.B", "../x:Y", "ü.ö:ä"])
def test_no_name_of_code_hides_from_the_list(name: str) -> None:
    assert [["a.0.type"]] == list(code_of({"a": [{"type": name}]}).values())
    with restrict(Trust()), pytest.raises(ScenarioError, match=r"a\.0\.type"):
        check_code("it", {"a": [{"type": name}]})


@pytest.mark.parametrize("text", ["08:00-22:00", "12:30", "a b:C", "mine:", ":C", "09:00"])
def test_other_texts_are_no_code(text: str) -> None:
    assert {} == code_of({"at": text})
