"""The gate: what trials of one build, or of two on the same trials, say about a release."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from fleet2d.configuration.documents import read_document
from fleet2d.configuration.problems import counted, suggest
from fleet2d.errors import InputError
from fleet2d.expectations.verdict import amount
from fleet2d.studies.answers import holm
from fleet2d.testing.claim import RateTest, nested_rate_interval
from fleet2d.testing.suite import SuiteTest, TrialKey, TrialOutcome, TrialReport

ERROR = 0.05
"""Largest probability that any expectation is called worse or better if none differs."""
MAX_LISTED = 6
HELD = "held"
FAILED = "failed"
UNTESTED = "untested"
UNDECIDED = "undecided"
BROKEN = "can't run"
NOT_COVERED = "not covered"
NOT_RUN = "not run"
RANKING = (BROKEN, FAILED, UNTESTED, UNDECIDED, NOT_RUN, HELD)
"""Verdicts, the worst first: a requirement has the worst of its expectations."""
Place = tuple[str, str]
"""The names of a test and of an expectation."""


@dataclass(frozen=True, eq=False)
class Tally:
    """The outcomes of an expectation in all trials of a build.

    Attributes:
        test: The name of the test.
        name: The name of the expectation; empty for trials that ended before any was judged.
        outcomes: Its outcomes by trial.
        errors: The trials that couldn't be run, or broke.
        accepted: Whether the claim of its test was accepted; None if trials are too few for that.
        claim: The claim of its test; None if no trial could be judged.
        declared: The requirements that it covers by its scenario.
    """

    test: str
    name: str
    outcomes: Mapping[TrialKey, TrialOutcome]
    errors: tuple[TrialReport, ...] = ()
    accepted: bool | None = True
    claim: RateTest | None = None
    declared: frozenset[str] = frozenset()

    @property
    def place(self) -> Place:
        """The names of its test and of the expectation."""
        return self.test, self.name

    @property
    def title(self) -> str:
        """The expectation with its test and its requirements."""
        covers = f" ({', '.join(sorted(self.covers))})" if self.covers else ""
        return f"{self.name} of {self.test}{covers}"

    @property
    def covers(self) -> frozenset[str]:
        """The requirements that it covers."""
        return self.declared.union(*(outcome.covers for outcome in self.outcomes.values()))

    @property
    def trials(self) -> int:
        """The number of its trials."""
        return len(self.outcomes) + len(self.errors)

    @property
    def failed(self) -> list[TrialKey]:
        """The trials in which it failed, the worst first."""
        failed = [key for key, outcome in self.outcomes.items() if outcome.fails]
        return sorted(failed, key=lambda key: _depth(self.outcomes[key]))

    @property
    def verdict(self) -> str:
        """The verdict, one of `RANKING`."""
        if self.errors:
            return BROKEN
        if not self.outcomes:
            return NOT_RUN
        if self.accepted is None:
            return UNDECIDED
        if self.failed and not self.accepted:
            is_untested = all(self.outcomes[key].holds is None for key in self.failed)
            return UNTESTED if is_untested else FAILED
        return HELD if any(o.holds for o in self.outcomes.values()) else UNTESTED

    @property
    def fails(self) -> bool:
        """Whether it speaks against its build."""
        return self.verdict in (BROKEN, FAILED) or (self.verdict == UNTESTED and bool(self.failed))

    @property
    def held(self) -> int:
        """The number of trials in which it held."""
        return sum(outcome.holds is True for outcome in self.outcomes.values())

    @property
    def least_margin(self) -> tuple[float, str] | None:
        """Its lowest margin, with the unit; None without margins."""
        outcomes = self.outcomes.values()
        return min(((o.margin, o.unit) for o in outcomes if o.margin is not None), default=None)

    @property
    def rate(self) -> tuple[float, float]:
        """The 95 % interval of the share of trials without a failure; (0, 1) without trials."""
        by_home: dict[str, list[bool]] = {}
        for key, outcome in self.outcomes.items():
            by_home.setdefault(key.home, []).append(not outcome.fails)
        return nested_rate_interval(list(by_home.values())) if by_home else (0.0, 1.0)

    def content(self) -> dict[str, Any]:
        """Return the tally as plain JSON data."""
        return {
            "test": self.test,
            "expectation": self.name,
            "covers": sorted(self.covers),
            "verdict": self.verdict,
            "trials": self.trials,
            "held": self.held,
            "failed": [key.label for key in self.failed],
            "rate": list(self.rate),
        }

    def sentence(self) -> str:
        """Return a sentence that says in how many trials it failed, and how in the worst."""
        number = counted(self.trials, "trial")
        if self.errors:
            first = self.errors[0]
            what = f"{self.test} can't be run in {len(self.errors)} of {number}"
            return f"{what}, first in {first.key.label}: {first.error}"
        failed = self.failed
        if self.verdict == NOT_RUN:
            return f"{self.title}: not run"
        if not failed:
            return f"{self.title}: {self.verdict} in {number}"
        worst = failed[0]
        text = f"{self.title}: failed in {len(failed)} of {number}"
        where = f", worst in {worst.label}" if len(failed) > 1 else f", in {worst.label}"
        return f"{text}{where}: {self.outcomes[worst].says}"


def _depth(outcome: TrialOutcome) -> tuple[bool, float]:
    """Return the sort key of failures, the worst first: violations before untested outcomes."""
    return outcome.holds is None, -math.inf if outcome.margin is None else outcome.margin


def tally(tests: Sequence[SuiteTest], reports: Sequence[TrialReport]) -> list[Tally]:
    """Return a tally for each expectation of each test that was run."""
    by_test: dict[str, list[TrialReport]] = {}
    for report in reports:
        by_test.setdefault(report.key.test, []).append(report)
    tallies: list[Tally] = []
    for test in tests:
        of_test = by_test.get(test.name, [])
        if not of_test and not test.function:
            tallies += _not_run(test)
        accepted = claim = None
        if of_test and not any(report.error for report in of_test):
            claim = test.rate(len(of_test))
            accepted = claim.judge([report.holds for report in of_test])
        tallies += tallies_of(test.name, of_test, accepted, claim)
    return tallies


def _not_run(test: SuiteTest) -> list[Tally]:
    """Return the tallies of a scenario of which no trial was run."""
    expected = test.variants()[0].scenario.expect
    return [
        Tally(test.name, name, {}, accepted=None, declared=frozenset(each.covers))
        for name, each in expected.items()
    ]


def tallies_of(
    test: str, reports: Sequence[TrialReport], accepted: bool | None, claim: RateTest | None
) -> list[Tally]:
    """Return a tally for each expectation of a test, and one of the trials that couldn't be run."""
    outcomes: dict[str, dict[TrialKey, TrialOutcome]] = {}
    for report in reports:
        for outcome in report.outcomes:
            outcomes.setdefault(outcome.name, {})[report.key] = outcome
    tallies = [Tally(test, name, each, (), accepted, claim) for name, each in outcomes.items()]
    errors = tuple(report for report in reports if report.error)
    return [*tallies, Tally(test, "", {}, errors)] if errors else tallies


