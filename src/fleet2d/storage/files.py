"""Files of a folder that Fleet2D stores: safe names, atomic replacement, and one writer.

Runs, studies, tunings and exports go through these functions, so that tests can make each of them
fail, and so that one check covers all names that a folder from somebody else may hold.
"""

from __future__ import annotations

import errno
import os
import platform
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fleet2d.errors import RunDirectoryError

try:
    import fcntl
except ImportError:  # not a POSIX system: the file itself is the lock
    HAS_LOCKS = False
else:
    HAS_LOCKS = True

PARTIAL = ".partial"
"""Suffix of a file's name until the file is complete."""

_FULL = {errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC)}


def plain_name(name: object, folder: Path | str) -> str:
    """Return a name that was read from a folder, checked to stay inside the folder.

    Args:
        name: Names separated by slashes, such as `learned/ltp.npz`.
        folder: The folder, or the location of a store, for the message.

    Raises:
        RunDirectoryError: It is no such name.

    Example:
        >>> plain_name("learned/ltp.npz", "month")
        'learned/ltp.npz'
        >>> plain_name("../other/run", "month")
        Traceback (most recent call last):
        fleet2d.errors.RunDirectoryError: month names a file '../other/run', which is not inside ...
    """
    if (
        isinstance(name, str)
        and name.isprintable()
        and not set("\\:" if os.name == "nt" else "\\") & set(name)  # names a drive by a colon
        and not {"", ".", ".."} & set(name.split("/"))
    ):
        return name
    raise RunDirectoryError(
        f"{folder} names a file {repr(name)[:80]}, which is not inside of it: the folder is damaged"
        " or forged"
    )


def path_in(folder: Path | str, name: object) -> Path:
    """Return the path of a file or folder that is named in somebody else's folder.

    Every name that was read from a run, a study or another folder that a command opens is turned
    into a path here, and so are the fixed names of files in such a folder. Nothing needs to exist.

    Args:
        folder: The folder, which the user named: it may itself be reached by a link.
        name: A name in it; see `plain_name`.

    Raises:
        RunDirectoryError: The name leads out of the folder; or the path is a link, leads through
            one, or is a device, a pipe or a socket.
    """
    path = Path(folder)
    for part in plain_name(name, folder).split("/"):
        path /= part
        with suppress(OSError):  # nothing there, or not accessible: opening it fails, too
            mode = path.lstat().st_mode
            if stat.S_ISLNK(mode):
                raise RunDirectoryError(
                    f"{path} is a link, which may lead anywhere: remove it, or replace it by what"
                    " it leads to"
                )
            if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
                raise RunDirectoryError(f"{path} is not a file, but a device or a pipe: remove it")
    return path


def refuse_links(folder: Path, subfolders: Iterable[str] = ()) -> None:
    """Refuse a folder with links, devices or pipes in it, before anything is written there.

    Args:
        folder: The folder, which may itself be reached by a link.
        subfolders: Names of the folders in it that are checked, too.

    Raises:
        RunDirectoryError: One is in it, or in one of the subfolders.
        OSError: A folder can't be read.
    """
    for directory in (folder, *(path_in(folder, name) for name in subfolders)):
        for path in sorted(directory.iterdir()) if directory.is_dir() else ():
            path_in(directory, path.name)


def write_all(handle: int, content: bytes | memoryview) -> None:
    """Write all bytes to an open file.

    Raises:
        OSError: They can't be written; some may have been.
    """
    rest = memoryview(content)
    while rest:
        rest = rest[os.write(handle, rest) :]


def sync(handle: int) -> None:
    """Flush an open file to the disk.

    Raises:
        OSError: The disk failed; bytes written since the last call may be lost.
    """
    os.fsync(handle)


def sync_directory(directory: Path) -> None:
    """Flush the names in a directory to the disk, where the system can do that."""
    if os.name != "posix":
        return
    handle = os.open(directory, os.O_RDONLY)
    try:
        sync(handle)
    finally:
        os.close(handle)


