"""What the results share: the month that is lived, studies of months, and intervals."""

import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fleet2d.errors import ComponentError

if TYPE_CHECKING:
    from fleet2d.studies.reader import Study
    from fleet2d.studies.record import Record
    from fleet2d.studies.results import Counts

# What is told of progress: what is being done, how much of it is done, and of how much.
Tell = Callable[[str, int, int], None]

CAMERA = {"range": [0.3, 4.5], "angle_deg": 108, "detection": 0.95}
USER = "ana"
START = "2026-01-05"
SEED = 4


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
        folder: Where the studies of months are kept; None: in a temporary folder.
    """

    quick: bool = False
    seeds: int | None = None
    days: int | None = None
    workers: int = 1
    map: Path | None = None
    folder: Path | None = None

    def size(self, seeds: int, days: int, quick_seeds: int, quick_days: int) -> tuple[int, int]:
        """Return how many months and of how many days, asked for or else usual.

        Example:
            >>> Request(quick=True, days=3).size(30, 30, 2, 5)
            (2, 3)
        """
        usual = (quick_seeds, quick_days) if self.quick else (seeds, days)
        return self.seeds or usual[0], self.days or usual[1]


def month(
    robot: Mapping[str, Any] | None = None,
    *,
    algorithms: Mapping[str, Any],
    metrics: Mapping[str, Any],
    days: int = 30,
) -> dict[str, Any]:
    """Return the scenario of a month in the bundled home: one person, who works outside.

    Args:
        robot: What the robot astro does; None: there is no robot.
        algorithms: What learns.
        metrics: What measures.
        days: How long it lasts.
    """
    return {
        "simulation": {"start": START, "duration": {"days": days}, "seed": SEED},
        "floorplan": {"type": "bundled"},
        "users": {USER: {"type": "routine", "persona": "works_outside"}},
        "robots": {} if robot is None else {"astro": {"camera": CAMERA, **robot}},
        "algorithms": dict(algorithms),
        "metrics": dict(metrics),
    }


def run_study(name: str, content: Mapping[str, Any], request: Request, tell: Tell) -> "Study":
    """Run a study of months and open it; where results are kept, it goes on where it stopped.

    Args:
        name: What the study is called.
        content: The study, as a study file has it.
        request: How many processes, and where to keep it.
        tell: Told of progress.

    Raises:
        InputError: The folder holds results of other code; or polars or scipy is missing.
    """
    from fleet2d.studies.driver import RunOptions, check_study, run_study
    from fleet2d.studies.local import LocalExecutor
    from fleet2d.studies.reader import open_study

    checked = check_study({"name": name, **content})
    options = RunOptions(fail_fast=True, changed="redo", observer=_Progress(tell))
    folder = request.folder or Path(tempfile.mkdtemp(prefix="fleet2d-paper-"))
    counts = run_study(checked, folder / name, LocalExecutor(request.workers), options)
    study = open_study(folder / name)
    if counts.failed:
        raise ComponentError(f"a month failed: {study.failures['error'][0]}")
    return study


class _Progress:
    """Passes on how a study goes on."""

    def __init__(self, tell: Tell) -> None:
        self._tell, self._done, self._total = tell, 0, 0

    def note(self, text: str) -> None:
        """Pass on nothing."""

    def checked(self, done: int, total: int) -> None:
        """Pass on how many homes are checked."""
        self._tell("homes", done, total)

    def began(self, counts: "Counts", workers: int) -> None:
        """Pass on how many months there are."""
        self._done, self._total = counts.complete, counts.total
        self._tell("months", self._done, self._total)

    def ended(self, record: "Record") -> None:
        """Pass on one more month."""
        self._done += 1
        self._tell("months", self._done, self._total)


def silent(what: str, done: int, of: int) -> None:
    """Be told of progress, and tell nobody."""


def interval(values: Iterable[float]) -> tuple[float, float, float]:
    """Return the mean, and the ends of its 95 % interval over months; the same at each call.

    Example:
        >>> interval([0.5, 0.5, 0.5])
        (0.5, 0.5, 0.5)
    """
    from fleet2d.studies.intervals import estimate

    found = estimate(list(values))
    return found.mean, found.low, found.high
