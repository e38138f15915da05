"""Failures of trials: their reports, and the same failures in smaller runs."""

import re
import shlex
import shutil
from collections.abc import Iterable
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple

from fleet2d.errors import Fleet2DError
from fleet2d.runtime.clock import Clock
from fleet2d.scenario.load import load_scenario
from fleet2d.scenario.model import Scenario
from fleet2d.testing.claim import Variant
from fleet2d.testing.trials import (
    ASSERT,
    MISSED,
    MISSED_BY_THE_END,
    Body,
    ClaimResult,
    ExpectationResult,
    TrialResult,
    names_in,
    run_trial,
)

LEAD_TIMES = tuple(timedelta(minutes=minutes) for minutes in (0, 1, 5, 15, 60, 240, 1440, 10_080))
"""Times from the start of a shorter run to the failure, tried in this order."""
MAX_SEEDS_SHOWN = 8
FILM_STEPS = 30  # steps to show before and after a failure


class FailingCase(NamedTuple):
    """A failing run, reduced so far.

    Attributes:
        variant: The scenario.
        without: Numbers of the interventions that are left out.
        result: The result of the run.
        failure: The failure that smaller runs must repeat.
    """

    variant: Variant
    without: frozenset[int]
    result: TrialResult
    failure: ExpectationResult

    @property
    def text(self) -> str:
        """A summary: the time, the people, and the number of interventions."""
        simulation = self.variant.scenario.simulation
        start = simulation.clock.start
        end = start + simulation.duration
        people = ", ".join(self.variant.scenario.users) or "nobody"
        number = len(self.result.acts)
        shown = f", {number - len(self.without)} of {number} interventions" if number else ""
        return f"{start:%a %d %b %H:%M:%S} to {end:%a %d %b %H:%M:%S}, with {people}{shown}"

    @property
    def step(self) -> int:
        """The step of the failure."""
        step = self.failure.step
        return max(0, self.result.steps - 1) if step is None else step


