"""Claims of tests with trials: scenarios, seeds, and the sequential test of a claimed rate."""

import math
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from fleet2d.errors import InputError, errors_as
from fleet2d.kernels import F64, I64
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.scenario.load import load_scenario
from fleet2d.scenario.model import Scenario

MAX_SEEDS = 10_000
BISECTIONS = 14
INTERVAL_BISECTIONS = 40
MAX_SEARCHED_SEEDS = 2_000
MIN_SHOWN = 0.5
MAX_FAILURE_RATIO = 10.0
"""A claim shows nothing if it can't refuse a robot that holds half as often, or fails ten times."""
ATTRIBUTE = "fleet2d_claim"
"""The attribute of a test function that holds its claim."""
HOME = "home"
HOUSEHOLD = "household"


class RateTest(NamedTuple):
    """A sequential test of a claimed rate, such as that a test holds in 95 % of trials.

    This is Wald's sequential probability ratio test (Ann. Math. Statist. 16(2), 1945, 117-186),
    truncated at a number of seeds. Its boundaries are numbers of failures, so that its error rates
    are exact sums over binomial paths; the largest rate that it can distinguish from the claimed
    one follows from the number of seeds.

    Attributes:
        seeds: Largest number of seeds.
        holds: The claimed rate, above 0 and up to 1.
        error: Largest probability of refusing a true claim, and of accepting the alternative.
        alternative: The largest rate that is refused with a probability of at least 1 - `error`.
        accept: int64 (seeds + 1,), the maximum number of failures with which the claim is accepted,
            by number of seeds so far; -1 where it can't be accepted yet.
        refuse: int64 (seeds + 1,), the fewest failures with which the claim is refused.

    Example:
        >>> test = rate_test(seeds=100, holds=0.95)
        >>> test.decide(seeds=10, failures=0) is None, test.decide(seeds=100, failures=20)
        (True, False)
    """

    seeds: int
    holds: float
    error: float
    alternative: float
    accept: I64
    refuse: I64

    def decide(self, seeds: int, failures: int) -> bool | None:
        """Return whether the claim is accepted; None while more seeds are needed."""
        if failures >= self.refuse[seeds]:
            return False
        return True if failures <= self.accept[seeds] else None

    def judge(self, held: Sequence[bool]) -> bool | None:
        """Return whether trials, in order, show the claim; None if they are too few."""
        failures = 0
        for number, holds in enumerate(held[: self.seeds], 1):
            failures += not holds
            decided = self.decide(number, failures)
            if decided is not None:
                return decided
        return None

    def acceptance(self, rate: float) -> float:
        """Return the exact probability that the claim is accepted if `rate` is the true rate."""
        return sum_in_order(accepted for accepted, _, _ in steps_of(self.accept, self.refuse, rate))


@lru_cache(maxsize=64)
def rate_test(seeds: int, holds: float = 1.0, error: float = 0.05) -> RateTest:
    """Return the sequential test of a claim.

    Args:
        seeds: Largest number of seeds.
        holds: The claimed rate; 1 claims that every seed holds, and one failure refuses it.
        error: The error rate, for both kinds of error.

    Raises:
        InputError: A number is out of range.
    """
    if not 1 <= seeds <= MAX_SEEDS:
        raise InputError(f"seeds={seeds}: expected 1 to {MAX_SEEDS:,} seeds")
    if not 0 < holds <= 1:
        raise InputError(f"holds={holds}: expected a rate above 0 and up to 1, such as 0.95")
    if not 0 < error < 0.5:
        raise InputError(f"error={error}: expected a rate above 0 and below 0.5, such as 0.05")
    if holds == 1:
        accept = np.full(seeds + 1, -1)
        accept[seeds] = 0
        every = np.ones(seeds + 1, np.int64)
        return RateTest(seeds, holds, error, error ** (1 / seeds), accept, every)
    low = 0.0
    high = holds
    best = _bounded(seeds, holds, 0.0, error)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        test = _bounded(seeds, holds, middle, error)
        if test.acceptance(middle) <= error:
            low = middle
            best = test
        else:
            high = middle
    if best.alternative == 0:
        fewest = math.floor(math.log(error) / math.log(1 - holds)) + 1
        raise InputError(
            f"seeds={seeds} is too few to test holds={holds:g} with an error of {error:g}: take"
            f" {max(fewest, seeds + 1)} seeds or more"
        )
    return best


