"""A failure explains itself: in words, by a picture, by a run, and by the command to see it."""

import re
import shlex
import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from fleet2d.clock import Clock
from fleet2d.errors import Fleet2DError
from fleet2d.testing.claim import Variant
from fleet2d.testing.life import ASSERT, Finding, Life
from fleet2d.testing.running import Body, Outcome, run_life
from fleet2d.testing.shrink import Shrinker

MOST_SEEDS_SHOWN = 8


@dataclass(frozen=True)
class Places:
    """Where what a test leaves behind goes, and what the test is called.

    Attributes:
        folder: For all tests.
        test: What pytest calls the test.
    """

    folder: Path
    test: str

    def fresh(self) -> Path:
        """Return the test's own folder, empty: of the last failure alone."""
        plain = re.sub(r"[^\w.-]+", "-", self.test).strip("-")
        folder = self.folder / plain
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)
        return folder


def explain(outcome: Outcome, body: Body, places: Places, tries: int) -> str:
    """Store a failing life, and the smallest one like it, and return what there is to say.

    Args:
        outcome: Of a claim that was refused.
        body: The test.
        places: Where to store.
        tries: How many lives may be run to make it smaller.
    """
    folder, life = places.fresh(), outcome.shown
    again = f"pytest {shlex.quote(places.test)} --fleet2d-seed {life.variant.seed}"
    lines = [outcome.words, *_by_expectation(outcome), ""]
    lines += describe_life(life, body, folder, tries, again)
    text = "\n".join(lines)
    (folder / "failure.txt").write_text(text + "\n", encoding="utf-8")
    return text


def describe_life(life: Life, body: Body, folder: Path, tries: int, again: str) -> Iterable[str]:
    """Store a failing life, and the smallest one like it; yield what there is to say.

    Args:
        life: The life.
        body: The test.
        folder: Where to store.
        tries: How many lives may be run to make it smaller.
        again: The command that runs it again.
    """
    yield f"{life.variant.words}:"
    yield from _moments(life)
    yield from _stored(life.variant, frozenset(), body, folder / "run", life)
    yield f"  again: {again}"
    if tries > 0:
        case = Shrinker(body, tries).shrink(life)
        if case.life is not life:
            yield ""
            yield f"smaller: {case.words}"
            yield from _moments(case.life)
            yield from _stored(case.variant, case.without, body, folder / "smaller", case.life)


def _by_expectation(outcome: Outcome) -> Iterable[str]:
    """Yield a line for each expectation that failed somewhere: in which seeds, and the worst."""
    failures: dict[str, list[tuple[Life, Finding]]] = {}
    for life in outcome.failed:
        for failure in life.failures:
            failures.setdefault(failure.name, []).append((life, failure))
    for name, cases in failures.items():
        if len(outcome.lives) == 1:
            continue
        seeds = [life.variant.words for life, _ in cases]
        shown = "; ".join(seeds[:MOST_SEEDS_SHOWN]) + "; …" * (len(seeds) > MOST_SEEDS_SHOWN)
        worst, failure = min(cases, key=lambda case: case[1].margin)
        yield f"  {name}: failed in {len(cases)} of {len(outcome.lives)} ({shown})"
        if len(cases) > 1 and name != ASSERT:
            yield f"    worst in {worst.variant.words}: {failure.words}"


def _moments(life: Life) -> Iterable[str]:
    """Yield a line for each failure of a life: what, when, by how much."""
    simulation = life.variant.scenario.simulation
    clock = Clock(simulation.start, simulation.step_us, simulation.steps)
    for failure in life.failures:
        at = ""
        if failure.step is not None:
            at = f" at {clock.time(failure.step):%a %d %b %H:%M:%S} (step {failure.step})"
        first = failure.words.splitlines()[0]
        yield f"  {first}" if failure.name != ASSERT else f"  assert failed{at}: {first}"


def _stored(
    variant: Variant, without: frozenset[int], body: Body, out: Path, life: Life
) -> Iterable[str]:
    """Run a life again and store it; yield where it is, its picture, and how to see it."""
    try:
        run_life(variant, body, out=out, without=without)
    except Fleet2DError as error:
        yield f"  the run could not be stored: {error}"
        return
    step = life.failing_step
    yield f"  run: {out}"
    try:
        from fleet2d.runs.run import open_run
        from fleet2d.viewer.pictures import draw_moment

        picture = out.with_suffix(".png")
        run = open_run(out)
        draw_moment(run, min(step, run.manifest["steps"] - 1), picture)
        yield f"  picture: {picture}"
    except Fleet2DError as error:  # such as that matplotlib is not installed
        yield f"  no picture: {error}"
    quoted = shlex.quote(str(out))
    yield f"  see it: fleet2d view {quoted}, or fleet2d show {quoted} --at 'step {step}'"
