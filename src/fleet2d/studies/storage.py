"""The files of a study: in a local folder, or in any store that pyarrow can reach."""

import itertools
import os
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import is_dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, get_args, get_origin, get_type_hints

from fleet2d.bounds import one_line
from fleet2d.errors import ArtifactError, Fleet2DError, RunDirectoryError, errors_as
from fleet2d.storage.files import PARTIAL, is_disk_full, path_in, plain_name, write_atomically

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

COPY_BYTES = 1 << 22
BATCH_ROWS = 5_000  # of a table that is read in parts
GROUP_ROWS = 50_000  # most of a table that are written together
GROUP_SHARE = 0.05  # of the rows before them
# What libraries raise on damaged files; pyarrow's errors are subclasses of these.
DAMAGE = (
    ArithmeticError, AttributeError, LookupError, MemoryError, NotImplementedError, OSError,
    RecursionError, TypeError, ValueError,
)  # fmt: skip


@contextmanager
def writing(location: str | Path) -> Iterator[None]:
    """Within the context, an error while something is written names its place and the remedy.

    Raises:
        ArtifactError: It can't be written.
    """
    try:
        yield
    except OSError as error:
        reason = "the disk is full" if is_disk_full(error) else (error.strerror or str(error))
        remedy = "free some space" if is_disk_full(error) else "make it writable"
        raise ArtifactError(
            f"{location} can't be written: {reason}; finished results are kept: {remedy}, and the"
            " same command continues"
        ) from error


def damaged(path: str | Path, reason: object) -> RunDirectoryError:
    """Return the error of a damaged file, with its remedy."""
    return RunDirectoryError(
        f"{path} is damaged ({one_line(reason, 120)}): run the study again, which"
        " restores what it can"
    )


def from_json(kind: Any, value: Any) -> Any:
    """Return a value of JSON as text, a number, a tuple, a mapping, or a dataclass of such.

    Pydantic does the same, but takes as long to load as all else that reading a study needs.

    Raises:
        TypeError: It has another type, or lacks a key or has one too many.

    Example:
        >>> from_json(tuple[int, ...], [1, 2])
        (1, 2)
    """
    origin = get_origin(kind) or kind
    of = get_args(kind)
    hints = get_type_hints(kind) if is_dataclass(kind) else None
    expected = {tuple: list, Mapping: dict}.get(origin, origin) if hints is None else dict
    if expected not in (type(value), Any):
        raise TypeError(f"{one_line(value)} is no {expected.__name__}")
    if hints is not None:
        return kind(**{key: from_json(hints.get(key, Any), part) for key, part in value.items()})
    if origin is tuple:
        return tuple(from_json(of[0], part) for part in value)
    if origin is Mapping:
        return {key: from_json(of[1], part) for key, part in value.items()}
    return value


