"""Files that survive a crash: the few calls to the operating system by which a run is stored.

Everything that a run writes goes through these functions, so that tests can let each fail.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

PARTIAL = ".partial"
"""What the name of a file ends in until the file is whole."""


def write_all(handle: int, content: bytes) -> None:
    """Write all bytes to an open file.

    Raises:
        OSError: They can't be written; some may have been.
    """
    rest = memoryview(content)
    while rest:
        rest = rest[os.write(handle, rest) :]


def sync(handle: int) -> None:
    """See what was written to an open file onto the disk.

    Raises:
        OSError: The disk failed; what was written since the last call may be lost.
    """
    os.fsync(handle)


def sync_directory(directory: Path) -> None:
    """See the names in a directory onto the disk, where the system can do that."""
    if os.name != "posix":
        return
    handle = os.open(directory, os.O_RDONLY)
    try:
        sync(handle)
    finally:
        os.close(handle)


def replace(path: Path, by: Path) -> None:
    """Give the file `by` the name `path`, at one stroke."""
    by.replace(path)


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file at one stroke: after a crash it is as before, or whole.

    Raises:
        OSError: It can't be written; what was there before still is.

    Example:
        >>> import tempfile
        >>> file = Path(tempfile.mkdtemp()) / "plan.json"
        >>> write_atomically(file, b"{}")
        >>> file.read_text(), [other.name for other in file.parent.iterdir()]
        ('{}', ['plan.json'])
    """
    partial = path.with_name(f"{path.name}{PARTIAL}")
    try:
        handle = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
        try:
            write_all(handle, content)
            sync(handle)
        finally:
            os.close(handle)
        replace(path, partial)
    except OSError:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise
