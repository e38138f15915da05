"""What a command prints of a finished run: one JSON object, or sentences and a table of metrics."""

import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import typer

from fleet2d.errors import ArtifactError
from fleet2d.runs.verdicts import verdict_line, verdicts_of
from fleet2d.runtime.memory import peak_memory_mb

if TYPE_CHECKING:
    from fleet2d.metrics.metric import Metric
    from fleet2d.runs.run import Run

MAX_COLUMNS = 6
"""With more subjects than this, a metric has a row for each of them instead of a column."""

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

    print_verdict(run)
    console = Console(highlight=False, markup=False, soft_wrap=True)
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
    blocks = [block_of(name, _class_of(run, name), result) for name, result in run.metrics.items()]
    width = max((len(row.name) for block in blocks for row in block.rows), default=0)
    for block in blocks:
        if len(block.rows) == 1:  # nothing was measured
            continue
        table = Table.grid(padding=(0, 2, 0, 0))
        table.add_column(min_width=width)
        for _ in block.rows[0].values:
            table.add_column(justify="right")
        table.add_column(style="dim")
        for row in block.rows:
            table.add_row(row.name, *row.values, row.unit)
        console.print(table, soft_wrap=False)
    hidden = sum(block.hidden for block in blocks)
    lines = [f"{hidden} more numbers are in the run: --json shows them"] if hidden else []
    lines += [verdict.says for verdict in verdicts_of(run) if verdict.outcome != "violated"]
    lines += [f"note: {note}" for note in run.notes or run.manifest["notes"]]
    lines += [f"seed {summary['seed']}, digest {summary['digest'][:16]}"]
    lines += [f"stored in {summary['run_dir']}"]
    console.print(*lines, sep="\n")


class Row(NamedTuple):
    """A line of the closing table."""

    name: str
    values: Sequence[str]
    unit: str


class Block(NamedTuple):
    """The lines of a metric: the first names its subjects, each of the others has one measure."""

    rows: Sequence[Row]
    hidden: int  # numbers that it leaves out


def _class_of(run: "Run", metric: str) -> "type[Metric]":
    from fleet2d.configuration.components import lookup

    kind = run.manifest["scenario"]["metrics"][metric]["type"]
    return cast("type[Metric]", lookup("metric", kind))


def block_of(metric: str, metric_class: "type[Metric]", result: Any) -> Block:
    """Lay out the result of a metric: a column for each subject, such as a person.

    Only the numbers next to the subjects are in it, not what is nested in them.
    """
    numbers = dict(_numbers(metric_class.summary(result)))
    depth = min(map(len, numbers), default=0)
    shown = {path: number for path, number in numbers.items() if len(path) == depth}
    hidden = len(list(_numbers(result))) - len(shown)
    subjects = list(dict.fromkeys(path[:-1] for path in shown))
    measures = list(dict.fromkeys(path[-1:] for path in shown))
    has_names_alone = depth == 1 and not any(name in metric_class.units for (name,) in shown)
    if has_names_alone and len(shown) <= MAX_COLUMNS:
        subjects, measures = measures, [()]
    rows = [Row(metric, [" · ".join(subject) for subject in subjects], "")]
    last_unit = ""
    for measure in measures:
        unit = metric_class.units.get("".join(measure), metric_class.unit)
        values = [
            _text(shown[subject + measure], unit) if subject + measure in shown else ""
            for subject in subjects
        ]
        rows.append(Row(f"  {''.join(measure)}", values, "" if unit == last_unit else unit))
        last_unit = unit
    return Block(rows, hidden)


def _numbers(result: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield the numbers of a result with the names on the way to each."""
    if not isinstance(result, Mapping):
        yield path, result
        return
    for name, value in result.items():
        yield from _numbers(value, (*path, str(name)))


def print_verdict(run: "Run", *, err: bool = False) -> None:
    """Print what became of the expectations, a line for each violated one; red if one is."""
    verdicts = verdicts_of(run)
    violated = [verdict.says for verdict in verdicts if verdict.outcome == "violated"]
    if line := verdict_line(run, verdicts):
        typer.secho("\n".join([line, *violated]), fg="red" if violated else None, err=err)


def _text(value: Any, unit: str) -> str:
    """Return a value as text: shares in percent, other numbers with few digits."""
    if not isinstance(value, float):
        return str(value)
    if unit.startswith("share"):
        return f"{100 * value:.1f} %" if value >= 0.001 or value == 0 else "< 0.1 %"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def _since_start() -> float:
    """Return the wall time since this process started [s]."""
    try:
        ticks = int(Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()[19])
        return time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, AttributeError, ValueError, IndexError):
        # Not on Linux: the time since this module was loaded.
        return time.perf_counter() - _LOADED
