"""The options `--trust` and `--trust-dir` of every command that could run a scenario's code."""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Annotated

import typer

from fleet2d.errors import InputError
from fleet2d.trust import Trust, restricted

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


def restricting(
    files: list[Path] | None, folders: list[Path] | None
) -> AbstractContextManager[None]:
    """Return a context in which only code that `--trust` and `--trust-dir` name may run.

    Raises:
        InputError: One isn't there, or is the other kind.
    """
    return restricted(trust_of(files, folders))
