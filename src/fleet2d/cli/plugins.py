"""Commands of installed packages: entry points of the group `fleet2d.command`.

Some of Fleet2D's own commands are declared the same way. Commands are loaded when they are called.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup
from typer.main import get_group

from fleet2d.errors import InputError

GROUP = "fleet2d.command"


class Commands(TyperGroup):
    """The commands of Fleet2D, followed by those of installed packages."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands that can be loaded."""
        built_in = super().list_commands(ctx)
        plugins = sorted({entry.name for entry in _entry_points()} - set(built_in))
        return [*built_in, *(name for name in plugins if self.get_command(ctx, name) is not None)]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command, None if there is none of that name."""
        command = super().get_command(ctx, cmd_name)
        if command is not None:
            return command
        entry = next((entry for entry in _entry_points() if entry.name == cmd_name), None)
        return None if entry is None else _load(entry, ctx)


def _entry_points(group: str = GROUP) -> Iterator[Any]:
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
    app = typer.Typer(rich_markup_mode=None, callback=lambda: None)
    if isinstance(value, typer.Typer):
        app.add_typer(value, name=entry.name)
    else:
        app.command(entry.name)(value)
    return get_group(app).get_command(ctx, entry.name)


def converter() -> Callable[[Path, Path], list[str]]:
    """Return the function that converts a configuration of another program into a scenario.

    Raises:
        InputError: There is none.
    """
    for entry in _entry_points("fleet2d.converter"):
        with suppress(ModuleNotFoundError):
            return entry.load()
    raise InputError(
        "this is neither a floor plan (docs/floorplans.md lists the formats) nor a file that an"
        " installed converter takes"
    )
