"""How long a study takes: said while it runs, whatever runs and workers do."""

import heapq

import numpy as np
import pytest

from fleet2d.studies.progress import MIN_RUNS, TimeLeft


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
