"""Slow, obvious twins of the random kernels, in plain Python integers."""

from fractions import Fraction

MASK = 2**64 - 1


def splitmix(seed, count):
    """Return the first `count` outputs of SplitMix64 as published: with a state that moves on."""
    state, outputs = seed, []
    for _ in range(count):
        state = (state + 0x9E3779B97F4A7C15) & MASK
        z = state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
        outputs.append(z ^ (z >> 31))
    return outputs


def random_bits(key, counter):
    """Return output number `counter` of the generator with seed `key`."""
    return splitmix((key + counter * 0x9E3779B97F4A7C15) & MASK, 1)[0]


def key_of_word(word):
    """Return the key whose output 0 is `word`, by running the generator backwards."""
    z = word
    z = z ^ (z >> 31) ^ (z >> 62)
    z = z * pow(0x94D049BB133111EB, -1, 2**64) & MASK
    z = z ^ (z >> 27) ^ (z >> 54)
    z = z * pow(0xBF58476D1CE4E5B9, -1, 2**64) & MASK
    z = z ^ (z >> 30) ^ (z >> 60)
    return (z - 0x9E3779B97F4A7C15) & MASK


def random_below(key, counter, bound):
    """Return the upper half of the bits, scaled to [0, bound)."""
    return (random_bits(key, counter) // 2**32) * bound // 2**32


def random_bell(key, counter):
    """Return the sum of the eight bytes, less its mean."""
    return sum(random_bits(key, counter).to_bytes(8, "big")) - 1020


def distribution_of_bell():
    """Return the exact probability of each value of `random_bell`, by adding byte after byte."""
    ways = {-1020: 1}
    for _ in range(8):
        longer = {}
        for value, count in ways.items():
            for byte in range(256):
                longer[value + byte] = longer.get(value + byte, 0) + count
        ways = longer
    return {value: Fraction(count, 256**8) for value, count in ways.items()}