class PairedChange(NamedTuple):
    """The changes of an expectation between two builds, in the trials that both had.

    Attributes:
        test: The name of the test.
        name: The name of the expectation.
        pairs: The number of pairs of trials.
        worse: The trials in which it fails now, and didn't before.
        better: The trials in which it failed before, and doesn't now.
        units: The independent unit: home, if there are several, or else trial.
        worse_units: The number of units in which more trials are worse than better.
        better_units: The number of units in which more trials are better than worse.
        p: Exact two-sided p value of such a difference if builds don't differ (McNemar's test).
        p_holm: The same, corrected for the number of expectations.
        shift: Median change of the margin where it differs [unit]; None if it doesn't.
        unit: Unit of the shift.
        narrower: The number of units with a smaller margin.
        wider: The number of units with a larger margin.
        p_shift: p value of the shift (sign test), corrected for the number of expectations.
    """

    test: str
    name: str
    pairs: int
    worse: tuple[TrialKey, ...]
    better: tuple[TrialKey, ...]
    units: str
    worse_units: int
    better_units: int
    p: float
    p_holm: float
    shift: float | None
    unit: str
    narrower: int
    wider: int
    p_shift: float

    @property
    def direction(self) -> int:
        """Whether it is clearly better (1), clearly worse (-1), or neither (0)."""
        if self.p_holm > ERROR:
            return 0
        return 1 if self.better_units > self.worse_units else -1

    @property
    def is_narrower(self) -> bool:
        """Whether it clearly holds by less."""
        return self.p_shift <= ERROR and self.narrower > self.wider

    @property
    def place(self) -> Place:
        """The names of the test and of the expectation."""
        return self.test, self.name

    @property
    def title(self) -> str:
        """The expectation with its test."""
        return f"{self.name} of {self.test}"

    @property
    def differs(self) -> bool:
        """Whether any verdict differs."""
        return bool(self.worse or self.better)

    def content(self) -> dict[str, Any]:
        """Return the change as plain JSON data."""
        worse = [key.label for key in self.worse]
        better = [key.label for key in self.better]
        return {**self._asdict(), "worse": worse, "better": better}

    def words(self) -> str:
        """Return in how many trials it differs, in which, and whether that may be chance."""
        keys = self.worse or self.better
        return f"{self.brief()}: {listed(keys)}" if keys else self.brief()

    def brief(self) -> str:
        """Return in how many trials it differs, and whether that may be chance."""
        pairs = counted(self.pairs, "trial")
        if not self.differs:
            return f"the same verdict in all {pairs}"
        numbers = {"worse": len(self.worse), "better": len(self.better)}
        parts = [f"{word} in {number}" for word, number in numbers.items() if number]
        text = f"{' and '.join(parts)} of {pairs}"
        if self.units == "home":
            text += f", in {self.worse_units} homes worse and in {self.better_units} better"
        doubt = "" if self.direction else ", not shown for other trials"
        return f"{text} (p = {self.p_holm:.2g}{doubt})"

    def nearer(self) -> str:
        """Return in how many units it holds by less, and by how much."""
        number = counted(self.narrower + self.wider, self.units)
        by = amount(-(self.shift or 0.0), self.unit)
        return (
            f"holds by less in {self.narrower} of {number} that differ, by {by} in the median"
            f" (p = {self.p_shift:.2g})"
        )


