"""How long a study takes: a forecast before it runs, and a bar with the time left while it does."""

import itertools
import math
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from datetime import timedelta
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fleet2d.errors import ComponentError, Fleet2DError
from fleet2d.kernels import F64
from fleet2d.runtime.clock import DAY_S, HOUR_S
from fleet2d.runtime.progress import progress_bar
from fleet2d.studies.directory import StudyDirectory
from fleet2d.studies.driver import CheckedStudy, Observer, StudyJob
from fleet2d.studies.executors import Executor, FinishedTask, TaskSchedule, WorkerTask, cores
from fleet2d.studies.plan import PlannedVariants
from fleet2d.studies.records import VariantRecord, record_of
from fleet2d.studies.simulator import RunSpeed, VariantOutcome, measure

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from fleet2d.studies.directory import Counts
    from fleet2d.studies.tuning import TuneObserver


MIN_RUNS = 5  # that have finished before the time left is estimated
CONFIDENCE = 2.0  # standard errors: 95 %
# variants that are measured for a forecast
MIN_SAMPLES = 4
MAX_SAMPLES = 24
WARM_UP_S = 0.3  # processor time until a worker is as fast as in the middle of a study
MEASURING_S = 15.0  # wall time after which MIN_SAMPLES are enough
PRECISION = 0.1  # relative error at which they are enough, too
MODEL_ERROR = 0.15  # of a forecast: machines change their speed, runs their first days
MIN_FREEDOM = 3  # of the differences within strata


class Forecast(NamedTuple):
    """The time that a study will take if other programs go on as they do now.

    Attributes:
        simulated: The simulated time of all variants.
        shortest: The lower end of the wall time.
        longest: The upper end.
        core_share: The share of a core that each worker got, 0 to 1.
    """

    simulated: timedelta
    shortest: timedelta
    longest: timedelta
    core_share: float


class SpeedSample(NamedTuple):
    """What one variant of a study takes.

    Attributes:
        speed: The speed of its run.
        home_s: The wall time of building its home; 0 if the worker had it [s].
        warm_s: The wall time for which its worker was warmed up beyond loading all code [s].
        record: Its results so far.
    """

    speed: RunSpeed
    home_s: float
    warm_s: float
    record: VariantRecord


@dataclass
class SpeedJob(StudyJob):
    """Does for some seconds what workers of a study do, after a warm-up that loads all code.

    Attributes:
        homes: The home of each task, by its number.
    """

    homes: Sequence[str] = ()
    _built: set[str] = field(default_factory=set)

    def __call__(self, task: WorkerTask) -> Any:
        """Return the sample of a variant; None if it fails."""
        home = self.homes[task.number]
        is_first = not self._built
        first_s = 0.0
        warm_s = 0.0
        try:
            if home not in self._built:
                first_s = self._measure(task, max_s=0.0)[0].setup_s
            begin_s, begin_core_s = time.perf_counter(), time.process_time()
            while is_first and time.process_time() - begin_core_s < WARM_UP_S:
                self._measure(task, max_s=0.0)
                warm_s = time.perf_counter() - begin_s
            speed, outcome = self._measure(task)
        except Fleet2DError:  # a variant may fail without ending the study
            return None
        self._built.add(home)
        # The first set-up of a worker loads all code.
        home_s = 0.0 if is_first else max(first_s - speed.setup_s, 0.0)
        return SpeedSample(speed, home_s, warm_s, record_of(task, outcome))

    def _measure(self, task: WorkerTask, max_s: float = 2.0) -> tuple[RunSpeed, VariantOutcome]:
        return measure(lambda: self.scenario(task), self.metrics, self.tables, max_s)


def forecast(
    checked: CheckedStudy,
    executor: Executor,
    checked_s: float = 0.0,
    observer: Observer | None = None,
) -> Forecast:
    """Measure the speed of some variants, on as many workers as will run the study.

    Args:
        checked: The study.
        executor: Its workers.
        checked_s: The wall time of all checks, which come before the runs of a study [s].
        observer: Receives remarks about metrics that the measured variants lack.

    Raises:
        ComponentError: All measured variants fail.
    """
    variants = checked.plan.variants
    begin_s = time.perf_counter()
    start_s = 0.0
    strata = Strata(variants)
    places = strata.places()
    planned = [variants.task(place) for place in places]
    # Groups of one task each start in their order.
    tasks = [replace(task, number=i, home=str(i)) for i, task in enumerate(planned)]
    finished = dict[int, SpeedSample | None]()
    tried = 0
    # samples by place
    measured = dict[int, SpeedSample]()
    total_s = 0.0
    error_s = 0.0
    job = checked.job
    homes = [task.home for task in planned]
    speed_job = SpeedJob(job.design, job.metrics, job.tables, homes)
    with closing(executor.run(speed_job, TaskSchedule(tasks))) as events:
        for number, event in enumerate(events):
            sample = event.payload if isinstance(event, FinishedTask) else None
            elapsed_s = time.perf_counter() - begin_s
            if not number and sample is not None:
                measured_s = sample.warm_s + sample.speed.fixed_s + sample.speed.moving_s
                start_s = max(elapsed_s - measured_s, 0.0)
            finished[event.task.number] = sample
            # Those that finish early are short: a sample has all that began before its last.
            while tried in finished:
                if (sample := finished[tried]) is not None:
                    measured[places[tried]] = sample
                tried += 1
            if not measured:
                continue
            total_s, error_s = strata.total(measured)
            is_late = elapsed_s - start_s > MEASURING_S
            if len(measured) >= MIN_SAMPLES and (is_late or error_s < PRECISION * total_s):
                break
    samples = list(measured.values())
    if not samples:
        raise ComponentError("all measured variants fail: run one of them with `fleet2d run`")
    if observer is not None:
        checked.note_missing((sample.record.header for sample in samples), observer)
    workers = min(executor.workers, len(variants))
    homes_s = max(len(variants.home_keys), workers) * max(sample.home_s for sample in samples)
    wall_s = checked_s + start_s + (homes_s + total_s) / workers
    if job.tables:
        wall_s += _storing_s(samples) * variants.total_simulated_s
    longest_s = float(strata.seconds(measured).max())
    core_share = float(np.mean([sample.speed.core_share for sample in samples]))
    error_s = error_s / workers + MODEL_ERROR * wall_s
    return Forecast(
        timedelta(seconds=variants.total_simulated_s),
        timedelta(seconds=max(wall_s - error_s, 0.0)),
        timedelta(seconds=wall_s + error_s + longest_s * (1 - 1 / workers)),  # the last runs alone
        min(core_share * max(workers / cores(), 1.0), 1.0),  # not what workers share
    )


