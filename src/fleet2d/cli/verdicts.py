"""Print verdicts on expectations."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

    from fleet2d.cli.scenario_case import ScenarioCase
    from fleet2d.expectations.verdict import Verdict


def print_expectations(console: "Console", expectations: Mapping[str, Mapping[str, Any]]) -> None:
    """Print the verdicts of a run's manifest."""
    for content in expectations.values():
        console.print(content["says"], highlight=False, markup=False, soft_wrap=True)


def print_cases(cases: "Sequence[ScenarioCase]") -> None:
    """Print a table of expectations, then the failures."""
    from rich.console import Console
    from rich.table import Table

    console = Console()
    table = Table("scenario", "expectation", "held", "at least by", show_edge=False)
    for source in dict.fromkeys(case.source for case in cases):
        cases_of_source = [case for case in cases if case.source == source]
        label = source
        for name in cases_of_source[0].scenario.expect:
            verdicts = [case.verdicts[name] for case in cases_of_source if name in case.verdicts]
            count = sum(verdict.holds for verdict in verdicts)
            table.add_row(label, name, f"{count} of {len(cases_of_source)}", _least(verdicts))
            label = ""
    console.print(table)
    for case in cases:
        _print_failure(console, case)
    failed = sum(case.fails for case in cases)
    runs = f"{len(cases)} run{'' if len(cases) == 1 else 's'}"
    console.print(f"{failed} of {runs} failed" if failed else f"all held: {runs}", highlight=False)


def _print_failure(console: "Console", case: "ScenarioCase") -> None:
    prefix = f"{case.source}, seed {case.seed}: "
    lines = [f"{prefix}{case.error}"] if case.error else []
    for verdict in case.verdicts.values():
        if not verdict.holds:
            lines += [f"{prefix}{verdict}", f"  to see it: {case.commands(verdict)}"]
    lines += [f"  stored: {path}" for path in case.files]
    for line in lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def _least(verdicts: "Sequence[Verdict]") -> str:
    """Return the least robustness of verdicts as text, else the least time to spare."""
    from math import isfinite

    from fleet2d.expectations.verdict import amount

    measured = [verdict for verdict in verdicts if isfinite(verdict.robustness)]
    if measured:
        worst = min(measured, key=lambda verdict: verdict.robustness)
        return amount(worst.robustness, worst.unit)
    slack = [verdict.slack_s for verdict in verdicts if verdict.slack_s is not None]
    return f"{min(slack):g} s to spare" if slack else ""
