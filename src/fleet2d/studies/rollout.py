"""Rollouts: a change that reaches a fleet in stages, and what each day shows of its effect.

On each day robots with the change are compared with those without it yet, as in the field: stages
are drawn at random. Intervals hold on all days and for all metrics together, however often one
looks: the level is divided among them, which no dependence between days can break, and costs little
for some weeks. The simulator also knows what the robots with the change would have done without.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from fleet2d.errors import InputError
from fleet2d.kernels import F64, I64, Bool
from fleet2d.studies.answers import StudyAnswers
from fleet2d.studies.design import WITH
from fleet2d.studies.intervals import ENOUGH_UNITS, LEVEL, two_sample_interval
from fleet2d.studies.sentences import Conclusion, number
from fleet2d.studies.simulator import DAILY
from fleet2d.studies.specification import NEVER, ROLLOUT, STAGE, Bounds, Rollout

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

DAY_S = 86_400


@dataclass(frozen=True)
class RolloutLook:
    """The evidence on a metric at the end of a day.

    Attributes:
        day: The number of days since the start of the runs.
        treated: The number of robots with the change.
        others: The number of robots without it.
        difference: The mean of robots with the change minus that of the others; NaN if one is
            missing.
        low: The lower end of the interval; NaN if there are too few robots.
        high: Its upper end.
        truth: The true effect: the mean difference of robots with the change from their own runs
            without it.
        without: The mean of the same robots in their runs without the change.
    """

    day: int
    treated: int
    others: int
    difference: float
    low: float
    high: float
    truth: float
    without: float

    def breaks(self, bounds: Bounds) -> bool:
        """Whether the whole interval is beyond the bounds."""
        above = bounds.most is not None and self.low > bounds.most
        return above or (bounds.least is not None and self.high < bounds.least)


def looks_of(
    without: F64, treated: F64, begins: I64, level: float, days: Sequence[int]
) -> list[RolloutLook]:
    """Return the evidence on a metric at the end of each of some days.

    Args:
        without: The metric at the end of each day without the change: float64 (robots, days).
        treated: The same with the change, from its stage on: float64 (robots, days).
        begins: The first day with the change, from 0 on; large for never: int64 (robots,).
        level: The share of single intervals that contain the true difference.
        days: The days, from 0 on.
    """
    first = int(begins.min())
    before = without[:, first - 1] if first > 0 else np.zeros(len(without))
    looks = []
    for day in days:
        is_treated: Bool = begins <= day
        otherwise = without[:, day]
        seen = np.where(is_treated, treated[:, day], otherwise)
        known = np.isfinite(seen) & np.isfinite(otherwise) & np.isfinite(before)
        with_change = is_treated & known
        without_change = ~is_treated & known
        own = int(with_change.sum())
        others = int(without_change.sum())
        difference = low = high = truth = mean_without = math.nan
        if own:
            truth = float((seen - otherwise)[with_change].mean())
            mean_without = float(otherwise[with_change].mean())
        if own and others:
            adjusted = seen - _slope(seen[known], before[known], is_treated[known]) * before
            difference = float(adjusted[with_change].mean() - adjusted[without_change].mean())
            if min(own, others) >= ENOUGH_UNITS:
                low, high = two_sample_interval(
                    adjusted[with_change], adjusted[without_change], level
                )
        look = RolloutLook(day + 1, own, others, difference, low, high, truth, mean_without)
        looks.append(look)
    return looks


def _slope(values: F64, before: F64, is_treated: Bool) -> float:
    """Return the slope of values over those before the rollout, by which values are adjusted."""
    centred = before - np.where(is_treated, before[is_treated].mean(), before[~is_treated].mean())
    square = float((centred**2).sum())
    return float((centred * values).sum()) / square if square > 0 else 0.0


class RolloutAnswer:
    """The answer of a study about its rollout.

    Attributes:
        settings: The rollout.
        start: When the runs begin.
        days: The days on which robots with the change and without it are compared, from 0 on.
    """

    def __init__(self, study: StudyAnswers) -> None:
        """Read the daily numbers.

        Raises:
            InputError: The study has no rollout, or no robot has complete runs.
        """
        if study.meta.rollout is None:
            raise InputError(f"{study.location} has no rollout")
        self._study = study
        self.settings = Rollout.model_validate(study.meta.rollout)
        self.metrics = self.settings.metrics
        self._rows = self._robots()
        if not len(self._rows):
            raise InputError(f"{study.location}: no robot is complete, with the change and without")
        scenario = study.scenario(int(self._rows["variant"][0]))
        self.start = datetime.fromisoformat(str(scenario["simulation"]["start"]))
        stages = self._rows[STAGE].to_list()
        self._begins = np.array([self._first_day(stage) for stage in stages], np.int64)
        self._values = {metric: self._days_of(metric) for metric in self.metrics}
        last = min(values[0].shape[1] for values in self._values.values())
        first = int(self._begins.min())
        waiting = [day for day in range(first, last) if (self._begins > day).any()]
        self.days = waiting or [*range(first, last)]

    def _robots(self) -> "pl.DataFrame":
        """Return robots with complete runs: number, stage, variants without and with the change."""
        import polars as pl

        study = self._study
        fleet = study.meta.fleet
        frame = study.complete.select(fleet, STAGE, "variant", ROLLOUT)
        without = frame.filter(pl.col(ROLLOUT) != WITH).drop(ROLLOUT)
        with_it = frame.filter(pl.col(ROLLOUT) == WITH).select(fleet, treated="variant")
        joined = without.group_by(fleet, maintain_order=True).first()
        both = joined.join(
            with_it.group_by(fleet).first(), on=fleet, how="left", maintain_order="left"
        )
        is_whole = pl.col("treated").is_not_null() | (pl.col(STAGE) == NEVER)
        return both.filter(is_whole)

    def _first_day(self, stage: str) -> int:
        if stage == NEVER:
            return 1 << 40
        return max(0, (datetime.fromisoformat(stage) - self.start) // timedelta(days=1))

    def _days_of(self, metric: str) -> tuple[F64, F64]:
        """Return a metric without the change and with it: float64 (robots, days) each."""
        import polars as pl

        rows = self._study.polars(DAILY).filter(metric=metric).select("variant", "day", "value")
        frame = rows.collect()
        if not len(frame):
            raise InputError(f"no run has a number {metric} on any day")
        count = int(frame["day"].max()) + 1
        sides = []
        for column in ("variant", "treated"):
            places = self._rows.select(
                pl.col(column).alias("variant"), robot=pl.int_range(pl.len())
            )
            own = frame.join(places.drop_nulls("variant"), on="variant", how="inner")
            values = np.full((len(self._rows), count), np.nan)
            values[own["robot"].to_numpy(), own["day"].to_numpy()] = own["value"].to_numpy()
            sides.append(values)
        without, treated = sides
        return without, np.where(np.isnan(treated), without, treated)

    @cached_property
    def looks(self) -> dict[str, list[RolloutLook]]:
        """The evidence on each metric, day by day."""
        level = 1 - (1 - LEVEL) / (len(self.days) * len(self.metrics))
        return {
            metric: looks_of(*self._values[metric], self._begins, level, self.days)
            for metric in self.metrics
        }

    @cached_property
    def stop(self) -> tuple[str, RolloutLook] | None:
        """The guard that stops the rollout first, with the evidence; None if no guard does."""
        breaks = [
            (look.day, metric, look)
            for metric, bounds in self.settings.guards.items()
            for look in self.looks[metric]
            if look.breaks(bounds)
        ]
        return min(breaks, key=lambda each: each[:2])[1:] if breaks else None

    def date_of(self, day: int) -> date:
        """Return the date of a day, from 1 on."""
        return (self.start + timedelta(days=day - 1)).date()

    @property
    def sentences(self) -> list[str]:
        """Sentences on the rollout: its course, when and why it stopped, and the truth."""
        begins = [self._first_day(stage) for stage in self._rows[STAGE].unique().to_list()]
        stages = [
            f"{int((self._begins == day).sum()):,} from {self.date_of(day + 1)} on"
            for day in sorted(begins)
            if day < len(self.days) + max(self.days) + 1
        ]
        texts = [f"The change reaches {', '.join(stages)}, of {len(self._rows):,} robots."]
        if self.stop is not None:
            metric, look = self.stop
            texts.append(
                f"It is stopped after {self.date_of(look.day)} by the guard of {metric}: with the"
                f" change it is {self._words(look)} than without, and {self._bounds(metric)} is"
                " allowed."
            )
        elif self.settings.guards:
            texts.append(self._not_stopped())
        last = self.stop[1].day if self.stop else self.days[-1] + 1
        texts += [self._watched(metric, last) for metric in self.settings.watch]
        if self.stop is not None:
            texts.append(self._had_it_gone_on(self.stop[0]))
        return texts

    def _watched(self, metric: str, day: int) -> str:
        """Return a sentence on the evidence on a metric on a day, and on the truth."""
        look = next(each for each in self.looks[metric] if each.day == day)
        on = f"On {self.date_of(day)}"
        if not look.treated:
            return f"{on} no robot with the change has a {metric}."
        if look.others:
            known = (
                f"{metric} is {self._words(look)} for the {look.treated:,} robots with the change"
                f" than for the {look.others:,} without"
            )
        else:
            known = f"all {look.treated:,} robots with a {metric} have the change: none to compare"
        return (
            f"{on} {known}. The simulator knows that it is {_size(look.truth)} by the change:"
            f" without it these robots would have {number(look.without)}."
        )

    def _had_it_gone_on(self, metric: str) -> str:
        """Return what the stages after a stop would have done: the runs have all stages."""
        without, treated = self._values[metric]
        (look,) = looks_of(without, treated, self._begins, LEVEL, [without.shape[1] - 1])
        return (
            f"Had it gone on, {metric} would be {_size(look.truth)} on {self.date_of(look.day)} for"
            f" {look.treated:,} robots."
        )

    def _not_stopped(self) -> str:
        """Return which guards didn't stop the rollout, and which never could have."""
        seen: list[str] = []
        blind: list[str] = []
        for metric in self.settings.guards:
            is_blind = all(math.isnan(look.low) for look in self.looks[metric])
            kind = blind if is_blind else seen
            kind.append(metric)
        parts = []
        if seen:
            parts.append(f"No guard stops it: {', '.join(seen)}.")
        if blind:
            parts.append(
                f"The guard of {', '.join(blind)} can't be told on any day: there are never"
                f" {ENOUGH_UNITS} robots on both sides that differ."
            )
        return " ".join(parts)

    def _words(self, look: RolloutLook) -> str:
        size = _size(look.difference)
        if math.isnan(look.low):
            return f"{size} (how much in all robots can't be told from so few)"
        return f"{size} (difference {look.low:.3g} to {look.high:.3g}, on any day)"

    def _bounds(self, metric: str) -> str:
        bounds = self.settings.guards[metric]
        parts = []
        if bounds.most is not None:
            parts.append(f"at most {bounds.most:+g}")
        if bounds.least is not None:
            parts.append(f"at least {bounds.least:+g}")
        return " and ".join(parts)

    @property
    def table(self) -> "pl.DataFrame":
        """All looks: a row for each number and day.

        The intervals hold on any day, for all numbers together. `truth` is the true effect on the
        robots with the change, and `mean without it` their mean in runs without it.
        """
        import polars as pl

        rows = [
            {
                "number": metric,
                "date": str(self.date_of(look.day)),
                "with": look.treated,
                "without": look.others,
                "difference": look.difference,
                "low": look.low,
                "high": look.high,
                "doubt": "" if math.isfinite(look.low) else "too few robots",
                "truth": look.truth,
                "mean without it": look.without,
            }
            for metric, looks in self.looks.items()
            for look in looks
        ]
        return pl.DataFrame(rows, infer_schema_length=None)

    def figure(self) -> "Figure":
        """Draw each metric over the days: the evidence, the truth, and the bounds."""
        import matplotlib.pyplot as plt

        names = list(self.looks)
        size = (7, 2.6 * len(names))
        figure, axes = plt.subplots(len(names), 1, sharex=True, figsize=size, squeeze=False)
        for axis, metric in zip(axes[:, 0], names, strict=True):
            looks = self.looks[metric]
            days = [look.day for look in looks]
            low = [look.low for look in looks]
            high = [look.high for look in looks]
            axis.fill_between(days, low, high, alpha=0.25, lw=0, label="known, on any day")
            axis.plot(days, [look.difference for look in looks], lw=1)
            axis.plot(days, [look.truth for look in looks], "k--", lw=1, label="true")
            for day in np.unique(self._begins[self._begins <= self.days[-1]]).tolist():
                axis.axvline(day + 1, color="grey", lw=0.6)
            bounds = self.settings.guards.get(metric, Bounds())
            for end in (bounds.least, bounds.most):
                if end is not None:
                    axis.axhline(end, color="tab:red", lw=1, label="bounds")
            if self.stop is not None and self.stop[0] == metric:
                axis.axvline(self.stop[1].day, color="tab:red", lw=1.5)
            axis.axhline(0, color="grey", lw=0.4)
            axis.set_ylabel(self._study.meta.with_unit(metric).replace(" [", "\n["))
        axes[0, 0].legend(frameon=False, fontsize="small")
        axes[-1, 0].set_xlabel(f"day, from {self.start.date()} on")
        return figure


def _size(difference: float) -> str:
    if not difference:
        return "no different"
    return f"{number(abs(difference))} {'lower' if difference < 0 else 'higher'}"


def with_rollout(study: StudyAnswers, answer: Conclusion) -> Conclusion:
    """Return the answer of a study, extended by the answer about its rollout."""
    if not study.counts.complete:
        return answer
    try:
        found = RolloutAnswer(study)
    except InputError as error:
        return Conclusion(answer.question, (*answer.sentences, f"{error}."), answer.table)
    day = found.stop[1].day if found.stop else found.days[-1] + 1
    rows = found.table.filter(date=str(found.date_of(day))).to_dicts()
    end = [s for s in answer.sentences if s.startswith(("Clear", "It took"))]
    return Conclusion(answer.question, (*found.sentences, *end), tuple(rows))
