"""The plan of a study: its variants, checked and stored."""

import itertools
import json
import re
import tempfile
import weakref
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.configuration.problems import did_you_mean, suggest
from fleet2d.configuration.units import parse_duration
from fleet2d.errors import Fleet2DError, InputError, RunDirectoryError, ScenarioError
from fleet2d.scenario.model import Scenario
from fleet2d.studies.axes import Label
from fleet2d.studies.design import (
    SWITCHES,
    Design,
    home_key,
    identity,
    input_hash,
    scenario_content,
    template_hash,
)
from fleet2d.studies.directory import (
    PLAN,
    PLAN_ONLY,
    SCENARIOS,
    MetricFacts,
    StudyDirectory,
)
from fleet2d.studies.executors import (
    Crew,
    SerialExecutor,
    TaskQueue,
    WorkerTask,
    run_tasks,
)
from fleet2d.studies.population import MAX_PROBLEMS, FleetLives, raise_problems
from fleet2d.studies.results import VARIANT
from fleet2d.studies.simulator import check_setup, is_kept
from fleet2d.studies.specification import SEED, Specification

if TYPE_CHECKING:
    import polars as pl
    import pyarrow as pa


LAYERS = ("explored", "first_seen", "last_seen", "time_since_seen")  # tables of robots' maps
SLICE_ROWS = 5_000  # variants whose results are in memory at a time
SCENARIO_ROWS = 1_000  # scenarios that are in memory at a time
FEW_SETUPS = 8  # for so few, starting workers costs more than it saves
FLEET_HOMES = 100
"""Homes of a fleet that are set up before its first run, as all lives are drawn alike."""


class StudyPlan(NamedTuple):
    """A design and its variants, all checked.

    Attributes:
        design: The design.
        variants: A row for each variant, in the order of the design: `variant`, its number in
            results, which stays when the study is extended; `index` in the design; `identity`, the
            hash of everything that its results depend on; `template`, that of its scenario without
            the seed; `seed`; `home_key`, the same for variants that can share a home;
            `simulated_s` [s].
    """

    design: Design
    variants: "pl.DataFrame"

    def queue(self, variants: "pl.DataFrame") -> TaskQueue:
        """Return the tasks to run some of its variants."""
        import polars as pl

        place = pl.int_range(pl.len()).first().over("home_key")  # where its home comes first
        rows = variants.select(VARIANT, "index", "identity", "home_key", place=place)
        rows = rows.sort("place", maintain_order=True)
        counts = rows["place"].rle().struct.field("len")
        ends = counts.cum_sum()
        columns = rows.drop("place")

        def tasks(end: int, count: int) -> Iterator[WorkerTask]:
            # As objects, all tasks together would take several times the memory of the rows.
            yield from itertools.starmap(WorkerTask, columns[end - count : end].iter_rows())

        return TaskQueue(
            (count, tasks(end, count)) for end, count in zip(ends, counts, strict=True)
        )


