"""How long a study takes: a forecast before it runs, and a bar with the time left while it does."""

import math
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import timedelta
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.configuration.trust import restrict
from fleet2d.errors import ComponentError, Fleet2DError
from fleet2d.runtime.clock import DAY_S, HOUR_S
from fleet2d.studies.driver import Observer
from fleet2d.studies.executors import Executor, FinishedTask, TaskSchedule, WorkerTask, cores
from fleet2d.studies.plan import SetupJob, StudyPlan
from fleet2d.studies.simulator import RunSpeed, measure

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from fleet2d.studies.directory import Counts
    from fleet2d.studies.records import VariantRecord
    from fleet2d.studies.tuning import TuneObserver


MIN_RUNS = 5  # that have finished before the time left is estimated
CONFIDENCE = 2.0  # standard errors: 95 %
MIN_SAMPLES, MAX_SAMPLES = 4, 24  # variants that are measured for a forecast
MEASURING_S = 15.0  # wall time after which MIN_SAMPLES are enough
STRATA = 32  # of equal size, from which variants are drawn; a power of 2
PRECISION = 0.1  # relative error at which they are enough, too
MODEL_ERROR = 0.1  # of a forecast: the first days of a run differ from the others


@dataclass(frozen=True)
class Forecast:
    """The time that a study will take.

    Attributes:
        simulated: The simulated time of all variants.
        shortest: The wall time if nothing else runs on this machine.
        longest: The wall time if other programs use the machine as now.
        core_share: The share of a core that each worker got, 0 to 1.
    """

    simulated: timedelta
    shortest: timedelta
    longest: timedelta
    core_share: float


@dataclass
class SpeedJob(SetupJob):
    """Measures the speed of variants, after a warm-up that loads all code."""

    is_warm: bool = False

    def __call__(self, task: WorkerTask) -> Any:
        """Return the speed of a variant; None if it fails."""
        try:
            with restrict(self.trust):
                scenario = self.design.scenario(task.index)
                if not self.is_warm:
                    measure(scenario, max_s=0.0)
                    self.is_warm = True
                return measure(scenario)
        except Fleet2DError:  # a variant may fail without ending the study
            return None


def forecast(plan: StudyPlan, executor: Executor, checked_s: float = 0.0) -> Forecast:
    """Measure the speed of some variants, on as many workers as will run the study.

    Args:
        plan: The study.
        executor: Its workers.
        checked_s: The wall time of all checks, which come before the runs of a study [s].

    Raises:
        ComponentError: All measured variants fail.
    """
    variants, begin_s = plan.variants, time.perf_counter()
    count, start_s = len(variants), 0.0
    places = _spread(count)
    # Groups of one task each start in their order.
    tasks = [WorkerTask(i, variants[at].index, "", str(i)) for i, at in enumerate(places)]
    speeds, simulated_s = list[RunSpeed](), list[float]()
    mean_simulated_s = variants.total_simulated_s / count
    finished, tried = dict[int, RunSpeed | None](), 0
    with closing(executor.run(SpeedJob(plan.design), TaskSchedule(tasks))) as events:
        for number, event in enumerate(events):
            speed = event.payload if isinstance(event, FinishedTask) else None
            elapsed_s = time.perf_counter() - begin_s
            if not number and speed is not None:
                start_s = max(elapsed_s - speed.wall_s, 0.0)
            finished[event.task.number] = speed
            # Those that finish early are short: a sample has all that began before its last.
            while (speed := finished.get(tried)) is not None or tried in finished:
                if speed is not None:
                    speeds.append(speed)
                    simulated_s.append(variants[places[tried]].simulated_s)
                tried += 1
            if len(speeds) < MIN_SAMPLES:
                continue
            _, error = _mean_run(speeds, simulated_s, mean_simulated_s, count)
            if error < PRECISION or elapsed_s - start_s > MEASURING_S:
                break
    if not speeds:
        raise ComponentError("all measured variants fail: run one of them with `fleet2d run`")
    run_s, error = _mean_run(speeds, simulated_s, mean_simulated_s, count)
    workers = min(executor.workers, count)
    # The first variant finds its home built by the warm-up.
    homes_s = len(variants.home_keys) * max(speed.home_s for speed in speeds)
    wall_s = checked_s + start_s + (homes_s + count * run_s) / workers
    longest_s = max(map(RunSpeed.seconds, speeds, simulated_s))
    last_s = longest_s * (1 - 1 / workers)  # the others wait for the last worker
    core_share = float(np.mean([speed.core_share for speed in speeds]))
    core_share = min(core_share * max(workers / cores(), 1.0), 1.0)  # not what workers share
    error += MODEL_ERROR
    return Forecast(
        timedelta(seconds=variants.total_simulated_s),
        timedelta(seconds=wall_s * core_share * max(1 - error, 0.0)),
        timedelta(seconds=wall_s * (1 + error) + last_s),
        core_share,
    )


def _spread(count: int) -> list[int]:
    """Return places of at most MAX_SAMPLES of `count` variants; the first few are far apart."""
    parts = min(count, STRATA)
    order = sorted(range(parts), key=lambda i: f"{i:b}".zfill(STRATA.bit_length())[::-1])
    edges = np.arange(parts + 1) * count // parts
    places = np.random.Generator(np.random.Philox(0)).integers(edges[:-1], edges[1:])
    return [int(places[i]) for i in order[:MAX_SAMPLES]]


def _mean_run(
    speeds: list[RunSpeed], simulated_s: list[float], mean_simulated_s: float, count: int
) -> tuple[float, float]:
    """Return the mean wall time of `count` runs [s] from some of them, and its relative error.

    The lengths of all runs are known, so only the time for a simulated second is estimated, by
    the ratio estimator (Cochran 1977, Sampling Techniques, chapter 6), beside that of a set-up.

    Args:
        speeds: Of the measured runs.
        simulated_s: The lengths of the measured runs [s].
        mean_simulated_s: The mean length of all runs [s].
        count: The number of all runs.
    """
    setups_s, lengths_s = np.array([each.setup_s for each in speeds]), np.array(simulated_s)
    moves_s = lengths_s / [each.speedup for each in speeds]
    setup_s, ratio = float(setups_s.mean()), float(moves_s.sum() / lengths_s.sum())
    mean_s, n = setup_s + ratio * mean_simulated_s, len(speeds)
    residuals_s = setups_s - setup_s + moves_s - ratio * lengths_s
    deviation_s = float(np.linalg.norm(residuals_s)) / math.sqrt(max(n - 1, 1))
    return mean_s, CONFIDENCE * deviation_s / mean_s * math.sqrt(1 / n - 1 / count)


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
        n, rest = self.finished, self.missing - self.finished
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

    def on_result(self, record: "VariantRecord") -> None:
        """Show one more variant, with rate, failures and the time left."""
        seconds = record.header.get("wall_s", {}).get("total", 0.0)
        if not self._left.finished:
            self._start_s = time.monotonic() - seconds  # workers take a while to start
        self._left.add(seconds)
        self._failed += not record.is_complete
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


class NoteObserver(Observer):
    """Prints remarks on stderr."""

    def on_note(self, text: str) -> None:
        """Print a remark."""
        sys.stderr.write(f"note: {text}\n")


@contextmanager
def observing(*, quiet: bool = False) -> Iterator[Observer]:
    """Yield an observer of a study: it prints remarks, and shows a bar on a terminal.

    Args:
        quiet: Show nothing.
    """
    with progress_bar(show=sys.stderr.isatty() and not quiet) as progress:
        yield BarObserver(progress) if progress else Observer() if quiet else NoteObserver()


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