def listed(keys: Sequence[TrialKey]) -> str:
    """Return the labels of the first few trials."""
    more = [f"and {len(keys) - MAX_LISTED} more"] if len(keys) > MAX_LISTED else []
    return "; ".join([*(key.label for key in keys[:MAX_LISTED]), *more])


def sign_test(fewer: int, more: int) -> float:
    """Return the exact two-sided p value of so many changes in one direction and in the other.

    >>> sign_test(0, 6), sign_test(3, 3), sign_test(0, 0)
    (0.03125, 1.0, 1.0)
    """
    number = fewer + more
    ways = sum(math.comb(number, k) for k in range(min(fewer, more) + 1))
    return min(1.0, 2 * ways / 2**number)


def compare(new: Sequence[Tally], old: Sequence[Tally]) -> list[PairedChange]:
    """Return how each expectation differs between two builds, p values corrected by Holm's method.

    Trials of several homes count by homes, as those of one home are no independent pairs.
    """
    before = {each.place: each.outcomes for each in old}
    changes = []
    for each in new:
        earlier = before.get(each.place, {})
        pairs = {
            key: (outcome, earlier[key])
            for key, outcome in each.outcomes.items()
            if key in earlier and _is_tested(outcome) and _is_tested(earlier[key])
        }
        if pairs:
            changes.append(_change(each, pairs))
    verdicts = holm([change.p for change in changes])
    shifts = holm([change.p_shift for change in changes])
    return [
        change._replace(p_holm=p, p_shift=shift)
        for change, p, shift in zip(changes, verdicts, shifts, strict=True)
    ]


