"""Run the trials of a claim, one after the other, until it is decided."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fleet2d.artifacts.settings import ArtifactSettings
from fleet2d.errors import InputError
from fleet2d.floorplan.home.home import keep_homes
from fleet2d.floorplan.source import keep_plans
from fleet2d.testing.claim import Claim, SetUpError, Variant
from fleet2d.testing.trials import Trial, TrialResult

Body = Callable[[Trial], Any]
"""A test function with all arguments bound except the trial."""

MOST_HOMES = 32  # in memory
NOTHING = ArtifactSettings(
    trajectories="off",
    key_frames=False,
    observations=False,
    events=False,
    outputs=False,
    checkpoint="off",
)


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
        keep(min(len(claim.variants), MOST_HOMES))
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
    """Return a share as messages write it.

    >>> percent(0.95), percent(0.8464)
    ('95 %', '84.6 %')
    """
    return f"{round(100 * share, 1):g} %"
