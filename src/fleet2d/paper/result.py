"""A result: tables to print, and the numbers behind them to keep."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fleet2d.errors import InputError

PAPER_COLUMN = "the paper's"  # the head of what others measured


@dataclass(frozen=True)
class Table:
    """One table, its cells as they are printed.

    Attributes:
        title: What it shows, with units.
        columns: Heads of the columns.
        rows: The cells.
        notes: What is to be said below it.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Result:
    """One result of the paper, measured anew.

    Attributes:
        name: As on the command line.
        title: What it is.
        tables: To print.
        numbers: All of it, of each single run; JSON.
    """

    name: str
    title: str
    tables: tuple[Table, ...]
    numbers: Mapping[str, Any] = field(default_factory=dict)

    def save(self, directory: Path) -> Path:
        """Write the numbers to `NAME.json` in a directory; return the file.

        Raises:
            InputError: It can't be written.
        """
        from fleet2d.version import __version__

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
    """Make the directory for results, if there is none.

    Raises:
        InputError: It can't be made.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{directory} can't be made: {error.strerror}; name another directory by --out"
        ) from error


def counted(number: int, noun: str) -> str:
    """Return a number of things in words.

    Example:
        >>> counted(1, "day"), counted(30, "day")
        ('1 day', '30 days')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"
