"""Suites: tests from scenarios and from Python, and their trials with builds of a robot."""

import hashlib
import inspect
import itertools
import json
import math
import shlex
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

from fleet2d.configuration.documents import read_document
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import Fleet2DError, InputError
from fleet2d.expectations.verdict import Verdict
from fleet2d.options import file_name
from fleet2d.runtime.progress import progress_bar
from fleet2d.scenario.compose import apply_changes
from fleet2d.scenario.load import load_scenario, scenario_of
from fleet2d.scenario.model import Scenario
from fleet2d.studies.api import open_crew
from fleet2d.studies.executors import TaskQueue, WorkerTask, by_home, cores, run_tasks
from fleet2d.studies.simulator import describe_error
from fleet2d.testing.claim import HOME, Claim, RateTest, Variant, rate_test
from fleet2d.testing.search import claimed_test, claimed_tests
from fleet2d.testing.trials import (
    ASSERT,
    Body,
    Trial,
    TrialResult,
    asserts,
    margin_of,
    run_trial,
)

FIRST_SEED = 1
PATIENCE_S = 3.0
"""Wall time after which trials go on in other processes, which take a second to start [s]."""
BUILD_SECTIONS = ("robots", "algorithms", "interactions")
"""Sections of a scenario that are the build rather than the test."""
SCENARIO_KEYS = {"simulation", "floorplan", "extends", "expect"}
SUFFIXES = (".yaml", ".yml")


class Build(NamedTuple):
    """A build of a robot: settings laid over the scenario of each test.

    Attributes:
        name: Its name.
        overlay: The YAML file with its settings; None: the robots of the tests.
    """

    name: str = ""
    overlay: Path | None = None

    def over(self, scenario: Scenario) -> Scenario:
        """Return a scenario with the settings of the build.

        Raises:
            ScenarioError: The settings are wrong, or don't fit the scenario.
        """
        if self.overlay is None:
            return scenario
        document = apply_changes(scenario._document, [read_document(self.overlay)])
        return scenario_of(document, scenario.folder)


NO_CHANGES = Build()
"""The build without settings: the robots of the tests."""


class TrialKey(NamedTuple):
    """The key of a trial; trials of two builds with the same key are a pair.

    Attributes:
        test: The name of the test.
        home: The home, household and the like; empty if the test has only one.
        seed: The seed.
    """

    test: str
    home: str
    seed: int

    @property
    def label(self) -> str:
        """The home, if there are several, and the seed."""
        return f"home {self.home}, seed {self.seed}" if self.home else f"seed {self.seed}"


NO_TRIAL = TrialKey("", "", 0)


def key_of(test: str, variant: Variant) -> TrialKey:
    """Return the key of a trial of a test."""
    parts = []
    for name, label in variant.labels.items():
        if name != "seed" and label is not None:
            parts.append(str(label) if name == HOME else f"{name} {label}")
    return TrialKey(test, ", ".join(parts), variant.seed)


@dataclass(frozen=True)
class TrialOutcome:
    """The outcome of an expectation in a trial.

    Attributes:
        name: The name of the expectation.
        holds: Whether it held; None if it was not put to the test.
        fails: Whether that fails the trial.
        says: By how much it held or failed, and when.
        margin: The margin, below 0 if it didn't hold [unit]; None if it is only true or false.
        unit: Unit of the margin; "s" for time to spare.
        step: The worst step of a failure.
        covers: The requirements that it covers.
        content: The verdict as plain data.
    """

    name: str
    holds: bool | None
    fails: bool
    says: str
    margin: float | None = None
    unit: str = ""
    step: int | None = None
    covers: tuple[str, ...] = ()
    content: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class TrialReport:
    """The report of a trial of a build.

    Attributes:
        key: The trial.
        outcomes: The outcomes of its expectations.
        error: The error that ended it; empty if there was none.
        wall_s: Its wall time [s].
        simulated_s: Its simulated time [s].
    """

    key: TrialKey
    outcomes: tuple[TrialOutcome, ...] = ()
    error: str = ""
    wall_s: float = 0.0
    simulated_s: float = 0.0

    @property
    def holds(self) -> bool:
        """Whether it ran, and nothing failed."""
        return not self.error and not any(outcome.fails for outcome in self.outcomes)


