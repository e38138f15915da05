"""Secrets of this user, in files that nobody else may read; signatures by one of them.

A signature says that a file was written by this user. Only such files are unpickled, since a pickle
can run any command.
"""

import errno
import hmac
import os
import secrets
import stat
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

from fleet2d.errors import ArtifactError
from fleet2d.storage.files import sync, write_all

SECRET_BYTES = 43  # characters of a token of 256 random bits
KEY_NAME = "signing-key"
SIGNATURE_CHARACTERS = 64
"""Length of a signature in hexadecimal digits."""

# The folder of programs' states on systems that don't follow the XDG specification.
_USUAL = {"darwin": "~/Library/Application Support", "win32": "~/AppData/Local"}
_IS_POSIX = os.name == "posix"
# Links are not followed, and a pipe doesn't block.
_FLAGS = os.O_RDONLY | sum(getattr(os, f"O_{name}", 0) for name in ("NOFOLLOW", "NONBLOCK"))


class UnusableSecretError(ArtifactError):
    """The user has no secret, or somebody else may know it."""


def state_folder() -> Path:
    """Return the folder of this user in which Fleet2D keeps secrets; it may not exist yet.

    Raises:
        RuntimeError: The user has no home.
    """
    named = Path(os.environ.get("XDG_STATE_HOME", ""))
    usual = Path(_USUAL.get(sys.platform, "~/.local/state"))
    return (named if named.is_absolute() else usual.expanduser()) / "fleet2d"


def user_secret(name: str) -> bytes:
    """Return a secret of this user, which is made when it is first needed.

    Args:
        name: The name of its file.

    Raises:
        UnusableSecretError: The secret can't be kept, or its file isn't this user's alone.
    """
    try:
        path = state_folder() / name
        if not os.path.lexists(path):
            _make(path)
        return _read(path)
    except (OSError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise UnusableSecretError(
            f"there is no folder for the secrets of this user ({reason}): let XDG_STATE_HOME name"
            " one that can be written"
        ) from error


def signature(purpose: str) -> hmac.HMAC:
    """Return a signature by this user, to which content is added.

    Args:
        purpose: The kind of content: a signature of one kind doesn't fit another.

    Raises:
        UnusableSecretError: See `user_secret`.
    """
    return hmac.new(user_secret(KEY_NAME), f"{purpose}\n".encode(), "sha256")


def _make(path: Path) -> None:
    """Make a secret atomically, so that several processes all get that of the first."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    handle, new = tempfile.mkstemp(dir=path.parent)  # only this user may read the file
    try:
        with os.fdopen(handle, "wb"):
            write_all(handle, secrets.token_urlsafe(32).encode())
            sync(handle)
        with suppress(FileExistsError):  # another process was first
            (os.link if _IS_POSIX else os.rename)(new, path)
    finally:
        with suppress(FileNotFoundError):
            Path(new).unlink()


def _read(path: Path) -> bytes:
    is_link = path.is_symlink()
    try:
        handle = -1 if is_link else os.open(path, _FLAGS | getattr(os, "O_BINARY", 0))
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise
        is_link = True
    if is_link:
        raise _unusable(path, "is a link")
    with os.fdopen(handle, "rb") as file:
        if fault := _fault(os.fstat(handle)):
            raise _unusable(path, fault)
        return file.read(SECRET_BYTES)


def _fault(found: os.stat_result) -> str:
    """Return why a file is no secret of this user; empty if it is one."""
    if not stat.S_ISREG(found.st_mode):
        return "is not a file"
    if _IS_POSIX and found.st_uid != os.geteuid():
        return "belongs to another user"
    if _IS_POSIX and found.st_mode & 0o077:
        return f"may be read by others (mode {stat.S_IMODE(found.st_mode):04o})"
    if found.st_size != SECRET_BYTES:
        return f"has {found.st_size} bytes, expected {SECRET_BYTES}"
    return ""


def _unusable(path: Path, fault: str) -> UnusableSecretError:
    return UnusableSecretError(f"{path} {fault}: delete it, and a new one is made")
