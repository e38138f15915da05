"""The page of a run as a widget, for Jupyter, marimo and whatever else shows anywidgets."""

from pathlib import Path

from fleet2d.errors import InputError
from fleet2d.runs.run import Run
from fleet2d.viewer.export import embedded_run, html_of
from fleet2d.viewer.shown_run import ShownRun

try:
    import anywidget
    import traitlets
except ImportError:
    raise InputError('a widget needs anywidget: pip install "fleet2d[view]"') from None


class RunWidget(anywidget.AnyWidget):  # type: ignore[misc]
    """The page of a run in a frame of its own.

    Attributes:
        content: The page, with the run in it.
        height: Of the frame [pixels].
    """

    _esm = Path(__file__).parent / "widget.js"
    content = traitlets.Unicode().tag(sync=True)
    height = traitlets.Int(720).tag(sync=True)


def run_widget(run: Run, height: int) -> RunWidget:
    """Return the page of a run as a widget; see `Run.view`."""
    held = embedded_run(ShownRun(run), 0, run.manifest["steps"])
    return RunWidget(content=html_of([held]), height=height)
