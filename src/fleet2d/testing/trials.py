"""Trials of a claim: simulations under test, run until it is decided, and reports of failures."""

import math
import re
import shlex
import shutil
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import timedelta
from pathlib import Path
from typing import Any

from fleet2d.artifacts.store import ArtifactSettings
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import Fleet2DError, InputError
from fleet2d.expectations.verdict import Verdict
from fleet2d.floorplan.home import keep_homes
from fleet2d.floorplan.source import keep_plans
from fleet2d.interventions.bodies import Decide, TakeControl
from fleet2d.interventions.intervention import Intervention
from fleet2d.runtime.clock import Clock
from fleet2d.scenario.model import Scenario, load_scenario
from fleet2d.testing.claim import Claim, SetUpError, Variant

ASSERT = "assert"
"""The name of a failed `assert` of a test among its expectations."""
SMALLEST_MARGIN = 1e-9
SCALES = {"m": 1.0, "m/s": 0.5, "share": 0.1, "s": 60.0, "times": 1.0}
"""Margins that count as neither narrow nor wide, by unit; 1 for others."""
LASTING = ("always(", "never(", "at_most(")
"""Expectations that fail at the first step of a violation; others fail at their deadline."""
MAX_HOMES = 32  # in memory
NOTHING = ArtifactSettings(
    trajectories="off",
    key_frames=False,
    observations=False,
    events=False,
    outputs=False,
    checkpoint="off",
)
SECTIONS = ("users", "robots", "objects", "algorithms", "metrics")
"""The sections of the scenario whose entries are left out one by one."""
LEAD_TIMES = tuple(timedelta(minutes=minutes) for minutes in (0, 1, 5, 15, 60, 240, 1440, 10_080))
"""Times from the start of a shorter run to the failure, tried in this order."""
MAX_SEEDS_SHOWN = 8


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
        holds: Whether it held, or may be untested.
        margin: Margin by which it held, below 0 if it failed, from -1 to 1: comparable between
            expectations of different units.
        step: The first step of a violation; None if it held, or if it failed at no single step.
        untested: Whether the run didn't put it to the test.
    """

    name: str
    text: str
    holds: bool
    margin: float
    step: int | None = None
    untested: bool = False


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
    if (margin > 0) != (verdict.holds is not False):  # fulfilled just in time, or just too late
        margin = -math.copysign(SMALLEST_MARGIN, margin)
    repeated = f"{verdict.expectation} is violated: {verdict.expectation}"  # without a name
    text = str(verdict).replace(repeated, f"{verdict.expectation} is violated")
    untested = verdict.holds is None
    return ExpectationResult(verdict.name, text, not verdict.fails, margin, step, untested)


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
        """The smallest margin of all expectations, -1 to 1; 1 without expectations."""
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
        number, failures = len(self.trials), len(self.failed)
        rate, unit = self.claim.rate, "run" if self.claim.varies else "seed"
        held = f"held in {number - failures} of {number} {plural(unit, number)}"
        if rate.seeds == 1:
            return "held" if self.holds else "failed"
        if rate.holds == 1:
            return f"{held}; all of them must hold" if failures else held
        verb = "accepted" if self.holds else "refused"
        return (
            f"{held}: {percent(rate.holds)} {verb} after {number} of at most {rate.seeds}"
            f" (error {percent(rate.error)}; distinguishes {percent(rate.holds)} from"
            f" {percent(rate.alternative)})"
        )


def run_claim(claim: Claim, body: Body) -> ClaimResult:
    """Run trials until the claim is decided.

    Raises:
        Fleet2DError: The scenario or the test is wrong, or a component failed.
    """
    for keep in (keep_homes, keep_plans):
        keep(min(len(claim.variants), MAX_HOMES))
    __tracebackhide__ = True
    rate, trials, failures = claim.rate, list[TrialResult](), 0
    for variant in claim.trials():
        trial = run_trial(variant, body)
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
    try:
        trial = Trial(scenario, out=out, without=without)
    except InputError as problem:
        raise SetUpError(f"{variant.text}: {problem}") from problem
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
    result = TrialResult(variant, results, trial.step, trial.acts, error)
    if out is not None and not trial.done:
        trial.run()
    elif out is not None:
        trial.finish()
    return result


def plural(word: str, number: int) -> str:
    """Return the singular or plural of a word for a number.

    >>> plural("seed", 1), plural("run", 2)
    ('seed', 'runs')
    """
    return word if number == 1 else f"{word}s"


def percent(share: float) -> str:
    """Return a share in percent, with at most one decimal.

    >>> percent(0.95), percent(0.8464)
    ('95 %', '84.6 %')
    """
    return f"{round(100 * share, 1):g} %"


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
        """Move the start of the run as close to the failure as possible."""
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
    for lead in LEAD_TIMES:
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


@dataclass(frozen=True)
class FailureFolder:
    """The folder for the artifacts of a failing test.

    Attributes:
        parent: The folder for all tests.
        test: The node id of the test in pytest.
    """

    parent: Path
    test: str

    def create(self) -> Path:
        """Return the test's own folder, without the artifacts of earlier failures."""
        name = re.sub(r"[^\w.-]+", "-", self.test).strip("-")
        folder = self.parent / name
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)
        return folder


