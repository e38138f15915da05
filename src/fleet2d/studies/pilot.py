"""Pilots: some variants of a study, run for a minute, show what a study of its size can tell."""

import math
import time
from collections.abc import Mapping
from contextlib import closing
from datetime import timedelta
from typing import TYPE_CHECKING, Any

from fleet2d.configuration.problems import counted
from fleet2d.errors import extra
from fleet2d.studies.answers import MAX_P, Comparison, StudyAnswers
from fleet2d.studies.driver import CheckedStudy, describe, result_of_end
from fleet2d.studies.executors import Crew, run_tasks
from fleet2d.studies.intervals import ENOUGH_UNITS, MeanEstimate, plural
from fleet2d.studies.results import VARIANT, results_frame
from fleet2d.studies.sentences import Conclusion, StudyAnswer, in_words, listed, number

if TYPE_CHECKING:
    import polars as pl

    from fleet2d.studies.specification import PairedComparison

PILOT_S = 60.0
# The number of combinations of home, people and seed in a pilot.
PILOT_UNITS = 12
RESERVE = 0.9  # the share of pilots for which the assumed variance is large enough
MAX_OTHERS = 2  # the most values that a pilot compares with the reference


class Pilot(StudyAnswers):
    """Some variants of a study that were complete in time.

    Attributes:
        whole: The labels of all variants of the study, with their simulated times.
    """

    def __init__(self, checked: CheckedStudy) -> None:
        """Prepare a pilot of a study whose variants haven't run."""
        import polars as pl

        self.location = "the pilot"
        self.meta = describe(checked)
        self.columns = self.meta.columns
        self.populations = self.meta.populations
        self._checked = checked
        design = checked.plan.design
        of_variants = [design.parameters(index) for index in checked.plan.variants["index"]]
        labels = pl.DataFrame(of_variants, infer_schema_length=None)
        self.whole = checked.plan.variants.hstack(labels.drop("seed"))
        self._results = results_frame(())

    @property
    def comparisons(self) -> "tuple[PairedComparison, ...]":
        """The comparisons that the study file asks for."""
        return self._checked.specification.file.compare

    @property
    def variants(self) -> "pl.DataFrame":
        """The variants that were complete in time."""
        plan = self.whole.select(VARIANT, "simulated_s", *self.columns)
        return plan.join(self._results.drop("identity", strict=False), on=VARIANT)

    def chosen(self) -> "pl.DataFrame":
        """Return the variants of the pilot: some units, each with the values to compare."""
        import polars as pl

        references: dict[str, Any] = {}
        for comparison in self.comparisons:
            references |= comparison.against
        rows = self.whole
        for axis in (column for column in self.columns if column not in self.populations):
            values = rows[axis].unique(maintain_order=True).to_list()
            count = 1 + (MAX_OTHERS if axis in references or not references else 0)
            first = [references[axis]] if axis in references else []
            kept = list(dict.fromkeys([*first, *values]))[:count]
            rows = rows.filter(pl.col(axis).is_in(kept, nulls_equal=True))
        # Homes and seeds grow in number together, so that the variance of both is seen.
        ranks = [pl.col(column).rank("dense") for column in self.populations]
        rows = rows.with_columns(largest=pl.max_horizontal(ranks), all=pl.sum_horizontal(ranks))
        units = rows.select(*self.populations, "largest", "all").unique(maintain_order=True)
        units = units.sort("largest", "all", maintain_order=True).head(PILOT_UNITS)
        return units.join(rows, on=self.populations, nulls_equal=True, maintain_order="left")

    def run(self, crew: Crew, seconds: float = PILOT_S) -> None:
        """Run variants until the time is over."""
        end_s = time.monotonic() + seconds
        rows = []
        plan = self._checked.plan
        with closing(run_tasks(crew, self._checked.job, plan.queue(self.chosen()))) as rounds:
            for ends in rounds:
                rows += [result_of_end(end).row for end in ends]
                if time.monotonic() >= end_s:
                    break
        self._results = results_frame(rows)

    def answer(self, workers: int) -> Conclusion:
        """Return the effects that the study can show, and its time on a number of workers."""
        tried = counted(len(self._results), "run")
        question = f"What can {self.meta.name} tell?"
        if not self.counts.complete:
            failed = self._results["error"].drop_nulls().head(1).to_list()
            why = f"all failed: {failed[0]}" if failed else "a run takes longer"
            return Conclusion(question, (f"A pilot of a minute can't say, as {why}.",))
        wall_s = float(self.complete["wall_s"].mean()) * len(self.whole) / workers
        took = in_words(timedelta(seconds=wall_s))
        whole = counted(len(self.whole), "run")
        cost = f"By a pilot of {tried}, its {whole} take {took} on {counted(workers, 'worker')}."
        sizes = {kind: self.whole[kind].n_unique() for kind in self.populations}
        kind = next((kind for kind, count in sizes.items() if count > 1), "seed")
        enough = {**sizes, kind: max(sizes[kind], ENOUGH_UNITS)}
        study = StudyAnswer(self)
        if not study.asked:
            means = f"from {ENOUGH_UNITS} {plural(kind)} on it tells means with intervals"
            return Conclusion(question, (cost, f"It compares nothing; {means}."))
        found = study.comparisons
        parts = [part for c in found if (part := self._detects(c, enough))]
        shown = f"in four of five studies {enough[kind]} {plural(kind)} show"
        if parts:
            says = (
                f"By its variance, with a reserve, {shown} {listed(parts, 'difference')}; fewer do"
                " if rare homes differ much."
            )
        else:
            says = (
                "For what differences show, two of its homes or seeds must be complete and differ."
            )
        few = self._few_units_text(kind, sizes[kind], max(1, len(found)))
        return Conclusion(question, tuple(filter(None, (cost, few, says))))

    def _few_units_text(self, kind: str, count: int, comparisons: int) -> str:
        """Return what a study with too few units for intervals can tell; empty if it has enough."""
        if count >= ENOUGH_UNITS:
            return ""
        tests = (MeanEstimate(1.0, signs={kind: (n, count - n)}) for n in range(count + 1))
        clear = [max(t.signs[kind]) for t in tests if t.sign_p < MAX_P / comparisons]
        units = f"From {count} {kind if count == 1 else plural(kind)}"
        if not clear:
            return f"{units} it can tell nothing, as even if all agree that may be chance."
        return f"{units} it tells no amounts, and which is better only if {min(clear)} agree."

    def _detects(self, c: Comparison, sizes: Mapping[str, int]) -> str:
        """Return the smallest difference that the whole study shows; empty if it isn't known."""
        units = {kind: sizes[kind] for kind in c.estimate.spread.units}
        smallest = smallest_shown(c.estimate, units, 1 - MAX_P / c.number) if units else 0.0
        if not smallest:
            return ""
        (axis, value), *_ = c.labels.items()
        unit = self.meta.unit(c.metric)
        amount = f"{number(smallest)} [{unit}]" if unit else number(smallest)
        return (
            f"a difference of {amount} in {c.metric} between {axis} = {value} and {c.reference}"
            f" (here it is {number(abs(c.difference))})"
        )


def smallest_shown(pilot: MeanEstimate, units: Mapping[str, int], level: float) -> float:
    """Return the smallest mean that four of five studies show, by the variance of a pilot.

    The variance of so small a sample is uncertain: the upper end of its interval is used.

    Args:
        pilot: The mean of the pilot.
        units: The number of units of each kind of the study.
        level: The level of its intervals.
    """
    with extra("study", "intervals need scipy"):
        from scipy.special import chdtri
    reserve = math.sqrt(pilot.freedom / chdtri(pilot.freedom, RESERVE))
    return reserve * pilot.spread.detectable(units, level=level)
