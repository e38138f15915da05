"""A recurrent network as a reference for `model: learned`, on the same data sets.

    python benchmarks/gru.py presence presence_logs [--epochs 12] [--seed 0]

It needs `pip install "fleet2d[ml]"`. A GRU reads the windows of each place of a home in order of
time, with the features that `learned` gets; a layer over its state and the mean of all places
corrects the belief of `routine`. It learns from `train` of the first data set, and is scored on
`test` of each, beside the other models.
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.nn.functional import pad

from fleet2d.learning.datasets.reader import Dataset, open_dataset
from fleet2d.learning.datasets.tasks import forecasts, rtp_scores, windows
from fleet2d.learning.datasets.windows import Windows
from fleet2d.metrics.rtp_score import log_loss

HIDDEN = 32
PERSONS = 16  # whose windows are read at once
CHUNK = 256  # windows through which gradients go back
RATE = 3e-3


class GatedReference(nn.Module):
    """A GRU over the windows of each place, and a score of each place from all of them."""

    def __init__(self, mean: Any, scale: Any) -> None:
        """Begin with the belief that it corrects."""
        super().__init__()
        self.mean = mean
        self.scale = scale
        self.memory = nn.GRU(len(mean), HIDDEN, batch_first=True)
        self.outer = nn.Sequential(nn.Linear(2 * HIDDEN, HIDDEN), nn.ReLU())
        self.score = nn.Linear(HIDDEN, 1, bias=False)
        nn.init.zeros_(self.score.weight)

    def forward(self, inputs: Any, exists: Any, state: Any) -> tuple[Any, Any]:
        """Return logarithms of beliefs (persons, places, windows), and the state after the windows.

        Args:
            inputs: float32 (persons, places, windows, features), the last the prior's logarithm.
            exists: bool (persons, places), the homes' own places.
            state: What it returned for the windows before; None: at the beginning.
        """
        persons, places, count, width = inputs.shape
        scaled = ((inputs - self.mean) / self.scale).reshape(-1, count, width)
        of_place, state = self.memory(scaled, state)
        of_place = of_place.reshape(persons, places, count, HIDDEN)
        own = exists[:, :, None, None]
        of_home = (of_place * own).sum(1, keepdim=True) / own.sum(1, keepdim=True)
        both = torch.cat([of_place, of_home.expand_as(of_place)], dim=3)
        score = self.score(self.outer(both))[..., 0] + inputs[..., -1]
        return score.masked_fill(~exists[:, :, None], -torch.inf).log_softmax(1), state.detach()


def sequences(parts: Sequence[Windows]) -> tuple[Any, Any, Any]:
    """Return inputs, places that exist, and truth, of persons with padding; -1: no window."""
    places = max(len(part.places) for part in parts)
    count = max(len(part.truth) for part in parts)
    inputs, exists, truth = [], [], []
    for part in parts:
        facts = np.repeat(part.places[None].astype(np.float32), len(part.truth), axis=0)
        own = torch.from_numpy(np.concatenate([facts, part.features], axis=2)).transpose(0, 1)
        later = count - len(part.truth)
        inputs.append(pad(own, (0, 0, 0, later, 0, places - len(part.places))))
        exists.append(torch.arange(places) < len(part.places))
        truth.append(pad(torch.from_numpy(part.truth), (0, later), value=-1))
    return torch.stack(inputs), torch.stack(exists), torch.stack(truth)


def read(network: GatedReference, parts: Sequence[Windows]) -> Iterator[tuple[Any, Any]]:
    """Yield the logarithms of beliefs and the truth of the windows of some persons, in order."""
    inputs, exists, truth = sequences(parts)
    state = None
    for first in range(0, truth.shape[1], CHUNK):
        belief, state = network(inputs[:, :, first : first + CHUNK], exists, state)
        yield belief, truth[:, first : first + CHUNK]


def train(parts: Sequence[Windows], epochs: int, seed: int) -> GatedReference:
    """Train by Adam, whose rate falls to 0."""
    torch.manual_seed(seed)
    order = np.random.default_rng(seed)
    inputs, exists, _ = sequences(parts[::8])
    known = inputs[exists].flatten(0, 1)
    network = GatedReference(known.mean(0), known.std(0).clamp(min=1e-2))
    steps = torch.optim.Adam(network.parameters(), lr=RATE)
    falls = torch.optim.lr_scheduler.LambdaLR(steps, lambda epoch: 1 - epoch / epochs)
    for epoch in range(epochs):
        losses = []
        shuffled = [parts[k] for k in order.permutation(len(parts))]
        for first in range(0, len(parts), PERSONS):
            for belief, truth in read(network, shuffled[first : first + PERSONS]):
                loss = nn.functional.nll_loss(belief, truth, ignore_index=-1)
                steps.zero_grad()
                loss.backward()
                steps.step()
                losses.append(loss.item())
        falls.step()
        print(f"epoch {epoch + 1}: log loss {np.mean(losses):.3f}", flush=True)
    return network


@torch.no_grad()
def show(network: GatedReference, data: Dataset) -> None:
    """Print the scores of the network on `test`, beside those of the other models."""
    made = forecasts(data, "test")
    assert made is not None
    width = made.beliefs["routine"].shape[1]
    own = []
    for part in (part for part in windows(data, "test") if len(part.truth)):
        belief = torch.cat([belief[0].T for belief, _ in read(network, [part])]).exp().numpy()
        own.append(np.pad(belief, ((0, 0), (0, width - belief.shape[1]))))
    print(data.root)
    for name, belief in {**made.beliefs, "gru": np.concatenate(own)}.items():
        scores = rtp_scores(belief, made.truth, made.gap)
        less = log_loss(belief, made.truth) - log_loss(made.beliefs["routine"], made.truth)
        beside = made.over_homes(less, np.ones(len(less), np.bool_))
        print(name, {key: round(value, 3) for key, value in scores.items()}, beside)


def main() -> None:
    """Train the network, and print its scores."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, nargs="+", help="the first one is trained on")
    parser.add_argument("--epochs", type=int, default=12)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    data = [open_dataset(path) for path in options.data]
    parts = [part for part in windows(data[0], "train") if len(part.truth)]
    network = train(parts, options.epochs, options.seed)
    for each in data:
        show(network, each)


if __name__ == "__main__":
    main()
