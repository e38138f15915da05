"""The results of variants: rows and tables in Parquet files, many variants in each.

The file of a part's results names the files of its tables, which are written before it: files that
it doesn't name don't count.
"""

import json
import math
import re
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from fleet2d.errors import RunDirectoryError
from fleet2d.studies.storage import Storage

if TYPE_CHECKING:
    import polars as pl
    import pyarrow as pa
    import pyarrow.parquet as pq

    from fleet2d.studies.executors import WorkerTask
    from fleet2d.studies.simulator import VariantOutcome

VARIANT = "variant"
RESULTS = "results"
TABLES = "tables"
PART_ROWS = 5_000  # results of a part
# The size of the tables of a part, in memory.
PART_BYTES = 64_000_000
FLUSH_EVERY_S = 1.0  # maximum loss if the process is killed, unless writing takes long
# The share of the time that may be spent on writing.
FLUSH_SHARE = 0.05
ROWS_PER_GROUP = 250_000
_TEXTS = ("identity", "status", "digest", "error", "trace")
_SECONDS = {"setup_s": "setup", "simulate_s": "simulate", "wall_s": "total"}
RESULT_COLUMNS = (VARIANT, *_TEXTS, "attempts", *_SECONDS, "peak_rss_mb")
"""The columns of the results beside the metrics."""
_FILES = b"fleet2d.tables"
_RESULTS_FILE = rf"{RESULTS}/\d{{6}}\.parquet"
_TABLE_FILE = rf"{TABLES}/[^/]+/\d{{6}}-\d+\.parquet"


@dataclass(frozen=True)
class VariantResult:
    """The results of one variant, as workers send them.

    Attributes:
        row: The columns of the results, and each metric.
        tables: The tables to keep, by name.
    """

    row: Mapping[str, Any]
    tables: "Mapping[str, pa.Table]" = field(default_factory=dict)

    @property
    def is_complete(self) -> bool:
        """Whether the run succeeded."""
        return bool(self.row["status"] == "complete")


def result_of(task: "WorkerTask", outcome: "VariantOutcome") -> VariantResult:
    """Return the outcome of a task as a result; numbers that are not finite are missing."""
    row: dict[str, Any] = {
        VARIANT: task.number,
        "identity": task.identity,
        "status": outcome.status,
        "digest": outcome.digest,
        "error": outcome.error,
        "trace": outcome.trace,
        "attempts": 1,
    }
    row |= {name: outcome.wall_s.get(phase) for name, phase in _SECONDS.items()}
    row["peak_rss_mb"] = outcome.peak_rss_mb
    for name, value in outcome.metrics.items():
        row[name] = value if math.isfinite(value) else None
    return VariantResult(row, outcome.tables)


def results_frame(rows: Iterable[Mapping[str, Any]]) -> "pl.DataFrame":
    """Return results as a data frame, with the types that readers rely on."""
    import polars as pl

    schema: dict[str, Any] = {VARIANT: pl.Int32, **dict.fromkeys(_TEXTS, pl.String)}
    schema |= {"attempts": pl.Int32, **dict.fromkeys((*_SECONDS, "peak_rss_mb"), pl.Float64)}
    listed = list(rows)
    metrics = dict.fromkeys(name for row in listed for name in row if name not in schema)
    return pl.DataFrame(listed, schema={**schema, **dict.fromkeys(metrics, pl.Float64)})


class ResultWriter:
    """Writes results in parts; a growing part is rewritten, each time as a whole."""

    def __init__(self, storage: Storage) -> None:
        """Begin a part after the existing ones."""
        self._storage = storage
        self._number = max(map(part_of, part_names(storage)), default=0)
        self._next_flush_s = 0.0
        self._begin()

    def _begin(self) -> None:
        self._number += 1
        self._version = 0
        self._frame = results_frame(())
        self._new: list[Mapping[str, Any]] = []
        self._tables: dict[str, dict[int, pa.Table]] = {}
        self._files: dict[str, str] = {}

    def add(self, result: VariantResult) -> None:
        """Add the result of a variant, which `flush` writes."""
        number = result.row[VARIANT]
        self._new.append(result.row)
        for name, table in result.tables.items():
            if table.num_rows or table.num_columns:
                self._tables.setdefault(name, {})[number] = plain(table)

    def flush(self, *, now: bool = False) -> None:
        """Write new results, if it is time.

        Raises:
            ArtifactError: They can't be written; earlier results stay.
        """
        import polars as pl

        start_s = time.monotonic()
        is_due = now or start_s >= self._next_flush_s or len(self._new) >= PART_ROWS
        if not self._new or not is_due:
            return
        frames = [self._frame, results_frame(self._new)]
        self._frame = pl.concat(frames, how="diagonal")
        self._new = []
        self._version += 1
        files = {name: self._write_table(name) for name in self._tables}
        rows = self._frame.sort(VARIANT).to_arrow()
        rows = rows.replace_schema_metadata({_FILES: json.dumps(files)})
        self._storage.write_table(f"{RESULTS}/{self._number:06d}.parquet", [rows])
        for old in self._files.values():
            self._storage.delete(old)
        self._files = files
        size = sum(table.nbytes for of_all in self._tables.values() for table in of_all.values())
        if len(self._frame) >= PART_ROWS or size >= PART_BYTES:
            self._begin()
        duration_s = time.monotonic() - start_s
        self._next_flush_s = start_s + max(FLUSH_EVERY_S, duration_s / FLUSH_SHARE)

    def _write_table(self, name: str) -> str:
        """Write the rows of all variants of the part; return the name of the file."""
        import pyarrow as pa

        of_all = self._tables[name]
        tables = [with_variant(of_all[number], number) for number in sorted(of_all)]
        file = f"{TABLES}/{name}/{self._number:06d}-{self._version:04d}.parquet"
        rows = pa.concat_tables(tables, promote_options="permissive")
        self._storage.write_table(file, [rows], ROWS_PER_GROUP)
        return file