def explain(result: ClaimResult, body: Body, place: FailureFolder, tries: int) -> str:
    """Store a failing run, and the smallest similar one, and return a report.

    Args:
        result: The result of a claim that was refused.
        body: The test.
        place: Where to store the runs.
        tries: Largest number of runs to make it smaller.
    """
    folder, trial = place.create(), result.shown
    command = f"pytest {shlex.quote(place.test)} --fleet2d-seed {trial.variant.seed}"
    lines = [result.text, *_by_expectation(result), ""]
    lines += describe_trial(trial, body, folder, tries, command)
    text = "\n".join(lines)
    (folder / "failure.txt").write_text(text + "\n", encoding="utf-8")
    return text


def describe_trial(
    trial: TrialResult, body: Body, folder: Path, tries: int, command: str
) -> Iterable[str]:
    """Store a failing run, and the smallest similar one; yield the lines of a report.

    Args:
        trial: The result of the run.
        body: The test.
        folder: Where to store the runs.
        tries: Largest number of runs to make it smaller.
        command: The command that repeats the run.
    """
    yield f"{trial.variant.text}:"
    yield from _failures(trial)
    yield from _store(trial.variant, frozenset(), body, folder / "run", trial)
    yield f"  again: {command}"
    if tries > 0:
        case = Shrinker(body, tries).shrink(trial)
        if case.result is not trial:
            yield ""
            yield f"smaller: {case.text}"
            yield from _failures(case.result)
            yield from _store(case.variant, case.without, body, folder / "smaller", case.result)


def _by_expectation(result: ClaimResult) -> Iterable[str]:
    """Yield a line for each expectation that failed: in which runs, and the worst."""
    failures: dict[str, list[tuple[TrialResult, ExpectationResult]]] = {}
    for trial in result.failed:
        for failure in trial.failures:
            failures.setdefault(failure.name, []).append((trial, failure))
    for name, cases in failures.items():
        if len(result.trials) == 1:
            continue
        seeds = [trial.variant.text for trial, _ in cases]
        shown = "; ".join(seeds[:MAX_SEEDS_SHOWN]) + "; …" * (len(seeds) > MAX_SEEDS_SHOWN)
        worst, failure = min(cases, key=lambda case: case[1].margin)
        yield f"  {name}: failed in {len(cases)} of {len(result.trials)} ({shown})"
        if len(cases) > 1 and name != ASSERT:
            yield f"    worst in {worst.variant.text}: {failure.text}"


def _failures(trial: TrialResult) -> Iterable[str]:
    """Yield a line for each failure of a run: what failed, when, by how much."""
    simulation = trial.variant.scenario.simulation
    clock = Clock(simulation.start, simulation.step_us, simulation.steps)
    for failure in trial.failures:
        at = ""
        if failure.step is not None:
            at = f" at {clock.time(failure.step):%a %d %b %H:%M:%S} (step {failure.step})"
        first = failure.text.splitlines()[0]
        yield f"  {first}" if failure.name != ASSERT else f"  assert failed{at}: {first}"


def _store(
    variant: Variant, without: frozenset[int], body: Body, out: Path, trial: TrialResult
) -> Iterable[str]:
    """Repeat a run and store it; yield its path, its picture, and the commands to see it."""
    try:
        run_trial(variant, body, out=out, without=without)
    except Fleet2DError as error:
        yield f"  the run could not be stored: {error}"
        return
    step = trial.failing_step
    yield f"  run: {out}"
    try:
        from fleet2d.runs.run import open_run
        from fleet2d.viewer.figures import draw_moment

        picture = out.with_suffix(".png")
        run = open_run(out)
        draw_moment(run, min(step, run.manifest["steps"] - 1), picture)
        yield f"  picture: {picture}"
    except Fleet2DError as error:  # such as that matplotlib is not installed
        yield f"  no picture: {error}"
    path = shlex.quote(str(out))
    yield f"  see it: fleet2d view {path}, or fleet2d show {path} --at 'step {step}'"
