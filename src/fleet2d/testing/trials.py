"""Trials of a claim: simulations under test, run until it is decided."""

import dis
import inspect
import math
import traceback
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from pathlib import Path
from typing import Any

from fleet2d.artifacts.store import ArtifactSettings
from fleet2d.configuration.problems import counted
from fleet2d.engine.access import evidence_of
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import errors_as
from fleet2d.expectations.expectation import Expectation, Term
from fleet2d.expectations.parse import read_requirements
from fleet2d.expectations.temporal import after, at_end, eventually, until
from fleet2d.expectations.verdict import Verdict, VerdictEvidence, amount
from fleet2d.floorplan.home import HOME_CACHE
from fleet2d.floorplan.source import PLAN_CACHE
from fleet2d.interventions.intervention import Intervention, dump_intervention
from fleet2d.scenario.model import Scenario
from fleet2d.testing.claim import Claim, SetUpError, Variant, nested_rate_interval, percent

TEST = "test"
"""The name, among the expectations, of a test that tests nothing."""
MISSED = "missed"
MISSED_BY_THE_END = "missed by the end"
"""Kinds of violation: something never came about in its time, or by the end of the run."""
ASSERT = "assert"
"""The name, among the expectations, of a failed `assert`."""
SMALLEST_MARGIN = 1e-9
SCALES = {"m": 1.0, "m/s": 0.5, "share": 0.1, "s": 60.0, "times": 1.0}
"""Margins that count as neither narrow nor wide, by unit; 1 for others."""
LASTING = ("always(", "never(", "at_most(")
"""Expectations that fail at the first step of a violation; others fail at their deadline."""
NOTHING_TESTED = "nothing is tested: there is no expectation, and no assert"
# The number of homes in memory.
MAX_HOMES = 32
NOTHING = ArtifactSettings(
    trajectories="off",
    key_frames=False,
    observations=False,
    events=False,
    outputs=False,
    checkpoint="off",
)


class Trial(Simulation):
    """The simulation that a test function gets.

    It has all methods of a simulation: `run_until`, `advance`, `do`, `expect`, `state`, …. After
    the function it runs on until all expectations are decided.
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
        self.acts: list[frozenset[str]] = []
        self._covers: dict[str, tuple[str, ...]] = {}

    def expect(
        self, expectation: Expectation | str, name: str = "", *, covers: Sequence[str] = ()
    ) -> str:
        """Add an expectation and the requirements that it covers; see `Simulation.expect`."""
        name = super().expect(expectation, name)
        self._covers[name] = read_requirements(covers)
        return name

    def do(self, act: Intervention | Mapping[str, Any]) -> None:
        """Apply an intervention at the present step; see `Simulation.do`."""
        number = len(self.acts)
        self.acts.append(names_in(act))
        # The commands of a driven body can't be left out: it would have no plan.
        if number not in self._without or _is_command(act):
            super().do(act)

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
        expectations = self._state.expectations
        assert expectations is not None
        while not self.done:
            self._state.settle(self.step)
            if expectations.are_decided:
                break
            self._run_to(min(self.clock.steps, self.step + minute))
            minute *= 2
        if self.done:
            self.finish()  # some metrics are known at the end only
        results = []
        for name, verdict in self.verdicts().items():
            result = result_of(verdict, expectations.entries[name].expectation)
            evidence = evidence_of(self, name) if verdict.fails else None
            results.append(replace(result, evidence=evidence, covers=self._covers.get(name, ())))
        return tuple(results)


def names_in(act: Intervention | Mapping[str, Any]) -> frozenset[str]:
    """Return the names and other texts of an intervention."""
    return frozenset(value for value in _content(act).values() if isinstance(value, str))


def _is_command(act: Intervention | Mapping[str, Any]) -> bool:
    content = _content(act)
    return not {"drive", "decide"}.isdisjoint({*content, content.get("do")})


def _content(act: Intervention | Mapping[str, Any]) -> Mapping[str, Any]:
    return act if isinstance(act, Mapping) else dump_intervention(act)


@dataclass(frozen=True)
class ExpectationResult:
    """The result of one expectation in one trial.

    Attributes:
        name: The name of the expectation, or its text.
        text: By how much it held or failed, and when.
        holds: Whether it held, or may be untested.
        margin: Margin by which it held, below 0 if it failed, from -1 to 1: comparable between
            expectations of different units.
        amount: The margin in its unit, as text; empty if it has no size.
        step: The first step of a violation; None if it held, or if it failed at no single step.
        untested: Whether the run didn't put it to the test.
        kind: The kind of violation: `MISSED` or `MISSED_BY_THE_END` if something didn't come about,
            the line of an `assert`, else empty.
        names: The names of bodies, rooms, doors and the like in it.
        evidence: Its signals, if it failed, for a picture.
        verdict: The verdict; None for an `assert`.
        covers: The requirements that it covers.
    """

    name: str
    text: str
    holds: bool
    margin: float
    amount: str = ""
    step: int | None = None
    untested: bool = False
    kind: str = ""
    names: frozenset[str] = frozenset()
    evidence: VerdictEvidence | None = None
    verdict: Verdict | None = None
    covers: tuple[str, ...] = ()


def result_of(verdict: Verdict, expectation: Expectation) -> ExpectationResult:
    """Return the result of an expectation from its verdict."""
    step = None
    if verdict.violations:
        first = verdict.violations[0]
        step = first.first if verdict.expectation.startswith(LASTING) else first.last
    value, unit = margin_of(verdict)
    margin = comparable(value, SCALES.get(unit, 1.0))
    if (margin > 0) != (verdict.holds is not False):  # fulfilled just in time, or just too late
        margin = -math.copysign(SMALLEST_MARGIN, margin)
    repeated = f"{verdict.expectation} is violated: {verdict.expectation}"  # if it has no name
    text = str(verdict).replace(repeated, f"{verdict.expectation} is violated")
    names = (name for measurement in expectation.measures() for name in measurement.named())
    return ExpectationResult(
        verdict.name,
        text,
        not verdict.fails,
        margin,
        margin_text(value, unit) if math.isfinite(value) else "",
        step,
        untested=verdict.holds is None,
        kind=kind_of(expectation),
        names=frozenset(part for name in names for part in str(name).split(".") if part),
        verdict=verdict,
    )


def margin_of(verdict: Verdict) -> tuple[float, str]:
    """Return the margin of a verdict with its unit; if that isn't finite, the time to spare [s]."""
    if not math.isfinite(verdict.robustness) and verdict.slack_s is not None:
        return verdict.slack_s, "s"
    return verdict.robustness, verdict.unit


