"""Making a failure smaller: a shorter life, fewer people and interventions that still fail."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import Any

from fleet2d.errors import Fleet2DError
from fleet2d.scenario.model import load_scenario
from fleet2d.testing.claim import Variant
from fleet2d.testing.life import Life
from fleet2d.testing.running import Body, run_life

SECTIONS = ("users", "robots", "objects", "algorithms", "metrics")
"""The sections whose entries are left out one by one."""
LEADS = tuple(timedelta(minutes=minutes) for minutes in (0, 1, 5, 15, 60, 240, 1440, 10_080))
"""How long before the failure a shorter life begins, tried in this order."""


@dataclass(frozen=True)
class Case:
    """A failing life, as little of it as is needed so far.

    Attributes:
        variant: The scenario.
        without: Numbers of interventions that are left out.
        life: What became of it.
    """

    variant: Variant
    without: frozenset[int]
    life: Life

    @property
    def words(self) -> str:
        """What is left: when, who, and how many interventions."""
        simulation = self.variant.scenario.simulation
        end = simulation.start + simulation.duration
        people = ", ".join(self.variant.scenario.users) or "nobody"
        number = f"{self.interventions} of {self.life.interventions} interventions"
        return (
            f"{simulation.start:%a %d %b %H:%M:%S} to {end:%a %d %b %H:%M:%S}, with {people}"
            f"{f', {number}' if self.life.interventions else ''}"
        )

    @property
    def interventions(self) -> int:
        """How many interventions are left."""
        return self.life.interventions - len(self.without)


class Shrinker:
    """Tries smaller versions of a failing life.

    A smaller one counts where one of the same expectations fails in it: one that fails otherwise,
    or can't be run, doesn't.
    """

    def __init__(self, body: Body, tries: int) -> None:
        """Begin.

        Args:
            body: The test.
            tries: How many lives may be run.
        """
        self._body, self.tries = body, tries

    def shrink(self, life: Life) -> Case:
        """Return the smallest failing version that is found of a failing life."""
        case = Case(life.variant, frozenset(), life)
        for smaller in (_shorter, self._later, self._undone, self._fewer, _shorter):
            found = smaller(case)
            tried = found if isinstance(found, Case) else self._try(case, found, case.without)
            case = tried or case
        return case

    def _later(self, case: Case) -> Case:
        """Let the life begin as shortly before the failure as it still fails."""
        for variant in _later_starts(case):
            smaller = self._try(case, variant, case.without)
            if smaller is not None:
                return self._try(smaller, _shorter(smaller), smaller.without) or smaller
        return case

    def _fewer(self, case: Case) -> Case:
        """Leave out people, robots and things, one after the other."""
        for section in SECTIONS:
            for name in getattr(case.variant.scenario, section):
                variant = _without_entry(case.variant, section, name)
                case = self._try(case, variant, case.without) or case
        if case.variant.scenario.changes:
            case = self._try(case, _edited(case.variant, changes=[]), case.without) or case
        return case

    def _undone(self, case: Case) -> Case:
        """Leave out interventions, the last first."""
        for number in reversed(range(case.life.interventions)):
            case = self._try(case, case.variant, case.without | {number}) or case
        return case

    def _try(self, case: Case, variant: Variant | None, without: frozenset[int]) -> Case | None:
        """Return a version if it fails as the case does; None otherwise."""
        if variant is None or self.tries <= 0:
            return None
        self.tries -= 1
        try:
            life = run_life(variant, self._body, without=without)
        except Exception:  # noqa: BLE001 - what can't be run is no smaller version
            return None
        names = {failure.name for failure in case.life.failures}
        fails = any(failure.name in names for failure in life.failures)
        return Case(variant, without, life) if fails else None


def _shorter(case: Case) -> Variant | None:
    """Return the scenario up to the failure; None where it lasts no longer."""
    simulation = case.variant.scenario.simulation
    steps = case.life.failing_step + 1
    if steps >= simulation.steps:
        return None
    return _edited(case.variant, simulation={"duration": steps * simulation.step})


def _later_starts(case: Case) -> Iterator[Variant | None]:
    """Yield the scenario with later starts, the latest first."""
    simulation = case.variant.scenario.simulation
    end = simulation.start + simulation.duration
    failing = simulation.start + case.life.failing_step * simulation.step
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
    """Return a variant with some keys changed; None if it is no scenario then."""
    content = variant.scenario.resolved()
    for name, value in sections.items():
        content[name] = {**content[name], **value} if name == "simulation" else value
    try:
        return replace(variant, scenario=load_scenario(content))
    except Fleet2DError:
        return None
