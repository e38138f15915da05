"""The answer of trials: a question, two to six sentences, and one small table."""

from collections.abc import Iterator, Sequence
from datetime import timedelta
from typing import Any

from fleet2d.configuration.problems import counted
from fleet2d.studies.sentences import Conclusion, in_words, listed
from fleet2d.testing.claim import percent, seeds_for
from fleet2d.testing.gate import (
    BROKEN,
    ERROR,
    HELD,
    RANKING,
    UNDECIDED,
    UNTESTED,
    Gate,
    Tally,
    sign_test,
)
from fleet2d.testing.suite import TrialReport
from fleet2d.testing.trials import ASSERT, TEST, margin_text

RATES = (0.9, 0.95, 0.99, 0.999)
"""Rates, of which the next higher one is told with the number of trials that show it."""
MAX_TIMES = 50
"""The largest multiple of the trials that is considered to show a difference."""


def answer(gate: Gate) -> Conclusion:
    """Return the answer of a gate about its build."""
    ordered = sorted(gate.tallies, key=lambda each: _rank(gate, each))
    question = "Does the robot do what its tests expect?"
    if gate.build:
        question = f"Is {gate.build} fit for release?"
    texts = (
        f"{headline(gate)}.",
        _failed(gate, ordered),
        _tolerated(gate, ordered),
        _requirements(gate),
        _open_questions(gate, ordered),
        gate.cost,
    )
    table = tuple(_row(gate, each) for each in ordered)
    return Conclusion(question, tuple(filter(None, texts)), table)


def headline(gate: Gate) -> str:
    """Return the verdict in one sentence."""
    number = len([each for each in gate.tallies if each.name])
    tests = counted(number, "expectation")
    subject = gate.build or ("the build" if gate.against else "")
    if not gate.tallies:
        return f"{subject or 'The robot'} is untested: no trial was run"
    held = f"{len([each for each in gate.tallies if each.verdict == HELD])} of {tests} held"
    if gate.passes:
        if gate.changes:
            held = f"none of {tests} is shown to be worse than with {gate.against}"
        return f"{subject} passes: {held}" if subject else held
    broken = len({each.test for each in gate.blocking if each.verdict == BROKEN})
    worse = len([each for each in gate.blocking if each.name])
    what = "fails" if worse == 1 else "fail"
    if gate.against:
        what = f"{'is' if worse == 1 else 'are'} worse than with {gate.against}"
    parts = []
    if worse:
        parts.append(f"{worse} of {tests} {what}")
    if broken:
        parts.append(f"{counted(broken, 'test')} can't be run")
    if number and not worse:
        parts.append(held)
    text = " and ".join(parts)
    return f"{subject} doesn't pass: {text}" if subject else text


def cost_of(reports: Sequence[TrialReport], wall_s: float, builds: int = 1) -> str:
    """Return a sentence with the number of trials and the time that they took."""
    if not reports:
        return ""
    simulated = in_words(timedelta(seconds=sum(report.simulated_s for report in reports)))
    wall = in_words(timedelta(seconds=wall_s))
    trials = counted(len(reports), "trial")
    of_both = ", half of them with each build" if builds > 1 else ""
    return f"It took {trials}{of_both}: {simulated} simulated in {wall}."


def _rank(gate: Gate, each: Tally) -> tuple[bool, bool, int, float]:
    """Return the sort key of an expectation: first those against the build that fail most often."""
    share = len(each.failed) / max(1, each.trials)
    is_harmless = each not in gate.blocking
    is_unknown = each not in gate.known
    return is_harmless, is_unknown, RANKING.index(each.verdict), -share


def _name(gate: Gate, each: Tally) -> str:
    """Return the name of an expectation, with its test if there are several, and requirements."""
    test = gate.short[each.test]
    if each.name in ("", TEST):
        return test
    if each.name == ASSERT:
        return f"an assert of {test}"
    covers = f" ({', '.join(sorted(each.covers))})" if each.covers else ""
    where = f" of {test}" if len(gate.short) > 1 else ""
    return f"{each.name}{where}{covers}"


