"""Conversion between chunks and Arrow: schemas, tables, Parquet files."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from fleet2d.artifacts.table import (
    DTYPES,
    Chunk,
    Column,
    ColumnChunk,
    Kind,
    TableSpec,
    Words,
    empty_chunk,
    encode_strings,
)
from fleet2d.bounds import TABLE_BYTES, unpacked_bytes
from fleet2d.errors import ArtifactError
from fleet2d.kernels import Bool
from fleet2d.storage import files
from fleet2d.storage.files import PARTIAL

# Arrow counts the bytes of text in an array in 32 bits.
MAX_TEXT_BYTES = 2**31 - 1

_TYPES = {
    "step": pa.int64(),
    "time": pa.timestamp("us"),
    "int32": pa.int32(),
    "int64": pa.int64(),
    "float64": pa.float64(),
    "bool": pa.bool_(),
    "category": pa.dictionary(pa.int32(), pa.string()),
    "string": pa.string(),
}


def _type_of(column: Column) -> pa.DataType:
    """Return the type of a column; times of a time zone are instants."""
    has_zone = column.kind == "time" and column.unit
    return pa.timestamp("us", column.unit) if has_zone else _TYPES[column.kind]


def schema_of(spec: TableSpec) -> pa.Schema:
    """Return the Arrow schema of a table; its metadata holds the whole spec."""
    fields = [_field_of(column) for column in spec.columns]
    return pa.schema(fields, {"fleet2d.table": spec.name, "description": spec.description})


def spec_of(schema: pa.Schema) -> TableSpec:
    """Return the spec that the metadata of a schema holds.

    Raises:
        ArtifactError: The schema is not one that `schema_of` made.
    """
    try:
        columns = [_column_of(field) for field in schema]
        name = schema.metadata[b"fleet2d.table"].decode()
        return TableSpec(name, tuple(columns), schema.metadata[b"description"].decode())
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ArtifactError("this table was not stored by Fleet2D: read it with pyarrow") from error


def _field_of(column: Column) -> pa.Field:
    texts = {
        "kind": column.kind,
        "unit": column.unit,
        "description": column.description,
        "categories": json.dumps(column.categories) if column.categories else "",
    }
    metadata = {key: text for key, text in texts.items() if text}
    return pa.field(column.name, _type_of(column), column.nullable, metadata)


def _column_of(field: pa.Field) -> Column:
    metadata = {key.decode(): value.decode() for key, value in field.metadata.items()}
    return Column(
        field.name,
        cast(Kind, metadata["kind"]),  # Column refuses an unknown kind
        unit=metadata.get("unit", ""),
        nullable=field.nullable,
        categories=tuple(json.loads(metadata.get("categories", "[]"))),
        description=metadata.get("description", ""),
    )


def table_of(
    chunks: Sequence[tuple[Chunk, int]],
    spec: TableSpec,
    words: Words,
    schema: pa.Schema | None = None,
) -> pa.Table:
    """Return chunks, each with its number of rows, as one Arrow table."""
    columns = []
    for column in spec.columns:
        names = words[column.name].in_order() if column.is_growing else column.categories
        dictionary = string_array(names) if column.kind == "category" else None
        parts = [_array_of(chunk[column.name], column, dictionary) for chunk, _ in chunks]
        columns.append(pa.chunked_array(parts, _type_of(column)))
    return pa.Table.from_arrays(columns, schema=schema or schema_of(spec))


def _array_of(chunk: ColumnChunk, column: Column, dictionary: pa.Array | None) -> pa.Array:
    """Wrap the values of a column, without a copy where Arrow allows it."""
    missing = None if chunk.valid is None or chunk.valid.all() else ~chunk.valid
    if chunk.lengths is not None:
        ends = np.zeros(len(chunk.lengths) + 1, np.int64)
        np.cumsum(chunk.lengths, out=ends[1:])
        if ends[-1] > MAX_TEXT_BYTES:
            raise ArtifactError(
                f"{column.name} is more than 2 GiB of text at once: append fewer rows at a time"
            )
        # Casting large strings would be simpler, but imports pyarrow.compute: a tenth of a second.
        offsets = pa.py_buffer(ends.astype(np.int32))
        text = pa.py_buffer(np.ascontiguousarray(chunk.values))
        bitmap = None if missing is None else _bits(~missing)
        return pa.StringArray.from_buffers(len(chunk.lengths), offsets, text, bitmap)
    if dictionary is not None:
        codes = number_array(chunk.values, pa.int32(), missing)
        return pa.DictionaryArray.from_arrays(codes, dictionary)
    return number_array(chunk.values, _type_of(column), missing)


def number_array(values: NDArray[Any], kind: pa.DataType, missing: Bool | None = None) -> pa.Array:
    """Wrap numbers or booleans as they lie in memory.

    `pa.array` would be simpler, but imports pandas if installed: a quarter of a second.
    """
    data = _bits(values) if kind == pa.bool_() else pa.py_buffer(np.ascontiguousarray(values))
    bitmap = None if missing is None else _bits(~missing)
    return pa.Array.from_buffers(kind, len(values), [bitmap, data])


def string_array(words: Sequence[str | None]) -> pa.Array:
    """Return texts, or None where there is none, as an array; see `number_array`."""
    chunk = encode_strings(words, nullable=None in words)
    return _array_of(chunk, Column("words", "string"), None)


def _bits(flags: Bool) -> pa.Buffer:
    return pa.py_buffer(np.packbits(flags, bitorder="little"))


def chunks_of(table: pa.Table, spec: TableSpec, words: Words) -> Iterator[tuple[Chunk, int]]:
    """Yield the rows of a table as chunks, and the number of rows of each.

    Raises:
        ArtifactError: The table's columns are not those of the spec.
    """
    if tuple(table.column_names) != spec.names:
        raise ArtifactError(
            f"table {spec.name!r} should have the columns {', '.join(spec.names)}, "
            f"but has {', '.join(table.column_names)}"
        )
    for batch in table.to_batches():
        arrays = zip(spec.columns, batch.columns, strict=True)
        chunk = {column.name: _chunk_of(array, column, words) for column, array in arrays}
        yield chunk, batch.num_rows


def _chunk_of(array: pa.Array, column: Column, words: Words) -> ColumnChunk:
    """Convert an Arrow array to the form that is hashed, with zeros for nulls."""
    if not len(array):
        return empty_chunk(column)
    valid = array.is_valid().to_numpy(zero_copy_only=False) if column.nullable else None
    if column.kind == "category":
        return ColumnChunk(_codes_of(array, column, words), valid)
    if column.kind == "string":
        strings = array.cast(pa.large_string()).fill_null("")
        _, offsets, data = strings.buffers()
        ends = np.frombuffer(offsets, np.int64)[strings.offset :][: len(strings) + 1]
        text = np.empty(0, np.uint8) if data is None else np.frombuffer(data, np.uint8)
        return ColumnChunk(text[ends[0] : ends[-1]], valid, np.diff(ends))
    if column.kind == "time":
        in_us = array.cast(pa.timestamp("us", array.type.tz))
        array = in_us.cast(pa.int64())
    if array.null_count:
        array = array.fill_null(False if column.kind == "bool" else 0)
    values = array.to_numpy(zero_copy_only=False)
    return ColumnChunk(values.astype(DTYPES[column.kind], casting="safe", copy=False), valid)


def _codes_of(array: pa.Array, column: Column, words: Words) -> Any:
    """Return the codes of an array, converted from its own dictionary to that of the column."""
    if not pa.types.is_dictionary(array.type):
        array = array.dictionary_encode()
    names = array.dictionary.to_pylist()
    if names == list(column.categories):
        return array.indices.fill_null(0).to_numpy(zero_copy_only=False)
    code_of: dict[str, int] = {name: code for code, name in enumerate(column.categories)}
    codes = array.indices.fill_null(-1).to_numpy(zero_copy_only=False)
    used, first = np.unique(codes[codes >= 0], return_index=True)
    column_codes = np.zeros(len(names) + 1, np.int32)  # the last one is for -1, a missing value
    for code in used[np.argsort(first, kind="stable")]:
        name = names[code]
        if not column.is_growing and name not in code_of:
            raise ArtifactError(f"column {column.name!r} has no category {name!r}")
        column_codes[code] = words[column.name][name] if column.is_growing else code_of[name]
    return column_codes[codes]


def values_of(column: pa.ChunkedArray) -> NDArray[Any]:
    """Return the values of a stored column without nulls: numbers, times, flags, or names.

    Times are int64, in microseconds; names are objects. `to_numpy` would be simpler, but imports
    pandas if installed: a quarter of a second.

    Raises:
        ValueError: A value is missing.
    """
    parts = [_values_of(chunk) for chunk in column.chunks if len(chunk)]
    return np.concatenate(parts) if parts else np.zeros(0)


def _values_of(array: pa.Array) -> NDArray[Any]:
    if array.null_count:
        raise ValueError("a value is missing")
    if pa.types.is_dictionary(array.type):
        words = np.array(array.dictionary.to_pylist(), object)
        return cast(NDArray[Any], words[_values_of(array.indices)])
    if pa.types.is_string(array.type):
        return np.array(array.to_pylist(), object)
    _, content = array.buffers()
    if pa.types.is_boolean(array.type):
        flags = np.unpackbits(np.frombuffer(content, np.uint8), bitorder="little")
        return flags[array.offset :][: len(array)].astype(bool)
    stored = pa.timestamp("us") if pa.types.is_timestamp(array.type) else array.type
    dtype = next(DTYPES[kind] for kind, each in _TYPES.items() if each == stored)
    return np.frombuffer(content, dtype, len(array), array.offset * dtype.itemsize)


class ParquetTable:
    """The file of a table that is being written: `NAME.parquet.partial` until it is complete."""

    def __init__(self, directory: Path, spec: TableSpec) -> None:
        """Create the partial file.

        Raises:
            OSError: The file can't be created.
        """
        self.spec = spec
        self.path = directory / f"{spec.name}.parquet"
        self.partial = directory / f"{spec.name}.parquet{PARTIAL}"
        self._is_published = False
        self._schema = schema_of(spec)
        texts = [column.name for column in spec.columns if column.kind in ("category", "string")]
        ascending = [column.name for column in spec.columns if column.kind in ("step", "time")]
        self._writer = pq.ParquetWriter(
            self.partial,
            self._schema,
            compression="zstd",
            compression_level=1,
            use_dictionary=texts,
            column_encoding=dict.fromkeys(ascending, "DELTA_BINARY_PACKED"),
        )

    def write(self, chunk: Chunk, rows: int, words: Words) -> None:
        """Write one row group."""
        table = table_of([(chunk, rows)], self.spec, words, self._schema)
        self._writer.write_table(table, row_group_size=max(rows, 1))

    def finish(self) -> None:
        """Complete the file and flush it to the disk; it keeps its partial name."""
        if self._is_published:
            return
        self._writer.close()
        with self.partial.open("rb+") as file:
            files.sync(file.fileno())

    def publish(self) -> None:
        """Rename the finished temporary file to its final name."""
        if not self._is_published:
            files.replace(self.path, self.partial)
            self._is_published = True

    def abandon(self) -> None:
        """Close the file, which stays partial."""
        try:
            self._writer.close()
        except OSError:  # the disk is still full
            self._writer.is_open = False

    def empty(self) -> bool:
        """Free the disk space of a file that can't be completed; return whether that worked."""
        try:
            os.truncate(self.partial, 0)
        except OSError:
            return False
        return True


