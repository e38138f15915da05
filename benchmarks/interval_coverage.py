"""How often 95 % intervals of studies, and others, contain the true mean, by simulated studies.

python benchmarks/interval_coverage.py [--studies 1000]

Homes come from a normal, an exponential, a lognormal (σ 1) or a heavy-tailed distribution (that of
Student's t with 3 degrees of freedom); with seeds, each home and each seed adds a part of its own.
A row is a case, a cell the share of studies whose interval contains the true mean, and the median
length of the interval in that of Student's t.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy import stats

from fleet2d.studies.intervals import LEVEL, estimate, student_quantile

RESAMPLES = 999
HOMES = (3, 5, 8, 15, 30, 60)
CROSSED = ((5, 5), (8, 5), (15, 5), (30, 10))
Interval = tuple[float, float]
Draw = Callable[[np.random.Generator, int], Any]


def lognormal(generator: np.random.Generator, count: int) -> Any:
    """Return positive values with a long tail, mean 1.65."""
    return np.exp(generator.normal(0, 1, count))


def exponential(generator: np.random.Generator, count: int) -> Any:
    """Return positive values, mean 1."""
    return generator.exponential(1, count)


def heavy(generator: np.random.Generator, count: int) -> Any:
    """Return values of a symmetric distribution with heavy tails, mean 3."""
    return 3 + generator.standard_t(3, count)


def normal(generator: np.random.Generator, count: int) -> Any:
    """Return normal values, mean 3."""
    return generator.normal(3, 1, count)


MEANS: dict[Draw, float] = {
    normal: 3.0,
    heavy: 3.0,
    exponential: 1.0,
    lognormal: float(np.exp(0.5)),
}


@dataclass(frozen=True)
class Case:
    """Simulated studies of one kind."""

    draw: Draw
    homes: int
    seeds: int = 1

    def study(self, number: int) -> tuple[Any, dict[str, Any]]:
        """Return the values of a study and the units that they belong to."""
        generator = np.random.default_rng((7, number, self.homes, self.seeds))
        of_home = self.draw(generator, self.homes)
        home, seed = np.divmod(np.arange(self.homes * self.seeds), self.seeds)
        if self.seeds == 1:
            return of_home, {"home": home}
        of_seed = generator.normal(0, 0.5, self.seeds)
        return of_home[home] + of_seed[seed] + generator.normal(0, 0.5, len(home)), {
            "home": home, "seed": seed,
        }  # fmt: skip


def ours(values: Any, levels: dict[str, Any]) -> Interval:
    """Return the interval of studies: the wider of Student's t and Hall's transformation of it."""
    mean = estimate(values, levels)
    return mean.low, mean.high


def student(values: Any, levels: dict[str, Any]) -> Interval:
    """Return the interval by Student's t."""
    mean = estimate(values, levels)
    half = student_quantile(mean.freedom) * mean.error
    return mean.mean - half, mean.mean + half


def log_scale(values: Any, levels: dict[str, Any]) -> Interval | None:
    """Return Cox's interval for the mean of lognormal values."""
    if len(levels) > 1 or (values <= 0).any():
        return None
    logs, count = np.log(values), len(values)
    variance = logs.var(ddof=1)
    half = student_quantile(count - 1) * np.sqrt(variance / count + variance**2 / (2 * (count - 1)))
    return tuple(np.exp(logs.mean() + variance / 2 + np.array([-half, half])).tolist())


def accelerated(values: Any, levels: dict[str, Any]) -> Interval | None:
    """Return the bias-corrected and accelerated bootstrap interval."""
    if len(levels) > 1:
        return None
    result = stats.bootstrap(
        (values,), np.mean, n_resamples=RESAMPLES, confidence_level=LEVEL, rng=1, method="BCa"
    )
    return result.confidence_interval.low, result.confidence_interval.high


def studentized(values: Any, levels: dict[str, Any]) -> Interval | None:
    """Return the studentized bootstrap interval, for homes without seeds."""
    if len(levels) > 1:
        return None
    count, mean, error = len(values), values.mean(), stats.sem(values)
    resamples = np.random.default_rng(1).choice(values, (RESAMPLES, count))
    errors = np.maximum(stats.sem(resamples, axis=1), 1e-3 * error)
    low, high = np.quantile((resamples.mean(axis=1) - mean) / errors, [0.025, 0.975])
    return mean - high * error, mean - low * error


METHODS: dict[str, Callable[[Any, dict[str, Any]], Interval | None]] = {
    "of studies": ours,
    "Student's t": student,
    "studentized bootstrap": studentized,
    "BCa bootstrap": accelerated,
    "t of logarithms": log_scale,
}


def cases() -> Iterator[Case]:
    """Yield all cases."""
    for draw in MEANS:
        yield from map(partial(Case, draw), HOMES)
        for homes, seeds in CROSSED:
            yield Case(draw, homes, seeds)


def row(case: Case, studies: int) -> list[str]:
    """Return the cells of a case: coverage and relative length by method."""
    mean = MEANS[case.draw]
    intervals = {
        name: np.array([method(*case.study(i)) or (np.nan, np.nan) for i in range(studies)])
        for name, method in METHODS.items()
    }
    lengths = {name: np.median(np.ptp(ends, axis=1)) for name, ends in intervals.items()}
    unit = lengths["Student's t"]
    cells = [case.draw.__name__, str(case.homes), str(case.seeds)]
    for name, ends in intervals.items():
        if np.isnan(ends).any():
            cells.append("–")
            continue
        covered = ((ends[:, 0] <= mean) & (mean <= ends[:, 1])).mean()
        cells.append(f"{covered:.3f} ({lengths[name] / unit:.2f})")
    return cells


def main() -> None:
    """Print a table in Markdown."""
    parser = argparse.ArgumentParser(description="How often intervals contain the true mean.")
    parser.add_argument("--studies", type=int, default=1000, help="simulated studies of a case")
    studies = parser.parse_args().studies
    head = ["homes from", "homes", "seeds", *METHODS]
    print(f"| {' | '.join(head)} |\n| {' | '.join(['---'] * len(head))} |")
    for case in cases():
        print(f"| {' | '.join(row(case, studies))} |", flush=True)


if __name__ == "__main__":
    main()
