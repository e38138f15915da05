"""Answers about a fleet: percentiles over robots, the worst robots, and groups that differ.

Groups are found by a shallow tree on half of the homes and tested on the other half, which had no
part in choosing them: so their intervals hold, and only splits that both halves show are reported.
"""

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.configuration.problems import counted
from fleet2d.errors import InputError, extra
from fleet2d.kernels import F64, I64, Bool
from fleet2d.studies.answers import StudyAnswers, holm
from fleet2d.studies.intervals import ENOUGH_UNITS, LEVEL, MeanEstimate, estimate
from fleet2d.studies.results import VARIANT
from fleet2d.studies.sentences import Conclusion, StudyAnswer, number

if TYPE_CHECKING:
    import polars as pl

PERCENTS = (1, 5, 25, 50, 75, 95, 99)
WORST_SHARE = 0.01
DEPTH = 2
# The number of values at which a numeric feature may be split.
CUTS = 15
# The least share of the robots in a group.
SMALLEST_SHARE = 0.05
MAX_NAMED = 3  # runs that a sentence names
# The number of robots for which each half of the homes can show two groups.
FEWEST = 4 * ENOUGH_UNITS


def features_of(study: StudyAnswers) -> list[str]:
    """Return the columns of drawn features that differ between robots."""
    *drawn, seed = study.meta.features
    varying = [c for c in drawn if study.complete[c].drop_nulls().n_unique() > 1]
    return [c for c in varying if c not in (*study.populations, seed)]


def by_robot(
    study: StudyAnswers, metric: str, against: Mapping[str, Any] | None = None
) -> "pl.DataFrame":
    """Return the mean of a metric for each robot, or its mean difference to a reference.

    Returns:
        A row for each robot: its number, home, features, `value`, and the `variant` of one run.

    Raises:
        InputError: The study has no fleet, or no such metric or axis.
    """
    import polars as pl

    fleet = study.meta.fleet
    if not fleet:
        raise InputError(f"{study.location} has no fleet: an axis with the key `population`")
    if against is None:
        values = study.with_metric(metric).select(fleet, value=metric)
    else:
        values = study.differences(metric, against, fleet).select(fleet, value="difference")
    means = values.group_by(fleet, maintain_order=True).agg(pl.col("value").mean())
    keys = dict.fromkeys((fleet, *study.populations, *study.meta.features, VARIANT))
    robots = study.complete.select(*keys).unique(fleet, keep="first", maintain_order=True)
    return robots.join(means, on=fleet, how="inner", maintain_order="left")


def percentiles(study: StudyAnswers, metric: str) -> "pl.DataFrame":
    """Return percentiles of a metric over robots, with intervals from the binomial distribution.

    Returns:
        A row for each of `PERCENTS`: percent, value, low and high (95 %; null where there are too
        few robots to tell), doubt.

    Raises:
        InputError: The study has no fleet, or no such metric.
    """
    import polars as pl

    values = np.sort(by_robot(study, metric)["value"].to_numpy())
    rows = []
    for percent in PERCENTS:
        ranks = quantile_ranks(len(values), percent / 100)
        value = float(np.quantile(values, percent / 100, method="inverted_cdf"))
        low, high = [None if rank is None else float(values[rank]) for rank in ranks]
        doubt = f"{len(values)} robots are too few" if None in ranks else ""
        row = {"percent": percent, "value": value, "low": low, "high": high, "doubt": doubt}
        rows.append(row)
    return pl.DataFrame(rows, infer_schema_length=None)


def quantile_ranks(count: int, share: float) -> tuple[int | None, int | None]:
    """Return the ranks, from 0 on, of the ends of the interval of a quantile; None: too few values.

    >>> quantile_ranks(2000, 0.01), quantile_ranks(100, 0.01)
    ((11, 29), (None, 3))
    """
    with extra("study", "intervals need scipy"):
        from scipy.special import bdtr
    tail = (1 - LEVEL) / 2
    # The probability that at most 0, 1, 2 … values are below the quantile.
    chances = bdtr(np.arange(count + 1), count, share)
    low = int(np.argmax(chances > tail)) - 1
    high = int(np.argmax(chances >= 1 - tail))
    return (low if low >= 0 else None), (high if high < count else None)