def kind_of(expectation: Term) -> str:
    """Return the kind of violation of an expectation, see `ExpectationResult`."""
    kinds = [kind_of(part) for part in expectation.parts()]
    if isinstance(expectation, eventually | until | at_end | after):
        if getattr(expectation, "within", None) is not None:
            kinds.append(MISSED)
        elif not isinstance(expectation, after):
            kinds.append(MISSED_BY_THE_END)
    return next((kind for kind in (MISSED_BY_THE_END, MISSED) if kind in kinds), "")


def margin_text(value: float, unit: str) -> str:
    """Return a margin with its unit: a time to the digit, others to three digits."""
    return f"{value:g} s" if unit == "s" else amount(value, unit)


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
        acts: The names that each intervention uses.
        error: The failed `assert` of the test; None if all held.
        untested: Why nothing was tested, such as that the test expects nothing.
    """

    variant: Variant
    results: tuple[ExpectationResult, ...]
    steps: int
    acts: tuple[frozenset[str], ...]
    error: AssertionError | None = None
    untested: str = ""

    @property
    def simulated_s(self) -> float:
        """The simulated time [s]."""
        return self.steps * self.variant.scenario.simulation.step.total_seconds()

    @property
    def margin(self) -> float:
        """The smallest margin of all expectations, -1 to 1; 1 without expectations."""
        return self._narrowest.margin

    @property
    def amount(self) -> str:
        """The smallest margin in its unit, as text; empty if it has no size."""
        return self._narrowest.amount

    @property
    def _narrowest(self) -> ExpectationResult:
        untouched = ExpectationResult(TEST, "", True, 1.0)
        results = (*self.results, *self.failures)
        return min(results, key=lambda result: result.margin, default=untouched)

    @property
    def holds(self) -> bool:
        """Whether all expectations held."""
        return not (self.error or self.untested) and all(result.holds for result in self.results)

    @property
    def failures(self) -> tuple[ExpectationResult, ...]:
        """The results that failed, with one for a failed `assert`."""
        failed = tuple(result for result in self.results if not result.holds)
        if self.untested:
            return (*failed, ExpectationResult(TEST, self.untested, False, 1.0, untested=True))
        if self.error is None:
            return failed
        step = max(0, self.steps - 1)
        text = str(self.error) or ASSERT
        line = _line_of(self.error)
        return (*failed, ExpectationResult(ASSERT, text, False, -1.0, step=step, kind=line))

    @property
    def first_failure(self) -> ExpectationResult | None:
        """The failure that came first, if there is one."""
        last = self.steps
        return min(self.failures, key=lambda f: last if f.step is None else f.step, default=None)

    @property
    def failing_step(self) -> int:
        """The first step of a failure."""
        steps = [failure.step for failure in self.failures if failure.step is not None]
        return min(steps, default=max(0, self.steps - 1))


Body = Callable[[Trial], Any]
"""A test function with all arguments bound except the trial."""


@dataclass(frozen=True)
class ClaimResult:
    """The result of a claim.

    Attributes:
        claim: The claim.
        trials: The results of its trials, in order.
        holds: Whether the claim is accepted.
    """

    claim: Claim
    trials: tuple[TrialResult, ...]
    holds: bool

    @property
    def failed(self) -> tuple[TrialResult, ...]:
        """The trials that failed."""
        return tuple(trial for trial in self.trials if not trial.holds)

    @property
    def shown(self) -> TrialResult:
        """The failed trial to report: the shortest."""
        return min(self.failed, key=lambda trial: (trial.failing_step, trial.variant.seed))

    @property
    def text(self) -> str:
        """The decision, and the number of trials that it is based on."""
        number = len(self.trials)
        failures = len(self.failed)
        rate = self.claim.rate
        unit = "run" if self.claim.varies else "seed"
        held = f"held in {number - failures} of {counted(number, unit)}"
        if rate.seeds == 1:
            return "held" if self.holds else "failed"
        if rate.holds == 1:
            if failures:
                return f"{held}; all of them must hold"
            return f"{held}; at least {percent(rate.alternative)} was shown"
        claimed = percent(rate.holds)
        alternative = percent(rate.alternative)
        verb = "accepted" if self.holds else "refused"
        shown = f"at least {alternative}" if self.holds else f"less than {claimed}"
        by_variant: dict[str, list[bool]] = {}
        for trial in self.trials:
            labels = {**trial.variant.labels, "seed": None}
            by_variant.setdefault(repr(labels), []).append(trial.holds)
        low, high = nested_rate_interval(list(by_variant.values()), rate.error)
        share = percent((number - failures) / number)
        return (
            f"{held}: {claimed} {verb} after {number} of at most {rate.seeds}"
            f" (error {percent(rate.error)}; distinguishes {claimed} from {alternative});"
            f" {shown} was shown; rate {share}, {percent(low)} to {percent(high)}"
        )


def run_claim(claim: Claim, body: Body) -> ClaimResult:
    """Run trials until the claim is decided.

    Raises:
        Fleet2DError: The scenario or the test is wrong, or a component failed.
    """
    for cache in (HOME_CACHE, PLAN_CACHE):
        cache.grow(min(len(claim.variants), MAX_HOMES))
    __tracebackhide__ = True
    rate = claim.rate
    trials = list[TrialResult]()
    failures = 0
    for variant in claim.trials():
        trial = run_trial(variant, body)
        if claim.may_be_untested:
            tested = tuple(result for result in trial.results if not result.untested)
            trial = replace(trial, untested="", results=tested)
        trials.append(trial)
        failures += not trial.holds
        holds = rate.decide(len(trials), failures)
        if holds is not None:
            return ClaimResult(claim, tuple(trials), holds)
    raise AssertionError("Rate.decide() gave no verdict after the last seed")


def run_trial(
    variant: Variant, body: Body, *, out: Path | None = None, without: Collection[int] = ()
) -> TrialResult:
    """Run one trial of a test.

    Args:
        variant: The scenario.
        body: The test.
        out: A new directory in which the whole run is stored; None stores nothing.
        without: Numbers of interventions to leave out.

    Raises:
        Fleet2DError: The scenario or the test is wrong, or a component failed.
    """
    scenario = variant.scenario
    if out is None:
        scenario = scenario.model_copy(update={"artifacts": NOTHING})
    with errors_as(SetUpError, variant.text):
        trial = Trial(scenario, out=out, without=without)
    error: AssertionError | None = None
    __tracebackhide__ = True  # pytest shows the lines of the test
    try:
        body(trial)
    except AssertionError as failure:
        error = failure
    except Exception as failure:
        failure.add_note(f"in {variant.text}")
        raise
    results = trial.conclude() if error is None else ()
    untested = "" if error or results or asserts(body) else NOTHING_TESTED
    result = TrialResult(variant, results, trial.step, tuple(trial.acts), error, untested)
    if out is not None and not trial.done:
        trial.run()
    elif out is not None:
        trial.finish()
    return result


def asserts(function: Any, depth: int = 4) -> bool:
    """Return whether a function has an `assert`, or calls one of its module that does."""
    function = inspect.unwrap(function)
    code = getattr(function, "__code__", None)
    if code is None or depth == 0:
        return False
    called: list[Any] = []
    for each in (code, *filter(inspect.iscode, code.co_consts)):
        operations = {operation.opname for operation in dis.get_instructions(each)}
        if "LOAD_ASSERTION_ERROR" in operations or "AssertionError" in each.co_names:
            return True
        called += map(function.__globals__.get, each.co_names)
    called += [cell.cell_contents for cell in function.__closure__ or ()]
    return any(asserts(each, depth - 1) for each in called if inspect.isroutine(each))


def _line_of(error: AssertionError) -> str:
    """Return the file and line at which an assertion failed."""
    frames = traceback.extract_tb(error.__traceback__)
    return f"{frames[-1].filename}:{frames[-1].lineno}" if frames else ""