def _failure_text(each: Tally) -> str:
    """Return in how many trials an expectation failed, and by how much in the worst."""
    number = counted(each.trials, "trial")
    if each.errors:
        text = each.errors[0].error.splitlines()[0]
        often = f" in {len(each.errors)} of {number}" if each.trials > 1 else ""
        return f"can't be run{often}: {text}"
    worst = each.failed[0]
    outcome = each.outcomes[worst]
    if each.verdict == UNTESTED:
        why = outcome.says.partition(": ")[2] or outcome.says
        return f"is untested in {len(each.failed)} of {number}: {why}"
    text = f"failed in {len(each.failed)} of {number}"
    which = "worst in" if len(each.failed) > 1 else "in"
    text += f", {which} {worst.label}"
    if outcome.margin is not None:
        text += f", by {margin_text(abs(outcome.margin), outcome.unit)}"
    if each.name == ASSERT:
        text += f": {outcome.says.splitlines()[0]}"
    return text


def _failed(gate: Gate, ordered: Sequence[Tally]) -> str:
    """Return the failures that speak against the build, in words."""
    parts = []
    for each in ordered:
        if each in gate.blocking:
            change = gate.change_of.get(each.place)
            how = _failure_text(each)
            if change is not None and change.worse:
                how = f"is {change.brief()}"
            parts.append(f"{_name(gate, each)} {how}")
    return f"{listed(parts, 'expectation')}." if parts else ""


def _tolerated(gate: Gate, ordered: Sequence[Tally]) -> str:
    """Return the differences and failures that don't speak against the build, in words."""
    parts = []
    for each in ordered:
        texts = []
        if each in gate.known:
            often = f"in {len(each.failed) or len(each.errors)} of {counted(each.trials, 'trial')}"
            texts.append(f"{gate.known_as}, {often}")
        change = gate.change_of.get(each.place)
        if change is not None and each not in gate.blocking:
            if change.differs:
                texts.append(f"is {change.brief()}")
            elif change.is_narrower:
                texts.append(change.nearer())
        if texts:
            parts.append(f"{_name(gate, each)} {' and '.join(texts)}")
    return f"{listed(parts, 'expectation')}." if parts else ""


def _requirements(gate: Gate) -> str:
    """Return how many requirements held, and which didn't or aren't covered."""
    if not gate.coverage:
        return ""
    by_verdict: dict[str, list[str]] = {}
    for row in gate.coverage:
        by_verdict.setdefault(row.verdict, []).append(row.requirement)
    held = len(by_verdict.pop(HELD, []))
    parts = [f"{held} of {counted(len(gate.coverage), 'requirement')} held"]
    parts += [f"{verdict}: {', '.join(ids)}" for verdict, ids in by_verdict.items()]
    return f"{'; '.join(parts)}."


def _open_questions(gate: Gate, ordered: Sequence[Tally]) -> str:
    """Return what remains open, how many more trials would show it, and what was left out."""
    parts = [_unseen(gate, ordered)] if gate.against else [_missed(gate), *_undecided(gate)]
    notes = [listed(gate.notes, "note")] if gate.notes else []
    text = "; ".join([*filter(None, parts), *notes])
    return f"{text}." if text else ""


def _undecided(gate: Gate) -> Iterator[str]:
    for each in gate.tallies:
        if each.verdict == UNDECIDED and each.claim is not None:
            more = counted(each.claim.seeds - each.trials, "more trial")
            yield f"{_name(gate, each)} can't be told yet: up to {more} would decide"
        elif each.verdict == UNTESTED and not each.fails:
            yield f"{_name(gate, each)} was never put to the test, which it may be"


def _units(each: Tally) -> int:
    """Return the number of independent trials: homes, if there are several."""
    homes = len({key.home for key in each.outcomes})
    return homes if homes > 1 else each.trials


def _excluded_rate(each: Tally) -> float:
    """Return the highest rate that an accepted claim excludes, as a share of the claimed one."""
    claim = each.claim
    assert claim is not None, "only what was judged is compared"
    return ERROR ** (1 / _units(each)) if claim.holds == 1 else claim.alternative / claim.holds


