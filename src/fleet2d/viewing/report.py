"""A report of a run as one HTML page: what ran, metrics, figures, timeline, how to run it again."""

import base64
import html
from collections.abc import Callable
from contextlib import suppress
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from fleet2d.configuration.units import format_duration
from fleet2d.errors import ArtifactError, InputError
from fleet2d.metrics.metric import flat
from fleet2d.metrics.results import ResultTable, blocks_of
from fleet2d.runs.run import Run
from fleet2d.runtime.clock import DAY
from fleet2d.viewing.notebook import figure_png, verdict_html
from fleet2d.viewing.page_data import POLICY, PageData, embedded_run, html_of, write_file
from fleet2d.viewing.run_facts import run_title
from fleet2d.viewing.story import story_of

MAX_TIMELINE_CHARS = 20_000_000
"""The maximum number of characters of a page that is embedded in a report."""
STYLE = Path(__file__).with_suffix(".css").read_text(encoding="utf-8")


def write_report(run: Run, path: Path) -> None:
    """Write a report of a run as one HTML page without references to other files.

    Args:
        run: The run.
        path: The file; an existing file is replaced.

    Raises:
        InputError: The file can't be written.
    """
    write_file(path, report_html(run).encode())


def report_html(run: Run) -> str:
    """Return a report of a run; see `write_report`."""
    title = html.escape(run_title(run))
    parts = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',  # its frame's, too
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{title}: report</title><style>{STYLE}</style></head><body>",
        f"<h1>{title}</h1>",
        verdict_html(run),
        _what_ran(run),
        _notes(run),
        _story(run),
        "<h2>Metrics</h2>",
        _metrics(run),
        "<h2>Figures</h2>",
        *_figures(run),
        "<h2>Timeline</h2>",
        _timeline(run),
        "<h2>Run it again</h2>",
        _again(run),
        "</body></html>\n",
    ]
    return "\n".join(part for part in parts if part)


def _what_ran(run: Run) -> str:
    manifest = run.manifest
    clock = run.clock
    entities = manifest["entities"]
    rows = [
        ("status", run.status),
        ("simulated", f"{clock.start:%Y-%m-%d %H:%M} to {clock.time(clock.steps):%Y-%m-%d %H:%M}"),
        ("steps", f"{clock.steps:,} of {format_duration(timedelta(microseconds=clock.step_us))}"),
        ("home", str(manifest["scenario"].get("floorplan", {}).get("name") or "")),
        ("users", ", ".join(entities["users"]) or "none"),
        ("robots", ", ".join(entities["robots"]) or "none"),
        ("seed", str(manifest["seed"])),
        ("digest", run.digest or "none"),
        ("versions", ", ".join(f"{k} {v}" for k, v in sorted(manifest["versions"].items()))),
    ]
    return _table([row for row in rows if row[1]])


def _notes(run: Run) -> str:
    if not run.notes:
        return ""
    return "<ul>" + "".join(f"<li>{html.escape(note)}</li>" for note in run.notes) + "</ul>"


def _metrics(run: Run) -> str:
    if not run.metrics:
        return "<p>The run has none.</p>"
    blocks = blocks_of(run.metrics, run.manifest["scenario"]["metrics"])
    numbers = [
        (name, f"{value:.4g}" if isinstance(value, float) else str(value))
        for name, value in flat(run.metrics)
    ]
    every = f"<details><summary>All {len(numbers)} numbers</summary>{_table(numbers)}</details>"
    return "".join(map(_block, blocks)) + every


def _story(run: Run) -> str:
    """Return the moments of a run that are worth a look, as a list."""
    moments = []
    for moment in story_of(run):
        title, words = html.escape(moment["title"]), html.escape(moment["words"])
        time = f"{run.clock.time(moment['step']):%a %-d %b %H:%M}"
        moments.append(f"<li><b>{title}</b>, {time}: {words}</li>")
    return f"<h2>Story</h2><ul>{''.join(moments)}</ul>" if moments else ""


