"""A trial: a run that a test steers, and of which it says what is to hold."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

from fleet2d.engine.simulation import Simulation
from fleet2d.expectations.verdict import Verdict
from fleet2d.interventions.bodies import Decide, Drive
from fleet2d.interventions.intervention import Intervention
from fleet2d.scenario.model import Scenario
from fleet2d.testing.claim import Variant

ASSERT = "assert"
"""What a plain `assert` of a test is called among its expectations."""
NEXT_TO_NOTHING = 1e-9


class Trial(Simulation):
    """What a test function gets: a simulation.

    All that a simulation offers is there: `run_until`, `advance`, `put`, `send`, `call`, `shut`,
    `expect`, `state`, …. After the function it goes on until all that is expected is decided.
    """

    def __init__(
        self, scenario: Scenario, *, out: Path | None = None, without: Collection[int] = ()
    ) -> None:
        """Set it up.

        Args:
            scenario: What is simulated.
            out: Directory of the run; None: in memory.
            without: Numbers of interventions to leave out, counted from 0 in order.
        """
        super().__init__(scenario, out=out)
        self._without = frozenset(without)
        self.acts = 0

    def intervene(self, act: Intervention | Mapping[str, Any]) -> None:
        """Do something at the present step; see `Simulation.intervene`."""
        number = self.acts
        self.acts += 1
        # A body that is driven needs its plans.
        if number not in self._without or isinstance(act, Drive | Decide):
            super().intervene(act)

    @property
    def expected(self) -> list[str]:
        """The names of all that is expected."""
        known = self._state.expecting
        return [] if known is None else list(known.entries)

    def conclude(self) -> "tuple[Finding, ...]":
        """Simulate until all that is expected is decided, and return what became of it."""
        if not self.expected:
            return ()
        minute = max(1, timedelta(minutes=1) // self.scenario.simulation.step)
        while not self.done and not self._is_decided():
            self._run_to(min(self.clock.steps, self.step + minute))
            minute *= 2
        if self.done:
            self.finish()  # some metrics are known at the end alone
        return tuple(map(finding_of, self.verdicts().values()))

    def _is_decided(self) -> bool:
        verdicts = self.verdicts()
        return len(verdicts) == len(self.expected) and all(v.decided for v in verdicts.values())


@dataclass(frozen=True)
class Finding:
    """What became of one expectation in one life.

    Attributes:
        name: What the expectation is called: its name, or what it says.
        words: By how much it held or failed, and when.
        holds: Whether it held.
        margin: By how much it held, below 0 where it failed, from -1 to 1: comparable between
            expectations of different units.
        step: The first step of a violation; None if it held, or no step is to blame.
    """

    name: str
    words: str
    holds: bool
    margin: float
    step: int | None = None


SCALES = {"m": 1.0, "m/s": 0.5, "share": 0.1, "s": 60.0, "times": 1.0}
"""Margins that count as neither narrow nor wide, by unit; 1 for others."""
LASTING = ("always(", "never(", "at_most(")
"""Expectations that fail at the first step of a violation; others when their time is over."""


def finding_of(verdict: Verdict) -> Finding:
    """Return what became of an expectation, from its verdict."""
    step = None
    if verdict.violations:
        first = verdict.violations[0]
        step = first.first if verdict.expectation.startswith(LASTING) else first.last
    value, unit = verdict.robustness, verdict.unit
    if not math.isfinite(value) and verdict.slack_s is not None:
        value, unit = verdict.slack_s, "s"
    margin = comparable(value, SCALES.get(unit, 1.0))
    if (margin > 0) != verdict.holds:  # it came just in time, or just too late
        margin = math.copysign(NEXT_TO_NOTHING, 1.0 if verdict.holds else -1.0)
    twice = f"{verdict.expectation} is violated: {verdict.expectation}"  # one without a name
    words = str(verdict).replace(twice, f"{verdict.expectation} is violated")
    return Finding(verdict.name, words, verdict.holds, margin, step)


def comparable(value: float, scale: float) -> float:
    """Return a margin between -1 and 1: 0 stays 0, the scale comes to a half.

    >>> comparable(0.5, 1.0), comparable(float("-inf"), 1.0)
    (0.3333333333333333, -1.0)
    """
    return math.copysign(1.0, value) if math.isinf(value) else value / (abs(value) + scale)


@dataclass(frozen=True)
class Life:
    """What became of one trial.

    Attributes:
        variant: What was simulated.
        findings: One for each expectation.
        steps: How many steps were simulated.
        interventions: How many interventions there were.
        error: An assertion of the test that failed; None if none did.
    """

    variant: Variant
    findings: tuple[Finding, ...]
    steps: int
    interventions: int
    error: AssertionError | None = None

    @property
    def margin(self) -> float:
        """By how much all held, -1 to 1: the least of the margins; 1 if nothing is expected."""
        margins = [finding.margin for finding in (*self.findings, *self.failures)]
        return min(margins, default=1.0)

    @property
    def holds(self) -> bool:
        """Whether all held."""
        return self.error is None and all(finding.holds for finding in self.findings)

    @property
    def failures(self) -> tuple[Finding, ...]:
        """What failed, a failed `assert` among them."""
        failed = tuple(finding for finding in self.findings if not finding.holds)
        if self.error is None:
            return failed
        step = max(0, self.steps - 1)
        return (*failed, Finding(ASSERT, str(self.error) or ASSERT, False, -1.0, step))

    @property
    def failing_step(self) -> int:
        """The first step at which something failed."""
        steps = [failure.step for failure in self.failures if failure.step is not None]
        return min(steps, default=max(0, self.steps - 1))
