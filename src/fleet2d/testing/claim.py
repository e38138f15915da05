"""Claims of tests with trials: the scenarios, the seeds, and the rate at which they hold."""

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
    """The scenario of a trial is wrong, so that the test couldn't begin."""


@dataclass(frozen=True)
class Variant:
    """One scenario of a claim, with its labels along the claim's axes."""

    scenario: Scenario
    labels: Mapping[str, Any] = field(default_factory=dict)

    def with_seed(self, seed: int) -> "Variant":
        """Return the variant with another seed."""
        simulation = self.scenario.simulation.model_copy(update={"seed": seed})
        scenario = self.scenario.model_copy(update={"simulation": simulation})
        return Variant(scenario, {**self.labels, "seed": seed})

    @property
    def seed(self) -> int:
        """The seed; 0 where the scenario has none."""
        return self.scenario.simulation.seed or 0

    @property
    def text(self) -> str:
        """The name of the variant in messages.

        >>> Variant(load_scenario(), {"home": "flat"}).with_seed(3).text
        'home flat, seed 3'
        """
        return ", ".join(f"{n} {v}" for n, v in self.labels.items() if v is not None)


@dataclass(frozen=True)
class Claim:
    """A claim that a test holds in a share of trials.

    Attributes:
        source: The scenario, as `fleet2d.load_scenario` takes it.
        overrides: Texts like 'simulation.duration=4 h'.
        settings: Keys of `simulation` or of the scenario.
        axes: Axes along which the scenario varies, as in a study file.
        households: The users by name of household, which replace those of the scenario.
        seeds: The seeds; empty for the scenario's own.
        holds: The claimed rate.
        error: Largest probability of a wrong decision.
        only: The only seed to run; None: all.
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
            return rate_test(len(list(self.trials())))
        return rate_test(self.most_trials, self.holds, self.error)

    def of_scenario(self, source: str | Path) -> "Claim":
        """Return the claim for one scenario only, with its own seed."""
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
        """Whether trials differ by more than their seeds."""
        return bool(self.axes or self.households)

    @property
    def most_trials(self) -> int:
        """Largest number of trials: one for each seed, and at least one for each variant."""
        return max(len(self.seeds), len(self.variants), 1)

    @cached_property
    def variants(self) -> tuple[Variant, ...]:
        """The variants of the scenario along its axes, checked; without axes only itself."""
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

    def trials(self) -> Iterator[Variant]:
        """Yield the scenario of each trial: the variants in turn, each with the next seed."""
        own = self.scenario.simulation.seed or 0
        seeds = self.seeds or (own,)
        pairs = [
            (self.variants[number % len(self.variants)], seeds[number % len(seeds)])
            for number in range(self.most_trials)
        ]
        if self.only is not None:
            matches = [pair for pair in pairs if pair[1] == self.only]
            pairs = matches or [(variant, self.only) for variant in self.variants]
        for variant, seed in pairs:
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
    """Turn a function with an argument `trial` into a test: pytest calls it once for each trial.

    Args:
        scenario: A YAML file beside the test or in the working folder, 'bundled:NAME', a mapping
            or a Scenario; None: the bundled base scenario.
        overrides: Texts like 'simulation.duration=4 h'.
        seeds: Number of seeds, from 0 on, or the seeds; None: that of the scenario, or 0. With
            homes, households or axes each trial takes the next of these and the next seed.
        holds: The share of trials in which it must hold. 1: in each, and the first failure decides;
            less: a sequential test decides, see `fleet2d.testing.rate`.
        error: Largest probability of a wrong decision.
        homes: Number of synthetic homes, or files, folders and patterns of floor plans.
        households: The users by name of household: `{"couple": {"ana": …, "ben": …}}`.
        axes: Further axes, as the `axes` of a study file.
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
        raise InputError(f"seeds={seeds}: expected 1 or more seeds")

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
    """Return the folder of the file that defines a function."""
    code = getattr(function, "__code__", None)
    return Path(code.co_filename).parent if code is not None else Path()


def _beside(function: Callable[..., Any], source: Any) -> Any:
    """Return the path of a scenario beside the file of the test, if it exists there."""
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
    """Return a path or pattern relative to a folder, if it exists there, else as it is."""
    path = folder / name
    return str(path if path.exists() or any(path.parent.glob(path.name)) else Path(name).absolute())
