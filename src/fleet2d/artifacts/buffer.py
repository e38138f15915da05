"""The buffer that collects rows of a table until they are flushed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.artifacts.chunk import (
    Chunk,
    ColumnChunk,
    Words,
    empty_chunk,
    encode_strings,
    encode_words,
)
from fleet2d.artifacts.table import DTYPES, Column, TableSpec
from fleet2d.errors import ArtifactError

FLUSH_ROWS = 2**17
"""Rows that a table holds back at most, and rows of a Parquet row group at most."""

_FIRST_CAPACITY = 256
_NOT_A_TIME = np.iinfo(np.int64).min


class Checked(NamedTuple):
    """Rows that fit the table, before they are copied into it."""

    rows: int
    values: dict[str, Any]
    valid: dict[str, Any]


class TableBuffer:
    """Collects rows of one table, at most `limit` of them, in arrays that grow as needed."""

    def __init__(self, spec: TableSpec, limit: int = FLUSH_ROWS) -> None:
        """Start empty; memory is taken only when rows come."""
        self.spec = spec
        self.limit = limit
        self.rows = 0
        self.words = {column.name: Words() for column in spec.columns if column.is_growing}
        self._capacity = 0
        self._needed = _FIRST_CAPACITY
        self._values: dict[str, Any] = {}
        self._valid: dict[str, NDArray[np.bool_]] = {}
        self._names = frozenset(spec.names)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the room that is kept free for more rows."""
        values = {name: kept[: self.rows] for name, kept in self._values.items()}
        valid = {name: kept[: self.rows] for name, kept in self._valid.items()}
        return {**self.__dict__, "_capacity": self.rows, "_values": values, "_valid": valid}

    @property
    def is_full(self) -> bool:
        """Whether no further row fits."""
        return self.rows >= self.limit

    def append(self, **columns: Any) -> None:
        """Add rows, as many as fit under `limit`.

        Args:
            columns: One array per column, all of one length; a scalar stands for all rows.

        Raises:
            ArtifactError: The columns don't fit the table, or the rows don't fit the limit.
        """
        checked = self.check(columns)
        if self.rows + checked.rows > self.limit:
            raise ArtifactError(
                f"table {self.spec.name!r}: {checked.rows} rows are more than the "
                f"{self.limit - self.rows} that still fit: append less at a time"
            )
        self.fill(checked, 0)

    def check(self, columns: Mapping[str, Any]) -> Checked:
        """Bring columns to the table's types; nothing is kept yet.

        Raises:
            ArtifactError: A column is missing, unknown, of another length or type, out of range,
                or has missing values without being nullable.
        """
        if columns.keys() != self._names:
            raise ArtifactError(self._wrong_names(columns))
        values: dict[str, Any] = {}
        valid: dict[str, Any] = {}
        rows = -1
        for column in self.spec.columns:
            try:
                kept, there = _checked(column, columns[column.name])
            except ArtifactError as error:
                raise ArtifactError(
                    f"table {self.spec.name!r}, column {column.name!r}: {error}"
                ) from error
            values[column.name], valid[column.name] = kept, there
            length = _length(kept)
            if length >= 0 and rows >= 0 and length != rows:
                raise ArtifactError(
                    f"table {self.spec.name!r}: column {column.name!r} has {length} values where "
                    f"others have {rows}: give all columns one length"
                )
            rows = max(rows, length)
        return Checked(1 if rows < 0 else rows, values, valid)

    def fill(self, checked: Checked, start: int) -> int:
        """Copy rows in from `start` on, as many as fit; return where the rest starts."""
        stop = min(checked.rows, start + self.limit - self.rows)
        a, b = self.rows, self.rows + stop - start
        self._make_room(b)
        for column in self.spec.columns:
            name, given = column.name, checked.values[column.name]
            kept = self._values[name]
            if isinstance(kept, np.ndarray):
                kept[a:b] = given if np.ndim(given) == 0 else given[start:stop]
            else:
                del kept[a:]  # what an interrupted call may have left
                kept.extend([given] * (b - a) if not isinstance(given, list) else given[start:stop])
            if column.nullable and name in self._valid:
                there = checked.valid[name]
                self._valid[name][a:b] = there if np.ndim(there) == 0 else there[start:stop]
        self.rows = b
        return stop

    def take(self, *, reuse: bool = False) -> Chunk:
        """Hand out the rows and empty the buffer.

        Args:
            reuse: The caller is done with the arrays before the next append, so the same memory
                may collect the next rows.
        """
        chunk = self.peek()
        self.rows = 0
        if not reuse:
            self._needed = max(self._needed, self._capacity)  # likely needed again
            self._capacity, self._values, self._valid = 0, {}, {}
        for column in self.spec.columns:
            if column.takes_strings:
                self._values[column.name] = []
        return chunk

    def learn_words(self, words: Mapping[str, Words]) -> None:
        """Enter words in the order of their codes, before rows are encoded that hold them."""
        for name, known in words.items():
            for word in known.listed():
                self.words[name][word]  # looking a new word up enters it

    def peek(self, start: int = 0) -> Chunk:
        """Return the rows from `start` on, which stay here; arrays are not copied."""
        return {column.name: self._rows_of(column, start) for column in self.spec.columns}

    def _rows_of(self, column: Column, start: int) -> ColumnChunk:
        """Encode what one column holds from row `start` on."""
        if self.rows <= start:
            return empty_chunk(column)
        kept = self._values[column.name][start : self.rows]
        if column.kind == "string":
            return encode_strings(kept, column.nullable)
        if column.is_growing:
            return encode_words(kept, self.words[column.name], column.nullable)
        if not column.nullable:
            return ColumnChunk(kept)
        valid = self._valid[column.name][start : self.rows]
        if not valid.all():
            kept[~valid] = 0
        return ColumnChunk(kept, valid)

    def _make_room(self, rows: int) -> None:
        """Let at least `rows` rows fit, doubling so that many small appends stay cheap."""
        if rows <= self._capacity and self._values:
            return
        capacity = min(self.limit, max(rows, 2 * self._capacity, self._needed))
        for column in self.spec.columns:
            if column.takes_strings:
                self._values.setdefault(column.name, [])
                continue
            _grow(self._values, column.name, capacity, self.rows, DTYPES[column.kind])
            if column.nullable:
                _grow(self._valid, column.name, capacity, self.rows, np.dtype(np.bool_))
        self._capacity = capacity

    def _wrong_names(self, columns: Mapping[str, Any]) -> str:
        missing = [name for name in self.spec.names if name not in columns]
        unknown = [name for name in columns if name not in self._names]
        parts = [f"lacks {', '.join(missing)}"] if missing else []
        parts += [f"has no column {', '.join(unknown)}"] if unknown else []
        return (
            f"table {self.spec.name!r} {' and '.join(parts)}: "
            f"give exactly {', '.join(self.spec.names)}"
        )


