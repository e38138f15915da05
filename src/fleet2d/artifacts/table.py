"""Tables of a run: their columns, the form of rows that is hashed and stored, and a buffer."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from fleet2d.errors import ArtifactError
from fleet2d.kernels import I64, Bool
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.local_time import Zone, rules_of
from fleet2d.storage.names import is_word

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
KINDS: dict[str, Kind] = {"b": "bool", "i": "int64", "u": "int64", "f": "float64", "O": "category"}
"""The kind of column for values of each kind of NumPy's types."""

TRACK = 0
PLANNED = 1
WALK = 2
KEY_KINDS = ("track", "planned", "walk")
"""The kinds of rows in the table key_frames: a breakpoint that the body reached, the planned end of
a segment that was interrupted before, the state from which a random walk continues."""


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table.

    Attributes:
        name: Its name, with the unit in it where the unit isn't SI.
        kind: `step` int64 · `time` timestamp[us] · `int32` · `int64` · `float64` · `bool` ·
            `category` dictionary<int32, string> · `string`.
        unit: Its unit, such as "m" or "rad"; empty without one. For UTC times, the time zone of the
            home.
        nullable: Whether a value may be missing. Missing values are NaN in float64, NaT in time,
            code -1 or None in category, None in string, and what a masked array masks.
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
class Repeated:
    """The values of a column with many repetitions: each distinct value is stored and checked once.

    Example:
        >>> np.asarray(Repeated(np.array([0.5, 2.0]), np.array([0, 0, 1]))).tolist()
        [0.5, 0.5, 2.0]

    Attributes:
        values: Numbers or codes, (k,).
        index: int64 (rows,), the index into `values` of each row.
    """

    values: NDArray[Any]
    index: I64

    def __array__(self, dtype: Any = None, *, copy: bool | None = None) -> NDArray[Any]:
        """Return the value of each row."""
        return self.values[self.index].astype(dtype or self.values.dtype, copy=False)

    def copy_to(self, rows: NDArray[Any], start: int) -> None:
        """Copy the values from row `start` on into `rows`, as many as fit."""
        index = self.index[start : start + len(rows)]
        np.take(self.values, index, out=rows, mode="clip")  # other modes make a copy first


Columns = dict[Column, Any]
"""Columns and their values, which make a table and rows of it."""
LAYER_PREFIX = "layer."
"""The beginning of the names of tables that hold layers."""
ALL_CELLS = -1
"""Row and column of the entry that holds the fill value: of all cells without an entry."""
STEP = Column("step", "step", description="step at which the row takes effect")
TIME = Column("time", "time", description="local time")


def time_column(zone: Zone | None) -> Column:
    """Return the time column of a run: UTC if the home has a time zone."""
    return TIME if zone is None else replace(TIME, unit=zone.label, description="time")


def moment_columns(clock: Clock, step: I64) -> Columns:
    """Return the first columns of most tables of a run: the steps of rows, and their times."""
    return {STEP: step, time_column(clock.zone): clock.stamps(step)}


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
        if self.name[:1] in ("", ".", "-") or not is_word(self.name.replace(".", "_")):
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


class ColumnChunk(NamedTuple):
    """Consecutive values of one column, in the one form that is both hashed and stored.

    Attributes:
        values: Numbers or category codes, (n,), 0 where missing; for strings their UTF-8 bytes.
        valid: Which values are not missing, (n,) bool; None if the column isn't nullable.
        lengths: Bytes of each string, (n,) int64; None for every other kind.
    """

    values: NDArray[Any]
    valid: Bool | None = None
    lengths: I64 | None = None


Chunk = dict[str, ColumnChunk]


class Dictionary(dict[str | None, int]):
    """A growing dictionary: looking up a new word gives it the next code.

    Example:
        >>> words = Dictionary()
        >>> words["on"], words["off"], words["on"], words.in_order()
        (0, 1, 0, ['on', 'off'])
    """

    def __missing__(self, word: str | None) -> int:
        """Enter a new word."""
        if not isinstance(word, str):
            raise ArtifactError(f"expected text, got {word!r}")
        self[word] = code = len(self) - (None in self)
        return code

    def enter(self, words: Iterable[str]) -> None:
        """Enter words in the order of their codes."""
        for word in words:
            self[word]  # looking a new word up enters it

    def in_order(self) -> list[str]:
        """Return all words in the order of their codes."""
        return [word for word in self if word is not None]


Words = Mapping[str, Dictionary]
"""The dictionaries of the columns of a table whose dictionary grows, by the column's name."""


def new_dictionaries(spec: TableSpec) -> dict[str, Dictionary]:
    """Return an empty dictionary for each column of a table whose dictionary grows."""
    return {column.name: Dictionary() for column in spec.columns if column.is_growing}