class Shrinker:
    """Tries smaller versions of a failing run.

    A smaller version counts if the same expectation fails in the same way. Interventions stay that
    may have asked for what didn't come about, as they share names with the expectation; and so does
    the time before the failure, while it depends on an algorithm that learns.
    """

    def __init__(self, body: Body, tries: int) -> None:
        """Prepare to shrink runs of a test.

        Args:
            body: The test.
            tries: Largest number of runs.
        """
        self._body = body
        self.tries = tries

    def shrink(self, result: TrialResult) -> FailingCase | None:
        """Return the smallest version found of a failing run; None if none is smaller."""
        failure = result.first_failure
        if failure is None or failure.untested:
            return None
        whole = case = FailingCase(result.variant, frozenset(), result, failure)
        for reduce in (
            self._cut_after,
            self._drop_learners,
            self._cut_before,
            self._drop_interventions,
            self._drop_bodies,
        ):
            case = reduce(case)
        case = self._cut_after(case)
        return None if case is whole else case

    def _cut_after(self, case: FailingCase) -> FailingCase:
        """End the run at the failure."""
        simulation = case.variant.scenario.simulation
        if case.step + 1 >= simulation.steps or case.failure.kind == MISSED_BY_THE_END:
            return case
        length = (case.step + 1) * simulation.step
        return self._cut(case, simulation.clock.start, simulation.clock.start + length) or case

    def _drop_learners(self, case: FailingCase) -> FailingCase:
        """Leave out the algorithms and metrics that aren't needed to fail."""
        without = _edited(case.variant, algorithms={}, metrics={})
        if case.variant.scenario.algorithms and (smaller := self._try(case, without)):
            return smaller
        return self._drop_entries(case, ("algorithms", "metrics"))

    def _cut_before(self, case: FailingCase) -> FailingCase:
        """Move the start of the run as close to the failure as possible, to the minute."""
        if case.variant.scenario.algorithms or case.failure.kind == MISSED_BY_THE_END:
            return case  # what they have learned by then may be the cause
        whole = case
        short = timedelta(0)
        for lead in LEAD_TIMES:
            if smaller := self._begin_before(whole, lead):
                case = smaller
                break
            short = lead
        else:
            return case
        while lead - short > timedelta(minutes=1) and self.tries > 0:
            middle = (short + (lead - short) / 2) // timedelta(minutes=1) * timedelta(minutes=1)
            smaller = self._begin_before(whole, middle)
            short, lead = (short, middle) if smaller else (middle, lead)
            case = smaller or case
        return case

    def _begin_before(self, case: FailingCase, lead: timedelta) -> FailingCase | None:
        """Return the run that begins some time before the failure, if it fails, too."""
        simulation = case.variant.scenario.simulation
        end = simulation.clock.start + simulation.duration
        failing = simulation.clock.start + case.step * simulation.step
        start = (failing - lead).replace(second=0, microsecond=0)
        if not simulation.clock.start < start < end:
            return None
        smaller = self._cut(case, start, end)
        return smaller and self._cut_after(smaller)

    def _cut(self, case: FailingCase, start: datetime, end: datetime) -> FailingCase | None:
        """Return the part of the run between two times, if it fails, too."""
        entries = case.variant.scenario.script
        script = _script_within(case.variant.scenario, start, end)
        if any(
            content is None and self._may_ask_for(case, names_in(entry.act))
            for entry, content in zip(entries, script, strict=True)
        ):
            return None
        times = {"start": start.isoformat(), "duration": end - start}
        content = {"script": list(filter(None, script))} if entries else {}
        return self._try(case, _edited(case.variant, simulation=times, **content))

    def _drop_interventions(self, case: FailingCase) -> FailingCase:
        """Leave out interventions, the last first."""
        for number in reversed(range(len(case.result.acts))):
            if not self._may_ask_for(case, case.result.acts[number]):
                case = self._try(case, case.variant, case.without | {number}) or case
        for number in reversed(range(len(case.variant.scenario.script))):
            script = case.variant.scenario.resolved()["script"]
            if not self._may_ask_for(case, names_in(script.pop(number))):
                case = self._try(case, _edited(case.variant, script=script)) or case
        return case

    @staticmethod
    def _may_ask_for(case: FailingCase, names: frozenset[str]) -> bool:
        """Return whether an intervention with these names may have asked for what was missed."""
        is_missing = case.failure.kind in (MISSED, MISSED_BY_THE_END)
        return is_missing and bool(case.failure.names & names)

    def _drop_bodies(self, case: FailingCase) -> FailingCase:
        """Leave out the people, robots and objects not needed to fail."""
        return self._drop_entries(case, ("robots", "users", "objects"))

    def _drop_entries(self, case: FailingCase, sections: tuple[str, ...]) -> FailingCase:
        """Leave out the entries of some sections one by one."""
        for section in sections:
            for name in getattr(case.variant.scenario, section):
                content = case.variant.scenario.resolved()[section]
                del content[name]
                case = self._try(case, _edited(case.variant, **{section: content})) or case
        return case

    def _try(
        self, case: FailingCase, variant: Variant | None, without: frozenset[int] | None = None
    ) -> FailingCase | None:
        """Return a version if it fails as the case does; None otherwise."""
        if variant is None or self.tries <= 0:
            return None
        self.tries -= 1
        without = case.without if without is None else without
        try:
            result = run_trial(variant, self._body, without=without)
        except Exception:  # noqa: BLE001 - a version that can't be simulated doesn't count
            return None
        failure = same_failure(case.failure, result)
        return FailingCase(variant, without, result, failure) if failure else None


def same_failure(failure: ExpectationResult, result: TrialResult) -> ExpectationResult | None:
    """Return the failure of a run with the same expectation and kind; None if there is none."""
    same = (f for f in result.failures if (f.name, f.kind) == (failure.name, failure.kind))
    return next(same, None)


