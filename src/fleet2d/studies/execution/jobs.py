"""Jobs of workers: run variants of a study, or scenarios for a function."""

import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from fleet2d.errors import Fleet2DError
from fleet2d.runs.run import Run
from fleet2d.studies.data.record import WorkerTask, record_of
from fleet2d.studies.design.identity import FileHashes, identity, input_hash, scenario_content
from fleet2d.studies.design.variants import Design
from fleet2d.studies.simulator import (
    VariantOutcome,
    check_setup,
    describe_error,
    execute,
    run_scenario,
)
from fleet2d.trust import Trust, current_trust, restrict


class WorkerJob(Protocol):
    """A function that workers receive once and call for each task; it can be pickled."""

    def __call__(self, task: WorkerTask) -> bytes:
        """Do a task; return its results as bytes."""
        ...


@dataclass
class StudyJob:
    """Runs variants of a design.

    Attributes:
        design: The design.
        metrics: Patterns of the numbers to keep.
        tables: Names of the tables to keep.
        trust: The code that workers may run; None: any.
    """

    design: Design
    metrics: tuple[str, ...]
    tables: tuple[str, ...]
    trust: Trust | None = field(default_factory=current_trust)

    def __call__(self, task: WorkerTask) -> bytes:
        """Run a variant; return its record, with the error if it fails."""
        with restrict(self.trust):
            return record_of(task, self._outcome(task)).encode()

    def _outcome(self, task: WorkerTask) -> VariantOutcome:
        try:
            scenario = self.design.scenario(task.index)
            inputs = input_hash(scenario, self._files)
        except Fleet2DError as error:  # a file changed after the study was planned
            return VariantOutcome("failed", error=describe_error(error))
        current, _ = identity(scenario_content(scenario), inputs)
        if current != task.identity:
            return VariantOutcome("failed", error=CHANGED)
        return execute(scenario, self.metrics, self.tables)

    def __post_init__(self) -> None:
        """Start with no hashes."""
        self._files = FileHashes()


CHANGED = (
    "a file that the variant reads, or Fleet2D itself, changed after the study began: run the study"
    " again"
)


@dataclass
class SetupJob:
    """Sets variants up without running them, to find errors.

    Attributes:
        design: The design.
        trust: The code that workers may run; None: any.
    """

    design: Design
    trust: Trust | None = field(default_factory=current_trust)

    def __call__(self, task: WorkerTask) -> bytes:
        """Return the error of a variant's set-up as text; empty if there is none."""
        try:
            with restrict(self.trust):
                check_setup(self.design.scenario(task.index))
        except Fleet2DError as error:
            return str(error).encode()
        return b""


@dataclass
class FunctionJob:
    """Runs scenarios, and calls a function with each run.

    Attributes:
        function: The function, pickled.
        scenarios: The scenarios, in the order of the tasks' indices.
    """

    function: bytes
    scenarios: Sequence[Any]

    def __call__(self, task: WorkerTask) -> bytes:
        """Return what the function returns, or the error, pickled."""
        try:
            scenario = self.scenarios[task.index]
            return pickle.dumps((True, self._call(run_scenario(scenario))))
        except Exception as error:  # noqa: BLE001 - raised again in the driver
            return pickle.dumps((False, _portable(error)))

    def _call(self, run: Run) -> Any:
        function: Callable[[Run], Any] = pickle.loads(self.function)  # noqa: S301 - our own
        return function(run)


def _portable(error: Exception) -> Exception:
    """Return the error if it can be pickled, else one with the same text."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - our own
    except Exception:  # noqa: BLE001 - errors of users may do anything
        return RuntimeError(describe_error(error))
    return error
