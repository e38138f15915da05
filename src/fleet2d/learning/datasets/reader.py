"""Reading data sets: their tables, what they were made from, and whether their files are whole."""

import hashlib
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, ValidationError

from fleet2d.artifacts.manifest import Count, FileRecord, Record, Sha256, problems_of, read_json
from fleet2d.bounds import FILE_BYTES, TABLE_BYTES, read_bytes, unpacked_bytes
from fleet2d.errors import InputError, extra
from fleet2d.learning.datasets.tables import OFFSET, SCHEMAS
from fleet2d.storage.files import path_in

if TYPE_CHECKING:
    import polars as pl
    import pyarrow as pa

FORMAT = 1
MANIFEST = "dataset.json"
NULLABLE = frozenset({OFFSET, "next_place", "next_step", "activity"})
"""Columns in which values may be missing: nobody knows what comes after the end of a run, and a
home without a time zone has no offset from UTC."""
LARGEST = 1e6
"""The largest absolute value of a number in a table that isn't whole, such as an area [m²]."""

_SPLIT = "[A-Za-z0-9_]+"
_TABLE = "|".join(SCHEMAS)


class ShardRecord(FileRecord):
    """The size and the digest of a file of a data set."""

    rows: Count


def _check_files(files: dict[str, ShardRecord]) -> dict[str, ShardRecord]:
    """Refuse shards that lack the file of a table."""
    shards = {(name.partition("/")[0], name[-13:]) for name in files}
    if len(files) != len(shards) * len(SCHEMAS):
        raise ValueError("a shard lacks the file of a table")
    return files


class DatasetManifest(Record):
    """The content of `dataset.json`.

    Attributes:
        format: Version of the layout.
        name: The name of the data set.
        plan: The digest of all inputs on which its content depends, without the code.
        versions: Versions of the software that made it.
        splits: The number of runs of each split.
        unfit: Why runs were left out whose people don't fit into their home, by number.
        file: The file that it was made from, as plain data.
        files: Each file: its rows, size and digest.
    """

    format: Annotated[int, Field(ge=FORMAT, le=FORMAT)] = FORMAT
    name: str
    plan: Sha256
    versions: dict[str, str]
    splits: dict[Annotated[str, Field(pattern=f"^{_SPLIT}$")], Count]
    unfit: dict[str, str] = {}
    file: dict[str, Any]
    files: Annotated[
        dict[
            Annotated[str, Field(pattern=rf"^{_SPLIT}/({_TABLE})-[0-9]{{5,7}}\.parquet$")],
            ShardRecord,
        ],
        AfterValidator(_check_files),
    ]


class Dataset:
    """A data set in a folder.

    Attributes:
        root: The folder.
        manifest: The content of `dataset.json`.
    """

    def __init__(self, root: Path, manifest: DatasetManifest) -> None:
        """Wrap a folder; use `open_dataset` to open a data set."""
        self.root = root
        self.manifest = manifest

    def __repr__(self) -> str:
        """Return the folder and the splits."""
        splits = ", ".join(f"{name} {runs}" for name, runs in self.manifest.splits.items())
        return f"<Dataset {self.root}: {splits} runs>"

    @cached_property
    def splits(self) -> tuple[str, ...]:
        """The names of its splits."""
        return tuple(self.manifest.splits)

    def files(self, table: str, split: str) -> list[Path]:
        """Return the files of a table.

        Raises:
            InputError: There is no such table or split, or a file is a link, a device or a pipe.
        """
        prefix = f"{split}/{table}-"
        names = sorted(name for name in self.manifest.files if name.startswith(prefix))
        if not names:
            raise InputError(
                f"{self.root} has no table {table!r} of a split {split!r}: splits are"
                f" {', '.join(self.splits)}, tables {', '.join(sorted(SCHEMAS))}"
            )
        return [path_in(self.root, name) for name in names]

    def arrow(self, table: str, split: str) -> "pa.Table":
        """Return a table of a split.

        Raises:
            InputError: There is no such table or split, or a file is damaged.
        """
        import pyarrow as pa

        return pa.concat_tables(_read(path, table) for path in self.files(table, split))

    def shards(self, split: str) -> int:
        """Return the number of shards of a split, each with a file of every table.

        Raises:
            InputError: There is no such split.
        """
        return len(self.files("runs", split))

    def shard(self, split: str, number: int) -> "dict[str, pa.Table]":
        """Return the tables of one shard of a split, by name.

        Raises:
            InputError: There is no such split, or a file is damaged.
        """
        return {name: _read(self.files(name, split)[number], name) for name in SCHEMAS}

    def polars(self, table: str, split: str) -> "pl.LazyFrame":
        """Return a table of a split as a lazy frame of polars.

        Raises:
            InputError: There is no such table or split, or polars isn't installed.
        """
        with extra("polars", "lazy frames need polars"):
            import polars as pl

        return pl.scan_parquet(self.files(table, split))

    def lacking(self) -> list[str]:
        """Return the names of the files that are missing.

        Raises:
            InputError: A file is a link, a device or a pipe.
        """
        return [name for name in self.manifest.files if not path_in(self.root, name).is_file()]

    def verify(self) -> list[str]:
        """Return the names of the files that are missing or differ from the manifest.

        Raises:
            InputError: A file is a link, a device or a pipe.
        """
        return [name for name, file in self.manifest.files.items() if not self._is_same(name, file)]

    def _is_same(self, name: str, record: ShardRecord) -> bool:
        path = path_in(self.root, name)
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest() == record.sha256


def _read(path: Path, table: str) -> "pa.Table":
    """Return the content of a file of a table."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(path)  # `read_table` imports pandas
        TABLE_BYTES.check(unpacked_bytes(file), path, prefix="about ")
        content = file.read()
        problem = _problem(content, SCHEMAS[table])
    except (OSError, pa.ArrowException) as error:
        problem = str(error)
    if problem:
        raise InputError(f"{path} can't be read: {problem}; make the data set again")
    return content


def _problem(content: "pa.Table", schema: "pa.Schema") -> str:
    """Return the first problem of the columns and values of a table; empty if there is none."""
    import pyarrow as pa

    if content.schema.names != schema.names or content.schema.types != schema.types:
        return f"its columns aren't {', '.join(schema.names)}"
    for field, column in zip(schema, content, strict=True):
        if column.null_count and field.name not in NULLABLE:
            return f"it has no value in a row of {field.name}"
        if pa.types.is_integer(field.type) and (column.drop_null().to_numpy() < 0).any():
            return f"it has a negative {field.name}"
        if pa.types.is_floating(field.type) and not (np.abs(column.to_numpy()) <= LARGEST).all():
            return f"it has a value of {field.name} that is not a number up to {LARGEST:,.0f}"
    return ""


def open_dataset(directory: str | Path) -> Dataset:
    """Open a data set.

    Raises:
        InputError: There is no data set, or it is damaged or of another version.
    """
    root = Path(directory)
    path = path_in(root, MANIFEST)
    try:
        content = read_json(read_bytes(path, FILE_BYTES))
    except FileNotFoundError:
        advice = ": it was interrupted, run the same command again" if root.is_dir() else ""
        raise InputError(f"{root} holds no complete data set{advice}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path} can't be read: {error}") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f"{path} is not of a data set of this version of Fleet2D")
    try:
        return Dataset(root, DatasetManifest.model_validate(content))
    except ValidationError as error:
        raise InputError(
            f"{path} is damaged ({problems_of(error).rstrip('.')}): make the data set again"
        ) from None