def _missed(gate: Gate) -> str:
    """Return how rare a failure the fewest trials may have missed, and how many more show it."""
    held = [each for each in gate.tallies if each.verdict == HELD and each.claim is not None]
    if not held:
        return ""
    each = min(held, key=_excluded_rate)
    claim = each.claim
    assert claim is not None, "only what was judged is told"
    name = gate.short[each.test]
    if claim.holds < 1:
        rates = f"{percent(claim.holds)} from {percent(claim.alternative)}"
        more = "up to four times as many would halve that difference"
        return f"{name} can't tell {rates} in {counted(claim.seeds, 'trial')}; {more}"
    number = _units(each)
    kind = "trial" if number == each.trials else "home"
    shown = _excluded_rate(each)
    text = f"What fails in less than {percent(1 - shown)} of {kind}s may have gone unseen"
    target = next((rate for rate in RATES if rate > shown), None)
    needed = None if target is None else seeds_for(1.0, target)
    if target is None or needed is None:
        return text
    more_of = f"{counted(needed - number, f'more {kind}')} of {name}"
    return f"{text}: {more_of} would show what fails in {percent(1 - target)}"


def _unseen(gate: Gate, ordered: Sequence[Tally]) -> str:
    """Return what the comparison leaves open."""
    if not gate.changes:
        return f"No trial of {gate.against} is the same: nothing is compared"
    pairs = sum(change.pairs for change in gate.changes)
    if any(change.differs for change in gate.changes):
        text = (
            f"The verdicts of {counted(pairs, 'pair')} were compared with {gate.against}; p values"
            f" are exact, and corrected for {counted(len(gate.changes), 'expectation')} (Holm)"
        )
        more = (_trials_needed(gate, each) for each in ordered)
        return "; ".join([text, *filter(None, more)][:2])
    units = min(change.pairs for change in gate.changes)
    rate = percent(1 - ERROR ** (1 / units))
    text = (
        f"All {counted(pairs, 'verdict')} are those of {gate.against}; what differs in less than"
        f" {rate} of trials may have gone unseen"
    )
    if not any(change.narrower or change.wider for change in gate.changes):
        text += "; nothing holds by more or less: do both builds differ in what these tests use?"
    return text


def _trials_needed(gate: Gate, each: Tally) -> str:
    """Return how many more trials would show a difference that isn't clear; empty if it is."""
    change = gate.change_of.get(each.place)
    if change is None or change.direction or change.worse_units == change.better_units:
        return ""
    for times in range(2, MAX_TIMES + 1):
        p = sign_test(times * change.worse_units, times * change.better_units)
        if p * len(gate.changes) <= ERROR:
            return (
                f"whether {each.name} differs for others, {times} times as many trials would show"
                " if they differ as often"
            )
    return ""


def _row(gate: Gate, each: Tally) -> dict[str, Any]:
    """Return a row of the table."""
    low, high = each.rate
    untested = sum(outcome.holds is None for outcome in each.outcomes.values())
    row = {"test": gate.short[each.test], "expectation": each.name or "–", "outcome": each.verdict}
    if any(tally.claim is not None and tally.claim.holds < 1 for tally in gate.tallies):
        row["claim"] = "–" if each.claim is None else percent(each.claim.holds)
    row["held"] = f"{each.held} of {each.trials}"
    if untested:
        row["held"] += f", {untested} untested"
    row["95 % interval"] = f"{percent(low)} to {percent(high)}" if each.outcomes else "–"
    row["margin"] = "–" if each.least_margin is None else margin_text(*each.least_margin)
    row["worst in"] = each.failed[0].label if each.failed else "–"
    if gate.against:
        change = gate.change_of.get(each.place)
        difference = "–"
        if change is not None:
            numbers = {"worse": change.worse, "better": change.better}
            parts = [f"{len(keys)} {word}" for word, keys in numbers.items() if keys]
            difference = ", ".join(parts) or "same"
        row[f"than {gate.against}"] = difference
    return row
