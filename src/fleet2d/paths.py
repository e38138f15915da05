"""Text and paths from a scenario, with the folder of the file that they are written in."""

from functools import partial
from pathlib import Path
from typing import Annotated, Self

from pydantic import BeforeValidator, WithJsonSchema

from fleet2d.problems import problem, shown


class Text(str):
    """A string from a scenario, with the folder of its file."""

    __slots__ = ("folder",)
    folder: Path

    def __new__(cls, text: str, folder: Path) -> Self:
        """Attach ``folder`` to ``text``."""
        self = super().__new__(cls, text)
        self.folder = folder
        return self

    def __getnewargs__(self) -> tuple[str, Path]:  # type: ignore[override]
        """Preserve the folder in copies and pickles."""
        return str(self), self.folder


def folder_of(text: object) -> Path:
    """Return the folder that a relative path starts from.

    >>> folder_of(Text("plan.json", Path("/homes")))
    PosixPath('/homes')
    """
    return text.folder if isinstance(text, Text) else Path.cwd()


def _existing(value: object, *, is_folder_allowed: bool = False) -> Path:
    kind = "file or folder" if is_folder_allowed else "file"
    if not isinstance(value, str | Path) or not str(value):
        raise problem(f"expected the path of a {kind}, got {shown(value)}")
    path = (folder_of(value) / Path(value).expanduser()).resolve()
    if not (path.is_file() or (is_folder_allowed and path.is_dir())):
        reason = "a folder, not a file" if path.is_dir() else f"no such {kind}"
        raise problem(f"{reason}: {path}")
    return path


_SCHEMA = WithJsonSchema(
    {
        "type": "string",
        "description": "path, relative to the file it is written in",
        "x-quantity": "path",
    }
)

InputPath = Annotated[Path, BeforeValidator(_existing), _SCHEMA]
"""An existing file. Relative paths start from the folder of the YAML they are written in, on the
command line and in Python from the current one; dumped as absolute."""

InputFileOrFolder = Annotated[
    Path, BeforeValidator(partial(_existing, is_folder_allowed=True)), _SCHEMA
]
"""An existing file or folder, likewise."""
