"""The summary of a finished run."""

import json
import os
import sys
import time
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import typer

from fleet2d.cli.verdicts import print_expectations
from fleet2d.errors import ArtifactError

if TYPE_CHECKING:
    from fleet2d.metrics.metric import Metric
    from fleet2d.runs.run import Run

SEPARATOR = " · "

_LOADED = time.perf_counter()


def print_results(result: "Run", *, as_json: bool, quiet: bool) -> None:
    """Print the results of a run: as one JSON object, as a table, or nothing.

    Raises:
        ArtifactError: They can't be written; the run is stored nevertheless.
    """
    summary = summary_of(result)
    try:
        if as_json:
            typer.echo(json.dumps(summary))
        elif not quiet:
            print_summary(summary, result)
    except BrokenPipeError:  # its reader has seen enough
        raise
    except OSError as error:
        raise ArtifactError(
            f"the results can't be printed ({error.strerror or error}): the run is stored in"
            f" {result.directory}"
        ) from error


def summary_of(run: "Run") -> dict[str, Any]:
    """Return the content of `--json`."""
    manifest = run.manifest
    wall = {**manifest["wall_s"], "total": _since_start()}
    return {
        "run_dir": str(run.directory),
        "steps": manifest["steps"],
        "simulated_s": manifest["simulated_s"],
        "seed": manifest["seed"],
        "digest": run.digest,
        "wall_s": wall,
        "speedup": manifest["simulated_s"] / (wall["setup"] + wall["simulate"] + wall["save"]),
        "peak_rss_mb": _peak_rss_mb(),
        "metrics": run.metrics,
        **({"expectations": verdicts} if (verdicts := manifest["expectations"]) else {}),
    }


def print_summary(summary: dict[str, Any], run: "Run") -> None:
    """Print the summary as text: speed, a table of metrics, notes."""
    from rich.console import Console
    from rich.table import Table

    from fleet2d.configuration.units import format_duration

    console = Console()
    wall = summary["wall_s"]
    simulated = format_duration(timedelta(seconds=summary["simulated_s"]))
    seconds = wall["setup"] + wall["simulate"] + wall["save"]
    console.print(
        f"{simulated} in {seconds:.2f} s: {summary['speedup']:,.0f} x real time"
        f" (set-up {wall['setup']:.2f} s, simulate {wall['simulate']:.2f} s,"
        f" save {wall['save']:.2f} s;"
        f" whole process {wall['total']:.2f} s, {summary['peak_rss_mb']:.0f} MB)",
        highlight=False,
        soft_wrap=True,
    )
    table, hidden = Table("metric", "of", "value", "", show_edge=False), 0
    for metric, result in summary["metrics"].items():
        metric_class = _class_of(run, metric)
        rows = _flat(metric_class.summary(result))
        hidden += len(_flat(result)) - len(rows)
        last_unit = None
        for name, value in rows:
            unit = metric_class.units.get(name.rsplit(SEPARATOR, 1)[-1], metric_class.unit)
            table.add_row(metric, name, _text(value, unit), "" if unit == last_unit else unit)
            metric, last_unit = "", unit
    if table.row_count:
        console.print(table)
    if hidden:
        console.print(f"{hidden} more numbers are in the run: --json shows them", highlight=False)
    print_expectations(console, run.manifest["expectations"])
    for note in run.notes or run.manifest["notes"]:
        console.print(f"note: {note}", highlight=False, markup=False)
    console.print(f"seed {summary['seed']}, digest {summary['digest'][:16]}", highlight=False)
    console.print(f"stored in {summary['run_dir']}", highlight=False, soft_wrap=True, markup=False)


def _text(value: Any, unit: str) -> str:
    """Return a value as text: shares in percent, other numbers with few digits."""
    if not isinstance(value, float):
        return str(value)
    if unit.startswith("share"):
        return f"{100 * value:.1f} %" if value >= 0.001 or value == 0 else "< 0.1 %"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def _class_of(run: "Run", metric: str) -> "type[Metric]":
    """Return the class of a metric, which has its units and its summary."""
    from fleet2d.configuration.components import lookup

    configured = run.manifest["scenario"]["metrics"][metric]
    return cast("type[Metric]", lookup("metric", configured["type"]))


def _flat(result: Any, prefix: str = "") -> list[tuple[str, Any]]:
    """Return nested results as rows (name, value)."""
    if not isinstance(result, dict):
        return [(prefix, result)]
    return [
        row
        for key, value in result.items()
        for row in _flat(value, f"{prefix}{SEPARATOR}{key}" if prefix else key)
    ]


def _since_start() -> float:
    """Return the wall time since this process started [s]."""
    try:
        ticks = int(Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()[19])
        return time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, AttributeError, ValueError, IndexError):
        # Not on Linux: the time since this module was loaded.
        return time.perf_counter() - _LOADED


def _peak_rss_mb() -> float | None:
    """Return the largest memory of this process so far [MB]; None where the system can't say."""
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1024 * 1024 if sys.platform == "darwin" else 1024)
