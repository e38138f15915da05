"""The progress of a study while it runs: a bar with the time left."""

import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from typing import TYPE_CHECKING

from fleet2d.runtime.clock import DAY_S, HOUR_S
from fleet2d.runtime.progress import progress_bar
from fleet2d.studies.driver import Observer

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from fleet2d.studies.directory import Counts
    from fleet2d.studies.results import VariantResult
    from fleet2d.studies.tuning import TuneObserver


MIN_RUNS = 5  # that have finished before the time left is estimated
CONFIDENCE = 2.0  # standard errors: 95 %


@dataclass
class TimeLeft:
    """The wall time that the rest of a study takes, from the runs that have finished.

    The others are taken to go on at the rate so far, which shows how many workers there are, what
    they do beside their runs, and what else the machine does. As runs take different times, the
    estimate is an interval: of the mean of the runs so far as a sample, and of those that are left.

    Attributes:
        missing: The number of variants to run.
        workers: How many run at a time.

    Example:
        >>> left = TimeLeft(missing=100, workers=2)
        >>> for _ in range(10):
        ...     left.add(4.0)
        >>> [round(s) for s in left.interval_s(elapsed_s=20.0)]
        [162, 164]
    """

    missing: int
    workers: int
    finished: int = 0
    _sum_s: float = 0.0
    _sum_squares: float = 0.0
    _longest_s: float = 0.0

    def add(self, seconds: float) -> None:
        """Add a run that has finished, and its wall time [s]."""
        self.finished += 1
        self._sum_s += seconds
        self._sum_squares += seconds**2
        self._longest_s = max(self._longest_s, seconds)

    def interval_s(self, elapsed_s: float) -> tuple[float, float] | None:
        """Return the time left, from and to [s]; None as long as too few have finished.

        Args:
            elapsed_s: The wall time since the first run began.
        """
        n = self.finished
        rest = self.missing - n
        if n < MIN_RUNS or not self._sum_s:
            return None
        mean_s = self._sum_s / n
        variance = max(self._sum_squares / n - mean_s**2, 0.0) * n / (n - 1)
        # Renewal theory: workers that are amid a run have done this many runs more than finished.
        begun = min(self.workers, rest) * (1 - variance / mean_s**2) / 2
        left_s = elapsed_s * max(rest - begun, 0.0) / max(n + begun, 1.0)
        error = CONFIDENCE * math.sqrt(variance * (1 / n + 1 / max(rest, 1))) / mean_s
        last_s = self._longest_s * (1 - 1 / self.workers)  # the others wait for the last worker
        return left_s * max(1 - error, 0.0), left_s * (1 + error) + last_s


class BarObserver(Observer):
    """Shows the progress of a study as a bar."""

    def __init__(self, progress: "Progress") -> None:
        """Show a bar without a total."""
        self._progress = progress
        self._task: TaskID = progress.add_task("checking", total=None)
        self._start_s = time.monotonic()
        self._left = TimeLeft(0, 1)
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
        self._left = TimeLeft(counts.total - counts.complete, workers)
        self._progress.reset(
            self._task, total=counts.total, completed=counts.complete, description="running"
        )

    def on_result(self, result: "VariantResult") -> None:
        """Show one more variant, with rate, failures and the time left."""
        seconds = result.row["wall_s"] or 0.0
        if not self._left.finished:
            self._start_s = time.monotonic() - seconds  # workers take a while to start
        self._left.add(seconds)
        self._failed += not result.is_complete
        elapsed_s = max(time.monotonic() - self._start_s, 1e-9)
        text = _rate(self._left.finished / elapsed_s)
        if self._failed:
            text += f", {self._failed} failed"
        if interval := self._left.interval_s(elapsed_s):
            low, high = (in_words(timedelta(seconds=s)) for s in interval)
            text += f", {low} left" if low == high else f", {low} to {high} left"
        self._progress.update(self._task, advance=1, description=text)


def _rate(per_second: float) -> str:
    """Return a rate as text.

    >>> _rate(12.3), _rate(0.05)
    ('12.3 variants/s', '3.0 variants/min')
    """
    if per_second >= 1:
        return f"{per_second:.1f} variants/s"
    return f"{60 * per_second:.1f} variants/min"


class NoteObserver(Observer):
    """Prints remarks on stderr."""

    def on_note(self, text: str) -> None:
        """Print a remark."""
        sys.stderr.write(f"note: {text}\n")


@contextmanager
def observing(*, quiet: bool = False) -> Iterator[Observer]:
    """Yield an observer of a study, which prints remarks and shows the progress.

    Args:
        quiet: Show nothing.
    """
    with progress_bar(show=not quiet) as progress:
        yield Observer() if quiet else BarObserver(progress)


def in_words(time_span: timedelta) -> str:
    """Return a duration in its largest fitting unit.

    >>> in_words(timedelta(seconds=200)), in_words(timedelta(hours=30))
    ('3.3 min', '30.0 h')
    """
    seconds = time_span.total_seconds()
    units = (
        ("years", 31_557_600),
        ("months", 2_629_800),
        ("days", DAY_S),
        ("h", HOUR_S),
        ("min", 60),
    )
    for name, unit in units:
        if seconds >= unit * (2 if unit >= DAY_S else 1):
            return f"{seconds / unit:,.1f} {name}"
    return f"{seconds:.1f} s"


@contextmanager
def observing_trials(*, show: bool) -> "Iterator[TuneObserver]":
    """Yield an observer of a search, whose progress is shown if `show`."""
    with progress_bar(show=show) as progress:
        task = progress.add_task("trials", total=None)

        def update(done: int, trials: int, best: list[float] | None) -> None:
            values = ", ".join(f"{value:.4g}" for value in best or ())
            progress.update(task, completed=done, total=trials, description=f"best {values}")

        yield update
