"""The file of an experiment: all that can't be trained or scored is told before the first run."""

from pathlib import Path

import pytest
import yaml
from tests.learning.transfer.homes import write_home

from fleet2d.errors import ScenarioError
from fleet2d.learning.transfer.specification import TransferPlan, read_plan


def plan(folder: Path, homes, **keys) -> TransferPlan:
    content = {"tasks": ["room in 60 min"], "days": [0, 3], "homes": homes, **keys}
    path = folder / "homes.yaml"
    path.write_text(yaml.safe_dump(content))
    return read_plan(path)


@pytest.fixture
def homes(tmp_path):
    """Two homes that are fit."""
    return {
        name: {"path": str(write_home(tmp_path / f"{name}.txt", 9, shift_min=shift))}
        for name, shift in (("one", 0), ("two", 5))
    }


def test_a_fit_file_has_a_cell_for_each_arm_that_has_its_days(tmp_path, homes):
    made = plan(tmp_path, homes, learners=["usual"])
    arms = {cell[3:] for cell in made.cells if cell.home == "one"}
    assert {("real", 0), ("survey", 0), ("own", 3), ("fitted", 3), ("copied", 3)} <= arms
    assert not {("own", 0), ("fitted", 0), ("survey", 3), ("simulated", 3)} & arms
    assert {} == made.unfit
    assert [3, 4, 5, 6, 7, 8] == made.tested["one"].tolist()


ODD = {
    "three days": ({"days": 3}, {}, "3 days of its own leave 0 to test on, of the 3"),
    "a week's holiday": (
        {"days": 12, "silent": range(3, 10)},
        {},
        "3 days of its own leave 2 to test on, of the 5 that are known",
    ),
    "one sensor": (
        {"days": 9, "labels": dict.fromkeys(("Bathroom", "Bedroom", "LivingRoom", "OutsideDoor"), "")},
        {},
        "3 days of its own leave 0 to test on, of the 0 that are known",
    ),
    "rooms without kinds": (
        {"days": 9, "labels": {r: f"M{n:03}" for n, r in enumerate(("Bathroom", "Bedroom", "Kitchen", "LivingRoom", "OutsideDoor"))}},
        {},
        r"its labels \(M000, M001, M002, M003, M004\) name no kind of room: say which they are",
    ),
    "a label that isn't there": ({"days": 9}, {"rooms": {"M9": "kitchen"}}, "no label 'M9'"),
    "a person of a log without persons": ({"days": 9}, {"id": "ben"}, "takes no id"),
}  # fmt: skip


@pytest.mark.parametrize("case", ODD)
def test_an_odd_home_is_named_with_its_reason_and_left_out_if_asked(tmp_path, homes, case):
    made, keys, reason = ODD[case]
    odd = {"path": str(write_home(tmp_path / "odd.txt", **made)), **keys}
    with pytest.raises(ScenarioError, match=f"odd: .*{reason}") as caught:
        plan(tmp_path, {**homes, "odd": odd})
    assert "`skip: unfit` leaves them out and counts" in str(caught.value)
    assert "one: " not in str(caught.value)

    without = plan(tmp_path, {**homes, "odd": odd}, skip="unfit")
    assert any(text.startswith("odd: ") and n for text, n in without.unfit.items())
    assert {"one", "two"} <= {cell.home for cell in without.cells}


def test_all_that_is_unfit_is_told_at_once(tmp_path, homes):
    short = {"path": str(write_home(tmp_path / "short.txt", 3))}
    blind = {"path": str(write_home(tmp_path / "blind.txt", 9)), "rooms": {"M9": "kitchen"}}
    with pytest.raises(ScenarioError) as caught:
        plan(tmp_path, {**homes, "short": short, "blind": blind})
    assert {"short", "blind"} == {
        line.partition(":")[0] for line in str(caught.value).splitlines()[1:]
    }


def test_a_single_home_has_no_others_to_learn_from(tmp_path, homes):
    with pytest.raises(ScenarioError, match="one: there is no other real home"):
        plan(tmp_path, {"one": homes["one"]})


def test_a_wrong_key_is_named_with_its_line(tmp_path, homes):
    with pytest.raises(ScenarioError, match=r"homes.yaml:\d+.*test_day"):
        plan(tmp_path, homes, test_day=4)
