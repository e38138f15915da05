"""Sums of floats that are the same in every version of Python."""

from collections.abc import Iterable


def sum_in_order(values: Iterable[float]) -> float:
    """Return the sum of some floats, added from the first to the last.

    The built-in `sum` does this up to Python 3.11; later versions compensate for rounding, so that
    the last digits of a stored value would depend on the version.

    Example:
        >>> sum_in_order([0.1] * 10)
        0.9999999999999999
    """
    total = 0.0
    for value in values:
        total += value
    return total
