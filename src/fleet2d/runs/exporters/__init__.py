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


def exporter(name: str) -> Exporter:
    """Return the function that exports runs to a format.

    Raises:
        InputError: There is no such format.

    Example:
        >>> exporter("casas").__module__
        'fleet2d.runs.exporters.casas'
    """
    own = [module.name for module in pkgutil.iter_modules(__path__)]
    if name in own:
        return cast("Exporter", importlib.import_module(f"{__name__}.{name}").export)
    plugins = entry_points(group="fleet2d.exporter")
    if name not in plugins.names:
        known = sorted({*own, *plugins.names})
        raise InputError(f"there is no exporter {name!r}{suggest(name, known)}")
    return cast("Exporter", plugins[name].load())