def replace(path: Path, new: Path) -> None:
    """Rename the file `new` to `path`, atomically."""
    new.replace(path)


def write_atomically(path: Path, content: bytes | memoryview) -> None:
    """Write a file atomically: after a crash it has the old content or the new one.

    Raises:
        OSError: It can't be written; the old content is unchanged.

    Example:
        >>> import tempfile
        >>> file = Path(tempfile.mkdtemp()) / "plan.json"
        >>> write_atomically(file, b"{}")
        >>> file.read_text(), [path.name for path in file.parent.iterdir()]
        ('{}', ['plan.json'])
    """
    with replacing(path) as handle:
        write_all(handle, content)


@contextmanager
def replacing(path: Path) -> Iterator[int]:
    """Yield the handle of a new file, which replaces a file atomically in the end.

    Raises:
        OSError: It can't be written; the old content is unchanged.
    """
    with partial_file(path) as partial:
        handle = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        try:
            yield handle
            sync(handle)
        finally:
            os.close(handle)


@contextmanager
def partial_file(path: Path) -> Iterator[Path]:
    """Yield the path of a file to be written, which replaces a file atomically in the end.

    A link in place of either file is replaced; what it leads to is not touched.

    Raises:
        OSError: It can't be written; the old content is unchanged.
    """
    partial = path.with_name(f"{path.name}{PARTIAL}")
    try:
        partial.unlink(missing_ok=True)  # left by a crash
        yield partial
        replace(path, partial)
    except Exception:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise


def is_disk_full(error: OSError) -> bool:
    """Whether an error means that the disk, or the user's quota, is full."""
    return error.errno in _FULL


class FolderLock:
    """The right to write in a folder.

    Where the system has advisory locks, the lock ends with its process, even if that is killed; a
    lock file that remains doesn't prevent a new lock then.

    Example:
        >>> import tempfile
        >>> folder = Path(tempfile.mkdtemp())
        >>> lock = FolderLock(folder, "run.lock")
        >>> FolderLock(folder, "run.lock")  # doctest: +ELLIPSIS
        Traceback (most recent call last):
        fleet2d.errors.RunDirectoryError: ... is being written by process ...
        >>> lock.release()
        >>> FolderLock(folder, "run.lock").release()
    """

    def __init__(
        self,
        folder: Path,
        name: str,
        advice: str = "wait until it is done, or choose another directory",
    ) -> None:
        """Acquire the lock.

        Args:
            folder: The folder.
            name: The name of the lock file in it.
            advice: What to do if another process holds the lock, for the message.

        Raises:
            RunDirectoryError: Another process holds it, or the lock file is a link.
            OSError: The file can't be created.
        """
        self.path = path_in(folder, name)
        self._advice = advice
        while True:
            self._handle = self._open()
            # Another process may have removed the file between opening and locking it.
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(self._handle), self.path.stat()):
                    break
            os.close(self._handle)
        os.ftruncate(self._handle, 0)
        os.write(self._handle, f"process {os.getpid()} on {platform.node()}\n".encode())

    def _open(self) -> int:
        flags = os.O_RDWR | os.O_CREAT | (0 if HAS_LOCKS else os.O_EXCL)
        try:
            handle = os.open(self.path, flags, 0o666)
        except FileExistsError as error:
            raise self._locked_error() from error
        if HAS_LOCKS:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                os.close(handle)
                raise self._locked_error() from error
        return handle

    def _locked_error(self) -> RunDirectoryError:
        writer = ""
        with suppress(OSError, ValueError):
            writer = " ".join(self.path.read_text(encoding="utf-8")[:200].split())
        return RunDirectoryError(
            f"{self.path.parent} is being written by {writer or 'another process'}: {self._advice}"
        )

    def release(self) -> None:
        """Release the lock, if it is held."""
        if self._handle < 0:
            return
        with suppress(OSError):
            self.path.unlink()
        os.close(self._handle)
        self._handle = -1
