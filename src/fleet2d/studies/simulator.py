"""Running scenarios: the only module of `studies` that imports the engine."""

import copy
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from fleet2d.engine.basis import input_files as input_files
from fleet2d.engine.simulation import Simulation, run
from fleet2d.errors import ComponentError
from fleet2d.runtime.clock import HOUR_S
from fleet2d.runtime.memory import peak_memory_mb
from fleet2d.scenario.model import Scenario

if TYPE_CHECKING:
    import pyarrow as pa

    from fleet2d.runs.run import Run

Status = Literal["complete", "failed"]
SEPARATOR = "."
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


class StagedRun:
    """A run in stages: it stops at simulated times, and its results so far can be read there.

    Example:
        >>> from fleet2d.scenario.model import load_scenario
        >>> stages = StagedRun(load_scenario("simulation.duration=2 h", seed=4))
        >>> hour = stages.until(3600.0)
        >>> whole = stages.until(None)
        >>> hour.status, whole.status
        ('interrupted', 'complete')
    """

    def __init__(self, scenario: Scenario) -> None:
        """Set the run up.

        Raises:
            Fleet2DError: The scenario is wrong, or a component can't start.
        """
        self._simulation = Simulation(scenario)

    @property
    def done(self) -> bool:
        """Whether the run is over."""
        return self._simulation.done

    def until(self, seconds: float | None) -> "Run":
        """Continue to a simulated time [s], None for the end; return the run so far.

        Raises:
            Fleet2DError: A component failed.
        """
        simulation = self._simulation
        if seconds is None:
            return simulation.run()
        steps = int(seconds * 1e6) // simulation.clock.step_us - simulation.step
        if steps > 0:
            simulation.advance(min(steps, simulation.clock.steps - simulation.step))
        return copy.deepcopy(simulation).finish()


def execute(scenario: Scenario, metrics: Iterable[str], tables: Iterable[str]) -> VariantOutcome:
    """Run a scenario; return the results to keep, or the error if it fails.

    Args:
        scenario: The scenario, with its seed.
        metrics: Patterns of the numbers to keep.
        tables: Names of the tables to keep.
    """
    start_s = time.perf_counter()
    try:
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
    return _outcome_of(finished, metrics, tables, start_s)


def _outcome_of(
    run: "Run", metrics: Iterable[str], tables: Iterable[str], start_s: float
) -> VariantOutcome:
    """Return the results to keep of a run that began at a time of `perf_counter`."""
    wall_s: dict[str, float] = {**run.manifest["wall_s"], "total": time.perf_counter() - start_s}
    patterns = tuple(metrics)
    return VariantOutcome(
        "complete",
        run.digest,
        {name: value for name, value in flat_numbers(run.metrics) if is_kept(name, patterns)},
        {name: run.tables[name] for name in tables if name in run.tables},
        wall_s,
        peak_memory_mb() or 0.0,
    )


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


class RunSpeed(NamedTuple):
    """How fast a scenario runs on this machine.

    Attributes:
        fixed_s: Wall time of building the scenario, setting it up, and closing the run [s].
        moving_s: Wall time of the simulated time [s].
        simulated_s: The simulated time that was run [s].
        setup_s: Wall time of the set-up alone [s].
        core_share: Processor time over wall time: below 1 as far as other programs run.
    """

    fixed_s: float
    moving_s: float
    simulated_s: float
    setup_s: float = 0.0
    core_share: float = 1.0


def measure(
    build: Callable[[], Scenario], metrics: Iterable[str], tables: Iterable[str], max_s: float = 2.0
) -> tuple[RunSpeed, VariantOutcome]:
    """Run a scenario for some time to measure its speed; return the results so far, too.

    Args:
        build: Returns the scenario.
        metrics: Patterns of the numbers to keep.
        tables: Names of the tables to keep.
        max_s: The longest wall time between set-up and end [s].

    Raises:
        Fleet2DError: The scenario is wrong, or a component failed.
    """
    start_s = time.perf_counter()
    start_core_s = time.process_time()
    scenario = build()
    built_s = time.perf_counter()
    simulation = Simulation(scenario)
    ready_s = time.perf_counter()
    hour = max(1, int(HOUR_S * 1e6 / simulation.clock.step_us))
    while not simulation.done and time.perf_counter() - ready_s < max_s:
        simulation.advance(min(hour, simulation.clock.steps - simulation.step))
    moving_s = time.perf_counter() - ready_s
    outcome = _outcome_of(simulation.finish("interrupted"), metrics, tables, start_s)
    wall_s = time.perf_counter() - start_s
    core_s = time.process_time() - start_core_s
    simulated_s = simulation.step * simulation.clock.step_us / 1e6
    speed = RunSpeed(
        wall_s - moving_s, moving_s, simulated_s, ready_s - built_s, min(core_s / wall_s, 1.0)
    )
    return speed, outcome
