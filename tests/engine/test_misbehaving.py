"""Code of a user that ends, interrupts, prints, waits or writes where it shouldn't."""

import json
import time
from datetime import timedelta
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from tests.scenes import fleet2d_process, process, scenario
from tests.thorough import some

import fleet2d
from fleet2d import Algorithm, Behavior, Metric
from fleet2d.cli.run import watched
from fleet2d.configuration.importing import import_class
from fleet2d.errors import ComponentError, ScenarioError, blame
from fleet2d.runs.run import open_run


class Text(Exception):
    """An error whose message fails."""

    def __str__(self):
        raise RuntimeError


class Exits(Exception):
    """An error whose message ends the program."""

    def __str__(self):
        raise SystemExit(0)


class Ends(Algorithm):
    """Does what its key says in the second hour."""

    how: str = "exit"

    def update(self, history, state):
        if state.step < 7000:
            return {"n": 1.0}
        raise {
            "exit": SystemExit(0),
            "exit with words": SystemExit("bye"),
            "interrupt": KeyboardInterrupt(),
            "text": Text(),
            "exit in the text": Exits(),
            "recursion": RecursionError(),
            "memory": MemoryError("too much"),
            "generator": GeneratorExit(),
            "lines": ValueError("\n".join(map(str, range(10_000)))),
        }[self.how]


def small(**sections):
    people = {"users": {"ana": {"type": "meander"}}}
    robots = {"robots": {"astro": {"type": "patrol", "camera": {"range": [0, 4]}}}}
    return scenario("3 h", **{**people, **robots, **sections})


def name(cls):
    return f"{__name__}:{cls.__name__}"


@pytest.mark.parametrize(
    ("how", "what"),
    [
        ("exit", "SystemExit: 0"),
        ("exit with words", "SystemExit: bye"),
        ("interrupt", "KeyboardInterrupt"),
        ("text", "Text: (its message can't be written: RuntimeError)"),
        ("exit in the text", "Exits: (its message can't be written: SystemExit)"),
        ("recursion", "RecursionError"),
        ("memory", "MemoryError: too much"),
        ("generator", "GeneratorExit"),
        ("lines", "ValueError: 0\n1\n"),
    ],
)
def test_code_that_ends_the_run_is_named_and_the_run_kept(tmp_path, how, what):
    algorithms = {"ends": {"type": name(Ends), "how": how}}
    with pytest.raises(ComponentError) as caught:
        fleet2d.run(small(algorithms=algorithms), seed=4, out=tmp_path / "run")
    assert str(caught.value).startswith("algorithms.ends failed at step 7199: " + what)
    assert len(str(caught.value).splitlines()) <= 201
    stored = open_run(tmp_path / "run")
    assert "failed" == stored.status
    assert 1 == stored.arrow("ends").num_rows
    assert blame.now is None
    assert blame.interrupts


MODULE = """
import os, sys, threading, time
import fleet2d

print("imported")

class Prints(fleet2d.Algorithm):
    how: str = ""
    def start(self, home):
        print("started")
    def update(self, history, state):
        print("updated")
        if self.how == "exit" and state.step > 3600:
            sys.exit(0)
        if self.how == "gone" and state.step > 90_000:
            os._exit(0)
        if self.how == "gone in a thread" and state.step > 90_000:
            threading.Thread(target=lambda: os._exit(0)).start()
            time.sleep(60)
        if self.how == "gone as a thread" and state.step > 90_000:
            threading.Thread(target=os._exit, args=(0,)).start()
            time.sleep(60)
        if self.how == "forks" and not os.fork():
            os._exit(0)
        return {"n": 1.0}
"""


@pytest.mark.slow
def test_what_components_print_goes_to_stderr_with_json(tmp_path):
    (tmp_path / "mine.py").write_text(MODULE)
    override = "algorithms.own.type=mine:Prints"
    done = fleet2d_process("run", "simulation.duration=2 h", override, "--json", cwd=tmp_path)
    assert 0 == done.returncode, done.stderr
    assert 7200 == json.loads(done.stdout)["steps"]
    assert ["imported", "started", "updated", "updated"] == done.stderr.splitlines()


def run_prints(folder, how, duration="3 h"):
    (folder / "mine.py").write_text(MODULE)
    override = f"algorithms.own={{type: mine:Prints, how: {how}}}"
    arguments = ("run", f"simulation.duration={duration}", override, "--out", "a")
    return fleet2d_process(*arguments, cwd=folder)


