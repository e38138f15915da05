"""The files of a study: in a local folder, or in any store that pyarrow can reach."""

import os
import re
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from fleet2d.errors import ArtifactError, RunDirectoryError
from fleet2d.storage.files import PARTIAL, is_disk_full

if TYPE_CHECKING:
    pass


COPY_BYTES = 1 << 22


def write_error(location: str | Path, error: OSError) -> ArtifactError:
    """Return the error of a failed write, with its reason and remedy."""
    reason = "the disk is full" if is_disk_full(error) else (error.strerror or str(error))
    remedy = "free some space" if is_disk_full(error) else "see that it can be written"
    return ArtifactError(
        f"{location} can't be written: {reason}; what is finished is kept: {remedy}, and the same"
        " command goes on"
    )


class Storage:
    """Files by name. A file is complete, or it doesn't exist.

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

        self._source = str(location)
        self.location = re.sub(r"//[^/@]*@", "//", self._source)
        self.folder: Path | None = None
        self.filesystem: pafs.FileSystem
        if "://" in self._source:
            try:
                self.filesystem, self.root = pafs.FileSystem.from_uri(self._source)
            except (pa.ArrowException, OSError, ValueError) as error:
                raise RunDirectoryError(
                    f"{self.location} can't be used as a store: {error}; write a folder, or a"
                    " location like s3://bucket/study"
                ) from error
        else:
            self.folder = Path(self._source).absolute()
            self.filesystem, self.root = pafs.LocalFileSystem(), str(self.folder)

    @property
    def is_local(self) -> bool:
        """Whether it is a local folder."""
        return self.folder is not None

    def path(self, name: str) -> str:
        """Return the path of a file in the file system."""
        return str(PurePosixPath(self.root) / name)

    def names(self, folder: str = "") -> list[str]:
        """Return the names of the files below a folder, sorted; none if there is no such folder.

        Raises:
            ArtifactError: The store can't be reached.
        """
        import pyarrow.fs as pafs

        start = self.path(folder)
        selector = pafs.FileSelector(start, recursive=True, allow_not_found=True)
        try:
            infos = self.filesystem.get_file_info(selector)
        except OSError as error:
            raise self._unreachable(error) from error
        paths = (info.path for info in infos if info.type == pafs.FileType.File)
        return sorted(str(PurePosixPath(path).relative_to(self.root)) for path in paths)

    def exists(self, name: str) -> bool:
        """Return whether there is such a file."""
        return self.size(name) is not None

    def size(self, name: str) -> int | None:
        """Return the size of a file [bytes], None if there is none."""
        try:
            info = self.filesystem.get_file_info(self.path(name))
        except OSError as error:
            raise self._unreachable(error) from error
        return info.size

    def read(self, name: str) -> bytes:
        """Return the content of a file.

        Raises:
            FileNotFoundError: There is none.
        """
        with self.filesystem.open_input_file(self.path(name)) as file:
            return bytes(file.read())

    def write(self, name: str, content: bytes) -> None:
        """Write a file; readers see all of it, or none.

        Raises:
            ArtifactError: It can't be written.
        """
        try:
            if self.folder is None:
                with self.filesystem.open_output_stream(self.path(name)) as stream:
                    stream.write(content)
                return
            path = self.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            partial = path.with_name(f"{path.name}{PARTIAL}")
            with partial.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            partial.replace(path)
        except OSError as error:
            raise write_error(self.location, error) from error

    def publish(self, local: Path, name: str) -> None:
        """Move a finished local file into the storage: by renaming if it is local, else by a copy.

        Raises:
            ArtifactError: It can't be written.
        """
        try:
            if self.folder is not None:
                target = self.folder / name
                target.parent.mkdir(parents=True, exist_ok=True)
                with local.open("rb") as file:
                    os.fsync(file.fileno())
                local.replace(target)
                return
            with (
                local.open("rb") as file,
                self.filesystem.open_output_stream(self.path(name)) as out,
            ):
                while block := file.read(COPY_BYTES):
                    out.write(block)
            local.unlink()
        except OSError as error:
            raise write_error(self.location, error) from error

    def delete(self, name: str) -> None:
        """Delete a file, if there is one."""
        if self.exists(name):
            self.filesystem.delete_file(self.path(name))

    def _unreachable(self, error: OSError) -> ArtifactError:
        return ArtifactError(f"{self.location} can't be reached: {error}")

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the location alone."""
        return Storage, (self._source,)
