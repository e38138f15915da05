"""How verdicts are printed."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

    from fleet2d.cli.product_tests import Case
    from fleet2d.expectations.verdict import Verdict


def print_expectations(console: "Console", expectations: Mapping[str, Mapping[str, Any]]) -> None:
    """Print what became of the expectations of a run, as its manifest has it."""
    for content in expectations.values():
        console.print(content["says"], highlight=False, markup=False, soft_wrap=True)


def print_cases(cases: "Sequence[Case]") -> None:
    """Print a table of expectations, and what is wrong in words."""
    from rich.console import Console
    from rich.table import Table

    console = Console()
    table = Table("scenario", "expectation", "held", "at least by", show_edge=False)
    for source in dict.fromkeys(case.source for case in cases):
        mine = [case for case in cases if case.source == source]
        shown = source
        for name in mine[0].scenario.expect:
            verdicts = [case.verdicts[name] for case in mine if name in case.verdicts]
            held = sum(verdict.holds for verdict in verdicts)
            table.add_row(shown, name, f"{held} of {len(mine)}", _least(verdicts))
            shown = ""
    console.print(table)
    for case in cases:
        _print_failure(console, case)
    failed = sum(case.fails for case in cases)
    runs = f"{len(cases)} run{'' if len(cases) == 1 else 's'}"
    console.print(f"{failed} of {runs} failed" if failed else f"all held: {runs}", highlight=False)


def _print_failure(console: "Console", case: "Case") -> None:
    where = f"{case.source}, seed {case.seed}: "
    lines = [f"{where}{case.error}"] if case.error else []
    for verdict in case.verdicts.values():
        if not verdict.holds:
            lines += [f"{where}{verdict}", f"  shown again by: {case.again(verdict)}"]
    lines += [f"  kept: {path}" for path in case.files]
    for line in lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def _least(verdicts: "Sequence[Verdict]") -> str:
    """Write the least robustness of some verdicts, or the least time to spare."""
    from math import isfinite

    from fleet2d.expectations.verdict import amount

    known = [verdict for verdict in verdicts if isfinite(verdict.robustness)]
    if known:
        worst = min(known, key=lambda verdict: verdict.robustness)
        return amount(worst.robustness, worst.unit)
    slack = [verdict.slack_s for verdict in verdicts if verdict.slack_s is not None]
    return f"{min(slack):g} s to spare" if slack else ""
