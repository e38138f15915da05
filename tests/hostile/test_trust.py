"""Attacks by code in somebody else's folder: forged checkpoints, and more than what is listed.

Each planted file leaves the file `ran` if its code runs.
"""

import importlib
import json
import os
import pickle
import py_compile
import shutil
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest
from tests.scenes import cut_off, fleet2d_process

import fleet2d as package
from fleet2d import Simulation, _core
from fleet2d.algorithms.external import Process
from fleet2d.artifacts.unfinished import CHECKPOINT_NAME, FOLDER, JOURNAL_NAME
from fleet2d.configuration.importing import import_class
from fleet2d.configuration.trust import UntrustedCodeError, running_code, stored_code
from fleet2d.engine import checkpoint
from fleet2d.engine.repeat import reopen
from fleet2d.errors import ScenarioError
from fleet2d.interventions import Put
from fleet2d.runtime.program import ExternalProgram
from fleet2d.storage.secret_files import KEY_NAME, SECRET_BYTES, signature, state_folder

OWN = "import fleet2d\nclass Own(fleet2d.Algorithm):\n    def update(self, history, state):\n        return {'n': 1.0}\n"
SETTINGS = ("simulation.duration=2 h", "artifacts.checkpoint=30 min")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder from elsewhere, which is the current one, with `mine.py`."""
    (tmp_path / "mine.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def evil(folder):
    return f"from pathlib import Path\nPath({str(folder / 'ran')!r}).touch()\n{OWN}"


# Checkpoints


def cut_run(out, seed=4, **more):
    """Return an unfinished run with a checkpoint of its first hour."""
    simulation = Simulation("bundled:paper", *SETTINGS, seed=seed, out=out, **more)
    simulation.run_until(4000)
    return cut_off(simulation)


def undisturbed(directory):
    """Return the digest of the run that a manifest describes."""
    scenario = json.loads((directory / "manifest.json").read_text())["scenario"]
    return package.run(scenario, "artifacts.checkpoint=off").digest


def as_another_user(monkeypatch, folder):
    monkeypatch.setenv("XDG_STATE_HOME", str(folder / "another user"))


def forged(out, command):
    """Return a run of built-in components only, whose checkpoint starts a shell."""
    period = "algorithms.ltp.period=30 min"
    simulation = Simulation("bundled:paper", *SETTINGS, period, seed=4, out=out)
    simulation.run_until(4000)
    learners = simulation._state.learners.all
    learner = next(each for each in learners if each.path.startswith("algorithms."))
    shell = Process.model_construct(command=Path("/bin/sh"), period=learner.component.period)
    shell.__dict__["program"] = ExternalProgram(Path("/bin/sh"), ["-c", command], 10, {})
    shell.__dict__["_rooms"] = []
    learner.component = shell
    assert simulation._keeper is not None
    simulation._keeper.checkpoint(simulation._state)
    assert simulation._keeper.is_storable
    return cut_off(simulation)


def test_a_forged_checkpoint_runs_no_command(folder, monkeypatch, fleet2d):
    """All classes in it were allowed ones; `resume` without `--trust` ran the command."""
    with monkeypatch.context() as attacker:
        as_another_user(attacker, folder)
        run = forged(folder / "evil", f"touch {folder}/ran; exec sleep 1")

    code, out, err = fleet2d("resume", run, "--json")

    assert not (folder / "ran").exists()
    assert 0 == code, err
    assert "starting again from the first step: " in err
    assert f"{run}/{FOLDER}/{CHECKPOINT_NAME} is not signed by this user" in err
    assert undisturbed(run) == json.loads(out)["digest"]


@pytest.mark.slow
def test_the_forgery_would_run_its_command_with_the_key_of_the_user(folder):
    """So that the test above tests something."""
    run = forged(folder / "evil", f"touch {folder}/ran; exec sleep 1")
    simulation, _ = reopen(run)
    with pytest.raises(package.Fleet2DError, match="/bin/sh"):
        simulation.run()
    assert (folder / "ran").exists()


def test_a_pickle_in_place_of_a_checkpoint_is_not_read(folder, monkeypatch):
    class Calls:
        def __reduce__(self):
            return os.system, (f"touch {folder}/ran",)

    run = cut_run(folder / "run")
    path = run / FOLDER / CHECKPOINT_NAME
    magic, header, _ = path.read_bytes().split(b"\n", 2)
    content = b"\n".join((magic, header, pickle.dumps(Calls())))
    with monkeypatch.context() as attacker:
        as_another_user(attacker, folder)
        seal = signature(checkpoint.PURPOSE)
    seal.update(content)
    path.write_bytes(content + seal.hexdigest().encode())
    assert undisturbed(run) == package.resume(run).digest
    assert not (folder / "ran").exists()


def test_a_checkpoint_of_this_user_is_continued(folder):
    run = cut_run(folder / "run")
    moved = run.rename(folder / "moved")
    simulation, remark = reopen(moved)
    assert remark.startswith("continuing from 2026-01-05 01:0")
    assert 3600 <= simulation.step < 4000
    assert undisturbed(moved) == simulation.run().digest


def flip_bit(path, at):
    content = bytearray(path.read_bytes())
    content[at] ^= 1
    path.write_bytes(content)


def change_byte(run):
    path = run / FOLDER / CHECKPOINT_NAME
    flip_bit(path, path.stat().st_size // 2)


def change_seal(run):
    path = run / FOLDER / CHECKPOINT_NAME
    path.write_bytes(path.read_bytes()[:-64] + b"0" * 64)


def change_scenario(run):
    path = run / "manifest.json"
    manifest = json.loads(path.read_text())
    (name,) = manifest["entities"]["robots"][:1]
    manifest["scenario"]["robots"][name]["speed"] = 0.123
    path.write_text(json.dumps(manifest))


def change_seed(run):
    path = run / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["seed"] = manifest["scenario"]["simulation"]["seed"] = 5
    path.write_text(json.dumps(manifest))


def copy_of_another_seed(run):
    other = cut_run(run.with_name("other"), seed=9)
    shutil.copy(other / FOLDER / CHECKPOINT_NAME, run / FOLDER / CHECKPOINT_NAME)


def copy_of_another_course(run):
    """The same scenario and seed, but something was done to that run."""
    simulation = Simulation("bundled:paper", *SETTINGS, seed=4, out=run.with_name("other"))
    simulation.run_until(1000)
    simulation.do(Put("ana", "kitchen"))
    simulation.run_until(4000)
    other = cut_off(simulation)
    for name in (CHECKPOINT_NAME, JOURNAL_NAME):
        shutil.copy(other / FOLDER / name, run / FOLDER / name)


def copy_of_a_saved_simulation(run):
    simulation = Simulation("bundled:paper", *SETTINGS, seed=4)
    simulation.advance(100)
    simulation.save(run / FOLDER / CHECKPOINT_NAME)


def change_journal(run):
    flip_bit(run / FOLDER / JOURNAL_NAME, 200)


CHANGES = {
    change_byte: "is not signed by this user",
    change_seal: "is not signed by this user",
    change_scenario: "was written by another run",
    change_seed: "was written by another run",
    copy_of_another_seed: "was written by another run",
    copy_of_another_course: "was written by another run",
    copy_of_a_saved_simulation: "is not signed by this user",
    change_journal: "the journal has changed since the checkpoint",
    lambda run: (run / FOLDER / JOURNAL_NAME).unlink(): "the journal can't be read",
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_is_not_as_it_was_signed_is_simulated_again(folder, change):
    run = cut_run(folder / "run")
    change(run)
    simulation, remark = reopen(run)
    assert remark.startswith("starting again from the first step: ")
    assert CHANGES[change] in remark
    assert 0 == simulation.step
    assert undisturbed(run) == simulation.run().digest


@pytest.mark.parametrize("fault", ["readable by others", "another", "link", "short"])
def test_a_key_that_is_not_this_user_s_alone_is_not_used(folder, monkeypatch, fault):
    as_another_user(monkeypatch, folder)
    run, key = cut_run(folder / "run"), state_folder() / KEY_NAME
    if fault == "readable by others":
        key.chmod(0o644)
    elif fault == "another":
        key.write_bytes(b"x" * SECRET_BYTES)
    elif fault == "link":
        key.rename(key.with_name("other"))
        key.symlink_to("other")
    else:
        key.write_bytes(b"x")
    simulation, remark = reopen(run)
    words = {
        "readable by others": f"{key} may be read by others (mode 0644): delete it",
        "another": "is not signed by this user",
        "link": f"{key} is a link",
        "short": f"{key} has 1 bytes",
    }
    assert remark.startswith("starting again from the first step: ")
    assert words[fault] in remark
    assert undisturbed(run) == simulation.run().digest


@pytest.mark.parametrize("obstacle", ["a file", "a readable key"])
def test_without_a_key_no_checkpoint_is_written(folder, monkeypatch, obstacle, fleet2d):
    as_another_user(monkeypatch, folder)
    if obstacle == "a file":
        (folder / "another user").touch()
    else:
        signature("anything")
        (state_folder() / KEY_NAME).chmod(0o644)
    run = cut_run(folder / "run")
    assert not (run / FOLDER / CHECKPOINT_NAME).exists()
    simulation, remark = reopen(run)
    assert remark == "starting again from the first step: there is no checkpoint yet"
    done = simulation.run()
    notes = [note for note in done.notes if note.startswith("no checkpoint from step ")]
    assert 1 == len(notes)
    assert undisturbed(run) == done.digest
    code, out, _ = fleet2d("verify", run, "--again")
    assert (0, True) == (code, "reproduced: digest" in out)
    _, out, _ = fleet2d("run", "bundled:paper", *SETTINGS, "--seed", "4", "--out", "second")
    assert 1 == out.count(f"note: {notes[0]}")


# Code beside what is listed


def compiled(folder, target):
    """Write bytecode that leaves a file."""
    source = folder / "evil.txt"
    source.write_text(evil(folder))
    target.parent.mkdir(exist_ok=True, parents=True)
    py_compile.compile(str(source), str(target), doraise=True)
    source.unlink()


PLANTS = {
    "source": lambda folder: (folder / "theirs.py").write_text(evil(folder)),
    "package": lambda folder: (
        (folder / "theirs").mkdir(),
        (folder / "theirs" / "__init__.py").write_text(evil(folder)),
    ),
    "bytecode": lambda folder: compiled(folder, folder / "theirs.pyc"),
    "extension": lambda folder: shutil.copy(
        _core.__file__, folder / f"theirs{EXTENSION_SUFFIXES[0]}"
    ),
    "nothing": lambda _: None,
}


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("name", ["theirs:Own", "{folder}/theirs:Own", "{folder}/theirs.py:Own"])
def test_no_code_of_a_stored_run_is_imported_without_trust(folder, plant, name):
    PLANTS[plant](folder)
    name = name.format(folder=folder)
    with running_code(allowed=False), pytest.raises(ScenarioError, match="which is not trusted"):
        import_class(name)
    content = {"algorithms": {"own": {"type": name}}}
    with pytest.raises(UntrustedCodeError) as caught, stored_code("it", content, trust=False):
        pass
    assert f"{folder}/theirs" in str(caught.value)
    assert not (folder / "ran").exists()


def test_an_installed_module_that_is_not_loaded_asks_too(folder):
    (folder / "installed").mkdir()
    (folder / "installed" / "theirs.py").write_text(evil(folder))
    sys.path.append(str(folder / "installed"))
    importlib.invalidate_caches()
    try:
        with (
            running_code(allowed=False),
            pytest.raises(ScenarioError, match=r"installed/theirs\.py"),
        ):
            import_class("theirs:Own")
    finally:
        sys.path.remove(str(folder / "installed"))
    assert not (folder / "ran").exists()


def test_what_is_loaded_already_is_usable(folder):
    own = import_class(f"{folder}/mine:Own")
    content = {"algorithms": {"own": {"type": f"{folder}/mine:Own"}}}
    with stored_code("it", content, trust=False):
        assert own is import_class(f"{folder}/mine:Own")


def test_own_code_keeps_its_extension_modules_and_leaves_no_bytecode(folder):
    """What a user runs from an own scenario isn't restricted."""
    compiled(folder, folder / "helpers.pyc")
    (folder / "mine.py").write_text(f"import helpers\n{OWN}")

    assert import_class(f"{folder}/mine:Own")
    assert (folder / "ran").exists()
    assert not (folder / "__pycache__").exists()


