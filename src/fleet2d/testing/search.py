"""The search for a run that fails: over homes, households, timings, and any key of a scenario."""

import importlib.util
import itertools
import math
import random
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import lru_cache
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pydantic import TypeAdapter

from fleet2d.bounds import one_line
from fleet2d.configuration.documents import Document, Keys, parse_yaml, read_document
from fleet2d.configuration.problems import counted, did_you_mean, suggest, validating
from fleet2d.errors import Fleet2DError, InputError, errors_as, extra
from fleet2d.scenario.compose import apply_changes, assignment
from fleet2d.scenario.load import scenario_of
from fleet2d.scenario.model import Scenario
from fleet2d.studies.axes import AnyAxis, Choice, Parameter, key_path
from fleet2d.studies.executors import Crew, TaskQueue, WorkerTask, run_tasks
from fleet2d.studies.sentences import Conclusion
from fleet2d.studies.simulator import describe_error
from fleet2d.studies.tuning import suggested
from fleet2d.testing.claim import ATTRIBUTE, Claim, Variant
from fleet2d.testing.trials import Body, TrialResult, run_trial

if TYPE_CHECKING:
    import optuna


Settings = Mapping[str, Any]
"""A point of the space: for each dimension a number, or the index of a choice."""

_AXIS: TypeAdapter[Any] = TypeAdapter(AnyAxis)
# The share of the budget that is spent before the search is guided.
RANDOM_SHARE = 0.25
MIN_RANDOM_POINTS = 10
CANDIDATES = 64


class SearchSpace(NamedTuple):
    """The dimensions of a search, by name: ranges of numbers, and lists of choices.

    Example:
        >>> speed, home = {"low": 0.2, "high": 0.8}, {"synthetic": 3}
        >>> space = read_space({"robots.astro.speed": speed, "home": home})
        >>> space.changes({"robots.astro.speed": 0.5, "home": 2})[1]
        (('floorplan',), {'type': 'synthetic', 'seed': 2})
    """

    ranges: Mapping[str, Parameter]
    choices: Mapping[str, tuple[Choice, ...]]

    def ask(self, trial: "optuna.Trial") -> dict[str, Any]:
        """Return the point that Optuna suggests."""
        point = {name: suggested(trial, name, parameter) for name, parameter in self.ranges.items()}
        for name, choices in self.choices.items():
            point[name] = trial.suggest_categorical(name, range(len(choices)))
        return point

    def draw(self, generator: random.Random) -> dict[str, Any]:
        """Return a random point."""
        point = {name: parameter.at(generator.random()) for name, parameter in self.ranges.items()}
        for name, choices in self.choices.items():
            point[name] = generator.randrange(len(choices))
        return point

    def changes(self, point: Settings) -> list[tuple[Keys, Any]]:
        """Return the key paths and values that a point sets."""
        changes: list[tuple[Keys, Any]] = []
        for name, value in point.items():
            if name in self.ranges:
                parameter = self.ranges[name]
                changes.append((key_path(parameter.key), parameter.with_unit(value)))
            else:
                changes += self.choices[name][value].changes
        return changes

    def text(self, point: Settings) -> str:
        """Return a point as text for messages."""
        parts = [f"{n} = {v}" for n, v in point.items() if n in self.ranges]
        parts += [self.choices[n][v].words for n, v in point.items() if n in self.choices]
        return ", ".join(parts)


def read_space(content: Mapping[str, Any]) -> SearchSpace:
    """Return the space that a mapping of axes by name describes.

    An axis is a range, ``{key: robots.astro.speed, low: 0.3, high: 0.8}``, with `unit`, `log` and
    `integer` as in the `tune` section of a study; or one of a study's axes. By default its name is
    its key.

    Raises:
        InputError: An axis is wrong.
    """
    ranges = dict[str, Parameter]()
    choices = dict[str, tuple[Choice, ...]]()
    if not content:
        raise InputError("nothing to search over: name an axis, such as home={synthetic: 20}")
    for name, axis in content.items():
        with validating(f"over {name}"):
            if isinstance(axis, list):
                axis = {"key": name, "values": axis}
            if isinstance(axis, Mapping) and {"low", "high"} & axis.keys():
                ranges[name] = Parameter.model_validate({"key": name, **axis})
                continue
            if isinstance(axis, Mapping) and {"values", "range"} & axis.keys():
                axis = {"key": name, **axis}
            choices[name] = tuple(_AXIS.validate_python(axis).choices(name))
    return SearchSpace(ranges, choices)


