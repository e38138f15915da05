"""Examples of programs that decide for a robot: a behavior tree, a planner, a language model."""

import runpy
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples" / "live"

pytestmark = pytest.mark.slow


def test_a_behavior_tree_finds_her(capsys):
    pytest.importorskip("py_trees", reason="py_trees is not installed")
    runpy.run_path(str(EXAMPLES / "tree.py"))
    assert capsys.readouterr().out == "the tree ends in SUCCESS\n"


def test_a_plan_of_pddl_is_carried_out(capsys):
    pytest.importorskip("pyperplan", reason="pyperplan is not installed")
    runpy.run_path(str(EXAMPLES / "plan.py"))
    lines = capsys.readouterr().out.splitlines()
    done = [line.split(" do ")[1] for line in lines if " do " in line]
    assert sorted(done) == ["oven kitchen_1", "plants living_room_1"]  # in an order of the planner
    assert lines == sorted(lines)  # times


def test_a_language_model_answers_from_a_run(capsys):
    pytest.importorskip("mcp", reason="the extra mcp is not installed")
    runpy.run_path(str(EXAMPLES / "talk.py"))
    *calls, answer = capsys.readouterr().out.splitlines()
    assert [call.partition(":")[0] for call in calls] == [
        "components", "write", "check", "run", "stays",
    ]  # fmt: skip
    assert answer.startswith("She sleeps 10.")


def test_each_is_short():
    for name in ("tree", "plan", "talk"):
        assert len((EXAMPLES / f"{name}.py").read_text().splitlines()) <= 60
