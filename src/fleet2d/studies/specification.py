"""The study file: its sections as typed settings, and how it is read."""

import datetime as dt
import os.path
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, ValidationError, model_validator

from fleet2d.bounds import one_line
from fleet2d.configuration.components import Settings
from fleet2d.configuration.documents import Document, read_document
from fleet2d.configuration.problems import Location, problem, problem_at, suggest
from fleet2d.configuration.units import Share, folder_of
from fleet2d.errors import ScenarioError, errors_as
from fleet2d.scenario.compose import compose
from fleet2d.scenario.load import explain
from fleet2d.scenario.model import Scenario
from fleet2d.studies.axes import Parameter, check_count
from fleet2d.studies.population import PopulationAxis, StudyAxis
from fleet2d.studies.results import RESULT_COLUMNS


def _with_type(value: Any) -> Any:
    """Expand `TPESampler` to `{type: TPESampler}`."""
    if isinstance(value, str):
        return {"type": value}
    if isinstance(value, Mapping) and value and not isinstance(value.get("type"), str):
        raise problem("name the type of the sampler, as in {type: CmaEsSampler}")
    return value


class TuneSettings(Settings):
    """The searched parameters, the objective, and the homes on which the results are judged.

    Attributes:
        search: The parameters, by name.
        objective: A metric such as ltp_error.ana.tv, with the better direction.
        trials: The number of settings to try.
        held_out: {axis: [values]}: unknown to the search, used only by the report.
        seed: The seed of the search.
        batch: The number of settings that are suggested together, before any of them is judged.
        sampler: A class of optuna.samplers or mine:Sampler, by its name, or {type: NAME, …} with
            its arguments; left out: TPESampler.
    """

    search: dict[str, Parameter] = Field(min_length=1)
    objective: dict[str, Literal["minimize", "maximize"]] = Field(min_length=1, max_length=1)
    trials: int = Field(default=40, ge=1)
    held_out: dict[str, tuple[Any, ...]] = Field(min_length=1, max_length=1)
    seed: int = Field(default=0, ge=0)
    batch: int = Field(default=4, ge=1)
    sampler: Annotated[dict[str, Any], BeforeValidator(_with_type)] = Field(default={})

    @property
    def metric(self) -> str:
        """The name of the objective."""
        (metric,) = self.objective
        return metric


SEED = "seed"
RESERVED = (*RESULT_COLUMNS, "step", "time", "scenario", "template", "home_key", "simulated_s")
"""Columns of the results; no axis may have such a name."""


class ConditionalChange(Settings):
    """A change for all variants that fulfil a condition.

    Attributes:
        when: Values of axes; a list: any of them.
        set: {key path: value, …}.
    """

    when: dict[str, Any] = Field(default={})
    set: dict[str, Any] = Field(min_length=1)


class Keep(Settings):
    """What a study keeps of each run.

    Attributes:
        metrics: Names or patterns of numbers, such as ltp_error.*.tv.
        tables: Tables of a run, by name.
    """

    metrics: tuple[str, ...] = ("*",)
    tables: tuple[str, ...] = ()


class PairedComparison(Settings):
    """A paired comparison that the report shows.

    Attributes:
        metric: A number, such as ltp_error.ana.tv.
        against: The axis and its reference value.
        by: The columns whose values are the units of intervals; left out: homes, people, seeds.
        within: Axes with a separate comparison for each of their values.
    """

    metric: str
    against: dict[str, Any] = Field(min_length=1, max_length=1)
    by: tuple[str, ...] | None = None
    within: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _compares_an_axis_once(self) -> Self:
        (axis,) = self.against
        for key in ("by", "within"):
            if axis in (getattr(self, key) or ()):
                raise problem(f"{axis} is what is compared: leave it out of {key}")
        return self


ROLLOUT = "rollout"
STAGE = "stage"
NEVER = "never"


class Bounds(Settings):
    """The differences that a metric of robots with a change may have to that of others.

    Attributes:
        least: The least difference.
        most: The largest difference.
    """

    least: float | None = None
    most: float | None = None


def _share(value: Any) -> Any:
    return 1.0 if value == "all" else value


def _several(value: Any) -> Any:
    return [value] if isinstance(value, Mapping) else value


