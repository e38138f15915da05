"""Forecasts of presence, sightings and resampled days: no logarithm, and one order of sums.

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
