"""Train a policy by MaskablePPO of Stable-Baselines3, and write it as a file for robots.

    pip install "fleet2d[gym,onnx]" sb3-contrib onnxscript
    python examples/agents/train.py hangout hangout.onnx --decisions 300000

The settings are the defaults of Stable-Baselines3 but for shorter rollouts and rewards that are
scaled to a variance of one. Its flat network knows a room by its number, so it sees many homes.
"""

import argparse
from pathlib import Path
from typing import Any

import torch
from sb3_contrib import MaskablePPO
from sb3_contrib.common.maskable.policies import MaskableActorCriticPolicy
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from torch import Tensor, nn

from fleet2d.learning.gym import RobotEnv

TASKS = ("hangout", "find", "patrol", "interact")
LIVES, HORIZON = 8, 256


class Scores(nn.Module):
    """The part of a policy that scores the actions."""

    def __init__(self, policy: MaskableActorCriticPolicy) -> None:
        super().__init__()
        self.policy = policy

    def forward(self, observation: Tensor) -> Tensor:
        """Return the scores (n, rows + 1) for observations (n, rows, columns)."""
        features = observation.flatten(1)
        return self.policy.action_net(self.policy.mlp_extractor.forward_actor(features))


def train(task: str, decisions: int, seed: int = 0, **settings: Any) -> MaskablePPO:
    """Return a model after some decisions; see MaskablePPO for its settings."""
    torch.set_num_threads(1)
    lives = DummyVecEnv([lambda: RobotEnv(task) for _ in range(LIVES)])
    scaled = VecNormalize(lives, norm_obs=False)
    options = {"n_steps": HORIZON, "device": "cpu", "verbose": 1} | settings
    return MaskablePPO("MlpPolicy", scaled, seed=seed, **options).learn(decisions)


def export(model: MaskablePPO, path: Path) -> None:
    """Write the scores of a policy as an ONNX file with the input `observation`."""
    example = torch.zeros(1, *model.observation_space.shape)
    names = {"input_names": ["observation"], "output_names": ["scores"]}
    scores = Scores(model.policy).eval()
    torch.onnx.export(scores, (example,), str(path), dynamo=False, **names)


def main() -> None:
    """Train, and write the policy."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", choices=TASKS)
    parser.add_argument("file", type=Path)
    parser.add_argument("--decisions", type=int, default=300_000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    export(train(arguments.task, arguments.decisions, arguments.seed), arguments.file)
    print(arguments.file)


if __name__ == "__main__":
    main()
