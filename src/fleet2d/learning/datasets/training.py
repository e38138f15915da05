"""Training of the network of `model: learned`: gradients by hand, with nothing but NumPy."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fleet2d.algorithms.presence.learned import PLACE_FEATURES, TRUSTS, Weights, trust_class
from fleet2d.errors import InputError
from fleet2d.kernels import TRACE_FEATURES, PlaceNetwork
from fleet2d.learning.datasets.windows import Windows, joined

FLOOR = 1e-6
# The factors of the correction that fine-tuning tries.
FACTORS = tuple(k / 10 for k in range(16))
CAUTION = 0.05  # log loss that a factor of 0 or of 2 must gain
# By gap: lowest log loss for simulated people who were left out, a persona at a time.
TRUST = (1.0, 0.9, 0.85, 0.8, 0.75, 0.55)
# of Adam
BETA_1 = 0.9
BETA_2 = 0.999


@dataclass(frozen=True)
class TrainingSettings:
    """How a network is trained.

    Attributes:
        hidden: Width of its layers.
        epochs: How often each window is used.
        batch: Windows of a step.
        rate: The largest learning rate, which rises for a tenth of the steps and falls to 0.
        decay: Weight decay; with `start`, the pull back to the weights at the beginning.
        seed: Of the initial weights, and of the order of the windows.
        trust: The share of the learned correction that is used in the end, by the gap since the
            newest sighting. People differ from those of the training: these are best for personas
            that were left out of it.
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


Parameters = dict[str, Any]


def train(
    training: Iterable[Windows],
    validation: Iterable[Windows] = (),
    settings: TrainingSettings = TrainingSettings(),
    start: Weights | None = None,
    on_epoch: Any = None,
) -> Weights:
    """Train a network to have the lowest log loss, by Adam.

    Args:
        training: The windows to learn from.
        validation: Windows whose log loss is told after each epoch. It stops nothing: the few
            people of a validation are no guide to which epoch is best for others.
        settings: How it is trained.
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
    batches, checks = (
        [batch._replace(inputs=(batch.inputs - mean) / scale) for batch in part]
        for part in (batches, checks)
    )
    random = np.random.default_rng(settings.seed)
    values = _initial(random, settings.hidden) if start is None else _unfolded(start, mean, scale)
    anchor = {k: np.zeros_like(v) if start is None else v.copy() for k, v in values.items()}
    counted = np.array(settings.trust) if start is None else start.trust
    trust = np.ones(TRUSTS) if start is None else counted
    trust = trust.astype(np.float32)
    moments = {name: [np.zeros_like(v), np.zeros_like(v)] for name, v in values.items()}
    step = 0
    total = settings.epochs * len(batches)
    for epoch in range(settings.epochs):
        losses = []
        for k in random.permutation(len(batches)):
            loss, gradient = _gradient(values, batches[k], trust)
            losses.append(loss)
            step += 1
            rate = settings.rate * min(10 * step / total, 1) * (1 - step / total)
            values = _adam(values, gradient, moments, step, rate, settings.decay, anchor)
        loss = float(np.mean(losses))
        if on_epoch is not None:
            on_epoch(epoch, loss, _loss(values, checks, counted) if checks else loss)
    return _folded(values, mean, scale)._replace(trust=counted)


def fine_tune(weights: Weights, windows: Iterable[Windows]) -> Weights:
    """Return weights fitted to a few days of one home, which stay near those they begin with.

    What matters most is how far to trust the correction: the factor of its scores that is best on
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


def predict(weights: Weights, windows: Windows) -> Any:
    """Return the belief of a network in each window: float64 (windows, places), away last."""
    places = weights.of_places(windows.places)
    return weights.probabilities(places, windows.features.astype(np.float64))