class Rollout(Settings):
    """A change that reaches a fleet in stages.

    Attributes:
        change: The interventions that make it, as in a script, without a time.
        stages: The share of robots that have it from each date on; `all`: all of them.
        watch: The metrics that it is made for.
        guards: Metrics that stop it, with how much they may differ.
    """

    change: Annotated[tuple[dict[str, Any], ...], BeforeValidator(_several), Field(min_length=1)]
    stages: dict[dt.date, Annotated[Share, BeforeValidator(_share)]] = Field(min_length=1)
    watch: tuple[str, ...] = ()
    guards: dict[str, Bounds] = Field(default={})

    def model_post_init(self, _: object, /) -> None:
        """Require growing stages, bounds, and metrics to watch."""
        ordered = [self.stages[day] for day in sorted(self.stages)]
        if ordered != sorted(set(ordered)) or not ordered[0] > 0:
            raise problem("each stage must reach more robots than the one before")
        for metric, bounds in self.guards.items():
            if bounds.least is None and bounds.most is None:
                raise problem_at(("guards", metric), "give least or most, or both")
        if not self.metrics:
            raise problem("give metrics to watch, or guards")

    @property
    def metrics(self) -> tuple[str, ...]:
        """All metrics, watched or guarded."""
        return tuple(dict.fromkeys((*self.watch, *self.guards)))

    def stage_of(self, share: float) -> str:
        """Return the date from which a robot has the change, by its random share; or `never`.

        >>> from datetime import date
        >>> change = {"dismiss": "astro"}
        >>> stages = {date(2026, 1, 5): 0.01, date(2026, 1, 9): 0.1}
        >>> rollout = Rollout(change=change, stages=stages, watch=("sightings.ana",))
        >>> rollout.stage_of(0.05), rollout.stage_of(0.5)
        ('2026-01-09', 'never')
        """
        days = (day for day in sorted(self.stages) if share < self.stages[day])
        return str(next(days, NEVER))


def _numbers_or_count(value: Any) -> Any:
    if isinstance(value, int) and not isinstance(value, bool):
        if value < 1:
            raise problem(f"expected 1 or more replicates, got {one_line(value)}")
        return tuple(range(check_count(value)))
    return value


class StudyFile(Settings):
    """A study: a base scenario, axes along which it varies, what to keep and to compare.

    Attributes:
        name: The name of the study in reports.
        description: The question it answers, for the report.
        tags: Words to find the study by.
        notes: Remarks for the report.
        base: The scenario: a file, bundled:NAME, or a mapping; left out: bundled:family.
        axes: The axes along which scenarios vary, by name.
        replicates: The number of seeds, from 0 on, or a list; left out: the seed of the base.
        rules: Changes for some of the variants.
        exclude: Combinations to leave out: {axis: value, …}.
        keep: The metrics and tables to keep of each run.
        compare: The comparisons that the report shows.
        tune: The search of `fleet2d study tune`.
        rollout: A change that reaches the lives of a population in stages.
    """

    name: str | None = None
    description: str = ""
    tags: tuple[str, ...] = ()
    notes: str = ""
    base: Any = None
    axes: dict[str, StudyAxis] = Field(default={})
    replicates: Annotated[
        tuple[Annotated[int, Field(ge=0, lt=2**63)], ...], BeforeValidator(_numbers_or_count)
    ] = ()
    rules: tuple[ConditionalChange, ...] = ()
    exclude: tuple[dict[str, Any], ...] = ()
    keep: Keep = Keep()
    compare: tuple[PairedComparison, ...] = ()
    tune: TuneSettings | None = None
    rollout: Rollout | None = None

    @model_validator(mode="before")
    @classmethod
    def _short_axes(cls, data: Any) -> Any:
        """Expand `robots.astro.speed: [0.3, 0.6]` to an axis with that key."""
        axes = data.get("axes") if isinstance(data, Mapping) else None
        if not isinstance(axes, Mapping):
            return data
        return {**data, "axes": {name: _long_form(name, axis) for name, axis in axes.items()}}

    @model_validator(mode="after")
    def _has_one_population(self) -> Self:
        names = [name for name, axis in self.axes.items() if isinstance(axis, PopulationAxis)]
        if len(names) > 1:
            raise problem_at(("axes", names[1]), f"there is a population already: {names[0]}")
        if self.rollout is not None and not names:
            raise problem_at((ROLLOUT,), "it needs a fleet: an axis with the key `population`")
        return self

    @model_validator(mode="after")
    def _columns_differ(self) -> Self:
        own = (ROLLOUT, STAGE) if self.rollout is not None else ()
        owners = dict.fromkeys((SEED, *RESERVED, *own), "")
        for name, axis in self.axes.items():
            for column in axis.columns(name):
                if owner := owners.get(column):
                    message = f"the axis {owner!r} has a column {column!r}, too"
                    raise problem_at(("axes", name), message)
                if column in owners:
                    raise problem_at(
                        ("axes", name),
                        f"an axis can't be called {column!r}, because results have a column of that"
                        " name",
                    )
                owners[column] = name
        return self

    @model_validator(mode="after")
    def _conditions_name_columns(self) -> Self:
        known: list[str] = []
        for name, axis in self.axes.items():
            _check_columns(axis.when, known, ("axes", name, "when"), "axes before it")
            known += axis.columns(name)
        if self.rollout is not None:
            known += [ROLLOUT, STAGE]
        for location, condition in self.conditions():
            _check_columns(condition, [*known, SEED], location, "axes")
        for i, comparison in enumerate(self.compare):
            for key in ("by", "within"):
                columns = getattr(comparison, key) or ()
                _check_columns(columns, [*known, SEED], ("compare", i, key), "axes")
        return self

    def conditions(self) -> Iterator[tuple[Location, Mapping[str, Any]]]:
        """Yield the conditions on columns except those of axes, each with its location."""
        yield from ((("rules", i, "when"), rule.when) for i, rule in enumerate(self.rules))
        yield from ((("exclude", i), condition) for i, condition in enumerate(self.exclude))
        yield from ((("compare", i, "against"), c.against) for i, c in enumerate(self.compare))
        if self.tune is not None:
            yield ("tune", "held_out"), self.tune.held_out

    def named_metrics(self) -> Iterator[tuple[Location, str]]:
        """Yield the metrics and patterns that the file names, each with its location."""
        yield from ((("compare", i, "metric"), each.metric) for i, each in enumerate(self.compare))
        yield from ((("keep", "metrics", i), each) for i, each in enumerate(self.keep.metrics))
        if self.tune is not None:
            yield ("tune", "objective", self.tune.metric), self.tune.metric
        if self.rollout is not None:
            yield from (((ROLLOUT, "watch", i), m) for i, m in enumerate(self.rollout.watch))
            yield from (((ROLLOUT, "guards", metric), metric) for metric in self.rollout.guards)

    @property
    def populations(self) -> tuple[str, ...]:
        """The columns whose values are a sample of a population, the seed last."""
        columns = [c for name, axis in self.axes.items() for c in axis.populations(name)]
        if not self.fleet:
            columns.append(SEED)
        return tuple(columns)

    @property
    def fleet(self) -> str:
        """The name of the axis that is a population; empty without one."""
        axes = self.axes.items()
        return next((name for name, axis in axes if isinstance(axis, PopulationAxis)), "")


