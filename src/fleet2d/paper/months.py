"""Code shared by the results: the scenario of a month, studies of months, and intervals."""

import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fleet2d.errors import ComponentError
from fleet2d.studies import driver
from fleet2d.studies.answers import estimate
from fleet2d.studies.directory import Counts
from fleet2d.studies.executors import LocalExecutor
from fleet2d.studies.reader import Study, open_study
from fleet2d.studies.records import VariantRecord

OnProgress = Callable[[str, int, int], None]
"""A function that receives progress: the name of the phase, the finished steps, and all steps."""

CAMERA = {"range": [0.3, 4.5], "angle_deg": 108, "detection": 0.95}
USER = "ana"
START = "2026-01-05"
SEED = 4


@dataclass(frozen=True)
class PaperOptions:
    """The size of the results.

    Attributes:
        quick: Whether to make small versions, to see that everything works.
        seeds: The number of months of each kind (runs of each row of the speed table); None: the
            default of the result.
        days: The days of a month; None: 30, or a few if `quick`.
        workers: The number of worker processes; results don't depend on it.
        map: The map of a real home, for the speed table.
        folder: The folder of the studies; None: a temporary folder.
    """

    quick: bool = False
    seeds: int | None = None
    days: int | None = None
    workers: int = 1
    map: Path | None = None
    folder: Path | None = None

    def size(self, seeds: int, days: int, quick_seeds: int, quick_days: int) -> tuple[int, int]:
        """Return the number of months and their days: as requested, else the defaults.

        Example:
            >>> PaperOptions(quick=True, days=3).size(30, 30, 2, 5)
            (2, 3)
        """
        if self.quick:
            seeds, days = quick_seeds, quick_days
        return self.seeds or seeds, self.days or days


def month(
    robot: Mapping[str, Any] | None = None,
    *,
    algorithms: Mapping[str, Any],
    metrics: Mapping[str, Any],
    days: int = 30,
) -> dict[str, Any]:
    """Return the scenario of a month in the bundled home with one person, who works outside.

    Args:
        robot: The settings of the robot astro; None: there is no robot.
        algorithms: The section `algorithms`.
        metrics: The section `metrics`.
        days: The duration [days].
    """
    return {
        "simulation": {"start": START, "duration": {"days": days}, "seed": SEED},
        "floorplan": {"type": "bundled"},
        "users": {USER: {"type": "routine", "persona": "works_outside"}},
        "robots": {} if robot is None else {"astro": {"camera": CAMERA, **robot}},
        "algorithms": dict(algorithms),
        "metrics": dict(metrics),
    }


def run_study(
    name: str, content: Mapping[str, Any], options: PaperOptions, on_progress: OnProgress
) -> Study:
    """Run a study of months and open it; an interrupted study in a folder continues.

    Args:
        name: The name of the study.
        content: The content of the study file.
        options: The number of processes, and the folder.
        on_progress: Receives the progress.

    Raises:
        InputError: The folder holds results of other code; or polars or scipy is missing.
    """
    checked = driver.check_study({"name": name, **content})
    observer = _ProgressObserver(on_progress)
    run_options = driver.RunOptions(fail_fast=True, changed="redo", observer=observer)
    folder = options.folder or Path(tempfile.mkdtemp(prefix="fleet2d-paper-"))
    counts = driver.run_study(checked, folder / name, LocalExecutor(options.workers), run_options)
    study = open_study(folder / name)
    if counts.failed:
        raise ComponentError(f"a month failed: {study.failures['error'][0]}")
    return study


class _ProgressObserver(driver.Observer):
    """Reports the progress of a study: its homes, then its months."""

    def __init__(self, on_progress: OnProgress) -> None:
        self._report, self._finished, self._total = on_progress, 0, 0

    def on_check(self, done: int, total: int) -> None:
        """Report the number of checked homes."""
        self._report("homes", done, total)

    def on_start(self, counts: Counts, workers: int) -> None:
        """Report the number of months that are complete."""
        self._finished, self._total = counts.complete, counts.total
        self._report("months", self._finished, self._total)

    def on_result(self, record: VariantRecord) -> None:
        """Report one more month."""
        self._finished += 1
        self._report("months", self._finished, self._total)


def ignore_progress(phase: str, done: int, total: int) -> None:
    """Receive progress and do nothing."""


def interval(values: Iterable[float]) -> tuple[float, float, float]:
    """Return the mean of values and the ends of its 95 % interval.

    Example:
        >>> interval([0.5, 0.5, 0.5])
        (0.5, 0.5, 0.5)
    """
    mean = estimate(list(values))
    return mean.mean, mean.low, mean.high
