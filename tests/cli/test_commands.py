"""Commands are found by their names, and are imported when they are called."""

import subprocess
import sys

import pytest
from tests.scenes import Cli

from fleet2d.cli.__main__ import COMMANDS

OTHERS = """
import sys
from fleet2d.cli import main
sys.argv = ["fleet2d", "verify", "--help"]
try:
    main()
finally:
    print(*(name for name in sys.modules if name.startswith("fleet2d.cli.") and "__" not in name))
"""


@pytest.mark.parametrize("command", COMMANDS)
def test_module_of_a_command_has_its_function(command: str, fleet2d: Cli) -> None:
    code, out, err = fleet2d(command, "--help")

    assert (0, "") == (code, err)
    assert f"fleet2d {command} [" in out
    assert len(out.splitlines()) > 5


def test_help_lists_all_commands_by_name(fleet2d: Cli) -> None:
    _, out, _ = fleet2d("--help")

    names = [line.split()[0] for line in out.split("Commands:")[1].splitlines() if line]
    assert names == sorted(names)
    assert {*COMMANDS, "study", "view"} <= set(names)


@pytest.mark.parametrize(("typed", "meant"), [("exprt", "export"), ("stdy", "study")])
def test_nearest_command_is_named(typed: str, meant: str, fleet2d: Cli) -> None:
    code, _, err = fleet2d(typed)

    assert 2 == code
    assert f"No such command '{typed}': did you mean '{meant}'?" in err


def test_command_that_is_like_no_other_is_refused(fleet2d: Cli) -> None:
    code, _, err = fleet2d("frobnicate")

    assert 2 == code
    assert "No such command 'frobnicate'.\n" in err


def test_command_imports_no_other() -> None:
    done = subprocess.run(
        [sys.executable, "-c", OTHERS], capture_output=True, text=True, check=True
    )

    assert "fleet2d.cli.run" == done.stdout.splitlines()[-1]
