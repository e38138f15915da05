"""The plan of a study: its variants, checked and stored."""

import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.configuration.problems import did_you_mean, suggest
from fleet2d.configuration.units import parse_duration
from fleet2d.errors import Fleet2DError, InputError, RunDirectoryError, ScenarioError
from fleet2d.kernels import F64, I32, Bool
from fleet2d.scenario.model import Scenario
from fleet2d.studies.axes import Label
from fleet2d.studies.design import (
    SWITCHES,
    Design,
    content_hash,
    home_key,
    identity,
    input_hash,
    scenario_content,
    scenario_hashes,
)
from fleet2d.studies.directory import PLAN, MetricFacts, StudyDirectory
from fleet2d.studies.executors import (
    Crew,
    SerialExecutor,
    TaskQueue,
    WorkerTask,
    run_tasks,
)
from fleet2d.studies.records import VARIANT, array_of, numbers_of
from fleet2d.studies.simulator import check_setup, is_kept
from fleet2d.studies.specification import SEED, Specification

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


HASH = np.dtype("S16")
"""A hash of 32 hexadecimal digits, packed."""
Hashes = NDArray[np.bytes_]


def packed(hashes: Iterable[str]) -> Hashes:
    """Return hashes of 32 hexadecimal digits as HASH, (n,).

    >>> unpacked(packed(["00" * 15 + "ab"])[0])
    '000000000000000000000000000000ab'
    """
    return np.array([bytes.fromhex(text) for text in hashes], HASH)


def unpacked(value: bytes) -> str:
    """Return the hexadecimal digits of a packed hash; numpy cuts zeros off its end."""
    return value.ljust(HASH.itemsize, b"\0").hex()


