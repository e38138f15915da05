"""Training of the network of `model: learned` by PyTorch; the network runs without it."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import log
from typing import Any, NamedTuple

import numpy as np

from fleet2d.algorithms.presence.learned import PLACE_FEATURES, TRUSTS, Weights, trust_class
from fleet2d.errors import InputError, extra
from fleet2d.kernels import TRACE_FEATURES, PlaceNetwork
from fleet2d.learning.datasets.windows import Windows, joined, predict

with extra("ml", "training a network needs torch"):
    import torch
    from torch.nn.functional import cross_entropy

FLOOR = 1e-6
# The factors of the correction that fine-tuning tries.
FACTORS = tuple(k / 10 for k in range(16))
CAUTION = 0.05  # gain in log loss required of a factor of 0 or 2
# By gap, the trust with the lowest log loss for personas left out of the training, one at a time.
TRUST = (1.0, 0.9, 0.85, 0.8, 0.75, 0.55)


@dataclass(frozen=True)
class TrainingSettings:
    """The settings of the training of a network.

    Attributes:
        hidden: Width of its layers.
        epochs: The number of times that each window is used.
        batch: The number of windows of a step.
        rate: The largest learning rate, which rises for a tenth of the steps and falls to 0.
        decay: Weight decay; with `start`, the pull back to the weights at the beginning.
        seed: The seed of the initial weights, and of the order of the windows.
        trust: The share of the learned correction that is used in the end, by the gap since the
            newest sighting. As people differ from those of the training, the defaults are best for
            personas left out of it.
    """

    hidden: int = 32
    epochs: int = 5
    batch: int = 512
    rate: float = 4e-3
    decay: float = 1e-3
    seed: int = 0
    trust: tuple[float, ...] = TRUST


class WindowBatch(NamedTuple):
    """Windows with the same number of places.

    Attributes:
        inputs: float32 (n, places, features).
        prior: float32 (n, places), the logarithm of the belief that is corrected.
        truth: int64 (n,).
        gap: int64 (n,), the class of the gap since the newest sighting.
    """

    inputs: Any
    prior: Any
    truth: Any
    gap: Any

    def rows(self, chosen: Any) -> "WindowBatch":
        """Return some of the windows."""
        return WindowBatch(*(part[chosen] for part in self))


Parameters = dict[str, Any]


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Compute on one thread of the processor, whatever the settings of PyTorch.

    One thread adds in the same order each time, and more gain nothing with so few weights.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with torch.enable_grad(), torch.device("cpu"):
            yield
    finally:
        torch.set_num_threads(threads)


@_undisturbed()
def train(
    training: Iterable[Windows],
    validation: Iterable[Windows] = (),
    settings: TrainingSettings = TrainingSettings(),
    start: Weights | None = None,
    on_epoch: Any = None,
) -> Weights:
    """Train a network to have the lowest log loss, by AdamW.

    The same seed gives the same weights on one machine.

    Args:
        training: The windows to learn from.
        validation: Windows whose log loss is reported after each epoch. It doesn't stop the
            training: the few people of a validation are no guide to the best epoch for others.
        settings: The settings of the training.
        start: Weights to begin with, for fine-tuning; None: random ones.
        on_epoch: Called with the epoch, and the log losses of training and validation.

    Raises:
        InputError: There are no windows.
    """
    batches = _batches(training, settings.batch)
    checks = _batches(validation, 4096)
    if not batches:
        raise InputError("there are no windows to train on: no label has a stored belief")
    mean, scale = _scales(batches)
    for batch in [*batches, *checks]:
        batch.inputs.sub_(mean).div_(scale)
    random = torch.Generator().manual_seed(settings.seed)
    # The difference to the anchor is trained, so that the decay of weights pulls back to it.
    if start is None:
        change = _initial(random, settings.hidden)
        anchor = {name: torch.zeros_like(value) for name, value in change.items()}
        counted = np.array(settings.trust)
        trust = torch.ones(TRUSTS, dtype=torch.float32)
    else:
        anchor = _unfolded(start, mean, scale)
        change = {name: torch.zeros_like(value) for name, value in anchor.items()}
        counted = start.trust
        trust = _tensor(counted)
    for value in change.values():
        value.requires_grad_()
    steps = torch.optim.AdamW(change.values(), settings.rate, weight_decay=settings.decay)
    total = settings.epochs * len(batches)

    def share_of_rate(done: int) -> float:
        step = done + 1
        return min(10 * step / total, 1) * (1 - step / total)

    rates = torch.optim.lr_scheduler.LambdaLR(steps, share_of_rate)
    for epoch in range(settings.epochs):
        losses = []
        for k in torch.randperm(len(batches), generator=random).tolist():
            loss = _losses(_sum(anchor, change), batches[k], trust)
            losses.append(_capped(loss))
            steps.zero_grad()
            loss.mean().backward()
            steps.step()
            rates.step()
        known = float(torch.stack([part.mean() for part in losses]).mean())
        if on_epoch is not None:
            values = _sum(anchor, change)
            on_epoch(epoch, known, _loss(values, checks, _tensor(counted)) if checks else known)
    return _folded(_sum(anchor, change), mean, scale)._replace(trust=counted)


def fine_tune(weights: Weights, windows: Iterable[Windows]) -> Weights:
    """Return weights fitted to a few days of one home, near those given.

    The trust in the correction matters most: first comes the factor of its scores that is best on
    these days, with a penalty for factors far from 1. The weights are then trained a little.
    """
    days = list(windows)

    def loss(factor: float) -> float:
        scaled = weights._replace(trust=weights.trust * factor)
        chances = [predict(scaled, part)[np.arange(len(part.truth)), part.truth] for part in days]
        every = np.concatenate(chances or [np.ones(1)])
        return float(-np.log(np.maximum(every, FLOOR)).mean()) + CAUTION * (factor - 1) ** 2

    factor = min(FACTORS, key=loss)
    settings = TrainingSettings(epochs=10, batch=128, rate=5e-4, decay=0.3)
    return train(days, settings=settings, start=weights._replace(trust=weights.trust * factor))


def _batches(parts: Iterable[Windows], size: int) -> list[WindowBatch]:
    """Return batches of windows with equal numbers of places, in a fixed random order."""
    batches = []
    for places, group in sorted(joined(parts).items()):
        inputs_of_homes = []
        for w in group:
            facts = np.broadcast_to(w.places.astype(np.float32), (len(w.truth), *w.places.shape))
            inputs_of_homes.append(np.concatenate([facts, w.features], axis=2))
        inputs = np.concatenate(inputs_of_homes)
        truth = np.concatenate([w.truth for w in group])
        gap = trust_class(inputs[..., PLACE_FEATURES:])
        arrays = (inputs, inputs[..., -1], truth, gap)
        whole = WindowBatch(*(torch.from_numpy(array) for array in arrays))
        order = torch.randperm(len(truth), generator=torch.Generator().manual_seed(places))
        batches += [whole.rows(rows) for rows in order.tensor_split(-(-len(order) // size))]
    return batches


def _scales(batches: list[WindowBatch]) -> tuple[Any, Any]:
    """Return the mean and the standard deviation of each feature."""
    rows = torch.cat([batch.inputs.flatten(0, 1) for batch in batches[::4]]).double()
    scale, mean = torch.std_mean(rows, dim=0, correction=0)
    return mean.float(), scale.float().clamp(min=1e-2)


def _initial(random: Any, hidden: int) -> Parameters:
    width = PLACE_FEATURES + TRACE_FEATURES

    def normal(*shape: int) -> Any:
        drawn = torch.randn(shape, generator=random, dtype=torch.float32)
        return drawn * (2 / shape[0]) ** 0.5

    return {
        "first": normal(width, hidden),
        "start": torch.zeros(hidden, dtype=torch.float32),
        "second": normal(hidden, hidden),
        "context": normal(hidden, hidden) / 2,
        "bias": torch.zeros(hidden, dtype=torch.float32),
        # Scores of 0 leave the belief as it is.
        "score": torch.zeros(hidden, dtype=torch.float32),
    }


def _sum(anchor: Parameters, change: Parameters) -> Parameters:
    return {name: value + change[name] for name, value in anchor.items()}


def _losses(values: Parameters, batch: WindowBatch, trust: Any) -> Any:
    """Return the log loss of each window."""
    inner = (batch.inputs @ values["first"] + values["start"]).relu()
    home = inner.mean(dim=1) @ values["context"] + values["bias"]
    outer = (inner @ values["second"] + home[:, None]).relu()
    score = outer @ values["score"] * trust[batch.gap, None] + batch.prior
    return cross_entropy(score, batch.truth, reduction="none")


def _capped(losses: Any) -> Any:
    """Return log losses for reports: at most that of `FLOOR`."""
    return losses.detach().clamp(max=-log(FLOOR))


def _loss(values: Parameters, batches: list[WindowBatch], trust: Any) -> float:
    return float(torch.cat([_capped(_losses(values, batch, trust)) for batch in batches]).mean())


def _tensor(array: Any) -> Any:
    return torch.from_numpy(array.astype(np.float32))


def _folded(values: Parameters, mean: Any, scale: Any) -> Weights:
    """Return the parameters as weights of features that aren't scaled."""
    wide = {name: value.detach().double().numpy() for name, value in values.items()}
    first = wide["first"] / scale.numpy()[:, None]
    network = PlaceNetwork(
        first[PLACE_FEATURES:], wide["second"], wide["context"], wide["bias"], wide["score"]
    )
    start = wide["start"] - mean.numpy() @ first
    return Weights(first[:PLACE_FEATURES], start, np.ones(TRUSTS), network)


def _unfolded(weights: Weights, mean: Any, scale: Any) -> Parameters:
    """Return weights as parameters of scaled features."""
    first = np.concatenate([weights.places, weights.network.first])
    values = {
        "first": first * scale.numpy()[:, None],
        "start": weights.start + mean.numpy() @ first,
        "second": weights.network.second,
        "context": weights.network.context,
        "bias": weights.network.bias,
        "score": weights.network.score,
    }
    return {name: _tensor(value) for name, value in values.items()}
