"""The plan of a study: its variants, checked and stored, and the time that they will take."""

import json
import re
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from datetime import timedelta
from typing import TYPE_CHECKING, Any, Literal

from fleet2d.configuration.problems import did_you_mean, suggest
from fleet2d.configuration.trust import Trust, current_trust, restrict
from fleet2d.configuration.units import parse_duration
from fleet2d.errors import (
    ComponentError,
    Fleet2DError,
    InputError,
    RunDirectoryError,
    ScenarioError,
)
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.scenario.model import Scenario
from fleet2d.studies.axes import Label
from fleet2d.studies.design import (
    SWITCHES,
    Design,
    FileHashes,
    content_hash,
    home_key,
    identity,
    input_hash,
    scenario_content,
    scenario_hashes,
)
from fleet2d.studies.directory import PLAN, SCENARIOS, MetricFacts, StudyDirectory
from fleet2d.studies.executors import (
    Executor,
    FinishedTask,
    LostTask,
    SerialExecutor,
    TaskSchedule,
    WorkerTask,
)
from fleet2d.studies.parts import VARIANT
from fleet2d.studies.simulator import check_setup, is_kept, measure
from fleet2d.studies.specification import SEED, StudyFile

if TYPE_CHECKING:
    import pyarrow as pa


MAX_PROBLEMS = 10  # in one report
LAYERS = ("explored", "first_seen", "last_seen", "time_since_seen")  # tables of robots' maps
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


class KnownNames:
    """The names of tables, metrics and bodies in the variants of a study.

    A study that keeps or compares what no variant has would end without it, silently.

    Attributes:
        facts: What readers should know of each metric.
    """

    def __init__(self) -> None:
        """Start without names."""
        self._tables = {"trajectories", *SWITCHES}
        self._metrics: dict[str, bool] = {}  # by name, whether it comes with Fleet2D
        self._bodies = {"anyone"}
        self.facts: dict[str, MetricFacts] = {}

    def add(self, scenario: Scenario) -> None:
        """Add the names of a scenario."""
        self._tables |= {*scenario.algorithms, *scenario.metrics}
        self._tables |= {"sensors"} if scenario.objects else set()
        self._bodies |= {*scenario.users, *scenario.robots}
        for name, metric in scenario.metrics.items():
            kind = type(metric)
            self._metrics[name] = kind.__module__.startswith("fleet2d.")
            if name not in self.facts:
                description = (kind.__doc__ or "").strip().partition("\n")[0]
                self.facts[name] = MetricFacts(description, kind.unit, kind.units)

    def check(self, file: StudyFile) -> None:
        """Check the names in a study file.

        Raises:
            ScenarioError: No variant has a table or a metric, or a metric isn't kept.
        """
        for name in file.keep.tables:
            if name not in self._tables and not name.startswith(LAYERS):
                raise ScenarioError(
                    f"keep.tables: no variant has a table {name!r}"
                    f"{suggest(name, sorted(self._tables))}"
                )
        for pattern in file.keep.metrics:
            self._check_metric("keep.metrics", pattern)
        used = [("compare", comparison.metric) for comparison in file.compare]
        used += [("adapt", file.adapt.metric)] if file.adapt else []
        for key, metric in used:
            self._check_metric(key, metric)
            if not is_kept(metric, file.keep.metrics):
                raise ScenarioError(
                    f"{key}: the metric {metric!r} isn't kept: add it to keep.metrics"
                )
        for name in file.tune.objectives if file.tune else ():
            self._check_metric("tune.objectives", name)

    def _check_metric(self, key: str, name: str) -> None:
        """Refuse a metric, or the pattern of some, of which no variant can have one."""
        prefix = re.split(r"[*?[]", name)[0]  # the part that has to be there as it is
        entry, dot, rest = prefix.partition(".")
        if not dot and prefix != name:
            if any(known.startswith(entry) for known in self._metrics):
                return
        elif dot and entry in self._metrics:
            body, dot, _ = rest.partition(".")
            is_whole = dot or prefix == name
            typo = did_you_mean(body, sorted(self._bodies))
            # Metrics of users' own may have numbers of any name.
            if not (is_whole and self._metrics[entry]) or body in self._bodies or typo == ".":
                return
            raise ScenarioError(
                f"{key}: {name!r} is of a body {body!r}, which no variant has{typo}"
            )
        elif entry in self._metrics:
            raise ScenarioError(
                f"{key}: {name!r} is no number: write {name}.* for all of its numbers"
            )
        raise ScenarioError(
            f"{key}: no variant has a metric {entry!r}{suggest(entry, sorted(self._metrics))}"
        )