def _script_within(
    scenario: Scenario, start: datetime, end: datetime
) -> list[dict[str, Any] | None]:
    """Return the entries of a script for a part of its time; None for those outside."""
    simulation = scenario.simulation
    clock = Clock(start, simulation.step_us, (end - start) // simulation.step)
    entries: list[dict[str, Any] | None] = []
    for entry, content in zip(scenario.script, scenario.resolved()["script"], strict=True):
        at = entry.at
        is_in = True
        if isinstance(at, timedelta):  # since the start
            at = at - (start - simulation.clock.start)
            is_in = timedelta(0) <= at < end - start
            content = {**content, "at": at}
        elif isinstance(at, datetime):
            is_in = start <= at < end
        elif at is not None:
            is_in = any(at.moments(clock))
        entries.append(content if is_in else None)
    return entries


def _edited(variant: Variant, **sections: Any) -> Variant | None:
    """Return a variant with some keys changed; None if that is not a valid scenario."""
    content = variant.scenario.resolved()
    for name, value in sections.items():
        content[name] = {**content[name], **value} if name == "simulation" else value
    try:
        return replace(variant, scenario=load_scenario(content))
    except Fleet2DError:
        return None


def explain(result: ClaimResult, body: Body, folder: Path, test: str, tries: int) -> str:
    """Store a failing run, and the smallest similar one, and return a report.

    Args:
        result: The result of a claim that was refused.
        body: The test.
        folder: The folder of the runs of all tests.
        test: The test, as pytest names it.
        tries: Largest number of runs to make it smaller.
    """
    folder /= re.sub(r"[^\w.-]+", "-", test).strip("-")
    shutil.rmtree(folder, ignore_errors=True)  # it may hold earlier failures
    folder.mkdir(parents=True, exist_ok=True)
    trial = result.shown
    command = f"pytest {shlex.quote(test)} --fleet2d-seed {trial.variant.seed}"
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
    case = Shrinker(body, tries).shrink(trial)
    if case is not None:
        yield ""
        yield f"smaller: {case.text}"
        yield from _failures(case.result)
        out = folder / "smaller"
        yield from _store(case.variant, case.without, body, out, case.result)
        yield f"  again: fleet2d verify {shlex.quote(str(out))} --again"


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
        if len(seeds) > MAX_SEEDS_SHOWN:
            seeds[MAX_SEEDS_SHOWN:] = ["…"]
        shown = "; ".join(seeds)
        worst, failure = min(cases, key=lambda case: case[1].margin)
        yield f"  {name}: failed in {len(cases)} of {len(result.trials)} ({shown})"
        if len(cases) > 1 and name != ASSERT:
            yield f"    worst in {worst.variant.text}: {failure.text}"


def _failures(trial: TrialResult) -> Iterable[str]:
    """Yield a line for each failure of a run: its expectation, time and margin."""
    simulation = trial.variant.scenario.simulation
    clock = simulation.clock
    for failure in trial.failures:
        at = ""
        if failure.step is not None:
            at = f" at {clock.time(failure.step):%a %d %b %H:%M:%S} (step {failure.step})"
        first = failure.text.splitlines()[0]
        yield f"  {first}" if failure.name != ASSERT else f"  assert failed{at}: {first}"


def _store(
    variant: Variant, without: frozenset[int], body: Body, out: Path, trial: TrialResult
) -> Iterable[str]:
    """Repeat a failing run and store it; yield its path, picture, and the commands to see it."""
    failure = trial.first_failure
    assert failure is not None, "only failing runs are described"
    try:
        again = run_trial(variant, body, out=out, without=without)
    except Fleet2DError as error:
        yield f"  the run could not be stored: {error}"
        return
    if same_failure(failure, again) is None:
        yield "  it didn't fail again: the test depends on more than the scenario and the seed"
    step = trial.failing_step
    yield f"  run: {out}"
    try:
        from fleet2d.runs.run import open_run
        from fleet2d.viewing.figures import draw_failure

        picture = out.with_suffix(".png")
        run = open_run(out)
        text = failure.text.splitlines()[0]
        draw_failure(run, min(step, run.manifest["steps"] - 1), picture, text, failure.evidence)
        yield f"  picture: {picture}"
    except Fleet2DError as error:  # matplotlib may be missing
        yield f"  no picture: {error}"
    path = shlex.quote(str(out))
    yield f"  see it: fleet2d view {path}, or fleet2d show {path} --at 'step {step}'"
    first = max(0, step - FILM_STEPS)
    last = min(step + FILM_STEPS, variant.scenario.simulation.steps - 1)
    film = shlex.quote(str(out.with_suffix(".mp4")))
    stretch = f"--from 'step {first}' --to 'step {last}'"
    yield f"  film it: fleet2d export {path} {film} {stretch} --speed 4"
