"""The commands run and export."""

import gc
import json
import sys
import time
from contextlib import nullcontext, redirect_stdout, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fleet2d.arguments import file_name, split
from fleet2d.cli.summary import print_summary, summary_of
from fleet2d.cli.watchdog import watched
from fleet2d.errors import InputError, RunDirectoryError
from fleet2d.garbage import rare_collections
from fleet2d.trust_options import TrustFiles, TrustFolders, restrict_to

if TYPE_CHECKING:
    from fleet2d.engine.simulation import Simulation
    from fleet2d.runs.run import Run

Arguments = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[SCENARIO.yaml] [KEY.PATH=VALUE]...",
        help="A scenario (left out: the bundled base scenario), and changes to it.",
    ),
]


def run(
    arguments: Arguments = None,
    seed: Annotated[int | None, typer.Option(help="The seed of all randomness.")] = None,
    out: Annotated[Path | None, typer.Option(help="Directory for the run.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Simulate a scenario and store the run."""
    with redirect_stdout(sys.stderr) if as_json else nullcontext():  # output of components
        result = run_with_progress(
            _set_up(arguments, seed, out), show=sys.stderr.isatty() and not quiet
        )
    print_results(result, as_json=as_json, quiet=quiet)


def _set_up(arguments: list[str] | None, seed: int | None, out: Path | None) -> "Simulation":
    with rare_collections():
        from fleet2d.engine.simulation import Simulation
        from fleet2d.scenario.model import load_scenario

        gc.freeze()

    scenario, overrides = split(arguments)
    settings = {} if seed is None else {"seed": seed}
    with watched(), rare_collections():
        loaded = load_scenario(scenario, *overrides, **settings)
        name = loaded.name or (Path(scenario).stem if scenario else "run")
        directory = out or _fresh_directory(name)
        try:
            return Simulation(loaded, out=directory)
        except BaseException:
            if out is None:
                with suppress(OSError):
                    directory.rmdir()
                    directory.parent.rmdir()  # fails if there are other runs
            raise


def print_results(result: "Run", *, as_json: bool, quiet: bool) -> None:
    """Print the results of a run: as one JSON object, as a table, or nothing."""
    summary = summary_of(result)
    if as_json:
        typer.echo(json.dumps(summary))
    elif not quiet:
        print_summary(summary, result)


def export(
    directory: Annotated[Path, typer.Argument(metavar="RUN_DIR", help="A stored run.")],
    out: Annotated[
        Path | None, typer.Argument(help="The file to write, for other programs.")
    ] = None,
    layout: Annotated[
        str,
        typer.Option("--format", help="Its format; casas: sensor readings in the layout of CASAS."),
    ] = "casas",
    html: Annotated[
        Path | None, typer.Option(help="The page to write: one file that plays anywhere.")
    ] = None,
    begin: Annotated[
        str | None, typer.Option("--from", help="Where the page begins, like 'day 3 18:30'.")
    ] = None,
    end: Annotated[str | None, typer.Option("--to", help="Where the page ends.")] = None,
    trust: TrustFiles = None,
    trust_dir: TrustFolders = None,
) -> None:
    """Write a run for others: a file for other programs, or a web page in one file."""
    from fleet2d.runs.run import open_run

    if (out is None) == (html is None):
        raise InputError(
            "name exactly one output: FILE (see --format), or --html FILE (a web page)"
        )
    if html is None and (begin is not None or end is not None):
        raise InputError("--from and --to need --html FILE")
    run = open_run(directory)
    if out is not None:
        from fleet2d.runs.exporters import exporter

        typer.echo(exporter(layout)(run, out))
    elif html is not None:
        from fleet2d.viewer.export import export_html
        from fleet2d.viewer.moments import steps_of

        first, last = steps_of(run, begin, end)
        with restrict_to(trust, trust_dir):
            export_html(run, html, first, last)
        typer.echo(f"{html}: {html.stat().st_size / 1e6:.1f} MB")


def _fresh_directory(name: str) -> Path:
    """Create and return runs/NAME-001, or the directory of the first free number."""
    stem = file_name(name) or "run"
    number = 1
    while True:
        directory = Path("runs") / f"{stem}-{number:03d}"
        try:
            directory.mkdir(parents=True)  # at once, so that a parallel run takes the next
        except FileExistsError:
            number += 1
        except OSError as error:
            raise RunDirectoryError(
                f"{directory} can't be created: {error.strerror}; name another directory by --out"
            ) from error
        else:
            return directory


def run_with_progress(simulation: "Simulation", *, show: bool) -> "Run":
    """Run to the end, with a progress bar on stderr if `show`.

    Raises:
        Exit: Ctrl-C or SIGTERM; what was simulated until then is stored.
    """
    try:
        with watched():
            return _run_with_bar(simulation, show=show)
    except KeyboardInterrupt:
        typer.echo(
            f"interrupted at {simulation.time:%Y-%m-%d %H:%M}; what was simulated until then is in"
            f" {simulation.directory}: continue it by `fleet2d resume {simulation.directory}`",
            err=True,
        )
        raise typer.Exit(130) from None


def _run_with_bar(simulation: "Simulation", *, show: bool) -> "Run":
    gc.freeze()  # loaded modules live to the end: the collector needn't scan them
    if not show:
        return simulation.run()
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=simulation.clock.steps)
        start_s = time.perf_counter()

        def update(current: "Simulation") -> None:
            simulated_s = current.step * current.clock.step_us / 1e6
            speedup = simulated_s / (time.perf_counter() - start_s)
            text = f"{current.time:%a %d %b %Y %H:%M}  {speedup:,.0f} x real time"
            progress.update(task, completed=current.step, description=text)

        return simulation.run(update)
