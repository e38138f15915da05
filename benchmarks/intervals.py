"""How often what studies and tests print is true, by simulated studies of ten shapes of homes.

python benchmarks/intervals.py [--studies 1000] [--others]

Homes come from ten distributions, in three designs: a value for each home; four seeds of its own
for each home; and differences of pairs with the same home and seed, homes and seeds crossed. A cell
is the share of studies whose 95 % interval contains the true mean. From few homes no interval is
told: there a cell is the share of studies that call most homes higher or lower though they aren't.
Of three comparisons, of which one is true, all intervals must hold at once. After a pilot, what it
says that four of five studies show must show in at least as many. The second table is of
the rates of tests, of homes that differ, and of tests that stop when they can decide. `--others`
takes six more distributions, on which no constant of the intervals was chosen.
"""

import argparse
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from fleet2d.studies.answers import Comparison, difference_limits, judged
from fleet2d.studies.intervals import (
    ENOUGH_UNITS,
    LEVEL,
    UNLIMITED,
    Limits,
    estimate,
    student_quantile,
)
from fleet2d.studies.pilot import smallest_shown
from fleet2d.testing.claim import nested_rate_interval, rate_interval, rate_test

HOMES = (5, 10, 20, 30, 40)
DESIGNS = ("homes", "nested", "crossed")
SEEDS = 4  # of a home
PILOT_HOMES = 12
STUDIES_OF_PILOT = 20
RATES = (0.5, 0.8, 0.9, 0.95, 0.99)
EFFECT = 0.8  # of the one of three comparisons that is true, in deviations of homes
Levels = dict[str, Any]
Draw = Callable[[np.random.Generator, int], Any]


@dataclass(frozen=True)
class Shape:
    """A distribution of homes: how they are drawn, their mean, and the limits of values."""

    draw: Draw
    mean: float
    limits: Limits = (0.0, np.inf)


def one_in_ten(generator: np.random.Generator, count: int) -> Any:
    """Return homes of which one in ten is eight times the others."""
    is_rare = generator.random(count) < 0.1
    return np.where(is_rare, 8.0, 1.0) * np.exp(generator.normal(0, 0.3, count))


def outliers(generator: np.random.Generator, count: int) -> Any:
    """Return homes of which one in twenty lies up to twenty times as far out, on either side."""
    size = np.where(generator.random(count) < 0.05, 20.0, 1.0)
    return 3 + size * generator.normal(0, 1, count)


SHAPES = {
    "normal": Shape(lambda g, n: g.normal(3, 1, n), 3.0, UNLIMITED),
    "lognormal": Shape(lambda g, n: np.exp(g.normal(0, 1, n)), float(np.exp(0.5))),
    "exponential": Shape(lambda g, n: g.exponential(1, n), 1.0),
    "70 % are zero": Shape(lambda g, n: (g.random(n) < 0.3) * g.exponential(1, n), 0.3),
    "one in ten": Shape(one_in_ten, float(1.7 * np.exp(0.045))),
    "outliers": Shape(outliers, 3.0, UNLIMITED),
    "shares near 0": Shape(lambda g, n: g.beta(0.5, 9.5, n), 0.05, (0.0, 1.0)),
    "shares near 1": Shape(lambda g, n: g.beta(9.5, 0.5, n), 0.95, (0.0, 1.0)),
    "ties": Shape(lambda g, n: g.poisson(1, n).astype(float), 1.0),
    "bimodal": Shape(lambda g, n: g.choice([1.0, 3.0], n) + g.normal(0, 0.2, n), 2.0),
}
OTHERS = {
    "gamma": Shape(lambda g, n: g.gamma(0.5, 1, n), 0.5),
    "Weibull": Shape(lambda g, n: g.weibull(0.7, n), math.gamma(1 + 1 / 0.7)),
    "half are zero": Shape(
        lambda g, n: (g.random(n) < 0.5) * g.lognormal(0, 0.7, n), 0.5 * math.exp(0.245)
    ),
    "one in eight": Shape(
        lambda g, n: np.where(g.random(n) < 0.125, 5.0, g.normal(1, 0.1, n)), 1.5
    ),
    "Student's t, 3": Shape(lambda g, n: g.standard_t(3, n), 0.0, UNLIMITED),
    "Laplace": Shape(lambda g, n: g.laplace(0, 1, n), 0.0, UNLIMITED),
}


