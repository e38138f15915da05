"""The marks of the timeline: interventions, and stretches in which expectations held or not."""

from collections.abc import Iterable, Mapping
from typing import Any, Literal

from fleet2d.runs.run import Run
from fleet2d.viewer.facts.contract import MarkFacts

INTERVENTIONS = "interventions"
VIOLATIONS = "violations"  # name of the table


def marks_of(run: Run) -> list[MarkFacts]:
    """Return the marks of a run's interventions and expectations.

    Raises:
        ArtifactError: The table of violations is damaged.
    """
    manifest = run.manifest
    marks = intervention_marks(manifest.get("interventions") or ())
    verdicts = manifest.get("expectations") or {}
    violations = _violations(run) if verdicts else {}
    for name, verdict in verdicts.items():
        marks += expectation_marks(name, verdict, violations.get(name, []), manifest["steps"])
    return marks


def intervention_marks(records: Iterable[Mapping[str, Any]]) -> list[MarkFacts]:
    """Return the marks of interventions, from the records of a manifest."""
    return [
        MarkFacts(
            lane=INTERVENTIONS,
            step=int(record["step"]),
            end=int(record["step"]) + 1,
            kind="intervention",
            label=intervention_label(record),
        )
        for record in records
    ]


def intervention_label(record: Mapping[str, Any]) -> str:
    """Return a short label of an intervention.

    >>> intervention_label({"do": "change", "step": 4, "change": {"shut": "bath_door", "at": None}})
    'shut bath_door'
    >>> intervention_label({"do": "put", "step": 4, "entity": "ana", "x": 5, "by": "script.0"})
    'put ana (script.0)'
    """
    change = record.get("change")
    fields = change if isinstance(change, Mapping) else record
    parts = [value for key, value in fields.items() if isinstance(value, str) and key != "by"]
    if isinstance(change, Mapping):
        parts = next(([key, value] for key, value in change.items() if value), ["change"])
    by = f" ({record['by']})" if record.get("by") else ""
    return " ".join(str(part) for part in parts[:3]) + by


def expectation_marks(
    name: str, verdict: Mapping[str, Any], violations: Iterable[tuple[int, int]], steps: int
) -> list[MarkFacts]:
    """Return the stretches of a run in which an expectation held, or was violated.

    Args:
        name: The name of the expectation.
        verdict: The verdict of the manifest.
        violations: The first and last step of each violation, in order.
        steps: The number of steps of the run.

    Example:
        >>> marks = expectation_marks("quiet", {"holds": False}, [(10, 19)], 100)
        >>> [(mark["step"], mark["end"], mark["kind"]) for mark in marks]
        [(0, 10, 'held'), (10, 20, 'violated'), (20, 100, 'held')]
    """
    label = str(verdict.get("says") or verdict.get("expectation") or name)
    marks: list[MarkFacts] = []

    def add(step: int, end: int, kind: Literal["held", "violated", "open"]) -> None:
        if end > step:
            marks.append(MarkFacts(lane=name, step=step, end=end, kind=kind, label=label))

    end_of_last, is_decided = 0, verdict.get("decided", True)
    for first, last in violations:
        add(end_of_last, first, "held")
        add(max(end_of_last, first), last + 1, "violated")
        end_of_last = max(end_of_last, last + 1)
    is_violated = not marks and not verdict.get("holds", True)
    add(end_of_last, steps, "violated" if is_violated else "held" if is_decided else "open")
    return marks


def _violations(run: Run) -> dict[str, list[tuple[int, int]]]:
    """Return the first and last steps of violations in order, by name of the expectation."""
    if VIOLATIONS not in run.tables:
        return {}
    table = run.tables[VIOLATIONS]
    columns = ("expectation", "step", "last_step")
    names, first, last = (table[column].to_pylist() for column in columns)
    violations: dict[str, list[tuple[int, int]]] = {}
    for name, begin, end in sorted(zip(names, first, last, strict=True)):
        violations.setdefault(name, []).append((begin, end))
    return violations
