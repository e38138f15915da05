"""Commands are found by their names, and are imported when they are called."""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint

import pytest
import typer
from tests.scenes import process

from fleet2d import __version__
from fleet2d.cli import __main__ as commands
from fleet2d.cli.__main__ import GROUPS, app

OTHERS = """
import sys
from fleet2d.cli import main
sys.argv = ["fleet2d", "verify", "--help"]
try:
    main()
finally:
    print(*(name for name in sys.modules if name.startswith("fleet2d.cli.") and "__" not in name))
"""


def all_commands() -> Iterator[tuple[str, ...]]:
    """Yield the words that call each command of Fleet2D, those within a command, too."""
    group = typer.main.get_command(app)
    context = typer.Context(group)
    for name in (name for names in GROUPS.values() for name in names):
        command = group.get_command(context, name)
        yield (name,)
        for own in getattr(command, "commands", ()):
            yield name, own


def described(help_text):
    """Return the lines of each section of a help text."""
    sections = {}
    for part in help_text.split("\n\n"):
        heading, *lines = part.strip("\n").splitlines()
        sections[heading.strip().rstrip(":")] = [line.strip() for line in lines]
    return sections


def test_help_lists_the_commands_in_groups_the_most_used_first(fleet2d):
    _, out, _ = fleet2d("--help")

    sections = described(out)
    for heading, names in GROUPS.items():
        assert list(names) == [line.split()[0] for line in sections[heading]]
    assert 3 == len(sections["Examples"])
    assert 18 == sum(map(len, GROUPS.values()))


@pytest.mark.parametrize("words", [(), ("study",), ("fit",), ("dataset",)])
def test_no_description_of_a_command_is_cut_or_wrapped(words, fleet2d, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    _, out, _ = fleet2d(*words, "--help")

    sections = described(out)
    for heading in GROUPS if not words else ("Commands",):
        for line in sections[heading]:
            name, description = line.split(maxsplit=1)
            assert description[0].isupper()
            assert description.endswith("."), name
            assert len(description) <= 58, name


def test_descriptions_are_wrapped_in_a_narrow_terminal(fleet2d, monkeypatch):
    monkeypatch.setenv("COLUMNS", "50")
    _, out, _ = fleet2d("--help")

    commands = out.partition("Run:")[2].partition("Examples:")[0]
    assert max(map(len, commands.splitlines())) <= 50
    assert "..." not in commands
    assert "Simulate a scenario and store the run." in " ".join(commands.split())


@pytest.mark.parametrize("words", list(all_commands()), ids=" ".join)
def test_help_of_each_command_ends_in_examples_that_are_valid(words, fleet2d):
    code, out, err = fleet2d(*words, "--help")

    assert (0, "") == (code, err)
    assert f"fleet2d {' '.join(words)} " in out
    assert [] == re.findall(r"<list\[.*|\[\[.*|\{[a-z]+\}", out)  # types of Python
    assert "<" not in " ".join(described(out).get("Arguments", ()))
    examples = out.rpartition("Examples:\n")[2].splitlines()
    assert 1 <= len(examples) <= 3
    for example in examples:
        program, *arguments = shlex.split(example)
        assert "fleet2d" == program
        assert tuple(arguments[: len(words)]) == words
        parse(arguments)


def parse(arguments):
    """Parse the arguments of a command, and of one within it, without calling it."""
    command = typer.main.get_command(app)
    context = typer.Context(command)
    while hasattr(command, "get_command"):
        name = arguments[0]
        command = command.get_command(context, name)
        context = command.make_context(name, arguments[1:], parent=context)
        arguments = arguments[1:]


def test_command_of_an_installed_package_is_listed_below_the_own(fleet2d, monkeypatch):
    entry = EntryPoint("dust", "tests.own_components:dust", "fleet2d.command")
    monkeypatch.setattr(commands, "entries", lambda: iter([entry]))
    monkeypatch.setattr(EntryPoint, "load", lambda self: dust)

    _, out, _ = fleet2d("--help")

    assert ["dust        Sweep."] == described(out)["Installed"]


def dust():
    """Sweep."""


def test_python_runs_the_command_line():
    done = process("-m", "fleet2d", "--version")

    assert (0, f"fleet2d {__version__}\n") == (done.returncode, done.stdout)


@pytest.mark.parametrize(("typed", "meant"), [("exprt", "export"), ("stdy", "study")])
def test_nearest_command_is_named(typed, meant, fleet2d):
    code, _, err = fleet2d(typed)

    assert 2 == code
    assert f"No such command '{typed}': did you mean '{meant}'?" in err


def test_command_that_is_like_no_other_is_refused(fleet2d):
    code, _, err = fleet2d("frobnicate")

    assert 2 == code
    assert "No such command 'frobnicate'.\n" in err


def test_command_imports_no_other():
    done = subprocess.run(
        [sys.executable, "-c", OTHERS], capture_output=True, text=True, check=True
    )

    assert "fleet2d.cli.results fleet2d.cli.run" == done.stdout.splitlines()[-1]


def test_no_number_of_the_table_is_cut_in_a_narrow_terminal(fleet2d, monkeypatch):
    words = ("bundled:family", "simulation.duration=3 h", "simulation.start=2026-01-05T17:00")
    tables = []
    for columns in ("20", "200"):
        monkeypatch.setenv("COLUMNS", columns)
        _, out, _ = fleet2d("run", *words, "--seed", "1", "--out", columns)
        lines = [line.split() for line in out.splitlines()]
        tables.append([line for line in lines if line[:1] != ["stored"] and " x " not in str(line)])
    narrow, wide = ([line for line in table if "real" not in line] for table in tables)
    assert narrow == wide


def test_no_unit_of_the_table_is_cut_in_a_narrow_terminal(fleet2d, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    _, out, _ = fleet2d("run", "bundled:paper", "simulation.duration=1 d", "--out", "run")

    assert "share of time at home" in " ".join(out.split())


@pytest.mark.parametrize(
    ("typed", "meant"), [("runs/frist", "runs/first"), ("hom.yaml", "home.yaml")]
)
def test_what_cannot_be_viewed_names_what_is_nearest(typed, meant, tmp_path, fleet2d):
    (tmp_path / "runs" / "first").mkdir(parents=True)
    (tmp_path / "home.yaml").touch()

    code, _, err = fleet2d("view", typed, "--no-browser")

    assert 2 == code
    assert f"there is no run directory and no scenario {typed}: did you mean {meant!r}?" in err
