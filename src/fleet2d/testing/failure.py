"""Reports of failures: a text, a picture, the stored run, and the command to repeat it."""

import re
import shlex
import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from fleet2d.errors import Fleet2DError
from fleet2d.runtime.clock import Clock
from fleet2d.testing.claim import Variant
from fleet2d.testing.running import Body, ClaimResult, run_trial
from fleet2d.testing.shrink import Shrinker
from fleet2d.testing.trials import ASSERT, ExpectationResult, TrialResult

MOST_SEEDS_SHOWN = 8


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
        shown = "; ".join(seeds[:MOST_SEEDS_SHOWN]) + "; …" * (len(seeds) > MOST_SEEDS_SHOWN)
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
        from fleet2d.viewer.scenes.figures import draw_moment

        picture = out.with_suffix(".png")
        run = open_run(out)
        draw_moment(run, min(step, run.manifest["steps"] - 1), picture)
        yield f"  picture: {picture}"
    except Fleet2DError as error:  # such as that matplotlib is not installed
        yield f"  no picture: {error}"
    path = shlex.quote(str(out))
    yield f"  see it: fleet2d view {path}, or fleet2d show {path} --at 'step {step}'"
