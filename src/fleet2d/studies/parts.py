"""Parts of a study's data set: many variants in one Parquet file for each table.

A part is written to a scratch folder and moved into the storage file by file. It counts once its
commit record is written: the names of its files with their sizes and checksums.
"""

import hashlib
import itertools
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from fleet2d.kernels import I32
from fleet2d.studies.records import VARIANT, check_numbers, numbers_of, results_table
from fleet2d.studies.storage import Storage, from_json, writing

if TYPE_CHECKING:
    import pyarrow as pa

    from fleet2d.studies.records import Journal


RECORDS = "parts"
RESULTS = "results"
TABLES = "tables"
ROWS_PER_GROUP = 250_000
GROUPS_IN_MEMORY = 2  # of rows of results


@dataclass(frozen=True)
class PartFile:
    """A file of a part, as its commit record describes it."""

    name: str
    size: int
    sha256: str


@dataclass(frozen=True)
class Part:
    """A committed part.

    Attributes:
        number: Its number, from 1.
        variants: The number of its variants.
        files: Its files.
    """

    number: int
    variants: int
    files: tuple[PartFile, ...]

    @classmethod
    def read(cls, storage: Storage, record: str) -> Self:
        """Return the part that a commit record describes.

        Raises:
            RunDirectoryError: The record is damaged, or names files that aren't of this part.
        """
        with storage.reading(record):
            part: Self = from_json(cls, json.loads(storage.read(record)))
            stem = part_name(part.number)
            files = re.compile(rf"({RESULTS}|{TABLES}/[^/]+)/{stem}\.parquet")
            unknown = [file.name for file in part.files if not files.fullmatch(file.name)]
            if unknown or record != f"{RECORDS}/{stem}.json":
                raise ValueError(f"it is not the record of {', '.join(unknown) or stem}")
        return part

    @property
    def results(self) -> str:
        """The name of the file with its results."""
        return f"{RESULTS}/{part_name(self.number)}.parquet"

    @property
    def tables(self) -> dict[str, str]:
        """The names of the files with its tables, by table."""
        names = (file.name.split("/") for file in self.files)
        return {name[1]: "/".join(name) for name in names if name[0] == TABLES}

    def problem(self, storage: Storage, *, checksums: bool) -> str | None:
        """Return the first problem of its files in words, None if there is none.

        Args:
            storage: The storage of the files.
            checksums: Whether to read the files and compare checksums, beside their sizes.
        """
        for file in self.files:
            size = storage.size(file.name)
            if size is None:
                return f"{file.name} is missing"
            if size != file.size:
                return f"{file.name} has {size} bytes instead of {file.size}"
            if checksums and hashlib.sha256(storage.read(file.name)).hexdigest() != file.sha256:
                return f"{file.name} was changed"
        return None


def part_name(number: int) -> str:
    """Return the name of the files of a part."""
    return f"{number:06d}"


def next_number(parts: Iterable[Part]) -> int:
    """Return the number of the part after these."""
    return max((part.number for part in parts), default=0) + 1


def record_names(storage: Storage) -> list[str]:
    """Return the names of the commit records, in order."""
    return [name for name in storage.names(RECORDS) if name.endswith(".json")]


def read_parts(storage: Storage) -> list[Part]:
    """Return the committed parts, in order.

    Raises:
        RunDirectoryError: A commit record is damaged.
    """
    return [Part.read(storage, name) for name in record_names(storage)]


def write_part(storage: Storage, scratch: Path, number: int, journal: "Journal") -> Part:
    """Write the variants of a journal as a part, and commit it.

    Args:
        storage: The storage of the study.
        scratch: A local folder for unfinished files, on the same disk as a local storage.
        number: The number of the part.
        journal: The records.

    Raises:
        ArtifactError: It can't be written; the journal still holds everything.
    """
    name = part_name(number)
    files = []
    with writing(storage.location):
        scratch.mkdir(parents=True, exist_ok=True)
        for file in scratch.iterdir():  # left by a crash
            file.unlink()
        local_files = _write_files(scratch, name, journal)
    for target, local in local_files.items():
        with local.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
        files.append(PartFile(target, local.stat().st_size, digest))
        storage.publish(local, target)
    part = Part(number, len(journal), tuple(files))
    storage.write(f"{RECORDS}/{name}.json", json.dumps(asdict(part), indent=1).encode())
    return part