class Storage:
    """Files by name. A file is complete, or it doesn't exist.

    Names are checked to stay inside the folder, and links in it are refused.

    Attributes:
        location: The folder or store as the user wrote it, without secrets.
        folder: The local folder; None for a remote store.
        filesystem: The file system of pyarrow.
        root: The path of the folder in it.
    """

    def __init__(self, location: str | Path) -> None:
        """Find the file system; nothing is read or written.

        Raises:
            RunDirectoryError: The location can't be understood or reached.
        """
        import pyarrow as pa
        import pyarrow.fs as pafs

        source = str(location)
        self.location = re.sub(r"//[^/@]*@", "//", source)
        self.folder: Path | None = None
        self.filesystem: pafs.FileSystem
        if "://" in source:
            try:
                self.filesystem, self.root = pafs.FileSystem.from_uri(source)
            except (pa.ArrowException, OSError, ValueError) as error:
                raise RunDirectoryError(
                    f"{self.location} can't be used as a store: {error}; write a folder, or a"
                    " location like s3://bucket/study"
                ) from error
            if isinstance(self.filesystem, pafs.LocalFileSystem):  # file://, a folder like others
                self.folder = Path(self.root)
                self.location = self.root
        else:
            self.folder = Path(source).absolute()
            self.filesystem, self.root = pafs.LocalFileSystem(), str(self.folder)

    def path(self, name: str) -> str:
        """Return the path of a file in the file system.

        Raises:
            RunDirectoryError: The name leads out of the folder, or to a link or device.
        """
        if self.folder is not None:
            return str(path_in(self.folder, name))
        return str(PurePosixPath(self.root) / plain_name(name, self.location))

    def names(self, folder: str) -> list[str]:
        """Return the names of the files in a folder, sorted; none if there is no such folder.

        Raises:
            ArtifactError: The store can't be reached.
        """
        import pyarrow.fs as pafs

        selector = pafs.FileSelector(self.path(folder), allow_not_found=True)
        with self._reaching():
            infos = self.filesystem.get_file_info(selector)
        return sorted(
            f"{folder}/{info.base_name}" for info in infos if info.type == pafs.FileType.File
        )

    def exists(self, name: str) -> bool:
        """Return whether there is such a file."""
        return self.size(name) is not None

    def size(self, name: str) -> int | None:
        """Return the size of a file [bytes], None if there is none."""
        with self._reaching():
            return self.filesystem.get_file_info(self.path(name)).size

    @contextmanager
    def reading(self, name: str) -> Iterator[None]:
        """Within the context, errors about the content of a file name it and the remedy.

        Raises:
            RunDirectoryError: The file is missing, damaged, or can't be read.
        """
        try:
            yield
        except Fleet2DError:
            raise
        except DAMAGE as error:
            raise damaged(f"{self.location}/{name}", error) from error

    def read(self, name: str) -> bytes:
        """Return the content of a file.

        Raises:
            RunDirectoryError: There is none, or it can't be read.
        """
        with self.reading(name), self.filesystem.open_input_file(self.path(name)) as file:
            return bytes(file.read())

    def read_table(
        self, name: str, columns: Sequence[str] | None = None, filters: Any = None
    ) -> "pa.Table":
        """Return the table of a Parquet file.

        Raises:
            RunDirectoryError: There is none, it is damaged, or it lacks a column.
        """
        import pyarrow.parquet as pq

        names = None if columns is None else list(columns)
        if filters is None:  # without the modules of data sets, which take 60 MB
            with self.parquet(name) as file:
                table = file.read(names)
        else:
            with self.reading(name):
                table = pq.read_table(
                    self.path(name), columns=names, filters=filters, filesystem=self.filesystem
                )
        with self.reading(name):
            if names and set(names) != set(table.column_names):
                raise ValueError(f"it has no columns {', '.join(names)}")
        return table

    def write(self, name: str, content: bytes) -> None:
        """Write a file; readers see all of it, or none.

        Raises:
            ArtifactError: It can't be written.
            RunDirectoryError: It is a link, or in one.
        """
        path = self.path(name)
        with writing(self.location):
            if self.folder is None:
                with self.filesystem.open_output_stream(path) as stream:
                    stream.write(content)
            else:
                Path(path).parent.mkdir(parents=True, exist_ok=True)
                write_atomically(Path(path), content)

    @contextmanager
    def parquet(self, name: str) -> "Iterator[pq.ParquetFile]":
        """Yield a Parquet file; within the context, errors are those of `reading`.

        Raises:
            RunDirectoryError: There is none, or it is damaged.
        """
        import pyarrow.parquet as pq

        with self.reading(name), self.filesystem.open_input_file(self.path(name)) as source:
            yield pq.ParquetFile(source)

    def row_groups(self, name: str) -> list[int]:
        """Return how many rows each group of a Parquet file has.

        Raises:
            RunDirectoryError: There is none, or it is damaged.
        """
        with self.parquet(name) as file:
            return [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)]

    def read_batches(self, name: str, columns: Sequence[str] | None = None) -> "Iterator[pa.Table]":
        """Yield some rows of a Parquet file after the other, at least one table.

        Raises:
            RunDirectoryError: There is none, it is damaged, or it lacks a column.
        """
        import pyarrow as pa

        with self.parquet(name) as file:
            names = file.schema_arrow.names if columns is None else list(columns)
            if missing := [name for name in names if name not in file.schema_arrow.names]:
                raise ValueError(f"it has no columns {', '.join(missing)}")
            if not file.metadata.num_rows:
                yield file.read(names)
            for group in range(file.num_row_groups):  # over all at once it keeps the whole file
                for batch in file.iter_batches(BATCH_ROWS, [group], names, use_threads=False):
                    yield pa.Table.from_batches([batch])

    def write_batches(self, name: str, tables: "Iterator[pa.Table]", scratch: Path) -> None:
        """Write tables of one schema as a Parquet file, without having all of them in memory.

        Args:
            name: The file; readers see all of it, or none.
            tables: The tables, one at least.
            scratch: A local folder for the unfinished file, on the same disk as a local storage.

        Raises:
            ArtifactError: It can't be written.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        local = scratch / f"{PurePosixPath(name).name}{PARTIAL}"
        first = next(tables)
        group = list[pa.Table]()
        rows = 0
        written = 0
        with writing(self.location):
            scratch.mkdir(parents=True, exist_ok=True)
            with pq.ParquetWriter(local, first.schema, compression="zstd") as file:
                for table in itertools.chain([first], tables):
                    group.append(table)
                    rows += table.num_rows
                    # Each column of a group takes 5 kB of memory until the file is finished.
                    if rows >= min(GROUP_SHARE * written, GROUP_ROWS):
                        file.write_table(pa.concat_tables(group))
                        group, rows, written = [], 0, written + rows
                if group:
                    file.write_table(pa.concat_tables(group))
        self.publish(local, name)

    def publish(self, local: Path, name: str) -> None:
        """Move a finished local file into the storage: by renaming if it is local, else by a copy.

        Raises:
            ArtifactError: It can't be written.
            RunDirectoryError: Its place is a link, or in one.
        """
        path = self.path(name)
        with writing(self.location):
            with local.open("rb") as file:
                if self.folder is not None:
                    os.fsync(file.fileno())
                    Path(path).parent.mkdir(parents=True, exist_ok=True)
                    local.replace(path)
                    return
                with self.filesystem.open_output_stream(path) as out:
                    shutil.copyfileobj(file, out, COPY_BYTES)
            local.unlink()

    def delete(self, name: str) -> None:
        """Delete a file, if there is one.

        Raises:
            ArtifactError: It can't be deleted.
        """
        with writing(self.location):
            if self.exists(name):
                self.filesystem.delete_file(self.path(name))

    def _reaching(self) -> AbstractContextManager[None]:
        return errors_as(ArtifactError, f"{self.location} can't be reached", of=OSError)
