"""Runs and homes in notebooks: figures, pictures and the widget."""

import base64
import html
import io
from contextlib import suppress
from typing import Any

from fleet2d.errors import Fleet2DError, extra
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.runs.moments import step_of
from fleet2d.runs.run import Run
from fleet2d.runs.verdicts import verdict_line, verdicts_of
from fleet2d.viewing.run_facts import run_title

NOTEBOOK_DPI = 100


def draw(shown: Run | FloorPlan | Home, at: str | int | None = None, ax: Any = None) -> Any:
    """Draw a run, one moment of it, or a home; needs the extra `viz`.

    Args:
        shown: The run or home.
        at: A moment of a run, such as "day 3 18:30", or a step; None: the whole run.
        ax: Matplotlib axes to draw on, in metres: a home, or a moment (the last one, if `at` is
            None); None for a new figure.

    Returns:
        A matplotlib figure, or `ax`.

    Raises:
        InputError: `at` names no moment, or matplotlib is missing.
        ArtifactError: The run stored no floor plan or no key frames.
    """
    if isinstance(shown, Run):
        return _draw_run(shown, at, ax)
    return _draw_plan(shown.plan if isinstance(shown, Home) else shown, ax)


def _draw_run(run: Run, at: str | int | None, axes: Any) -> Any:
    from fleet2d.viewing.figures import moment_figure, moment_on_axes
    from fleet2d.viewing.pictures.run import run_figure

    last = run.manifest["steps"] - 1
    step = step_of(at, run.clock, "at") if isinstance(at, str) else at
    if axes is not None:
        moment_on_axes(run, last if step is None else min(step, last), axes)
        return axes
    return run_figure(run) if step is None else moment_figure(run, step)


def _draw_plan(plan: FloorPlan, axes: Any) -> Any:
    with extra("viz", "drawing needs matplotlib"):
        from matplotlib.figure import Figure
    from fleet2d.viewing.pictures.floorplan import drawing_style, figure_size, floorplan_axes

    if axes is not None:
        floorplan_axes(plan, axes, title=False)
        return axes
    with drawing_style():
        figure = Figure(figsize=figure_size(plan))
        floorplan_axes(plan, figure.add_axes((0, 0, 1, 1)))
        return figure


def home_png(home: FloorPlan | Home) -> bytes | None:
    """Return a PNG of a home; None if matplotlib is not installed."""
    with suppress(Fleet2DError, ImportError):
        return figure_png(draw(home))
    return None


def view(run: Run, height: int = 720) -> Any:
    """Return the page of a run as a widget, for Jupyter and marimo; needs the extra `view`.

    Args:
        run: The run.
        height: Height of the widget [pixels].

    Raises:
        InputError: anywidget is not installed.
        ArtifactError: The run stored no floor plan.
    """
    from fleet2d.viewing import widget

    return widget.run_widget(run, height)


VIOLATED_STYLE = "border-left: 5px solid #c8452f; padding-left: .6em"


def verdict_html(run: Run) -> str:
    """Return the verdicts on a run, and its failure, as HTML; empty if there are none."""
    verdicts = verdicts_of(run)
    failure = "the run failed" if run.status == "failed" else ""
    line = html.escape("; ".join(filter(None, (failure, verdict_line(run, verdicts)))))
    says = [verdict.says for verdict in verdicts if verdict.outcome == "violated"]
    if not failure and not says:
        return line and f"<p>{line}</p>"
    items = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in says)
    return f'<div style="{VIOLATED_STYLE}"><b>\N{BALLOT X} {line}</b><ul>{items}</ul></div>'


def run_html(run: Run) -> str:
    """Return a run as HTML for notebooks: its verdicts, its facts and its picture."""
    clock = run.clock
    entities = run.manifest["entities"]
    facts = [
        run.status,
        f"{clock.start:%Y-%m-%d %H:%M} to {clock.time(clock.steps):%Y-%m-%d %H:%M}",
        ", ".join([*entities["users"], *entities["robots"]]) or "nobody",
        f"seed {run.manifest['seed']}",
        f"digest {run.digest[:12]}" if run.digest else "no digest",
    ]
    text = html.escape(" · ".join(facts))
    picture = ""
    with suppress(Fleet2DError, ImportError):  # no matplotlib or no floor plan
        content = base64.b64encode(figure_png(draw(run))).decode()
        image = f"data:image/png;base64,{content}"
        picture = f'<img alt="The run in its home" style="max-width:100%" src="{image}">'
    title = html.escape(run_title(run))
    return f"<div><b>{title}</b>{verdict_html(run)}<p>{text}</p>{picture}</div>"


def figure_png(figure: Any) -> bytes:
    """Return a figure as a PNG, without the version of matplotlib."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=NOTEBOOK_DPI, metadata={"Software": None})
    return picture.getvalue()
