"""The axes of a study: lists, samples, options, homes and people."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field

from fleet2d.bounds import VARIANTS
from fleet2d.configuration.components import Settings
from fleet2d.configuration.documents import Keys
from fleet2d.configuration.problems import did_you_mean, problem, problem_at
from fleet2d.configuration.units import folder_of
from fleet2d.errors import ScenarioError, extra
from fleet2d.kernels import F64

Label = str | int | float | bool | None
"""The name of a choice in tables and messages; None where the axis does not apply."""


@dataclass(frozen=True)
class Choice:
    """One value of an axis.

    Attributes:
        labels: Its label in each column of the axis.
        changes: (key path, value) pairs that it sets in the scenario.
        seed: The seed of its runs; None: the seeds of the replicates.
    """

    labels: Mapping[str, Label]
    changes: tuple[tuple[Keys, Any], ...] = field(default=(), compare=False)
    seed: int | None = None

    @property
    def words(self) -> str:
        """The choice as messages name it.

        >>> Choice({"speed": 0.3, "robot": "slow"}).words
        'speed = 0.3, robot = slow'
        """
        return ", ".join(f"{column} = {label}" for column, label in self.labels.items())


def key_path(text: str) -> Keys:
    """Split 'robots.astro.speed' into its keys.

    Raises:
        ScenarioError: A part is empty.
    """
    keys = tuple(part.strip() for part in text.split("."))
    if not all(keys):
        raise ScenarioError(f"expected a key path like robots.astro.speed, got {text!r}")
    return keys


def label_values(values: Sequence[Any]) -> list[Label]:
    """Return a label for each value: itself, else its `type`, else its number from 1.

    >>> label_values([0.3, "fast"]), label_values([{"type": "patrol"}, {"type": "hangout"}])
    ([0.3, 'fast'], ['patrol', 'hangout'])
    """
    labels = [_own_label(value) for value in values]
    if None not in labels and len({repr(label) for label in labels}) == len(values):
        return labels
    if all(value is None or isinstance(value, str | int | float) for value in values):
        return ["none" if label is None else label for label in labels]
    return [f"{number}" for number in range(1, len(values) + 1)]


def _own_label(value: Any) -> Label:
    name = value.get("type") if isinstance(value, Mapping) else value
    if isinstance(name, str):
        return str(name)
    return value if isinstance(value, bool | int | float) else None


class Axis(Settings):
    """Base class of axes.

    Attributes:
        is_population: Whether its values are a sample of a population (homes, people); the
            intervals of answers hold over populations.
        when: The axis applies only where other axes have these values: {robot: hangout}; a list:
            any of them.
    """

    is_population: ClassVar[bool] = False

    when: dict[str, Any] = Field(default={})

    def columns(self, name: str) -> tuple[str, ...]:
        """Return the columns of its labels."""
        return (name,)

    def populations(self, name: str) -> tuple[str, ...]:
        """Return its columns whose values are a sample of a population."""
        return self.columns(name) if self.is_population else ()

    def choices(self, name: str) -> list[Choice]:
        """Return the label and the scenario changes of each value of the axis, in order.

        Raises:
            InputError: A file or a package is missing.
        """
        raise NotImplementedError


Number = TypeVar("Number", int, float)


def check_count(count: Number) -> Number:
    """Return a number of values, unless it is too large for one axis.

    Raises:
        PydanticCustomError: The number is too large.
    """
    if count > VARIANTS.limit:
        raise problem(
            f"more than {VARIANTS.limit:,} values are too many for one axis; to allow more, set"
            f" {VARIANTS.variable} in the environment"
        )
    return count


Count = Annotated[int, AfterValidator(check_count)]
"""A number of values that fits into one study."""


Method = Literal["latin_hypercube", "sobol"]
DIGITS = 6  # significant digits of a sampled number, so that tables print the very value


class Parameter(Settings):
    """One sampled or searched parameter: a range, or a list to choose from.

    Attributes:
        key: The key path that it sets.
        low: The smallest value.
        high: The largest value.
        log: Whether values are uniform in the logarithm.
        integer: Whether values are whole numbers.
        unit: The unit to write after the number: d, cm, %.
        choices: A list to choose from, instead of a range.
    """

    key: str
    low: float | None = None
    high: float | None = None
    log: bool = False
    integer: bool = False
    unit: str = ""
    choices: tuple[Any, ...] = ()

    def model_post_init(self, _: object, /) -> None:
        """Require a range or choices, not both."""
        if self.choices:
            if self.low is not None or self.high is not None:
                raise problem("give low and high, or choices, not both")
            return
        if self.low is None or self.high is None or not self.low < self.high:
            raise problem("give low and high, low below high; or choices")
        if self.log and self.low <= 0:
            raise problem(f"low is {self.low:g}; with log it must be above 0")

    def at(self, share: float) -> Any:
        """Return the value at a share of the range, from 0 to 1.

        >>> Parameter(key="a.b", low=1, high=100, log=True).at(0.5)
        10.0
        """
        if self.choices:
            return self.choices[min(int(share * len(self.choices)), len(self.choices) - 1)]
        assert self.low is not None
        assert self.high is not None
        if self.integer:
            return min(int(self.low + share * (self.high - self.low + 1)), int(self.high))
        if self.log:
            return rounded(math.exp(math.log(self.low) + share * math.log(self.high / self.low)))
        return rounded(self.low + share * (self.high - self.low))

    def with_unit(self, value: Any) -> Any:
        """Return a value as the scenario file spells it, with its unit.

        >>> Parameter(key="a.b", low=1, high=9, unit="d").with_unit(2.5)
        '2.5 d'
        """
        return f"{value!r} {self.unit}" if self.unit and not self.choices else value


def rounded(value: float) -> float:
    """Return a number rounded to six significant digits.

    >>> rounded(0.123456789)
    0.123457
    """
    return float(f"{value:.{DIGITS}g}")


def shares(method: Method, count: int, dimensions: int, seed: int) -> F64:
    """Return points of the unit cube: float64 (count, dimensions), the same at each call.

    Raises:
        InputError: scipy is missing.
        ScenarioError: The method has no such number of points.
    """
    generator = np.random.Generator(np.random.Philox(seed))
    with extra("study", f"{method} samples need scipy"):
        from scipy.stats import qmc
    if method == "latin_hypercube":
        return qmc.LatinHypercube(dimensions, rng=generator).random(count)
    power = round(math.log2(count))
    if count != 2**power:
        raise ScenarioError(
            f"sobol points are balanced in powers of two only: count {2**power}, not {count}"
        )
    return qmc.Sobol(dimensions, rng=generator).random_base2(power)


def _texts(value: Any) -> tuple[Any, ...]:
    """Return a text or a list of texts as a tuple; each keeps the folder of its file."""
    texts = (value,) if isinstance(value, str | Path) else value
    if not isinstance(texts, list | tuple) or not all(isinstance(t, str | Path) for t in texts):
        raise problem(f"expected a text or a list of texts, got {value!r}")
    return tuple(texts)


Texts = Annotated[Any, BeforeValidator(_texts)]


class FloorplansAxis(Axis):
    """Floor plans: the files of a folder or a pattern, or a list of files.

    Attributes:
        floorplans: A folder, a pattern, or files.
        settings: Further keys of the floor plan, such as furnish.
    """

    is_population = True

    floorplans: Texts
    settings: dict[str, Any] = Field(default={})

    def choices(self, name: str) -> list[Choice]:
        """Return a choice for each floor plan; its label is the name of its file.

        Raises:
            ScenarioError: There is no such file, or one is not a floor plan.
        """
        files = self._files()
        labels = [path.stem for path in files]
        if len(set(labels)) < len(labels):
            labels = [path.name for path in files]
        return [
            Choice({name: label}, ((("floorplan",), self._section(path)),))
            for label, path in zip(labels, files, strict=True)
        ]

    def _files(self) -> list[Path]:
        from fleet2d.floorplan.load import plan_suffixes

        files: list[Path] = []
        suffixes = plan_suffixes()
        for pattern in self.floorplans:
            path = folder_of(pattern) / Path(pattern).expanduser()
            candidates = path.iterdir() if path.is_dir() else path.parent.glob(path.name)
            visible = (p for p in candidates if path.name[:1] == "." or p.name[0] != ".")
            plans = sorted(p for p in visible if p.suffix.lower() in suffixes)
            if not plans:
                raise ScenarioError(
                    f"no floor plan matches {pattern!r} in {folder_of(pattern)}: name a folder, a"
                    f" pattern or a file that ends in {', '.join(suffixes)}"
                )
            files += plans
        return files

    def _section(self, path: Path) -> dict[str, Any]:
        from fleet2d.floorplan.load import format_of_file

        return {"type": format_of_file(path), "path": str(path.absolute()), **self.settings}


class SyntheticAxis(Axis):
    """Synthetic homes by their seeds.

    Attributes:
        synthetic: The number of homes, from seed 0 on; or a list of seeds.
        first: The first seed, if `synthetic` is a number.
        settings: Further keys of the homes, such as area_m2 and furnish.
    """

    is_population = True

    synthetic: Count | tuple[int, ...]
    first: int = Field(default=0, ge=0)
    settings: dict[str, Any] = Field(default={})

    def model_post_init(self, _: object, /) -> None:
        """Refuse an axis without homes."""
        if not len(self.seeds):
            raise problem_at(("synthetic",), "expected 1 home or more, got none")

    @property
    def seeds(self) -> Sequence[int]:
        """The seeds of the homes."""
        if isinstance(self.synthetic, int):
            return range(self.first, self.first + self.synthetic)
        return self.synthetic

    def choices(self, name: str) -> list[Choice]:
        """Return a choice for each home; its label is its seed."""
        return [self.choice(name, seed) for seed in self.seeds]

    def choice(self, name: str, seed: int) -> Choice:
        """Return the choice of a home."""
        section = {"type": "synthetic", "seed": seed, **self.settings}
        return Choice({name: seed}, ((("floorplan",), section),))


class PersonasAxis(Axis):
    """Personas of one user: the bundled ones, or files of your own.

    Attributes:
        personas: `all`, or a list of names and files.
        user: The name of the user who has the persona.
    """

    is_population = True

    personas: Texts
    user: str

    def choices(self, name: str) -> list[Choice]:
        """Return a choice for each persona."""
        from fleet2d.routines.persona import bundled_names

        personas = bundled_names() if self.personas == ("all",) else self.personas
        user = ("users", self.user)
        return [
            Choice(
                {name: Path(persona).stem},
                (((*user, "type"), "routine"), ((*user, "persona"), persona)),
            )
            for persona in personas
        ]


class ValuesAxis(Axis):
    """A list of values of one key, or of several keys that have the same value.

    Attributes:
        key: The key path, or several.
        values: The values.
        labels: The names of the values in tables.
    """

    key: str | tuple[str, ...]
    values: tuple[Any, ...] = Field(min_length=1)
    labels: tuple[str, ...] = ()

    def model_post_init(self, _: object, /) -> None:
        """Require a label of its own for each value, if there are labels."""
        if self.labels and len(self.labels) != len(self.values):
            raise problem(f"there are {len(self.labels)} labels for {len(self.values)} values")
        if len(set(self.labels)) < len(self.labels):
            twice = next(label for label in self.labels if self.labels.count(label) > 1)
            raise problem(f"two values have the label {twice!r}: results couldn't tell them apart")

    def choices(self, name: str) -> list[Choice]:
        """Return a choice for each value."""
        keys = (self.key,) if isinstance(self.key, str) else self.key
        paths = [key_path(key) for key in keys]
        labels = self.labels or label_values(self.values)
        return [
            Choice({name: label}, tuple(product(paths, [value])))
            for label, value in zip(labels, self.values, strict=True)
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
        choices = []
        for label, settings in self.options.items():
            changes = [(key_path(key), value) for key, value in settings.items()]
            choices.append(Choice({name: label}, tuple(changes)))
        return choices


class SampleAxis(Axis):
    """Samples of several parameters at once, evenly spread.

    Attributes:
        sample: The parameters, by column.
        count: The number of samples.
        method: `latin_hypercube`: each parameter is spread evenly; `sobol`: all together.
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
            InputError: scipy is missing, or the method has no such number of samples.
        """
        labels = {
            column: dict(zip(map(repr, p.choices), label_values(p.choices), strict=True))
            for column, p in self.sample.items()
        }
        choices = []
        for row in shares(self.method, self.count, len(self.sample), self.seed).tolist():
            names: dict[str, Label] = {}
            changes = []
            for (column, parameter), share in zip(self.sample.items(), row, strict=True):
                value = parameter.at(share)
                names[column] = labels[column].get(repr(value), value)
                changes.append((key_path(parameter.key), parameter.with_unit(value)))
            choices.append(Choice(names, tuple(changes)))
        return choices


KINDS: dict[str, type[Axis]] = {
    "values": ValuesAxis,
    "options": OptionsAxis,
    "floorplans": FloorplansAxis,
    "synthetic": SyntheticAxis,
    "personas": PersonasAxis,
    "sample": SampleAxis,
}
"""The kinds of axes by the key that only they have."""


def axis_of(value: Any, kinds: Mapping[str, type[Axis]] = KINDS) -> Any:
    """Choose the kind of an axis by the key that only it has."""
    if isinstance(value, Axis):
        return value
    if not isinstance(value, Mapping):
        raise problem(f"expected an axis like {{key: PATH, values: […]}}, got {value!r}")
    own = [kind for kind in kinds if kind in value and not isinstance(value[kind], bool)]
    if len(own) != 1:
        unknown = next((key for key in value if key not in ("key", "when")), "")
        hint = did_you_mean(unknown, kinds) if not own else "."
        keys = " and ".join(own) or ", ".join(map(repr, value)) or "nothing"
        raise problem(f"expected exactly one of {', '.join(kinds)}, got {keys}{hint}")
    return kinds[own[0]].model_validate(value)


AnyAxis = Annotated[Axis, BeforeValidator(lambda value: axis_of(value))]
"""A field that takes an axis of any kind."""