def read_parquet(path: Path, kinds: Mapping[str, Kind] | None = None) -> pa.Table:
    """Read a table from its file; the chunks of a category column share one dictionary.

    Args:
        path: The file.
        kinds: The columns that it should have, and their kinds; None: any.

    Raises:
        ArtifactError: The file is missing, cut off or otherwise damaged.
    """
    with _opened(path) as file:
        if kinds is not None:
            _check_columns(path, file.schema_arrow, kinds)
        TABLE_BYTES.check(unpacked_bytes(file), path, ArtifactError, prefix="about ")
        table = file.read()
    return with_categories(table)


def _check_columns(path: Path, schema: pa.Schema, kinds: Mapping[str, Kind]) -> None:
    """Refuse a table whose columns differ from those in the manifest."""
    if schema.names != list(kinds):
        raise ArtifactError(
            f"{path} has the columns {', '.join(schema.names)}, but {', '.join(kinds)} were stored:"
            " the file was changed"
        )
    for field, kind in zip(schema, kinds.values(), strict=True):
        zone = getattr(field.type, "tz", None)
        stored = pa.timestamp("us", zone) if kind == "time" else _TYPES[kind]
        if field.type != stored:
            raise ArtifactError(
                f"{path}: the column {field.name} is {field.type}, but {_TYPES[kind]} was stored:"
                " the file was changed"
            )


