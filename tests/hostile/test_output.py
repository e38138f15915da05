"""Closed and full outputs: no run depends on a terminal, and none ends in a traceback.

`2>&-` ended a command before its first step with the status `running` and no word; a summary on a
full disk or in ASCII ended in a traceback after the run was stored.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from tests.scenes import scenario
from tests.thorough import some

import fleet2d
from fleet2d.runs.run import open_run

RUN = ("run", "--out", "out", "simulation.duration=10 min", "--seed", "4")
pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")


def shell(folder, redirect, *arguments, **environment):
    """Run a command with its streams redirected by a shell."""
    script = f'exec "{sys.executable}" -m fleet2d.cli "$@" {redirect}'
    return subprocess.run(
        ["sh", "-c", script, "sh", *arguments],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("redirect", "options", "code", "message"),
    some(
        [
            ("2>&-", (), 0, ""),
            ("2>/dev/full", (), 0, ""),
            ("<&- 2>&-", ("--json",), 0, ""),
            ("2>&-", ("--quiet",), 0, ""),
            (">/dev/full", ("--json",), 1, "error: the results can't be printed (No space left"),
            (">/dev/full", (), 1, "error: the results can't be printed (No space left on device)"),
            (">&-", ("--quiet",), 0, ""),
            (">&-", (), 1, "error: the results can't be printed (Bad file descriptor)"),
            ("<&- >&- 2>&-", (), 1, ""),
            (">/dev/full 2>&1", ("--json",), 1, ""),
        ],
        4,
    ),
)
def test_a_run_needs_no_output(tmp_path, redirect, options, code, message):
    result = shell(tmp_path, redirect, *RUN, *options)
    assert code == result.returncode
    assert result.stderr.startswith(message)
    assert result.stderr.count("\n") == bool(message)
    assert not message or f"the run is stored in {Path('out')}" in result.stderr
    run = open_run(tmp_path / "out")
    assert "complete" == run.status
    assert [] == run.verify()


@pytest.mark.slow
@pytest.mark.parametrize("encoding", some(["ascii", "utf-8"], 2))
def test_a_summary_in_any_encoding(tmp_path, encoding):
    result = shell(tmp_path, "", *RUN, PYTHONIOENCODING=encoding)
    assert (0, "") == (result.returncode, result.stderr)
    assert "stored in out" in result.stdout


@pytest.mark.slow
@pytest.mark.parametrize("redirect", some([">/dev/full", ">&-"], 2))
@pytest.mark.parametrize(
    "arguments",
    some(
        [
            ("verify", "run"),
            ("--help",),
            ("--version",),
            ("components",),
            ("components", "--schema", "scenario"),
            ("show", "run", "--out", "picture.png"),
            ("validate", "bundled:paper"),
            ("verify", "run", "--again"),
        ],
        6,
    ),
)
def test_every_command_says_that_its_output_cannot_be_written(tmp_path, arguments, redirect):
    fleet2d.run(scenario("1 min"), out=tmp_path / "run")
    result = shell(tmp_path, redirect, *arguments)
    assert 1 == result.returncode
    assert result.stderr.startswith("error: the output can't be written (")
    assert 1 == result.stderr.count("\n")


@pytest.mark.slow
def test_a_reader_that_has_seen_enough_is_no_error(tmp_path):
    result = shell(tmp_path, "| head -c 1", "components")
    assert "" == result.stderr


CLOSED = """
import os, signal, sys
sys.path.insert(0, sys.argv[1])
import fleet2d
simulation = fleet2d.Simulation("simulation.duration.days=400", out="out", seed=4)

def stop(current):
    if current.step > 40_000:
        os.kill(os.getpid(), signal.SIGINT)

try:
    simulation.run(stop)
except KeyboardInterrupt:
    pass
"""


@pytest.mark.slow
def test_no_message_is_written_into_a_file_of_the_run(tmp_path):
    """In a program without stderr, the journal may have the number 2, and got the message of Ctrl-C."""
    source = Path(fleet2d.__file__).parents[1]
    script = f'exec "{sys.executable}" -c "$1" {source} <&- >&- 2>&-'
    subprocess.run(["sh", "-c", script, "sh", CLOSED], cwd=tmp_path, check=False, timeout=120)
    run = open_run(tmp_path / "out")
    assert "interrupted" == run.status
    assert [] == run.verify()
    journal = (tmp_path / "out" / "unfinished" / "journal").read_bytes()
    assert b"storing what was simulated" not in journal
