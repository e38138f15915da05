"""Studies from Python: `fleet2d.study` and `fleet2d.map_runs`."""

import pickle
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeVar

from fleet2d.errors import ComponentError, InputError
from fleet2d.runs.run import Run
from fleet2d.scenario.load import load_scenario
from fleet2d.scenario.model import Scenario
from fleet2d.studies.cluster_executors import RayExecutor, SlurmExecutor
from fleet2d.studies.design import home_key
from fleet2d.studies.driver import check_study, run_study
from fleet2d.studies.executors import (
    Executor,
    LocalExecutor,
    LostTask,
    SerialExecutor,
    TaskSchedule,
    WorkerTask,
    cores,
)
from fleet2d.studies.plan import Changed
from fleet2d.studies.progress import observing
from fleet2d.studies.reader import Study, open_study
from fleet2d.studies.simulator import describe_error, run_scenario
from fleet2d.studies.specification import read_specification

Result = TypeVar("Result")
ExecutorName = Literal["local", "ray", "slurm", "serial"]


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
        workers: The number of worker processes; None: one per core.
        executor: Where they run: `local`, `ray`, `slurm`, `serial` (in this process), or an
            executor of your own.
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
    with observing() as observer:
        run_study(
            check_study(specification), location, make_executor(executor, workers),
            fail_fast=fail_fast, changed=changed, observer=observer,
        )  # fmt: skip
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
    resolved = tuple(load_scenario(scenario).resolved() for scenario in scenarios)
    if not resolved:
        return []
    homes = map(home_key, resolved)  # scenarios that share a home go to one worker in turn
    tasks = TaskSchedule(WorkerTask(i, i, "", home) for i, home in enumerate(homes))
    job = FunctionJob(pickled(function), resolved)
    results: dict[int, Result] = {}
    with closing(make_executor(executor, workers).run(job, tasks)) as events:
        for event in events:
            if isinstance(event, LostTask):
                raise ComponentError(f"scenario {event.task.index}: {event.reason}")
            succeeded, value = pickle.loads(event.payload)  # noqa: S301 - from our own workers
            if not succeeded:
                value.add_note(f"in scenario {event.task.index}")
                raise value
            results[event.task.index] = value
            if on_result is not None:
                on_result(event.task.index)
    return [results[i] for i in range(len(resolved))]


def make_executor(
    executor: ExecutorName | Executor,
    workers: int | None = None,
    slurm: Mapping[str, Any] | None = None,
) -> Executor:
    """Return an executor by its name.

    Args:
        executor: Its name; an executor is returned as it is.
        workers: The number of workers; None: one per core, or 16 jobs of Slurm.
        slurm: submitit's parameters of jobs of Slurm.

    Raises:
        InputError: There is no executor of that name, or its package is missing.
    """
    match executor:
        case "local":
            return LocalExecutor(workers or cores())
        case "serial":
            return SerialExecutor()
        case "ray":
            return RayExecutor(workers)
        case "slurm":
            return SlurmExecutor(workers, slurm)
        case str():
            raise InputError(f"there is no executor {executor!r}: give local, ray, slurm or serial")
    return executor


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
            run = run_scenario(self.scenarios[task.index])
            return pickle.dumps((True, self._callable(run)))
        except Exception as error:  # noqa: BLE001 - raised again in the driver
            return pickle.dumps((False, _portable(error)))

    @cached_property
    def _callable(self) -> Callable[[Run], Any]:
        """The function, which a worker reads once: it may hold a lot."""
        function: Callable[[Run], Any] = pickle.loads(self.function)  # noqa: S301 - our own
        return function


def _portable(error: Exception) -> Exception:
    """Return the error if it can be pickled, else one with the same text."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - our own
    except Exception:  # noqa: BLE001 - errors of users may do anything
        return RuntimeError(describe_error(error))
    return error
