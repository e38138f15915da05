"""Layouts of logs of rooms and activities, one a module, by its name.

A module has `read(path, *, sort=False)`, which returns an `ActivityLog`; `matches(line)`, which
returns whether a line of a file shows this layout; and `FOLDERS`, whether it reads folders, too.
"""

import importlib
import pkgutil
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

if TYPE_CHECKING:
    from fleet2d.logs.log import ActivityLog


class LogLayout(Protocol):
    """What a module of a layout has."""

    FOLDERS: bool

    def matches(self, line: str) -> bool:
        """Return whether a stripped line shows this layout, and no other."""

    def read(self, path: Path, *, sort: bool = False) -> "ActivityLog":
        """Read a file, or a folder of files of one home."""


def layout_names() -> list[str]:
    """Return the names of all layouts, sorted.

    >>> "casas" in layout_names()
    True
    """
    return sorted(module.name for module in pkgutil.iter_modules(__path__))


def layout_of(name: str) -> LogLayout:
    """Return the module of a layout."""
    return cast("LogLayout", importlib.import_module(f"{__name__}.{name}"))
