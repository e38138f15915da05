"""The design of a study: its variants, the scenario of each, and its identity."""

import hashlib
import itertools
import json
import math
import platform
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fleet2d import __version__
from fleet2d.configuration.documents import Document
from fleet2d.configuration.problems import Location, suggest
from fleet2d.errors import InputError, ScenarioError, errors_as, os_errors_as
from fleet2d.kernels import I32
from fleet2d.scenario.compose import apply_changes, assignment, merge
from fleet2d.scenario.load import scenario_of
from fleet2d.scenario.model import Scenario
from fleet2d.studies.axes import Choice, Label, key_path
from fleet2d.studies.executors import Crew
from fleet2d.studies.lazy import LazySequence
from fleet2d.studies.lives import MAX_SEED
from fleet2d.studies.population import (
    FleetLives,
    PopulationAxis,
    find_lives,
    first_life,
)
from fleet2d.studies.simulator import input_files
from fleet2d.studies.specification import NEVER, ROLLOUT, SEED, STAGE, Rollout, Specification

DIGITS = 32  # hexadecimal digits of a hash
# Packages that run, show or evaluate simulations without changing their results: those above the
# engine in the order of imports, but `homes`.
_LEAVES = ("__main__", "cli", "learning", "live", "studies", "testing", "viewing")
_SUFFIXES = (".py", ".so", ".yaml", ".json")
_NO_EFFECT = ("max_span", "speedup")  # keys of `simulation` that change no result


@cache
def code_version() -> str:
    """Return the version of Fleet2D with a hash of the files that can change a run.

    It is constant for a release; in a checkout it changes with every edit of such a file.
    """
    root = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*")):
        name = path.relative_to(root)
        if path.suffix in _SUFFIXES and name.parts[0] not in _LEAVES:
            digest.update(name.as_posix().encode() + b"\0")
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    python = ".".join(platform.python_version_tuple()[:2])
    return f"fleet2d {__version__}, python {python}, files {digest.hexdigest()[:DIGITS]}"


def file_hash(path: Path) -> str:
    """Return the SHA-256 of an input file, which is read again only after it changed.

    Raises:
        InputError: The file can't be read.
    """
    with os_errors_as(InputError, f"{path} can't be read", "; a variant needs it"):
        status = path.stat()
        return _hash_of(path, status.st_mtime_ns, status.st_size)


