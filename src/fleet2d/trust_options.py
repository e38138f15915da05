"""The options `--trust` and `--trust-dir` of all commands that may run a scenario's own code."""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Annotated

import typer

from fleet2d.errors import InputError
from fleet2d.trust import Trust, restrict

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