def worst(study: StudyAnswers, metric: str, share: float = WORST_SHARE) -> "pl.DataFrame":
    """Return the worst robots by a metric, the worst first, and how to run each again.

    Args:
        study: The study.
        metric: A metric of which one direction is better.
        share: The share of all robots; one robot at least.

    Returns:
        Number, home, features, `value`, `variant`, and `command`, which runs it again.

    Raises:
        InputError: The study has no fleet or metric, or neither direction of it is better.
    """
    import polars as pl

    better = study.better(metric)
    if not better:
        raise InputError(f"no value of {metric} is better than another: its metric doesn't say so")
    robots = by_robot(study, metric)
    count = max(1, math.ceil(share * len(robots)))
    order = robots.sort("value", descending=better == "lower", maintain_order=True)
    found = order.head(count)
    rerun = f"fleet2d study rerun {shlex.quote(study.location)}"
    commands = [f"{rerun} {variant} --out worst{variant}" for variant in found[VARIANT]]
    return found.with_columns(pl.Series("command", commands))


@dataclass(frozen=True)
class GroupCondition:
    """A condition on a feature of a robot.

    Attributes:
        feature: The feature.
        value: The value, or the limit of a number.
        is_number: Whether the value is the limit of a number.
        is_met: Whether robots must meet the condition, rather than break it.
    """

    feature: str
    value: Any
    is_number: bool
    is_met: bool = True

    def __str__(self) -> str:
        """Return the condition in words."""
        if self.is_number:
            return f"{self.feature} {'≤' if self.is_met else '>'} {number(float(self.value))}"
        return f"{self.feature} {'is' if self.is_met else 'is not'} {self.value}"

    def holds(self, columns: Mapping[str, Sequence[Any]]) -> Bool:
        """Return for each robot whether the condition holds: bool (robots,)."""
        values = columns[self.feature]
        if self.is_number:
            numbers = np.array([math.nan if v is None else v for v in values], np.float64)
            met = numbers <= self.value
        else:
            met = np.array([value == self.value for value in values], np.bool_)
        return met if self.is_met else ~met


GroupPath = tuple[GroupCondition, ...]


@dataclass(frozen=True)
class Group:
    """Robots that differ from others, found on half of the homes and tested on the others.

    Attributes:
        conditions: The conditions that they have in common.
        robots: Their number in the half of the homes that tests.
        estimate: The mean over these robots.
        p: The p value of the split that made the group, corrected for all splits.
        low: The lower end of the interval of the mean, simultaneous over all groups.
        high: Its upper end.
    """

    conditions: GroupPath
    robots: int
    estimate: MeanEstimate
    p: float
    low: float = math.nan
    high: float = math.nan


def find_groups(
    values: F64, columns: Mapping[str, Sequence[Any]], homes: Sequence[Any]
) -> list[Group]:
    """Return groups of robots whose means differ; none if the other half of homes shows none.

    Args:
        values: One for each robot: float64 (robots,).
        columns: The features of robots, numbers or texts, by name.
        homes: The home of each robot.

    Example:
        >>> people = [1, 2, 3] * 200
        >>> values = np.array([float(p > 1) for p in people]) + np.arange(600) % 7
        >>> found = find_groups(values, {"people": people}, range(600))
        >>> [str(group.conditions[0]) for group in found]
        ['people ≤ 1', 'people > 1']
    """
    places = {home: place for place, home in enumerate(dict.fromkeys(homes))}
    numbers = np.array([places[home] for home in homes], np.int64)
    finds = numbers % 2 == 0
    smallest = max(ENOUGH_UNITS, math.ceil(SMALLEST_SHARE * finds.sum()))
    p_values: dict[GroupPath, float] = {}
    leaves: list[GroupPath] = []

    def grow(path: GroupPath, inside: Bool) -> None:
        split = None if len(path) == DEPTH else _best(values, columns, inside & finds, smallest)
        if split is None:
            leaves.append(path)
            return
        met = split.holds(columns)
        tests = inside & ~finds
        p_values[path] = _p_of_split(values[tests], met[tests], numbers[tests])
        for is_met, side in ((True, met), (False, ~met)):
            grow((*path, replace(split, is_met=is_met)), inside & side)

    grow((), np.ones(len(values), np.bool_))
    corrected = dict(zip(p_values, holm(list(p_values.values())), strict=True))
    clear = {path: p for path, p in corrected.items() if p < 1 - LEVEL}
    kept = list(dict.fromkeys(_pruned(path, clear) for path in leaves))
    if kept == [()]:
        return []
    groups = []
    for path in kept:
        inside = ~finds
        for condition in path:
            inside &= condition.holds(columns)
        found = estimate(values[inside], {"home": list(compress(homes, inside))})
        low, high = found.interval(1 - (1 - LEVEL) / len(kept))
        groups.append(Group(path, int(inside.sum()), found, clear[path[:-1]], low, high))
    return groups


