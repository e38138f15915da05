"""Verdicts: whether an expectation holds, by how much, and when it was violated."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Any, NamedTuple

from fleet2d.configuration.units import format_duration
from fleet2d.errors import InputError
from fleet2d.expectations.expectation import (
    TINY,
    And,
    Expectation,
    Not,
    Or,
    RunSignals,
    Trace,
    number_text,
)
from fleet2d.expectations.signals import ANY_KIND, Signal, SignalComparison, WordComparison
from fleet2d.expectations.temporal import Temporal, Total, Violation, after, at_end, may_be_untested
from fleet2d.expectations.vocabulary import distance, during
from fleet2d.runtime.clock import DAY_S, HOUR_S, Clock


@dataclass(frozen=True)
class Verdict:
    """The result of judging an expectation.

    Attributes:
        name: Name of the expectation.
        expectation: Its text.
        holds: Whether it holds; during a run, whether it isn't violated yet. None: it was never put
            to the test, see `untested`.
        decided: Whether the rest of the run can't change `holds`.
        robustness: Margin by which it holds (above 0) or fails (below 0) [unit]; infinite for
            conditions that are only true or false.
        unit: Unit of the robustness: `m`, `m/s`, `share`, `times`, `1` for other numbers, `mixed`,
            and empty for conditions that are only true or false.
        slack_s: With a time limit: time to spare on the worst occasion [s]; below 0 if it was late,
            by at least that much if it never happened. None without a time limit.
        occasions: The number of judged occasions of `after`; None for other expectations.
        violations: The violations, in order of time.
        first: The first judged step.
        end: One past the last step that is known.
        clock: The clock of the run.
        untested: Why the run didn't put it to the test, such as that its trigger never happened.
        may_be_untested: Whether it may remain untested.
        notes: Notes on it, such as that the home lacks a kind of rooms.
    """

    name: str
    expectation: str
    holds: bool | None
    decided: bool
    robustness: float
    unit: str
    slack_s: float | None
    occasions: int | None
    violations: tuple[Violation, ...]
    first: int
    end: int
    clock: Clock
    untested: str = ""
    may_be_untested: bool = False
    notes: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """Whether it holds, or may be untested."""
        return not self.fails

    @property
    def fails(self) -> bool:
        """Whether it is violated, or untested where it must not be."""
        return self.holds is False or (self.holds is None and not self.may_be_untested)

    @property
    def worst(self) -> Violation | None:
        """The violation with the lowest robustness, the first if tied; None if it holds."""
        return min(self.violations, key=lambda v: v.robustness, default=None)

    @property
    def times(self) -> list[tuple[datetime, datetime]]:
        """The local times of the first and the last step of each violation."""
        return [(self.clock.time(v.first), self.clock.time(v.last)) for v in self.violations]

    def __str__(self) -> str:
        """Return a sentence: whether it held, and if not, when and by how much."""
        if self.holds is None:
            return f"{self.name} is untested: {self.untested}"
        if self.holds:
            return f"{self.name} {'held' if self.decided else 'holds so far'}{self._margin_words()}"
        return f"{self.name} is violated: {self.expectation}{self._violation_times()}"

    def _margin_words(self) -> str:
        if self.occasions == 0:
            return ", as its trigger hasn't happened yet"
        parts = []
        if math.isfinite(self.robustness):
            parts.append(f"by {amount(self.robustness, self.unit)}")
        if self.slack_s is not None:
            parts.append(f"with {duration_in_words(timedelta(seconds=self.slack_s))} to spare")
        return f" {', '.join(parts)}" if parts else ""

    def _violation_times(self) -> str:
        worst = self.worst
        if worst is None:
            return ""
        day = "%a %d %b %H:%M:%S"
        begin = self.clock.time(worst.first)
        end = self.clock.time(worst.last)
        step = timedelta(microseconds=self.clock.step_us)
        text = f", from {begin:{day}} to {end:%H:%M:%S} ({duration_in_words(end - begin + step)})"
        if end.date() != begin.date():
            text = f", from {begin:{day}} to {end:{day}}"
        if worst.first == worst.last:
            text = f", at {begin:{day}}"
        if math.isfinite(worst.robustness):
            text += f", by {amount(-worst.robustness, self.unit)}"
            if worst.worst != worst.first:
                text += f" at {self.clock.time(worst.worst):%H:%M:%S}"
        if len(self.violations) > 1:
            text += f"; the worst of {len(self.violations)} times"
        return text

    def content(self) -> dict[str, Any]:
        """Return the verdict as plain JSON data; an infinite robustness is null."""
        return {
            "expectation": self.expectation,
            "holds": self.holds,
            "decided": self.decided,
            "robustness": _finite(self.robustness),
            "unit": self.unit,
            "slack_s": self.slack_s,
            "occasions": self.occasions,
            "violations": len(self.violations),
            "first": self.first,
            "says": str(self),
            **({"untested": self.untested} if self.holds is None else {}),
            **({"notes": list(self.notes)} if self.notes else {}),
        }


class SignalCourse(NamedTuple):
    """A signal of an expectation over the run, and its bound.

    Attributes:
        text: The signal, or a condition that is 1 while it holds.
        unit: Its unit; empty for plain numbers and conditions.
        trace: Its values.
        limit: The limit of the comparison; None for a condition, or if it is a signal, too.
    """

    text: str
    unit: str
    trace: Trace
    limit: float | None


class VerdictEvidence(NamedTuple):
    """The signals and names in an expectation, for pictures.

    Attributes:
        signals: Its signals.
        places: The names and kinds of rooms that it names, among other names.
        distances: The pairs of bodies, or of a body and a place, whose distance it measures.
    """

    signals: tuple[SignalCourse, ...]
    places: frozenset[str]
    distances: tuple[tuple[str, str | tuple[float, float]], ...]


def evidence_of(expectation: Expectation, run: RunSignals) -> VerdictEvidence:
    """Return the evidence for an expectation from the signals of a run."""
    courses: dict[str, SignalCourse] = {}
    places: set[str] = set()
    for atom in _atoms(expectation):
        if isinstance(atom, SignalComparison):
            limit = atom.limit if isinstance(atom.limit, float) else None
            signals = [s for s in (atom.signal, atom.limit) if isinstance(s, Signal)]
            courses |= {str(s): SignalCourse(str(s), s.unit, s.trace(run), limit) for s in signals}
        else:
            holds = atom.robustness(run, False).map(lambda value: (value > 0).astype(float))
            courses[str(atom)] = SignalCourse(str(atom), "", holds, None)
        if isinstance(atom, WordComparison):
            places |= {word.removeprefix(ANY_KIND) for word in atom.words}
    distances = [m for m in expectation.measures() if isinstance(m, distance)]
    pairs = [(m.body, m.other) for m in distances if isinstance(m.other, str | tuple)]
    places |= {other for _, other in pairs if isinstance(other, str)}
    return VerdictEvidence(tuple(courses.values()), frozenset(places), tuple(dict.fromkeys(pairs)))


def _atoms(expectation: Expectation) -> Iterator[Expectation]:
    """Yield the elementary conditions of an expectation."""
    parts = [part for part in expectation.parts() if isinstance(part, Expectation)]
    for part in parts:
        yield from _atoms(part)
    if not parts and not isinstance(expectation, during):
        yield expectation


def verdict_of(name: str, expectation: Expectation, run: RunSignals, text: str = "") -> Verdict:
    """Return the verdict on an expectation from the signals of a run; `text` is its wording."""
    best = expectation.robustness(run, True).at(run.first)
    worst = best if run.ended else expectation.robustness(run, False).at(run.first)
    slack = expectation.slack(run) if isinstance(expectation, Temporal) else None
    untested = expectation.untested(run) if run.ended and best > 0 else ""
    inner = expectation.part if isinstance(expectation, may_be_untested) else expectation
    text = text or str(expectation)
    return Verdict(
        name or text,
        text,
        None if untested else best > 0,
        run.ended or best < 0 or worst > 0,
        worst if worst > 0 else best,
        expectation.unit,
        None if slack is None else slack * run.clock.step_us / 1e6,
        len(inner.judged(run)) if isinstance(inner, after) else None,
        tuple(_violations(expectation, run)) if best < 0 else (),
        run.first,
        run.end,
        run.clock,
        untested,
        inner is not expectation,
    )


def is_decided(expectation: Expectation, run: RunSignals) -> bool:
    """Return whether the rest of a run can't change a verdict any more."""
    first = run.first
    return (
        expectation.robustness(run, True).at(first) < 0
        or expectation.robustness(run, False).at(first) > 0
    )