class Strata:
    """The variants of a study in blocks, from each of which some are measured.

    A block has the variants of one combination, or of some that follow each other if there are
    more than MAX_SAMPLES.
    """

    def __init__(self, variants: PlannedVariants) -> None:
        """Divide variants into blocks."""
        combination = variants.index // variants.seeds
        _, block = np.unique(combination, return_inverse=True)
        count = int(block[-1]) + 1
        self._stratum = block * min(count, MAX_SAMPLES) // count
        self._sizes = np.bincount(self._stratum)
        self._lengths_s = variants.simulated_s[combination]

    def places(self) -> list[int]:
        """Return the places of at most MAX_SAMPLES variants, of all blocks in turn."""
        random = np.random.Generator(np.random.Philox(0))
        count = len(self._sizes)
        # By reversed bits the first few blocks are far apart.
        order = sorted(range(count), key=lambda i: f"{i:b}".zfill(count.bit_length())[::-1])
        begins = np.cumsum(self._sizes) - self._sizes
        drawn = [
            (begin + random.choice(size, min(size, MAX_SAMPLES), replace=False)).tolist()
            for begin, size in zip(begins.tolist(), self._sizes.tolist(), strict=True)
        ]
        rounds = itertools.zip_longest(*(drawn[stratum] for stratum in order))
        places = (place for each in rounds for place in each if place is not None)
        return list(itertools.islice(places, MAX_SAMPLES))

    def total(self, measured: Mapping[int, SpeedSample]) -> tuple[float, float]:
        """Return the wall time of all runs one after the other, and its error [s].

        Lengths are known, so all runs are estimated from the mean time of a set-up and that of a
        simulated second, and each block is corrected by what its measured runs differ from that:
        the difference estimator of stratified samples (Särndal, Swensson and Wretman 1992, Model
        Assisted Survey Sampling, chapter 6).

        Args:
            measured: The samples of the measured variants, by their places.
        """
        places = list(measured)
        fixed_s = _fixed_s(measured)
        lengths_s = self._lengths_s[places]
        seconds = self.seconds(measured)
        fixed_mean_s = float(fixed_s.mean())
        ratio = float((seconds - fixed_s).sum() / lengths_s.sum())
        residuals_s = seconds - fixed_mean_s - ratio * lengths_s
        stratum = self._stratum[places]
        sizes = self._sizes
        counts = np.bincount(stratum, minlength=len(sizes))
        means_s = np.bincount(stratum, residuals_s, len(sizes)) / np.maximum(counts, 1)
        within_s = residuals_s - means_s[stratum]
        freedom = len(places) - int((counts > 0).sum())
        deviation_s = float(np.linalg.norm(residuals_s)) / math.sqrt(max(len(places) - 2, 1))
        within = np.linalg.norm(within_s) / math.sqrt(max(freedom, 1))
        of_measured_s = float(within) if freedom >= MIN_FREEDOM else deviation_s
        inverse = 1 / np.maximum(counts, 1) - 1 / sizes
        errors_s = np.where(counts > 0, of_measured_s * np.sqrt(inverse), deviation_s)
        total_s = len(self._stratum) * fixed_mean_s + ratio * float(self._lengths_s.sum())
        total_s += float((sizes * means_s).sum())
        return total_s, CONFIDENCE * float(np.linalg.norm(sizes * errors_s))

    def seconds(self, measured: Mapping[int, SpeedSample]) -> F64:
        """Return the wall time of each measured variant, whole and in a home that is there [s]."""
        speeds = [sample.speed for sample in measured.values()]
        moving = [speed.moving_s / max(speed.simulated_s, 1e-6) for speed in speeds]
        return np.asarray(_fixed_s(measured) + self._lengths_s[list(measured)] * moving)


def _fixed_s(measured: Mapping[int, SpeedSample]) -> F64:
    return np.array([sample.speed.fixed_s for sample in measured.values()])


def _storing_s(samples: Sequence[SpeedSample]) -> float:
    """Return the wall time of storing the tables of a simulated second [s]."""
    storing_s = 0.0
    for part in (samples[:1], samples):  # the first loads all code
        with tempfile.TemporaryDirectory() as folder:
            directory = StudyDirectory(folder)
            begin_s = time.perf_counter()
            journal = directory.open_journal(())
            for sample in part:
                journal.append(sample.record)
            directory.commit(journal, ())
            storing_s = time.perf_counter() - begin_s
    return storing_s / max(sum(sample.speed.simulated_s for sample in samples), 1e-6)


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
        rest = self.missing - self.finished
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
