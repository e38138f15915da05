"""Reading data sets: their tables, what they were made from, and whether their files are whole."""

import hashlib
import json
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fleet2d.errors import InputError
from fleet2d.storage.files import path_in

if TYPE_CHECKING:
    import polars as pl
    import pyarrow as pa

FORMAT = 1
MANIFEST = "dataset.json"


class Dataset:
    """A data set in a folder.

    Attributes:
        root: The folder.
        manifest: The content of `dataset.json`.
    """

    def __init__(self, root: Path, manifest: Mapping[str, Any]) -> None:
        """Read nothing yet; `open_dataset` opens a data set."""
        self.root, self.manifest = root, manifest

    def __repr__(self) -> str:
        """Return its folder and splits."""
        splits = ", ".join(f"{name} {runs}" for name, runs in self.manifest["splits"].items())
        return f"<Dataset {self.root}: {splits} runs>"

    @cached_property
    def splits(self) -> tuple[str, ...]:
        """The names of its splits."""
        return tuple(self.manifest["splits"])

    def files(self, table: str, split: str) -> list[Path]:
        """Return the files of a table.

        Raises:
            InputError: There is no such table or split.
        """
        prefix = f"{split}/{table}-"
        names = sorted(name for name in self.manifest["files"] if name.startswith(prefix))
        if not names:
            tables = {Path(name).name.partition("-")[0] for name in self.manifest["files"]}
            raise InputError(
                f"there is no table {table!r} of a split {split!r}: splits are"
                f" {', '.join(self.splits)}, tables {', '.join(sorted(tables))}"
            )
        return [path_in(self.root / split, Path(name).name) for name in names]

    def arrow(self, table: str, split: str) -> "pa.Table":
        """Return a table of a split.

        Raises:
            InputError: There is no such table or split, or a file is damaged.
        """
        import pyarrow as pa

        return pa.concat_tables(_read(path) for path in self.files(table, split))

    def shards(self, split: str) -> int:
        """Return the number of shards of a split, each with a file of every table.

        Raises:
            InputError: There is no such split.
        """
        return len(self.files("runs", split))

    def shard(self, split: str, number: int) -> "dict[str, pa.Table]":
        """Return the tables of some runs of a split, by name: of those in one file of each.

        Raises:
            InputError: There is no such split, or a file is damaged.
        """
        prefix, suffix = f"{split}/", f"-{number:05}.parquet"
        names = [
            name.removeprefix(prefix).removesuffix(suffix)
            for name in self.manifest["files"]
            if name.startswith(prefix) and name.endswith(suffix)
        ]
        return {name: _read(path_in(self.root / split, f"{name}{suffix}")) for name in names}

    def polars(self, table: str, split: str) -> "pl.LazyFrame":
        """Return a table of a split as a lazy frame of polars."""
        import polars as pl

        return pl.scan_parquet(self.files(table, split))

    def lacking(self) -> list[str]:
        """Return the names of the files that are missing."""
        return [name for name in self.manifest["files"] if not self._path(name).is_file()]

    def verify(self) -> list[str]:
        """Return the names of the files that are missing or differ from what was written."""
        return [
            name
            for name, record in self.manifest["files"].items()
            if not (path := self._path(name)).is_file()
            or hashlib.sha256(path.read_bytes()).hexdigest() != record["sha256"]
        ]

    def _path(self, name: str) -> Path:
        return path_in(self.root / Path(name).parent, Path(name).name)


def _read(path: Path) -> "pa.Table":
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return pq.ParquetFile(path).read()  # `read_table` imports pandas
    except (OSError, pa.ArrowException) as error:
        raise InputError(f"{path} can't be read: {error}; make the data set again") from None


def open_dataset(directory: str | Path) -> Dataset:
    """Open a data set.

    Raises:
        InputError: There is none, or it is of another version.
    """
    root = Path(directory)
    try:
        manifest = json.loads((root / MANIFEST).read_text(encoding="utf-8"))
    except FileNotFoundError:
        advice = ": it was interrupted, run the same command again" if root.is_dir() else ""
        raise InputError(f"{root} holds no complete data set{advice}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{root / MANIFEST} can't be read: {error}") from None
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise InputError(f"{root / MANIFEST} is not of a data set of this version of Fleet2D")
    return Dataset(root, manifest)
