"""The progress of a study on a terminal: a bar with rate, time left and failures."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING

from fleet2d.runtime.clock import DAY_S, HOUR_S
from fleet2d.studies.driver import Observer

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from fleet2d.studies.directory import Counts
    from fleet2d.studies.records import VariantRecord
    from fleet2d.studies.tuning import TuneObserver


class BarObserver(Observer):
    """Shows the progress of a study as a bar."""

    def __init__(self, progress: "Progress") -> None:
        """Show a bar without a total."""
        self._progress = progress
        self._task: TaskID = progress.add_task("checking", total=None)
        self._start_s = time.monotonic()
        self._finished = self._failed = 0

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

    def on_result(self, record: "VariantRecord") -> None:
        """Show one more variant, with rate and failures."""
        self._finished += 1
        self._failed += not record.is_complete
        rate = self._finished / max(time.monotonic() - self._start_s, 1e-9)
        failed = f", {self._failed} failed" if self._failed else ""
        self._progress.update(self._task, advance=1, description=f"{_rate(rate)}{failed}")


def _rate(per_second: float) -> str:
    """Return a rate as text.

    >>> _rate(12.3), _rate(0.05)
    ('12.3 variants/s', '3.0 variants/min')
    """
    if per_second >= 1:
        return f"{per_second:.1f} variants/s"
    return f"{60 * per_second:.1f} variants/min"


@contextmanager
def progress_bar(*, show: bool) -> "Iterator[Progress | None]":
    """Yield a progress bar on stderr with counts and time left; None unless `show`."""
    if not show:
        yield None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    text = TextColumn("{task.description}")
    columns = (text, BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        yield progress


@contextmanager
def observing(*, show: bool) -> Iterator[Observer]:
    """Yield an observer of a study; it shows a bar if `show`, else nothing."""
    with progress_bar(show=show) as progress:
        yield BarObserver(progress) if progress else Observer()


def in_words(time_span: timedelta) -> str:
    """Return a duration in its largest fitting unit.

    >>> in_words(timedelta(seconds=200)), in_words(timedelta(hours=30))
    ('3.3 min', '30.0 h')
    """
    seconds = time_span.total_seconds()
    for name, unit in (("years", 31_557_600), ("months", 2_629_800), ("days", DAY_S)):
        if seconds >= 2 * unit:
            return f"{seconds / unit:,.1f} {name}"
    for name, unit in (("h", HOUR_S), ("min", 60)):
        if seconds >= unit:
            return f"{seconds / unit:.1f} {name}"
    return f"{seconds:.1f} s"


@contextmanager
def observing_trials(*, show: bool) -> "Iterator[TuneObserver | None]":
    """Yield an observer of a search; it shows a bar if `show`, else nothing."""
    with progress_bar(show=show) as progress:
        if progress is None:
            yield None
            return
        task = progress.add_task("trials", total=None)

        def update(done: int, trials: int, best: list[float] | None) -> None:
            values = ", ".join(f"{value:.4g}" for value in best or ())
            progress.update(task, completed=done, total=trials, description=f"best {values}")

        yield update
