"""The files of a study: in a local folder, or in any store that pyarrow can reach."""

import itertools
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from io import BytesIO
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, BinaryIO

from fleet2d.bounds import one_line
from fleet2d.errors import ArtifactError, Fleet2DError, RunDirectoryError, errors_as
from fleet2d.storage.files import is_disk_full, path_in, plain_name, replacing

if TYPE_CHECKING:
    import polars as pl
    import pyarrow as pa
    import pyarrow.parquet as pq


@contextmanager
def writing(location: str | Path) -> Iterator[None]:
    """Turn errors of writing within the context into one that names the place and the remedy.

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
            if isinstance(self.filesystem, pafs.LocalFileSystem):  # file://, a local folder
                self.folder = Path(self.root)
                self.location = self.root
        else:
            self.folder = Path(source).absolute()
            self.filesystem = pafs.LocalFileSystem()
            self.root = str(self.folder)

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

        return self._entries(folder, pafs.FileType.File)

    def folders(self, folder: str) -> list[str]:
        """Return the names of the folders in a folder, sorted; none if there is no such folder.

        Raises:
            ArtifactError: The store can't be reached.
        """
        import pyarrow.fs as pafs

        return self._entries(folder, pafs.FileType.Directory)

    def _entries(self, folder: str, kind: Any) -> list[str]:
        import pyarrow.fs as pafs

        selector = pafs.FileSelector(self.path(folder), allow_not_found=True)
        with self._reaching():
            infos = self.filesystem.get_file_info(selector)
        return sorted(f"{folder}/{info.base_name}" for info in infos if info.type == kind)

    def exists(self, name: str) -> bool:
        """Return whether there is such a file."""
        return self.size(name) is not None

    def size(self, name: str) -> int | None:
        """Return the size of a file [bytes], None if there is none."""
        with self._reaching():
            return self.filesystem.get_file_info(self.path(name)).size

    @contextmanager
    def reading(self, name: str) -> Iterator[None]:
        """Turn errors of reading within the context into one that names the file and the remedy.

        Raises:
            RunDirectoryError: The file is missing, damaged, or can't be read.
        """
        try:
            yield
        except Fleet2DError:
            raise
        except Exception as error:  # libraries raise anything on damaged files
            raise damaged(f"{self.location}/{name}", error) from error

    def read(self, name: str) -> bytes:
        """Return the content of a file.

        Raises:
            RunDirectoryError: There is none, or it can't be read.
        """
        with self.reading(name), self.filesystem.open_input_file(self.path(name)) as file:
            return bytes(file.read())

    def read_frame(
        self,
        name: str,
        needed: Iterable[str] = (),
        kept: Callable[[str], bool] = lambda _: True,
        is_wanted: "Callable[[pq.ParquetFile], bool]" = lambda _: True,
    ) -> "pl.DataFrame":
        """Return the table of a Parquet file as a data frame.

        Args:
            name: The file.
            needed: Columns that it must have.
            kept: Returns whether to keep a column.
            is_wanted: Returns whether its rows are wanted, or only its columns.

        Raises:
            RunDirectoryError: There is none, it is damaged, or it lacks a column.
        """
        import polars as pl

        with self.parquet(name) as file:
            names = file.schema_arrow.names
            if missing := [column for column in needed if column not in names]:
                raise ValueError(f"it has no columns {', '.join(missing)}")
            names = list(filter(kept, names))
            # Each thread of Arrow would keep memory.
            groups = range(file.num_row_groups if is_wanted(file) else 0)
            table = file.read_row_groups(groups, names, use_threads=False)
            frame = pl.from_arrow(table, rechunk=False)
            assert isinstance(frame, pl.DataFrame)
            return frame

    def write_table(
        self, name: str, parts: "Iterable[pa.Table]", group_rows: int | None = None
    ) -> None:
        """Write a table as a Parquet file with checksums; readers see all of it, or none.

        Args:
            name: The file.
            parts: Parts of the table, one at least; each begins a group of rows.
            group_rows: The largest number of rows of a group; None: that of pyarrow.

        Raises:
            ArtifactError: It can't be written.
            RunDirectoryError: It is a link, or in one.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        rest = iter(parts)
        first = next(rest)
        options = {"compression": "zstd", "write_page_checksum": True}
        with self._replacing(name) as file, pq.ParquetWriter(file, first.schema, **options) as sink:
            for part in itertools.chain([first], rest):
                sink.write_table(part, group_rows)
                pa.default_memory_pool().release_unused()

    def write(self, name: str, content: Any) -> None:
        """Write a file; readers see all of it, or none.

        Raises:
            ArtifactError: It can't be written.
            RunDirectoryError: It is a link, or in one.
        """
        with self._replacing(name) as file:
            file.write(content)

    @contextmanager
    def _replacing(self, name: str) -> Iterator[BinaryIO]:
        """Yield a new file that replaces the old one in the end; for a remote store, in memory.

        Raises:
            ArtifactError: It can't be written.
            RunDirectoryError: It is a link, or in one.
        """
        path = self.path(name)
        with writing(self.location):
            if self.folder is None:
                content = BytesIO()
                yield content
                with self.filesystem.open_output_stream(path) as stream:
                    stream.write(content.getbuffer())
            else:
                Path(path).parent.mkdir(parents=True, exist_ok=True)
                with replacing(Path(path)) as handle, open(handle, "wb", closefd=False) as file:
                    yield file

    @contextmanager
    def parquet(self, name: str) -> "Iterator[pq.ParquetFile]":
        """Yield a Parquet file; within the context, errors are those of `reading`.

        Raises:
            RunDirectoryError: There is none, or it is damaged.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        with self.reading(name), self.filesystem.open_input_file(self.path(name)) as source:
            yield pq.ParquetFile(source, page_checksum_verification=True)
        pa.default_memory_pool().release_unused()

    def check(self, name: str) -> None:
        """Read a Parquet file of a local folder, with its checksums; of a store, only its footer.

        Raises:
            RunDirectoryError: There is none, or it is damaged.
        """
        with self.parquet(name) as file:
            for group in range(file.num_row_groups if self.folder is not None else 0):
                file.read_row_group(group, use_threads=False)

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