def _grow(
    arrays: dict[str, Any], name: str, capacity: int, rows: int, dtype: np.dtype[Any]
) -> None:
    """Replace an array by a longer one with the same first rows."""
    longer = np.empty(capacity, dtype)
    if rows:
        longer[:rows] = arrays[name][:rows]
    arrays[name] = longer


def _checked(column: Column, given: Any) -> tuple[Any, Any]:
    """Return the values as array, list or scalar, and which of them are there."""
    if column.takes_strings:
        return _checked_strings(column, given), True
    mask = np.ma.getmaskarray(given) if isinstance(given, np.ma.MaskedArray) else None
    values = np.ma.getdata(given) if mask is not None else np.asarray(given)
    if values.ndim > 1:
        raise ArtifactError(f"has {values.ndim} dimensions: give one value per row")
    if not values.size:
        return np.empty(0, DTYPES[column.kind]), True
    valid = None if mask is None else ~mask
    if column.kind == "float64":
        if values.dtype.kind not in "fiu":
            raise ArtifactError(f"holds {values.dtype}, not float64: convert it first")
        there = ~np.isnan(values) if values.dtype.kind == "f" else None
    elif column.kind == "bool":
        if values.dtype.kind != "b":
            raise ArtifactError(f"holds {values.dtype}, not bool: convert it first")
        there = None
    else:
        values, there = _checked_integers(column, values, valid)
    if there is not None:
        valid = there if valid is None else valid & there
    if not column.nullable and valid is not None and not valid.all():
        raise ArtifactError("has missing values (NaN, NaT, -1 or masked): declare it nullable")
    return values, True if valid is None else valid


def _checked_integers(column: Column, values: Any, valid: Any) -> tuple[Any, Any]:
    """Check type and range of integers, times and codes; return which are there if not all."""
    if column.kind == "time" and values.dtype.kind == "M":
        values = values.astype("datetime64[us]", copy=False).view(np.int64)
        return values, values != _NOT_A_TIME
    if values.dtype.kind not in "iu":
        raise ArtifactError(f"holds {values.dtype}, not integers: convert it first")
    dtype = DTYPES[column.kind]
    if column.kind != "category":
        if not np.can_cast(values.dtype, dtype) and values.size:
            seen = values if valid is None else values[valid]
            if seen.size and not _fits(seen, dtype):
                raise ArtifactError(f"holds numbers beyond {dtype}: declare it int64")
        return values, None
    there = values >= 0 if column.nullable else None
    seen = values if valid is None else values[valid]
    lowest = -1 if column.nullable else 0
    if seen.size and not (lowest <= seen.min() and seen.max() < len(column.categories)):
        raise ArtifactError(
            f"has code {int(seen.min())} or {int(seen.max())}: "
            f"there are {len(column.categories)} categories"
        )
    return values, there


def _length(kept: Any) -> int:
    """Return the number of values, or -1 for a scalar."""
    if isinstance(kept, np.ndarray):
        return -1 if kept.ndim == 0 else len(kept)
    return len(kept) if isinstance(kept, list) else -1


def _fits(values: Any, dtype: np.dtype[Any]) -> bool:
    bounds = np.iinfo(dtype)
    return int(values.min()) >= bounds.min and int(values.max()) <= bounds.max


def _checked_strings(column: Column, given: Any) -> Any:
    """Return one string (or None), or a list of them."""
    if isinstance(given, np.ndarray):
        given = given.tolist()  # a scalar if it has no dimension
    if given is not None and not isinstance(given, str):
        given = list(given)
    strings = given if isinstance(given, list) else [given]
    strange = set(map(type, strings)) - {str}
    if strange == {type(None)} and not column.nullable:
        raise ArtifactError("has missing values (None): declare it nullable")
    if strange - {type(None)}:
        raise ArtifactError(f"holds {strange.pop().__name__}, not strings: convert it first")
    return given