class KnownNames:
    """The names of tables, metrics and bodies in the variants of a study.

    A study that keeps or compares what no variant has would end without it, silently.

    Attributes:
        facts: The description of each metric for readers.
    """

    def __init__(self) -> None:
        """Start without names."""
        self._tables = {"trajectories", *SWITCHES}
        self._metrics: dict[str, bool] = {}  # whether each comes with Fleet2D, by name
        self._bodies = {"anyone"}
        self.facts: dict[str, MetricFacts] = {}

    def add(self, scenario: Scenario) -> None:
        """Add the names of a scenario."""
        self._tables |= {*scenario.algorithms, *scenario.metrics}
        if scenario.objects:
            self._tables.add("sensors")
        self._bodies |= {*scenario.users, *scenario.robots}
        for name, metric in scenario.metrics.items():
            kind = type(metric)
            self._metrics[name] = kind.__module__.startswith("fleet2d.")
            if name not in self.facts:
                description = (kind.__doc__ or "").strip().partition("\n")[0]
                self.facts[name] = MetricFacts(
                    description=description,
                    unit=kind.unit,
                    units=dict(kind.units),
                    least=dict(kind.least),
                    largest=dict(kind.largest),
                    better=dict(kind.better),
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
            must_be_kept = location[0] == "compare"
            if not problem and must_be_kept and not is_kept(metric, file.keep.metrics):
                problem = f"the metric {metric!r} isn't kept: add it to keep.metrics"
            if problem:
                raise specification.error(location, problem)

    def _problem(self, name: str) -> str:
        """Return why no variant can have a metric, or one of a pattern; empty if some can."""
        prefix = re.split(r"[*?[]", name)[0]  # the part without wildcards
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
    import polars as pl

    frames: list[pl.DataFrame] = []  # rows of Python objects take several times the memory
    rows: list[tuple[str, str, str, int, float]] = []
    problems: list[str] = []
    first_of = dict[tuple[str, str], int]()
    repeated = _repeated(design.seeds)  # two variants with the same scenario
    for first in range(0, len(design), len(design.seeds)):
        try:
            scenario = design.scenario(first)
            content = scenario_content(scenario)
            inputs = input_hash(scenario)
        except InputError as error:
            problems.append(str(error))
            if len(problems) == MAX_PROBLEMS:
                break
            continue
        template = template_hash(content)
        same = first_of.setdefault((template, inputs), first)
        seeds = design.seeds_of(first)  # each life has seeds of its own
        if same != first and repeated is None and design.seeds_of(same) == seeds:
            repeated = same, first
        home = home_key(content)
        seconds = _simulated_s(content["simulation"])
        rows += [(identity(template, s, inputs), template, home, s, seconds) for s in seeds]
        if len(rows) >= SLICE_ROWS:
            frames.append(_frame_of(rows))
            rows = []
        if same == first:
            on_scenario(template, scenario)
    raise_problems(problems)
    if repeated is not None:
        one, other = map(design.describe, repeated)
        raise ScenarioError(
            f"{one} and {other} are the same scenario: an axis sets what another axis or a rule"
            " overrides, or has a value twice"
        )
    numbers = pl.int_range(pl.len(), dtype=pl.Int32)
    variants = pl.concat([*frames, _frame_of(rows)])
    variants = variants.with_columns(numbers.alias(VARIANT), numbers.alias("index"))
    return StudyPlan(design, variants)


def _frame_of(rows: list[tuple[str, str, str, int, float]]) -> "pl.DataFrame":
    """Return variants as a data frame: identity, template, home, seed and simulated time [s]."""
    import polars as pl

    texts = dict.fromkeys(("identity", "template", "home_key"), pl.String)
    schema = {**texts, SEED: pl.Int64, "simulated_s": pl.Float64}
    return pl.DataFrame(rows, schema, orient="row")


def _simulated_s(simulation: Mapping[str, Any]) -> float:
    """Return the simulated time of a run in whole steps [s]."""
    step = parse_duration(simulation["step"])
    duration = parse_duration(simulation["duration"])
    return (duration // step * step).total_seconds()


def _repeated(seeds: Sequence[int]) -> tuple[int, int] | None:
    """Return the places of two equal seeds; None if all differ."""
    first_of: dict[int, int] = {}
    pairs = ((first_of.setdefault(seed, i), i) for i, seed in enumerate(seeds))
    return next((pair for pair in pairs if pair[0] != pair[1]), None)


def setups_to_check(plan: StudyPlan) -> list[int]:
    """Return the places of variants in which each home meets each choice of every other axis.

    Their set-up shows people and robots that have no room where they start, without setting up
    every variant. For a fleet the first homes are enough: a later life without room fails by
    itself.
    """
    seeds = len(plan.design.seeds)
    homes: dict[str, list[int]] = {}
    for number, home in enumerate(plan.variants["home_key"].gather_every(seeds)):
        homes.setdefault(home, []).append(number)
    is_fleet = any(isinstance(axis.choices, FleetLives) for axis in plan.design.axes)
    checked = itertools.islice(homes.values(), FLEET_HOMES if is_fleet else None)
    chosen = (_covering(plan.design, np.array(numbers)) for numbers in checked)
    return [number * seeds for number in itertools.chain.from_iterable(chosen)]


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
    places = setups_to_check(plan)
    if len(places) <= FEW_SETUPS:
        crew = Crew(SerialExecutor(), plans=crew.plans)
    job = partial(setup_problem, plan.design)
    done = 0
    with closing(run_tasks(crew, job, plan.queue(plan.variants[places]))) as rounds:
        for ends in rounds:
            done += len(ends)
            on_progress(done, len(places))
            for end in ends:
                if text := end.loss or end.payload:
                    problems[end.task.index] = f"{plan.design.describe(end.task.index)}: {text}"
    raise_problems([problems[index] for index in sorted(problems)])


Changed = Literal["redo", "keep"]


class ScenarioFile:
    """Collects the scenarios of combinations as compressed text, outside of the memory."""

    def __init__(self) -> None:
        """Start without scenarios."""
        self._templates: list[str] = []
        self._texts = tempfile.TemporaryFile()  # noqa: SIM115 - closed with this object
        weakref.finalize(self, self._texts.close)

    def add(self, template: str, scenario: Scenario) -> None:
        """Add the scenario of a combination, with any of its seeds."""
        text = zlib.compress(json.dumps(scenario.resolved()).encode(), 1)
        self._templates.append(template)
        self._texts.write(len(text).to_bytes(4) + text)

    def write(self, directory: StudyDirectory) -> None:
        """Write the scenarios to the folder of a study."""
        directory.storage.write_table(SCENARIOS, self._parts())

    def _parts(self) -> "Iterator[pa.Table]":
        import polars as pl  # Arrow would import pandas to look at lists

        self._texts.seek(0)
        for first in range(0, len(self._templates), SCENARIO_ROWS):
            templates = self._templates[first : first + SCENARIO_ROWS]
            texts = [self._next_text() for _ in templates]
            yield pl.DataFrame({"template": templates, "scenario": texts}).to_arrow()

    def _next_text(self) -> str:
        size = int.from_bytes(self._texts.read(4))
        return zlib.decompress(self._texts.read(size)).decode()


def reconcile(
    planned: "pl.DataFrame",
    directory: StudyDirectory,
    finished: "pl.Series",
    changed: Changed | None,
    on_note: Callable[[str], None],
) -> "pl.DataFrame":
    """Number planned variants as in the stored study; new variants get new numbers.

    Args:
        planned: The current variants, with the columns of `StudyPlan.variants`.
        directory: The study.
        finished: The numbers of variants that have results.
        changed: What to do with results of other code, inputs or scenarios.
        on_note: Receives remarks about new variants, and about results that are set aside.

    Raises:
        RunDirectoryError: There are such results, and `changed` is None.
    """
    import polars as pl

    if not directory.storage.exists(PLAN):
        if len(finished):
            raise RunDirectoryError(
                f"{directory.location}/{PLAN} is missing, and with it the variants of the results:"
                " choose another --out"
            )
        return planned
    stored = directory.plan((VARIANT, "identity").__contains__)
    if stored["identity"].equals(planned["identity"]):  # it takes less memory than joins
        return planned.with_columns(stored[VARIANT])
    stored = directory.plan((VARIANT, "identity", "template", SEED).__contains__)
    numbers = stored.select("identity", stored=VARIANT).unique("identity", keep="last")
    stale = stored.filter(pl.col(VARIANT).is_in(finished.implode()))
    stale = stale.join(planned, on="identity", how="anti")
    same = ["template", SEED]
    others = stale.select(*same, other=VARIANT, old="identity").unique(same, keep="last")
    variants = planned.join(numbers, on="identity", how="left", maintain_order="left")
    variants = variants.join(others, on=same, how="left", maintain_order="left")
    is_recomputed = pl.col("stored").is_null() & pl.col("other").is_not_null()
    recomputed = len(variants.filter(is_recomputed))
    if len(stale) and changed is None:
        raise RunDirectoryError(_refusal(directory.location, recomputed, len(stale)))
    reused = recomputed if changed == "keep" else 0
    if reused:
        variants = variants.with_columns(
            identity=pl.when(is_recomputed).then("old").otherwise("identity"),
            stored=pl.col("stored").fill_null(pl.col("other")),
        )
    is_new = pl.col("stored").is_null()
    first = int(stored[VARIANT].max() or 0) + 1
    number = pl.when(is_new).then(first - 1 + is_new.cum_sum()).otherwise("stored")
    new = len(variants.filter(is_new))
    if 0 < new < len(variants):
        on_note(f"{new} variants are new in {directory.location}")
    if len(stale) > reused:
        on_note(f"{len(stale) - reused} results no longer belong to the study: set aside")
    variants = variants.with_columns(number.cast(pl.Int32).alias(VARIANT))
    return variants.drop("stored", "other", "old")


def _refusal(location: str, recomputed: int, stale: int) -> str:
    removed = stale - recomputed
    causes = []
    if recomputed:
        causes.append(f"{recomputed} of the same scenarios, by other code or input files")
    if removed:
        causes.append(f"{removed} of scenarios that the study no longer has")
    keep = ", --changed keep leaves those of other code as they are" if recomputed else ""
    return (
        f"{location} holds results that don't belong to this study as it is now:"
        f" {' and '.join(causes)}. --changed redo runs again what has changed and"
        f" sets the old results aside{keep}; or choose another --out"
    )


def write_plan(directory: StudyDirectory, plan: StudyPlan) -> None:
    """Write the plan of a study: a row per variant with its parameters."""
    design = plan.design
    index = plan.variants["index"].to_numpy()
    combination = index // len(design.seeds)
    columns = []
    for number, axis in enumerate(design.axes):
        choices = design.combinations[:, number]
        used = set(np.unique(choices).tolist())
        for column, own in axis.labels().items():
            labels = [label if place in used else None for place, label in enumerate(own)]
            places = choices[combination] % (len(labels) + 1)  # -1 is the last, None
            columns.append(label_series([*labels, None]).gather(places).alias(column))
    names = (VARIANT, *PLAN_ONLY, "simulated_s")
    frame = plan.variants.select(*names, *columns, SEED)
    parts = (rows.to_arrow() for rows in frame.iter_slices(SLICE_ROWS))
    directory.storage.write_table(PLAN, parts)


def label_series(labels: list[Label]) -> "pl.Series":
    """Return labels as a column: numbers or booleans if all labels are, else text.

    >>> label_series([1, 2.5]).dtype, label_series([1, "a"]).to_list()
    (Float64, ['1', 'a'])
    """
    import polars as pl

    kinds = {type(label) for label in labels if label is not None}
    for kind, dtype in ((int, pl.Int64), (bool, pl.Boolean), (float, pl.Float64)):
        if kinds <= {kind} or (kind is float and kinds <= {int, float}):
            return pl.Series(labels, dtype=dtype)
    return pl.Series([None if label is None else str(label) for label in labels], dtype=pl.String)
