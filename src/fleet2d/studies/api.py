"""Studies from Python: `fleet2d.study` and `fleet2d.map_runs`."""

import itertools
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeVar

from fleet2d.errors import ComponentError, InputError
from fleet2d.runs.run import Run
from fleet2d.scenario.load import load_scenario
from fleet2d.scenario.model import Scenario
from fleet2d.storage.files import scratch_folder
from fleet2d.studies.design import home_key
from fleet2d.studies.driver import check_study, run_study
from fleet2d.studies.executors import (
    Crew,
    LocalExecutor,
    SerialExecutor,
    TaskQueue,
    WorkerTask,
    by_home,
    cores,
    portable,
    run_tasks,
)
from fleet2d.studies.plan import Changed
from fleet2d.studies.progress import observing
from fleet2d.studies.reader import Study, open_study
from fleet2d.studies.simulator import run_scenario
from fleet2d.studies.specification import read_specification

Result = TypeVar("Result")
ExecutorName = Literal["local", "serial"]


def study(
    source: str | Path | Mapping[str, Any],
    out: str | Path | None = None,
    *,
    workers: int | None = None,
    executor: ExecutorName | Executor = "local",
    fail_fast: bool = False,
    changed: Changed | None = None,
) -> Study:
    """Run the variants of a study that have no results yet, and open the study.

    Args:
        source: A study file, or the same as a mapping.
        out: A folder, or a location like s3://bucket/study; None: studies/NAME.
        workers: The number of worker processes; None: one per core. An executor of your own gets as
            many calls at a time.
        executor: Where they run: `local`, `serial` (in this process), or an executor of your own,
            as `concurrent.futures` defines them.
        fail_fast: End with the first variant that fails.
        changed: What to do with results of other code or scenarios: `redo` or `keep`; None: refuse
            to continue.

    Raises:
        InputError: The study is wrong, or the folder holds results of another study.
        ArtifactError: Results can't be written; stored results are kept.

    Example:
        >>> import fleet2d
        >>> speeds = {"robots.astro.speed": [0.3, 0.6]}
        >>> base = {"extends": "bundled:paper", "simulation": {"duration": "1 h"}}
        >>> fleet2d.study({"base": base, "axes": speeds}, out="speeds")  # doctest: +SKIP
        <Study speeds: 2 of 2 variants complete>
    """
    specification = read_specification(source)
    location = out or default_location(specification.name)
    with observing() as observer, open_crew(executor, workers) as crew:
        checked = check_study(specification, crew=crew, observer=observer)
        run_study(checked, location, crew, fail_fast=fail_fast, changed=changed, observer=observer)
    return open_study(location)


def map_runs(
    function: "Callable[[Run], Result]",
    scenarios: Iterable[str | Path | Mapping[str, Any] | Scenario],
    *,
    workers: int | None = None,
    executor: ExecutorName | Executor = "local",
    on_result: Callable[[int], None] | None = None,
) -> list[Result]:
    """Run scenarios in worker processes, and return the result of a function for each run.

    Args:
        function: Called with each run in its worker process; its result is sent back. A lambda or a
            function of a script or notebook needs the package cloudpickle.
        scenarios: The scenarios, as `fleet2d.run` takes them, each with a seed.
        workers: The number of worker processes; None: one per core.
        executor: Where they run, as for `study`.
        on_result: Called with the number of each scenario whose result has come, for progress.

    Returns:
        The results in the order of the scenarios.

    Raises:
        InputError: A scenario is wrong, or the function can't be sent to a worker.
        Exception: The exception of the function, if it raises one.

    Example:
        >>> import fleet2d, operator
        >>> hours = [fleet2d.load_scenario("simulation.duration=1 h", seed=s) for s in range(2)]
        >>> digests = fleet2d.map_runs(operator.attrgetter("digest"), hours)  # doctest: +SKIP
    """
    resolved = [load_scenario(scenario).resolved() for scenario in scenarios]
    tasks = [
        FunctionTask(number, number, "", home_key(content), content)
        for number, content in enumerate(resolved)
    ]
    results: dict[int, Result] = {}
    with (
        open_crew(executor, workers) as crew,
        closing(
            run_tasks(crew, FunctionJob(pickled(function)), TaskQueue(by_home(tasks)))
        ) as rounds,
    ):
        for end in itertools.chain.from_iterable(rounds):
            number = end.task.number
            if end.loss is not None:
                raise ComponentError(f"scenario {number}: {end.loss}")
            succeeded, value = end.payload
            if not succeeded:
                value.add_note(f"in scenario {number}")
                raise value
            results[number] = pickle.loads(value)  # noqa: S301 - from our own workers
            if on_result is not None:
                on_result(number)
    return [results[number] for number in range(len(tasks))]


@contextmanager
def open_crew(executor: ExecutorName | Executor, workers: int | None = None) -> Iterator[Crew]:
    """Yield a crew for an executor; one given by name is closed at the end of the context.

    Args:
        executor: The name; or an executor, which stays open.
        workers: The number of workers; None: one per core.

    Raises:
        InputError: There is no executor of that name.
    """
    count = workers or cores()
    with scratch_folder("fleet2d-homes-") as plans:
        match executor:
            case "local":
                crew = Crew(LocalExecutor(count), count, plans=plans)
            case "serial":
                crew = Crew(SerialExecutor(), plans=plans)
            case str():
                raise InputError(f"there is no executor {executor!r}: give local or serial")
            case _:
                yield Crew(executor, count, plans=plans)
                return
        with crew.executor:
            yield crew


def default_location(name: str) -> str:
    """Return the default folder of a study: studies/NAME."""
    stem = "".join(c if c.isalnum() or c in "_-." else "-" for c in name).strip(".-")
    return str(Path("studies") / (stem or "study"))


def pickled(function: Callable[..., Any]) -> bytes:
    """Return a function as bytes for another process.

    Raises:
        InputError: It can't be pickled.
    """
    is_importable = getattr(function, "__module__", "__main__") != "__main__"
    try:
        if is_importable:
            return pickle.dumps(function)
    except (pickle.PicklingError, AttributeError, TypeError):
        pass
    try:
        import cloudpickle
    except ImportError:
        raise InputError(
            f"{function!r} can't be sent to other processes: put it into a module, or"
            ' pip install "fleet2d[study]"'
        ) from None
    return cloudpickle.dumps(function)


@dataclass(frozen=True)
class FunctionTask(WorkerTask):
    """A scenario to run.

    Attributes:
        scenario: The content of the scenario.
    """

    scenario: Mapping[str, Any] = field(default_factory=dict)


@dataclass
class FunctionJob:
    """Runs scenarios, and calls a function with each run.

    Attributes:
        function: The function, pickled.
    """

    function: bytes

    def __call__(self, task: FunctionTask) -> tuple[bool, Any]:
        """Return whether the function succeeded, with its pickled result or its error."""
        try:
            run = run_scenario(task.scenario)
            return True, pickle.dumps(self._callable(run))
        except Exception as error:  # noqa: BLE001 - raised again in the driver
            return False, portable(error)

    @cached_property
    def _callable(self) -> Callable[[Run], Any]:
        """The function, unpickled once a worker since it may be large."""
        function: Callable[[Run], Any] = pickle.loads(self.function)  # noqa: S301 - our own
        return function
