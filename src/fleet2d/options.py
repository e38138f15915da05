"""Options and arguments that several commands share."""

import re
from contextlib import AbstractContextManager
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

import typer

from fleet2d.configuration.trust import Trust, restrict
from fleet2d.errors import InputError

Resolution = Annotated[
    float | None,
    typer.Option(help="Metres per pixel, for a floor plan that is a picture without a scale."),
]

Scale = Annotated[
    float | None,
    typer.Option(
        min=1e-6,
        max=1000,
        help="What lengths of a floor plan are multiplied by, such as 0.001 for millimetres.",
    ),
]

ThemeChoice = Annotated[
    Literal["light", "dark"], typer.Option(help="Theme of pictures: a light or a dark background.")
]


def resume_hint(time: datetime, directory: Path) -> str:
    """Return a line about a run that was interrupted at a local time."""
    return (
        f"interrupted at {time:%Y-%m-%d %H:%M}; what was simulated until then is in {directory}:"
        f" continue it by `fleet2d resume {directory}`"
    )


def split(arguments: list[str] | None) -> tuple[str | None, list[str]]:
    """Return the scenario, None if there is none, and the overrides, which have a '='."""
    if arguments and "=" not in arguments[0]:
        return arguments[0], arguments[1:]
    return None, list(arguments or [])


def file_name(name: str) -> str:
    """Return a name without the characters that a file name should not have."""
    return re.sub(r"[^\w.-]+", "-", name).strip(".-")


Workers = Annotated[
    int | None, typer.Option(min=1, help="Processes at a time; left out: one per core.")
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
    """Return the trust in the files of `--trust` and the folders of `--trust-dir`.

    Raises:
        InputError: A path doesn't exist, or is a folder instead of a file or vice versa.
    """
    for path in files or ():
        if path.is_dir():
            raise InputError(f"--trust {path} is a folder: name it by --trust-dir")
    for path in folders or ():
        if path.is_file():
            raise InputError(f"--trust-dir {path} is a file: name it by --trust")
    return Trust.of([*(files or ()), *(folders or ())])


def restrict_to(
    files: list[Path] | None, folders: list[Path] | None
) -> AbstractContextManager[None]:
    """Return a context in which only code that `--trust` and `--trust-dir` name may run.

    Raises:
        InputError: See `trust_of`.
    """
    return restrict(trust_of(files, folders))