def read_row_groups(path: Path) -> Iterator[pa.Table]:
    """Yield a table without rows, then its row groups, so that memory stays small."""
    with _opened(path) as file:
        yield file.schema_arrow.empty_table()
        for group in range(file.num_row_groups):
            TABLE_BYTES.check(unpacked_bytes(file, group), path, ArtifactError, prefix="about ")
            yield file.read_row_group(group)


def count_rows(path: Path) -> int:
    """Return the number of rows in the metadata of a file.

    Raises:
        ArtifactError: The file is missing or cut off.
    """
    with _opened(path) as file:
        return int(file.metadata.num_rows)


@contextmanager
def _opened(path: Path) -> Iterator[pq.ParquetFile]:
    """Open a file; errors in opening or reading it name the file."""
    try:
        with pq.ParquetFile(path) as file:
            yield file
    except FileNotFoundError as error:
        raise ArtifactError(
            f"{path} is missing: the run directory was changed; run the scenario again"
        ) from error
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ArtifactError(
            f"{path} is damaged or cut off ({reason}): copy the run again from where it was whole, "
            "or run the scenario again"
        ) from error


def with_categories(table: pa.Table) -> pa.Table:
    """Give every chunk of a category column the same dictionary: all categories, in order.

    Raises:
        ArtifactError: The table was not stored by Fleet2D, or holds an unknown category.
    """
    for i, column in enumerate(spec_of(table.schema).columns):
        if column.kind != "category":
            continue
        # The unified dictionary begins with that of the first chunk.
        no_codes = number_array(np.empty(0, np.int32), pa.int32(), None)
        first = pa.DictionaryArray.from_arrays(no_codes, string_array(column.categories))
        unified = pa.chunked_array([first, *table.column(i).chunks]).unify_dictionaries()
        chunks = unified.chunks
        names = chunks[0].dictionary
        known = len(column.categories)
        if not column.is_growing and len(names) > known:
            raise ArtifactError(f"column {column.name!r} has no category {names[known].as_py()!r}")
        values = pa.chunked_array(chunks[1:], _TYPES["category"])
        table = table.set_column(i, table.schema.field(i), values)
    return table