def _pruned(path: GroupPath, clear: Mapping[GroupPath, float]) -> GroupPath:
    """Return the start of a path up to the first split that isn't clear."""
    for depth in range(len(path)):
        if path[:depth] not in clear:
            return path[:depth]
    return path


def _best(
    values: F64, columns: Mapping[str, Sequence[Any]], inside: Bool, smallest: int
) -> GroupCondition | None:
    """Return the condition that divides robots best: with the largest sum of squares between."""
    best: tuple[float, GroupCondition] | None = None
    own = values[inside]
    mean = own.mean() if len(own) else 0.0
    for condition in _candidates(columns, inside):
        met = condition.holds(columns)[inside]
        count = int(met.sum())
        if not smallest <= count <= len(own) - smallest:
            continue
        square = count * (own[met].mean() - mean) ** 2
        square += (len(own) - count) * (own[~met].mean() - mean) ** 2
        if square > 0 and (best is None or square > best[0]):
            best = float(square), condition
    return best[1] if best else None


def _candidates(columns: Mapping[str, Sequence[Any]], inside: Bool) -> list[GroupCondition]:
    """Return the conditions that may divide robots, at most `CUTS` of each numeric feature."""
    found = []
    for feature, values in columns.items():
        known = [value for value in compress(values, inside) if value is not None]
        kinds = {type(value) for value in known}
        if known and kinds <= {int, float}:
            shares = np.linspace(0, 1, CUTS + 2)[1:-1]
            cuts = np.unique(np.quantile(known, shares, method="inverted_cdf"))
            cuts = cuts[cuts < max(known)]
            found += [GroupCondition(feature, cut, True) for cut in cuts.tolist()]
        else:
            found += [GroupCondition(feature, value, False) for value in dict.fromkeys(known)]
    return found


def _p_of_split(values: F64, met: Bool, homes: I64) -> float:
    """Return the p value of a difference of means between robots, some of which share a home.

    The standard error is taken over homes; NaN if there are too few homes or no variance.

    Args:
        values: float64 (robots,).
        met: Whether each is on the first side: bool (robots,).
        homes: The number of the home of each: int64 (robots,).
    """
    other = ~met
    fewest = min(len(np.unique(homes[met])), len(np.unique(homes[other])))
    if fewest < 2:
        return math.nan
    with extra("study", "intervals need scipy"):
        from scipy.special import stdtr
    mean = values[met].mean()
    other_mean = values[other].mean()
    shares = np.where(met, (values - mean) / met.sum(), (other_mean - values) / other.sum())
    of_homes = np.bincount(homes, shares)
    count = len(np.unique(homes))
    variance = float((of_homes**2).sum()) * count / (count - 1)
    if not variance > 0:
        return math.nan
    ratio = abs(float(mean - other_mean)) / math.sqrt(variance)
    return float(2 * stdtr(fewest - 1, -ratio))


