"""Verdicts on a run's expectations, in a few words: a report of a run begins with them."""

from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

if TYPE_CHECKING:
    from fleet2d.runs.run import Run

VIOLATIONS = "violations"  # name of the table
MOST_NAMED = 3


Outcome = Literal["violated", "held", "not decided", "untested"]


class ExpectationVerdict(NamedTuple):
    """The verdict on an expectation of a run.

    Attributes:
        name: Its name.
        outcome: The outcome; `not decided` if it held as far as the run came.
        says: A sentence about the outcome.
        step: The first step of its first violation; None if it isn't violated.
    """

    name: str
    outcome: Outcome
    says: str
    step: int | None


def violations_of(run: "Run") -> dict[str, list[tuple[int, int]]]:
    """Return the first and last steps of violations in order, by name of the expectation.

    Raises:
        ArtifactError: The table of violations is damaged.
    """
    if VIOLATIONS not in run.tables:
        return {}
    table = run.tables[VIOLATIONS]
    columns = ("expectation", "step", "last_step")
    names, first, last = (table[column].to_pylist() for column in columns)
    violations: dict[str, list[tuple[int, int]]] = {}
    for name, begin, end in sorted(zip(names, first, last, strict=True)):
        violations.setdefault(name, []).append((begin, end))
    return violations


def verdicts_of(run: "Run") -> list[ExpectationVerdict]:
    """Return the verdicts on a run's expectations: violated ones first, in order of time.

    Raises:
        ArtifactError: The table of violations is damaged.
    """
    records = run.manifest.get("expectations") or {}
    violations = violations_of(run) if records else {}
    verdicts = []
    for name, record in records.items():
        outcome = _outcome(record)
        step = None
        if outcome == "violated":
            first_steps = [begin for begin, _ in violations.get(name, ())]
            step = first_steps[0] if first_steps else int(record.get("first", 0))
        says = str(record.get("says") or name)
        verdicts.append(ExpectationVerdict(name, outcome, says, step))
    return sorted(verdicts, key=lambda v: (v.step is None, v.step or 0))


def _outcome(record: Mapping[str, Any]) -> Outcome:
    holds = record.get("holds", True)
    if holds is None:
        return "untested"
    if not holds:
        return "violated"
    return "held" if record.get("decided", True) else "not decided"


def verdict_line(run: "Run", verdicts: list[ExpectationVerdict]) -> str:
    """Return the verdicts in one line; empty if there are none.

    Example:
        >>> import fleet2d
        >>> changes = ("simulation.duration=10 s", "expect.quiet=never(moving(ana))")
        >>> run = fleet2d.run("bundled:paper", *changes, seed=4)
        >>> verdict_line(run, verdicts_of(run))
        '1 of 1 expectation violated: quiet at Mon 05 Jan 00:00:01'
    """
    count = f"{len(verdicts)} expectation{'' if len(verdicts) == 1 else 's'}"
    violated = [(v.name, v.step) for v in verdicts if v.step is not None]
    if not verdicts:
        return ""
    if not violated:
        outcomes = Counter(verdict.outcome for verdict in verdicts)
        return f"{count}: {', '.join(f'{n} {outcome}' for outcome, n in outcomes.items())}"
    named = [f"{name} at {run.clock.time(step):%a %d %b %H:%M:%S}" for name, step in violated]
    more = f" and {len(named) - MOST_NAMED} more" if len(named) > MOST_NAMED else ""
    return f"{len(named)} of {count} violated: {', '.join(named[:MOST_NAMED])}{more}"
