"""How often 95 % intervals of studies, and others, contain the true mean, by simulated studies.

python benchmarks/intervals.py [--studies 1000]

Homes come from ten distributions, in three designs: a value for each home; four seeds of its own
for each home; and differences of pairs with the same home and seed, homes and seeds crossed. A row
is a case, a cell the share of studies whose interval contains the true mean, of those that have an
interval, and its median length in that of Student's t. The column `can't tell` has the share of
studies in which no interval is told.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy import stats

from fleet2d.studies.answers import difference_limits
from fleet2d.studies.intervals import (
    LEVEL,
    UNLIMITED,
    Limits,
    MeanEstimate,
    estimate,
    student_quantile,
)

RESAMPLES = 999
HOMES = (5, 10, 20, 40)
DESIGNS = ("homes", "nested", "crossed")
SEEDS = 4  # of a home
Interval = tuple[float, float]
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


SHAPES = {
    "normal": Shape(lambda g, n: g.normal(3, 1, n), 3.0, UNLIMITED),
    "lognormal": Shape(lambda g, n: np.exp(g.normal(0, 1, n)), float(np.exp(0.5))),
    "exponential": Shape(lambda g, n: g.exponential(1, n), 1.0),
    "70 % are zero": Shape(lambda g, n: (g.random(n) < 0.3) * g.exponential(1, n), 0.3),
    "one in ten": Shape(one_in_ten, float(1.7 * np.exp(0.045))),
    "shares near 0": Shape(lambda g, n: g.beta(0.5, 9.5, n), 0.05, (0.0, 1.0)),
    "shares near 1": Shape(lambda g, n: g.beta(9.5, 0.5, n), 0.95, (0.0, 1.0)),
    "ties": Shape(lambda g, n: g.poisson(1, n).astype(float), 1.0),
    "constant": Shape(lambda _, n: np.full(n, 0.5), 0.5, (0.0, 1.0)),
    "bimodal": Shape(lambda g, n: g.choice([1.0, 3.0], n) + g.normal(0, 0.2, n), 2.0),
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

    def study(self, number: int) -> tuple[Any, Levels]:
        """Return the values of a study and the units that they belong to."""
        generator = np.random.default_rng((7, number, self.homes))
        of_home = SHAPES[self.shape].draw(generator, self.homes)
        home, seed = np.divmod(np.arange(self.homes * SEEDS), SEEDS)
        if self.design == "homes" or self.shape == "constant":
            return of_home, {"home": np.arange(self.homes)}
        # What differs between seeds has the mean 0, and never leaves the limits.
        size = np.minimum(of_home, 1 - of_home) if self.limits[1] == 1 else 0.2 * np.abs(of_home)
        noise = 1.7 * size[home] * generator.uniform(-0.5, 0.5, len(home))
        if self.design == "nested":
            return of_home[home] + noise, {"home": home}
        of_seed = generator.normal(0, 0.02 * np.abs(SHAPES[self.shape].mean), SEEDS)
        return of_home[home] + 0.5 * noise + of_seed[seed], {"home": home, "seed": seed}


def ours(values: Any, levels: Levels, limits: Limits) -> MeanEstimate:
    """Return the mean as studies estimate it."""
    return estimate(values, levels, limits=limits)


def student(values: Any, levels: Levels) -> Interval:
    """Return the interval by Student's t."""
    mean = estimate(values, levels)
    half = student_quantile(mean.freedom) * mean.error
    return mean.mean - half, mean.mean + half


def log_scale(values: Any, levels: Levels) -> Interval | None:
    """Return Cox's interval for the mean of lognormal values."""
    if len(levels) > 1 or (values <= 0).any():
        return None
    logs, count = np.log(values), len(values)
    variance = logs.var(ddof=1)
    half = student_quantile(count - 1) * np.sqrt(variance / count + variance**2 / (2 * (count - 1)))
    return tuple(np.exp(logs.mean() + variance / 2 + np.array([-half, half])).tolist())


def accelerated(values: Any, levels: Levels) -> Interval | None:
    """Return the bias-corrected and accelerated bootstrap interval."""
    if len(levels) > 1:
        return None
    result = stats.bootstrap(
        (values,), np.mean, n_resamples=RESAMPLES, confidence_level=LEVEL, rng=1, method="BCa"
    )
    return result.confidence_interval.low, result.confidence_interval.high


