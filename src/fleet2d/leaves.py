"""What shows and judges runs: named from above, so that what is shown knows nothing of it.

A few methods of `Run` and `FloorPlan` hand over to it. Everything else works without.
"""

from collections.abc import Callable
from typing import Any, Protocol

from fleet2d.errors import InputError


class Views(Protocol):
    """What draws and shows runs and floor plans; `fleet2d.viewer.notebook` does."""

    def draw_run(self, run: Any, at: str | int | None, axes: Any, theme: str) -> Any:
        """Return a figure of a run, or of a moment of it."""

    def draw_plan(self, plan: Any, axes: Any, theme: str) -> Any:
        """Return a figure of a floor plan."""

    def plan_png(self, plan: Any) -> bytes | None:
        """Return a picture of a floor plan, if one can be drawn."""

    def run_html(self, run: Any) -> str:
        """Return a run as a notebook shows it."""

    def run_widget(self, run: Any, height: int) -> Any:
        """Return the page of a run as a widget of a height [pixels]."""


class Judges(Protocol):
    """What judges finished runs; `fleet2d.engine.reproduce` does."""

    def judge_again(self, run: Any, expectation: Any, name: str) -> Any:
        """Return the verdict on what is expected of a run."""


_load: list[Callable[[], Views]] = []
_load_judges: list[Callable[[], Judges]] = []


def register_judges(load: Callable[[], Judges]) -> None:
    """Name what judges finished runs from now on.

    Args:
        load: Returns it; called when something is judged.
    """
    _load_judges[:] = [load]


def judges() -> Judges:
    """Return what judges finished runs.

    Raises:
        InputError: There is nothing.
    """
    if not _load_judges:
        raise InputError("nothing is registered that could judge a run")
    return _load_judges[0]()


def register_views(load: Callable[[], Views]) -> None:
    """Name what shows runs and homes from now on.

    Args:
        load: Returns it; called when something is shown.
    """
    _load[:] = [load]


def views() -> Views:
    """Return what shows runs and homes.

    Raises:
        InputError: There is none, or it needs a library that isn't installed.
    """
    if not _load:
        raise InputError("nothing is registered that could show this")
    try:
        return _load[0]()
    except ModuleNotFoundError as error:
        raise InputError(f"showing this needs {error.name}, which is not installed") from None
