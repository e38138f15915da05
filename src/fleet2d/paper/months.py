"""What the results share: the month that is lived, many months at once, and intervals."""

import os
import signal
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from fleet2d.kernels.presence import resampled
from fleet2d.streams import stream_key

Case = TypeVar("Case")
Found = TypeVar("Found")
# What is told of progress: what is being done, how much of it is done, and of how much.
Tell = Callable[[str, int, int], None]

CAMERA = {"range": [0.3, 4.5], "angle_deg": 108, "detection": 0.95}
USER = "ana"
START = "2026-01-05"
RESAMPLES = 2000
LEVEL = 0.95


@dataclass(frozen=True)
class Request:
    """How large the results shall be.

    Attributes:
        quick: Whether small versions will do, to see that everything works.
        seeds: How many months of each kind (runs of each row of the speed table); None: as many as
            the result wants.
        days: Days of a month; None: 30, or a few of a quick one.
        workers: Processes at a time; results don't depend on it.
        map: A map of a real home, for the table of speed.
    """

    quick: bool = False
    seeds: int | None = None
    days: int | None = None
    workers: int = 1
    map: Path | None = None

    def size(self, seeds: int, days: int, quick_seeds: int, quick_days: int) -> tuple[int, int]:
        """Return how many months and of how many days, asked for or else usual.

        Example:
            >>> Request(quick=True, days=3).size(30, 30, 2, 5)
            (2, 3)
        """
        usual = (quick_seeds, quick_days) if self.quick else (seeds, days)
        return self.seeds or usual[0], self.days or usual[1]


def month(
    robot: Mapping[str, Any],
    *,
    algorithms: Mapping[str, Any],
    metrics: Mapping[str, Any],
    seed: int = 4,
    days: int = 30,
    name: str = "astro",
) -> dict[str, Any]:
    """Return the scenario of a month in the bundled home: one person, who works outside, one robot.

    The person's life goes by `seed` only; the robot's draws by its name, too. Nothing is stored
    but what algorithms and metrics put out.
    """
    return {
        "simulation": {"start": START, "duration": {"days": days}, "seed": seed},
        "floorplan": {"type": "bundled"},
        "users": {USER: {"type": "routine", "persona": "works_outside"}},
        "robots": {name: {"camera": CAMERA, **robot}},
        "algorithms": dict(algorithms),
        "metrics": dict(metrics),
        "artifacts": {
            "trajectories": "off", "key_frames": False, "observations": False, "events": False,
        },
    }  # fmt: skip


def run_all(
    collect: Callable[[Case], Found],
    cases: Sequence[Case],
    request: Request,
    tell: Tell,
    what: str = "months",
) -> list[Found]:
    """Return what `collect` finds in each case, in their order, several processes at a time.

    Processes are started afresh, not forked: what is loaded here may have threads.

    Args:
        collect: A function of a module; a month of its own, that depends on nothing but the case.
        cases: The cases.
        request: How many processes.
        tell: Told of progress.
        what: The cases in words.
    """
    found: list[Found] = []
    tell(what, 0, len(cases))

    def take(results: Iterable[Found]) -> None:
        for result in results:
            found.append(result)
            tell(what, len(found), len(cases))

    workers = min(request.workers, len(cases))
    if workers <= 1:
        take(map(collect, cases))
        return found
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _leave_interrupts_to_the_parent)
    try:
        take(pool.map(collect, cases))
    finally:
        pool.shutdown(cancel_futures=True)
    return found


def _leave_interrupts_to_the_parent() -> None:
    """Let Ctrl-C, which all processes of a terminal get, end the one that has begun the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def silent(what: str, done: int, of: int) -> None:
    """Be told of progress, and tell nobody."""


def cores() -> int:
    """Return how many cores this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def interval(values: Iterable[float]) -> tuple[float, float, float]:
    """Return the mean, and the ends of its 95 % bootstrap interval; the same at each call.

    Example:
        >>> interval([0.5, 0.5, 0.5])
        (0.5, 0.5, 0.5)
    """
    given = np.array(list(values), np.float64)
    drawn = resampled(np.uint64(stream_key(0, "paper", "interval")), given[:, None], RESAMPLES)
    drawn = drawn[:, 0] / len(given)
    low, high = np.quantile(drawn, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(given.mean()), float(low), float(high)