def seeds_for(holds: float, alternative: float, error: float = 0.05) -> int | None:
    """Return how many seeds distinguish a claimed rate from a lower one; None if too many.

    Example:
        >>> seeds_for(1.0, 0.9), seeds_for(0.9, 0.7)
        (29, 46)
    """
    if holds == 1:
        return math.ceil(math.log(error) / math.log(alternative))

    def refused(seeds: int) -> float:
        """Return the largest rate that is refused with so many seeds."""
        try:
            return rate_test(seeds, holds, error).alternative
        except InputError:
            return 0.0

    high = 2
    while refused(high) < alternative:
        high *= 2
        if high > MAX_SEARCHED_SEEDS:
            return None
    return bisect_left(range(high), alternative, lo=high // 2 + 1, key=refused)


def rate_interval(held: int, number: int, error: float = 0.05) -> tuple[float, float]:
    """Return the interval of rates that some trials leave open (Clopper and Pearson, 1934).

    Args:
        held: The number of trials that held.
        number: The number of trials.
        error: The largest probability that the interval doesn't hold the true rate.

    Example:
        >>> low, high = rate_interval(9, 10)
        >>> round(low, 3), round(high, 3)
        (0.555, 0.997)
    """
    counts = range(number + 1)
    logs = [
        math.lgamma(number + 1) - math.lgamma(k + 1) - math.lgamma(number - k + 1) for k in counts
    ]

    def at_least(count: int, rate: float) -> float:
        """Return the probability that at least so many trials hold, at a given rate."""
        log_rate = math.log(rate)
        log_rest = math.log1p(-rate)
        terms = (logs[k] + k * log_rate + (number - k) * log_rest for k in counts[count:])
        return math.fsum(map(math.exp, terms))

    def rate_of(count: int, probability: float) -> float:
        low = 0.0
        high = 1.0
        for _ in range(INTERVAL_BISECTIONS):
            middle = (low + high) / 2
            low, high = (middle, high) if at_least(count, middle) < probability else (low, middle)
        return (low + high) / 2

    low = rate_of(held, error / 2) if held else 0.0
    return low, rate_of(held + 1, 1 - error / 2) if held < number else 1.0


def nested_rate_interval(
    outcomes: Sequence[Sequence[bool]], error: float = 0.05
) -> tuple[float, float]:
    """Return the interval of rates that trials leave open, some of which share a home.

    The interval is that of the effective number of trials, which is the smaller the more homes
    differ (Korn and Graubard, 1998, Survey Methodology 24). If all trials had the same outcome,
    which doesn't tell how much homes differ, the number of homes is used.

    Args:
        outcomes: Whether each trial held, by home or other variant.
        error: The largest probability that the interval doesn't hold the true rate.

    Example:
        >>> low, high = nested_rate_interval([[True] * 5, [True] * 5, [True] * 4 + [False]])
        >>> round(low, 2), round(high, 2)
        (0.64, 1.0)
    """
    number = sum(map(len, outcomes))
    homes = len(outcomes)
    rate = sum(map(sum, outcomes)) / number
    effective = float(number)
    if 1 < homes < number:
        squares = sum_in_order((sum(held) - rate * len(held)) ** 2 for held in outcomes)
        variance = homes / (homes - 1) * squares / number**2
        independent = rate * (1 - rate) / variance if variance else number
        effective = max(homes, min(independent, number)) if 0 < rate < 1 else homes
    count = math.floor(effective)
    low, _ = rate_interval(math.floor(rate * count), count, error)
    _, high = rate_interval(math.ceil(rate * count), count, error)
    return low, high


def _bounded(seeds: int, holds: float, other: float, error: float) -> RateTest:
    """Return the test of a claimed rate against another one.

    Each of its two errors, to refuse the claim or to accept it wrongly, has at most the probability
    `error`. Half of it is for decisions before the last seed (Ville's inequality), the remainder
    for the decision at the last seed.
    """
    number = np.arange(seeds + 1)
    failure = math.log((1 - other) / (1 - holds))  # evidence of one failure for the other rate
    with np.errstate(divide="ignore"):
        success = float(np.log(holds / other)) if other > 0 else math.inf
    threshold = math.log(2 / error)
    if math.isinf(success):  # one success refutes a rate of 0
        accept = np.full(seeds + 1, -1)
        refuse = number + 1
    else:
        slope = success / (success + failure)
        shift = threshold / (success + failure)
        accept = np.floor(slope * number - shift).astype(np.int64).clip(-1)
        refuse = np.minimum(np.ceil(slope * number + shift), seeds + 1).astype(np.int64)
    accept[seeds] = -1
    refuse[seeds] = seeds + 2
    steps = steps_of(accept, refuse, holds)
    refused = sum(now for _, now, _ in steps[:-1])
    last = steps[-1][2]
    # The fewest failures to refuse at the last seed so that refusals stay within the error.
    tail = refused + np.cumsum(last[::-1])[::-1]  # refusals if that many failures refuse
    most = int(np.argmax(np.append(tail, 0.0) <= error)) - 1
    accept[seeds] = most
    refuse[seeds] = most + 1
    return RateTest(seeds, holds, error, other, accept, refuse)


def steps_of(accept: I64, refuse: I64, rate: float) -> "list[tuple[float, float, F64]]":
    """Return (accepted, refused, undecided by failures) after each seed: exact probabilities."""
    width = int(refuse[:-1].max()) + 2
    failures = np.arange(width)
    undecided = np.zeros(width)
    undecided[0] = 1.0
    steps = []
    for number in range(1, len(accept)):
        mass = undecided * rate
        mass[1:] += undecided[:-1] * (1 - rate)
        is_accepted = failures <= accept[number]
        is_refused = failures >= refuse[number]
        accepted = float(mass[is_accepted].sum())
        refused = float(mass[is_refused].sum())
        steps.append((accepted, refused, mass))
        undecided = np.where(is_accepted | is_refused, 0.0, mass)
    return steps


Test = TypeVar("Test", bound=Callable[..., Any])


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
        width: The largest difference between the claimed rate and the highest refused one.
        may_be_untested: Whether trials count that test nothing.
        problem: The problem of the arguments; empty if there is none.
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
    width: float | None = None
    may_be_untested: bool = False
    problem: str = ""

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario, before the axes change it."""
        return load_scenario(self.source, *self.overrides, **self.settings)

    @cached_property
    def rate(self) -> RateTest:
        """The test of the claimed rate."""
        if self.only is not None:
            return rate_test(len(list(self.trials())))
        return rate_test(self.max_trials, self.holds, self.error)

    def of_scenario(self, source: str | Path) -> "Claim":
        """Return the claim for one scenario only, with its own seed."""
        return Claim(source, holds=1.0, error=self.error)

    def prepare(self) -> None:
        """Build the scenarios, and the test of the rate.

        Raises:
            SetUpError: One of them is wrong.
        """
        if self.problem:
            raise SetUpError(self.problem)
        with errors_as(SetUpError):
            _ = self.variants, self.rate
        if self.only is None:
            self._check_power()

    def _check_power(self) -> None:
        """Refuse a claim with too little power, and say how many seeds would suffice.

        Raises:
            SetUpError: The trials can't show what is claimed.
        """
        rate = self.rate
        least = rate.holds * MIN_SHOWN, 1 - MAX_FAILURE_RATIO * (1 - rate.holds)
        wanted = max(least) if self.width is None else rate.holds - self.width
        if rate.seeds == 1 or (rate.holds == 1 and self.width is None):
            return
        if rate.alternative < wanted:
            needed = seeds_for(rate.holds, wanted, rate.error)
            hint = f"{needed} would do" if needed else f"not even {MAX_SEARCHED_SEEDS:,} would do"
            other = percent(rate.alternative)
            shows = f", which show nothing: a robot that holds in {other} would be accepted, too"
            shows = shows if self.width is None else ""
            raise SetUpError(
                f"{percent(rate.holds)} can't be told from {percent(wanted)} with {rate.seeds}"
                f" seeds{shows}; {hint}"
            )

    @property
    def varies(self) -> bool:
        """Whether trials differ by more than their seeds."""
        return bool(self.axes or self.households)

    @property
    def max_trials(self) -> int:
        """Largest number of trials: one for each seed, and at least one for each variant."""
        return max(len(self.seeds), len(self.variants), 1)

    @cached_property
    def variants(self) -> tuple[Variant, ...]:
        """The checked variants of the scenario along its axes; without axes, the scenario alone."""
        if not self.varies:
            return (Variant(self.scenario),)
        from fleet2d.studies.design import build_design
        from fleet2d.studies.specification import read_specification

        base = self.scenario.resolved()
        axes = dict(self.axes)
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
            for number in range(self.max_trials)
        ]
        if self.only is not None:
            matches = [pair for pair in pairs if pair[1] == self.only]
            pairs = matches or [(variant, self.only) for variant in self.variants]
        for variant, seed in pairs:
            yield variant.with_seed(seed)


def percent(share: float) -> str:
    """Return a share in percent, with at most one decimal.

    >>> percent(0.95), percent(0.8464)
    ('95 %', '84.6 %')
    """
    return f"{round(100 * share, 1):g} %"


def trial(  # noqa: PLR0913 - all that a test may say of its trials
    scenario: str | Path | Mapping[str, Any] | Scenario | None = None,
    *overrides: str,
    seeds: int | Sequence[int] | None = None,
    holds: float = 1.0,
    error: float = 0.05,
    homes: int | str | Path | Sequence[str | Path] | None = None,
    households: Mapping[str, Mapping[str, Any]] | None = None,
    axes: Mapping[str, Any] | None = None,
    width: float | None = None,
    may_be_untested: bool = False,
    **settings: Any,
) -> Callable[[Test], Test]:
    """Turn a function with an argument `trial` into a test: pytest calls it once for each trial.

    Args:
        scenario: A YAML file beside the test or in the working folder, 'bundled:NAME', a mapping
            or a Scenario; None: the bundled family.
        overrides: Texts like 'simulation.duration=4 h'.
        seeds: Number of seeds, from 0 on, or the seeds; None: that of the scenario, or 0. With
            homes, households or axes each trial takes the next of these and the next seed.
        holds: The share of trials in which it must hold. 1: in each, and the first failure decides;
            less: a sequential test decides, see `RateTest`.
        error: Largest probability of a wrong decision.
        homes: Number of synthetic homes, or files, folders and patterns of floor plans.
        households: The users by name of household: `{"couple": {"ana": …, "ben": …}}`.
        axes: Further axes, as the `axes` of a study file.
        width: The largest distance from `holds` to the highest refused rate: with 0.1, seeds must
            suffice to distinguish 95 % from 85 %.
        may_be_untested: Whether a trial counts that has no expectation and no `assert`, or none
            whose occasion came.
        settings: Keys of `simulation` or of the scenario, such as ``seed=4``.

    Example:
        >>> from fleet2d.testing import trial
        >>> @trial("bundled:paper", "simulation.duration=1 h", seeds=20, holds=0.8)
        ... def test_robot_moves(trial):
        ...     before = trial.state["astro"]
        ...     trial.run_until("00:50")
        ...     assert trial.state["astro"] != before
    """
    numbers = range(seeds) if isinstance(seeds, int) else seeds or ()
    too_few = isinstance(seeds, int) and seeds < 1
    problem = f"seeds={seeds}: expected 1 or more seeds" if too_few else ""

    def decorate(function: Test) -> Test:
        code = getattr(function, "__code__", None)
        folder = Path(code.co_filename).parent if code is not None else Path()
        claim = Claim(
            _path_beside_test(folder, scenario),
            overrides,
            settings,
            {**_homes(folder, homes), **(axes or {})},
            households or {},
            tuple(numbers),
            holds,
            error,
            width=width,
            may_be_untested=may_be_untested,
            problem=problem,
        )
        setattr(function, ATTRIBUTE, claim)
        return function

    return decorate


def _path_beside_test(folder: Path, source: Any) -> Any:
    """Return the path of a scenario in the folder of the test, if it exists there."""
    if not isinstance(source, str | Path) or str(source).startswith("bundled:"):
        return source
    return folder / source if (folder / source).is_file() else source


def _homes(folder: Path, homes: int | str | Path | Sequence[str | Path] | None) -> dict[str, Any]:
    if homes is None:
        return {}
    if isinstance(homes, int):
        return {HOME: {"synthetic": homes}}
    names = [homes] if isinstance(homes, str | Path) else list(homes)
    return {HOME: {"floorplans": [_relative_path(folder, name) for name in names]}}


def _relative_path(folder: Path, name: str | Path) -> str:
    """Return a path or pattern relative to a folder if it exists there, else unchanged."""
    path = folder / name
    return str(path if path.exists() or any(path.parent.glob(path.name)) else Path(name).absolute())
