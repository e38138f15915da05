"""Reading a log of any layout; layouts of rooms and activities are modules, by their names.

A module has `read(path, *, sort=False)`, which returns an `ActivityLog`; `matches(line)`, which
returns whether a line of a file shows this layout; and `FOLDERS`, whether it reads folders, too.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol, cast

from fleet2d.logs.log import ActivityLog, LogError, PositionLog, log_lines
from fleet2d.storage.bags import is_bag

FIRST_LINES = 20


class LogLayout(Protocol):
    """What a module of a layout has."""

    FOLDERS: bool

    def matches(self, line: str) -> bool:
        """Return whether a stripped line shows this layout, and no other."""

    def read(self, path: Path, *, sort: bool = False) -> ActivityLog:
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


if TYPE_CHECKING:
    Layout = str
else:
    Layout = Literal[("auto", *layout_names(), "bag", "positions")]


def read_log(
    path: str | Path,
    layout: Layout = "auto",
    *,
    id: str | None = None,  # noqa: A002 - the name of the column
    columns: Mapping[str, str] | None = None,
    time_zone: str | None = None,
    sort: bool = False,
) -> ActivityLog | PositionLog:
    """Read a log: a smart home's events, an activity script, or position fixes.

    Args:
        path: The file; or the folder, for a home that has several.
        layout: The layout; "auto" recognizes it by its content.
        id: The tag to read, of positions; the topic or frame, of a bag; see `read_bag`.
        columns: The names of the columns of positions; see `read_positions`.
        time_zone: The time zone of the home, for positions and bags; see `read_positions`.
        sort: Sort lines whose time runs backwards instead of refusing them.

    Raises:
        LogError: It is of no known layout, damaged, or contradicts itself.
    """
    path = Path(path)
    if not path.exists():
        raise LogError(f"no such file: {path}")
    layout = _recognize(path) if layout == "auto" else layout
    if layout == "positions":
        # Imported here, as no other layout needs pyarrow.
        from fleet2d.logs.positions import read_positions

        return read_positions(path, id=id, columns=columns, time_zone=time_zone, sort=sort)
    if layout == "bag":
        if columns:
            raise LogError(f"{path} is a bag: columns are for tables of positions")
        from fleet2d.logs.bags import read_bag

        return read_bag(path, id=id, time_zone=time_zone, sort=sort)
    if id is not None or columns or time_zone is not None:
        raise LogError(
            f"{path} is of the layout {layout}: id, columns and time_zone are for positions"
            " and bags"
        )
    return layout_of(layout).read(path, sort=sort)


def _recognize(path: Path) -> str:
    """Return the layout of a file or folder.

    Raises:
        LogError: It is of no known layout.
    """
    if is_bag(path):
        return "bag"
    if path.is_dir():
        layouts = map(_recognize_lines, sorted(path.glob("*.txt")))
        layout = next((name for name in layouts if name and layout_of(name).FOLDERS), None)
        if layout is None:
            several = [name for name in layout_names() if layout_of(name).FOLDERS]
            raise LogError(
                f"{path}: no .txt file in this folder is of a layout with several files"
                f" ({', '.join(several)}): for other layouts name the file"
            )
        return layout
    if path.suffix.lower() in (".parquet", ".pq"):
        return "positions"
    layout = _recognize_lines(path) or ("positions" if path.suffix.lower() == ".csv" else None)
    if layout is None:
        names = ", ".join(layout_names())
        raise LogError(f"{path} has no known layout: give 'format' ({names} or positions)")
    return layout


def _recognize_lines(file: Path) -> str | None:
    """Return the layout that one of the first lines of a file shows, if one does."""
    layouts = {name: layout_of(name) for name in layout_names()}
    lines = (line for _, line in islice(log_lines(file), FIRST_LINES))
    shown = (name for line in lines for name, layout in layouts.items() if layout.matches(line))
    return next(shown, None)
