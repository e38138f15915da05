"""The run directory: whether it can be used, making it, and taking it back."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from pathlib import Path

from fleet2d.errors import ArtifactError, Fleet2DError, RunDirectoryError

_FULL = {errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC)}


def check_run_directory(directory: Path) -> None:
    """Say early, and without writing, that a directory can't take a run.

    Raises:
        RunDirectoryError: It exists and holds something, is a file, or can't be made.
    """
    try:
        if directory.is_dir():
            if any(directory.iterdir()):
                raise RunDirectoryError(
                    f"{directory} exists and is not empty: choose another --out or remove it"
                )
            _check_writable(directory, directory)
            return
        nearest = directory
        while not os.path.lexists(nearest) and nearest != nearest.parent:
            nearest = nearest.parent
        if not nearest.is_dir():
            raise RunDirectoryError(
                f"{directory} can't be a run directory, for {nearest} is no directory: "
                "choose another --out or remove it"
            )
        _check_writable(directory, nearest)
    except OSError as error:
        raise cannot_write(directory, error) from error


def _check_writable(directory: Path, nearest: Path) -> None:
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise RunDirectoryError(
            f"{directory} can't be written: you may not write in {nearest}; choose another --out"
        )


def make_directories(directory: Path) -> list[Path]:
    """Make a directory and its parents; return those that were missing, outermost first.

    Raises:
        OSError: One can't be made; none is left behind.
    """
    missing = [path for path in (directory, *directory.parents) if not path.is_dir()]
    made: list[Path] = []
    try:
        for path in reversed(missing):
            path.mkdir(exist_ok=True)
            made.append(path)
    except OSError:
        remove_directories(made)
        raise
    return made


def remove_directories(made: list[Path]) -> None:
    """Remove directories that `make_directories` made, as far as they are empty."""
    for path in reversed(made):
        with suppress(OSError):
            path.rmdir()


def is_disk_full(error: OSError) -> bool:
    """Whether an error means that nothing more fits on the disk, or in one's share of it."""
    return error.errno in _FULL


def cannot_write(directory: Path, error: OSError) -> Fleet2DError:
    """Return what to tell the user when a run directory can't be made."""
    if is_disk_full(error):
        return ArtifactError(
            f"the disk is full: {directory} can't be made; free some space or choose another --out"
        )
    reason = error.strerror or str(error)
    return RunDirectoryError(
        f"{directory} can't be made or written ({reason}): choose another --out"
    )
