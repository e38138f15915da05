"""The command `fleet2d transfer`."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from fleet2d.errors import printable
from fleet2d.options import Workers


def transfer(
    source: Annotated[Path, typer.Argument(metavar="FILE.yaml", help="The experiment.")],
    out: Annotated[Path | None, typer.Option(help="A folder; left out: studies/NAME.")] = None,
    workers: Workers = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check all, and print what would be trained.")
    ] = False,
    changed: Annotated[
        Literal["redo"] | None,
        typer.Option(help="redo: set aside results of other code, logs or settings."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Measure what simulated people are worth to real homes.

    Models are trained on real days, simulated days, or both, and tested on days of real homes.

    Examples:
      fleet2d transfer homes.yaml --dry-run
      fleet2d transfer homes.yaml --out transfer
    """
    from fleet2d.configuration.problems import counted
    from fleet2d.learning.transfer.driver import run_transfer
    from fleet2d.learning.transfer.report import write_report
    from fleet2d.learning.transfer.specification import read_plan
    from fleet2d.studies.api import default_location, open_crew
    from fleet2d.studies.command import interruptible
    from fleet2d.studies.progress import observing
    from fleet2d.studies.reader import open_study

    plan = read_plan(source)
    location = out or Path(default_location(plan.name))
    for words, count in plan.unfit.items() if not quiet else ():
        typer.echo(f"left out: {printable(words)} ({counted(count, 'cell')})", err=True)
    if dry_run:
        left_out = sum(plan.unfit.values())
        typer.echo(f"{counted(len(plan.cells), 'cell')}, {left_out} left out")
        return
    with (
        interruptible(location),
        observing(quiet=quiet) as observer,
        open_crew("local", workers) as crew,
    ):
        counts = run_transfer(plan, location, crew, changed=changed, observer=observer)
    study = open_study(location)
    left_out = sum(plan.unfit.values())
    if counts.complete:
        for sentence in write_report(study, location):
            if not quiet:
                typer.echo(printable(sentence))
    if not quiet:
        typer.echo(
            f"{counts.complete} of {counts.total} cells, {left_out} left out: {location}/report.md"
        )
    for row in study.failures.head(10).to_dicts():
        cell = ", ".join(str(row[name]) for name in ("task", "learner", "home", "arm", "days"))
        typer.echo(printable(f"{cell}: {row['error']}"), err=True)
    if counts.complete < counts.total:
        raise typer.Exit(1)
