"""Write the files of the viewer."""

from pathlib import Path

from fleet2d.errors import InputError
from fleet2d.storage.files import write_atomically


def write_file(path: Path, content: bytes) -> None:
    """Write a file; readers see all of it, or none.

    Raises:
        InputError: It can't be written.
    """
    try:
        write_atomically(path, content)
    except OSError as error:
        raise InputError(f"{path} can't be written: {error.strerror}") from error
