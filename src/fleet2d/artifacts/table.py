"""Tables of a run: their names, and the kinds and units of their columns."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from fleet2d.errors import ArtifactError

Kind = Literal["step", "time", "int32", "int64", "float64", "bool", "category", "string"]

DTYPES: dict[str, np.dtype[Any]] = {
    "step": np.dtype(np.int64),
    "time": np.dtype(np.int64),  # microseconds since 1970, as in timestamp[us]
    "int32": np.dtype(np.int32),
    "int64": np.dtype(np.int64),
    "float64": np.dtype(np.float64),
    "bool": np.dtype(np.bool_),
    "category": np.dtype(np.int32),
}
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.\-]*")


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table.

    Attributes:
        name: Its name, with the unit in it where the unit isn't SI.
        kind: `step` int64 · `time` timestamp[us] · `int32` · `int64` · `float64` · `bool` ·
            `category` dictionary<int32, string> · `string`.
        unit: Its unit, such as "m" or "rad"; empty where there is none.
        nullable: Whether a value may be missing. Missing are: NaN in float64, NaT in time, code
            -1 or None in category, None in string, and what a masked array masks.
        categories: The words that the codes of a category column stand for. Empty: the column
            takes strings, and its dictionary grows in the order in which they appear first.
        description: One line for a reader of the file.
    """

    name: str
    kind: Kind
    unit: str = ""
    nullable: bool = False
    categories: tuple[str, ...] = ()
    description: str = ""

    def __post_init__(self) -> None:
        """Refuse a column that can't be stored."""
        if not self.name:
            raise ArtifactError("a column has no name: give it one")
        if self.kind not in get_args(Kind):
            raise ArtifactError(
                f"column {self.name!r} is of unknown kind {self.kind!r}: "
                f"use one of {', '.join(get_args(Kind))}"
            )
        if self.categories and self.kind != "category":
            raise ArtifactError(f"column {self.name!r} has categories: its kind must be category")
        if len(set(self.categories)) < len(self.categories):
            raise ArtifactError(f"column {self.name!r} names a category twice: name each once")

    @property
    def is_growing(self) -> bool:
        """Whether the column takes strings that extend its dictionary."""
        return self.kind == "category" and not self.categories

    @property
    def takes_strings(self) -> bool:
        """Whether values are appended as strings."""
        return self.kind == "string" or self.is_growing


@dataclass(frozen=True, slots=True)
class TableSpec:
    """A table's columns, and its name, which is also the name of its file.

    Example:
        >>> TableSpec("events", (Column("step", "step"), Column("what", "category"))).names
        ('step', 'what')
    """

    name: str
    columns: tuple[Column, ...]
    description: str = ""

    def __post_init__(self) -> None:
        """Refuse a table that can't be stored."""
        object.__setattr__(self, "columns", tuple(self.columns))
        if not _NAME.fullmatch(self.name):
            raise ArtifactError(
                f"a table can't be named {self.name!r}, because it becomes the file name: "
                "use letters, digits, '_', '-' and '.'"
            )
        if not self.columns:
            raise ArtifactError(f"table {self.name!r} has no columns: give it at least one")
        if len(set(self.names)) < len(self.names):
            raise ArtifactError(f"table {self.name!r} names a column twice: name each once")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, in order."""
        return tuple(column.name for column in self.columns)
