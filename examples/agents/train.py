"""Train a policy by PPO (Schulman et al. 2017), and write it as a file that a robot can follow.

    pip install "fleet2d[gym,onnx]" torch onnxscript
    python examples/agents/train.py hangout hangout.onnx --minutes 60

The network scores every room by the same weights, so it applies to homes of any size. Decisions
last differently long: the discount from one to the next is that of the time between them.
"""

import argparse
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.distributions import Categorical

from fleet2d.learning.gym import VectorRobotEnv

LIVES, HORIZON, EPOCHS, BATCHES, WIDTH = 16, 128, 4, 4, 64
HALF_LIFE_S = {"hangout": 4 * 3600.0, "find": 600.0, "patrol": 3600.0}
TRACE, CLIP, ENTROPY, RATE = 0.95, 0.2, 0.01, 1e-3


class Network(nn.Module):
    """Scores of all actions, and the value of the situation."""

    def __init__(self, columns: int) -> None:
        super().__init__()
        layers = nn.Linear(columns, WIDTH), nn.Tanh(), nn.Linear(WIDTH, WIDTH), nn.Tanh()
        self.room = nn.Sequential(*layers)
        self.both = nn.Sequential(nn.Linear(2 * WIDTH, WIDTH), nn.Tanh())
        self.score, self.rest, self.worth = (nn.Linear(WIDTH, 1) for _ in range(3))
        for layer in (self.score, self.rest):
            nn.init.normal_(layer.weight, std=0.01)

    def forward(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Return the scores (n, rooms + 1) and the values (n,)."""
        exists = observation[:, :, :1]
        rooms = self.room(observation)
        home = (rooms * exists).sum(1, keepdim=True) / exists.sum(1, keepdim=True)
        rooms = self.both(torch.cat([rooms, home.expand_as(rooms)], dim=2))
        home = self.both(torch.cat([home, home], dim=2))
        scores = torch.cat([self.score(rooms)[:, :, 0], self.rest(home)[:, :, 0]], dim=1)
        return scores, self.worth(home)[:, 0, 0]

    def choice(self, observation: Tensor, mask: Tensor) -> tuple[Categorical, Tensor]:
        """Return the distribution over the possible actions, and the values."""
        scores, values = self(observation)
        return Categorical(logits=scores.masked_fill(~mask, -1e9)), values


class Batch(NamedTuple):
    """Decisions to learn from; a row each."""

    observations: Tensor
    masks: Tensor
    actions: Tensor
    chances: Tensor  # logarithms of the probabilities with which they were chosen
    advantages: Tensor
    targets: Tensor  # of the values


class Experience:
    """VectorRobotEnv that go on while the network learns from them."""

    def __init__(self, task: str, seed: int) -> None:
        self.lives, self.half_life_s = VectorRobotEnv(LIVES, task=task), HALF_LIFE_S[task]
        self.observation, info = self.lives.reset(seed=seed)
        self.mask, self.over = info["action_mask"], np.zeros(LIVES, np.bool_)
        self.returns: list[float] = []  # of lives that are over
        self._sum, self._scale = np.zeros(LIVES), 0.0

    def collect(self, network: Network) -> Batch:
        """Let all lives go on by some decisions."""
        steps: list[tuple[Any, ...]] = []
        counts, rewards, discounts, values = [], [], [], []
        for _ in range(HORIZON):
            observation, mask = torch.from_numpy(self.observation), torch.from_numpy(self.mask)
            with torch.no_grad():
                choice, value = network.choice(observation, mask)
                action = choice.sample()
            steps.append((observation, mask, action, choice.log_prob(action)))
            counts.append(~self.over)  # a step that begins a new life is no decision
            values.append(value.numpy())
            reward, discount = self._step(action.numpy())
            rewards.append(reward)
            discounts.append(discount)
        with torch.no_grad():
            values.append(network(torch.from_numpy(self.observation))[1].numpy())
        spread = max(float(np.std(rewards)), 1e-3)
        self._scale = 0.9 * self._scale + 0.1 * spread if self._scale else spread
        advantages, trace = np.zeros((HORIZON, LIVES), np.float32), np.zeros(LIVES)
        counts.append(~self.over)
        for t in reversed(range(HORIZON)):
            error = rewards[t] / self._scale + discounts[t] * values[t + 1] - values[t]
            advantages[t] = trace = error + discounts[t] * TRACE * trace * counts[t + 1]
        rows = torch.from_numpy(np.flatnonzero(np.concatenate(counts[:HORIZON])))
        kept = [torch.cat(columns) for columns in zip(*steps, strict=True)]
        gains = torch.from_numpy(advantages), torch.from_numpy(advantages + np.stack(values[:-1]))
        return Batch(*(column[rows] for column in (*kept, *(gain.reshape(-1) for gain in gains))))

    def _step(self, actions: Any) -> tuple[Any, Any]:
        """Return the rewards of some actions, and the discount after each."""
        self.observation, reward, terminated, truncated, info = self.lives.step(actions)
        self.mask, self.over = info["action_mask"], terminated | truncated
        self._sum += reward
        self.returns += self._sum[self.over].tolist()
        self._sum[self.over] = 0
        return reward, 0.5 ** (info["elapsed_s"] / self.half_life_s) * ~terminated


def improve(network: Network, optimizer: torch.optim.Optimizer, batch: Batch, left: float) -> None:
    """Learn from some decisions; `left` is the part of the training that is left."""
    for _ in range(EPOCHS):
        for rows in torch.randperm(len(batch.actions)).chunk(BATCHES):
            part = Batch(*(column[rows] for column in batch))
            choice, values = network.choice(part.observations, part.masks)
            ratio = (choice.log_prob(part.actions) - part.chances).exp()
            gains = part.advantages
            gains = (gains - gains.mean()) / (gains.std() + 1e-8)
            surrogate = torch.min(ratio * gains, ratio.clamp(1 - CLIP, 1 + CLIP) * gains).mean()
            loss = 0.5 * (values - part.targets).square().mean() - surrogate
            loss -= ENTROPY * left * choice.entropy().mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(network.parameters(), 0.5)
            optimizer.step()


def train(task: str, minutes: float, seed: int = 0) -> Network:
    """Return the network after some time of learning; print the mean return every minute."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    experience = Experience(task, seed)
    network = Network(experience.observation.shape[-1])
    optimizer = torch.optim.Adam(network.parameters(), RATE, eps=1e-5)
    began, decisions, reports, past_s = time.time(), 0, 0, 0.0
    while past_s < 60 * minutes:
        left = 1 - past_s / (60 * minutes)
        optimizer.param_groups[0]["lr"] = RATE * max(left, 0.05)
        batch = experience.collect(network)
        improve(network, optimizer, batch, left)
        decisions, past_s = decisions + len(batch.actions), time.time() - began
        if past_s > 60 * reports and experience.returns:
            reports, mean = int(past_s / 60) + 1, np.mean(experience.returns[-100:])
            print(f"{past_s:6.0f} s, {decisions:9,} decisions, return {mean:.1f}", flush=True)
    return network


def export(network: Network, path: Path) -> None:
    """Write the scores of a network as an ONNX file with the input `observation`."""

    class Scores(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.network = network

        def forward(self, observation: Tensor) -> Tensor:
            return self.network(observation)[0]

    example = torch.zeros(1, 16, network.room[0].in_features)
    example[:, 0, 0] = 1
    names = {"input_names": ["observation"], "output_names": ["scores"]}
    torch.onnx.export(Scores().eval(), (example,), str(path), dynamo=False, **names)


def main() -> None:
    """Train, and write the policy."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", choices=list(HALF_LIFE_S))
    parser.add_argument("file", type=Path)
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    export(train(arguments.task, arguments.minutes, arguments.seed), arguments.file)
    print(arguments.file)


if __name__ == "__main__":
    main()
