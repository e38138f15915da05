"""Make a failing run smaller: shorter, with fewer people and interventions, still failing."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import Any

from fleet2d.errors import Fleet2DError
from fleet2d.scenario.model import load_scenario
from fleet2d.testing.claim import Variant
from fleet2d.testing.running import Body, run_trial
from fleet2d.testing.trials import TrialResult

SECTIONS = ("users", "robots", "objects", "algorithms", "metrics")
"""The sections of the scenario whose entries are left out one by one."""
LEADS = tuple(timedelta(minutes=minutes) for minutes in (0, 1, 5, 15, 60, 240, 1440, 10_080))
"""Times from the start of a shorter run to the failure, tried in this order."""


@dataclass(frozen=True)
class FailingCase:
    """A failing run, reduced so far.

    Attributes:
        variant: The scenario.
        without: Numbers of the interventions that are left out.
        result: The result of the run.
    """

    variant: Variant
    without: frozenset[int]
    result: TrialResult

    @property
    def text(self) -> str:
        """A summary: the time, the people, and the number of interventions."""
        simulation = self.variant.scenario.simulation
        end = simulation.start + simulation.duration
        people = ", ".join(self.variant.scenario.users) or "nobody"
        number = f"{self.interventions} of {self.result.interventions} interventions"
        return (
            f"{simulation.start:%a %d %b %H:%M:%S} to {end:%a %d %b %H:%M:%S}, with {people}"
            f"{f', {number}' if self.result.interventions else ''}"
        )

    @property
    def interventions(self) -> int:
        """Number of remaining interventions."""
        return self.result.interventions - len(self.without)


class Shrinker:
    """Tries smaller versions of a failing run.

    A smaller version counts if one of the same expectations fails in it, but not if another one
    fails, or if it can't be simulated.
    """

    def __init__(self, body: Body, tries: int) -> None:
        """Prepare.

        Args:
            body: The test.
            tries: Largest number of runs.
        """
        self._body, self.tries = body, tries

    def shrink(self, result: TrialResult) -> FailingCase:
        """Return the smallest failing version that it finds of a failing run."""
        case = FailingCase(result.variant, frozenset(), result)
        case = self._try(case, _shorter(case), case.without) or case
        for reduce in (self._later, self._undone, self._fewer):
            case = reduce(case)
        return self._try(case, _shorter(case), case.without) or case

    def _later(self, case: FailingCase) -> FailingCase:
        """Let the run begin as shortly before the failure as it still fails."""
        for variant in _later_starts(case):
            smaller = self._try(case, variant, case.without)
            if smaller is not None:
                return self._try(smaller, _shorter(smaller), smaller.without) or smaller
        return case

    def _fewer(self, case: FailingCase) -> FailingCase:
        """Leave out the people, robots, objects, algorithms and metrics not needed to fail."""
        for section in SECTIONS:
            for name in getattr(case.variant.scenario, section):
                variant = _without_entry(case.variant, section, name)
                case = self._try(case, variant, case.without) or case
        if case.variant.scenario.changes:
            case = self._try(case, _edited(case.variant, changes=[]), case.without) or case
        return case

    def _undone(self, case: FailingCase) -> FailingCase:
        """Leave out interventions, the last first."""
        for number in reversed(range(case.result.interventions)):
            case = self._try(case, case.variant, case.without | {number}) or case
        return case

    def _try(
        self, case: FailingCase, variant: Variant | None, without: frozenset[int]
    ) -> FailingCase | None:
        """Return a version if it fails as the case does; None otherwise."""
        if variant is None or self.tries <= 0:
            return None
        self.tries -= 1
        try:
            result = run_trial(variant, self._body, without=without)
        except Exception:  # noqa: BLE001 - a version that can't be simulated doesn't count
            return None
        names = {failure.name for failure in case.result.failures}
        fails = any(failure.name in names for failure in result.failures)
        return FailingCase(variant, without, result) if fails else None


def _shorter(case: FailingCase) -> Variant | None:
    """Return the scenario up to the failure; None if it already ends there."""
    simulation = case.variant.scenario.simulation
    steps = case.result.failing_step + 1
    if steps >= simulation.steps:
        return None
    return _edited(case.variant, simulation={"duration": steps * simulation.step})


def _later_starts(case: FailingCase) -> Iterator[Variant | None]:
    """Yield the scenario with later starts, the latest first."""
    simulation = case.variant.scenario.simulation
    end = simulation.start + simulation.duration
    failing = simulation.start + case.result.failing_step * simulation.step
    for lead in LEADS:
        start = (failing - lead).replace(second=0, microsecond=0)
        if simulation.start < start < end:
            times = {"start": start.isoformat(), "duration": end - start}
            yield _edited(case.variant, simulation=times)


def _without_entry(variant: Variant, section: str, name: str) -> Variant | None:
    entries = dict(getattr(variant.scenario, section))
    del entries[name]
    content = variant.scenario.resolved()[section]
    return _edited(variant, **{section: {key: content[key] for key in entries}})


def _edited(variant: Variant, **sections: Any) -> Variant | None:
    """Return a variant with some keys changed; None if that is not a valid scenario."""
    content = variant.scenario.resolved()
    for name, value in sections.items():
        content[name] = {**content[name], **value} if name == "simulation" else value
    try:
        return replace(variant, scenario=load_scenario(content))
    except Fleet2DError:
        return None
