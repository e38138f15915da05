"""Commands to watch runs with: view, and the HTML file of `export`."""

from pathlib import Path
from typing import Annotated

import typer

from fleet2d.cli.arguments import split
from fleet2d.errors import InputError, RunDirectoryError


def view(
    what: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="RUN_DIR...|SCENARIO.yaml [KEY.PATH=VALUE]...",
            help="Stored runs, up to four; or a scenario that runs while it is watched.",
        ),
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0: a free one.")] = 0,
    browser: Annotated[bool, typer.Option(help="Whether to open the browser.")] = True,
    seed: Annotated[int | None, typer.Option(help="Of a scenario: its seed.")] = None,
    out: Annotated[Path | None, typer.Option(help="Of a scenario: directory of the run.")] = None,
) -> None:
    """Show runs in the browser, on this machine only; end it with Ctrl-C."""
    names = list(what or [])
    directories = [Path(name) for name in names]
    if names and all(path.is_dir() for path in directories):
        if seed is not None or out is not None:
            raise InputError("--seed and --out are for a scenario, not for stored runs")
        _view_runs(directories, port, browser=browser)
        return
    scenario, overrides = split(names)
    if scenario is not None and scenario.endswith("/"):
        raise RunDirectoryError(f"{scenario} does not exist: give a run directory or a scenario")
    from fleet2d.viewer.live import watch_scenario

    watch_scenario(
        scenario,
        overrides,
        seed=seed,
        out=out,
        port=port,
        open_browser=browser,
        announce=_announce,
    )


def _view_runs(directories: list[Path], port: int, *, browser: bool) -> None:
    from fleet2d.artifacts.manifest import FILE_NAME
    from fleet2d.viewer.serve import MOST_RUNS, serve

    if len(directories) > MOST_RUNS:
        raise InputError(
            f"{len(directories)} runs don't fit side by side: give at most {MOST_RUNS}"
        )
    for path in directories:
        if not (path / FILE_NAME).exists():
            raise RunDirectoryError(f"{path} holds no run: give what `fleet2d run --out` wrote")
    serve(directories, port=port, open_browser=browser, announce=_announce)


def _announce(address: str) -> None:
    typer.echo(f"{address}\nshown until you press Ctrl-C; the address works on this machine only")
