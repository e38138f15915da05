"""What workers do with a task: run a variant of a study, or a scenario for a function."""

import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from fleet2d.errors import Fleet2DError
from fleet2d.studies.design import Design
from fleet2d.studies.engine import Outcome, check_setup, describe_error, execute, run_scenario
from fleet2d.studies.identity import FileHashes, identity, input_hash, scenario_content
from fleet2d.studies.record import Task, record_of
from fleet2d.trust import Trust, current_trust, under

if TYPE_CHECKING:
    from fleet2d.runs.run import Run


class Job(Protocol):
    """What a worker is given once, and then calls for each task; it can be pickled."""

    def __call__(self, task: Task) -> bytes:
        """Do a task; return what came of it."""
        ...


@dataclass
class StudyJob:
    """Runs variants of a design.

    Attributes:
        design: The design.
        metrics: Patterns of the numbers to keep.
        tables: Names of the tables to keep.
        trust: Whose code may run, in whichever process.
    """

    design: Design
    metrics: tuple[str, ...]
    tables: tuple[str, ...]
    trust: Trust | None = field(default_factory=current_trust)

    def __call__(self, task: Task) -> bytes:
        """Run a variant; return its record. What goes wrong in it is part of the record."""
        with under(self.trust):
            return record_of(task, self._outcome(task)).encode()

    def _outcome(self, task: Task) -> Outcome:
        try:
            scenario = self.design.scenario(task.index)
            inputs = input_hash(scenario, self._files)
        except Fleet2DError as error:  # a file has changed since it was planned
            return Outcome("failed", error=describe_error(error))
        found, _ = identity(scenario_content(scenario), inputs)
        if found == task.identity:
            return execute(scenario, self.metrics, self.tables)
        return Outcome("failed", error=CHANGED)

    def __post_init__(self) -> None:
        """Begin without knowing any file."""
        self._files = FileHashes()


CHANGED = (
    "a file that the variant reads, or Fleet2D itself, is not what it was when the study began:"
    " run the study again"
)


@dataclass
class SetupJob:
    """Sets variants up without running them.

    Attributes:
        design: The design.
        trust: Whose code may run, in whichever process.
    """

    design: Design
    trust: Trust | None = field(default_factory=current_trust)

    def __call__(self, task: Task) -> bytes:
        """Return what is wrong with a variant; nothing if nothing is."""
        try:
            with under(self.trust):
                check_setup(self.design.scenario(task.index))
        except Fleet2DError as error:
            return str(error).encode()
        return b""


@dataclass
class FunctionJob:
    """Runs scenarios, and hands each run to a function.

    Attributes:
        function: The function, pickled.
        scenarios: The scenarios, in the order of the tasks' indices.
    """

    function: bytes
    scenarios: Sequence[Any]

    def __call__(self, task: Task) -> bytes:
        """Return what the function returns, or the error, pickled."""
        try:
            scenario = self.scenarios[task.index]
            return pickle.dumps((True, self._call(run_scenario(scenario))))
        except Exception as error:  # noqa: BLE001 - raised again where the function came from
            return pickle.dumps((False, _portable(error)))

    def _call(self, run: "Run") -> Any:
        function: Callable[[Run], Any] = pickle.loads(self.function)  # noqa: S301 - our own
        return function(run)


def _portable(error: Exception) -> Exception:
    """Return an error that survives pickling."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - our own
    except Exception:  # noqa: BLE001 - errors of users may do anything
        return RuntimeError(describe_error(error))
    return error
