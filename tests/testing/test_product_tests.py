"""The product tests of the examples: each holds, and fails where the robot is made worse for it."""

import importlib.util
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

from fleet2d.testing.claim import ATTRIBUTE
from fleet2d.testing.trials import run_claim

FOLDER = Path(__file__).parents[2] / "examples" / "product_tests"
WORSE = tomllib.loads((FOLDER / "worse.toml").read_text())


@pytest.fixture(scope="module")
def week() -> ModuleType:
    specification = importlib.util.spec_from_file_location("week", FOLDER / "test_week.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules["week"] = module
    specification.loader.exec_module(module)
    return module


def test_each_of_the_twelve_tests_has_a_worse_robot(week: ModuleType) -> None:
    tests = [name for name, value in vars(week).items() if hasattr(value, ATTRIBUTE)]
    assert 12 == len(tests)
    assert {name.removeprefix("test_") for name in tests} == WORSE.keys()


@pytest.mark.parametrize("name", WORSE)
def test_tests_pass_for_the_product_and_fail_for_a_worse_robot(week: ModuleType, name: str) -> None:
    function = getattr(week, f"test_{name}")
    claim = getattr(function, ATTRIBUTE)

    good = run_claim(claim, function)
    assert good.holds, [failure.text for trial in good.failed for failure in trial.failures]

    worse = replace(claim, overrides=(*claim.overrides, *WORSE[name]))
    bad = run_claim(worse, function)
    assert not bad.holds
