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
from fleet2d.testing.claim import nested_rate_interval, percent
from fleet2d.testing.suite import SuiteTest, TrialKey, TrialOutcome, TrialReport

ERROR = 0.05
"""Largest probability that any expectation is called worse or better if none differs."""
MAX_LISTED = 6
HELD, FAILED, UNTESTED, UNDECIDED, BROKEN = "held", "failed", "untested", "undecided", "can't run"
NOT_COVERED = "not covered"
NOT_RUN = "not run"
RANKING = (BROKEN, FAILED, UNTESTED, UNDECIDED, NOT_RUN, HELD)
"""Verdicts, the worst first: a requirement has that of its worst expectation."""
Place = tuple[str, str]
"""The names of a test and of an expectation."""


@dataclass(frozen=True, eq=False)
class Tally:
    """What came of an expectation in all trials of a build.

    Attributes:
        test: The name of the test.
        name: The name of the expectation; empty for trials that ended before any was judged.
        outcomes: Its outcomes by trial.
        errors: The trials that couldn't be run, or broke.
        accepted: Whether the claim of its test was accepted; None if trials are too few for that.
    """

    test: str
    name: str
    outcomes: Mapping[TrialKey, TrialOutcome]
    errors: tuple[TrialReport, ...] = ()
    accepted: bool | None = True

    @property
    def title(self) -> str:
        """The expectation with its test, and with what it covers."""
        covers = sorted({r for outcome in self.outcomes.values() for r in outcome.covers})
        return f"{self.name} of {self.test}" + (f" ({', '.join(covers)})" if covers else "")

    @property
    def covers(self) -> frozenset[str]:
        """The requirements that it covers."""
        return frozenset(r for outcome in self.outcomes.values() for r in outcome.covers)

    @property
    def failed(self) -> list[TrialKey]:
        """The trials in which it failed, the worst first."""
        failed = [key for key, outcome in self.outcomes.items() if outcome.fails]
        return sorted(failed, key=lambda key: _depth(self.outcomes[key]))

    @property
    def verdict(self) -> str:
        """What is to be said of it, as one of `RANKING`."""
        if self.errors:
            return BROKEN
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
    def rate(self) -> tuple[float, float]:
        """The 95 % interval of the share of trials in which it doesn't fail; (0, 1) without any."""
        by_home: dict[str, list[bool]] = {}
        for key, outcome in self.outcomes.items():
            by_home.setdefault(key.home, []).append(not outcome.fails)
        return nested_rate_interval(list(by_home.values())) if by_home else (0.0, 1.0)

    def sentence(self) -> str:
        """Return what failed in how many trials, and how in the worst."""
        number = len(self.outcomes) + len(self.errors)
        if self.errors:
            first = self.errors[0]
            what = f"{self.test} can't be run in {len(self.errors)} of {counted(number, 'trial')}"
            return f"{what}, first in {first.key.label}: {first.error}"
        failed = self.failed
        if not failed:
            return f"{self.title}: {self.verdict} in {counted(number, 'trial')}"
        worst = failed[0]
        text = f"{self.title}: failed in {len(failed)} of {counted(number, 'trial')}"
        where = f", worst in {worst.label}" if len(failed) > 1 else f", in {worst.label}"
        return f"{text}{where}: {self.outcomes[worst].says}"


def _depth(outcome: TrialOutcome) -> tuple[bool, float]:
    """Return what sorts failures, the worst first: violations before what was untested."""
    return outcome.holds is None, -math.inf if outcome.margin is None else outcome.margin


def tally(tests: Sequence[SuiteTest], reports: Sequence[TrialReport]) -> list[Tally]:
    """Return a tally for each expectation of each test that was run."""
    tallies: list[Tally] = []
    for test in tests:
        of_test = [report for report in reports if report.key.test == test.name]
        errors = tuple(report for report in of_test if report.error)
        outcomes: dict[str, dict[TrialKey, TrialOutcome]] = {}
        for report in of_test:
            for outcome in report.outcomes:
                outcomes.setdefault(outcome.name, {})[report.key] = outcome
        accepted = None
        if of_test and not errors:
            accepted = test.decide([report.holds for report in of_test])
        tallies += [Tally(test.name, n, each, (), accepted) for n, each in outcomes.items()]
        if errors:
            tallies.append(Tally(test.name, "", {}, errors))
    return tallies


