"""What a study will take: measured on the beginning of some of its variants."""

from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta

from fleet2d.errors import ComponentError
from fleet2d.studies.engine import measure
from fleet2d.studies.plan import Plan

SAMPLES = 3


@dataclass(frozen=True)
class Forecast:
    """What a study will take.

    Attributes:
        simulated: Simulated time of all variants.
        wall: Wall time of all variants, one after the other.
    """

    simulated: timedelta
    wall: timedelta

    def by(self, workers: int) -> timedelta:
        """Return the wall time by so many workers at a time."""
        return self.wall / max(workers, 1)


def forecast(plan: Plan, samples: int = SAMPLES) -> Forecast:
    """Measure how fast some variants begin; the first of each is not counted, for it loads code.

    Raises:
        ComponentError: All variants that are begun fail.
    """
    count = len(plan.variants)
    chosen = sorted({round(i * (count - 1) / max(samples - 1, 1)) for i in range(samples)})
    measure(plan.design.scenario(0), most_s=0.0)
    paces = []
    for i in chosen:
        with suppress(ComponentError):  # a variant may fail, and the study go on
            paces.append(measure(plan.design.scenario(plan.variants[i].index)))
    if not paces:
        raise ComponentError("none of the variants that were begun can be run: run one by itself")
    wall_s = sum(
        sum(pace.seconds(variant.simulated_s) for pace in paces) / len(paces)
        for variant in plan.variants
    )
    simulated_s = sum(variant.simulated_s for variant in plan.variants)
    return Forecast(timedelta(seconds=simulated_s), timedelta(seconds=wall_s))
