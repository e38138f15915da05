"""Networks in ONNX files from somebody else: one that never ends, needs 10 GB, or gives NaN."""

import os
import shutil
from pathlib import Path

import pytest

import fleet2d
from fleet2d.configuration.trust import code_lines, running_code
from fleet2d.errors import ComponentError, Fleet2DError, InputError

pytest.importorskip("onnxruntime", reason="onnxruntime isn't installed")
BOMBS = Path(__file__).parent / "bombs"


def content(file):
    return {
        "floorplan": {"type": "synthetic", "seed": 0, "area_m2": 80},
        "simulation": {"start": "2026-01-05", "duration": "2 h", "seed": 1},
        "users": {"ana": {"type": "routine", "persona": "retired"}},
        "robots": {"astro": {"behaviors": [{"type": "policy", "file": str(file)}]}},
    }


def model(file):
    algorithms = {
        "rtp": {"type": "real_time_presence", "model": {"type": "onnx", "file": str(file)}}
    }
    return {**content(file), "robots": {}, "algorithms": algorithms}


@pytest.fixture
def stored(tmp_path):
    """A run that names a network, and the network."""
    file = tmp_path / "policy.onnx"
    shutil.copy(BOMBS / "pol-good.onnx", file)
    fleet2d.run(content(file), out=tmp_path / "run")
    return tmp_path / "run", file


@pytest.mark.parametrize("bomb", ["pol-loop", "pol-expand"])
def test_a_network_that_a_stored_run_names_runs_only_if_it_is_trusted(stored, bomb):
    """`reproduce` computed for ever, or filled the memory."""
    run, file = stored
    shutil.copy(BOMBS / f"{bomb}.onnx", file)
    with pytest.raises(InputError) as caught:
        fleet2d.reproduce(run)
    assert str(file) in str(caught.value)
    assert "robots.astro.behaviors.0.file" in str(caught.value)
    assert "None of it has run" in str(caught.value)


def test_a_trusted_network_of_a_stored_run_is_computed(stored):
    assert fleet2d.reproduce(stored[0], trust=True).same


@pytest.mark.parametrize("name", ["pol-loop.onnx", "~/own.onnx", "../own.onnx"])
def test_networks_of_behaviors_and_of_models_are_listed_as_code(name):
    for scenario in (content(Path(name)), model(Path(name))):
        (line,) = code_lines(scenario)
        assert ".onnx" in line
        assert ".file" in line


def test_a_link_with_another_suffix_leads_to_no_network(tmp_path):
    """The list names files by their suffix."""
    (tmp_path / "loop.bin").symlink_to(BOMBS / "pol-loop.onnx")
    with running_code(allowed=False), pytest.raises(InputError, match=r"trusted|suffix"):
        fleet2d.Simulation(model(tmp_path / "loop.bin"))


def test_a_policy_that_returns_nan_is_named_with_its_step():
    """It drove to the first room, as if it had chosen it."""
    words = r"robots\.astro failed at step 0: .*pol-nan\.onnx returned NaN, not a number"
    with pytest.raises(ComponentError, match=words):
        fleet2d.run(content(BOMBS / "pol-nan.onnx"))


@pytest.mark.parametrize("kind", ["fifo", "dev", "dir", "empty", "text", "trunc", "sparse"])
def test_what_is_no_network_is_refused_before_the_run(tmp_path, kind):
    path = tmp_path / f"{kind}.onnx"
    match kind:
        case "fifo":
            os.mkfifo(path)
        case "dev":
            path.symlink_to("/dev/zero")
        case "dir":
            path.mkdir()
        case "sparse":
            with path.open("wb") as file:
                file.truncate(5 << 30)
        case _:
            whole = (BOMBS / "pol-good.onnx").read_bytes()
            path.write_bytes({"empty": b"", "text": b"hello\n", "trunc": whole[:90]}[kind])
    for scenario in (content(path), model(path)):
        with pytest.raises(Fleet2DError) as caught:
            fleet2d.Simulation(scenario)
        assert isinstance(caught.value, InputError)
        assert "\n" not in str(caught.value)