@pytest.mark.slow
def test_an_exit_in_an_update_is_exit_code_1(tmp_path):
    done = run_prints(tmp_path, "exit")
    assert 1 == done.returncode
    assert "algorithms.own failed at step 7199: SystemExit: 0 (mine.py:" in done.stderr
    assert "failed" == open_run(tmp_path / "a").status


@pytest.mark.slow
@pytest.mark.parametrize("how", some(["gone", "gone in a thread", "gone as a thread"], 3))
def test_a_component_that_ends_the_process_leaves_the_run(tmp_path, how):
    """What was committed can be read, and the run can be resumed."""
    done = run_prints(tmp_path, how, "2 d")
    assert 0 == done.returncode  # what the component says: nobody is left to say more

    stored = open_run(tmp_path / "a")
    assert "running" == stored.status
    assert 86_400 == stored.manifest["steps"]
    assert any("fleet2d resume" in note for note in stored.notes)
    resumed = fleet2d_process("resume", "a", "--trust", cwd=tmp_path)
    assert "starting again from the first step: there is no checkpoint yet" in resumed.stderr


@pytest.mark.slow
def test_a_child_process_of_a_component_may_end(tmp_path):
    assert 0 == run_prints(tmp_path, "forks").returncode


@pytest.mark.parametrize("code", ["import sys; sys.exit(0)", "raise SystemExit", "exit(3)"])
def test_an_exit_at_import_is_an_error(tmp_path, code, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(f"class C: pass\n{code}\n")
    with pytest.raises(ScenarioError, match=r"can't import 'mine:C': mine\.py:2: SystemExit"):
        import_class("mine:C")


ODD = """
import os, sys
import fleet2d
from pydantic import model_validator

class Odd(fleet2d.Algorithm):
    how: str = ""

    @model_validator(mode="after")
    def _is_fine(self):
        self.do("check")
        return self

    def do(self, when):
        if self.how == when:
            sys.exit(0)
        if self.how == f"{when}: interrupt":
            raise KeyboardInterrupt

    def files(self):
        self.do("files")
        return []

    def start(self, home):
        self.do("start")

    def update(self, history, state):
        if self.how == "chdir":
            os.chdir("/")
        return {"n": 1.0}

    def remember(self):
        if self.how == "remember":
            raise fleet2d.errors.ScenarioError("mine")
        return {}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "words"),
    some(
        [
            ("check", "mine:Odd failed while its keys were checked: SystemExit: 0"),
            ("files", "mine:Odd failed when it was started: SystemExit: 0"),
            ("start", "algorithms.odd failed when it was started: SystemExit: 0"),
            ("start: interrupt", "algorithms.odd failed when it was started: KeyboardInterrupt"),
            ("check: interrupt", "mine:Odd failed while its keys were checked: KeyboardInterrupt"),
        ],
        3,
    ),
)
def test_code_that_ends_the_program_before_the_run_is_named(tmp_path, how, words):
    """Some ended it with code 0 or 130, without a word."""
    (tmp_path / "mine.py").write_text(ODD)
    override = f"algorithms.odd={{type: mine:Odd, how: '{how}'}}"
    done = fleet2d_process("run", "simulation.duration=1 h", override, cwd=tmp_path)
    assert done.returncode in (1, 2)
    assert words in done.stderr


STOPS = """
import os, signal
import fleet2d

class Stops(fleet2d.Algorithm):
    def start(self, home):
        os.kill(os.getpid(), getattr(signal, os.environ["STOP"]))

    def update(self, history, state):
        pass
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "command"),
    some(
        [
            ("SIGINT", ("run", "algorithms.own.type=mine:Stops")),
            ("SIGINT", ("study", "run", "study.yaml", "--executor", "serial")),
            ("SIGTERM", ("study", "run", "study.yaml", "--executor", "serial")),
        ],
        3,
    ),
)
def test_a_signal_during_the_code_of_a_component_is_not_its_error(
    tmp_path, monkeypatch, number, command
):
    monkeypatch.setenv("STOP", number)
    (tmp_path / "mine.py").write_text(STOPS)
    algorithms = {"own": {"type": "mine:Stops"}}
    base = {"extends": "bundled:paper", "algorithms": algorithms}
    study = {"base": base, "axes": {"robots.astro.speed": [0.3]}, "replicates": 1}
    (tmp_path / "study.yaml").write_text(json.dumps(study))
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
        f" import sys; sys.argv = ['fleet2d', *{command!r}]; from fleet2d.cli import main; main()"
    )
    assert 130 == process("-c", code, cwd=tmp_path).returncode


