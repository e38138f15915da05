"""Arguments that several commands take."""

import re
from pathlib import Path
from typing import Annotated

import typer

from fleet2d.errors import InputError
from fleet2d.trust import Trust

Resolution = Annotated[
    float | None,
    typer.Option(help="Metres per pixel, of a floor plan that is a mere picture."),
]

TrustFiles = Annotated[
    list[Path] | None,
    typer.Option("--trust", metavar="FILE", help="Code of the scenario that may run."),
]
TrustFolders = Annotated[
    list[Path] | None,
    typer.Option("--trust-dir", metavar="DIR", help="A folder all of whose code may run."),
]


def trust_of(files: list[Path] | None, folders: list[Path] | None) -> Trust:
    """Return what `--trust` and `--trust-dir` name.

    Raises:
        InputError: One isn't there, or is the other kind.
    """
    for path in files or ():
        if path.is_dir():
            raise InputError(f"--trust {path} is a folder: name it by --trust-dir")
    for path in folders or ():
        if path.is_file():
            raise InputError(f"--trust-dir {path} is a file: name it by --trust")
    return Trust.of([*(files or ()), *(folders or ())])


def split(arguments: list[str] | None) -> tuple[str | None, list[str]]:
    """Tell the scenario from the overrides: it comes first, and has no '='."""
    rest = list(arguments or [])
    if rest and "=" not in rest[0]:
        return rest[0], rest[1:]
    return None, rest


def file_name(name: str) -> str:
    """Return what of a name can be a file's, wherever it comes from."""
    return re.sub(r"[^\w.-]+", "-", name).strip(".-")