def _write_files(scratch: Path, name: str, journal: "Journal") -> dict[str, Path]:
    """Write results and tables; return the local files by their names in the storage."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    results = scratch / f"{name}-results"
    schemas = dict[str, pa.Schema]()
    rows = journal.results()
    first = next(rows)
    with pq.ParquetWriter(results, first.schema, compression="zstd") as file:
        for table in itertools.chain([first], rows):
            file.write_table(table)
    files = {f"{RESULTS}/{name}.parquet": results}
    numbers = sorted(journal.with_tables)
    for record in map(journal.read, numbers):
        for table, rows in record.tables().items():
            schema = plain_schema(rows.schema)
            common = schemas.setdefault(table, schema)
            if common != schema:  # widened, so that all rows fit
                schemas[table] = pa.unify_schemas([common, schema], promote_options="permissive")
    with ExitStack() as stack:
        writers: dict[str, _PartFileWriter] = {}
        for i, (table, schema) in enumerate(schemas.items()):
            local = scratch / f"{name}-table-{i}"
            files[f"{TABLES}/{table}/{name}.parquet"] = local
            writers[table] = stack.enter_context(closing(_PartFileWriter(local, schema)))
        for number in numbers:
            for table, rows in journal.read(number).tables().items():
                writers[table].write(number, rows.read_all())
    return files


class _PartFileWriter:
    """Writes one Parquet file of a table. A row group holds the rows of one or more variants."""

    def __init__(self, path: Path, schema: "pa.Schema") -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._schema = schema.insert(0, pa.field(VARIANT, pa.int32(), nullable=False))
        self._writer: pq.ParquetWriter = pq.ParquetWriter(path, self._schema, compression="zstd")
        self._buffer: list[pa.Table] = []

    def write(self, number: int, rows: "pa.Table") -> None:
        """Add the rows of a variant."""
        self._buffer.append(with_variant(rows, number, self._schema))
        if sum(table.num_rows for table in self._buffer) >= ROWS_PER_GROUP:
            self._flush()

    def close(self) -> None:
        """Write the rest."""
        self._flush()
        self._writer.close()

    def _flush(self) -> None:
        import pyarrow as pa

        if self._buffer:
            table = pa.concat_tables(self._buffer)
            self._writer.write_table(table, row_group_size=max(table.num_rows, 1))
            self._buffer = []


def with_variant(rows: "pa.Table", number: int, schema: "pa.Schema") -> "pa.Table":
    """Return the rows of a variant in the schema of the data set, with a column of its number."""
    import pyarrow as pa

    count = rows.num_rows
    columns = []
    for field in schema:
        if field.name == VARIANT:
            columns.append(pa.repeat(pa.scalar(number, pa.int32()), count))
        elif field.name in rows.column_names:
            columns.append(rows.column(field.name).cast(field.type))
        else:
            columns.append(pa.nulls(count, field.type))
    return pa.table(columns, schema=schema)


def plain_schema(schema: "pa.Schema") -> "pa.Schema":
    """Return a schema without dictionary types: their words differ between homes."""
    import pyarrow as pa

    fields = []
    for field in schema:
        kind = field.type.value_type if pa.types.is_dictionary(field.type) else field.type
        unit = (field.metadata or {}).get(b"unit")
        fields.append(pa.field(field.name, kind, True, {"unit": unit} if unit else None))
    return pa.schema(fields)


def read_results(
    storage: Storage, parts: Iterable[Part], columns: Sequence[str] | None = None
) -> "Iterator[pa.Table]":
    """Yield the results of each part, or some of their columns.

    Raises:
        RunDirectoryError: They are missing or damaged.
    """
    import pyarrow as pa

    for part in parts:
        schema = _results_schema(storage, part)
        if columns is not None:
            schema = pa.schema([schema.field(name) for name in columns])
        table = storage.read_table(part.results, schema.names)
        with storage.reading(part.results):
            table = table.select(schema.names).cast(schema)
            check_numbers(table)
            yield table


def _results_schema(storage: Storage, part: Part) -> "pa.Schema":
    """Return the columns of the results of a part, with the types that readers rely on."""
    import pyarrow as pa

    types = {field.name: field.type for field in results_table(()).schema}
    with storage.parquet(part.results) as file:
        names = file.schema_arrow.names
        if not types.keys() <= set(names):
            raise ValueError("it has no results of variants")
    return pa.schema([(name, types.get(name, pa.float64())) for name in names])


class ResultRows:
    """The newest result of each variant, looked up without having all in memory."""

    def __init__(
        self, storage: Storage, parts: Sequence[Part], headers: Iterable[Mapping[str, Any]]
    ) -> None:
        """Note where the result of each variant is.

        Args:
            storage: The storage of the study.
            parts: The parts with results.
            headers: The headers of the records of a journal, which are newer.

        Raises:
            RunDirectoryError: Results are missing or damaged.
        """
        import pyarrow as pa

        self._storage, self._parts = storage, parts
        self._newest = results_table(headers)
        schemas = [_results_schema(storage, part) for part in parts]
        if self._newest.num_rows or not parts:
            schemas.append(self._newest.schema)
        self._schema = pa.unify_schemas(schemas)
        numbers = [numbers_of(t) for t in read_results(storage, parts, (VARIANT,))]
        numbers.append(numbers_of(self._newest))
        # Rows are read by groups of a file; the last group is the journal.
        sizes = [storage.row_groups(part.results) for part in parts]
        self._groups = [(p, i) for p, of_part in enumerate(sizes) for i in range(len(of_part))]
        self._first = np.cumsum([0, *(size for of_part in sizes for size in of_part)])
        self._read = lru_cache(GROUPS_IN_MEMORY)(self._read_group)
        count = 1 + max((int(part.max(initial=-1)) for part in numbers), default=-1)
        self._row = np.full(count + 1, -1, np.int32)  # by number, over all parts; last: none
        rows = np.concatenate(numbers)
        self._row[rows] = np.arange(len(rows))

    def of(self, numbers: I32) -> "pa.Table":
        """Return the results of variants, a row each; without values where there are none."""
        import pyarrow as pa

        from fleet2d.artifacts.arrow import number_array

        rows = self._row[np.where(numbers < len(self._row), numbers, -1)]
        groups = np.searchsorted(self._first, rows, side="right") - 1
        places = np.full(len(numbers), -1)
        before = 0
        tables = [pa.Table.from_batches([], self._schema)]
        for group in np.unique(groups[rows >= 0]).tolist():
            here = np.flatnonzero(groups == group)
            in_group = number_array(rows[here] - self._first[group], pa.int64())
            tables.append(self._read(group).take(in_group))
            places[here] = before + np.arange(len(here))
            before += len(here)
        table = pa.concat_tables(tables, promote_options="default")
        return table.take(number_array(places, pa.int64(), places < 0))

    def _read_group(self, group: int) -> "pa.Table":
        if group == len(self._groups):
            return self._newest
        part, number = self._groups[group]
        name = self._parts[part].results
        schema = _results_schema(self._storage, self._parts[part])
        with self._storage.parquet(name) as file:
            table = file.read_row_group(number, use_threads=False)
            return table.select(schema.names).cast(schema)