@dataclass(frozen=True)
class Case:
    """Simulated studies of one kind."""

    shape: str
    homes: int
    design: str = "homes"

    @property
    def limits(self) -> Limits:
        """The limits of values."""
        limits = SHAPES[self.shape].limits
        return difference_limits(limits) if self.design == "crossed" else limits

    def study(self, number: int) -> tuple[Any, Levels, float]:
        """Return the values of a study, the units that they belong to, and the true mean.

        That of few seeds, which are the same in all homes, is of those seeds.
        """
        generator = np.random.default_rng((7, number, self.homes))
        of_home = SHAPES[self.shape].draw(generator, self.homes)
        home, seed = np.divmod(np.arange(self.homes * SEEDS), SEEDS)
        if self.design == "homes":
            return of_home, {"home": np.arange(self.homes)}, SHAPES[self.shape].mean
        # What differs between seeds has the mean 0, and never leaves the limits.
        size = np.minimum(of_home, 1 - of_home) if self.limits[1] == 1 else 0.2 * np.abs(of_home)
        noise = 1.7 * size[home] * generator.uniform(-0.5, 0.5, len(home))
        if self.design == "nested":
            return of_home[home] + noise, {"home": home}, SHAPES[self.shape].mean
        of_seed = generator.normal(0, 0.02 * np.abs(SHAPES[self.shape].mean), SEEDS)
        values = of_home[home] + 0.5 * noise + of_seed[seed]
        truth = SHAPES[self.shape].mean + float(of_seed.mean())
        return values, {"home": home, "seed": seed}, truth


@dataclass(frozen=True)
class Coverage:
    """How intervals of studies do in one case.

    Attributes:
        contain: The share that contains the true mean, told or not.
        told: The same of the intervals that are told; NaN if none is.
        untold: The share of studies in which no interval is told.
        student: The share of intervals of Student's t that contain it, for comparison.
    """

    contain: float
    told: float
    untold: float
    student: float


def coverage(case: Case, studies: int) -> Coverage:
    """Return how the intervals of studies do in a case."""
    contain = np.zeros(studies, np.bool_)
    is_told = np.zeros(studies, np.bool_)
    student = np.zeros(studies, np.bool_)
    for number in range(studies):
        values, levels, truth = case.study(number)
        mean = estimate(values, levels, limits=case.limits)
        contain[number] = mean.low <= truth <= mean.high
        is_told[number] = not mean.doubt
        student[number] = abs(mean.mean - truth) <= student_quantile(mean.freedom) * mean.error
    told = float(contain[is_told].mean()) if is_told.any() else np.nan
    return Coverage(float(contain.mean()), told, float(1 - is_told.mean()), float(student.mean()))


@lru_cache
def median_of(shape: str) -> float:
    """Return the median of a shape."""
    return float(np.median(SHAPES[shape].draw(np.random.default_rng(1), 1_000_001)))


def called(shape: str, homes: int, studies: int) -> float:
    """Return the share of studies that call most homes higher or lower, where half of them are."""
    differ = 0
    for number in range(studies):
        values, levels, _ = Case(shape, homes).study(number)
        differ += compared(values - median_of(shape), levels).is_clear
    return differ / studies


def compared(differences: Any, levels: Levels) -> Comparison:
    """Return a comparison of paired differences."""
    above, below = int((differences > 0).sum()), int((differences < 0).sum())
    mean = estimate(differences, levels)
    one = Comparison("", {}, "", 0, 0, mean, 1, 1, len(differences), above, below, {})
    return judged([one])[0]


def family(shape: str, homes: int, studies: int) -> tuple[float, float]:
    """Return how often the intervals of three comparisons hold, and how often a claim is false.

    The first differs by `EFFECT`, the others don't.
    """
    drawn = SHAPES[shape].draw(np.random.default_rng(1), 100_000)
    center, deviation = SHAPES[shape].mean, float(np.std(drawn))
    truths = (EFFECT * deviation, 0.0, 0.0)
    hold = false = 0
    for number in range(studies):
        found = []
        for place, truth in enumerate(truths):
            values, levels, _ = Case(shape, homes).study(3 * number + place)
            found.append(compared(values - center + truth, levels))
        intervals = [each.interval for each in judged(found)]
        hold += all(low <= t <= high for (low, high), t in zip(intervals, truths, strict=True))
        false += any(each.is_clear for each in judged(found)[1:])
    return hold / studies, false / studies


