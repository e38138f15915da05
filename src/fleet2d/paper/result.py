"""A result: tables to print, and all numbers behind them."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fleet2d.errors import InputError

PAPER_COLUMN = "the paper's"  # heading of the column of the paper's own figures


@dataclass(frozen=True)
class Table:
    """One table, with its cells as text.

    Attributes:
        title: Its title, with units.
        columns: The headings of its columns.
        rows: Its cells.
        notes: Notes to print below it.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Result:
    """One result of the paper, measured again.

    Attributes:
        name: Its name on the command line.
        title: Its title.
        tables: Its tables.
        numbers: The numbers of every single run, as JSON data.
    """

    name: str
    title: str
    tables: tuple[Table, ...]
    numbers: Mapping[str, Any] = field(default_factory=dict)

    def save(self, directory: Path) -> Path:
        """Write the numbers to `NAME.json` in a directory; return the path.

        Raises:
            InputError: The file can't be written.
        """
        from fleet2d import __version__

        path = directory / f"{self.name}.json"
        content = {"result": self.title, "fleet2d": __version__, **self.numbers}
        try:
            path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        except OSError as error:
            raise InputError(
                f"{path} can't be written: {error.strerror}; name another directory by --out"
            ) from error
        return path


def make_directory(directory: Path) -> None:
    """Create the directory for results, if there is none.

    Raises:
        InputError: It can't be created.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{directory} can't be created: {error.strerror}; name another directory by --out"
        ) from error


def counted(number: int, noun: str) -> str:
    """Return a number with its noun.

    Example:
        >>> counted(1, "day"), counted(30, "day")
        ('1 day', '30 days')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"
