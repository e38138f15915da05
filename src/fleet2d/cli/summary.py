"""What is said of a run when it is over."""

import os
import sys
import time
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from fleet2d.cli.verdicts import print_expectations

if TYPE_CHECKING:
    from fleet2d.metrics.metric import Metric
    from fleet2d.runs.run import Run

SEPARATOR = " · "

_LOADED = time.perf_counter()


def summary_of(stored: "Run") -> dict[str, Any]:
    """Return what `--json` prints."""
    manifest = stored.manifest
    wall = {**manifest["wall_s"], "total": _since_start()}
    return {
        "run_dir": str(stored.directory),
        "steps": manifest["steps"],
        "simulated_s": manifest["simulated_s"],
        "seed": manifest["seed"],
        "digest": stored.digest,
        "wall_s": wall,
        "speedup": manifest["simulated_s"] / (wall["setup"] + wall["simulate"] + wall["save"]),
        "peak_rss_mb": _peak_rss_mb(),
        "metrics": stored.metrics,
        **({"expectations": judged} if (judged := manifest["expectations"]) else {}),
    }


def print_summary(summary: dict[str, Any], stored: "Run") -> None:
    """Print the summary for people: speed, a table of metrics, notes."""
    from rich.console import Console
    from rich.table import Table

    from fleet2d.units import format_duration

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
        measured = _class_of(stored, metric)
        rows = _flat(measured.summary(result))
        hidden += len(_flat(result)) - len(rows)
        said = None
        for name, value in rows:
            unit = measured.units.get(name.rsplit(SEPARATOR, 1)[-1], measured.unit)
            table.add_row(metric, name, _shown(value, unit), "" if unit == said else unit)
            metric, said = "", unit
    if table.row_count:
        console.print(table)
    if hidden:
        console.print(f"{hidden} more numbers are in the run: --json shows them", highlight=False)
    print_expectations(console, stored.manifest["expectations"])
    for note in stored.notes or stored.manifest["notes"]:
        console.print(f"note: {note}", highlight=False)
    console.print(f"seed {summary['seed']}, digest {summary['digest'][:16]}", highlight=False)
    console.print(f"stored in {summary['run_dir']}", highlight=False, soft_wrap=True)


def _shown(value: Any, unit: str) -> str:
    """Return a number as people read it: shares in percent, few digits."""
    if not isinstance(value, float):
        return str(value)
    if unit.startswith("share"):
        return f"{100 * value:.1f} %" if value >= 0.001 or value == 0 else "< 0.1 %"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def _class_of(stored: "Run", metric: str) -> "type[Metric]":
    """Return the class of a metric, which knows its unit and what of it matters."""
    from fleet2d.component import lookup

    configured = stored.manifest["scenario"]["metrics"][metric]
    return cast("type[Metric]", lookup("metric", configured["type"]))


def _flat(result: Any, prefix: str = "") -> list[tuple[str, Any]]:
    if not isinstance(result, dict):
        return [(prefix, result)]
    return [
        row
        for key, value in result.items()
        for row in _flat(value, f"{prefix}{SEPARATOR}{key}" if prefix else key)
    ]


def _since_start() -> float:
    """Return the wall time since this process began [s]."""
    try:
        ticks = int(Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()[19])
        return time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (
        OSError,
        AttributeError,
        ValueError,
        IndexError,
    ):  # not Linux: since this module was loaded
        return time.perf_counter() - _LOADED


def _peak_rss_mb() -> float | None:
    """Return the most memory that this process has held [MB]; None where nobody says."""
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1024 * 1024 if sys.platform == "darwin" else 1024)
