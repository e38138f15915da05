"""Exporters, one format a module: `export` in it writes a stored run to a file for other programs.

A format of an installed package is an entry point of the group `fleet2d.exporter`: a function with
the same arguments.
"""

import ast
import importlib
import os
import pkgutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, cast

from fleet2d.errors import InputError, RunDirectoryError
from fleet2d.storage.files import replacing

if TYPE_CHECKING:
    from fleet2d.runs.records import Selection
    from fleet2d.runs.run import Run

Exporter = Callable[["Run", Path, "Selection"], str]
"""Writes a part of a run to a file, and returns a line about it."""

# Formats whose files have another suffix than the name of the format.
_SUFFIXES = {".txt": "casas", ".rrd": "rerun", "": "rosbag2"}


def export(
    run: "Run",
    path: Path | str,
    layout: str | None = None,
    *,
    first: int = 0,
    end: int | None = None,
    every: str | None = None,
) -> str:
    """Write a run, or a part of it, to a file for other programs.

    Args:
        run: The run.
        path: The file, or the folder of a bag.
        layout: The name of its format, such as "mcap"; None: by the suffix of the file.
        first: The first step.
        end: The step after the last one; None for the end of the run.
        every: Time between two poses, such as "10 s"; None for the step.

    Returns:
        A line about the file.

    Raises:
        InputError: There is no such format, it needs a library that isn't installed, or `every` is
            no multiple of the step.
        ArtifactError: The run stored no key frames, or the file can't be written.
    """
    from fleet2d.runs.records import Selection  # with NumPy, which the help needn't import

    write = exporter(layout or format_of(Path(path)))
    return write(run, Path(path), Selection.of(run, first, end, every))


def formats() -> dict[str, str]:
    """Return what each format is, by its name, without importing any.

    That is the first line of the module; empty for formats of installed packages.
    """
    own = {name: _first_line(Path(__path__[0], f"{name}.py")) for name in _modules()}
    return dict(sorted({**dict.fromkeys(_plugins().names, ""), **own}.items()))


def format_of(path: Path) -> str:
    """Return the name of the format of a file with such a name.

    Raises:
        InputError: No format has this suffix.

    Example:
        >>> format_of(Path("week.mcap")), format_of(Path("bags/week"))
        ('mcap', 'rosbag2')
    """
    name = _SUFFIXES.get(path.suffix.lower(), path.suffix.lower()[1:])
    if name not in formats():
        suffixes = ", ".join(f".{own}" for own in formats() if own not in _SUFFIXES.values())
        raise InputError(
            f"{path}: no format has the suffix {path.suffix!r}: name the format by --format, or"
            f" write a file with one of {suffixes}, .rrd, .txt, or a folder"
        )
    return name


@contextmanager
def new_file(path: Path) -> Iterator[BinaryIO]:
    """Yield a file that appears, complete, after the block, replacing one of the same name.

    Raises:
        RunDirectoryError: It can't be written.
    """
    try:
        with replacing(path) as handle, os.fdopen(handle, "wb", closefd=False) as file:
            yield file
    except OSError as error:
        raise RunDirectoryError(f"{path} can't be written: {error.strerror or error}") from error


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