def part_names(storage: Storage) -> list[str]:
    """Return the names of the files of results, in order."""
    return [name for name in storage.names(RESULTS) if re.fullmatch(_RESULTS_FILE, name)]


def part_of(name: str) -> int:
    """Return the number of the part of a file of results.

    >>> part_of("results/000012.parquet")
    12
    """
    return int(name.rpartition("/")[2].partition(".")[0])


def plain(table: "pa.Table") -> "pa.Table":
    """Return a table without dictionary types, whose words differ between homes."""
    import pyarrow as pa

    fields = []
    for column in table.schema:
        kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
        unit = (column.metadata or {}).get(b"unit")
        fields.append(pa.field(column.name, kind, True, {"unit": unit} if unit else None))
    return table.cast(pa.schema(fields))


def with_variant(rows: "pa.Table", number: int) -> "pa.Table":
    """Return the rows of a variant with its number as the first column."""
    import pyarrow as pa

    numbers = pa.repeat(pa.scalar(number, pa.int32()), rows.num_rows)
    return rows.add_column(0, pa.field(VARIANT, pa.int32(), nullable=False), numbers)


def read_results(
    storage: Storage,
    numbers: "pl.Series | None" = None,
    columns: "Sequence[str] | None" = None,
) -> "pl.DataFrame":
    """Return the newest result of each variant.

    Args:
        storage: The files.
        numbers: The numbers of the variants; None: all.
        columns: Columns of the results; None: all, and the metrics.

    Raises:
        RunDirectoryError: A file is damaged.
    """
    import polars as pl

    def is_wanted(file: "pq.ParquetFile") -> bool:
        if numbers is None:
            return True
        found = pl.Series(file.read([VARIANT], use_threads=False)[VARIANT])
        return bool(numbers.is_in(found.implode()).any())

    empty = results_frame(())
    frames = [empty.select(columns or pl.all())]
    for name in part_names(storage):
        frame = storage.read_frame(name, RESULT_COLUMNS, is_wanted=is_wanted)
        with storage.reading(name):
            metrics = [column for column in frame.columns if column not in empty.columns]
            types = {**empty.schema, **dict.fromkeys(metrics, pl.Float64)}
            check_numbers(frame)
            part = frame.select(*types).cast(dict(types))
            if numbers is not None:
                part = part.filter(pl.col(VARIANT).is_in(numbers.implode()))
            frames.append(part.select(columns or pl.all()))
    found = pl.concat(frames, how="diagonal")
    if found[VARIANT].n_unique() < len(found):  # saves a copy in memory
        found = found.unique(VARIANT, keep="last", maintain_order=True)
    return found


def check_numbers(frame: "pl.DataFrame") -> None:
    """Refuse rows without the number of a variant.

    Raises:
        ValueError: There are such rows.
    """
    numbers = frame[VARIANT]
    if str(numbers.dtype) != "Int32" or numbers.null_count() or (numbers < 0).any():
        raise ValueError("it has rows without the number of a variant")


def table_files(storage: Storage, results: str) -> dict[str, str]:
    """Return the files of the tables of a part, by table.

    Raises:
        RunDirectoryError: The file of its results is damaged.
    """
    with storage.parquet(results) as file:
        found = json.loads((file.schema_arrow.metadata or {})[_FILES])
        for table, name in found.items():
            if not re.fullmatch(rf"{TABLES}/[^/]+/{part_of(results):06d}-\d+\.parquet", name):
                raise ValueError(f"it names a file {name!r} of {table}, which is of another part")
        return dict(found)


def drop_damaged(storage: Storage) -> list[str]:
    """Delete damaged parts, and files that no part names; return a line about each problem.

    Raises:
        RunDirectoryError: There is a link in the folder.
    """
    problems = []
    named = set[str]()
    for results in part_names(storage):
        try:
            files = table_files(storage, results)
            for name in (results, *files.values()):
                storage.check(name)
            named |= {*files.values()}
        except RunDirectoryError as error:
            storage.path(results)  # refuses a link
            problems.append(f"{str(error).partition(':')[0]}: its variants are run again")
            storage.delete(results)
    for folder in storage.folders(TABLES):
        for name in storage.names(folder):
            if name not in named and re.fullmatch(_TABLE_FILE, name):
                storage.delete(name)
    return problems
