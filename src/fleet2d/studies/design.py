"""The variants of a study: which there are, and the scenario of each."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fleet2d.document import Document
from fleet2d.errors import InputError, ScenarioError
from fleet2d.problems import did_you_mean
from fleet2d.scenario.compose import assignment, changed, merge
from fleet2d.scenario.model import Scenario, scenario_of
from fleet2d.studies.choice import Choice, Label, key_path
from fleet2d.studies.specification import SEED, Specification

NOT_APPLICABLE = -1
MOST_VARIANTS = 10_000_000
SWITCHES = ("key_frames", "observations", "events")  # of `artifacts`, named after their tables


@dataclass(frozen=True)
class AxisPlan:
    """An axis with its choices.

    Attributes:
        name: Its name.
        columns: The columns that it fills.
        when: Values of other columns with which it applies.
        choices: Its points.
        changes: What each point changes, with the place that messages name.
    """

    name: str
    columns: tuple[str, ...]
    when: Mapping[str, Any]
    choices: tuple[Choice, ...]
    changes: tuple[Document, ...]


@dataclass(frozen=True)
class RulePlan:
    """A conditional change: a condition on columns, and what it changes."""

    when: Mapping[str, Any]
    change: Document


@dataclass(frozen=True)
class Design:
    """All variants of a study, each built when it is asked for; it can be pickled.

    A variant is a combination of choices, and a seed. Seeds change fastest: variants of one home
    with the same seeds stay together, and share the lives of their people.

    Attributes:
        base: The composed base scenario, with what all variants have in common.
        folder: The folder of the study file.
        axes: The axes.
        rules: Conditional changes.
        exclude: Combinations that are left out.
        seeds: The seeds of each combination.
    """

    base: Document
    folder: Path
    axes: tuple[AxisPlan, ...]
    rules: tuple[RulePlan, ...]
    exclude: tuple[Mapping[str, Any], ...]
    seeds: tuple[int, ...]

    @cached_property
    def combinations(self) -> list[tuple[int, ...]]:
        """The index of the choice on each axis, by combination; -1 where an axis doesn't apply."""
        return list(self._combined((), {}))

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of all axes, and the seed."""
        return (*(column for axis in self.axes for column in axis.columns), SEED)

    @property
    def labels(self) -> dict[str, list[Label]]:
        """The labels of each column, in order."""
        found: dict[str, list[Label]] = {}
        for axis in self.axes:
            for column in axis.columns:
                labels = (choice.labels[column] for choice in axis.choices)
                found[column] = list(dict.fromkeys(labels))
        return {**found, SEED: list(self.seeds)}

    def __len__(self) -> int:
        """Return the number of variants."""
        return len(self.combinations) * len(self.seeds)

    def parameters(self, index: int) -> dict[str, Label]:
        """Return the labels of a variant by column."""
        combination, seed = self._at(index)
        return {**self._labels(combination), SEED: seed}

    def scenario(self, index: int) -> Scenario:
        """Build and check the scenario of a variant.

        Raises:
            ScenarioError: What is wrong; the message names the axis and the value.
        """
        combination, seed = self._at(index)
        labels = {**self._labels(combination), SEED: seed}
        changes = [
            axis.changes[choice]
            for axis, choice in zip(self.axes, combination, strict=True)
            if choice != NOT_APPLICABLE
        ]
        changes += [rule.change for rule in self.rules if matches(rule.when, labels)]
        changes.append(assignment(("simulation", "seed"), seed, f"seed {seed}"))
        try:
            return scenario_of(changed(self.base, changes), self.folder)
        except InputError as error:
            raise type(error)(f"{self.describe(index)}: {error}") from None

    def describe(self, index: int) -> str:
        """Return a variant as messages call it: 'variant 3 (speed = 0.3, seed = 1)'."""
        words = ", ".join(
            f"{column} = {label}"
            for column, label in self.parameters(index).items()
            if label is not None
        )
        return f"variant {index} ({words})"

    def _at(self, index: int) -> tuple[tuple[int, ...], int]:
        combination, seed = divmod(index, len(self.seeds))
        return self.combinations[combination], self.seeds[seed]

    def _labels(self, combination: Sequence[int]) -> dict[str, Label]:
        labels: dict[str, Label] = {}
        for axis, choice in zip(self.axes, combination, strict=False):
            if choice == NOT_APPLICABLE:
                labels |= dict.fromkeys(axis.columns)
            else:
                labels |= axis.choices[choice].labels
        return labels

    def _combined(
        self, begun: tuple[int, ...], labels: Mapping[str, Label]
    ) -> Iterator[tuple[int, ...]]:
        """Yield the combinations that begin so, the last axis changing fastest."""
        if len(begun) == len(self.axes):
            if not any(matches(condition, labels) for condition in self.exclude):
                yield begun
            return
        axis = self.axes[len(begun)]
        if matches(axis.when, labels):
            for number, choice in enumerate(axis.choices):
                yield from self._combined((*begun, number), {**labels, **choice.labels})
        else:
            without = {**labels, **dict.fromkeys(axis.columns)}
            yield from self._combined((*begun, NOT_APPLICABLE), without)


def matches(condition: Mapping[str, Any], labels: Mapping[str, Label]) -> bool:
    """Return whether labels fulfil a condition: each column has the value, or one of a list.

    >>> matches({"robot": ["patrol", "hangout"]}, {"robot": "hangout", "speed": 0.3})
    True
    """
    for column, wanted in condition.items():
        values = wanted if isinstance(wanted, list | tuple) else [wanted]
        if not any(same_label(labels.get(column), value) for value in values):
            return False
    return True


def same_label(label: Label, value: Any) -> bool:
    """Return whether a label is the one that is written: 1 is 1.0, but true is not 1."""
    return label == value and isinstance(label, bool) == isinstance(value, bool)


def build_design(specification: Specification) -> Design:
    """Turn a study into its variants; none is built yet.

    Raises:
        ScenarioError: An axis has no values, a condition names a value that there isn't, or there
            are too many variants.
    """
    file = specification.file
    axes = tuple(_axis_plan(specification, name) for name in file.axes)
    rules = tuple(
        RulePlan(rule.when, _change(rule.set.items(), _place(specification, "rules", i)))
        for i, rule in enumerate(file.rules)
    )
    count = 1
    for axis in axes:
        count *= len(axis.choices)
    if count > MOST_VARIANTS:
        raise ScenarioError(
            f"{specification.name} would have {count:,} combinations: at most {MOST_VARIANTS:,}"
            " can be run as one study; sample some of them by an axis of the kind `sample`"
        )
    base = merge(specification.base, _artifacts(file.keep.tables))
    seeds = file.replicates or (_base_seed(specification.base),)
    design = Design(base, specification.folder, axes, rules, file.exclude, seeds)
    _check_conditions(specification, design)
    if not design.combinations:
        raise ScenarioError(f"{specification.name} has no variants: all are excluded")
    return design


def _axis_plan(specification: Specification, name: str) -> AxisPlan:
    axis = specification.file.axes[name]
    place = specification.places.place(("axes", name))
    try:
        choices = tuple(axis.choices(name))
        where = f", {place}" if place else ""
        changes = tuple(
            _change(
                ((".".join(keys), value) for keys, value in choice.changes),
                f"axis {name!r}, {choice.words}{where}",
            )
            for choice in choices
        )
    except InputError as error:
        raise ScenarioError(f"{place}{': ' * bool(place)}axes.{name}: {error}") from None
    return AxisPlan(name, axis.columns(name), axis.when, choices, changes)


def _change(changes: Any, place: str) -> Document:
    """Return changes by key path as one."""
    result = Document()
    for path, value in changes:
        result = merge(result, assignment(key_path(path), value, place))
    return result


def _place(specification: Specification, *location: str | int) -> str:
    place = specification.places.place(location)
    words = ".".join(map(str, location))
    return f"{words}, {place}" if place else words


def _check_conditions(specification: Specification, design: Design) -> None:
    """Refuse conditions on values that no axis has: they would silently never hold."""
    file = specification.file
    conditions: list[tuple[tuple[str | int, ...], Mapping[str, Any]]] = [
        *(((("axes", axis.name, "when")), axis.when) for axis in design.axes),
        *((("rules", i, "when"), rule.when) for i, rule in enumerate(file.rules)),
        *((("exclude", i), condition) for i, condition in enumerate(file.exclude)),
        *((("compare", i, "against"), one.against) for i, one in enumerate(file.compare)),
    ]
    if file.tune is not None:
        conditions.append((("tune", "held_out"), file.tune.held_out))
    for location, condition in conditions:
        for column, wanted in condition.items():
            values = wanted if isinstance(wanted, list | tuple) else [wanted]
            labels = design.labels[column]
            for value in values:
                if not any(same_label(label, value) for label in labels):
                    place = specification.places.place((*location, column))
                    raise ScenarioError(
                        f"{place}{': ' * bool(place)}{'.'.join(map(str, location))}.{column}: no"
                        f" variant has {value!r}{did_you_mean(value, labels)} There are:"
                        f" {', '.join(map(str, labels))}"
                    )


def _artifacts(tables: Sequence[str]) -> Document:
    """Return the change that has runs make no tables that are not kept."""
    settings: dict[str, Any] = {name: name in tables for name in SWITCHES}
    if "trajectories" not in tables:
        settings["trajectories"] = "off"
    change = Document()
    for name, value in {**settings, "outputs": True, "learned": False}.items():
        change = merge(change, assignment(("artifacts", name), value, "keep.tables"))
    return change


def _base_seed(base: Document) -> int:
    simulation = base.data.get("simulation")
    seed = simulation.get(SEED) if isinstance(simulation, Mapping) else None
    return seed if isinstance(seed, int) else 0
