"""Sums of floats."""

import builtins
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

import fleet2d
from fleet2d.runtime.determinism import sum_in_order

EXAMPLES = Path(__file__).parent.parent / "examples"


def test_floats_are_added_one_after_the_other() -> None:
    values = [1e16, 1.0, -1e16, 0.1]
    assert sum_in_order(values) == ((1e16 + 1.0) - 1e16) + 0.1 == 0.1


@pytest.mark.parametrize(
    "scenario",
    [
        [None],
        [EXAMPLES / "family.yaml"],
        [EXAMPLES / "learning_robot.yaml"],
        [EXAMPLES / "smart_home.yaml"],
        [None, "floorplan={type: synthetic, area_m2: 60}"],
    ],
)
def test_a_run_adds_no_floats_by_the_built_in_sum(
    scenario: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The mover's distance of the bundled month had another last digit in Python 3.13 than in 3.11."""
    calls: set[str] = set()
    built_in = builtins.sum

    def checked(values: Iterable[Any], start: Any = 0) -> Any:
        total = built_in(values, start)
        caller = sys._getframe(1)
        if type(total) is float and caller.f_globals["__name__"].startswith("fleet2d"):
            calls.add(f"{caller.f_code.co_filename}:{caller.f_lineno}")
        return total

    monkeypatch.setattr(builtins, "sum", checked)
    fleet2d.run(*scenario, "simulation.duration=1 d", seed=4)
    assert not calls