@dataclass(frozen=True)
class SuiteTest:
    """A test: a scenario with expectations, or a function with a trial.

    Attributes:
        path: The file.
        function: The function of a Python file; empty for a scenario.
        overrides: Changes of the scenario.
        seeds: Seeds in place of the test's own.
        homes: The homes of a scenario, by name, as changes of it; or those of a Python test as the
            `homes` of a trial.
        only: The only seed of a Python test to run.
    """

    path: Path
    function: str = ""
    overrides: tuple[str, ...] = ()
    seeds: tuple[int, ...] = ()
    homes: tuple[tuple[str, tuple[str, ...]], ...] = (("", ()),)
    only: int | None = None

    @property
    def name(self) -> str:
        """Its name in tables and in the history."""
        return f"{self.path.as_posix()}::{self.function}" if self.function else self.path.as_posix()

    def claim(self, build: Build = NO_CHANGES) -> Claim:
        """Return the claim of a Python test about a build.

        Raises:
            InputError: The scenario is wrong.
        """
        claim = claimed_test(self.path, self.function)[1]
        claim = replace(
            claim,
            overrides=(*claim.overrides, *self.overrides),
            seeds=self.seeds or claim.seeds,
            only=self.only,
        )
        if build.overlay is None:
            return claim
        return replace(claim, source=build.over(claim.scenario), overrides=(), settings={})

    def variants(self, build: Build = NO_CHANGES) -> list[Variant]:
        """Return the scenario of each trial with a build.

        Raises:
            InputError: The scenario is wrong.
        """
        if self.function:
            return list(self.claim(build).trials())
        variants = []
        for home, change in self.homes:
            scenario = build.over(load_scenario(self.path, *self.overrides, *change))
            labels = {HOME: home} if home else {}
            variants += [Variant(scenario, labels).with_seed(seed) for seed in self.seeds]
        return variants

    def rate(self, trials: int) -> RateTest:
        """Return the claim of the test about so many trials; a scenario claims that all hold."""
        return self.claim().rate if self.function else rate_test(trials)

    def body(self) -> Body:
        """Return the function that a trial calls."""
        return claimed_test(self.path, self.function)[0] if self.function else Trial.run

    def keys(self) -> list[TrialKey]:
        """Return its trials, in order."""
        return [key_of(self.name, variant) for variant in self.variants()]

    def fingerprint(self) -> str:
        """Return a digest of the test without the build."""
        scenario = self.claim().scenario if self.function else load_scenario(self.path)
        content = {k: v for k, v in scenario.resolved().items() if k not in BUILD_SECTIONS}
        content["simulation"].pop("seed", None)
        source = inspect.getsource(self.body()) if self.function else ""
        text = json.dumps([content, self.overrides, source], sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def command(self, key: TrialKey, build: Build, out: str = "failures") -> str:
        """Return the command that repeats a trial and stores its run if it fails."""
        change = dict(self.homes).get(key.home, ())
        parts = [self.name, *self.overrides, *change, "--seed", str(key.seed)]
        if build.overlay:
            parts += ["--build", str(build.overlay)]
        return f"fleet2d test {shlex.join([*parts, '--out', out])}"


def collect(
    arguments: Sequence[str],
    overrides: Sequence[str],
    seeds: int | None = None,
    first: int | None = None,
    homes: str | None = None,
) -> tuple[list[SuiteTest], list[str]]:
    """Return the tests of files and folders, and notes on tests that are left out.

    Args:
        arguments: Scenarios, Python files, tests as FILE.py::NAME, and folders of these.
        overrides: Changes to all scenarios.
        seeds: The number of seeds of each; None: a scenario's own, or those of a Python test.
        first: The first seed; None: a scenario's own.
        homes: A number of synthetic homes, or a folder of floor plans.

    Raises:
        InputError: There is no such file, a scenario is wrong, or no test is left.
    """
    tests: list[SuiteTest] = []
    notes: list[str] = []
    for argument in arguments:
        name, _, function = argument.partition("::")
        path = Path(name)
        files = _files_in(path) if path.is_dir() else [path]
        for file in files:
            if file.suffix == ".py":
                tests += _python_tests(file, function, notes)
            elif load_scenario(file, *overrides).expect:
                tests.append(SuiteTest(file))
            elif not path.is_dir():
                raise InputError(
                    f"{file} has no expectations: write, for example,\n"
                    "  expect: {keeps_off: 'always(distance(ana, astro) > 0.5 m)'}"
                )
    if not tests:
        message = (
            f"{' '.join(arguments)}: no test there: a test is a scenario with a section `expect`,"
            " or a function with @trial in a file test_….py"
        )
        raise InputError("; ".join([message, *notes]))
    different = dict.fromkeys(tests)
    ready = [_with_trials(test, tuple(overrides), seeds, first, homes) for test in different]
    return ready, notes


def _with_trials(
    test: SuiteTest,
    overrides: tuple[str, ...],
    seeds: int | None,
    first: int | None,
    homes: str | None,
) -> SuiteTest:
    """Return a test with its overrides, seeds and homes; see `collect`."""
    if test.function:
        if homes is not None:
            raise InputError(f"{test.name}: --homes is for scenarios; write @trial(homes=…)")
        if seeds is None:
            return replace(test, overrides=overrides, seeds=(), only=first)
        begin = first or 0
        return replace(test, overrides=overrides, seeds=tuple(range(begin, begin + seeds)))
    scenario = load_scenario(test.path, *overrides)
    own = scenario.simulation.seed
    begin = FIRST_SEED if own is None else own
    if first is not None:
        begin = first
    numbers = range(begin, begin + (seeds or 1))
    found = (("", ()),) if homes is None else tuple(_homes(homes, scenario))
    return replace(test, overrides=overrides, seeds=tuple(numbers), homes=found)


def _files_in(folder: Path) -> list[Path]:
    """Return the files of a folder that may be tests: builds and lists aren't scenarios."""
    scenarios = [
        path
        for suffix in SUFFIXES
        for path in folder.rglob(f"*{suffix}")
        if SCENARIO_KEYS & read_document(path).data.keys()
    ]
    return sorted([*scenarios, *folder.rglob("test_*.py")])


def _python_tests(path: Path, function: str, notes: list[str]) -> Iterator[SuiteTest]:
    """Yield the tests of a Python file; a note says which can't be run without pytest."""
    for name in [function] if function else claimed_tests(path):
        try:
            claimed_test(path, name)
        except InputError as error:
            if function:
                raise
            notes.append(f"left out: {error}")
        else:
            yield SuiteTest(path, name)


def _homes(homes: str, scenario: Scenario) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the homes to run a scenario in: a name, and the change of the scenario.

    Raises:
        InputError: There are no such floor plans.
    """
    from fleet2d.studies.axes import FloorplansAxis, SyntheticAxis

    furnish = scenario.resolved()["floorplan"].get("furnish")
    settings = {"furnish": furnish} if furnish else {}
    if homes.isdigit():
        axis = SyntheticAxis(synthetic=int(homes), settings=settings)
    else:
        axis = FloorplansAxis(floorplans=(homes,), settings=settings)  # type: ignore[assignment]
    for choice in axis.choices("home"):
        (_, section) = choice.changes[0]
        yield str(choice.labels["home"]), (f"floorplan={json.dumps(section)}",)


@dataclass(frozen=True)
class SuiteTask(WorkerTask):
    """One trial of a build.

    Attributes:
        key: The key that it shares with the trial of another build.
        test: The number of the test.
        build: The number of the build.
        trial: The number of the trial among those of the test.
    """

    key: TrialKey = NO_TRIAL
    test: int = 0
    build: int = 0
    trial: int = 0


@dataclass
class SuiteJob:
    """Runs trials of the tests of a suite with builds."""

    tests: tuple[SuiteTest, ...]
    builds: tuple[Build, ...]
    _ready: dict[tuple[int, int], list[Variant]] = field(default_factory=dict)

    def __call__(self, task: SuiteTask) -> TrialReport:
        """Run a trial; an error of the test or of the build is part of its report."""
        test = self.tests[task.test]
        start_s = time.perf_counter()
        try:
            result = self.run(task)
            is_lenient = bool(test.function) and test.claim().may_be_untested
            outcomes = outcomes_of(result, test.body(), may_be_untested=is_lenient)
        except Fleet2DError as error:
            return TrialReport(task.key, error=str(error))
        except Exception as error:  # noqa: BLE001 - of the user's test; reported
            return TrialReport(task.key, error=describe_error(error))
        wall_s = time.perf_counter() - start_s
        return TrialReport(task.key, outcomes, "", wall_s, result.simulated_s)

    def run(self, task: SuiteTask, out: Path | None = None) -> TrialResult:
        """Run a trial, and store it if there is a directory for it.

        Raises:
            Fleet2DError: The scenario or the test is wrong, or a component failed.
        """
        test = self.tests[task.test]
        place = task.test, task.build
        if place not in self._ready:
            self._ready[place] = test.variants(self.builds[task.build])
        return run_trial(self._ready[place][task.trial], test.body(), out=out)


def outcomes_of(
    result: TrialResult, body: Body, *, may_be_untested: bool = False
) -> tuple[TrialOutcome, ...]:
    """Return the outcomes of the expectations of a trial, and of its asserts."""
    expected = result.variant.scenario.expect
    outcomes = [
        _outcome(each.verdict, each.covers or _covers(expected, each.name))
        for each in result.results
        if each.verdict is not None
    ]
    others = [failure for failure in result.failures if failure.verdict is None]
    for each in others:
        holds = None if each.untested else False
        outcomes.append(TrialOutcome(each.name, holds, True, each.text))
    if may_be_untested:
        outcomes = [replace(o, fails=o.fails and o.holds is not None) for o in outcomes]
    if body is not Trial.run and not others and asserts(body):
        outcomes.append(TrialOutcome(ASSERT, True, False, "the asserts held"))
    return tuple(outcomes)


def _covers(expected: Mapping[str, Any], name: str) -> tuple[str, ...]:
    return expected[name].covers if name in expected else ()


def _outcome(verdict: Verdict, covers: tuple[str, ...]) -> TrialOutcome:
    margin, unit = margin_of(verdict)
    return TrialOutcome(
        verdict.name,
        verdict.holds,
        verdict.fails,
        str(verdict),
        margin if math.isfinite(margin) else None,
        unit,
        None if verdict.worst is None else verdict.worst.worst,
        covers,
        verdict.content(),
    )


def run_suite(
    tests: Sequence[SuiteTest],
    builds: Sequence[Build],
    keys: Mapping[str, Sequence[TrialKey]],
    numbers: Mapping[str, Sequence[int]],
    *,
    workers: int | None = None,
    show: bool = False,
) -> list[list[TrialReport]]:
    """Return for each build the reports of the trials of all tests, in order.

    Args:
        tests: The tests.
        builds: The builds, which all get the same trials.
        keys: All trials of each test, by its name.
        numbers: The numbers of the trials of each test to run, by its name.
        workers: Number of processes; None: one per core.
        show: Whether progress is shown.
    """
    job = SuiteJob(tuple(tests), tuple(builds))
    number = itertools.count()
    tasks = [
        SuiteTask(next(number), trial, "", each.name, keys[each.name][trial], test, build, trial)
        for test, each in enumerate(tests)
        for trial in numbers[each.name]
        for build in range(len(builds))
    ]
    found: dict[int, TrialReport] = {}
    with progress_bar(show=show) as bar:
        progress = bar.add_task("trials", total=len(tasks))
        for place, report in _reports(job, tasks, workers or cores()):
            found[place] = report
            bar.update(progress, completed=len(found))
    reports: list[list[TrialReport]] = [[] for _ in builds]
    for task in tasks:
        reports[task.build].append(found[task.number])
    return reports


def _reports(
    job: SuiteJob, tasks: list[SuiteTask], workers: int
) -> Iterator[tuple[int, TrialReport]]:
    """Yield the number and report of each task: for some seconds from here, then from workers."""
    waiting = list(reversed(tasks))
    end_s = time.monotonic() + PATIENCE_S
    while waiting and (workers == 1 or len(waiting) == 1 or time.monotonic() < end_s):
        task = waiting.pop()
        yield task.number, job(task)
    if not waiting:
        return
    with open_crew("local", min(workers, len(waiting))) as crew:
        queue = TaskQueue(by_home(reversed(waiting)))
        with closing(run_tasks(crew, job, queue)) as rounds:
            for ends in rounds:
                for end in ends:
                    lost = TrialReport(end.task.key, error=end.loss or "")
                    yield end.task.number, end.payload or lost


def run_name(key: TrialKey) -> str:
    """Return the name of the run directory of a trial."""
    file, _, function = key.test.partition("::")
    parts = [Path(file).stem, function, key.home, f"seed-{key.seed}"]
    return "-".join(filter(None, map(file_name, parts)))


def check_set_up(tests: Iterable[SuiteTest], *, strict: bool) -> None:
    """Set each test up, and print what will not work in its home.

    Raises:
        InputError: A scenario or an expectation is wrong, or a flaw is refused.
    """
    from fleet2d.cli.run import report_wrong

    for test in tests:
        if test.function:
            test.claim().prepare()
        elif test.homes == (("", ()),):  # not every home may have what it needs
            report_wrong(Simulation(test.variants()[0].scenario), strict=strict)
