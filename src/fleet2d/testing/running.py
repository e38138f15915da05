"""Running a claim: one life after the other, until it is decided."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fleet2d.artifacts.settings import ArtifactSettings
from fleet2d.errors import InputError
from fleet2d.floorplan.home.home import keep_homes
from fleet2d.floorplan.source import keep_plans
from fleet2d.testing.claim import Claim, SetUpError, Variant
from fleet2d.testing.life import Life, Trial

Body = Callable[[Trial], Any]
"""A test function, all of its arguments but the trial filled in."""

MOST_HOMES = 32  # that are kept in memory
NOTHING = ArtifactSettings(
    trajectories="off",
    key_frames=False,
    observations=False,
    events=False,
    outputs=False,
    checkpoint="off",
)


@dataclass(frozen=True)
class Outcome:
    """What became of a claim.

    Attributes:
        claim: What was claimed.
        lives: The lives that it took, in order.
        holds: Whether the claim is accepted.
    """

    claim: Claim
    lives: tuple[Life, ...]
    holds: bool

    @property
    def failed(self) -> tuple[Life, ...]:
        """The lives in which something failed."""
        return tuple(life for life in self.lives if not life.holds)

    @property
    def shown(self) -> Life:
        """The failing life that is told about: the shortest."""
        return min(self.failed, key=lambda life: (life.failing_step, life.variant.seed))

    @property
    def words(self) -> str:
        """What was decided, and on how much."""
        number, failures = len(self.lives), len(self.failed)
        rate, unit = self.claim.rate, "life" if self.claim.varies else "seed"
        held = f"held in {number - failures} of {number} {plural(unit, number)}"
        if rate.seeds == 1:
            return "held" if self.holds else "failed"
        if rate.holds == 1:
            return f"{held}; every one was to hold" if failures else held
        verb = "accepted" if self.holds else "refused"
        return (
            f"{held}: {percent(rate.holds)} {verb} after {number} of at most {rate.seeds}"
            f" (errs in {percent(rate.error)}; tells {percent(rate.holds)} from"
            f" {percent(rate.told_from)})"
        )


def run_claim(claim: Claim, body: Body) -> Outcome:
    """Run lives until the claim is decided.

    Raises:
        Fleet2DError: The scenario or the test is wrong, or a component failed.
    """
    for keep in (keep_homes, keep_plans):
        keep(min(len(claim.variants), MOST_HOMES))
    __tracebackhide__ = True
    rate, lives, failures = claim.rate, list[Life](), 0
    for variant in claim.lives():
        life = run_life(variant, body)
        lives.append(life)
        failures += not life.holds
        decided = rate.decide(len(lives), failures)
        if decided is not None:
            return Outcome(claim, tuple(lives), decided)
    raise AssertionError("the last seed decides")


def run_life(
    variant: Variant,
    body: Body,
    *,
    out: Path | None = None,
    without: Collection[int] = (),
) -> Life:
    """Run one life of a test.

    Args:
        variant: What is simulated.
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
        raise SetUpError(f"{variant.words}: {problem}") from problem
    error: AssertionError | None = None
    __tracebackhide__ = True  # pytest shows the lines of the test
    try:
        body(trial)
    except AssertionError as failure:
        error = failure
    except Exception as failure:
        failure.add_note(f"in {variant.words}")
        raise
    findings = trial.conclude() if error is None else ()
    life = Life(variant, findings, trial.step, trial.acts, error)
    if out is not None and not trial.done:
        trial.run()
    elif out is not None:
        trial.finish()
    return life


def plural(word: str, number: int) -> str:
    """Return a word for so many.

    >>> plural("seed", 1), plural("life", 2)
    ('seed', 'lives')
    """
    return word if number == 1 else "lives" if word == "life" else f"{word}s"


def percent(share: float) -> str:
    """Return a share as messages write it.

    >>> percent(0.95), percent(0.8464)
    ('95 %', '84.6 %')
    """
    return f"{round(100 * share, 1):g} %"
