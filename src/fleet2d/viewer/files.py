"""Write files whole, or not at all."""

from contextlib import suppress
from pathlib import Path

from fleet2d.errors import InputError


def write_whole(path: Path, content: bytes) -> None:
    """Write a file under another name, and give it its own once it is whole.

    Raises:
        InputError: It can't be written.
    """
    unfinished = path.with_name(f".{path.name}.unfinished")
    try:
        unfinished.write_bytes(content)
        unfinished.replace(path)
    except OSError as error:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)
        raise InputError(f"{path} can't be written: {error.strerror}") from error
