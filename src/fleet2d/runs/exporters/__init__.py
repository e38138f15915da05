"""Exporters, one format a module: `export` in it writes a stored run to a file for other programs.

A format of an installed package is an entry point of the group `fleet2d.exporter`: such a function.
"""

import importlib
import pkgutil
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from typing import cast

from fleet2d.errors import InputError
from fleet2d.problems import suggest
from fleet2d.runs.run import Run

Exporter = Callable[[Run, Path], str]
"""Writes a run to a file, and returns a line about it."""


def formats() -> list[str]:
    """Return the names of all formats: modules of this package, and of installed plugins."""
    own = [module.name for module in pkgutil.iter_modules(__path__)]
    plugins = entry_points(group="fleet2d.exporter").names
    return sorted({*(name for name in own if not name.startswith("_")), *plugins})


def exporter(name: str) -> Exporter:
    """Return the function that exports runs to a format.

    Raises:
        InputError: There is no such format.

    Example:
        >>> exporter("casas").__module__
        'fleet2d.runs.exporters.casas'
    """
    if name not in formats():
        raise InputError(f"there is no exporter {name!r}{suggest(name, formats())}")
    if any(module.name == name for module in pkgutil.iter_modules(__path__)):
        return cast("Exporter", importlib.import_module(f"{__name__}.{name}").export)
    return cast("Exporter", entry_points(group="fleet2d.exporter")[name].load())