def parse_over(texts: list[str]) -> dict[str, Any]:
    """Read the values of `--over`: YAML files of axes, and single axes, NAME=YAML.

    Raises:
        InputError: One can't be read.
    """
    content: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if equals and not text.endswith((".yaml", ".yml")):
            content[name.strip()] = parse_yaml(value, Path.cwd(), f"--over {one_line(text, 100)}")
            continue
        if not Path(text).is_file():
            near = did_you_mean(text, [p.name for p in Path().glob("*.yaml")])
            raise InputError(f"--over {text}: no such file{near} An axis is written NAME=YAML")
        data = read_document(Path(text)).data
        content |= data.get("axes", data)
    return content


@dataclass(frozen=True)
class TryTask(WorkerTask):
    """One run of the search.

    Attributes:
        point: The point of the search space.
        seed: Seed of the run.
    """

    point: dict[str, Any] = field(default_factory=dict)
    seed: int = 0


def _stretch(values: Sequence[float]) -> str:
    """Return sorted values as text: the ends, and how many runs had them.

    >>> _stretch([0.5]), _stretch([0.2, 0.3, 0.4])
    ('0.5 (1 run)', '0.2 to 0.4 (3 runs)')
    """
    ends = dict.fromkeys(f"{value:.4g}" for value in (values[0], values[-1]))
    return f"{' to '.join(ends)} ({counted(len(values), 'run')})"


@dataclass
class TryJob:
    """Runs the tasks of a search for a failure, and returns the margin of each run.

    Attributes:
        base: The composed scenario.
        folder: The folder that its paths are relative to.
        space: The dimensions that vary.
        test: The file of a test and its name; None: the expectations of the scenario.
    """

    base: Document
    folder: Path
    space: SearchSpace
    test: tuple[Path, str] | None = None
    _body: Body | None = None

    def body(self) -> Body:
        """Return the test function to call in each run.

        Raises:
            InputError: There is no such test.
        """
        return _expect_no_more if self.test is None else claimed_test(*self.test)[0]

    def scenario(self, point: Settings, seed: int) -> Scenario:
        """Return the scenario of a point.

        Raises:
            InputError: It is not a valid scenario, or its home can't be built.
        """
        source = self.space.text(point)
        changes = [(("simulation", "seed"), seed), *self.space.changes(point)]
        assignments = [assignment(keys, value, source) for keys, value in changes]
        return scenario_of(apply_changes(self.base, assignments), self.folder)

    def check(self) -> None:
        """Build a scenario for each end of each range, and for each choice.

        Raises:
            InputError: A key or a value is wrong.
        """
        values: dict[str, Iterable[Any]] = {}
        for name, parameter in self.space.ranges.items():
            values[name] = parameter.choices or (parameter.at(0.0), parameter.at(1.0))
        for name, choices in self.space.choices.items():
            values[name] = range(len(choices))
        for name, tried in values.items():
            for value in tried:
                with errors_as(None, f"over {name}", of=Fleet2DError):
                    self.scenario({name: value}, 0)

    def run(self, point: dict[str, Any], seed: int) -> TrialResult:
        """Run the trial at a point.

        Raises:
            Fleet2DError: The scenario is wrong, or a component failed.
        """
        self._body = self._body or self.body()
        return run_trial(Variant(self.scenario(point, seed), {"seed": seed}), self._body)

    def __call__(self, task: TryTask) -> tuple[float | None, str, str, str | None]:
        """Return (margin, margin in its unit, what failed, error); margin or error is None."""
        try:
            result = self.run(task.point, task.seed)
        except Exception as error:  # noqa: BLE001 - some points give no valid home; reported
            return None, "", "", describe_error(error)
        failure = result.first_failure
        what = f"{failure.name} {failure.kind}".strip() if failure else ""
        return result.margin, result.amount, what, None


class FailingPoint(NamedTuple):
    """A point of the search space at which the run fails.

    Attributes:
        number: Number of the run, from 1.
        point: The point.
        seed: Seed of the run.
        amount: Margin of the run in its unit; empty if it has no size.
        what: The expectation that failed first, and in which way.
    """

    number: int
    point: dict[str, Any]
    seed: int
    amount: str
    what: str