def groups(
    study: StudyAnswers, metric: str, against: Mapping[str, Any] | None = None
) -> "pl.DataFrame":
    """Return the groups of robots that differ by a metric, or by its difference to a reference.

    Returns:
        A row for each group: group (its conditions), robots (that tested it), mean, low and high
        (95 % for all groups together), doubt, p (of its split, after Holm). No rows if none differ.

    Raises:
        InputError: The study has no fleet, or no such metric or axis.
    """
    import polars as pl

    robots = by_robot(study, metric, against)
    columns = {name: robots[name].to_list() for name in features_of(study)}
    homes = robots[study.populations[0]].to_list()
    rows = [
        {
            "group": " and ".join(map(str, group.conditions)),
            "robots": group.robots,
            "mean": group.estimate.mean,
            "low": group.low,
            "high": group.high,
            "doubt": group.estimate.doubt,
            "p": group.p,
        }
        for group in find_groups(robots["value"].to_numpy(), columns, homes)
    ]
    kinds = dict.fromkeys(("mean", "low", "high", "p"), pl.Float64)
    schema = {"group": pl.String, "robots": pl.Int64, **kinds, "doubt": pl.String}
    return pl.DataFrame(rows, schema=schema)


def with_fleet(study: StudyAnswers, answer: Conclusion) -> Conclusion:
    """Return the answer of a study, extended by the answers about its fleet."""
    if not study.meta.fleet or not study.counts.complete:
        return answer
    compared = next(iter(StudyAnswer(study).asked), None)
    if compared is None and not study.metrics:
        return answer
    judged = [name for name in study.metrics if study.better(name)] or list(study.metrics)
    metric = compared.metric if compared else judged[0]
    against = compared.against if compared else None
    robots = len(by_robot(study, metric))
    sentences = list(answer.sentences[:-1])
    if robots >= FEWEST:
        sentences += [_groups(study, metric, against), _spread(study, metric)]
        if study.better(metric):
            sentences.append(_worst(study, metric))
    else:
        sentences.append(f"Percentiles and groups take {FEWEST} robots or more.")
    table = answer.table
    if compared is None and robots >= FEWEST:
        table = tuple(_percentile_row(study, name) for name in study.metrics[: len(answer.table)])
    return replace(answer, sentences=(*sentences, *answer.sentences[-1:]), table=table)


def _percentile_row(study: StudyAnswers, metric: str) -> dict[str, Any]:
    (mean,) = study.summary(metric, []).select("mean", "low", "high", "doubt").to_dicts()
    rows = percentiles(study, metric).to_dicts()
    shares = {f"p{row['percent']}": row["value"] for row in rows}
    return {"number": study.meta.with_unit(metric), **mean, **shares}


def _spread(study: StudyAnswers, metric: str) -> str:
    rows = {row["percent"]: row for row in percentiles(study, metric).to_dicts()}
    robots = len(by_robot(study, metric))
    unit = study.meta.with_unit(metric).removeprefix(metric)
    return (
        f"Of {robots:,} robots half have a {metric} up to {number(rows[50]['value'])}{unit}; one in"
        f" a hundred has up to {_bound(rows[1])}, and one in a hundred from {_bound(rows[99])} on."
    )


def _bound(row: Mapping[str, Any]) -> str:
    low, high = ["?" if row[end] is None else number(row[end]) for end in ("low", "high")]
    return f"{number(row['value'])} ({low} to {high})"


def _worst(study: StudyAnswers, metric: str) -> str:
    rows = worst(study, metric)
    names = ", ".join(map(str, rows[VARIANT].head(MAX_NAMED)))
    more = ", …" if len(rows) > MAX_NAMED else ""
    return (
        f"The worst 1 % ({counted(len(rows), 'robot')}): variant {names}{more}."
        f" `{rows['command'][0]}` runs the first again, and `fleet2d view worst{rows[VARIANT][0]}`"
        " opens it."
    )


def _groups(study: StudyAnswers, metric: str, against: Mapping[str, Any] | None) -> str:
    of = metric
    if against:
        of = f"the difference of {metric} to {next(iter(against.values()))}"
    found = groups(study, metric, against).sort("mean").to_dicts()
    if not found:
        return f"No group of homes or people was found in which {of} differs."
    parts = []
    for row in (found[0], found[-1]):
        mean = number(row["mean"])
        if not row["doubt"]:
            mean += f" ({number(row['low'])} to {number(row['high'])})"
        parts.append(f"{mean} where {row['group']}")
    return (
        f"Groups found on half of the homes, and tested on the others: {of} is least, {parts[0]},"
        f" and most, {parts[1]}."
    )