def _is_tested(outcome: TrialOutcome) -> bool:
    return outcome.holds is not None or outcome.fails


def _change(
    tally: Tally, pairs: Mapping[TrialKey, tuple[TrialOutcome, TrialOutcome]]
) -> PairedChange:
    several = len({key.home for key in pairs}) > 1
    signs = {key: int(old.fails) - int(new.fails) for key, (new, old) in pairs.items()}
    shifts = {
        key: new.margin - old.margin
        for key, (new, old) in pairs.items()
        if new.margin is not None and old.margin is not None and new.unit == old.unit
    }
    worse_units, better_units = _by_unit(signs, several)
    narrower, wider = _by_unit(shifts, several)
    differing = list(filter(None, shifts.values()))
    units = {new.unit for new, _ in pairs.values()}
    return PairedChange(
        tally.test,
        tally.name,
        len(pairs),
        tuple(key for key, sign in signs.items() if sign < 0),
        tuple(key for key, sign in signs.items() if sign > 0),
        "home" if several else "trial",
        worse_units,
        better_units,
        sign_test(worse_units, better_units),
        1.0,
        median(differing) if differing else None,
        units.pop() if len(units) == 1 else "",
        narrower,
        wider,
        sign_test(narrower, wider),
    )


def _by_unit(values: Mapping[TrialKey, float], several: bool) -> tuple[int, int]:
    """Return how many units have a negative sum, and how many a positive one."""
    sums: dict[object, list[float]] = {}
    for key, value in values.items():
        sums.setdefault(key.home if several else key, []).append(value)
    totals = [math.fsum(each) for each in sums.values()]
    return sum(total < 0 for total in totals), sum(total > 0 for total in totals)


class RequirementCoverage(NamedTuple):
    """A requirement and the expectations that cover it.

    Attributes:
        requirement: Its id.
        text: Its text; empty if there is no list of requirements.
        verdicts: The verdict of each expectation that covers it.
    """

    requirement: str
    text: str
    verdicts: Mapping[Place, str]

    @property
    def verdict(self) -> str:
        """The worst of the verdicts, or `NOT_COVERED`."""
        return min(self.verdicts.values(), key=RANKING.index, default=NOT_COVERED)

    def content(self) -> dict[str, Any]:
        """Return the coverage as plain JSON data."""
        return {
            "requirement": self.requirement,
            "text": self.text,
            "verdict": self.verdict,
            "by": [[*place, verdict] for place, verdict in self.verdicts.items()],
        }


def read_requirement_list(path: Path) -> dict[str, str]:
    """Return the requirements of a YAML file by id: a mapping of ids and texts.

    Raises:
        InputError: The file can't be read, or isn't such a mapping.
    """
    data = read_document(path).data
    if wrong := next((n for n, text in data.items() if not isinstance(text, str)), None):
        raise InputError(f"{path}: {wrong}: expected a text, as in `REQ-12: finds Ana`")
    return {str(name): text for name, text in data.items()}


def cover(
    tallies: Sequence[Tally], requirements: Mapping[str, str] | None
) -> list[RequirementCoverage]:
    """Return the coverage of requirements by the expectations of tests.

    Raises:
        InputError: An expectation covers a requirement that isn't listed.
    """
    rows: dict[str, dict[Place, str]] = {name: {} for name in requirements or ()}
    for each in tallies:
        for requirement in sorted(each.covers):
            if requirements is not None and requirement not in requirements:
                raise InputError(
                    f"{each.name} of {each.test} covers {requirement}, which isn't among the"
                    f" requirements{suggest(requirement, requirements)}"
                )
            rows.setdefault(requirement, {})[each.place] = each.verdict
    texts = requirements if requirements is not None else dict.fromkeys(sorted(rows), "")
    return [RequirementCoverage(name, text, rows[name]) for name, text in texts.items()]


