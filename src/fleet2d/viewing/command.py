"""The command `fleet2d view`."""

from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fleet2d.configuration.problems import did_you_mean
from fleet2d.errors import InputError, RunDirectoryError
from fleet2d.options import Trust, resume_hint, show_code, split

if TYPE_CHECKING:
    from fleet2d.runs.run import Run


def view(
    arguments: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="RUN_DIR|SCENARIO.yaml|KEY.PATH=VALUE",
            help="Stored runs, up to four; or a scenario that runs while it is watched.",
        ),
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0: a free one.")] = 0,
    seen_at: Annotated[
        str | None,
        typer.Option(metavar="URL", help="Address in the browser, of a tunnel or proxy."),
    ] = None,
    browser: Annotated[bool, typer.Option(help="Whether to open the browser.")] = True,
    seed: Annotated[int | None, typer.Option(help="Of a scenario: its seed.")] = None,
    out: Annotated[Path | None, typer.Option(help="Of a scenario: directory of the run.")] = None,
    trust: Trust = False,
) -> None:
    """Watch runs in the browser, or a scenario live.

    The page is shown on this machine only, until Ctrl-C.

    Examples:
      fleet2d view runs/home-001
      fleet2d view runs/home-001 runs/home-002
      fleet2d view home.yaml --out watched
    """
    names = list(arguments or [])
    directories = [Path(name) for name in names]
    if names and all(path.is_dir() for path in directories):
        if seed is not None or out is not None:
            raise InputError("--seed and --out are for a scenario, not for stored runs")
        _view_runs(directories, port, seen_at or "", browser=browser, trust=trust)
        return
    scenario, overrides = split(names)
    if scenario is not None and not scenario.startswith("bundled:") and not Path(scenario).exists():
        near = [str(path) for path in sorted(Path(scenario).parent.glob("*"))]
        hint = did_you_mean(Path(scenario), near)
        raise RunDirectoryError(f"there is no run directory and no scenario {scenario}{hint}")
    from fleet2d.engine.simulation import Simulation
    from fleet2d.viewing.live import LiveRun
    from fleet2d.viewing.page_server import PageServer

    settings: dict[str, Any] = {} if seed is None else {"seed": seed}
    live = LiveRun(Simulation(scenario, *overrides, out=out, **settings), paused=True)
    server = PageServer([], port=port, live=live, seen_at=seen_at or "")
    live.start()
    try:
        server.show(open_browser=browser, announce=typer.echo)
    finally:
        live.end()
        server.end_branches()
    if live.failure is not None:
        raise live.failure
    assert live.run is not None
    typer.echo(_closing_line(live.run), err=True)
    raise typer.Exit(130)


def _closing_line(run: "Run") -> str:
    """Return a line that says how a run that was watched ended, and where it is."""
    if run.directory is None:
        return f"the run is {run.status}; it is not stored: name a directory by --out"
    if run.status == "complete":
        return f"stored in {run.directory}"
    time = run.clock.start + timedelta(seconds=run.manifest["simulated_s"])
    return resume_hint(time, run.directory)


def _view_runs(
    directories: list[Path], port: int, seen_at: str, *, browser: bool, trust: bool
) -> None:
    from fleet2d.artifacts.manifest import FILE_NAME
    from fleet2d.runs.run import open_run
    from fleet2d.viewing.page_data import PageData
    from fleet2d.viewing.page_server import MAX_RUNS, PageServer

    if len(directories) > MAX_RUNS:
        raise InputError(f"{len(directories)} runs don't fit side by side: give at most {MAX_RUNS}")
    for path in directories:
        if not (path / FILE_NAME).exists():
            raise RunDirectoryError(f"{path} holds no run: give what `fleet2d run --out` wrote")
    trusted = [open_run(path, trust=True) for path in directories if trust]
    for run in trusted:
        show_code(run.manifest)
    sources = [PageData(run) for run in trusted] or directories
    server = PageServer(sources, port=port, seen_at=seen_at)
    server.show(open_browser=browser, announce=typer.echo)
    for run in server.end_branches():
        typer.echo(_closing_line(run), err=True)
    raise typer.Exit(130)
