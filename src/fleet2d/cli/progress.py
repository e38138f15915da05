"""Runs in the terminal: with a progress bar, and with a message when they are interrupted."""

import gc
import time
from typing import TYPE_CHECKING

import typer

from fleet2d.cli.watchdog import watched

if TYPE_CHECKING:
    from fleet2d.engine.simulation import Simulation
    from fleet2d.runs.run import Run


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
