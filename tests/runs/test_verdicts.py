"""The verdicts of a run in a line: what is violated comes first, and when."""

import pyarrow as pa
import pytest

import fleet2d
from fleet2d.runs.run import Tables
from fleet2d.runs.verdicts import verdict_line, verdicts_of

HELD = {"holds": True, "decided": True, "says": "it held"}
OPEN = {"holds": True, "decided": False, "says": "it holds so far"}
UNTESTED = {"holds": None, "decided": True, "says": "it is untested"}
VIOLATED = {"holds": False, "decided": True, "says": "it is violated"}


def run_with(expectations, violations):
    run = fleet2d.run("bundled:paper", "simulation.duration=10 s", seed=4)
    names, first, last = ([row[i] for row in violations] for i in range(3))
    table = pa.table({"expectation": names, "step": first, "last_step": last})
    run.tables = Tables(["violations"], {"violations": table}.__getitem__)
    run.manifest["expectations"] = expectations
    return run


@pytest.mark.parametrize(
    ("expectations", "line"),
    [
        ({}, ""),
        ({"a": HELD}, "1 expectation: 1 held"),
        ({"a": HELD, "b": OPEN}, "2 expectations: 1 held, 1 not decided"),
        ({"a": UNTESTED, "b": HELD}, "2 expectations: 1 untested, 1 held"),
        ({"a": HELD, "b": VIOLATED}, "1 of 2 expectations violated: b at Mon 05 Jan 00:00:05"),
        (
            {"c": VIOLATED, "b": VIOLATED, "a": HELD},
            "2 of 3 expectations violated: b at Mon 05 Jan 00:00:05, c at Mon 05 Jan 00:00:07",
        ),
        (
            dict.fromkeys("bcdef", VIOLATED),
            "5 of 5 expectations violated: d at Mon 05 Jan 00:00:00, e at Mon 05 Jan 00:00:00,"
            " f at Mon 05 Jan 00:00:00 and 2 more",
        ),
    ],
)
def test_violated_expectations_are_named_with_their_first_moment(expectations, line):
    run = run_with(expectations, [("c", 7, 8), ("b", 9, 9), ("b", 5, 6)])
    assert line == verdict_line(run, verdicts_of(run))
