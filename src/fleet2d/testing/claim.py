"""What a test of trials claims: in which scenarios, over how many seeds, and how often it holds."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from fleet2d.errors import InputError
from fleet2d.scenario.model import Scenario, load_scenario
from fleet2d.testing.rate import RateTest, rate_test

Test = TypeVar("Test", bound=Callable[..., Any])
ATTRIBUTE = "fleet2d_claim"
"""The attribute of a test function that holds its claim."""
HOME, HOUSEHOLD = "home", "household"


class SetUpError(InputError):
    """The scenario of a trial is wrong: the test has not begun."""


@dataclass(frozen=True)
class Variant:
    """One scenario of a claim, and what it is called along the claim's axes."""

    scenario: Scenario
    labels: Mapping[str, Any] = field(default_factory=dict)

    def with_seed(self, seed: int) -> "Variant":
        """Return the same with a seed."""
        simulation = self.scenario.simulation.model_copy(update={"seed": seed})
        scenario = self.scenario.model_copy(update={"simulation": simulation})
        return Variant(scenario, {**self.labels, "seed": seed})

    @property
    def seed(self) -> int:
        """The seed; 0 where the scenario has none."""
        return self.scenario.simulation.seed or 0

    @property
    def words(self) -> str:
        """Return it as messages call it.

        >>> Variant(load_scenario(), {"home": "flat"}).with_seed(3).words
        'home flat, seed 3'
        """
        return ", ".join(f"{n} {v}" for n, v in self.labels.items() if v is not None)


