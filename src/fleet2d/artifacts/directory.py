"""The run directory: check that it can be used, create it, and remove it again."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from fleet2d.errors import ArtifactError, Fleet2DError, RunDirectoryError
from fleet2d.storage.files import is_disk_full


def check_run_directory(directory: Path) -> None:
    """Check, without writing, that a run can be stored in a directory.

    Raises:
        RunDirectoryError: It exists and isn't empty, is a file, or can't be created.
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
                f"{directory} can't be a run directory, because {nearest} is not a directory: "
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
    """Create a directory and its parents; return those that were missing, outermost first.

    Raises:
        OSError: One can't be created; those created before it are removed again.
    """
    missing = [path for path in (directory, *directory.parents) if not path.is_dir()][::-1]
    try:
        for path in missing:
            path.mkdir(exist_ok=True)
    except OSError:
        remove_directories(missing)
        raise
    return missing


def remove_directories(directories: list[Path]) -> None:
    """Remove those of some directories, outermost first, that exist and are empty."""
    for path in reversed(directories):
        with suppress(OSError):
            path.rmdir()


def cannot_write(directory: Path, error: OSError) -> Fleet2DError:
    """Return the error to raise when a run directory can't be created."""
    if is_disk_full(error):
        return ArtifactError(
            f"the disk is full: {directory} can't be made; free some space or choose another --out"
        )
    reason = error.strerror or str(error)
    return RunDirectoryError(
        f"{directory} can't be made or written ({reason}): choose another --out"
    )
