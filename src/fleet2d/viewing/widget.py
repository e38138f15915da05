"""The page of a run as an anywidget, for Jupyter, marimo and other notebooks."""

from pathlib import Path

from fleet2d.errors import extra
from fleet2d.runs.run import Run
from fleet2d.viewing.page_data import PageData, embedded_run, html_of

with extra("view", "a widget needs anywidget"):
    import anywidget
    import traitlets


class RunWidget(anywidget.AnyWidget):  # type: ignore[misc]
    """The page of a run in a frame.

    Attributes:
        content: The HTML of the page, with the data of the run.
        height: The height of the frame [pixels].
    """

    _esm = Path(__file__).parent / "widget.js"
    content = traitlets.Unicode().tag(sync=True)
    height = traitlets.Int(720).tag(sync=True)


def run_widget(run: Run, height: int) -> RunWidget:
    """Return the page of a run as a widget; see `Run.view`."""
    embedded = embedded_run(PageData(run), 0, run.manifest["steps"])
    return RunWidget(content=html_of([embedded]), height=height)
