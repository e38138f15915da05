"""Trials: simulations that a test controls, with its expectations, and their results."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

from fleet2d.engine.simulation import Simulation
from fleet2d.expectations.verdict import Verdict
from fleet2d.interventions.bodies import Decide, TakeControl
from fleet2d.interventions.intervention import Intervention
from fleet2d.scenario.model import Scenario
from fleet2d.testing.claim import Variant

ASSERT = "assert"
"""The name of a failed `assert` of a test among its expectations."""
SMALLEST_MARGIN = 1e-9


class Trial(Simulation):
    """The simulation that a test function gets.

    It has all methods of a simulation: `run_until`, `advance`, `put`, `send`, `call`, `shut`,
    `expect`, `state`, …. After the function it runs on until all expectations are decided.
    """

    def __init__(
        self, scenario: Scenario, *, out: Path | None = None, without: Collection[int] = ()
    ) -> None:
        """Set up the simulation.

        Args:
            scenario: The scenario.
            out: Directory of the run; None: in memory.
            without: Numbers of interventions to leave out, in order from 0.
        """
        super().__init__(scenario, out=out)
        self._without = frozenset(without)
        self.acts = 0

    def intervene(self, act: Intervention | Mapping[str, Any]) -> None:
        """Intervene at the present step; see `Simulation.intervene`."""
        number = self.acts
        self.acts += 1
        # The commands of a driven body can't be left out: it would have no plan.
        if number not in self._without or isinstance(act, TakeControl | Decide):
            super().intervene(act)

    @property
    def expected(self) -> list[str]:
        """The names of the expectations."""
        expectations = self._state.expectations
        return [] if expectations is None else list(expectations.entries)

    def conclude(self) -> "tuple[ExpectationResult, ...]":
        """Simulate until all expectations are decided, and return their results."""
        if not self.expected:
            return ()
        minute = max(1, timedelta(minutes=1) // self.scenario.simulation.step)
        while not self.done and not self._is_decided():
            self._run_to(min(self.clock.steps, self.step + minute))
            minute *= 2
        if self.done:
            self.finish()  # some metrics are known at the end only
        return tuple(map(result_of, self.verdicts().values()))

    def _is_decided(self) -> bool:
        verdicts = self.verdicts()
        return len(verdicts) == len(self.expected) and all(v.decided for v in verdicts.values())


@dataclass(frozen=True)
class ExpectationResult:
    """The result of one expectation in one trial.

    Attributes:
        name: The name of the expectation, or its text.
        text: By how much it held or failed, and when.
        holds: Whether it held.
        margin: Margin by which it held, below 0 if it failed, from -1 to 1: comparable between
            expectations of different units.
        step: The first step of a violation; None if it held, or if it failed at no single step.
    """

    name: str
    text: str
    holds: bool
    margin: float
    step: int | None = None


SCALES = {"m": 1.0, "m/s": 0.5, "share": 0.1, "s": 60.0, "times": 1.0}
"""Margins that count as neither narrow nor wide, by unit; 1 for others."""
LASTING = ("always(", "never(", "at_most(")
"""Expectations that fail at the first step of a violation; others fail at their deadline."""


def result_of(verdict: Verdict) -> ExpectationResult:
    """Return the result of an expectation from its verdict."""
    step = None
    if verdict.violations:
        first = verdict.violations[0]
        step = first.first if verdict.expectation.startswith(LASTING) else first.last
    value, unit = verdict.robustness, verdict.unit
    if not math.isfinite(value) and verdict.slack_s is not None:
        value, unit = verdict.slack_s, "s"
    margin = comparable(value, SCALES.get(unit, 1.0))
    if (margin > 0) != verdict.holds:  # it was fulfilled just in time, or just too late
        margin = math.copysign(SMALLEST_MARGIN, 1.0 if verdict.holds else -1.0)
    repeated = f"{verdict.expectation} is violated: {verdict.expectation}"  # without a name
    text = str(verdict).replace(repeated, f"{verdict.expectation} is violated")
    return ExpectationResult(verdict.name, text, verdict.holds, margin, step)


def comparable(value: float, scale: float) -> float:
    """Return a margin scaled to -1 … 1: 0 stays 0, `scale` becomes 1/2.

    >>> comparable(0.5, 1.0), comparable(float("-inf"), 1.0)
    (0.3333333333333333, -1.0)
    """
    return math.copysign(1.0, value) if math.isinf(value) else value / (abs(value) + scale)


@dataclass(frozen=True)
class TrialResult:
    """The result of one trial.

    Attributes:
        variant: The scenario.
        results: The results of the expectations.
        steps: Number of simulated steps.
        interventions: Number of interventions.
        error: The failed `assert` of the test; None if all held.
    """

    variant: Variant
    results: tuple[ExpectationResult, ...]
    steps: int
    interventions: int
    error: AssertionError | None = None

    @property
    def margin(self) -> float:
        """The least margin of all expectations, -1 to 1; 1 without expectations."""
        margins = [result.margin for result in (*self.results, *self.failures)]
        return min(margins, default=1.0)

    @property
    def holds(self) -> bool:
        """Whether all expectations held."""
        return self.error is None and all(result.holds for result in self.results)

    @property
    def failures(self) -> tuple[ExpectationResult, ...]:
        """The results that failed, with one for a failed `assert`."""
        failed = tuple(result for result in self.results if not result.holds)
        if self.error is None:
            return failed
        step = max(0, self.steps - 1)
        return (*failed, ExpectationResult(ASSERT, str(self.error) or ASSERT, False, -1.0, step))

    @property
    def failing_step(self) -> int:
        """The first step of a failure."""
        steps = [failure.step for failure in self.failures if failure.step is not None]
        return min(steps, default=max(0, self.steps - 1))
