"""The kinds of axes of a study. Each turns its keys into choices."""

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

from fleet2d.errors import ScenarioError
from fleet2d.problems import did_you_mean, problem
from fleet2d.studies.axes.axis import Axis
from fleet2d.studies.axes.choice import Choice, Label, key_path, label_values
from fleet2d.studies.axes.count import Count, check_count
from fleet2d.studies.axes.populations import FloorplansAxis, PersonasAxis, SyntheticAxis
from fleet2d.studies.axes.sampling import Method, Parameter, draw, rounded


class ValuesAxis(Axis):
    """A list of values of one key, or of several keys that have the same value.

    Attributes:
        key: The key path, or several.
        values: The values.
        labels: What the values are called.
    """

    key: str | tuple[str, ...]
    values: tuple[Any, ...] = Field(min_length=1)
    labels: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _as_many_labels(self) -> Self:
        if self.labels and len(self.labels) != len(self.values):
            raise problem(f"there are {len(self.labels)} labels for {len(self.values)} values")
        return self

    def choices(self, name: str) -> list[Choice]:
        """Return a choice for each value."""
        keys = (self.key,) if isinstance(self.key, str) else self.key
        paths = [key_path(key) for key in keys]
        labels = self.labels or label_values(self.values)
        return [
            Choice({name: label}, tuple((path, value) for path in paths))
            for label, value in zip(labels, self.values, strict=True)
        ]


class RangeAxis(Axis):
    """Evenly spaced numbers of a range, by their step or their count.

    Attributes:
        key: The key path.
        range: First and last number.
        step: Difference between consecutive numbers.
        count: The number of values, instead of a step.
        log: With `count`: whether consecutive numbers differ by a constant factor.
        unit: The unit to write after the number: d, cm, %.
    """

    key: str
    range: tuple[float, float]
    step: float | None = Field(default=None, gt=0)
    count: Count | None = Field(default=None, ge=2)
    log: bool = False
    unit: str = ""

    @model_validator(mode="after")
    def _step_or_count(self) -> Self:
        first, last = self.range
        if (self.step is None) == (self.count is None):
            raise problem("give step, or count")
        if not first < last:
            raise problem(f"the first number, {first:g}, must be below the last, {last:g}")
        if self.step is not None:
            check_count((last - first) / self.step)
        if self.log and (first <= 0 or self.count is None):
            raise problem("log needs a count, and numbers above 0")
        return self

    def numbers(self) -> list[float]:
        """Return the numbers, rounded so that 0.1 + 0.2 is 0.3.

        >>> RangeAxis(key="a.b", range=(0.1, 0.5), step=0.2).numbers()
        [0.1, 0.3, 0.5]
        """
        first, last = self.range
        if self.step is not None:
            steps = math.floor((last - first) / self.step + 1e-9)
            return [rounded(first + i * self.step, 12) for i in range(steps + 1)]
        assert self.count is not None
        shares = [i / (self.count - 1) for i in range(self.count)]
        if self.log:
            return [rounded(first * (last / first) ** share) for share in shares]
        return [rounded(first + share * (last - first), 12) for share in shares]

    def choices(self, name: str) -> list[Choice]:
        """Return a choice for each number; whole numbers stay whole."""
        numbers = self.numbers()
        are_whole = all(number.is_integer() for number in numbers)
        values: list[Any] = [int(number) if are_whole else number for number in numbers]
        path = key_path(self.key)
        return [
            Choice({name: value}, ((path, f"{value!r} {self.unit}" if self.unit else value),))
            for value in values
        ]


class OptionsAxis(Axis):
    """Named options, each a set of changes.

    Attributes:
        options: The options by name, each {key path: value, …}.
        population: Whether the options are a sample of a population, as homes and people are.
    """

    options: dict[str, dict[str, Any]] = Field(min_length=1)
    population: bool = False

    def populations(self, name: str) -> tuple[str, ...]:
        """Return its column if its options are a sample of a population."""
        return (name,) if self.population else ()

    def choices(self, name: str) -> list[Choice]:
        """Return a choice for each option."""
        return [
            Choice({name: label}, tuple((key_path(k), v) for k, v in changes.items()))
            for label, changes in self.options.items()
        ]


