"""The space of a search for failures: homes, households, timings, and any key of a scenario."""

import random
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import TypeAdapter, ValidationError

from fleet2d.bounds import one_line
from fleet2d.configuration.documents import Document, Keys, parse_yaml, read_document
from fleet2d.configuration.problems import did_you_mean, refusal
from fleet2d.errors import Fleet2DError, InputError
from fleet2d.scenario.compose import apply_changes, assignment
from fleet2d.scenario.model import Scenario, scenario_of
from fleet2d.studies.axes import AnyAxis, Choice, Parameter, key_path
from fleet2d.studies.tuning import suggested

if TYPE_CHECKING:
    import optuna

Settings = Mapping[str, Any]
"""A point of the space: for each dimension a number, or the index of a choice."""

_AXIS: TypeAdapter[Any] = TypeAdapter(AnyAxis)


@dataclass(frozen=True)
class SearchSpace:
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

    def scenario(self, base: Document, folder: Path, point: Settings, seed: int) -> Scenario:
        """Return the scenario of a point.

        Raises:
            InputError: It is not a valid scenario, or its home can't be built.
        """
        changes = [(("simulation", "seed"), seed), *self.changes(point)]
        source = self.text(point)
        assignments = [assignment(keys, value, source) for keys, value in changes]
        return scenario_of(apply_changes(base, assignments), folder)

    def check(self, base: Document, folder: Path) -> None:
        """Build a scenario for each end of each range, and for each choice.

        Raises:
            InputError: A key or a value is wrong.
        """
        for name, parameter in self.ranges.items():
            for value in parameter.choices or (parameter.at(0.0), parameter.at(1.0)):
                self._check(base, folder, name, value)
        for name, choices in self.choices.items():
            for number in range(len(choices)):
                self._check(base, folder, name, number)

    def _check(self, base: Document, folder: Path, name: str, value: Any) -> None:
        try:
            self.scenario(base, folder, {name: value}, 0)
        except Fleet2DError as error:
            raise type(error)(f"over {name}: {error}") from None


def read_space(content: Mapping[str, Any]) -> SearchSpace:
    """Return the space that a mapping of axes by name describes.

    An axis is a range, ``{key: robots.astro.speed, low: 0.3, high: 0.8}``, with `unit`, `log` and
    `integer` as in the `tune` section of a study; or one of a study's axes. By default its name is
    its key.

    Raises:
        InputError: An axis is wrong.
    """
    ranges, choices = dict[str, Parameter](), dict[str, tuple[Choice, ...]]()
    if not content:
        raise InputError("nothing to search over: name an axis, such as home={synthetic: 20}")
    for name, axis in content.items():
        try:
            if isinstance(axis, list):
                axis = {"key": name, "values": axis}
            if isinstance(axis, Mapping) and {"low", "high"} & axis.keys():
                ranges[name] = Parameter.model_validate({"key": name, **axis})
                continue
            if isinstance(axis, Mapping) and {"values", "range"} & axis.keys():
                axis = {"key": name, **axis}
            choices[name] = tuple(_AXIS.validate_python(axis).choices(name))
        except ValidationError as error:
            raise refusal(f"over {name}", error) from None
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