@dataclass(frozen=True)
class Gate:
    """All that trials tell about a build before its release.

    Attributes:
        build: The name of the build; empty if it has none.
        tallies: The tallies of its expectations.
        against: The name of the build that it is compared with; empty for none.
        before: The tallies of that build.
        changes: How expectations differ between both.
        coverage: The requirements and the expectations that cover them.
        trend: How often each expectation held, of how many trials, by build; the oldest first.
        notes: Remarks, such as on tests that were left out.
        cost: A sentence with the number of trials and the time that they took.
        expected: The tests that are expected to fail.
    """

    build: str
    tallies: Sequence[Tally]
    against: str = ""
    before: Sequence[Tally] = ()
    changes: Sequence[PairedChange] = ()
    coverage: Sequence[RequirementCoverage] = ()
    trend: Mapping[str, Mapping[Place, tuple[int, int]]] = field(default_factory=dict)
    notes: Sequence[str] = ()
    cost: str = ""
    expected: frozenset[str] = frozenset()

    @cached_property
    def change_of(self) -> Mapping[Place, PairedChange]:
        """The changes by test and expectation."""
        return {change.place: change for change in self.changes}

    @cached_property
    def short(self) -> Mapping[str, str]:
        """The names of tests for tables, without files and folders where they are unique."""
        names = {
            each.test: each.test.partition("::")[2] or Path(each.test).name for each in self.tallies
        }
        unique = len(set(names.values())) == len(names)
        return names if unique else {test: test for test in names}

    @cached_property
    def blocking(self) -> list[Tally]:
        """The expectations that speak against a release.

        Without another build these are all that fail unexpectedly; else those that are clearly
        worse, that fail only now, or that can't be run.
        """
        failing = {each.place for each in self.before if each.fails}
        found = []
        for each in self.tallies:
            failed_before = each.place in failing and each.verdict != BROKEN
            is_known = failed_before or each.test in self.expected
            change = self.change_of.get(each.place)
            is_worse = change is not None and change.direction < 0
            if is_worse or (each.fails and not is_known):
                found.append(each)
        return found

    @cached_property
    def known(self) -> list[Tally]:
        """The expectations that fail with both builds, not clearly worse, or as expected."""
        return [each for each in self.tallies if each.fails and each not in self.blocking]

    @property
    def known_as(self) -> str:
        """Why known failures don't speak against a release, in words."""
        return f"fails with {self.against}, too" if self.against else "fails as expected"

    @property
    def passes(self) -> bool:
        """Whether nothing speaks against a release."""
        return not self.blocking

    def details(self, hints: Mapping[Tally, str]) -> Iterator[str]:
        """Yield lines that say what failed, how, and how to see it."""
        for each in self.blocking:
            change = self.change_of.get(each.place)
            yield each.sentence()
            if change is not None:
                yield f"  compared with {self.against}: {change.words()}"
            if hints.get(each):
                yield f"  {hints[each]}"
        for each in self.known:
            yield f"{self.known_as}: {each.sentence()}"

    def content(self) -> dict[str, Any]:
        """Return the gate as plain JSON data."""
        return {
            "passes": self.passes,
            "build": self.build,
            "against": self.against,
            "expectations": [each.content() for each in self.tallies],
            "changes": [change.content() for change in self.changes],
            "coverage": [row.content() for row in self.coverage],
            "history": {build: _held_by_place(row) for build, row in self.trend.items()},
            "notes": list(self.notes),
        }


def _held_by_place(row: Mapping[Place, tuple[int, int]]) -> list[list[str | int]]:
    """Return test, expectation, and how often it held of how many, as rows."""
    return [[*place, *numbers] for place, numbers in row.items()]
