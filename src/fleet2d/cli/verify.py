"""The command that compares a stored run with its seal: verify."""

from pathlib import Path
from typing import Annotated

import typer


def verify(
    directory: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="A stored run.")],
) -> None:
    """Check that a stored run is as it was stored, without running anything."""
    from fleet2d.artifacts.seal import verify_run

    found = verify_run(directory)
    for note in found.notes:
        typer.echo(f"note: {note}")
    for name in found.foreign:
        typer.echo(f"note: {name} is no part of the run")
    for name, how in found.differing.items():
        typer.echo(f"{name} {how}", err=True)
    if found.differing:
        raise typer.Exit(1)
    typer.echo(f"verified: {f'seal {found.digest}' if found.digest else 'the tables'}")
