"""Files that survive a crash: the few calls to the operating system that store a run.

All that a run writes goes through these functions, so that tests can make each of them fail.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PARTIAL = ".partial"
"""Suffix of a file's name until the file is complete."""


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
    partial = path.with_name(f"{path.name}{PARTIAL}")
    try:
        handle = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
        try:
            yield handle
            sync(handle)
        finally:
            os.close(handle)
        replace(path, partial)
    except Exception:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise
