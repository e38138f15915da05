"""Counter-based random bits: a pure function of (key, counter), so no draw depends on another.

The generator is SplitMix64 (Steele, Lea, Flood: "Fast splittable pseudorandom number generators",
OOPSLA 2014) addressed by counter instead of by state. Keys come from :mod:`fleet2d.streams`.
"""

import numpy as np

from fleet2d.kernels._jit import kernel

GAMMA = np.uint64(0x9E3779B97F4A7C15)
MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
MIX_2 = np.uint64(0x94D049BB133111EB)
ODD_BYTES = np.uint64(0x00FF00FF00FF00FF)
FOUR_LANES = np.uint64(0x0001000100010001)
# The sum of eight uniform bytes: mean 1020, variance 8 * (256**2 - 1) / 12 = 43690.
BELL_MEAN = 1020
BELL_STD = 209.0215299915


@kernel
def random_bits(key: np.uint64, counter: int) -> np.uint64:
    """Return 64 random bits for `counter` (int64 >= 0) of the stream `key` (uint64)."""
    z = key + (np.uint64(counter) + np.uint64(1)) * GAMMA
    z = (z ^ (z >> np.uint64(30))) * MIX_1
    z = (z ^ (z >> np.uint64(27))) * MIX_2
    return z ^ (z >> np.uint64(31))


@kernel
def random_below(key: np.uint64, counter: int, bound: int) -> int:
    """Return an integer in [0, bound), 0 < bound < 2**31, by multiply and shift."""
    high = random_bits(key, counter) >> np.uint64(32)
    return int((high * np.uint64(bound)) >> np.uint64(32))


@kernel
def random_uniform(key: np.uint64, counter: int) -> float:
    """Return a float64 in [0, 1), a multiple of 2**-53."""
    return np.float64(random_bits(key, counter) >> np.uint64(11)) * 2.0**-53


@kernel
def random_bell(key: np.uint64, counter: int) -> int:
    """Return a bell-shaped integer in [-1020, 1020], mean 0, standard deviation BELL_STD.

    The sum of eight uniform bytes: close to normal (excess kurtosis -0.15), cut at 4.88 standard
    deviations, and exact on every machine, which a logarithm or a cosine is not.
    """
    word = random_bits(key, counter)
    lanes = (word & ODD_BYTES) + ((word >> np.uint64(8)) & ODD_BYTES)
    return int((lanes * FOUR_LANES) >> np.uint64(48)) - BELL_MEAN
