"""Commands on stored runs: `fleet2d reproduce` and `verify`."""

from pathlib import Path
from typing import Annotated

import typer

from fleet2d.options import TrustFiles, TrustFolders, trust_of


def reproduce(
    directory: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="A stored run.")],
    trust: TrustFiles = None,
    trust_dir: TrustFolders = None,
) -> None:
    """Run a stored run again from its manifest, and compare."""
    from fleet2d.engine.repeat import reproduce_trusting

    result = reproduce_trusting(directory, trust_of(trust, trust_dir))
    for cause in result.causes:
        typer.echo(f"note: {cause}")
    typer.echo(f"not compared: {', '.join(result.not_compared)}")
    if result.same:
        typer.echo(f"reproduced: digest {result.digest}")
        return
    typer.echo(f"not reproduced: {', '.join(result.differing)} differ", err=True)
    raise typer.Exit(1)


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