def empty_chunk(column: Column) -> ColumnChunk:
    """Return an empty chunk of a column."""
    valid = np.empty(0, np.bool_) if column.nullable else None
    if column.kind == "string":
        return ColumnChunk(np.empty(0, np.uint8), valid, np.empty(0, np.int64))
    return ColumnChunk(np.empty(0, DTYPES[column.kind]), valid)


def encode_strings(strings: Sequence[str | None], nullable: bool) -> ColumnChunk:
    """Turn strings into their UTF-8 bytes and the length of each."""
    encoded = [string.encode() if string else b"" for string in strings]
    lengths = np.fromiter(map(len, encoded), np.int64, len(encoded))
    values = np.frombuffer(b"".join(encoded), np.uint8)
    return ColumnChunk(values, _valid(strings) if nullable else None, lengths)


def encode_words(strings: Sequence[str | None], words: Dictionary, nullable: bool) -> ColumnChunk:
    """Turn strings into codes, entering new ones into `words`."""
    if nullable:
        words[None] = 0  # a missing value is stored as code 0 and marked by `valid`
    codes = np.fromiter(map(words.__getitem__, strings), np.int32, len(strings))
    return ColumnChunk(codes, _valid(strings) if nullable else None)


def _valid(strings: Sequence[str | None]) -> Bool:
    return np.fromiter((string is not None for string in strings), np.bool_, len(strings))


FLUSH_ROWS = 2**16
"""Rows that a table holds back at most, and rows of a Parquet row group at most."""

_FIRST_CAPACITY = 256
_NOT_A_TIME = np.iinfo(np.int64).min
# NumPy's kinds of values that a kind of column takes; integers by default.
_ACCEPTED = {"float64": "fiu", "bool": "b", "time": "iuM"}


class Batch(NamedTuple):
    """Converted rows, before they are copied into a buffer.

    Attributes:
        rows: Number of rows.
        values: Of each column an array or a list, (rows,), or a scalar that stands for all rows; or
            `Repeated`, with 0 for missing ones.
        valid: Of each column which values are not missing, bool (rows,), `Repeated`, or True for
            all.
    """

    rows: int
    values: dict[str, Any]
    valid: dict[str, Any]