def make_plan(
    design: Design, on_scenario: Callable[[str, Scenario], None] = lambda *_: None
) -> StudyPlan:
    """Build and check the scenario of every variant of a design.

    Args:
        design: The design.
        on_scenario: Called with the template (a hash) and the scenario of each combination.

    Raises:
        ScenarioError: Variants are wrong; a line per problem, with axis and value.
    """
    variants: list[PlannedVariant] = []
    problems: list[str] = []
    files = FileHashes()
    for number in range(len(design.combinations)):
        first = number * len(design.seeds)
        try:
            scenario = design.scenario(first)
            content = scenario_content(scenario)
            variants += _planned(design, first, content, input_hash(scenario, files))
        except InputError as error:
            problems.append(str(error))
            if len(problems) == MAX_PROBLEMS:
                break
            continue
        on_scenario(variants[-1].template, scenario)
    _raise_problems(problems)
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


@dataclass
class SetupJob:
    """Sets variants up without running them, to find errors.

    Attributes:
        design: The design.
        trust: The code that workers may run; None: any.
    """

    design: Design
    trust: Trust | None = field(default_factory=current_trust)

    def __call__(self, task: WorkerTask) -> str:
        """Return the error of a variant's set-up; empty if there is none."""
        try:
            with restrict(self.trust):
                check_setup(self.design.scenario(task.index))
        except Fleet2DError as error:
            return str(error)
        return ""


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
            text = event.reason if isinstance(event, LostTask) else event.payload
            if text:
                problems[event.task.index] = f"{plan.design.describe(event.task.index)}: {text}"
            if len(problems) == MAX_PROBLEMS:
                break
    finally:
        events.close()
    _raise_problems([problems[index] for index in sorted(problems)])


def _raise_problems(problems: list[str]) -> None:
    if len(problems) == MAX_PROBLEMS:
        problems = [*problems, f"… and perhaps more: these are the first {MAX_PROBLEMS}"]
    if problems:
        raise ScenarioError("\n".join(_without_repetition(problems)))