def shown_after_pilot(shape: str, studies: int) -> float:
    """Return the share of studies of 40 homes that show what a pilot of 12 said they would."""
    center = SHAPES[shape].mean
    shown = []
    for pilot in range(-(-studies // STUDIES_OF_PILOT)):
        values, levels, _ = Case(shape, PILOT_HOMES).study(pilot)
        mean = estimate(values - center, levels)
        if not mean.error > 0:
            continue
        size = smallest_shown(mean, {"home": HOMES[-1]}, LEVEL)
        for number in range(STUDIES_OF_PILOT):
            values, levels, _ = Case(shape, HOMES[-1]).study(pilot * STUDIES_OF_PILOT + number)
            shown.append(estimate(values - center + size, levels).is_clear)
    return float(np.mean(shown))


def rate_coverage(rate: float, studies: int) -> tuple[float, float, float]:
    """Return how often intervals of a rate hold it: of 40 seeds, 20 homes of 5, and early stops."""
    generator = np.random.default_rng(1)
    alone = lru_cache(rate_interval)
    test = rate_test(100, 0.9)
    hits = np.zeros(3)
    for _ in range(studies):
        held = int((generator.random(40) < rate).sum())
        homes = generator.beta(8 * rate, 8 * (1 - rate), 20)
        outcomes = (generator.random((20, 5)) < homes[:, None]).tolist()
        failures = np.cumsum(generator.random(100) >= rate)
        end = next(n for n in range(1, 101) if test.decide(n, failures[n - 1]) is not None)
        intervals = (
            alone(held, 40),
            nested_rate_interval(outcomes),
            alone(int(end - failures[end - 1]), end),
        )
        hits += [low <= rate <= high for low, high in intervals]
    return tuple((hits / studies).tolist())


def row(shape: str, studies: int) -> list[str]:
    """Return the cells of a shape."""
    few = [f"*{called(shape, homes, studies):.3f}*" for homes in HOMES if homes < ENOUGH_UNITS]
    many = [coverage(Case(shape, homes), studies) for homes in HOMES if homes >= ENOUGH_UNITS]
    of_seeds = [coverage(Case(shape, HOMES[-1], design), studies).told for design in DESIGNS[1:]]
    hold, false = family(shape, HOMES[-1], studies)
    shown = shown_after_pilot(shape, studies)
    shares = [*(each.told for each in many), *of_seeds, hold, false, shown, many[-1].student]
    return [shape, *few, *(f"{share:.3f}" for share in shares)]


def main() -> None:
    """Print the tables in Markdown."""
    parser = argparse.ArgumentParser(description="How often what studies print is true.")
    parser.add_argument("--studies", type=int, default=1000, help="simulated studies of a case")
    parser.add_argument("--others", action="store_true", help="other shapes of data")
    options = parser.parse_args()
    studies = options.studies
    shapes = list(OTHERS if options.others else SHAPES)
    SHAPES.update(OTHERS)
    head = [
        "homes", *map(str, HOMES), "40, nested", "40, crossed", "three at once", "a false claim",
        "after a pilot",
        "40: Student's t",
    ]  # fmt: skip
    print(f"| {' | '.join(head)} |\n| {' | '.join(['---', *['---:'] * (len(head) - 1)])} |")
    for shape in shapes:
        print(f"| {' | '.join(row(shape, studies))} |", flush=True)
    print("\n| true rate | 40 seeds | 20 homes, 5 seeds each | stopped early |\n| --- |", end="")
    print(" ---: |" * 3)
    for rate in RATES:
        shares = " | ".join(f"{share:.3f}" for share in rate_coverage(rate, studies))
        print(f"| {100 * rate:g} % | {shares} |", flush=True)


if __name__ == "__main__":
    main()