class FailureSearch(TaskQueue):
    """A search for runs in which an expectation fails: random points, then those of Optuna.

    Attributes:
        failures: The failures.
        points: The points of all finished runs.
        narrowest: The smallest margin so far, that margin in its unit, and its point.
        errors: Errors of runs that couldn't be simulated, with how often they happened.
    """

    def __init__(
        self, job: TryJob, budget: int, *, seed: int = 0, finds: int = 1, is_guided: bool = True
    ) -> None:
        """Prepare a search; with is_guided=False all points are random, for comparison."""
        super().__init__()
        self._job = job
        self._budget = budget
        self._seed = seed
        self._finds = finds
        self._started = 0
        self._deadline = math.inf
        self._generator = random.Random(seed)  # noqa: S311 - a search, not a secret
        self._random = max(MIN_RANDOM_POINTS, round(RANDOM_SHARE * budget)) if is_guided else budget
        self._study = _optuna(seed, self._random) if is_guided else None
        self._suggested: dict[int, Any] = {}
        self.failures: list[FailingPoint] = []
        self.points: list[Settings] = []
        self.narrowest: tuple[float, str, dict[str, Any]] | None = None
        self.errors: dict[str, int] = {}

    def __bool__(self) -> bool:
        """Return whether there are runs to come."""
        may_start = self._started < self._budget and time.monotonic() <= self._deadline
        return not self.is_over and (super().__bool__() or may_start)

    def take(self, workers: int) -> list[WorkerTask]:
        """Return the next run: one that was put back, or a new one."""
        if super().__bool__():
            return super().take(workers)
        self._started += 1
        return [self.ask(self._started - 1)]

    @property
    def tries(self) -> int:
        """Number of finished runs."""
        return len(self.points)

    @property
    def failure(self) -> FailingPoint | None:
        """The first failure; None until there is one."""
        return next(iter(self.failures), None)

    @property
    def is_over(self) -> bool:
        """Whether the search has found enough failures."""
        return len(self.failures) >= self._finds

    def never_failed(self) -> list[str]:
        """Return which values never failed, a line for each dimension that has some."""
        failing = [failure.point for failure in self.failures]
        lines = []
        for name in self._job.space.ranges:
            bad = [point[name] for point in failing]
            good = sorted(point[name] for point in self.points)
            below = [value for value in good if value < min(bad)]
            above = [value for value in good if value > max(bad)]
            parts = [_stretch(values) for values in (below, above) if values]
            if parts:
                lines.append(f"{name}: {', '.join(parts)}")
        for name, choices in self._job.space.choices.items():
            tried = {point[name] for point in self.points} - {point[name] for point in failing}
            texts = [choices[number].words for number in sorted(tried)]
            if texts:
                lines.append(", ".join(texts))
        return lines

    def answer(self, question: str, took: str) -> Conclusion:
        """Return the distinct failures and the values that never failed; or how rare failures are.

        Args:
            question: The question that the search answers.
            took: How long it took, in words.
        """
        words = self._failure_sentences() if self.failures else self._no_failure_sentences()
        lost = [f"{n} runs could not be done: {error}." for error, n in self.errors.items()]
        cost = f"It took {counted(self.tries, 'run')} in {took}."
        table = [
            {
                "try": failure.number,
                "fails": failure.what,
                "case": self._job.space.text(failure.point),
                "seed": failure.seed,
                "margin": failure.amount or "–",
            }
            for failure in self.failures
        ]
        return Conclusion(question, (*words, *lost, cost), tuple(table))

    def _failure_sentences(self) -> Iterator[str]:
        tries: dict[str, list[str]] = {}
        for failure in self.failures:
            tries.setdefault(failure.what, []).append(str(failure.number))
        parts = [f"{what} at try {', '.join(numbers)}" for what, numbers in tries.items()]
        yield f"{len(self.failures)} of {counted(self.tries, 'run')} failed: {'; '.join(parts)}."
        if never := self.never_failed():
            yield f"Never failed: {'; '.join(never)}."

    def _no_failure_sentences(self) -> Iterator[str]:
        yield f"Nothing fails in {counted(self.tries, 'run')}."
        lost = sum(self.errors.values())
        blind = min(self._random, self.tries) - lost
        if blind > 0:
            # If more cases failed, fewer than 5 % of searches would miss them in so many random
            # runs.
            most = 100 * (1 - 0.05 ** (1 / blind))
            yield f"The first {blind} were random, so at most {most:.3g} % of cases fail (95 %)."
        if self.narrowest is not None:
            _, size, point = self.narrowest
            if size:
                yield f"The narrowest margin is {size}: {self._job.space.text(point)}."

    def run(
        self,
        crew: Crew,
        seconds: float | None = None,
        observer: Callable[["FailureSearch"], None] | None = None,
    ) -> FailingPoint | None:
        """Search until enough runs have failed, or the budget is used up.

        Args:
            crew: Where runs are executed.
            seconds: Wall time after which no run is started.
            observer: Called after each run.
        """
        self._deadline = math.inf if seconds is None else time.monotonic() + seconds
        with closing(run_tasks(crew, self._job, self)) as rounds:
            for end in itertools.chain.from_iterable(rounds):
                self._add(end.task, *(end.payload or (None, "", "", end.loss)))
                if observer is not None:
                    observer(self)
                if self.is_over:
                    break
        return self.failure

    def ask(self, number: int) -> TryTask:
        """Return the try of a number: a point of the search space, and a seed of its own."""
        if self._study is None:
            point = self._job.space.draw(self._generator)
        else:
            trial = self._study.ask()
            self._suggested[number] = trial
            point = self._job.space.ask(trial)
        return TryTask(number, number, "", point=point, seed=self._seed + number)

    def _add(
        self, task: TryTask, margin: float | None, size: str, what: str, error: str | None
    ) -> None:
        self.points.append(task.point)
        trial = self._suggested.pop(task.number, None)
        if margin is None:
            text = error or "it could not be run"
            self.errors[text] = self.errors.get(text, 0) + 1
        elif self.narrowest is None or margin < self.narrowest[0]:
            self.narrowest = margin, size, task.point
        if self._study is not None and trial is not None:
            from optuna.trial import TrialState

            state = TrialState.FAIL if margin is None else None
            self._study.tell(trial, margin, state=state)
        if margin is not None and margin < 0:
            self.failures.append(FailingPoint(self.tries, task.point, task.seed, size, what))