def _long_form(name: str, axis: Any) -> Any:
    if isinstance(axis, list | tuple):
        if "." not in name:
            raise problem_at(
                ("axes", name),
                f"a bare list is for an axis that is called by its key path, like"
                f" robots.astro.speed: […]; else write {name}: {{key: PATH, values: […]}}",
            )
        return {"key": name, "values": list(axis)}
    needs_key = isinstance(axis, Mapping) and "key" not in axis and "." in name
    if needs_key and axis.keys() & {"values", "range"}:
        return {"key": name, **axis}
    return axis


def _check_columns(
    columns: Mapping[str, Any] | tuple[str, ...], known: list[str], location: Location, noun: str
) -> None:
    for column in columns:
        if column not in known:
            raise problem_at(
                (*location, column) if isinstance(columns, Mapping) else location,
                f"there is no axis {column!r}{suggest(column, known, f'The {noun}')}",
            )


@dataclass(frozen=True)
class Specification:
    """The content of a study file.

    Attributes:
        file: The sections, validated.
        places: File and line of each key.
        base: The composed base scenario.
        folder: The folder of the file, for relative paths.
        source: The file; None for a mapping.
    """

    file: StudyFile
    places: Document
    base: Document
    folder: Path
    source: Path | None = None

    @property
    def name(self) -> str:
        """The name of the study: as the file says, else the name of the file."""
        return self.file.name or (self.source.stem if self.source else "study")

    def error(self, location: Location, message: str) -> ScenarioError:
        """Return the error about a key, with its file and line."""
        texts = (self.places.place(location), ".".join(map(str, location)), message)
        return ScenarioError(": ".join(filter(None, texts)))


def read_specification(source: str | Path | Mapping[str, Any] | Specification) -> Specification:
    """Read and check a study, without building its variants.

    Args:
        source: A YAML file, or the same as a mapping.

    Raises:
        ScenarioError: The study is wrong; the message says where and what to write.
    """
    if isinstance(source, Specification):
        return source
    path: Path | None = None
    if isinstance(source, Mapping):
        document = Document(dict(source))
        folder = Path.cwd()
    else:
        path = Path(source)
        document = read_document(path)
        folder = path.absolute().parent
    try:
        file = StudyFile.model_validate(document.data)
    except ValidationError as error:
        raise explain(error, document) from None
    base = _base(file.base, document)
    return Specification(file, document, base, folder, path)


def _base(base: Any, document: Document) -> Document:
    """Compose the base scenario; messages name the lines of the study file."""
    with errors_as(ScenarioError, document.named(("base",)), of=ScenarioError):
        if isinstance(base, Scenario):
            return compose(base.resolved())
        if isinstance(base, Mapping):
            return _inline_base(base, document)
        if base is None or (isinstance(base, str) and base.startswith("bundled:")):
            return compose(base)
        if not isinstance(base, str | Path):
            raise ScenarioError(f"expected the file of a scenario or a mapping, got {base!r}")
        return compose(os.path.relpath(folder_of(base) / Path(base).expanduser()))


def _inline_base(base: Mapping[str, Any], document: Document) -> Document:
    """Compose a base that the study file itself holds, with the lines of its keys."""
    extends = base.get("extends") or []
    parents = extends if isinstance(extends, list) else [extends]
    paths = [
        str(p) if str(p).startswith("bundled:") else str(folder_of(p) / Path(str(p)).expanduser())
        for p in parents
    ]
    composed = compose({**base, "extends": paths})
    composed.places.update(
        (keys[1:], place)
        for keys, place in document.places.items()
        if keys[:1] == ("base",) and keys[1:2] != ("extends",)
    )
    return composed
