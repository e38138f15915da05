"""Counter-based random bits: a pure function of (key, counter), so no draw depends on another.

The generator is SplitMix64 (Steele, Lea, Flood: "Fast splittable pseudorandom number generators",
OOPSLA 2014) addressed by counter instead of by state. Keys come from :mod:`fleet2d.streams`.
"""

from fleet2d._core import (
    BELL_MEAN,
    BELL_STD,
    Bits,
    StepDraws,
    random_bell,
    random_bells,
    random_below,
    random_bits,
    random_uniform,
)

__all__ = [
    "BELL_MEAN",
    "BELL_STD",
    "Bits",
    "StepDraws",
    "random_bell",
    "random_bells",
    "random_below",
    "random_bits",
    "random_uniform",
]
