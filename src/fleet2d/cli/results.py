"""The printed results of a finished run: one JSON object, or sentences and a table of metrics."""

import json
import os
import time
from collections.abc import Mapping
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from fleet2d.errors import ArtifactError
from fleet2d.runs.verdicts import verdict_line, verdicts_of
from fleet2d.runtime.memory import peak_memory_mb

if TYPE_CHECKING:
    from fleet2d.runs.run import Run

_LOADED = time.perf_counter()
# The width of the column of units, whose words wrap.
UNIT_WIDTH = 12
LONGEST = 10_000  # characters of a line


def print_results(result: "Run", *, as_json: bool, quiet: bool) -> None:
    """Print the results of a run: as one JSON object, as a table, or nothing.

    Raises:
        ArtifactError: The results can't be written; the run is stored nevertheless.
    """
    summary = summary_of(result)
    try:
        if as_json:
            typer.echo(json.dumps(summary))
        elif not quiet:
            print_summary(summary, result)
    except BrokenPipeError:  # the reader of the pipe has closed it
        raise
    except OSError as error:
        raise ArtifactError(
            f"the results can't be printed ({error.strerror or error}): the run is stored in"
            f" {result.directory}"
        ) from error


def summary_of(run: "Run") -> dict[str, Any]:
    """Return the content of `--json`."""
    manifest = run.manifest
    verdicts = verdicts_of(run)
    wall = {**manifest["wall_s"], "total": _since_start()}
    return {
        **({"verdict": verdict_line(run, verdicts)} if verdicts else {}),
        "run_dir": str(run.directory),
        "steps": manifest["steps"],
        "simulated_s": manifest["simulated_s"],
        "seed": manifest["seed"],
        "digest": run.digest,
        "wall_s": wall,
        "speedup": manifest["simulated_s"] / (wall["setup"] + wall["simulate"] + wall["save"]),
        "peak_rss_mb": peak_memory_mb(),
        "metrics": run.metrics,
        **({"expectations": manifest["expectations"]} if verdicts else {}),
    }


def print_summary(summary: Mapping[str, Any], run: "Run") -> None:
    """Print the summary as text: verdicts, speed, a table of metrics, notes."""
    from rich.console import Console
    from rich.table import Table

    from fleet2d.configuration.units import format_duration
    from fleet2d.metrics.results import blocks_of

    print_verdict(run)
    console = Console(highlight=False, markup=False, soft_wrap=True)
    wide = Console(highlight=False, markup=False, width=LONGEST)
    wall = summary["wall_s"]
    simulated = format_duration(timedelta(seconds=summary["simulated_s"]))
    seconds = wall["setup"] + wall["simulate"] + wall["save"]
    peak = summary["peak_rss_mb"]
    memory = "" if peak is None else f", {peak:.0f} MB"
    console.print(
        f"{simulated} in {seconds:.2f} s: {summary['speedup']:,.0f} x real time"
        f" (set-up {wall['setup']:.2f} s, simulate {wall['simulate']:.2f} s,"
        f" save {wall['save']:.2f} s; whole process {wall['total']:.2f} s{memory})"
    )
    blocks = blocks_of(run.metrics, run.manifest["scenario"]["metrics"])
    width = max((len(row.name) for block in blocks for row in block.rows), default=0)
    for block in blocks:
        columns = zip(*(row.values for row in block.rows), strict=True)
        value_width = sum(max(map(len, column)) + 2 for column in columns)
        # Where columns would be cut, the terminal breaks the lines instead.
        is_narrow = console.width < width + 4 + value_width + UNIT_WIDTH
        table = Table.grid(padding=(0, 2, 0, 0))
        table.add_column(min_width=width + 2, no_wrap=True)
        head, *rows = block.rows
        for _ in head.values:
            table.add_column(justify="right", no_wrap=True)
        table.add_column(style="dim", no_wrap=is_narrow)
        table.add_row(head.name, *head.values)
        for row in rows:
            table.add_row(f"  {row.name}", *row.values, row.unit)
        (wide if is_narrow else console).print(table, soft_wrap=False)
    hidden = sum(block.hidden for block in blocks)
    lines = [f"{hidden} more numbers are in the run: --json shows them"] if hidden else []
    lines += [verdict.says for verdict in verdicts_of(run) if verdict.outcome != "violated"]
    lines += [f"note: {note}" for note in run.notes or run.manifest["notes"]]
    lines += [f"seed {summary['seed']}, digest {summary['digest'][:16]}"]
    lines += [f"stored in {summary['run_dir']}"]
    console.print(*lines, sep="\n")


def print_verdict(run: "Run", *, err: bool = False) -> None:
    """Print what became of the expectations, a line for each violated one; red if one is."""
    verdicts = verdicts_of(run)
    violated = [verdict.says for verdict in verdicts if verdict.outcome == "violated"]
    if line := verdict_line(run, verdicts):
        typer.secho("\n".join([line, *violated]), fg="red" if violated else None, err=err)


def _since_start() -> float:
    """Return the wall time since this process started [s]."""
    try:
        _, fields = Path("/proc/self/stat").read_text().rsplit(")", 1)
        began_s = int(fields.split()[19]) / os.sysconf("SC_CLK_TCK")
        return time.clock_gettime(time.CLOCK_BOOTTIME) - began_s
    except (OSError, AttributeError, ValueError, IndexError):
        # Other systems than Linux only tell the time since this module was loaded.
        return time.perf_counter() - _LOADED
