"""The program `fleet2d`, also run as `python -m fleet2d`, and the search for its commands.

A command is a function of its name, or a Typer app of several commands, in a module of this package
that `COMMANDS` names. Installed packages add others by entry points of the group `fleet2d.command`,
and some of Fleet2D's own commands do so, too. All are imported when they are called, and should
import what they need then, too. A docstring is the help: its first line is the description in the
list of commands, and a section "Examples:" ends it.
"""

import sys
from collections.abc import Iterator
from difflib import get_close_matches
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup
from typer.main import get_group

from fleet2d import __version__, cli
from fleet2d.runtime.memory import rare_collections

GROUP = "fleet2d.command"
COMMANDS = {
    "components": "scenarios",
    "resume": "run",
    "run": "run",
    "validate": "scenarios",
    "verify": "run",
}
"""The module of each command of this package."""
GROUPS = {
    "Run": ("run", "demo", "resume", "live", "mcp"),
    "Look": ("view", "show", "export"),
    "Test": ("test", "falsify", "verify"),
    "Experiment": ("study", "transfer"),
    "Learn": ("fit", "dataset"),
    "Homes and files": ("validate", "convert", "components"),
}
"""The commands below each heading of the help, the most used first; others are `INSTALLED`."""
INSTALLED = "Installed"
EXAMPLES = "\n\nExamples:\n"


class Commands(TyperGroup):
    """The commands of Fleet2D and of installed packages, by name."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands that can be loaded, in the order of the help."""
        return [name for names in self._groups(ctx).values() for name in names]

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands in groups, with descriptions that are wrapped and never cut."""
        groups = self._groups(ctx)
        width = max(len(name) for names in groups.values() for name in names)
        for heading, commands in groups.items():
            rows = [
                (name.ljust(width), command.get_short_help_str(sys.maxsize))
                for name, command in commands.items()
            ]
            with formatter.section(heading):
                formatter.write_dl(rows)

    def _groups(self, ctx: Any) -> dict[str, dict[str, Any]]:
        """Return the commands that can be loaded, by heading and name."""
        grouped = {name for names in GROUPS.values() for name in names}
        installed = {*COMMANDS, *(entry.name for entry in entries())} - grouped
        groups = {}
        for heading, names in (*GROUPS.items(), (INSTALLED, sorted(installed))):
            commands = {name: self.get_command(ctx, name) for name in names}
            if loaded := {name: command for name, command in commands.items() if command}:
                groups[heading] = loaded
        return groups

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of a name, None if there is none."""
        module = COMMANDS.get(cmd_name)
        if module is not None:
            with rare_collections():
                function = getattr(import_module(f"{cli.__name__}.{module}"), cmd_name)
            return _command(cmd_name, function, ctx)
        entry = next((entry for entry in entries() if entry.name == cmd_name), None)
        return None if entry is None else _load(entry, ctx)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the name of the command that arguments call, the command, and its arguments.

        Raises:
            UsageError: There is no such command; the message names the nearest one.
        """
        if not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            near = get_close_matches(args[0], self.list_commands(ctx), n=1)
            hint = f": did you mean {near[0]!r}?" if near else "."
            ctx.fail(f"No such command {args[0]!r}{hint}")
        return super().resolve_command(ctx, args)


def entries(group: str = GROUP) -> Iterator[Any]:
    """Return the entry points of a group."""
    from importlib.metadata import entry_points  # slow to import, and rarely needed

    return iter(entry_points(group=group))


def _load(entry: Any, ctx: Any) -> Any:
    """Load a command; None if its package is missing or, with a message, if it fails."""
    try:
        value = entry.load()
    except Exception as error:  # noqa: BLE001 - a plugin may raise anything
        missing = error.name or "" if isinstance(error, ModuleNotFoundError) else ""
        if not missing or not f"{entry.module}.".startswith(f"{missing}."):
            typer.echo(f"the command {entry.name!r} ({entry.value}) fails: {error}", err=True)
        return None
    return _command(entry.name, value, ctx)


def _command(name: str, value: Any, ctx: Any) -> Any:
    """Return the command of a function, or the group of a Typer app."""
    app = typer.Typer(rich_markup_mode=None, callback=lambda: None)
    if isinstance(value, typer.Typer):
        app.add_typer(value, name=name)
    else:
        app.command(name)(value)
    command = get_group(app).get_command(ctx, name)
    _set_out(command)
    return command


def _set_out(command: Any) -> None:
    """End the help of a command and its subcommands in examples; show arguments by name alone."""
    for parameter in command.params:
        if parameter.param_type_name == "argument":
            parameter.display_type_rich = lambda **_: ""
    command.help, _, examples = (command.help or "").partition(EXAMPLES)
    if examples:
        # After a line of a backspace alone, lines aren't wrapped.
        command.epilog = f"\b\nExamples:\n{examples}"
    for own in getattr(command, "commands", {}).values():
        _set_out(own)


app = typer.Typer(
    cls=Commands,
    help="Simulate weeks in a home in seconds, and the same weeks from the same seed.",
    no_args_is_help=True,
    invoke_without_command=True,
    add_completion=False,
    epilog="\b\nExamples:\n"
    "  fleet2d demo\n"
    "  fleet2d run bundled:paper simulation.duration.days=60 --out sixty\n"
    "  fleet2d view sixty\n\n"
    "fleet2d COMMAND --help describes a command.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.callback()
def about(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Simulate weeks in a home in seconds, and the same weeks from the same seed."""
    if version:
        typer.echo(f"fleet2d {__version__}")
        raise typer.Exit


if __name__ == "__main__":  # a scenario may name it as the module of a component
    cli.main()
