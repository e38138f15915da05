"""Input files: what a command line, a scenario or a stored folder names, and how it is opened.

Links are followed before a file is checked, and anything but a regular file is refused, since a
pipe may never answer. Within a root, nothing outside of it is opened.
"""

import hashlib
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from io import BufferedReader
from pathlib import Path

from fleet2d.errors import Fleet2DError, InputError

PACKAGE = Path(__file__).resolve().parent
"""Scenarios, personas and tables that come with Fleet2D, which are read within any root."""

_ROOT: ContextVar[Path | None] = ContextVar("root", default=None)
# A pipe or a link may take a file's place after the check: the one must not block, the other not be
# followed.
_SAFELY = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0)


@contextmanager
def within(root: Path) -> Iterator[None]:
    """Within the context, refuse input files outside of a folder.

    Example:
        >>> with within(Path("homes").resolve()):
        ...     open_input(Path("homes/../secret.yaml"))
        Traceback (most recent call last):
        fleet2d.errors.InputError: homes/../secret.yaml is outside of the folder ...
    """
    token = _ROOT.set(root.resolve())
    try:
        yield
    finally:
        _ROOT.reset(token)


def resolved(path: Path | str, error: type[Fleet2DError] = InputError) -> Path:
    """Return a path with its links followed, whether or not anything exists there.

    Raises:
        Fleet2DError: The path leads out of the root, or no file can have such a name; of the type
            `error`.
    """
    try:
        real = Path(os.path.realpath(path))
    except ValueError:  # a null character, or half of a surrogate pair
        raise error(f"{str(path)!r} can't be the name of a file") from None
    root = _ROOT.get()
    if root is None or real.is_relative_to(root) or real.is_relative_to(PACKAGE):
        return real
    raise error(f"{path} is outside of the folder {root}: copy it into the folder")


def input_path(path: Path | str, error: type[Fleet2DError] = InputError) -> Path:
    """Return the path of an input file or folder with links followed, for a library to open.

    Raises:
        OSError: There is no such file or folder.
        Fleet2DError: It leads out of the root, or is a device, a pipe or a socket; of the type
            `error`.
    """
    real = resolved(path, error)
    mode = real.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise error(f"{path} is a device or a pipe: give a file")
    return real


def open_input(path: Path | str, error: type[Fleet2DError] = InputError) -> BufferedReader:
    """Open an input file.

    Raises:
        OSError: The file can't be opened, or is a folder.
        Fleet2DError: It leads out of the root, or is a device, a pipe or a socket; of the type
            `error`.
    """
    real = input_path(path, error)
    file = open(real, "rb", opener=_open_safely)  # noqa: SIM115 - the caller closes it
    if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        return file
    file.close()
    raise error(f"{path} is a device or a pipe: give a file")


def _open_safely(path: str, flags: int) -> int:
    return os.open(path, flags | _SAFELY)


def sha256_of_file(path: Path | str) -> str:
    """Return the SHA-256 of an input file, as hexadecimal digits.

    Raises:
        OSError: The file can't be read.
        InputError: It leads out of the root, or is a device, a pipe or a socket.
    """
    with open_input(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
