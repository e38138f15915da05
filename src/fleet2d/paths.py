"""Text and paths from a scenario, with the folder of the file that they are written in."""

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


def _resolve_path(value: object) -> Path:
    if not isinstance(value, str | Path) or not str(value):
        raise problem(f"found {shown(value)}; the path of a file is wanted")
    path = (folder_of(value) / Path(value).expanduser()).resolve()
    if not path.is_file():
        reason = "a folder, not a file" if path.is_dir() else "no such file"
        raise problem(f"{reason}: {path}")
    return path


InputPath = Annotated[
    Path,
    BeforeValidator(_resolve_path),
    WithJsonSchema(
        {
            "type": "string",
            "description": "a file's path, relative to the file it is written in",
            "x-quantity": "path",
        }
    ),
]
"""An existing file. Relative paths start from the folder of the YAML they are written in, on the
command line and in Python from the current one; dumped as absolute."""
