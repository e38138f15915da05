"""Networks are code: none is read by another name, or while no code may run."""

import shutil
from pathlib import Path

import pytest

from fleet2d.configuration.networks import open_network
from fleet2d.configuration.trust import running_code
from fleet2d.errors import InputError, ScenarioError

GOOD = Path(__file__).parent.parent / "hostile" / "bombs" / "pol-good.onnx"


def test_a_network_by_another_name_is_not_read(tmp_path):
    """The list of code names networks by their suffix."""
    path = shutil.copy(GOOD, tmp_path / "good.bin")
    with pytest.raises(InputError, match=r"its suffix isn't \.onnx"):
        open_network(path, ())


def test_no_network_is_read_while_no_code_may_run():
    with (
        running_code(allowed=False),
        pytest.raises(ScenarioError, match=r"would run .*pol-good\.onnx, which is not trusted"),
    ):
        open_network(GOOD, ())
