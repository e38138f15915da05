"""`fleet2d resume`: continue an unfinished run."""

import sys
from contextlib import nullcontext, redirect_stdout
from pathlib import Path
from typing import Annotated

import typer

from fleet2d.cli.run import print_results, run_with_progress
from fleet2d.options import TrustFiles, TrustFolders, trust_of


def resume(
    directory: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="An unfinished run.")],
    trust: TrustFiles = None,
    trust_dir: TrustFolders = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Continue an interrupted or killed run; the result equals that of an undisturbed run."""
    from fleet2d.engine.repeat import reopen

    with redirect_stdout(sys.stderr) if as_json else nullcontext():  # output of components
        simulation, note = reopen(directory, trust_of(trust, trust_dir))
        if not quiet:
            typer.echo(note, err=True)
        run = run_with_progress(simulation, show=sys.stderr.isatty() and not quiet)
    print_results(run, as_json=as_json, quiet=quiet)
