"""Viewing: pictures, films, pages and notebooks of homes and runs.

It is an extension of IPython, which `import fleet2d` loads in a notebook by itself.
"""

from typing import Any


def load_ipython_extension(shell: Any) -> None:
    """Register how Jupyter and IPython show a run or a home at the end of a cell."""
    formatters = shell.display_formatter.formatters
    formatters["text/html"].for_type_by_name("fleet2d.runs.run", "Run", _run_html)
    for module, name in (("plan", "FloorPlan"), ("home", "Home")):
        formatters["image/png"].for_type_by_name(f"fleet2d.floorplan.{module}", name, _home_png)
    # For figures of `draw`; where pyplot has registered its own formatter, that comes first.
    formatters["image/png"].for_type_by_name("matplotlib.figure", "Figure", _figure_png)


def _run_html(run: Any) -> str:
    from fleet2d.viewing.notebook import run_html

    return run_html(run)


def _figure_png(figure: Any) -> bytes:
    from fleet2d.viewing.notebook import figure_png

    return figure_png(figure)


def _home_png(home: Any) -> bytes | None:
    from fleet2d.viewing.notebook import home_png

    return home_png(home)
