"""How long studies take: said before and while they run, whatever runs and workers do."""

import heapq
import time
from collections.abc import Generator

import numpy as np
import pytest
from tests.studies.scenes import SPEED, base, small

from fleet2d.errors import ComponentError
from fleet2d.studies.directory import StudyDirectory
from fleet2d.studies.driver import CheckedStudy, check_study
from fleet2d.studies.executors import (
    Event,
    FinishedTask,
    SerialExecutor,
    TaskSchedule,
    WorkerJob,
    WorkerTask,
)
from fleet2d.studies.plan import StudyPlan
from fleet2d.studies.progress import (
    MAX_SAMPLES,
    MIN_RUNS,
    MIN_SAMPLES,
    MODEL_ERROR,
    Forecast,
    SpeedJob,
    SpeedSample,
    TimeLeft,
    forecast,
)
from fleet2d.studies.records import record_of
from fleet2d.studies.simulator import RunSpeed, VariantOutcome


def forecasts(
    times_s: list[float], workers: int, start_s: float, pause_s: float, after: int
) -> tuple[tuple[float, float] | None, float]:
    """The interval after some runs have finished, and the time that the rest really took [s]."""
    left, waiting = TimeLeft(len(times_s), workers), list(reversed(times_s))
    running: list[tuple[float, float]] = []
    for _ in range(min(workers, len(times_s))):
        seconds = waiting.pop()
        heapq.heappush(running, (start_s + seconds, seconds))
    interval, asked_s, now_s = None, 0.0, 0.0
    while running:
        now_s, seconds = heapq.heappop(running)
        left.add(seconds)
        if left.finished == after:
            interval, asked_s = left.interval_s(now_s - start_s), now_s
        if waiting:
            following = waiting.pop()
            heapq.heappush(running, (now_s + pause_s + following, following))
    return interval, now_s - asked_s


@pytest.mark.parametrize("workers", [1, 2, 16])
@pytest.mark.parametrize(("spread", "least"), [(0.0, 100), (0.3, 90), (1.0, 85)])
def test_the_time_left_is_within_30_percent_and_the_interval_holds(
    workers: int, spread: float, least: int
) -> None:
    inside, errors = 0, []
    for seed in range(100):
        random = np.random.default_rng(seed)
        times_s = (4.0 * np.exp(spread * random.standard_normal(1000))).tolist()
        interval, truth_s = forecasts(times_s, workers, start_s=2.0, pause_s=0.2, after=100)
        assert interval is not None
        errors.append(abs(sum(interval) / 2 / truth_s - 1))
        inside += interval[0] * 0.93 <= truth_s <= interval[1] * 1.07  # the last runs
    assert least <= inside
    assert np.quantile(errors, 0.95) < 0.3


def test_nothing_is_said_of_the_first_runs() -> None:
    interval, _ = forecasts([4.0] * 50, 2, start_s=0.0, pause_s=0.0, after=MIN_RUNS - 1)
    assert interval is None


def test_half_the_workers_take_twice_as_long() -> None:
    four, _ = forecasts([4.0] * 400, 4, start_s=0.0, pause_s=0.0, after=40)
    two, _ = forecasts([4.0] * 400, 2, start_s=0.0, pause_s=0.0, after=40)
    assert four is not None
    assert two is not None
    assert sum(two) == pytest.approx(2 * sum(four), rel=0.05)


class Measured(SerialExecutor):
    """Measures 2 s for a home, and an hour each second after the set-ups that are given [s]."""

    def __init__(self, setups_s: list[float], workers: int = 1, core_share: float = 1.0) -> None:
        self.setups_s, self.workers, self.core_share = setups_s, workers, core_share
        self.tasks: list[int] = []

    def run(self, job: WorkerJob, tasks: TaskSchedule) -> Generator[Event]:
        while (task := tasks.take(self)) is not None:
            setup_s = self.setup_s(task)
            self.tasks.append(task.index)
            speed = RunSpeed(setup_s, 1.0, 3600.0, core_share=self.core_share)
            record = record_of(task, VariantOutcome("complete"))
            yield FinishedTask(task, SpeedSample(speed, 2.0, 0.0, record), 1)

    def setup_s(self, task: WorkerTask) -> float:
        return self.setups_s[len(self.tasks) % len(self.setups_s)]


def ten_homes() -> CheckedStudy:
    """Thirty variants of two hours, in ten homes."""
    return check_study(small(base=base("2 h"), axes={"home": {"synthetic": 10}}, replicates=3))


def seconds(said: Forecast) -> tuple[float, float]:
    return said.shortest.total_seconds(), said.longest.total_seconds()


def within(truth_s: float) -> tuple[float, float]:
    return truth_s * (1 - MODEL_ERROR), truth_s * (1 + MODEL_ERROR)


