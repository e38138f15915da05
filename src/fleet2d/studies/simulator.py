"""Running scenarios: the only module of `studies` that imports the engine."""

import time
import traceback
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any, Literal

from fleet2d.engine.access import results_so_far
from fleet2d.engine.basis import input_files as input_files
from fleet2d.engine.simulation import Simulation, run
from fleet2d.errors import ComponentError
from fleet2d.runtime.clock import DAY_US
from fleet2d.runtime.memory import peak_memory_mb
from fleet2d.scenario.model import Scenario

if TYPE_CHECKING:
    import pyarrow as pa

    from fleet2d.runs.run import Run


Status = Literal["complete", "failed"]
SEPARATOR = "."
DAILY = "daily"
"""The table of the numbers that a rollout follows, at the end of each day of a run."""
run_scenario = run
"""The function that runs a scenario, for the other modules."""


@dataclass
class VariantOutcome:
    """The results of a variant, or its error.

    Attributes:
        status: `complete` or `failed`.
        digest: The digest of the run; None if it failed.
        metrics: The numbers to keep, by name, such as `ltp_error.ana.tv`.
        tables: The tables to keep, by name.
        wall_s: Wall time by phase: `setup`, `simulate`, `total` [s].
        peak_rss_mb: The peak memory of the process [MB]; 0 if unknown.
        error: The error in words; None if there is none.
        trace: The traceback of the error.
    """

    status: Status
    digest: str | None = None
    metrics: dict[str, float] = field(default_factory=dict)
    tables: "dict[str, pa.Table]" = field(default_factory=dict)
    wall_s: dict[str, float] = field(default_factory=dict)
    peak_rss_mb: float = 0.0
    error: str | None = None
    trace: str | None = None


def check_setup(scenario: Scenario) -> None:
    """Set a scenario up without running it.

    Raises:
        InputError: The floor plan or a place in it is wrong.
        ComponentError: A component can't start.
    """
    Simulation(scenario)


def execute(
    scenario: Scenario, metrics: Iterable[str], tables: Iterable[str], daily: Sequence[str] = ()
) -> VariantOutcome:
    """Run a scenario; return the results to keep, or the error if it fails.

    Args:
        scenario: The scenario, with its seed.
        metrics: Patterns of the numbers to keep.
        tables: Names of the tables to keep.
        daily: Numbers to keep at the end of each day, in the table `daily`.
    """
    start_s = time.perf_counter()
    days: dict[str, pa.Table] = {}
    try:
        if daily:
            finished, days[DAILY] = _run_by_day(scenario, daily)
        else:
            finished = run(scenario)
    except Exception as error:  # noqa: BLE001 - a component may raise anything; it is reported
        seconds = {"total": time.perf_counter() - start_s}
        return VariantOutcome(
            "failed",
            wall_s=seconds,
            peak_rss_mb=peak_memory_mb() or 0.0,
            error=describe_error(error),
            trace="".join(traceback.format_exception(error)),
        )
    wall_s = {**finished.manifest["wall_s"], "total": time.perf_counter() - start_s}
    patterns = tuple(metrics)
    numbers = flat_numbers(finished.metrics)
    return VariantOutcome(
        "complete",
        finished.digest,
        {name: value for name, value in numbers if is_kept(name, patterns)},
        {name: finished.tables[name] for name in tables if name in finished.tables} | days,
        wall_s,
        peak_memory_mb() or 0.0,
    )


def _run_by_day(scenario: Scenario, metrics: Sequence[str]) -> "tuple[Run, pa.Table]":
    """Run a scenario; return also the latest numbers of metrics at the end of each day."""
    import pyarrow as pa

    simulation = Simulation(scenario)
    steps_of_day = DAY_US // simulation.clock.step_us
    rows: list[dict[str, Any]] = []
    for day in range(simulation.clock.steps // steps_of_day):
        simulation.advance(steps_of_day)
        numbers = dict(flat_numbers(results_so_far(simulation)))
        known = [name for name in metrics if name in numbers]
        rows += [{"day": day, "metric": name, "value": numbers[name]} for name in known]
    columns = {"day": pa.int32(), "metric": pa.string(), "value": pa.float64()}
    return simulation.run(), pa.Table.from_pylist(rows, pa.schema(columns))


def is_kept(metric: str, patterns: Iterable[str]) -> bool:
    """Return whether a metric fits one of some patterns, such as `ltp_error.*.tv`."""
    return any(fnmatchcase(metric, pattern) for pattern in patterns)


def describe_error(error: BaseException) -> str:
    """Return the text of an error, after its class unless the text names a component."""
    text = str(error)
    return text if isinstance(error, ComponentError) else f"{type(error).__name__}: {text}"


def flat_numbers(metrics: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, float]]:
    """Yield each number of nested metrics by its name.

    >>> dict(flat_numbers({"sightings": {"ana": 0.4}, "note": "x"}))
    {'sightings.ana': 0.4}
    """
    for name, value in metrics.items():
        if isinstance(value, Mapping):
            yield from flat_numbers(value, f"{prefix}{name}{SEPARATOR}")
        elif isinstance(value, bool | int | float):
            yield f"{prefix}{name}", float(value)