class PairedChange(NamedTuple):
    """How an expectation differs between two builds in the trials that both had.

    Attributes:
        test: The name of the test.
        name: The name of the expectation.
        pairs: The number of pairs of trials.
        worse: The trials in which it fails now, and didn't before.
        better: The trials in which it failed before, and doesn't now.
        units: What counts as independent: home, if there are several, or else trial.
        worse_units: How many units have more trials that are worse than that are better.
        better_units: The other way round.
        p: Exact two-sided p value of such a difference if builds don't differ (McNemar's test).
        p_holm: The same, corrected for the number of expectations.
        shift: Median change of the margin where it differs [unit]; None if it doesn't.
        unit: Unit of the shift.
        narrower: How many units have a smaller margin.
        wider: How many have a larger one.
        p_shift: p value of that (sign test), corrected for the number of expectations.
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
    def title(self) -> str:
        """The expectation with its test."""
        return f"{self.name} of {self.test}"

    def words(self) -> str:
        """Return in how many trials it differs, in which, and whether that may be chance."""
        pairs = counted(self.pairs, "trial")
        if not self.worse and not self.better:
            return f"the same verdict in all {pairs}"
        numbers = {"worse": len(self.worse), "better": len(self.better)}
        parts = [f"{word} in {number}" for word, number in numbers.items() if number]
        text = f"{' and '.join(parts)} of {pairs}"
        if self.units == "home":
            text += f", in {self.worse_units} homes worse and in {self.better_units} better"
        doubt = "" if self.direction else ", not shown for other trials"
        text += f" (p = {self.p_holm:.2g}{doubt})"
        return f"{text}: {listed(self.worse or self.better)}"

    def nearer(self) -> str:
        """Return by how much less it holds."""
        number = counted(self.narrower + self.wider, self.units)
        by = amount(-(self.shift or 0.0), self.unit)
        return (
            f"holds by less in {self.narrower} of {number} that differ, by {by} in the median"
            f" (p = {self.p_shift:.2g})"
        )


def listed(keys: Sequence[TrialKey]) -> str:
    """Return the labels of trials, the first few."""
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
    before = {(each.test, each.name): each.outcomes for each in old}
    changes = []
    for each in new:
        earlier = before.get((each.test, each.name), {})
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
        median(filter(None, shifts.values())) if any(shifts.values()) else None,
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
    """A requirement, and what covers it.

    Attributes:
        requirement: Its id.
        text: What it says; empty if there is no list of requirements.
        verdicts: The verdict of each expectation that covers it.
    """

    requirement: str
    text: str
    verdicts: Mapping[Place, str]

    @property
    def verdict(self) -> str:
        """The worst of them; or that there are none."""
        return min(self.verdicts.values(), key=RANKING.index, default=NOT_COVERED)


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
        InputError: An expectation covers a requirement that isn't among them.
    """
    rows: dict[str, dict[Place, str]] = {name: {} for name in requirements or ()}
    for each in tallies:
        for requirement in sorted(each.covers):
            if requirements is not None and requirement not in requirements:
                raise InputError(
                    f"{each.name} of {each.test} covers {requirement}, which isn't among the"
                    f" requirements{suggest(requirement, requirements)}"
                )
            rows.setdefault(requirement, {})[each.test, each.name] = each.verdict
    texts = requirements if requirements is not None else dict.fromkeys(sorted(rows), "")
    return [RequirementCoverage(name, text, rows[name]) for name, text in texts.items()]