class SampleAxis(Axis):
    """Random or Latin-hypercube samples of several parameters at once.

    Attributes:
        sample: The parameters, by column.
        count: The number of samples.
        method: The sampling method, `latin_hypercube` or `random`.
        seed: The seed of the samples.
    """

    sample: dict[str, Parameter] = Field(min_length=1)
    count: Count = Field(ge=1)
    method: Method = "latin_hypercube"
    seed: int = Field(default=0, ge=0)

    def columns(self, name: str) -> tuple[str, ...]:
        """Return a column for each parameter."""
        return tuple(self.sample)

    def choices(self, name: str) -> list[Choice]:
        """Return a choice for each sample.

        Raises:
            InputError: scipy is missing, which Latin hypercubes need.
        """
        choices = []
        labels = {
            column: dict(zip(map(repr, p.choices), label_values(p.choices), strict=True))
            for column, p in self.sample.items()
        }
        for values in draw(self.sample, self.method, self.count, self.seed):
            names: dict[str, Label] = {
                column: labels[column].get(repr(value), value) for column, value in values.items()
            }
            changes = tuple(
                (key_path(self.sample[column].key), self.sample[column].with_unit(value))
                for column, value in values.items()
            )
            choices.append(Choice(names, changes))
        return choices


class _GroupAxis(Axis):
    """Base class of axes that consist of other axes."""

    def axes(self) -> "dict[str, Axis]":
        """Return the axes of the group."""
        raise NotImplementedError

    def columns(self, name: str) -> tuple[str, ...]:
        """Return the columns of all of its axes."""
        return tuple(c for axis_name, axis in self.axes().items() for c in axis.columns(axis_name))

    def populations(self, name: str) -> tuple[str, ...]:
        """Return the columns of its axes whose values are a sample of a population."""
        return tuple(
            c for axis_name, axis in self.axes().items() for c in axis.populations(axis_name)
        )

    def _join(self, rows: Iterator[tuple[Choice, ...]]) -> list[Choice]:
        """Return a choice for each row: the labels and changes of all its parts."""
        return [
            Choice(
                {column: label for part in row for column, label in part.labels.items()},
                tuple(change for part in row for change in part.changes),
            )
            for row in rows
        ]


class ZipAxis(_GroupAxis):
    """Axes of equal length in step: the first choices together, the second ones, and so on.

    Attributes:
        zip: The axes, by name.
    """

    zip: "dict[str, AnyAxis]" = Field(min_length=1)

    def axes(self) -> dict[str, Axis]:
        """Return the axes of the group."""
        return self.zip

    def choices(self, name: str) -> list[Choice]:
        """Return a choice for each position of the axes.

        Raises:
            ScenarioError: The axes differ in length.
        """
        lists = {axis_name: axis.choices(axis_name) for axis_name, axis in self.zip.items()}
        if len({len(choices) for choices in lists.values()}) > 1:
            lengths = ", ".join(
                f"{axis_name} has {len(choices)}" for axis_name, choices in lists.items()
            )
            raise ScenarioError(f"the axes of a zip must have equally many values: {lengths}")
        return self._join(zip(*lists.values(), strict=True))


class GridAxis(_GroupAxis):
    """All combinations of the values of axes, as of the axes of a study itself.

    Attributes:
        grid: The axes, by name.
    """

    grid: "dict[str, AnyAxis]" = Field(min_length=1)

    def axes(self) -> dict[str, Axis]:
        """Return the axes of the group."""
        return self.grid

    def choices(self, name: str) -> list[Choice]:
        """Return a choice for each combination; the last axis changes fastest."""
        lists = (axis.choices(axis_name) for axis_name, axis in self.grid.items())
        return self._join(itertools.product(*lists))


KINDS: dict[str, type[Axis]] = {
    "values": ValuesAxis,
    "range": RangeAxis,
    "options": OptionsAxis,
    "floorplans": FloorplansAxis,
    "synthetic": SyntheticAxis,
    "personas": PersonasAxis,
    "sample": SampleAxis,
    "zip": ZipAxis,
    "grid": GridAxis,
}
"""The kinds of axes by the key that only they have."""


def _axis_of(value: Any) -> Any:
    """Choose the kind of an axis by the key that only it has."""
    if isinstance(value, Axis):
        return value
    if not isinstance(value, Mapping):
        raise problem(f"expected an axis like {{key: PATH, values: […]}}, got {value!r}")
    kinds = [kind for kind in KINDS if kind in value]
    if len(kinds) != 1:
        unknown = next((key for key in value if key not in ("key", "when")), "")
        hint = did_you_mean(unknown, KINDS) if not kinds else "."
        keys = " and ".join(kinds) or ", ".join(map(repr, value)) or "nothing"
        raise problem(f"expected exactly one of {', '.join(KINDS)}, got {keys}{hint}")
    return KINDS[kinds[0]].model_validate(value)


AnyAxis = Annotated[Axis, BeforeValidator(_axis_of)]
"""A field that takes an axis of any kind."""

ZipAxis.model_rebuild()
GridAxis.model_rebuild()
