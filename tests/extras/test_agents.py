"""The examples of learning agents: a minute of training, and a comparison in a home."""

import runpy
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fleet2d.entities.robots.policy import Policy

torch = pytest.importorskip("torch", reason="needs torch")
for name in ("gymnasium", "onnxruntime"):
    pytest.importorskip(name, reason=f"needs {name}")

AGENTS = Path(__file__).parents[2] / "examples" / "agents"


def script(name: str) -> dict[str, Any]:
    return runpy.run_path(str(AGENTS / f"{name}.py"), run_name="script")


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_trained_policy_is_compared_with_the_bundled_behavior(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    train, path = script("train"), tmp_path / "hangout.onnx"
    monkeypatch.setitem(train["Experience"].__init__.__globals__, "LIVES", 2)
    monkeypatch.setitem(train["Experience"].collect.__globals__, "HORIZON", 4)
    network = train["train"]("hangout", 0.01)
    train["export"](network, path)
    evaluate = script("evaluate")
    monkeypatch.setitem(
        evaluate["main"].__globals__, "BUNDLED", {"hangout": {"hangout": {"type": "hangout"}}}
    )
    monkeypatch.setattr(sys, "argv", ["evaluate.py", "hangout", str(path), "--homes", "1"])
    evaluate["main"]()

    lines = capsys.readouterr().out.splitlines()
    assert ["hangout", "last", "learned"] == [line.split()[0] for line in lines]


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_model_of_stable_baselines_becomes_the_policy_of_a_robot(tmp_path: Path) -> None:
    pytest.importorskip("sb3_contrib", reason="needs sb3-contrib")
    train, path = script("train_sb3"), tmp_path / "hangout.onnx"
    for function in ("train", "export"):
        train[function].__globals__["LIVES"] = 1
    model = train["train"]("hangout", 8, n_steps=8, batch_size=8, n_epochs=1, verbose=0)
    train["export"](model, path)
    behavior = Policy(file=path)
    observation = model.observation_space.sample()
    mask = np.ones(17, np.bool_)
    expected, _ = model.predict(observation, deterministic=True)

    assert int(expected) == behavior.act(observation, mask)


def test_searches_that_know_more_beat_a_search_where_somebody_was_seen_last(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    evaluate = script("evaluate")
    monkeypatch.setitem(evaluate["main"].__globals__, "BUNDLED", {"find": {}})
    argv = ["evaluate.py", "find", "--homes", "1", "--search"]
    monkeypatch.setattr(sys, "argv", argv)
    evaluate["main"]()
    lines = capsys.readouterr().out.splitlines()
    rewards = {line[:20].strip(): float(line[20:].split(",")[0]) for line in lines}

    assert rewards["knows the room"] > rewards["last seen"]
    assert rewards["find, ltp, exact"] > rewards["last seen"]


def test_written_policy_is_the_behavior_of_a_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("onnx", reason="needs onnx")
    path = tmp_path / "small.onnx"
    monkeypatch.setattr(sys, "argv", ["last_seen.py", str(path)])
    script("last_seen")["main"]()
    lines = capsys.readouterr().out.splitlines()

    assert ["hangout", "small.onnx"] == [line.split()[0] for line in lines]
    assert int(lines[1].split()[-2]) > 1


def test_learning_improves_a_policy_in_a_home() -> None:
    """The network learns to prefer the action that is rewarded."""
    train = script("train")
    torch.manual_seed(0)
    network = train["Network"](40)
    optimizer = torch.optim.Adam(network.parameters(), 1e-2)
    observations = torch.zeros(64, 16, 40)
    observations[:, :5, 0], observations[:, 2, 7] = 1, 1
    masks = torch.ones(64, 17, dtype=torch.bool)
    for _ in range(10):
        with torch.no_grad():
            choice, _ = network.choice(observations, masks)
            actions = choice.sample()
        gains = (actions == 2).float()
        batch = train["Batch"](observations, masks, actions, choice.log_prob(actions), gains, gains)
        train["improve"](network, optimizer, batch, 1.0)

    assert 0.5 < float(network.choice(observations, masks)[0].probs[0, 2].detach())