def _batches(parts: Iterable[Windows], size: int) -> list[WindowBatch]:
    """Return batches of windows of homes with as many places, in a fixed random order."""
    batches = []
    for places, group in sorted(joined(parts).items()):
        inputs_of_homes = []
        for w in group:
            facts = np.broadcast_to(w.places.astype(np.float32), (len(w.truth), *w.places.shape))
            inputs_of_homes.append(np.concatenate([facts, w.features], axis=2))
        inputs = np.concatenate(inputs_of_homes)
        truth = np.concatenate([w.truth for w in group])
        gap = trust_class(inputs[..., PLACE_FEATURES:])
        order = np.random.default_rng(places).permutation(len(truth))
        batches += [
            WindowBatch(inputs[rows], inputs[rows, :, -1], truth[rows], gap[rows])
            for rows in np.array_split(order, -(-len(order) // size))
        ]
    return batches


def _scales(batches: list[WindowBatch]) -> tuple[Any, Any]:
    """Return the mean and the standard deviation of each feature."""
    rows = np.concatenate([b.inputs.reshape(-1, b.inputs.shape[2]) for b in batches[::4]])
    scale = rows.std(axis=0, dtype=np.float64).astype(np.float32)
    return rows.mean(axis=0, dtype=np.float64).astype(np.float32), np.maximum(scale, 1e-2)


def _initial(random: np.random.Generator, hidden: int) -> Parameters:
    width = PLACE_FEATURES + TRACE_FEATURES

    def normal(*shape: int) -> Any:
        return random.normal(0, np.sqrt(2 / shape[0]), shape).astype(np.float32)

    return {
        "first": normal(width, hidden),
        "start": np.zeros(hidden, np.float32),
        "second": normal(hidden, hidden),
        "context": normal(hidden, hidden) / 2,
        "bias": np.zeros(hidden, np.float32),
        "score": np.zeros(hidden, np.float32),  # so it begins with the belief that it corrects
    }


def _forward(values: Parameters, batch: WindowBatch, trust: Any) -> tuple[Any, Any, Any, Any]:
    inner = np.maximum(batch.inputs @ values["first"] + values["start"], 0)
    mean = inner.mean(axis=1)
    outer = inner @ values["second"] + (mean @ values["context"] + values["bias"])[:, None]
    outer = np.maximum(outer, 0)
    score = outer @ values["score"] * trust[batch.gap, None] + batch.prior
    score = np.exp(score - score.max(axis=1, keepdims=True))
    return inner, mean, outer, score / score.sum(axis=1, keepdims=True)


def _gradient(values: Parameters, batch: WindowBatch, trust: Any) -> tuple[float, Parameters]:
    inner, mean, outer, belief = _forward(values, batch, trust)
    count, places, hidden = inner.shape
    rows = np.arange(count)
    loss = -float(np.log(np.maximum(belief[rows, batch.truth], FLOOR)).mean())
    error = belief.copy()
    error[rows, batch.truth] -= 1
    error *= trust[batch.gap, None] / count
    to_outer = error[..., None] * values["score"] * (outer > 0)
    to_mean = to_outer.sum(axis=1)
    to_inner = to_outer @ values["second"].T + (to_mean @ values["context"].T)[:, None] / places
    to_inner *= inner > 0
    flat = to_inner.reshape(-1, hidden)
    return loss, {
        "first": batch.inputs.reshape(-1, batch.inputs.shape[2]).T @ flat,
        "start": flat.sum(axis=0),
        "second": inner.reshape(-1, hidden).T @ to_outer.reshape(-1, hidden),
        "context": mean.T @ to_mean,
        "bias": to_mean.sum(axis=0),
        "score": (error[..., None] * outer).sum(axis=(0, 1)),
    }


def _adam(
    values: Parameters,
    gradient: Parameters,
    moments: dict[str, list[Any]],
    step: int,
    rate: float,
    decay: float,
    anchor: Parameters,
) -> Parameters:
    """Return the parameters after a step; they are pulled back to `anchor` by `decay`."""
    made = {}
    for name, value in values.items():
        first, second = moments[name]
        first += (1 - BETA_1) * (gradient[name] - first)
        second += (1 - BETA_2) * (gradient[name] ** 2 - second)
        change = first / (1 - BETA_1**step) / (np.sqrt(second / (1 - BETA_2**step)) + 1e-8)
        made[name] = value - rate * (change + decay * (value - anchor[name]))
    return made


def _loss(values: Parameters, batches: list[WindowBatch], trust: Any) -> float:
    total = count = 0.0
    for batch in batches:
        belief = _forward(values, batch, trust)[3][np.arange(len(batch.truth)), batch.truth]
        total -= float(np.log(np.maximum(belief, FLOOR)).sum())
        count += len(batch.truth)
    return total / count


def _folded(values: Parameters, mean: Any, scale: Any) -> Weights:
    """Return the parameters as weights of features that aren't scaled."""
    wide = {name: value.astype(np.float64) for name, value in values.items()}
    first = wide["first"] / scale[:, None]
    network = PlaceNetwork(
        first[PLACE_FEATURES:], wide["second"], wide["context"], wide["bias"], wide["score"]
    )
    start = wide["start"] - mean @ first
    return Weights(first[:PLACE_FEATURES], start, np.ones(TRUSTS), network)


def _unfolded(weights: Weights, mean: Any, scale: Any) -> Parameters:
    """Return weights as parameters of scaled features."""
    first = np.concatenate([weights.places, weights.network.first])
    values = {
        "first": first * scale[:, None],
        "start": weights.start + mean @ first,
        "second": weights.network.second,
        "context": weights.network.context,
        "bias": weights.network.bias,
        "score": weights.network.score,
    }
    return {name: value.astype(np.float32) for name, value in values.items()}