def _block(block: ResultTable) -> str:
    """Return the numbers of a metric as a table."""
    head, *rows = block.rows
    subjects = "".join(f'<th scope="col">{html.escape(name)}</th>' for name in head.values)
    lines = [f"<tr><th>{html.escape(head.name)}</th>{subjects}<th></th></tr>"]
    for row in rows:
        numbers = "".join(f"<td>{html.escape(value)}</td>" for value in row.values)
        name = html.escape(row.name)
        unit = html.escape(row.unit)
        lines.append(f'<tr><th scope="row">{name}</th>{numbers}<td class="unit">{unit}</td></tr>')
    return f'<table class="metric">{"".join(lines)}</table>'


def _table(rows: list[tuple[str, str]]) -> str:
    lines = (
        f'<tr><th scope="row">{html.escape(name)}</th><td>{html.escape(value)}</td></tr>'
        for name, value in rows
    )
    return f"<table>{''.join(lines)}</table>"


def _figures(run: Run) -> list[str]:
    """Return the figures of the report as HTML."""
    from fleet2d.viewing.figures import stretch_figure
    from fleet2d.viewing.pictures.floorplan import drawing_style
    from fleet2d.viewing.pictures.run import run_figure

    steps = run.manifest["steps"]
    day = min(steps, max(1, DAY // timedelta(microseconds=run.manifest["step_us"])))
    kinds: tuple[tuple[str, Callable[[], Any]], ...] = (
        ("The run in its home, and who was where by day", partial(run_figure, run)),
        ("The first day", partial(stretch_figure, run, 0, day, "strip")),
        ("Where time was spent", partial(stretch_figure, run, 0, steps, "heat")),
    )
    if run.manifest["scenario"].get("interactions"):
        draw_answers = partial(stretch_figure, run, 0, steps, "answers")
        kinds = (*kinds, ("What robots wanted of people, and what they answered", draw_answers))
    figures = []
    for caption, draw in kinds:
        try:
            with drawing_style():
                address = _png(draw())
        except (ArtifactError, InputError) as error:
            figures.append(f"<p>{html.escape(caption)}: {html.escape(str(error))}</p>")
        else:
            picture = f'<img alt="{caption}" src="{address}">'
            figures.append(f"<figure>{picture}<figcaption>{caption}</figcaption></figure>")
    return figures


def _png(figure: Any) -> str:
    """Return a figure as the address of an image."""
    return f"data:image/png;base64,{base64.b64encode(figure_png(figure, 'figure')).decode()}"


def _timeline(run: Run) -> str:
    """Return the page of a run, in a sandboxed frame."""
    with suppress(ArtifactError):  # no plan or no key frames
        page = html_of([embedded_run(PageData(run), 0, run.manifest["steps"])])
        if len(page) <= MAX_TIMELINE_CHARS:
            document = html.escape(page)
            return f'<iframe title="Timeline" sandbox="allow-scripts" srcdoc="{document}"></iframe>'
        return "<p>Too large for a page: <code>fleet2d view</code> shows it.</p>"
    return "<p>The run stored no floor plan or no key frames: there is no timeline.</p>"


def _again(run: Run) -> str:
    scenario = yaml.safe_dump(run.manifest["scenario"], sort_keys=False, allow_unicode=True)
    directory = run.directory or "RUN_DIR"
    inputs = "".join(
        f"<li>{html.escape(record['path'])} (SHA-256 {record['sha256'][:16]}…)</li>"
        for record in run.manifest["inputs"]
    )
    files = f"<p>It read:</p><ul>{inputs}</ul>" if inputs else ""
    return (
        f"<pre>fleet2d verify {html.escape(str(directory))} --again</pre>"
        f"<p>compares every table with a new run of this scenario:</p>"
        f"<pre>{html.escape(scenario)}</pre>{files}"
    )
