"""The plan of a study: all its variants, checked, each with its identity."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from fleet2d.errors import InputError, ScenarioError
from fleet2d.problems import suggest
from fleet2d.scenario.model import Scenario
from fleet2d.studies.axes.choice import Label
from fleet2d.studies.data.record import WorkerTask
from fleet2d.studies.design.identity import (
    FileHashes,
    content_hash,
    home_key,
    identity,
    input_hash,
    scenario_content,
)
from fleet2d.studies.design.variants import SWITCHES, Design
from fleet2d.studies.execution.executor import Executor, LostTask, SerialExecutor
from fleet2d.studies.execution.jobs import SetupJob
from fleet2d.studies.execution.schedule import TaskSchedule
from fleet2d.units import parse_duration

MOST_PROBLEMS = 10  # in one report
FEW_SETUPS = 8  # up to here starting workers costs more than it saves


@dataclass(frozen=True, slots=True)
class PlannedVariant:
    """A variant before it is run.

    Attributes:
        number: Its number in results; it stays when the study is extended.
        index: Its index in the design.
        identity: The hash of everything that its results depend on.
        scenario: The hash of its scenario alone.
        template: The hash of its scenario without the seed.
        home_key: The same for variants that can share a home.
        simulated_s: The simulated time of its run [s].
    """

    number: int
    index: int
    identity: str
    scenario: str
    template: str
    home_key: str
    simulated_s: float


@dataclass(frozen=True)
class StudyPlan:
    """A design and its variants, all checked.

    Attributes:
        design: The design.
        variants: The variants, in the order of the design.
    """

    design: Design
    variants: tuple[PlannedVariant, ...]

    def parameters(self, variant: PlannedVariant) -> dict[str, Label]:
        """Return the labels of a variant by column."""
        return self.design.parameters(variant.index)


def make_plan(
    design: Design, tables: Sequence[str] = (), keep: Callable[[str, Any], None] | None = None
) -> StudyPlan:
    """Build and check the scenario of every variant of a design.

    Args:
        design: The design.
        tables: The tables to keep, each of which some variant must have.
        keep: Called with the template (a hash) and the content of each combination's scenario.

    Raises:
        ScenarioError: Variants are wrong; a line per problem, with axis and value.
    """
    variants: list[PlannedVariant] = []
    problems: list[str] = []
    files, known_tables = FileHashes(), set[str]()
    for number in range(len(design.combinations)):
        first = number * len(design.seeds)
        try:
            scenario = design.scenario(first)
            content = scenario_content(scenario)
            variants += _planned(design, first, content, input_hash(scenario, files))
        except InputError as error:
            problems.append(str(error))
            if len(problems) == MOST_PROBLEMS:
                break
            continue
        if keep is not None:
            keep(variants[-1].template, scenario.resolved())
        known_tables |= {*scenario.algorithms, *scenario.metrics, *_sensor_tables(scenario)}
    _raise_problems(problems)
    _check_tables(tables, known_tables)
    _check_identities(design, variants)
    return StudyPlan(design, tuple(variants))


def setups_to_check(plan: StudyPlan) -> list[PlannedVariant]:
    """Return variants in which each home meets each choice of every other axis, and no more.

    Their set-up shows people and robots that have no room where they start, without setting up
    every variant.
    """
    design = plan.design
    by_home: dict[str, list[tuple[PlannedVariant, tuple[int, ...]]]] = {}
    for number, combination in enumerate(design.combinations):
        variant = plan.variants[number * len(design.seeds)]
        by_home.setdefault(variant.home_key, []).append((variant, combination))
    return [variant for variants in by_home.values() for variant in _covering(variants)]


def _covering(
    variants: Sequence[tuple[PlannedVariant, tuple[int, ...]]],
) -> Iterator[PlannedVariant]:
    """Yield variants of one home in which each choice of each axis comes at least once."""
    first = variants[0][1]
    varying = [i for i in range(len(first)) if any(c[i] != first[i] for _, c in variants)]
    covered: set[tuple[int, int]] = set()
    for all_new in (True, False):  # variants of new choices only come first: fewer are needed
        for variant, combination in variants:
            choices = {(axis, combination[axis]) for axis in varying}
            uncovered = choices - covered
            if uncovered and (uncovered == choices or not all_new):
                covered |= choices
                yield variant
    if not varying:
        yield variants[0][0]


def check_setups(
    plan: StudyPlan, executor: Executor, on_progress: Callable[[int, int], None] | None = None
) -> None:
    """Set up the variants that `setups_to_check` returns: homes with people and robots in them.

    Raises:
        ScenarioError: Variants are wrong; a line per problem, with axis and value.
    """
    problems: dict[int, str] = {}
    tasks = [WorkerTask(v.number, v.index, v.identity, v.home_key) for v in setups_to_check(plan)]
    runner = executor if len(tasks) > FEW_SETUPS else SerialExecutor()
    events = runner.run(SetupJob(plan.design), TaskSchedule(tasks))
    try:
        for done, event in enumerate(events):
            if on_progress is not None:
                on_progress(done + 1, len(tasks))
            text = event.reason if isinstance(event, LostTask) else event.payload.decode()
            if text:
                problems[event.task.index] = f"{plan.design.describe(event.task.index)}: {text}"
            if len(problems) == MOST_PROBLEMS:
                break
    finally:
        events.close()
    _raise_problems([problems[index] for index in sorted(problems)])


def _raise_problems(problems: list[str]) -> None:
    if len(problems) == MOST_PROBLEMS:
        problems = [*problems, f"… and perhaps more: these are the first {MOST_PROBLEMS}"]
    if problems:
        raise ScenarioError("\n".join(_without_repetition(problems)))


def _planned(
    design: Design, first: int, content: dict[str, Any], inputs: str
) -> Iterator[PlannedVariant]:
    """Yield the variants of one combination; they differ by their seeds only."""
    home, simulation = home_key(content), content["simulation"]
    step, duration = parse_duration(simulation["step"]), parse_duration(simulation["duration"])
    template = content_hash({**content, "simulation": {**simulation, "seed": None}})
    for i, seed in enumerate(design.seeds):
        simulation["seed"] = seed
        variant_identity, scenario = identity(content, inputs)
        simulated_s = (duration // step * step).total_seconds()
        yield PlannedVariant(
            first + i, first + i, variant_identity, scenario, template, home, simulated_s
        )


def _sensor_tables(scenario: Scenario) -> list[str]:
    return ["sensors"] if scenario.objects else []


def _check_tables(tables: Sequence[str], known: set[str]) -> None:
    names = sorted({"trajectories", *SWITCHES, *known})
    layers = ("explored", "first_seen", "last_seen", "time_since_seen")
    for name in tables:
        if name not in names and not name.startswith(layers):
            raise ScenarioError(
                f"keep.tables: no variant has a table {name!r}{suggest(name, names)}"
            )


def _check_identities(design: Design, variants: Sequence[PlannedVariant]) -> None:
    """Refuse two variants with the same scenario, of which one axis has no effect."""
    by_identity: dict[str, PlannedVariant] = {}
    for variant in variants:
        equal = by_identity.setdefault(variant.identity, variant)
        if equal is not variant:
            raise ScenarioError(
                f"{design.describe(equal.index)} and {design.describe(variant.index)} are the same"
                " scenario: an axis sets what another axis or a rule overrides, or has a value"
                " twice"
            )


def _without_repetition(problems: list[str]) -> list[str]:
    """Return the first of all problems that differ by their variant only."""
    first: dict[str, str] = {}
    for text in problems:
        first.setdefault(text.partition("): ")[2] or text, text)
    return list(first.values())
