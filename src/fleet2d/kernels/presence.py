"""Chains of presence and resampled days, bin by bin: no logarithm, and one order of sums.

BLAS and einsum add in an order that depends on the machine. These loops don't, so what is learned,
and where a robot goes because of it, is the same everywhere.
"""

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.random import random_below, random_bits

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@kernel
def forward(transition: F64, start: F64, likelihood: F64, scale: F64) -> F64:
    """Filter a hidden Markov chain: the probability of each state given all evidence so far.

    Args:
        transition: (states, states), rows sum to one.
        start: (states,) filtered probability in the bin before the first.
        likelihood: (bins, states) of each bin's evidence, up to a factor.
        scale: (bins,) to write each bin's evidence into, given that before.

    Returns:
        float64 (bins, states), rows sum to one.
    """
    bins, states = likelihood.shape
    filtered = np.zeros((bins, states))
    before = start
    for t in range(bins):
        now = filtered[t]
        for i in range(states):
            for j in range(states):
                now[j] += before[i] * transition[i, j]
        total = 0.0
        for j in range(states):
            now[j] *= likelihood[t, j]
            total += now[j]
        for j in range(states):  # evidence that no state explains tells nothing
            now[j] = now[j] / total if total > 0.0 else 1.0 / states
        scale[t] = total if total > 0.0 else 1.0
        before = now
    return filtered


@kernel
def backward(
    transition: F64, start: F64, likelihood: F64, filtered: F64, scale: F64, weight: F64, pairs: F64
) -> F64:
    """Smooth what `forward` filtered: the probability of each state given all evidence.

    Args:
        transition: As in `forward`.
        start: As in `forward`.
        likelihood: As in `forward`.
        filtered: What `forward` returned.
        scale: What it wrote.
        weight: (bins,), how much each bin's step counts in `pairs`.
        pairs: (states, states) to add to: the expected number of steps from state to state.

    Returns:
        float64 (bins, states), rows sum to one.
    """
    bins, states = likelihood.shape
    smoothed = np.empty((bins, states))
    into = transition.T.copy()  # summed row by row, which is fast, and in the same order
    counts = np.zeros((states, states))
    after = np.ones(states)
    ahead = np.empty(states)
    for t in range(bins - 1, -1, -1):
        total = 0.0
        for j in range(states):
            smoothed[t, j] = filtered[t, j] * after[j]
            total += smoothed[t, j]
        for j in range(states):
            smoothed[t, j] = smoothed[t, j] / total if total > 0.0 else filtered[t, j]
            ahead[j] = likelihood[t, j] * after[j] / scale[t]
        before = filtered[t - 1] if t > 0 else start
        for i in range(states):
            after[i] = 0.0
            share = weight[t] * before[i]
            for j in range(states):
                counts[i, j] += share * ahead[j]
        for j in range(states):
            for i in range(states):
                after[i] += into[j, i] * ahead[j]
    for i in range(states):
        for j in range(states):
            pairs[i, j] += counts[i, j] * transition[i, j]
    return smoothed


@kernel
def advance(probability: F64, transition: F64, bins: int) -> F64:
    """Return a chain's state probabilities some bins later, without evidence: (states,)."""
    states = len(probability)
    now = probability.copy()
    for _ in range(bins):
        later = np.zeros(states)
        for i in range(states):
            for j in range(states):
                later[j] += now[i] * transition[i, j]
        now = later
    return now


@kernel
def count_sightings(step: I64, user: I64, room: I64, bin_steps: int, seen: I64) -> None:
    """Count the steps at which each user was perceived in each room, once however often.

    Args:
        step: (n,) in order of time, from the beginning of the first bin.
        user: (n,), below 0 for somebody unknown.
        room: (n,), below 0 for none.
        bin_steps: Steps of a bin.
        seen: (bins, users + 1, rooms) to add to; the last user is anybody.
    """
    bins, everybody, rooms = seen.shape
    last = np.full((everybody, rooms), -1, np.int64)  # step that was counted last
    for i in range(len(step)):
        at, where = step[i], room[i]
        if where < 0 or at < 0 or at >= bins * bin_steps:
            continue
        for who in (user[i], everybody - 1):
            if who >= 0 and last[who, where] != at:
                last[who, where] = at
                seen[at // bin_steps, who, where] += 1


@kernel
def resampled(key: np.uint64, days: F64, replicates: int) -> F64:
    """Sum days drawn with replacement.

    Args:
        key: Of the stream of draws.
        days: (days, values).
        replicates: How many sums.

    Returns:
        float64 (replicates, values), each the sum of as many days as there are.
    """
    count, values = days.shape
    sums = np.zeros((replicates, values))
    for b in range(replicates):
        draws = random_bits(key, b)
        for d in range(count):
            day = random_below(draws, d, count)
            for v in range(values):
                sums[b, v] += days[day, v]
    return sums
