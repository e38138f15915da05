"""Exporters, one format a module: `export` in it writes a stored run to a file for other programs.

A format of an installed package is an entry point of the group `fleet2d.exporter`: such a function.
"""

import ast
import importlib
import pkgutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from fleet2d.errors import InputError

if TYPE_CHECKING:
    from fleet2d.runs.run import Run

Exporter = Callable[["Run", Path], str]
"""Writes a run to a file, and returns a line about it."""


def formats() -> dict[str, str]:
    """Return what each format is, by its name, without importing any.

    That is the first line of the module; empty for formats of installed packages.
    """
    own = {name: _first_line(Path(__path__[0], f"{name}.py")) for name in _modules()}
    return dict(sorted({**dict.fromkeys(_plugins().names, ""), **own}.items()))


def exporter(name: str) -> Exporter:
    """Return the function that exports runs to a format.

    Raises:
        InputError: There is no such format.

    Example:
        >>> exporter("casas").__module__
        'fleet2d.runs.exporters.casas'
    """
    if name in _modules():
        return cast("Exporter", importlib.import_module(f"{__name__}.{name}").export)
    if name not in _plugins().names:
        from fleet2d.configuration.problems import (
            suggest,  # with pydantic, which the help needn't import
        )

        raise InputError(f"there is no exporter {name!r}{suggest(name, formats())}")
    return cast("Exporter", _plugins()[name].load())


def _first_line(module: Path) -> str:
    docstring = ast.get_docstring(ast.parse(module.read_text(encoding="utf-8")))
    return (docstring or "").partition("\n")[0]


def _modules() -> list[str]:
    return [module.name for module in pkgutil.iter_modules(__path__)]


def _plugins() -> Any:
    from importlib.metadata import entry_points  # slow to import, and rarely needed

    return entry_points(group="fleet2d.exporter")