@dataclass(frozen=True)
class Claim:
    """A claim about a share of lives.

    Attributes:
        source: The scenario, as `fleet2d.load_scenario` takes it.
        overrides: Texts like 'simulation.duration=4 h'.
        settings: Keys of `simulation` or of the scenario.
        axes: Along which the scenario varies, as in a study file.
        households: The users by name of household, in place of the scenario's own.
        seeds: The seeds; empty for the scenario's own.
        holds: The claimed rate.
        error: How often it is judged wrongly, at most.
        only: A seed whose lives alone are run; None: all.
    """

    source: Any
    overrides: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    axes: Mapping[str, Any] = field(default_factory=dict)
    households: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    seeds: tuple[int, ...] = ()
    holds: float = 1.0
    error: float = 0.05
    only: int | None = None

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario, before the axes change it."""
        return load_scenario(self.source, *self.overrides, **self.settings)

    @cached_property
    def rate(self) -> RateTest:
        """The test of the claimed rate."""
        if self.only is not None:
            return rate_test(len(list(self.lives())))
        return rate_test(self.lives_at_most, self.holds, self.error)

    def of_scenario(self, source: str | Path) -> "Claim":
        """Return the same claim about one scenario alone, with its own seed."""
        return Claim(source, holds=1.0, error=self.error)

    def prepare(self) -> None:
        """Build the scenarios, and the test of the rate.

        Raises:
            SetUpError: One of them is wrong.
        """
        try:
            _ = self.variants, self.rate
        except InputError as error:
            raise SetUpError(str(error)) from error

    @property
    def varies(self) -> bool:
        """Whether lives differ by more than their seeds."""
        return bool(self.axes or self.households)

    @property
    def lives_at_most(self) -> int:
        """How many lives there are, at most: one for each seed, and for each variant at least."""
        return max(len(self.seeds), len(self.variants), 1)

    @cached_property
    def variants(self) -> tuple[Variant, ...]:
        """The scenario along its axes, each built and checked; without axes just the scenario."""
        if not self.varies:
            return (Variant(self.scenario),)
        from fleet2d.studies.design import build_design
        from fleet2d.studies.specification import read_specification

        base, axes = self.scenario.resolved(), dict(self.axes)
        if self.households:
            base = {**base, "users": {}}
            options = {name: {"users": dict(users)} for name, users in self.households.items()}
            axes = {**axes, HOUSEHOLD: {"options": options}}
        design = build_design(read_specification({"base": base, "axes": axes}))
        artifacts = self.scenario.artifacts
        variants = []
        for index in range(len(design)):
            labels = design.parameters(index)
            labels.pop("seed")
            scenario = design.scenario(index).model_copy(update={"artifacts": artifacts})
            variants.append(Variant(scenario, labels))
        return tuple(variants)

    def lives(self) -> Iterator[Variant]:
        """Yield the scenario of each life: round and round the variants, with one seed each."""
        own = self.scenario.simulation.seed or 0
        seeds = self.seeds or (own,)
        lives = [
            (self.variants[number % len(self.variants)], seeds[number % len(seeds)])
            for number in range(self.lives_at_most)
        ]
        if self.only is not None:
            kept = [life for life in lives if life[1] == self.only]
            lives = kept or [(variant, self.only) for variant in self.variants]
        for variant, seed in lives:
            yield variant.with_seed(seed)


def trial(
    scenario: str | Path | Mapping[str, Any] | Scenario | None = None,
    *overrides: str,
    seeds: int | Sequence[int] | None = None,
    holds: float = 1.0,
    error: float = 0.05,
    homes: int | str | Path | Sequence[str | Path] | None = None,
    households: Mapping[str, Mapping[str, Any]] | None = None,
    axes: Mapping[str, Any] | None = None,
    **settings: Any,
) -> Callable[[Test], Test]:
    """Make a test of a function that takes a `trial`: it is called once a life, by pytest.

    Args:
        scenario: A YAML file beside the test or in the working folder, 'bundled:NAME', a mapping
            or a Scenario; None: the bundled base scenario.
        overrides: Texts like 'simulation.duration=4 h'.
        seeds: How many seeds, from 0 on, or which; None: that of the scenario, or 0. With
            homes, households or axes the seeds go round them.
        holds: In which share of lives it is to hold. 1: in each, and the first that fails
            decides; less: as soon as a sequential test tells, see `fleet2d.testing.rate`.
        error: How often the claim may be judged wrongly.
        homes: So many synthetic homes, or files, folders and patterns of floor plans.
        households: The users by name of household: `{"couple": {"ana": …, "ben": …}}`.
        axes: More that varies, as the `axes` of a study file.
        settings: Keys of `simulation` or of the scenario, such as ``seed=4``.

    Example:
        >>> from fleet2d.testing import trial
        >>> @trial("bundled:base", "simulation.duration=1 h", seeds=20, holds=0.8)
        ... def test_robot_moves(trial):
        ...     before = trial.state["astro"]
        ...     trial.run_until("00:50")
        ...     assert trial.state["astro"] != before
    """
    numbers = range(seeds) if isinstance(seeds, int) else seeds or ()
    if isinstance(seeds, int) and seeds < 1:
        raise InputError(f"seeds={seeds}: 1 or more seeds are wanted")

    def decorate(function: Test) -> Test:
        source = _beside(function, scenario)
        varied = {**_homes(homes, function), **(axes or {})}
        claim = Claim(
            source, overrides, settings, varied, households or {}, tuple(numbers), holds, error
        )
        setattr(function, ATTRIBUTE, claim)
        return function

    return decorate


def _folder_of(function: Callable[..., Any]) -> Path:
    """Return the folder of the file in which a function is written."""
    code = getattr(function, "__code__", None)
    return Path(code.co_filename).parent if code is not None else Path()


def _beside(function: Callable[..., Any], source: Any) -> Any:
    """Return a scenario's file as it lies beside the test's, if one does."""
    if not isinstance(source, str | Path) or str(source).startswith("bundled:"):
        return source
    path = _folder_of(function) / source
    return path if path.is_file() else source


def _homes(
    homes: int | str | Path | Sequence[str | Path] | None, function: Callable[..., Any]
) -> dict[str, Any]:
    if homes is None:
        return {}
    if isinstance(homes, int):
        return {HOME: {"synthetic": homes}}
    names = [homes] if isinstance(homes, str | Path) else list(homes)
    folder = _folder_of(function)
    return {HOME: {"floorplans": [_near(folder, name) for name in names]}}


def _near(folder: Path, name: str | Path) -> str:
    """Return a file or a pattern as it lies in a folder, if it does, else as it is written."""
    path = folder / name
    return str(path if path.exists() or any(path.parent.glob(path.name)) else Path(name).absolute())