def studentized(values: Any, levels: Levels) -> Interval | None:
    """Return the studentized bootstrap interval, for homes without seeds."""
    if len(levels) > 1:
        return None
    count, mean, error = len(values), values.mean(), stats.sem(values)
    resamples = np.random.default_rng(1).choice(values, (RESAMPLES, count))
    errors = np.maximum(stats.sem(resamples, axis=1), 1e-3 * error)
    low, high = np.quantile((resamples.mean(axis=1) - mean) / errors, [0.025, 0.975])
    return mean - high * error, mean - low * error


OTHERS: dict[str, Callable[[Any, Levels], Interval | None]] = {
    "Student's t": student,
    "studentized bootstrap": studentized,
    "BCa bootstrap": accelerated,
    "t of logarithms": log_scale,
}


def by_home(values: Any, levels: Levels) -> tuple[Any, Levels]:
    """Return the means of homes, if only homes are units, for methods that take one value each."""
    if len(levels) > 1:
        return values, levels
    homes, number = np.unique(levels["home"], return_inverse=True)
    return np.bincount(number, values) / np.bincount(number), {"home": homes}


def cases() -> Iterator[Case]:
    """Yield all cases."""
    for design in DESIGNS:
        for shape in SHAPES:
            for homes in HOMES:
                yield Case(shape, homes, design)


@dataclass(frozen=True)
class Coverage:
    """How intervals of studies do in one case.

    Attributes:
        contain: The share that contains the true mean, told or not, of the studies whose values
            differ; NaN if there are none.
        untold: The share of studies in which no interval is told.
        length: The median length.
    """

    contain: float
    untold: float
    length: float


def coverage(case: Case, studies: int) -> Coverage:
    """Return how the intervals of studies do in a case."""
    truth = SHAPES[case.shape].mean
    means = [ours(*case.study(number), case.limits) for number in range(studies)]
    untold = float(np.mean([bool(mean.doubt) for mean in means]))
    ends = np.array([(mean.low, mean.high) for mean in means if np.isfinite(mean.low)])
    if not len(ends):
        return Coverage(np.nan, untold, np.nan)
    contain = (ends[:, 0] <= truth) & (truth <= ends[:, 1])
    return Coverage(float(contain.mean()), untold, float(np.median(np.ptp(ends, axis=1))))


def row(case: Case, studies: int, *, compare: bool) -> list[str]:
    """Return the cells of a case."""
    truth, ours_does = SHAPES[case.shape].mean, coverage(case, studies)
    drawn = [by_home(*case.study(number)) for number in range(studies)]
    drawn = [(values, levels) for values, levels in drawn if np.ptp(values) > 0]
    cells = [case.shape, case.design, str(case.homes), f"{ours_does.untold:.0%}".replace("%", " %")]
    unit = np.median([np.ptp(student(*study)) for study in drawn]) if drawn else np.nan
    results = [(ours_does.contain, ours_does.length)]
    for method in OTHERS.values() if compare else (student,):
        found = [method(*study) for study in drawn]
        if not found or None in found:
            results.append((np.nan, np.nan))
            continue
        ends = np.array(found)
        contain = float(((ends[:, 0] <= truth) & (truth <= ends[:, 1])).mean())
        results.append((contain, float(np.median(np.ptp(ends, axis=1)))))
    return cells + [
        "–" if np.isnan(share) else f"{share:.3f} ({length / unit:.2f})"
        for share, length in results
    ]


def main() -> None:
    """Print a table in Markdown."""
    parser = argparse.ArgumentParser(description="How often intervals contain the true mean.")
    parser.add_argument("--studies", type=int, default=1000, help="simulated studies of a case")
    parser.add_argument("--quick", action="store_true", help="without the bootstraps")
    options = parser.parse_args()
    others = list(OTHERS)[:1] if options.quick else list(OTHERS)
    head = ["homes", "design", "number", "can't tell", "of studies", *others]
    print(f"| {' | '.join(head)} |\n| {' | '.join(['---'] * len(head))} |")
    one_row = partial(row, studies=options.studies, compare=not options.quick)
    for case in cases():
        print(f"| {' | '.join(one_row(case))} |", flush=True)


if __name__ == "__main__":
    main()
