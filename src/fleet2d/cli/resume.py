"""The command that goes on with a run: resume."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from fleet2d.cli.runs import run_with_progress
from fleet2d.cli.summary import print_summary, summary_of
from fleet2d.trust_options import TrustFiles, TrustFolders, trust_of


def resume(
    directory: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="An unfinished run.")],
    trust: TrustFiles = None,
    trust_dir: TrustFolders = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Go on with a run that was interrupted or killed, to the digest of an undisturbed one."""
    from fleet2d.engine.resume import reopen

    simulation, remark = reopen(directory, trust_of(trust, trust_dir))
    if not quiet:
        typer.echo(remark, err=True)
    stored = run_with_progress(simulation, show=sys.stderr.isatty() and not quiet)
    summary = summary_of(stored)
    if as_json:
        typer.echo(json.dumps(summary))
    elif not quiet:
        print_summary(summary, stored)