def _optuna(seed: int, startup: int) -> "optuna.Study":
    with extra("tune", "this needs Optuna"):
        import optuna
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    sampler = optuna.samplers.TPESampler(
        seed=seed, n_startup_trials=startup, n_ei_candidates=CANDIDATES, constant_liar=True
    )
    return optuna.create_study(sampler=sampler)


def _expect_no_more(_: object) -> None:
    """Do nothing: the expectations are in the scenario. A lambda couldn't be pickled with a job."""


def claimed_tests(path: Path) -> list[str]:
    """Return the names of the tests of a file that have a claim.

    Raises:
        InputError: There is no such file.
    """
    return [name for name, value in _content(path).items() if hasattr(value, ATTRIBUTE)]


def claimed_test(path: Path, name: str) -> tuple[Body, Claim]:
    """Return a test of a file, and its claim.

    Raises:
        InputError: There is no such file or test, or it has other arguments than a trial.
    """
    tests = claimed_tests(path)
    if name not in tests:
        raise InputError(
            f"{path} has no test {name!r} with a trial{suggest(name, tests, 'It has')}"
        )
    function = _content(path)[name]
    others = [name for name in signature(function).parameters if name != "trial"]
    if others or hasattr(function, "pytestmark"):
        extra = f"other arguments ({', '.join(others)})" if others else "pytest marks"
        raise InputError(
            f"{path}::{name} has {extra}: outside of pytest a test has no marks, and `trial` as its"
            " only argument"
        )
    return function, getattr(function, ATTRIBUTE)


def _content(path: Path) -> Mapping[str, Any]:
    """Return what a file of tests defines.

    Raises:
        InputError: There is no such file.
    """
    if not path.is_file():
        raise InputError(f"there is no {path}: name a scenario, or a test as FILE.py::NAME")
    return _loaded(path.absolute(), path.stat().st_mtime_ns)


@lru_cache(maxsize=16)
def _loaded(path: Path, _: int) -> Mapping[str, Any]:
    module_name = f"fleet2d_test_{path.stem}"
    specification = importlib.util.spec_from_file_location(module_name, path)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[module_name] = module
    sys.path.insert(0, str(path.parent))  # as pytest does
    try:
        specification.loader.exec_module(module)
    finally:
        sys.path.pop(0)
    return vars(module)