PROGRAM = """
import json, sys
import beside
for line in sys.stdin.buffer:
    message = json.loads(line)
    [sys.stdin.buffer.read(size) for _, size in message.get("blocks", [])]
    answer = {"type": "ready"}
    if message["type"] == "start":
        share = [float(room["type"] == "kitchen") for room in message["rooms"]]
    elif message["type"] == "update":
        answer = {"type": "output", "share": share}
    print(json.dumps(answer), flush=True)
"""


@pytest.mark.slow
def test_a_program_of_a_stored_run_is_listed_with_its_arguments(folder):
    """`--trust belief.py` ran `beside.py`, too: trust means the whole folder, and says so."""
    (folder / "belief.py").write_text(PROGRAM)
    (folder / "beside.py").write_text(evil(folder))
    settings = "{type: process, command: belief.py, arguments: ['-c', 'a b'], period: 30 min}"
    done = fleet2d_process(
        "run", "simulation.duration=2 h", f"algorithms.p={settings}", "--out", "run", "--quiet",
        cwd=folder,
    )  # fmt: skip
    assert 0 == done.returncode, done.stderr
    (folder / "ran").unlink()
    line = f"  {folder}/belief.py -c 'a b' (algorithms.p.command)"

    done = fleet2d_process("verify", "run", "--again", cwd=folder)

    assert 2 == done.returncode
    assert line in done.stderr.splitlines()
    assert "so could any file in its folders" in done.stderr
    assert not (folder / "ran").exists()

    done = fleet2d_process("verify", "run", "--again", "--trust", cwd=folder)

    assert 0 == done.returncode, done.stderr
    assert ["trusted, with all files in these folders:", line] == done.stderr.splitlines()
    assert (folder / "ran").exists()
