"""Where a study's files lie: a local folder, or any store that pyarrow's file systems reach."""

import os
import re
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from fleet2d.artifacts.directory import is_disk_full
from fleet2d.errors import ArtifactError, RunDirectoryError

if TYPE_CHECKING:
    pass

COPY_BYTES = 1 << 22


def write_error(location: str | Path, error: OSError) -> ArtifactError:
    """Return the error to raise where a study can't be written."""
    reason = "the disk is full" if is_disk_full(error) else (error.strerror or str(error))
    remedy = "free some space" if is_disk_full(error) else "see that it can be written"
    return ArtifactError(
        f"{location} can't be written: {reason}; what is finished is kept: {remedy}, and the same"
        " command goes on"
    )


class Storage:
    """Files by name; a file is there whole, or not at all.

    Attributes:
        location: What the user wrote, without the secrets in it.
        folder: The local folder; None for a remote store.
        filesystem: That of pyarrow.
        root: The folder's path in it.
    """

    def __init__(self, location: str | Path) -> None:
        """Touch nothing yet.

        Raises:
            RunDirectoryError: The location can't be understood or reached.
        """
        import pyarrow as pa
        import pyarrow.fs as pafs

        self._written = str(location)
        self.location = re.sub(r"//[^/@]*@", "//", self._written)
        self.folder: Path | None = None
        self.filesystem: pafs.FileSystem
        if "://" in self._written:
            try:
                self.filesystem, self.root = pafs.FileSystem.from_uri(self._written)
            except (pa.ArrowException, OSError, ValueError) as error:
                raise RunDirectoryError(
                    f"{self.location} can't be used as a store: {error}; write a folder, or a"
                    " location like s3://bucket/study"
                ) from error
        else:
            self.folder = Path(self._written).absolute()
            self.filesystem, self.root = pafs.LocalFileSystem(), str(self.folder)

    @property
    def is_local(self) -> bool:
        """Whether it is a folder of this machine."""
        return self.folder is not None

    def path(self, name: str) -> str:
        """Return where the file system has a file."""
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
        found = [info.path for info in infos if info.type == pafs.FileType.File]
        return sorted(str(PurePosixPath(path).relative_to(self.root)) for path in found)

    def exists(self, name: str) -> bool:
        """Return whether a file is there."""
        return self.size(name) is not None

    def size(self, name: str) -> int | None:
        """Return the bytes of a file, None if there is none."""
        try:
            info = self.filesystem.get_file_info(self.path(name))
        except OSError as error:
            raise self._unreachable(error) from error
        size: int | None = info.size
        return size

    def read(self, name: str) -> bytes:
        """Return the content of a file.

        Raises:
            FileNotFoundError: There is none.
        """
        with self.filesystem.open_input_file(self.path(name)) as file:
            return bytes(file.read())

    def write(self, name: str, content: bytes) -> None:
        """Write a file at one stroke.

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
            partial = path.with_name(path.name + ".partial")
            with partial.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            partial.replace(path)
        except OSError as error:
            raise write_error(self.location, error) from error

    def publish(self, local: Path, name: str) -> None:
        """Bring a finished local file to its place: renamed where possible, else copied.

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
        """Delete a file, if it is there."""
        if self.exists(name):
            self.filesystem.delete_file(self.path(name))

    def _unreachable(self, error: OSError) -> ArtifactError:
        return ArtifactError(f"{self.location} can't be reached: {error}")

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the location alone."""
        return Storage, (self._written,)