@cache
def _hash_of(path: Path, *_: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def scenario_content(scenario: Scenario) -> dict[str, Any]:
    """Return the keys of a resolved scenario that have an effect on its results."""
    content = scenario.resolved()
    content.pop("name", None)
    content["simulation"] = {k: v for k, v in content["simulation"].items() if k not in _NO_EFFECT}
    return content


def content_hash(content: Any) -> str:
    """Return a hash of plain data. The order of keys counts, since users decide in that order.

    >>> content_hash({"a": 1, "b": 2}) == content_hash({"b": 2, "a": 1})
    False
    """
    text = json.dumps(content, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


def input_hash(scenario: Scenario) -> str:
    """Return a hash of the files that a scenario names: floor plans, logs, the user's modules.

    Raises:
        InputError: A file can't be read.
    """
    return content_hash({str(path): file_hash(path) for path in input_files(scenario)})


def template_hash(content: dict[str, Any]) -> str:
    """Return the hash of the `scenario_content` of variants that differ by their seed alone."""
    return content_hash({**content, "simulation": {**content["simulation"], SEED: None}})


def identity(template: str, seed: int, inputs: str) -> str:
    """Return the identity of a variant.

    Args:
        template: The `template_hash` of its scenario.
        seed: The seed of its scenario.
        inputs: The `input_hash` of its scenario.
    """
    return content_hash([code_version(), template, seed, inputs])


def home_key(content: Mapping[str, Any]) -> str:
    """Return a hash that is the same for variants that can share a home."""
    return content_hash([content["floorplan"], content["objects"]])[:8]


NOT_APPLICABLE = -1
MAX_VARIANTS = 1_000_000
WITH = "with"
WITHOUT = "without"
"""Labels of runs of a rollout: with the change from its stage on, and without it."""
# The number of combinations of the first life that are checked before any home is built.
TRIED_FIRST = 100
# The distance between the seeds of replicates of a life, so that no two lives share a seed.
SEEDS_APART = 1_048_583
SWITCHES = ("key_frames", "observations", "events", "decisions")
"""Keys of `artifacts` that are named after their tables."""


class AxisPlan(NamedTuple):
    """An axis with its choices.

    Attributes:
        name: Its name.
        columns: The columns that it fills.
        when: The condition on columns of earlier axes under which the axis applies.
        choices: Its choices, in order.
        changes: The scenario change of each choice, with the place that messages name.
    """

    name: str
    columns: tuple[str, ...]
    when: Mapping[str, Any]
    choices: Sequence[Choice]
    changes: Sequence[Document]

    def labels(self) -> dict[str, list[Label]]:
        """Return the label of each choice, by column."""
        labels: dict[str, list[Label]] = {column: [] for column in self.columns}
        for choice in self.choices:
            for column, own in labels.items():
                own.append(choice.labels[column])
        return labels


@dataclass(frozen=True)
class LifeChanges(LazySequence[Document]):
    """The scenario change of each life, made when it is needed.

    Attributes:
        lives: The lives.
        place: The axis and the place of it that messages name.
    """

    lives: FleetLives
    place: str

    def __len__(self) -> int:
        """Return the number of lives."""
        return len(self.lives)

    def item(self, index: int) -> Document:
        """Return the change of a life."""
        return _change_of(self.lives[index], self.place)


class RulePlan(NamedTuple):
    """A change of the scenario for all variants that fulfil a condition on columns."""

    when: Mapping[str, Any]
    change: Document


@dataclass(frozen=True)
class Design:
    """All variants of a study. Scenarios are built on request; a design can be pickled.

    A variant is a combination of choices, and a seed. Seeds change fastest: variants of one home
    with the same seeds stay together, and their users live the same lives.

    Attributes:
        base: The composed base scenario, with the changes that all variants share.
        folder: The folder of the study file.
        axes: The axes.
        rules: Conditional changes.
        exclude: Conditions on columns; combinations that fulfil one are left out.
        seeds: The seeds of each combination.
        rollout: A change that some lives have from a day on.
    """

    base: Document
    folder: Path
    axes: tuple[AxisPlan, ...]
    rules: tuple[RulePlan, ...]
    exclude: tuple[Mapping[str, Any], ...]
    seeds: tuple[int, ...]
    rollout: Rollout | None = None

    @cached_property
    def combinations(self) -> I32:
        """The index of the choice on each axis, -1 where it doesn't apply: (combinations, axes)."""
        rows = self._extend((), {})
        if not self.axes:
            return np.zeros((sum(1 for _ in rows), 0), np.int32)
        return np.fromiter(rows, np.dtype((np.int32, (len(self.axes),))))

    @property
    def notes(self) -> list[str]:
        """Remarks on populations, and how many of their lives are left out, and why."""
        lives = [axis.choices for axis in self.axes if isinstance(axis.choices, FleetLives)]
        return [note for each in lives for note in (*each.draw.notes, each.words) if note]

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of all axes, and the seed."""
        return (*(column for axis in self.axes for column in axis.columns), SEED)

    @property
    def labels(self) -> dict[str, list[Label]]:
        """The labels of each column, in order."""
        labels: dict[str, list[Label]] = {SEED: list(self.seeds)}
        for axis in self.axes:
            for column, own in axis.labels().items():
                labels[column] = list(dict.fromkeys(own))
            if lives := [choice for choice in axis.choices if choice.seed is not None]:
                labels[SEED] = [choice.seed for choice in lives]
        return labels

    def __len__(self) -> int:
        """Return the number of variants."""
        return len(self.combinations) * len(self.seeds)

    def seeds_of(self, index: int) -> tuple[int, ...]:
        """Return the seeds of the combination of a variant."""
        combination, _ = divmod(index, len(self.seeds))
        return self._seeds(self.combinations[combination].tolist())

    def _seeds(self, combination: Sequence[int]) -> tuple[int, ...]:
        """Return the seeds of a combination: those of a life, if there are lives, differ."""
        for axis, choice in zip(self.axes, combination, strict=True):
            own = None if choice == NOT_APPLICABLE else axis.choices[choice].seed
            if own is not None:
                return tuple((own + seed * SEEDS_APART) % MAX_SEED for seed in self.seeds)
        return self.seeds

    def parameters(self, index: int) -> dict[str, Label]:
        """Return the labels of a variant by column."""
        combination, seed = self._at(index)
        return {**self._labels(combination), SEED: seed}

    def scenario(self, index: int) -> Scenario:
        """Build and check the scenario of a variant.

        Raises:
            ScenarioError: The scenario is wrong; the message names the axis and the value.
        """
        combination, seed = self._at(index)
        labels = self.parameters(index)
        changes = [
            axis.changes[choice]
            for axis, choice in zip(self.axes, combination, strict=True)
            if choice != NOT_APPLICABLE
        ]
        changes += [rule.change for rule in self.rules if matches(rule.when, labels)]
        changes.append(assignment(("simulation", "seed"), seed, f"seed {seed}"))
        with errors_as(None, self.describe(index)):
            document = apply_changes(self.base, changes)
            if labels.get(ROLLOUT) == WITH and self.rollout is not None:
                times = [{"at": f"{labels[STAGE]}T00:00", **act} for act in self.rollout.change]
                script = [*(document.data.get("script") or ()), *times]
                document = merge(document, assignment(("script",), script, "rollout.change"))
            return scenario_of(document, self.folder)

    def describe(self, index: int) -> str:
        """Return a variant as messages call it: 'variant 3 (speed = 0.3, seed = 1)'."""
        labels = ", ".join(
            f"{column} = {label}"
            for column, label in self.parameters(index).items()
            if label is not None
        )
        return f"variant {index} ({labels})"

    def _at(self, index: int) -> tuple[list[int], int]:
        number, seed = divmod(index, len(self.seeds))
        combination = self.combinations[number].tolist()
        return combination, self._seeds(combination)[seed]

    def _labels(self, combination: Sequence[int]) -> dict[str, Label]:
        labels: dict[str, Label] = {}
        for axis, choice in zip(self.axes, combination, strict=False):
            if choice == NOT_APPLICABLE:
                labels |= dict.fromkeys(axis.columns)
            else:
                labels |= axis.choices[choice].labels
        return labels

    def _extend(
        self, prefix: tuple[int, ...], labels: Mapping[str, Label]
    ) -> Iterator[tuple[int, ...]]:
        """Yield the combinations that start with a prefix, the last axis changing fastest."""
        if len(prefix) == len(self.axes):
            if labels.get(ROLLOUT) == WITH and labels.get(STAGE) == NEVER:
                return
            if not any(matches(condition, labels) for condition in self.exclude):
                yield prefix
            return
        axis = self.axes[len(prefix)]
        if matches(axis.when, labels):
            for number, choice in enumerate(axis.choices):
                yield from self._extend((*prefix, number), {**labels, **choice.labels})
        else:
            empty = dict.fromkeys(axis.columns)
            yield from self._extend((*prefix, NOT_APPLICABLE), {**labels, **empty})


def matches(condition: Mapping[str, Any], labels: Mapping[str, Label]) -> bool:
    """Return whether labels fulfil a condition: each column has the value, or one of a list.

    >>> matches({"robot": ["patrol", "hangout"]}, {"robot": "hangout", "speed": 0.3})
    True
    """
    return all(_is_among(labels.get(column), _values(condition, column)) for column in condition)


def _is_among(label: Label, values: Iterable[Any]) -> bool:
    return any(same_label(label, value) for value in values)


def _values(condition: Mapping[str, Any], column: str) -> Sequence[Any]:
    """Return the values of a column that a condition allows."""
    value = condition[column]
    return value if isinstance(value, list | tuple) else [value]


def same_label(label: Label, value: Any) -> bool:
    """Return whether a label equals a value of the study file: 1 is 1.0, but true is not 1."""
    return label == value and isinstance(label, bool) == isinstance(value, bool)


def build_design(
    specification: Specification,
    crew: Crew | None = None,
    on_progress: Callable[[int, int], None] = lambda *_: None,
) -> Design:
    """Turn a study into its variants, without building their scenarios.

    Args:
        specification: The study.
        crew: Where the homes of a population are built; None: in this process.
        on_progress: Receives how many of these homes are built, of how many.

    Raises:
        ScenarioError: An axis has no values, a condition names a value that no axis has, or there
            are too many variants.
    """
    file = specification.file
    base = specification.base
    fleet = file.axes.get(file.fleet)
    if isinstance(fleet, PopulationAxis) and fleet.replaces_people:
        base = Document({**base.data, "users": {}}, base.places)
    rules = []
    for i, rule in enumerate(file.rules):
        line = specification.places.place(("rules", i))
        place = ", ".join(filter(None, (f"rules.{i}", line)))
        rules.append(RulePlan(rule.when, _change(rule.set.items(), place)))
    base = merge(base, _artifacts(file.keep.tables))
    seeds = file.replicates or (0 if file.fleet else _base_seed(base),)
    design = Design(base, specification.folder, (), tuple(rules), file.exclude, seeds)
    axes = {name: _axis_plan(specification, name) for name in file.axes}
    if isinstance(fleet, PopulationAxis):
        _check_first_life(replace(design, axes=tuple(axes.values())))
        place = specification.places.named(("axes", file.fleet))
        with errors_as(ScenarioError, place, of=ScenarioError):
            lives = find_lives(fleet, file.fleet, base, crew, on_progress)
        axes[file.fleet] = _with_lives(axes[file.fleet], lives, file.rollout)
    if file.rollout is not None:
        choices = tuple(Choice({ROLLOUT: label}) for label in (WITHOUT, WITH))
        axes[ROLLOUT] = AxisPlan(ROLLOUT, (ROLLOUT,), {}, choices, (Document(), Document()))
    design = replace(design, axes=tuple(axes.values()), rollout=file.rollout)
    _check_size(specification.name, design)
    _check_values(specification, design)
    if not len(design.combinations):
        raise ScenarioError(f"{specification.name} has no variants: all are excluded")
    _check_combinations(specification, design)
    return design


def _check_size(name: str, design: Design) -> None:
    """Refuse a design of too many variants, before they are listed.

    Raises:
        ScenarioError: There are too many.
    """
    sizes = {axis.name: len(axis.choices) for axis in design.axes} | {SEED: len(design.seeds)}
    count = math.prod(sizes.values())
    if design.exclude or any(axis.when for axis in design.axes):  # there may be fewer
        combinations = itertools.islice(design._extend((), {}), MAX_VARIANTS // sizes[SEED] + 1)
        count = min(count, sum(1 for _ in combinations) * sizes[SEED])
    if count > MAX_VARIANTS:
        product = " × ".join(f"{size:,} of {axis}" for axis, size in sizes.items() if size > 1)
        raise ScenarioError(
            f"{name} would have {product} = {math.prod(sizes.values()):,} variants: at most"
            f" {MAX_VARIANTS:,} can be run as one study; sample some of them by an axis of the kind"
            " `sample`"
        )


def _check_first_life(design: Design) -> None:
    """Check what can be checked before the homes of a population are built, which takes long.

    Raises:
        ScenarioError: A scenario of the first life is wrong.
    """
    seeds = len(design.seeds)
    for index in range(0, min(len(design), TRIED_FIRST * seeds), seeds):
        design.scenario(index)


def _with_lives(axis: AxisPlan, lives: FleetLives, rollout: Rollout | None) -> AxisPlan:
    """Return the axis of a population with its lives, and the stage of each in a rollout."""
    changes = axis.changes
    assert isinstance(changes, LifeChanges)
    columns = axis.columns
    if rollout is not None:
        stages = [rollout.stage_of(lives.draw.share_of(int(k))) for k in lives.numbers]
        lives = replace(lives, features={**lives.features, STAGE: np.array(stages)})
        columns = (*columns, STAGE)
    changes = LifeChanges(lives, changes.place)
    return axis._replace(columns=columns, choices=lives, changes=changes)


def _axis_plan(specification: Specification, name: str) -> AxisPlan:
    """Return the plan of an axis; of a population, with the first life only, kept or not."""
    axis = specification.file.axes[name]
    place = specification.places.place(("axes", name))
    words = ", ".join(filter(None, (f"axis {name!r}", place)))
    choices: Sequence[Choice]
    changes: Sequence[Document]
    with errors_as(ScenarioError, specification.places.named(("axes", name))):
        if isinstance(axis, PopulationAxis):
            choices = first_life(axis, name)
            changes = LifeChanges(choices, words)
        else:
            choices = tuple(axis.choices(name))
            changes = tuple(_change_of(choice, words) for choice in choices)
    return AxisPlan(name, axis.columns(name), axis.when, choices, changes)


def _change_of(choice: Choice, place: str) -> Document:
    """Return the change of a choice; messages name it and the place of its axis."""
    axis, _, line = place.partition(", ")
    words = ", ".join(filter(None, (axis, choice.words, line)))
    return _change(((".".join(keys), value) for keys, value in choice.changes), words)


def _change(changes: Any, place: str) -> Document:
    """Merge (key path, value) pairs into one change; messages name the place."""
    result = Document()
    for path, value in changes:
        result = merge(result, assignment(key_path(path), value, place))
    simulation = result.data.get("simulation")
    if isinstance(simulation, Mapping) and SEED in simulation:
        raise ScenarioError(
            f"{place}: sets simulation.seed, which the key `replicates` of the study sets: write"
            f" replicates: [{simulation[SEED]}] there, or a list of seeds"
        )
    return result


def _conditions(
    specification: Specification, design: Design
) -> Iterator[tuple[Location, Mapping[str, Any]]]:
    """Yield all conditions of a study on columns, and where they stand."""
    for axis in design.axes:
        yield ("axes", axis.name, "when"), axis.when
    yield from specification.file.conditions()


def _check_values(specification: Specification, design: Design) -> None:
    """Refuse conditions on values that no axis has: they would silently never hold.

    Raises:
        ScenarioError: There is such a condition.
    """
    for location, condition in _conditions(specification, design):
        for column in condition:
            labels = design.labels[column]
            for value in _values(condition, column):
                if not any(same_label(label, value) for label in labels):
                    message = f"no variant has {value!r}{suggest(value, labels)}"
                    raise specification.error((*location, column), message)


def _check_combinations(specification: Specification, design: Design) -> None:
    """Refuse conditions on values that no variant has at once: they would never hold, either.

    Raises:
        ScenarioError: There is such a condition.
    """
    for location, condition in _conditions(specification, design):
        of_condition = design
        if location[0] == "exclude":  # several of these may exclude the same variants
            of_condition = replace(design, axes=_axes_of(design, condition), exclude=())
        if not _occurs(of_condition, condition):
            words = " and ".join(f"{column} = {value}" for column, value in condition.items())
            message = f"no variant has {words}: change a value, or leave this out"
            raise specification.error(location, message)


def _axes_of(design: Design, condition: Mapping[str, Any]) -> tuple[AxisPlan, ...]:
    """Return the axes of the columns of a condition, and those on which they depend."""
    columns = {*condition}
    kept: list[AxisPlan] = []
    for axis in reversed(design.axes):
        if columns & {*axis.columns}:
            kept.append(axis)
            columns |= {*axis.when}
    return tuple(reversed(kept))


def _occurs(design: Design, condition: Mapping[str, Any]) -> bool:
    """Return whether a combination of a design fulfils a condition, with some seed."""
    occurs = np.ones(len(design.combinations), np.bool_)
    for number, axis in enumerate(design.axes):
        for column in {*axis.columns} & {*condition}:
            values = _values(condition, column)
            fulfils = [_is_among(label, values) for label in axis.labels()[column]]
            occurs &= np.isin(design.combinations[:, number], np.flatnonzero(fulfils))
    return bool(occurs.any())


def _artifacts(tables: Sequence[str]) -> Document:
    """Return the change that turns off the tables that a study doesn't keep."""
    settings: dict[str, Any] = {name: name in tables for name in SWITCHES}
    if "trajectories" not in tables:
        settings["trajectories"] = "off"
    settings |= {"outputs": True, "learned": False}
    return _change(((f"artifacts.{name}", on) for name, on in settings.items()), "keep.tables")


def _base_seed(base: Document) -> int:
    simulation = base.data.get("simulation")
    seed = simulation.get(SEED) if isinstance(simulation, Mapping) else None
    return seed if isinstance(seed, int) else 0