def _planned(
    design: Design, first: int, content: dict[str, Any], inputs: str
) -> Iterator[PlannedVariant]:
    """Yield the variants of one combination; they differ by their seeds only."""
    home, simulation = home_key(content), content["simulation"]
    step, duration = parse_duration(simulation["step"]), parse_duration(simulation["duration"])
    template = content_hash({**content, "simulation": {**simulation, "seed": None}})
    simulated_s = (duration // step * step).total_seconds()
    for i, scenario in enumerate(scenario_hashes(content, design.seeds), first):
        yield PlannedVariant(
            i, i, identity(scenario, inputs), scenario, template, home, simulated_s
        )


def _check_identities(design: Design, variants: Sequence[PlannedVariant]) -> None:
    """Refuse two variants with the same scenario: some axis has no effect."""
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


Changed = Literal["redo", "keep"]
PLAN_COLUMNS = (VARIANT, "identity", "scenario", "template", "home_key", "simulated_s")
BATCH = 1000


class ScenarioFile:
    """Collects the scenarios of combinations as a compressed Parquet file in memory."""

    def __init__(self) -> None:
        """Create an empty file."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._schema = pa.schema([("template", pa.string()), ("scenario", pa.string())])
        self._sink = pa.BufferOutputStream()
        self._writer = pq.ParquetWriter(self._sink, self._schema, compression="zstd")
        self._rows: list[dict[str, str]] = []

    def add(self, template: str, scenario: Scenario) -> None:
        """Add the scenario of a combination, with any of its seeds."""
        content = json.dumps(scenario.resolved())
        self._rows.append({"template": template, "scenario": content})
        if len(self._rows) == BATCH:
            self._flush()

    def content(self) -> bytes:
        """Close the file and return its bytes."""
        self._flush()
        self._writer.close()
        return bytes(self._sink.getvalue())

    def _flush(self) -> None:
        import pyarrow as pa

        self._writer.write_table(pa.Table.from_pylist(self._rows, self._schema))
        self._rows = []


@dataclass(frozen=True)
class ReconciledPlan:
    """A plan matched with the stored variants of a study.

    Attributes:
        plan: The plan, with the numbers of stored variants.
        new: The number of variants that the study didn't have.
        set_aside: The number of stored results that no longer belong to it.
    """

    plan: StudyPlan
    new: int
    set_aside: int


def reconcile(
    plan: StudyPlan, directory: StudyDirectory, finished: Iterable[int], changed: Changed | None
) -> ReconciledPlan:
    """Number the variants of a plan as in the stored study; new variants get new numbers.

    Args:
        plan: The current plan.
        directory: The study.
        finished: Numbers of the variants with results.
        changed: What to do with results of other code, inputs or scenarios.

    Raises:
        RunDirectoryError: There are such results, and `changed` is None.
    """
    with_results = set(finished)
    if not directory.storage.exists(PLAN):
        if with_results:
            raise RunDirectoryError(
                f"{directory.location}/{PLAN} is missing, and with it the variants of the results:"
                " choose another --out"
            )
        return ReconciledPlan(plan, len(plan.variants), 0)
    stored_rows = directory.plan(PLAN_COLUMNS[:3]).to_pylist()
    numbers = {row["identity"]: row[VARIANT] for row in stored_rows}
    present = {variant.identity for variant in plan.variants}
    stale = {
        row["scenario"]: row
        for row in stored_rows
        if row["identity"] not in present and row[VARIANT] in with_results
    }
    recomputed = [v for v in plan.variants if v.identity not in numbers and v.scenario in stale]
    if stale and changed is None:
        raise RunDirectoryError(_refusal(directory.location, len(recomputed), len(stale)))
    next_number = max(numbers.values(), default=-1) + 1
    variants: list[PlannedVariant] = []
    reused = 0
    for variant in plan.variants:
        if variant.identity in numbers:
            variants.append(replace(variant, number=numbers[variant.identity]))
        elif changed == "keep" and variant.scenario in stale:
            row = stale[variant.scenario]
            variants.append(replace(variant, number=row[VARIANT], identity=row["identity"]))
            reused += 1
        else:
            variants.append(replace(variant, number=next_number))
            next_number += 1
    new_variants = sum(variant.identity not in numbers for variant in variants)
    return ReconciledPlan(
        StudyPlan(plan.design, tuple(variants)), new_variants, len(stale) - reused
    )


def _refusal(location: str, recomputed: int, stale: int) -> str:
    removed = stale - recomputed
    causes = [
        f"{recomputed} of the same scenarios, by other code or input files" * bool(recomputed),
        f"{removed} of scenarios that the study no longer has" * bool(removed),
    ]
    keep = ", --changed keep leaves those of other code as they are" if recomputed else ""
    return (
        f"{location} holds results that don't belong to this study as it is now:"
        f" {' and '.join(filter(None, causes))}. --changed redo runs again what has changed and"
        f" sets the old results aside{keep}; or choose another --out"
    )


def plan_table(plan: StudyPlan) -> "pa.Table":
    """Return a plan as a table: a row per variant, in the order of the design."""
    import pyarrow as pa

    columns: dict[str, pa.Array] = {
        VARIANT: pa.array([v.number for v in plan.variants], pa.int32())
    }
    for name in PLAN_COLUMNS[1:]:
        columns[name] = pa.array([getattr(v, name) for v in plan.variants])
    seeds = len(plan.design.seeds)
    places = pa.array([v.index // seeds for v in plan.variants], pa.int32())
    for column, labels in plan.design.combination_labels.items():
        columns[column] = label_array(labels).take(places)
    columns[SEED] = pa.array([plan.design.seeds[v.index % seeds] for v in plan.variants])
    return pa.table(columns)


def label_array(labels: list[Label]) -> "pa.Array":
    """Return labels as a column: numbers or booleans if all labels are, else text.

    >>> label_array([1, 2.5]).type, label_array([1, "a"]).to_pylist()
    (DataType(double), ['1', 'a'])
    """
    import pyarrow as pa

    kinds = {type(label) for label in labels if label is not None}
    if kinds <= {bool} or kinds <= {int}:
        return pa.array(labels, pa.bool_() if kinds == {bool} else pa.int64())
    if kinds <= {int, float}:
        return pa.array(labels, pa.float64())
    return pa.array([None if label is None else str(label) for label in labels], pa.string())


def write_catalogue(
    directory: StudyDirectory, plan: StudyPlan, scenarios: Callable[[], bytes]
) -> None:
    """Write the plan and the scenarios of a study."""
    directory.storage.write(SCENARIOS, scenarios())
    directory.storage.write_table(PLAN, plan_table(plan))


def stored_scenario(directory: StudyDirectory, number: int) -> dict[str, Any]:
    """Return the scenario of a variant, with its seed.

    Raises:
        RunDirectoryError: The study has no such variant.
    """
    row_filter = [(VARIANT, "=", number)]
    rows = directory.storage.read_table(PLAN, ["template", "seed"], row_filter).to_pylist()
    if not rows:
        raise RunDirectoryError(f"{directory.location} has no variant {number}")
    template_filter = [("template", "=", rows[0]["template"])]
    with directory.storage.reading(SCENARIOS):
        texts = directory.storage.read_table(SCENARIOS, filters=template_filter).to_pylist()
        content: dict[str, Any] = json.loads(texts[0]["scenario"])
        content["simulation"]["seed"] = rows[0]["seed"]
    return content


SAMPLES = 3
BUILDS = 2  # of each home: to check the set-ups, and to run


@dataclass(frozen=True)
class Forecast:
    """The time that a study will take.

    Attributes:
        simulated: The simulated time of all variants.
        start: The wall time until workers are ready.
        work: The wall time of all variants and homes with one worker.
    """

    simulated: timedelta
    start: timedelta
    work: timedelta

    def by(self, workers: int) -> timedelta:
        """Return the wall time with a number of workers."""
        return self.start + self.work / max(workers, 1)


@dataclass
class SpeedJob(SetupJob):
    """Measures the speed of variants, after a warm-up that loads all code."""

    is_warm: bool = False

    def __call__(self, task: WorkerTask) -> Any:
        """Return the speed of a variant and the wall time of measuring it [s]; None if it fails."""
        try:
            with restrict(self.trust):
                scenario = self.design.scenario(task.index)
                if not self.is_warm:
                    measure(scenario, max_s=0.0)
                    self.is_warm = True
                start_s = time.perf_counter()
                return measure(scenario), time.perf_counter() - start_s
        except Fleet2DError:  # a variant may fail without ending the study
            return None


def forecast(plan: StudyPlan, executor: Executor, samples: int = SAMPLES) -> Forecast:
    """Measure the speed of some variants in a worker.

    Raises:
        ComponentError: All measured variants fail.
    """
    count = len(plan.variants)
    numbers = {round(i * (count - 1) / max(samples - 1, 1)) for i in range(samples)}
    tasks = [WorkerTask(i, plan.variants[i].index, "") for i in sorted(numbers)]
    begin_s = time.perf_counter()
    with closing(executor.run(SpeedJob(plan.design), TaskSchedule(tasks))) as events:
        results = [event.payload for event in events if isinstance(event, FinishedTask)]
    measured = [result for result in results if result is not None]
    if not measured:
        raise ComponentError("all measured variants fail: run one of them with `fleet2d run`")
    worker_s = time.perf_counter() - begin_s - sum_in_order(seconds for _, seconds in measured)
    simulated_s = sum(variant.simulated_s for variant in plan.variants)
    homes = len({variant.home_key for variant in plan.variants})
    start_s = worker_s * (1 + (len(setups_to_check(plan)) > FEW_SETUPS))
    # The first variant finds its home built by the warm-up.
    home_s = max(speed.home_s for speed, _ in measured)
    runs_s = sum_in_order(speed.seconds(simulated_s / count) for speed, _ in measured)
    work_s = BUILDS * homes * home_s + count * runs_s / len(measured)
    return Forecast(*(timedelta(seconds=s) for s in (simulated_s, start_s, work_s)))