@dataclass(frozen=True)
class Gate:
    """All that is known about a build when it is to be released.

    Attributes:
        build: The name of the build; empty if it has none.
        tallies: The tallies of its expectations.
        against: The name of the build that it is compared with; empty for none.
        before: The tallies of that build.
        changes: How expectations differ between both.
        coverage: The requirements and what covers them.
        trend: By build of the history, oldest first: how often each expectation held, of how many.
        notes: What was left out, and the like.
    """

    build: str
    tallies: Sequence[Tally]
    against: str = ""
    before: Sequence[Tally] = ()
    changes: Sequence[PairedChange] = ()
    coverage: Sequence[RequirementCoverage] = ()
    trend: Mapping[str, Mapping[Place, tuple[int, int]]] = field(default_factory=dict)
    notes: Sequence[str] = ()

    @cached_property
    def change_of(self) -> Mapping[Place, PairedChange]:
        """The changes by test and expectation."""
        return {(change.test, change.name): change for change in self.changes}

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
        """What speaks against a release.

        Without another build that is all that fails; else what is clearly worse, what fails and
        didn't, and what can't be run.
        """
        failing = {(each.test, each.name) for each in self.before if each.fails}
        found = []
        for each in self.tallies:
            place = each.test, each.name
            is_known = place in failing and each.verdict != BROKEN
            change = self.change_of.get(place)
            if (each.fails and not is_known) or (change is not None and change.direction < 0):
                found.append(each)
        return found

    @property
    def known(self) -> list[Tally]:
        """What fails with both builds, and isn't clearly worse."""
        return [each for each in self.tallies if each.fails and each not in self.blocking]

    @property
    def passes(self) -> bool:
        """Whether nothing speaks against a release."""
        return not self.blocking

    def headline(self) -> str:
        """Return the verdict in one sentence."""
        name = self.build or "the build"
        number = len([each for each in self.tallies if each.name])
        tests = counted(number, "expectation")
        trials = len({key for each in self.tallies for key in _trials(each)})
        after = f"after {counted(trials, 'trial')}"
        if not self.passes:
            broken = len({each.test for each in self.blocking if each.verdict == BROKEN})
            worse = len([each for each in self.blocking if each.name])
            is_one = worse == 1
            what = "fails" if is_one else "fail"
            if self.against:
                what = f"{'is' if is_one else 'are'} worse than with {self.against}"
            parts = [f"{worse} of {tests} {what}"] if worse else []
            parts += [f"{counted(broken, 'test')} can't be run"] if broken else []
            return f"{name} doesn't pass: {' and '.join(parts)}, {after}"
        if self.against and self.changes:
            than = f"is shown to be worse than with {self.against}"
            known = f", {len(self.known)} of them failing with both" if self.known else ""
            return f"{name} passes: none of {tests} {than}{known}, {after}"
        held = sum(each.verdict == HELD for each in self.tallies)
        return f"{name} passes: {held} of {tests} held, {after}"

    def sentences(self, hints: Mapping[Tally, str] | None = None) -> Iterator[str]:
        """Yield what the verdict rests on, what else differs, and what can't be told.

        Args:
            hints: How to see failures.
        """
        for each in self.blocking:
            change = self.change_of.get((each.test, each.name))
            yield each.sentence()
            if change is not None:
                yield f"  compared with {self.against}: {change.words()}"
            if hints and hints.get(each):
                yield f"  {hints[each]}"
        yield from self.summary()
        for each in self.known:
            yield f"fails with {self.against}, too: {each.sentence()}"

    def reason(self, each: Tally) -> str:
        """Return why something speaks against a release: by the comparison, if there is one."""
        change = self.change_of.get((each.test, each.name))
        return each.sentence() if change is None else f"{each.title}: {change.words()}"

    def summary(self) -> Iterator[str]:
        """Yield what differs without speaking against a release, and what can't be told."""
        blocking = {(each.test, each.name) for each in self.blocking}
        for change in self.changes:
            is_different = change.worse or change.better
            if is_different and (change.test, change.name) not in blocking:
                yield f"{change.title}: {change.words()}"
            elif change.is_narrower and not is_different:
                yield f"{change.title}: {change.nearer()}"
        if self.against:
            yield self._unseen()
        yield from self._requirements()
        yield from self.notes

    def _unseen(self) -> str:
        """Return what the comparison can't tell."""
        if not self.changes:
            return f"no trial of {self.against} is the same: nothing is compared"
        pairs = sum(change.pairs for change in self.changes)
        if any(change.worse or change.better for change in self.changes):
            return (
                f"{counted(pairs, 'pair')} of verdicts were compared with {self.against}; p values"
                f" are exact, and corrected for {counted(len(self.changes), 'expectation')} (Holm)"
            )
        units = min(change.pairs for change in self.changes)
        rate = percent(1 - ERROR ** (1 / units))
        return (
            f"all {counted(pairs, 'verdict')} are those of {self.against}; what differs in less"
            f" than {rate} of trials may have gone unseen"
        )

    def _requirements(self) -> Iterator[str]:
        if not self.coverage:
            return
        by_verdict: dict[str, list[str]] = {}
        for row in self.coverage:
            by_verdict.setdefault(row.verdict, []).append(row.requirement)
        held = len(by_verdict.pop(HELD, []))
        parts = [f"{held} of {counted(len(self.coverage), 'requirement')} held"]
        parts += [f"{verdict}: {', '.join(ids)}" for verdict, ids in by_verdict.items()]
        yield "; ".join(parts)

    def content(self) -> dict[str, Any]:
        """Return it as plain JSON data."""
        return {
            "verdict": self.headline(),
            "passes": self.passes,
            "build": self.build,
            "against": self.against,
            "says": list(self.sentences()),
            "expectations": [
                {
                    "test": each.test,
                    "expectation": each.name,
                    "covers": sorted(each.covers),
                    "verdict": each.verdict,
                    "trials": len(each.outcomes) + len(each.errors),
                    "held": each.held,
                    "failed": [key.label for key in each.failed],
                    "rate": list(each.rate),
                }
                for each in self.tallies
            ],
            "changes": [
                {
                    **change._asdict(),
                    "worse": [key.label for key in change.worse],
                    "better": [key.label for key in change.better],
                }
                for change in self.changes
            ],
            "coverage": [
                {
                    "requirement": row.requirement,
                    "text": row.text,
                    "verdict": row.verdict,
                    "by": [[*place, verdict] for place, verdict in row.verdicts.items()],
                }
                for row in self.coverage
            ],
            "history": {
                build: [[*place, *numbers] for place, numbers in row.items()]
                for build, row in self.trend.items()
            },
            "notes": list(self.notes),
        }


def _trials(tally: Tally) -> list[TrialKey]:
    return [*tally.outcomes, *(report.key for report in tally.errors)]