class TableBuffer:
    """Collects rows of one table, at most `limit` of them, in arrays that grow as needed."""

    def __init__(self, spec: TableSpec, limit: int = FLUSH_ROWS) -> None:
        """Create an empty buffer; memory is allocated with the first rows."""
        self.spec = spec
        self.limit = limit
        self.rows = 0
        self.words = new_dictionaries(spec)
        self._capacity = 0
        self._first_capacity = _FIRST_CAPACITY
        self._values: dict[str, NDArray[Any]] = {}
        texts = [column.name for column in spec.columns if column.kind == "string"]
        self._strings: dict[str, list[str | None]] = {name: [] for name in texts}
        self._valid: dict[str, Bool] = {}
        self._names = frozenset(spec.names)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the memory that is reserved for more rows."""
        values = {name: column[: self.rows] for name, column in self._values.items()}
        valid = {name: column[: self.rows] for name, column in self._valid.items()}
        return {**self.__dict__, "_capacity": self.rows, "_values": values, "_valid": valid}

    @property
    def is_full(self) -> bool:
        """Whether no further row fits."""
        return self.rows >= self.limit

    def check(self, columns: Mapping[str, Any]) -> Batch:
        """Convert columns to the table's types, without changing the buffer.

        Args:
            columns: One array, or `Repeated`, per column, all of one length; a scalar stands for
                all rows.

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
            given = columns[column.name]
            convert = _convert_repeated if isinstance(given, Repeated) else _convert
            try:
                values[column.name], valid[column.name] = convert(column, given)
            except ArtifactError as error:
                raise ArtifactError(
                    f"table {self.spec.name!r}, column {column.name!r}: {error}"
                ) from error
            length = _length(values[column.name])
            if length >= 0 and rows >= 0 and length != rows:
                raise ArtifactError(
                    f"table {self.spec.name!r}: column {column.name!r} has {length} values where "
                    f"others have {rows}: give all columns one length"
                )
            rows = max(rows, length)
        return Batch(1 if rows < 0 else rows, values, valid)

    def fill(self, batch: Batch, start: int) -> int:
        """Copy the rows of a batch from `start` on; return the first one that doesn't fit."""
        stop = min(batch.rows, start + self.limit - self.rows)
        self._make_room(self.rows + stop - start)
        known = [(words, len(words)) for words in self.words.values()]
        try:
            self._copy(batch, start, stop)
        except BaseException:  # also Ctrl-C: the dictionary must have no word that is in no row
            for words, count in known:
                while len(words) > count:
                    words.popitem()
            raise
        self.rows += stop - start
        return stop

    def _copy(self, batch: Batch, start: int, stop: int) -> None:
        """Copy some rows of a batch after those of the buffer, without counting them yet."""
        a = self.rows
        b = a + stop - start
        for column in self.spec.columns:
            name = column.name
            values = batch.values[name]
            valid = batch.valid[name]
            if column.takes_strings:
                values = values[start:stop] if isinstance(values, list) else [values] * (b - a)
                if column.kind == "string":
                    self._strings[name][a:] = values  # an interrupted call may have added some
                    continue
                values, valid, _ = encode_words(values, self.words[name], column.nullable)
            elif isinstance(values, Repeated):
                values.copy_to(self._values[name][a:b], start)
                if isinstance(valid, Repeated):
                    valid.copy_to(self._valid[name][a:b], start)
                elif column.nullable:
                    self._valid[name][a:b] = valid
                continue
            else:
                values = values[start:stop] if np.ndim(values) else values
                valid = valid[start:stop] if np.ndim(valid) else valid
            self._values[name][a:b] = values
            if column.nullable:
                self._valid[name][a:b] = valid
                if valid is not True:
                    np.copyto(self._values[name][a:b], 0, where=~valid)

    def take(self, *, reuse: bool = False) -> Chunk:
        """Return the rows and empty the buffer.

        Args:
            reuse: Whether the next rows may overwrite the arrays that are returned: the caller no
                longer needs them by then.
        """
        read = partial(self._rows_of, start=0) if self.rows else empty_chunk
        chunk = {column.name: read(column) for column in self.spec.columns}
        self.rows = 0
        if not reuse:
            # The next chunk is likely to have as many rows.
            self._first_capacity = max(self._first_capacity, self._capacity)
            self._capacity = 0
            self._values = {}
            self._valid = {}
        for strings in self._strings.values():
            strings.clear()
        return chunk

    def arrays(self, start: int) -> list[NDArray[Any]]:
        """Return the rows from `start` on, at least one, in the form of the journal.

        Returns:
            Of each column which values are not missing, if it is nullable, and its values; of texts
            the lengths, which of them are not missing, and their bytes.
        """
        arrays: list[NDArray[Any]] = []
        for column in self.spec.columns:
            values, valid, lengths = self._rows_of(column, start)
            arrays += [array for array in (lengths, valid, values) if array is not None]
        return arrays

    def _rows_of(self, column: Column, start: int) -> ColumnChunk:
        """Return the values of one column from row `start` on."""
        name = column.name
        rows = slice(start, self.rows)
        if column.kind == "string":
            return encode_strings(self._strings[name][rows], column.nullable)
        valid = self._valid[name][rows] if column.nullable else None
        return ColumnChunk(self._values[name][rows], valid)

    def _make_room(self, rows: int) -> None:
        """Allocate memory for `rows` rows or more; it doubles, so that small appends are cheap."""
        if rows <= self._capacity:
            return
        capacity = min(self.limit, max(rows, 2 * self._capacity, self._first_capacity))
        for column in self.spec.columns:
            if column.kind == "string":
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


def _convert(column: Column, values: Any) -> tuple[Any, Any]:
    """Return values as array, list or scalar, and which of them are not missing (True: all)."""
    if column.takes_strings:
        return _as_strings(column, values), True
    valid = None
    # Importing `numpy.ma` takes time, and without it there are no masked arrays.
    if "numpy.ma" in sys.modules and isinstance(values, np.ma.MaskedArray):
        valid = ~np.ma.getmaskarray(values)
        values = np.ma.getdata(values)
    values = np.asarray(values)
    if values.ndim > 1:
        raise ArtifactError(f"has {values.ndim} dimensions: give one value per row")
    if not values.size:
        return np.empty(0, DTYPES[column.kind]), True
    kind = values.dtype.kind
    if kind not in _ACCEPTED.get(column.kind, "iu"):
        noun = column.kind if column.kind in ("float64", "bool") else "integers"
        raise ArtifactError(f"holds {values.dtype}, not {noun}: convert it first")
    if kind == "f":
        present = ~np.isnan(values)
    elif kind == "M":
        values = values.astype("datetime64[us]", copy=False).view(np.int64)
        present = values != _NOT_A_TIME
    else:
        present = _check_integers(column, values, values if valid is None else values[valid])
    if present is not None:
        valid = present if valid is None else valid & present
    if not column.nullable and valid is not None and not valid.all():
        raise ArtifactError("has missing values (NaN, NaT, -1 or masked): declare it nullable")
    return values, True if valid is None else valid


def _convert_repeated(column: Column, values: Repeated) -> tuple[Repeated, Any]:
    """Convert values of which each is given once; see `_convert`."""
    once, valid = _convert(column, values.values)
    once = once.astype(DTYPES[column.kind])
    if not column.nullable:
        valid = True
    elif valid is not True:
        once[~valid] = 0
        valid = Repeated(valid, values.index)
    return Repeated(once, values.index), valid


