"""Modules that show and judge runs, registered at run time: lower packages can't import them.

Only a few methods of `Run` and `FloorPlan` need them.
"""

from collections.abc import Callable
from typing import Any, Protocol

from fleet2d.errors import InputError


class Views(Protocol):
    """A module that draws and shows runs and floor plans, like `fleet2d.viewer.notebook`."""

    def draw_run(self, run: Any, at: str | int | None, axes: Any, theme: str) -> Any:
        """Return a figure of a run, or of one moment of it."""

    def draw_plan(self, plan: Any, axes: Any, theme: str) -> Any:
        """Return a figure of a floor plan."""

    def plan_png(self, plan: Any) -> bytes | None:
        """Return a picture of a floor plan as PNG; None if none can be drawn."""

    def run_html(self, run: Any) -> str:
        """Return the HTML of a run for a notebook."""

    def run_widget(self, run: Any, height: int) -> Any:
        """Return the page of a run as a widget of a height [pixels]."""


class Judges(Protocol):
    """A module that judges finished runs, like `fleet2d.engine.reproduce`."""

    def judge_again(self, run: Any, expectation: Any, name: str) -> Any:
        """Return the verdict on an expectation of a run."""


_load_views: list[Callable[[], Views]] = []
_load_judges: list[Callable[[], Judges]] = []


def register_judges(load: Callable[[], Judges]) -> None:
    """Register the module that judges finished runs.

    Args:
        load: Returns the module; called when it is needed.
    """
    _load_judges[:] = [load]


def judges() -> Judges:
    """Return the module that judges finished runs.

    Raises:
        InputError: None is registered.
    """
    if not _load_judges:
        raise InputError("nothing is registered that could judge a run")
    return _load_judges[0]()


def register_views(load: Callable[[], Views]) -> None:
    """Register the module that shows runs and floor plans.

    Args:
        load: Returns the module; called when it is needed.
    """
    _load_views[:] = [load]


def views() -> Views:
    """Return the module that shows runs and floor plans.

    Raises:
        InputError: None is registered, or it needs a library that isn't installed.
    """
    if not _load_views:
        raise InputError("nothing is registered that could show this")
    try:
        return _load_views[0]()
    except ModuleNotFoundError as error:
        raise InputError(f"showing this needs {error.name}, which is not installed") from None
