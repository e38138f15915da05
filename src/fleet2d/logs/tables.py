"""Tables of logs: CSV of any dialect, Parquet and JSON Lines, with units in names of columns."""

import codecs
import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from fleet2d.bounds import (
    FIXES,
    LOG_BYTES,
    TABLE_BYTES,
    check_file,
    one_line,
    read_bytes,
    unpacked_bytes,
)
from fleet2d.configuration.problems import did_you_mean
from fleet2d.configuration.units import ANGLE, DURATION, LENGTH
from fleet2d.kernels import F64, I64, Bool
from fleet2d.logs.log import LogError, encoding_of
from fleet2d.logs.times import Stamps, parse_numbers, parse_texts

NAMES = {
    "time": ("time", "timestamp", "t", "datetime"),
    "id": ("id", "tag", "tag_id", "name", "entity"),
    "x": ("x", "pos_x", "position_x"),
    "y": ("y", "pos_y", "position_y"),
    "heading": ("heading", "theta", "yaw"),
}
"""The names that a column may have, if the user gives none; a unit may follow, as in x [mm]."""

ZONES = ("utc", "gmt")
"""What the name of a column of times may tell in place of a unit."""

UNITS = {
    "time": {**DURATION.units, "ns": Fraction(1, 10**9), **dict.fromkeys(ZONES, Fraction(1))},
    "x": {**LENGTH.units, "ft": Fraction("0.3048")},
    "heading": ANGLE.units,
}
"""The units that the name of a column may tell, of a time, a coordinate and an angle."""
UNITS["y"] = UNITS["x"]

WORDS = frozenset({"id", "room", "sensor", "state", "user"})
"""The quantities that are text."""

# Cells without a value, as spreadsheets and programs write them.
_EMPTY = pa.array(["", "#N/A", "N/A", "NA", "NULL", "NaN", "None", "nan", "null"])
_UNIT = re.compile(r"(.+?)\s*(?:\[\s*([^\[\]]+?)\s*\]|\(\s*([^()]+?)\s*\)|[_\s]([^\W_]+|°))")
_COMMA = r"^[-+]?\d*,\d+(?:[eE][-+]?\d+)?$"
_THOUSANDS = r"^[-+]?[1-9]\d{0,2},\d{3}$"
_DIGITS = r"^[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?$"
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf)"
# Numbers that a spreadsheet has rounded, such as 1.58313E+12.
_ROUNDED = r"^\d[.,]\d+E\+\d+$"


def read_table(path: Path) -> tuple[pa.Table, I64]:
    """Read a CSV, Parquet or JSON Lines file within its bounds.

    Cells of CSV stay text: 007 and 7 differ.

    Returns:
        The rows, and the line of each in the file, int64 (n,).

    Raises:
        LogError: It can't be read, or is beyond a bound.
    """
    try:
        check_file(path, LOG_BYTES, LogError)
        if path.suffix.lower() in (".parquet", ".pq"):
            with pq.ParquetFile(path) as file:
                FIXES.check(file.metadata.num_rows, path, LogError)
                TABLE_BYTES.check(unpacked_bytes(file), path, LogError, prefix="about ")
                table = file.read()
        elif path.suffix.lower() in (".jsonl", ".ndjson"):
            import pyarrow.json as pajson

            table = pajson.read_json(path)
        else:
            return _read_csv(path)
        FIXES.check(table.num_rows, path, LogError)
        _ = table.column_names
    except (UnicodeDecodeError, pa.ArrowException, OSError) as error:
        if isinstance(error, UnicodeDecodeError) or "invalid UTF8" in str(error):
            raise LogError(f"{path} is not text in UTF-8: save it as CSV in UTF-8") from None
        raise LogError(f"{path} can't be read: {one_line(error, 200)}") from error
    return table, np.arange(1, table.num_rows + 1)


def _read_csv(path: Path) -> tuple[pa.Table, I64]:
    """Read a CSV file with commas, semicolons or tabs, in UTF-8 or UTF-16, all cells as text."""
    content = read_bytes(path, LOG_BYTES, LogError)
    encoding = encoding_of(path)
    if encoding == "utf-16":
        content = content.decode(encoding).encode()
    content = content.removeprefix(codecs.BOM_UTF8)
    head, _, rest = content.partition(b"\n")
    names_excel = head.lower().startswith(b"sep=")  # so Excel names the delimiter
    if names_excel:
        delimiter = head.decode().strip()[4:] or "\t"
        content = rest
    else:
        delimiter = max("\t;,", key=re.sub('"[^"]*"', "", head.decode()).count)
    names: list[str] = next(_rows(content.partition(b"\n")[0], delimiter), [])
    has_quotes = b'"' in content
    table = pacsv.read_csv(
        pa.BufferReader(content),
        parse_options=pacsv.ParseOptions(delimiter=delimiter, newlines_in_values=has_quotes),
        convert_options=pacsv.ConvertOptions(column_types=dict.fromkeys(names, pa.string())),
    )
    FIXES.check(table.num_rows, path, LogError)
    line = np.arange(2, table.num_rows + 2)
    if has_quotes or b"\n\n" in content or b"\n\r\n" in content:
        line = _first_lines(_rows(content, delimiter))
    return table, line + names_excel