def _violations(expectation: Expectation, run: RunSignals) -> list[Violation]:
    if isinstance(expectation, Temporal):
        return expectation.violations(run)
    value = expectation.robustness(run, True).at(run.first)
    if value > 0:
        return []
    if isinstance(expectation, And) and not isinstance(expectation, Or):
        parts = expectation.one, expectation.other
        return sorted(v for part in parts for v in _violations(part, run))
    return [Violation(run.first, run.end - 1, value, run.first)]


def check_judged(expectation: object) -> Expectation:
    """Return the expectation if it has a time operator; sums count at the end without one.

    Raises:
        InputError: It has no time operator, or is no expectation.
    """
    if not isinstance(expectation, Expectation):
        raise InputError(
            f"{expectation!r} is not an expectation: write one like"
            ' always(distance("ana", "astro") > 0.5)'
        )
    expectation = _sums_at_end(expectation)
    if not expectation.is_judged:
        raise InputError(
            f"{expectation} has no time operator: write always(…), never(…), eventually(…),"
            " at_end(…), until(…), after(…) or at_most(…)"
        )
    return expectation


def _sums_at_end(expectation: Expectation) -> Expectation:
    if isinstance(expectation, And):
        one = _sums_at_end(expectation.one)
        other = _sums_at_end(expectation.other)
        return replace(expectation, one=one, other=other)
    if isinstance(expectation, Not):
        return ~_sums_at_end(expectation.part)
    if not isinstance(expectation, SignalComparison) or not isinstance(expectation.signal, Total):
        return expectation
    if (per := expectation.signal.per) is not None:
        raise InputError(
            f"{expectation} says nothing of each {per}: write always(…) around it, or never(…)"
            f" around its opposite, which judge each step by its {per} so far (a share with `of`"
            f" is missing before that), or at_end(…) for the last {per} alone"
        )
    return at_end(expectation)


def amount(value: float, unit: str) -> str:
    """Format a margin with its unit, to three digits.

    >>> amount(0.2138, "m"), amount(0.031, "share"), amount(2.0, "times")
    ('0.214 m', '3.1 %', '2 times')
    """
    value = 0.0 if abs(value) <= TINY else float(f"{value:.3g}")
    return number_text(value, "" if unit in ("1", "mixed") else unit)


def _finite(value: float) -> float | None:
    if not math.isfinite(value):
        return None
    return 0.0 if abs(value) <= TINY else value


def duration_in_words(duration: timedelta) -> str:
    """Format a duration in days, hours, minutes and seconds.

    >>> duration_in_words(timedelta(seconds=9514))
    '2 h 38 min 34 s'
    >>> duration_in_words(timedelta(seconds=40.5))
    '40.5 s'
    """
    parts = []
    remainder = duration
    for unit, length in (("d", DAY_S), ("h", HOUR_S), ("min", 60)):
        count, remainder = divmod(remainder, timedelta(seconds=length))
        parts += [f"{count} {unit}"] if count else []
    return " ".join(parts + ([format_duration(remainder)] if remainder or not parts else []))
