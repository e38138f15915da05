"""One run, one writer: a lock on a run directory that ends with the process that holds it."""

from __future__ import annotations

import os
import platform
from contextlib import suppress
from pathlib import Path

from fleet2d.errors import RunDirectoryError

try:
    import fcntl
except ImportError:  # not a POSIX system: the file itself is the lock
    HAS_LOCKS = False
else:
    HAS_LOCKS = True

LOCK_NAME = "run.lock"


class RunLock:
    """The right to write in a run directory.

    Where the system has advisory locks, the lock ends with its process, even if that is killed; a
    lock file that remains doesn't prevent a new lock then.

    Example:
        >>> import tempfile
        >>> folder = Path(tempfile.mkdtemp())
        >>> lock = RunLock(folder)
        >>> RunLock(folder)  # doctest: +ELLIPSIS
        Traceback (most recent call last):
        fleet2d.errors.RunDirectoryError: ... is being written by process ...
        >>> lock.release()
        >>> RunLock(folder).release()
    """

    def __init__(self, directory: Path) -> None:
        """Acquire the lock.

        Raises:
            RunDirectoryError: Another process holds it.
            OSError: The file can't be created.
        """
        self.path = directory / LOCK_NAME
        while True:
            self._handle = self._open(directory)
            # Another process may have removed the file between opening and locking it.
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(self._handle), self.path.stat()):
                    break
            os.close(self._handle)
        os.ftruncate(self._handle, 0)
        os.write(self._handle, f"process {os.getpid()} on {platform.node()}\n".encode())

    def _open(self, directory: Path) -> int:
        flags = os.O_RDWR | os.O_CREAT | (0 if HAS_LOCKS else os.O_EXCL)
        try:
            handle = os.open(self.path, flags, 0o666)
        except FileExistsError as error:
            raise self._locked_error(directory) from error
        if HAS_LOCKS:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                os.close(handle)
                raise self._locked_error(directory) from error
        return handle

    def _locked_error(self, directory: Path) -> RunDirectoryError:
        writer = ""
        with suppress(OSError, ValueError):
            writer = self.path.read_text(encoding="utf-8")[:200].strip()
        return RunDirectoryError(
            f"{directory} is being written by {writer or 'another process'}: wait until it is"
            " done, or choose another directory"
        )

    def release(self) -> None:
        """Release the lock, if it is held."""
        if self._handle < 0:
            return
        with suppress(OSError):
            self.path.unlink()
        os.close(self._handle)
        self._handle = -1
