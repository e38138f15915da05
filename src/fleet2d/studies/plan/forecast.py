"""The time that a study will take, measured on the beginning of some of its variants."""

from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta

from fleet2d.errors import ComponentError
from fleet2d.studies.plan.study_plan import StudyPlan
from fleet2d.studies.simulator import measure
from fleet2d.sums import sum_in_order

SAMPLES = 3


@dataclass(frozen=True)
class Forecast:
    """The time that a study will take.

    Attributes:
        simulated: The simulated time of all variants.
        wall: The wall time of all variants with one worker.
    """

    simulated: timedelta
    wall: timedelta

    def by(self, workers: int) -> timedelta:
        """Return the wall time with a number of workers."""
        return self.wall / max(workers, 1)


def forecast(plan: StudyPlan, samples: int = SAMPLES) -> Forecast:
    """Measure the speed of some variants, after a warm-up that loads all code.

    Raises:
        ComponentError: All measured variants fail.
    """
    count = len(plan.variants)
    numbers = sorted({round(i * (count - 1) / max(samples - 1, 1)) for i in range(samples)})
    measure(plan.design.scenario(0), most_s=0.0)
    speeds = []
    for i in numbers:
        with suppress(ComponentError):  # a variant may fail without ending the study
            speeds.append(measure(plan.design.scenario(plan.variants[i].index)))
    if not speeds:
        raise ComponentError("all measured variants fail: run one of them with `fleet2d run`")
    wall_s = sum_in_order(
        sum_in_order(speed.seconds(variant.simulated_s) for speed in speeds) / len(speeds)
        for variant in plan.variants
    )
    simulated_s = sum(variant.simulated_s for variant in plan.variants)
    return Forecast(timedelta(seconds=simulated_s), timedelta(seconds=wall_s))