def _check_integers(column: Column, values: Any, unmasked: Any) -> Any:
    """Check the range of numbers or codes; return which codes are not -1 if that means missing."""
    dtype = DTYPES[column.kind]
    if column.kind != "category":
        if values.dtype != dtype and not np.can_cast(values.dtype, dtype) and unmasked.size:
            bounds = np.iinfo(dtype)
            if int(unmasked.min()) < bounds.min or int(unmasked.max()) > bounds.max:
                raise ArtifactError(f"holds numbers beyond {dtype}: declare it int64")
        return None
    lowest = -1 if column.nullable else 0
    count = len(column.categories)
    if unmasked.size and not (lowest <= unmasked.min() and unmasked.max() < count):
        raise ArtifactError(
            f"has codes from {int(unmasked.min())} to {int(unmasked.max())}, expected {lowest} to"
            f" {count - 1}: there are {count} categories"
        )
    return values >= 0 if column.nullable else None


def _as_strings(column: Column, strings: Any) -> Any:
    """Return one string (or None), or a list of them."""
    if isinstance(strings, np.ndarray):
        strings = strings.tolist()  # an array without dimensions becomes a scalar
    if strings is not None and not isinstance(strings, str):
        strings = list(strings)
    given = strings if isinstance(strings, list) else [strings]
    types = {*map(type, given)} - {str}
    if not types:
        return strings
    if types == {type(None)} and not column.nullable:
        raise ArtifactError("has missing values (None): declare it nullable")
    if strange := types - {type(None)}:
        raise ArtifactError(f"holds {strange.pop().__name__}, not strings: convert it first")
    return strings


def _length(values: Any) -> int:
    """Return the number of values, or -1 for a scalar."""
    if isinstance(values, np.ndarray):
        return -1 if values.ndim == 0 else len(values)
    if isinstance(values, Repeated):
        return len(values.index)
    return len(values) if isinstance(values, list) else -1


def categories(column: Any) -> tuple[I64, list[str]]:
    """Return the category of each row as a number, and the names of the categories.

    Args:
        column: A column of a pyarrow table, of text or of a dictionary of texts.

    Returns:
        int64 (rows,), -1 where the column is null; and the name that each number stands for.

    Example:
        >>> import pyarrow as pa
        >>> numbers, names = categories(pa.chunked_array([["ana", None], ["bob", "ana"]]))
        >>> numbers.tolist(), names
        ([0, -1, 1, 0], ['ana', 'bob'])
    """
    encoded = column.cast("string").combine_chunks().dictionary_encode()
    codes = encoded.indices  # `to_numpy` would import pandas where that is installed
    valid, content = codes.buffers()
    numbers = np.frombuffer(content, np.int32, len(codes), 4 * codes.offset).astype(np.int64)
    if codes.null_count:
        bits = np.unpackbits(np.frombuffer(valid, np.uint8), bitorder="little")
        numbers[bits[codes.offset :][: len(codes)] == 0] = -1
    return numbers, encoded.dictionary.to_pylist()


def _datetimes(column: Column, times: NDArray[Any], count: int) -> list[datetime]:
    """Return times, with the offset of their time zone if the column has one."""
    values = np.broadcast_to(times, count).tolist()
    if not column.unit:
        return values
    zone = rules_of(column.unit)
    return [value.replace(tzinfo=UTC).astimezone(zone) for value in values]


def rows_of(spec: TableSpec, columns: Mapping[str, Any], count: int) -> Iterator[dict[str, Any]]:
    """Yield rows for a table as mappings, with names and times in place of numbers, None for NaN.

    Args:
        spec: The table.
        columns: One array per column, or a scalar for all rows, as `TableBuffer.check` takes them.
        count: The number of rows.

    Example:
        >>> who = Column("who", "category", categories=("ana",))
        >>> spec = TableSpec("seen", (Column("step", "step"), who))
        >>> list(rows_of(spec, {"step": np.array([3, 4]), "who": np.array([0, -1])}, 2))
        [{'step': 3, 'who': 'ana'}, {'step': 4, 'who': None}]
    """
    lists = []
    for column in spec.columns:
        array = np.asarray(columns[column.name])
        values: list[Any] = array.tolist() if array.ndim else [array.item()] * count
        if column.kind == "category" and array.dtype.kind in "iu":
            values = [column.categories[v] if v >= 0 else None for v in values]
        elif column.kind == "time":
            values = _datetimes(column, array.astype("M8[us]").ravel(), count)
        elif array.dtype.kind == "f":
            values = [None if math.isnan(v) else v for v in values]
        lists.append(values)
    for row in zip(*lists, strict=True):
        yield dict(zip(spec.names, row, strict=True))