def _rows(content: bytes, delimiter: str) -> Any:
    return csv.reader(io.StringIO(content.decode(), newline=""), delimiter=delimiter)


def _first_lines(rows: Any) -> I64:
    """Return the line in which each row after the head begins; blank lines are no rows."""
    lines = []
    begin = 1
    for row in rows:
        if row:
            lines.append(begin)
        begin = rows.line_num + 1
    return np.array(lines[1:], np.int64)


def _named_unit(column: str, quantity: str) -> tuple[str, str | None]:
    """Return the name of a column in lower case without its unit, and the unit; None: it has none.

    >>> _named_unit("Position X [mm]", "x"), _named_unit("pos_x", "x")
    (('position_x', 'mm'), ('pos_x', None))
    """
    name = column.strip().lower()
    unit = None
    match = _UNIT.fullmatch(name)
    if match and (told := match[2] or match[3] or match[4]) in UNITS.get(quantity, {}):
        name = match[1]
        unit = told
    return re.sub(r"[\s-]+", "_", name.strip()), unit


@dataclass(frozen=True)
class LogTable:
    """A table of a log.

    Attributes:
        path: Its file.
        rows: Its rows.
        named: The name of the column of each quantity, such as time or x.
        line: The line of each row in the file, int64 (n,).
        decimal_comma: Whether numbers have a comma as decimal mark; None: the file has to show it.
        day_first: Whether 03/04/2026 is in April; None: the file has to show it.
    """

    path: Path
    rows: pa.Table
    named: Mapping[str, str]
    line: I64
    decimal_comma: bool | None = None
    day_first: bool | None = None

    @classmethod
    def read(
        cls,
        path: Path,
        columns: Mapping[str, str] | None,
        usual: Mapping[str, Sequence[str]] = NAMES,
        needed: Sequence[str] = ("time", "x", "y"),
        *,
        decimal_comma: bool | None = None,
        day_first: bool | None = None,
    ) -> Self:
        """Read a file.

        Args:
            path: The file.
            columns: The names of columns that the user gives; None: the user can't give any.
            usual: The names that the column of each quantity may have besides.
            needed: The quantities without which it can't be read.
            decimal_comma: Whether numbers have a comma as decimal mark; None: shown by the file.
            day_first: Whether 03/04/2026 is in April; None: shown by the file.

        Raises:
            LogError: It can't be read, a quantity is unknown, or one that is needed has no column.
        """
        rows, line = read_table(path)
        known = rows.column_names
        named = dict(columns or {})
        if len(set(known)) < len(known):
            twice = next(name for name in known if known.count(name) > 1)
            raise LogError(f"{path} has two columns {twice!r}: rename one of them")
        for quantity, name in named.items():
            if quantity not in usual:
                raise LogError(
                    f"columns: unknown key {quantity!r}; allowed here: {', '.join(usual)}"
                )
            if name not in known:
                raise LogError(f"{path} has no column {name!r}{did_you_mean(name, known)}")
        for quantity in (quantity for quantity in usual if quantity not in named):
            bases = {column: _named_unit(column, quantity)[0] for column in known}
            name = next((name for name in usual[quantity] if name in bases.values()), "")
            fitting = [column for column in known if bases[column] == name]
            if len(fitting) > 1:
                rename = "rename the others"
                say = f"say which it is by columns: {{{quantity}: {fitting[0]}}}"
                raise LogError(
                    f"{path} has several columns of {quantity}, {' and '.join(fitting)}:"
                    f" {rename if columns is None else say}"
                )
            if fitting:
                named[quantity] = fitting[0]
            elif quantity in needed:
                say = f"Say which it is by columns: {{{quantity}: …}}"
                raise LogError(
                    f"{path} has no column {quantity!r}; it has: {', '.join(known)}."
                    f" {'Rename the one that it is' if columns is None else say}"
                )
        return cls(path, rows, named, line, decimal_comma, day_first)

    def column(self, quantity: str) -> pa.Array:
        """Return the column of a quantity; texts without blanks around them."""
        column = self.rows[self.named[quantity]].combine_chunks()
        if pa.types.is_dictionary(column.type):
            column = column.cast(column.type.value_type)
        if _is_text(column):
            column = pc.utf8_trim_whitespace(column.cast(pa.string()))
        return column

    def unit(self, quantity: str) -> str | None:
        """Return the unit that the name of a quantity's column tells, if it does."""
        return _named_unit(self.named[quantity], quantity)[1] if quantity in self.named else None

    def texts(self, quantity: str) -> pa.Array:
        """Return the column of a quantity as texts, such as ids; whole numbers as their digits.

        Raises:
            LogError: It holds something else, so that different texts may have become equal.
        """
        column = self.column(quantity)
        name = self.named[quantity]
        if pa.types.is_floating(column.type) or pa.types.is_temporal(column.type):
            raise LogError(
                f"{self.path}: the column {name!r} holds {column.type}: write names and ids as text"
            )
        texts = column.cast(pa.string())
        rounded = _where(pc.match_substring_regex(texts, _ROUNDED))
        if len(rounded):
            raise LogError(
                f"{self.path}, line {self.line[rounded[0]]}: {texts[rounded[0]].as_py()!r} in"
                f" column {name!r} was rounded by a spreadsheet: export it as text"
            )
        return texts

    def numbers(self, quantity: str) -> F64:
        """Return a column of numbers, float64 (n,); NaN where it is empty."""
        column = self.column(quantity)
        if _is_text(column):
            column = pc.if_else(pc.is_in(column, value_set=_EMPTY), "nan", column)
            texts = self._with_points(column, quantity)
            try:
                column = texts.cast(pa.float64())
            except pa.ArrowException:
                wrong = next(
                    at for at, text in enumerate(texts.to_pylist()) if not _is_number(text)
                )
                raise self._no_number(quantity, wrong) from None
        try:
            numbers = pc.fill_null(column.cast(pa.float64()), float("nan"))
        except pa.ArrowException:
            raise LogError(
                f"{self.path}: column {self.named[quantity]!r} holds {column.type}, not numbers"
            ) from None
        return numbers.to_numpy(zero_copy_only=False).astype(np.float64)

    def _no_number(self, quantity: str, row: int) -> LogError:
        text = one_line(repr(self.column(quantity)[row].as_py()))
        return LogError(
            f"{self.path}, line {self.line[row]}: expected a number in column"
            f" {self.named[quantity]!r}, got {text}"
        )

    def _with_points(self, texts: pa.Array, quantity: str) -> pa.Array:
        """Return numbers in text with points as decimal marks.

        Raises:
            LogError: They have separators of thousands.
        """
        if not self._has_decimal_commas:
            return texts
        pointed = _where(pc.match_substring(texts, "."))
        if len(pointed):
            raise self._no_number(quantity, pointed[0])
        return pc.replace_substring(texts, ",", ".")

    @cached_property
    def _has_decimal_commas(self) -> bool:
        """Whether a comma is the decimal mark of all numbers of the file.

        Raises:
            LogError: It may separate thousands as well.
        """
        if self.decimal_comma is not None:
            return self.decimal_comma
        columns = [self.column(q) for q in self.named if q not in WORDS]
        texts = [column for column in columns if _is_text(column)]
        with_comma = [column.filter(pc.match_substring_regex(column, _COMMA)) for column in texts]
        numbers = pa.chunked_array(with_comma, pa.string())
        if not len(numbers) or not pc.all(pc.match_substring_regex(numbers, _THOUSANDS)).as_py():
            return len(numbers) > 0
        row = max(pc.index(column, numbers[0]).as_py() for column in texts)
        raise LogError(
            f"{self.path}, line {self.line[row]}: {numbers[0].as_py()!r} may be a thousand times as"
            " much: say 'decimal_comma: true' if a comma is the decimal mark, or false"
        )

    @property
    def unit_m(self) -> float | None:
        """The unit of x and y [m], as the names of their columns tell; None: they don't.

        Raises:
            LogError: They tell different ones.
        """
        unit = self.unit("x")
        other = self.unit("y")
        if unit != other:
            raise LogError(
                f"{self.path}: x and y have different units: {self.named['x']} and"
                f" {self.named['y']}"
            )
        return None if unit is None else float(UNITS["x"][unit])

    def headings(self) -> F64:
        """Return the headings [rad], float64 (n,); NaN where there is none.

        Raises:
            LogError: Without a unit, one is more than a turn.
        """
        if "heading" not in self.named:
            return np.full(len(self.line), np.nan)
        heading = self.numbers("heading")
        unit = self.unit("heading")
        wide = np.flatnonzero(np.abs(heading) > 2 * np.pi)
        if unit is None and len(wide):
            name = self.named["heading"]
            raise LogError(
                f"{self.path}, line {self.line[wide[0]]}: the heading {heading[wide[0]]:g} is more"
                f" than a turn: is it in degrees? Name its column {name}_deg or {name}_rad"
            )
        if unit in (None, "rad"):
            return heading
        return heading * float(UNITS["heading"][unit]) / 180 * np.pi

    def stamps(self) -> Stamps:
        """Return the times of the rows; those with a zone are UTC."""
        column = self.column("time")
        path = self.path
        line = self.line
        kind = column.type
        unit = self.unit("time")
        is_utc = unit in ZONES
        unit_s = None if unit is None or is_utc else float(UNITS["time"][unit])
        is_empty = pc.is_null(column)
        if _is_text(column):
            is_empty = pc.or_kleene(is_empty, pc.is_in(column, value_set=_EMPTY))
        empty = _where(is_empty)
        if len(empty):
            raise LogError(f"{path}, line {line[empty[0]]}: it has no time")
        if _is_text(column):
            is_number = pc.match_substring_regex(column, _DIGITS)
            if not pc.any(is_number).as_py():
                return parse_texts(column, path, line, is_utc=is_utc, day_first=self.day_first)
            other = _where(pc.invert(is_number))
            if len(other):
                raise LogError(
                    f"{path}, line {line[other[0]]}: expected a number, as in other lines, got"
                    f" {one_line(column[other[0]].as_py())!r}"
                )
            return parse_numbers(self._exact_times(column), path, line, unit_s)
        if pa.types.is_timestamp(kind):
            values = pc.cast(column, pa.timestamp("us", kind.tz), safe=False)
            time_us = pc.cast(values, pa.int64()).to_numpy()
            return Stamps(time_us, line, True, is_utc or kind.tz is not None)
        if pa.types.is_integer(kind) or pa.types.is_floating(kind):
            return parse_numbers(column.to_numpy(), path, line, unit_s)
        raise LogError(f"{path}: expected times as text, timestamps or numbers, got {kind}")

    def _exact_times(self, texts: pa.Array) -> Any:
        """Return times in digits as numbers.

        Raises:
            LogError: A spreadsheet has rounded them, or they are times of day like 080000.
        """
        wrong = _where(pc.match_substring_regex(texts, r"[eE]|^0\d"))
        if len(wrong):
            raise LogError(
                f"{self.path}, line {self.line[wrong[0]]}: expected a time like '2011-06-15"
                f" 01:03:39' or a number of seconds in digits, got {texts[wrong[0]].as_py()!r}"
            )
        texts = self._with_points(texts, "time")
        try:
            return texts.cast(pa.int64()).to_numpy()
        except pa.ArrowException:
            return texts.cast(pa.float64()).to_numpy()

    def where(self, is_kept: Bool) -> Self:
        """Return the table with some of its rows: bool (n,)."""
        return replace(self, rows=self.rows.filter(pa.array(is_kept)), line=self.line[is_kept])

    def rows_of(self, quantity: str, name: str | None) -> Bool:
        """Return which rows are of one of several names in a column; None: of the only one.

        Raises:
            LogError: There is no such name, or there are several.
        """
        texts = pc.fill_null(self.texts(quantity), "")
        known = sorted(pc.unique(texts).to_pylist())
        listed = ", ".join(text or "(none)" for text in known[:10])
        if name is None and len(known) > 1:
            raise LogError(
                f"{self.path} holds {len(known)} {quantity}s: {listed}: select one by {quantity!r}"
            )
        if name is not None and name not in known:
            near = did_you_mean(name, known)
            raise LogError(f"{self.path} has no {quantity} {name!r}{near} There are: {listed}")
        if len(known) <= 1:
            return np.ones(len(texts), bool)
        return np.asarray(pc.equal(texts, name).to_numpy(zero_copy_only=False), bool)


def _is_text(column: pa.Array) -> bool:
    kind: Any = column.type
    return pa.types.is_string(kind) or pa.types.is_large_string(kind)


def _is_number(text: str | None) -> bool:
    return text is None or re.fullmatch(_NUMBER, text) is not None


def _where(is_true: pa.Array) -> I64:
    """Return the rows that are true, int64 (n,)."""
    return np.flatnonzero(pc.fill_null(is_true, False).to_numpy(zero_copy_only=False))
