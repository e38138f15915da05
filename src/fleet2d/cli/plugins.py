"""Commands of installed packages: entry points of the group `fleet2d.command`.

Fleet2D's own commands that few need are declared the same way. They load when they are called.
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
    """The commands of Fleet2D, and behind them those of installed packages."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands that can be loaded."""
        own = super().list_commands(ctx)
        others = sorted({entry.name for entry in _entry_points()} - set(own))
        return [*own, *(name for name in others if self.get_command(ctx, name) is not None)]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command, None if there is none of that name."""
        own = super().get_command(ctx, cmd_name)
        if own is not None:
            return own
        entry = next((entry for entry in _entry_points() if entry.name == cmd_name), None)
        return None if entry is None else _load(entry, ctx)


def _entry_points(group: str = GROUP) -> Iterator[Any]:
    from importlib.metadata import entry_points  # slow to import, and seldom needed

    return iter(entry_points(group=group))


def _load(entry: Any, ctx: Any) -> Any:
    """Load a command; one whose package is gone is left out, a broken one is reported."""
    try:
        value = entry.load()
    except Exception as error:  # noqa: BLE001 - whatever the module of somebody else does
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
    """Return what turns a configuration of another program into a scenario.

    Raises:
        InputError: None is installed.
    """
    for entry in _entry_points("fleet2d.converter"):
        with suppress(ModuleNotFoundError):
            convert: Callable[[Path, Path], list[str]] = entry.load()
            return convert
    raise InputError("nothing is installed that converts this file: it is no floor plan")