@pytest.mark.parametrize(
    "code", some(["raise KeyboardInterrupt", "class B(BaseException): pass\nraise B"], 2)
)
def test_no_exception_at_import_ends_the_program(tmp_path, code):
    (tmp_path / "mine.py").write_text(code)
    done = fleet2d_process("run", "metrics.odd.type=mine:Odd", cwd=tmp_path)
    assert 2 == done.returncode
    assert "can't import 'mine:Odd': mine.py:" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("is_at_import", some([True, False], 2))
def test_a_run_is_stored_where_it_was_begun(tmp_path, is_at_import):
    """A component that changes the current folder had its run stored, and then not found."""
    (tmp_path / "mine.py").write_text(f"{ODD}\nos.chdir('/')" if is_at_import else ODD)
    override = "algorithms.odd={type: mine:Odd, how: chdir, period: 10 min}"
    keep = "artifacts.learned=true"
    done = fleet2d_process(
        "run", "simulation.duration=1 h", override, keep, "--out", "a", cwd=tmp_path
    )
    assert 0 == done.returncode, done.stderr
    assert "complete" == open_run(tmp_path / "a").status
    assert (tmp_path / "a/learned/ltp.npz").is_file()


def test_an_error_of_remember_is_noted(tmp_path):
    (tmp_path / "mine.py").write_text(ODD)
    odd = {"type": f"{tmp_path.as_posix()}/mine:Odd", "how": "remember"}
    content = small(algorithms={"odd": odd}, artifacts={"learned": True})
    run = fleet2d.run(content, "simulation.duration=1 h", seed=4, out=tmp_path / "run")
    assert "complete" == run.status
    assert "what algorithms.odd has learned is not stored: mine" == run.notes[-1]


class WithoutPeriod(Algorithm):
    """Declares a key of its base class anew."""

    period: int | None = None  # type: ignore[assignment]

    def update(self, history, state):
        """Do nothing."""


def test_an_impossible_period_of_a_class_is_named():
    with pytest.raises(ComponentError, match=r"algorithms\.odd failed when it was started: TypeE"):
        fleet2d.run(small(algorithms={"odd": {"type": name(WithoutPeriod)}}), seed=4)


class Writes(Metric):
    """Looks for arrays of the history and the home that it may change."""

    needs = frozenset({"evidence", "exposure"})
    writable: ClassVar[list[str]] = []

    def update(self, history, state):
        earlier = history.between(history.first, history.end)
        poses = [history.poses("ana"), history.poses("astro"), earlier.poses("ana")]
        evidence = history.evidence
        logs = [history.observations, history.truth, history.looks, evidence, evidence.sightings]
        for given in (*poses, *logs, earlier.observations, history.readings, state.home.plan):
            for key in dir(given):
                value = None if key.startswith("_") else getattr(given, key)
                if isinstance(value, np.ndarray) and value.flags.writeable:
                    self.writable.append(f"{type(given).__name__}.{key}")
        if history.exposure.flags.writeable:
            self.writable.append("exposure")

    def finish(self):
        return {}


def test_arrays_of_the_history_are_read_only():
    metrics = {"writes": {"type": name(Writes), "period": "1 h"}}
    fleet2d.run(small(metrics=metrics), seed=4)
    assert [] == sorted(set(Writes.writable))


class Stays(Behavior):
    """Stays for far too long."""

    def decide(self, now):
        return now.plan().stay(timedelta.max)


def test_a_stay_of_millions_of_years_is_refused():
    with pytest.raises(ComponentError, match=r"users\.ana.*1000 years"):
        fleet2d.run(small(users={"ana": {"type": name(Stays)}}), seed=4)


@pytest.mark.slow
def test_a_component_that_keeps_the_run_waiting_is_named(capsys):
    with watched(0.05), blame("algorithms.slow", 7):
        time.sleep(1.0)
    said = capsys.readouterr().err.splitlines()
    assert 1 <= len(said) <= 5  # each time that it took twice as long
    assert said[0].startswith("algorithms.slow has been running for 0 s at step 7 (test_mis")
    with watched(0.05):
        time.sleep(0.2)
        for step in range(20):
            with blame("algorithms.quick", step):
                time.sleep(0.01)
    assert "" == capsys.readouterr().err