@dataclass(frozen=True)
class PlannedVariants:
    """The variants of a plan as columns, 40 bytes each: as objects, ten million would take 5 GB.

    Attributes:
        seeds: How many variants of the design a combination has.
        index: Their indices in the design, ascending: int32 (n,).
        number: Their numbers in results: int32 (n,).
        identity: Their identities: HASH (n,).
        scenario: The hashes of their scenarios: HASH (n,).
        template: The hashes of the scenarios of combinations without seeds: HASH (m,).
        simulated_s: The simulated times of combinations [s]: float64 (m,).
        home: For each combination, its home, an index of `home_keys`: int32 (m,).
        home_keys: The keys of homes.
    """

    seeds: int
    index: I32
    number: I32
    identity: Hashes
    scenario: Hashes
    template: Hashes
    simulated_s: F64
    home: I32
    home_keys: tuple[str, ...]

    def __len__(self) -> int:
        """Return the number of variants."""
        return len(self.index)

    def __iter__(self) -> Iterator[PlannedVariant]:
        """Yield them in their order."""
        return map(self.__getitem__, range(len(self)))

    def __getitem__(self, place: int) -> PlannedVariant:
        """Return the variant at a place."""
        combination = int(self.index[place]) // self.seeds
        return PlannedVariant(
            int(self.number[place]),
            int(self.index[place]),
            unpacked(self.identity[place]),
            unpacked(self.scenario[place]),
            unpacked(self.template[combination]),
            self.home_keys[self.home[combination]],
            float(self.simulated_s[combination]),
        )

    def task(self, place: int) -> WorkerTask:
        """Return the task to run the variant at a place."""
        index = int(self.index[place])
        home = self.home_keys[self.home[index // self.seeds]]
        return WorkerTask(int(self.number[place]), index, unpacked(self.identity[place]), home)

    @property
    def total_simulated_s(self) -> float:
        """The simulated time of all variants [s]."""
        per_combination = np.bincount(self.index // self.seeds, minlength=len(self.simulated_s))
        return float((per_combination * self.simulated_s).sum())

    def take(self, places: NDArray[np.integer[Any]]) -> "PlannedVariants":
        """Return some of them, by their places."""
        columns = ("index", "number", "identity", "scenario")
        return replace(self, **{name: getattr(self, name)[places] for name in columns})


class StudyPlan(NamedTuple):
    """A design and its variants, all checked.

    Attributes:
        design: The design.
        variants: The variants, in the order of the design.
    """

    design: Design
    variants: PlannedVariants


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
                self.facts[name] = MetricFacts(
                    description,
                    kind.unit,
                    kind.units,
                    {name: float(number) for name, number in kind.least.items()},
                    {name: float(number) for name, number in kind.largest.items()},
                    kind.better,
                )

    def check(self, specification: Specification) -> None:
        """Check the names in a study file.

        Raises:
            ScenarioError: No variant has a table or a metric, or a metric isn't kept.
        """
        file = specification.file
        for i, name in enumerate(file.keep.tables):
            if name not in self._tables and not name.startswith(LAYERS):
                hint = suggest(name, sorted(self._tables))
                message = f"no variant has a table {name!r}{hint}"
                raise specification.error(("keep", "tables", i), message)
        for location, metric in file.named_metrics():
            problem = self._problem(metric)
            must_be_kept = location[0] in ("compare", "adapt")
            if not problem and must_be_kept and not is_kept(metric, file.keep.metrics):
                problem = f"the metric {metric!r} isn't kept: add it to keep.metrics"
            if problem:
                raise specification.error(location, problem)

    def _problem(self, name: str) -> str:
        """Return why no variant can have a metric, or one of a pattern; empty if some can."""
        prefix = re.split(r"[*?[]", name)[0]  # the part that has to be there as it is
        entry, dot, rest = prefix.partition(".")
        if not dot and prefix != name:
            if any(known.startswith(entry) for known in self._metrics):
                return ""
        elif dot and entry in self._metrics:
            body, dot, _ = rest.partition(".")
            is_whole = dot or prefix == name
            typo = did_you_mean(body, sorted(self._bodies))
            # Metrics of users' own may have numbers of any name.
            if not (is_whole and self._metrics[entry]) or body in self._bodies or typo == ".":
                return ""
            return f"{name!r} is of a body {body!r}, which no variant has{typo}"
        elif entry in self._metrics:
            return f"{name!r} is not a number: write {name}.* for all of its numbers"
        return f"no variant has a metric {entry!r}{suggest(entry, sorted(self._metrics))}"


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
    count = len(design.combinations)
    seeds = len(design.seeds)
    identities, scenarios = np.zeros((2, count, seeds), HASH)
    templates = np.zeros(count, HASH)
    simulated_s = np.zeros(count)
    homes = np.zeros(count, np.int32)
    home_keys = dict[str, int]()
    problems: list[str] = []
    first_of = dict[tuple[str, str], int]()
    repeated = _repeated(design.seeds)  # two variants with the same scenario
    for number in range(count):
        first = number * seeds
        try:
            scenario = design.scenario(first)
            content = scenario_content(scenario)
            inputs = input_hash(scenario)
        except InputError as error:
            problems.append(str(error))
            if len(problems) == MAX_PROBLEMS:
                break
            continue
        simulation = content["simulation"]
        template = content_hash({**content, "simulation": {**simulation, "seed": None}})
        repeated = repeated or (first_of.setdefault((template, inputs), first), first)
        repeated = None if repeated[0] == repeated[1] else repeated
        hashes = list(scenario_hashes(content, design.seeds))
        scenarios[number] = packed(hashes)
        identities[number] = packed(identity(each, inputs) for each in hashes)
        templates[number] = bytes.fromhex(template)
        homes[number] = home_keys.setdefault(home_key(content), len(home_keys))
        step, duration = (parse_duration(simulation[key]) for key in ("step", "duration"))
        simulated_s[number] = (duration // step * step).total_seconds()
        on_scenario(template, scenario)
    _raise_problems(problems)
    if repeated is not None:
        one, other = map(design.describe, repeated)
        raise ScenarioError(
            f"{one} and {other} are the same scenario: an axis sets what another axis or a rule"
            " overrides, or has a value twice"
        )
    places = np.arange(count * seeds, dtype=np.int32)
    columns = identities.reshape(-1), scenarios.reshape(-1), templates, simulated_s, homes
    return StudyPlan(design, PlannedVariants(seeds, places, places, *columns, tuple(home_keys)))


def _repeated(seeds: Sequence[int]) -> tuple[int, int] | None:
    """Return the places of two equal seeds; None if all differ."""
    first_of: dict[int, int] = {}
    pairs = ((first_of.setdefault(seed, i), i) for i, seed in enumerate(seeds))
    return next((pair for pair in pairs if pair[0] != pair[1]), None)


def setups_to_check(plan: StudyPlan) -> list[int]:
    """Return the places of variants in which each home meets each choice of every other axis.

    Their set-up shows people and robots that have no room where they start, without setting up
    every variant.
    """
    by_home = np.argsort(plan.variants.home, kind="stable")
    homes = np.split(by_home, np.flatnonzero(np.diff(plan.variants.home[by_home])) + 1)
    chosen = [number for home in homes for number in _covering(plan.design, home)]
    seeds = len(plan.design.seeds)
    return [number * seeds for number in chosen]


def _covering(design: Design, numbers: NDArray[np.integer[Any]]) -> Iterator[int]:
    """Yield combinations of one home, by number, in which each choice of each axis comes once."""
    rows = design.combinations[numbers]
    varying = np.flatnonzero((rows != rows[0]).any(axis=0)).tolist()
    covered: set[tuple[int, int]] = set()
    for all_new in (True, False):  # variants of new choices only come first: fewer are needed
        for number, row in zip(numbers.tolist(), rows[:, varying].tolist(), strict=True):
            choices = set(zip(varying, row, strict=True))
            uncovered = choices - covered
            if uncovered and (uncovered == choices or not all_new):
                covered |= choices
                yield number
    if not varying:
        yield int(numbers[0])


def setup_problem(design: Design, task: WorkerTask) -> str:
    """Set a variant up without running it; return the error, empty if there is none.

    Args:
        design: The design.
        task: The variant.
    """
    try:
        check_setup(design.scenario(task.index))
    except Fleet2DError as error:
        return str(error)
    return ""


def check_setups(
    plan: StudyPlan, crew: Crew, on_progress: Callable[[int, int], None] = lambda *_: None
) -> None:
    """Set up the variants that `setups_to_check` returns: homes with people and robots in them.

    Raises:
        ScenarioError: Variants are wrong; a line per problem, with axis and value.
    """
    problems: dict[int, str] = {}
    tasks = list(map(plan.variants.task, setups_to_check(plan)))
    if len(tasks) <= FEW_SETUPS:
        crew = Crew(SerialExecutor())
    job = partial(setup_problem, plan.design)
    done = 0
    with closing(run_tasks(crew, job, TaskQueue(tasks))) as rounds:
        for ends in rounds:
            done += len(ends)
            on_progress(done, len(tasks))
            for end in ends:
                if text := end.loss or end.payload:
                    problems[end.task.index] = f"{plan.design.describe(end.task.index)}: {text}"
            if len(problems) >= MAX_PROBLEMS:
                break
    _raise_problems([problems[index] for index in sorted(problems)[:MAX_PROBLEMS]])


def _raise_problems(problems: list[str]) -> None:
    """Raise an error about problems; of those that differ by their variant only, about the first.

    Raises:
        ScenarioError: There are problems.
    """
    if len(problems) == MAX_PROBLEMS:
        problems = [*problems, f"… and perhaps more: these are the first {MAX_PROBLEMS}"]
    first: dict[str, str] = {}
    for text in problems:
        first.setdefault(text.partition("): ")[2] or text, text)
    if first:
        raise ScenarioError("\n".join(first.values()))


Changed = Literal["redo", "keep"]
PLAN_BATCH = 5_000  # rows of the plan that are in memory as text
BATCH = 1000
FIND_BATCH = 1 << 20  # hashes that are looked up together: bounds the memory


class ScenarioFile:
    """Collects the scenarios of combinations as a compressed Parquet file in memory."""

    def __init__(self) -> None:
        """Create an empty file."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._schema = pa.schema([("template", pa.string()), ("scenario", pa.string())])
        self._sink = pa.BufferOutputStream()
        self._writer = pq.ParquetWriter(self._sink, self._schema, compression="zstd")
        self._rows: list[tuple[str, str]] = []

    def add(self, template: str, scenario: Scenario) -> None:
        """Add the scenario of a combination, with any of its seeds."""
        self._rows.append((template, json.dumps(scenario.resolved())))
        if len(self._rows) == BATCH:
            self._flush()

    def content(self) -> bytes:
        """Close the file and return its bytes."""
        self._flush()
        self._writer.close()
        return bytes(self._sink.getvalue())

    def _flush(self) -> None:
        import pyarrow as pa

        if self._rows:
            columns = [array_of(each, pa.string()) for each in zip(*self._rows, strict=True)]
            self._writer.write_table(pa.table(columns, schema=self._schema))
        self._rows = []


def reconcile(
    plan: StudyPlan,
    directory: StudyDirectory,
    finished: Bool,
    changed: Changed | None,
    on_note: Callable[[str], None],
    *,
    notes_new: bool,
) -> StudyPlan:
    """Number the variants of a plan as in the stored study; new variants get new numbers.

    Args:
        plan: The current plan.
        directory: The study.
        finished: Whether there are results, by the number of the variant: bool (n,).
        changed: What to do with results of other code, inputs or scenarios.
        on_note: Receives a remark about results that are set aside: they no longer belong to it.
        notes_new: Whether it receives one about new variants, too.

    Raises:
        RunDirectoryError: There are such results, and `changed` is None.
    """
    if not directory.storage.exists(PLAN):
        if finished.any():
            raise RunDirectoryError(
                f"{directory.location}/{PLAN} is missing, and with it the variants of the results:"
                " choose another --out"
            )
        return plan
    variants, (stored_number, stored_identity) = plan.variants, _stored(directory, "identity")
    place = _find(stored_identity, variants.identity)
    is_stored = place >= 0
    number = np.append(stored_number, np.int32(-1))[place]  # -1 for those at place -1
    count = 1 + int(stored_number.max(initial=-1))
    has_result = np.append(finished, np.zeros(count, np.bool_))[stored_number]
    has_result[place[is_stored]] = False  # only those that are gone are left
    stale = np.flatnonzero(has_result)
    same = np.full(len(variants), -1, np.int32)
    if len(stale):
        _, stored_scenario = _stored(directory, "scenario")
        same = np.where(is_stored, -1, _find(stored_scenario[stale], variants.scenario))
    if len(stale) and changed is None:
        recomputed = np.count_nonzero(same >= 0)
        raise RunDirectoryError(_refusal(directory.location, int(recomputed), len(stale)))
    reused = np.zeros(len(variants), np.bool_)
    identity = variants.identity
    if changed == "keep":
        reused = same >= 0
        identity = identity.copy()
        number[reused] = stored_number[stale[same[reused]]]
        identity[reused] = stored_identity[stale[same[reused]]]
    is_new = ~is_stored & ~reused
    number[is_new] = np.arange(count, count + np.count_nonzero(is_new))
    new = np.count_nonzero(is_new)
    set_aside = len(stale) - np.count_nonzero(reused)
    if 0 < new < len(variants) and notes_new:
        on_note(f"{new} variants are new in {directory.location}")
    if set_aside:
        on_note(f"{set_aside} results no longer belong to the study: set aside")
    return StudyPlan(plan.design, replace(variants, number=number, identity=identity))


def _stored(directory: StudyDirectory, column: str) -> tuple[I32, Hashes]:
    """Return the numbers of the variants of the stored plan, and a column of hashes: (n,) each."""
    count = sum(directory.storage.row_groups(PLAN))
    end = 0
    with directory.storage.reading(PLAN):
        numbers = np.empty(count, np.int32)
        hashes = np.empty(count, HASH)
        for batch in directory.plan_batches((VARIANT, column)):
            begin, end = end, end + len(batch)
            numbers[begin:end] = numbers_of(batch)
            hashes[begin:end] = packed(batch[column].to_pylist())
    return numbers, hashes


def _find(among: Hashes, wanted: Hashes) -> I32:
    """Return the last place of each wanted hash among others, or -1: int32 (n,)."""
    order = np.argsort(among, kind="stable")
    places = np.full(len(wanted), -1, np.int32)
    for begin in range(0, len(wanted) if len(among) else 0, FIND_BATCH):
        part = wanted[begin : begin + FIND_BATCH]
        # A hash below all others comes to -1, the last of the order, which it doesn't equal.
        place = order[np.searchsorted(among, part, side="right", sorter=order) - 1]
        places[begin : begin + FIND_BATCH] = np.where(among[place] == part, place, -1)
    return places


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


def plan_batches(plan: StudyPlan) -> "Iterator[pa.Table]":
    """Yield a plan as tables: a row per variant, in the order of the design."""
    import pyarrow as pa

    from fleet2d.artifacts.arrow import number_array

    design = plan.design
    variants = plan.variants
    labels = {}  # by column: the number of its axis, and the label of each choice, of none last
    for number, axis in enumerate(design.axes):
        used = set(np.unique(design.combinations[:, number]).tolist())
        for column in axis.columns:
            texts = (c.labels[column] if i in used else None for i, c in enumerate(axis.choices))
            labels[column] = number, label_array([*texts, None])
    homes = array_of(variants.home_keys, pa.string())
    seeds = np.array(design.seeds, np.int64)
    for begin in range(0, max(len(variants), 1), PLAN_BATCH):
        index = variants.index[begin : begin + PLAN_BATCH]
        combination, seed = np.divmod(index, len(design.seeds))
        numbers = variants.number[begin : begin + PLAN_BATCH]
        columns = {VARIANT: number_array(numbers, pa.int32())}
        for name in ("identity", "scenario"):
            values = getattr(variants, name)[begin : begin + PLAN_BATCH]
            columns[name] = array_of(map(unpacked, values.tolist()), pa.string())
        templates = map(unpacked, variants.template[combination].tolist())
        columns["template"] = array_of(templates, pa.string())
        columns["home_key"] = homes.take(number_array(variants.home[combination], pa.int32()))
        columns["simulated_s"] = number_array(variants.simulated_s[combination], pa.float64())
        for column, (number, texts) in labels.items():
            codes = design.combinations[combination, number] % len(texts)  # -1 is the last
            columns[column] = texts.take(number_array(codes, pa.int32()))
        columns[SEED] = number_array(seeds[seed], pa.int64())
        yield pa.table(columns)


def label_array(labels: list[Label]) -> "pa.Array":
    """Return labels as a column: numbers or booleans if all labels are, else text.

    >>> label_array([1, 2.5]).type, label_array([1, "a"]).to_pylist()
    (DataType(double), ['1', 'a'])
    """
    import pyarrow as pa

    kinds = {type(label) for label in labels if label is not None}
    if kinds <= {bool} or kinds <= {int}:
        return array_of(labels, pa.bool_() if kinds == {bool} else pa.int64())
    if kinds <= {int, float}:
        return array_of(labels, pa.float64())
    texts = (None if label is None else str(label) for label in labels)
    return array_of(texts, pa.string())


def write_plan(directory: StudyDirectory, plan: StudyPlan) -> None:
    """Write the plan of a study."""
    directory.storage.write_batches(PLAN, plan_batches(plan), directory.scratch)