def test_a_forecast_counts_the_checks_each_home_and_each_variant() -> None:
    said = forecast(ten_homes(), Measured([0.5]), checked_s=5.0)
    assert 60 * 3600 == pytest.approx(said.simulated.total_seconds())
    assert within(5 + 10 * 2 + 30 * (0.5 + 2)) == pytest.approx(seconds(said), abs=0.1)


def test_a_forecast_of_two_workers_waits_for_the_last_run() -> None:
    low_s, high_s = seconds(forecast(ten_homes(), Measured([0.5], workers=2)))
    assert within((10 * 2 + 30 * 2.5) / 2) == pytest.approx((low_s, high_s - 1.25), abs=0.1)


def test_each_worker_builds_the_only_home() -> None:
    said = forecast(check_study(small(base=base("2 h"))), Measured([0.5], workers=2))
    assert (2 * 2 + 6 * 2.5) / 2 * (1 - MODEL_ERROR) == pytest.approx(seconds(said)[0], abs=0.1)


def test_other_programs_are_taken_to_go_on() -> None:
    alone, beside = (forecast(ten_homes(), Measured([0.5], core_share=c)) for c in (1.0, 0.25))
    assert seconds(alone) == pytest.approx(seconds(beside), abs=0.1)
    assert (alone.core_share, beside.core_share) == (1.0, 0.25)


def test_runs_that_differ_are_measured_until_their_mean_is_known() -> None:
    alike, differing = Measured([0.5]), Measured([0.5, 40.0, 40.0])
    forecast(ten_homes(), alike)
    low_s, high_s = seconds(forecast(ten_homes(), differing))
    assert (MIN_SAMPLES, MAX_SAMPLES) == (len(alike.tasks), len(differing.tasks))
    assert low_s < 10 * 2 + 30 * (26.83 + 1 + 1) < high_s


class TwoRobots(Measured):
    """One of the two robots takes 40 s for a set-up."""

    def __init__(self, checked: CheckedStudy) -> None:
        super().__init__([0.5])
        self.design = checked.plan.design

    def setup_s(self, task: WorkerTask) -> float:
        return 40.0 if self.design.parameters(task.index)[SPEED] == 0.6 else 0.5


def test_axes_whose_values_take_different_times_make_no_forecast_uncertain() -> None:
    """Without blocks of combinations the range would be a third wider at each end."""
    checked = check_study(small(base=base("2 h"), replicates=100))
    executor = TwoRobots(checked)
    said = forecast(checked, executor)
    assert within(2 + 100 * (40 + 2) + 100 * 2.5) == pytest.approx(seconds(said), rel=0.01)
    assert len(executor.tasks) < 10


class ShortestFirst(Measured):
    """Runs all at a time: the shortest end first."""

    def __init__(self, plan: StudyPlan) -> None:
        super().__init__([0.0])
        self.plan = plan

    def run(self, job: WorkerJob, tasks: TaskSchedule) -> Generator[Event]:
        events = list(super().run(job, tasks))
        yield from sorted(events, key=lambda e: self.plan.variants[e.task.index].simulated_s)


def test_runs_of_several_lengths_are_all_part_of_a_forecast() -> None:
    axes = {"simulation.duration": ["2 h", "20 h"]}
    checked = check_study(small(base=base("2 h"), axes=axes, replicates=20))
    said = forecast(checked, ShortestFirst(checked.plan))
    assert within(2 + 20 * (2 + 20)) == pytest.approx(seconds(said), abs=0.1)


def test_a_forecast_counts_the_time_of_storing_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    checked = check_study(small(base=base("2 h"), keep={"tables": ["trajectories"]}))
    monkeypatch.setattr(StudyDirectory, "commit", lambda *_: time.sleep(0.1))
    # The two first and last of four samples of an hour each are stored for 0.1 s, of twelve hours.
    low_s, _ = seconds(forecast(checked, Measured([0.5])))
    truth_s = 2 + 6 * 2.5 + 0.1 * 12 / 4
    assert truth_s * (1 - MODEL_ERROR) == pytest.approx(low_s, abs=0.2)


def test_workers_measure_whole_variants_and_their_records() -> None:
    """What a worker measures is what it does in a study, with tables and numbers."""
    checked = check_study(small(keep={"metrics": ["sightings.*"], "tables": ["trajectories"]}))
    task, job = checked.plan.variants.task(0), checked.job
    sample = SpeedJob(job.design, job.metrics, job.tables, homes=["a home"])(task)
    record = job(task)
    assert record.header["metrics"] == sample.record.header["metrics"]
    assert [*record.tables()] == [*sample.record.tables()]
    assert sample.speed.simulated_s == 120
    assert sample.speed.fixed_s > 0
    assert sample.home_s == 0  # of the first, it loads all code, too


def test_variants_that_fail_are_no_part_of_a_forecast() -> None:
    broken = base()
    broken["robots"]["astro"]["radius"] = 2.0  # wider than the rooms
    with pytest.raises(ComponentError, match="all measured variants fail"):
        forecast(check_study(small(base=broken)), SerialExecutor())
