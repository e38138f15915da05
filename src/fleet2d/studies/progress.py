"""The progress of a study while it runs: a bar with the time left."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from fleet2d.runtime.progress import progress_bar
from fleet2d.studies.driver import Observer

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from fleet2d.studies.directory import Counts
    from fleet2d.studies.results import VariantResult
    from fleet2d.studies.tuning import TuneObserver


class BarObserver(Observer):
    """Shows the progress of a study as a bar."""

    def __init__(self, progress: "Progress") -> None:
        """Show a bar without a total."""
        self._progress = progress
        self._task: TaskID = progress.add_task("checking", total=None)
        self._start_s = time.monotonic()
        self._finished = 0
        self._failed = 0

    def on_note(self, text: str) -> None:
        """Print a remark above the bar."""
        self._progress.console.print(f"note: {text}", highlight=False, markup=False)

    def on_check(self, done: int, total: int) -> None:
        """Show the number of checked set-ups."""
        self._progress.update(self._task, completed=done, total=total, description="checking homes")

    def on_start(self, counts: "Counts", workers: int) -> None:
        """Show the number of variants that are complete."""
        self._start_s = time.monotonic()
        self._progress.reset(
            self._task, total=counts.total, completed=counts.complete, description="running"
        )

    def on_result(self, result: "VariantResult") -> None:
        """Show one more variant, with the rate and the failures; Rich adds the time left."""
        self._finished += 1
        self._failed += not result.is_complete
        text = _rate(self._finished / max(time.monotonic() - self._start_s, 1e-9))
        if self._failed:
            text += f", {self._failed} failed"
        self._progress.update(self._task, advance=1, description=text)


def _rate(per_second: float) -> str:
    """Return a rate as text.

    >>> _rate(12.3), _rate(0.05)
    ('12.3 variants/s', '3.0 variants/min')
    """
    if per_second >= 1:
        return f"{per_second:.1f} variants/s"
    return f"{60 * per_second:.1f} variants/min"


@contextmanager
def observing(*, quiet: bool = False) -> Iterator[Observer]:
    """Yield an observer of a study, which prints remarks and shows the progress.

    Args:
        quiet: Show nothing.
    """
    with progress_bar(show=not quiet) as progress:
        yield Observer() if quiet else BarObserver(progress)


@contextmanager
def observing_trials(*, show: bool) -> "Iterator[TuneObserver]":
    """Yield an observer of a search, whose progress is shown if `show`."""
    with progress_bar(show=show) as progress:
        task = progress.add_task("trials", total=None)

        def update(done: int, trials: int, best: float) -> None:
            progress.update(task, completed=done, total=trials, description=f"best {best:.4g}")

        yield update
