"""`fleet2d verify`: compare a stored run with its seal."""

from pathlib import Path
from typing import Annotated

import typer


def verify(
    directory: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="A stored run.")],
) -> None:
    """Check that the files of a stored run are unchanged, without running anything."""
    from fleet2d.artifacts.seal import verify_run

    result = verify_run(directory)
    for note in result.notes:
        typer.echo(f"note: {note}")
    for name in result.foreign:
        typer.echo(f"note: {name} is not part of the run")
    for name, difference in result.differing.items():
        typer.echo(f"{name} {difference}", err=True)
    if result.differing:
        raise typer.Exit(1)
    typer.echo(f"verified: {f'seal {result.digest}' if result.digest else 'the tables'}")
