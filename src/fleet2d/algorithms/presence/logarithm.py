"""Logarithms that are the same on every machine, unlike those of the system's math library."""

import numpy as np
from numpy.typing import ArrayLike

from fleet2d.kernels import F64

LN_2 = 0.6931471805599453
ROOT_HALF = 0.7071067811865476
TERMS = 11  # of the series: the first left out is below 1e-17 of the sum


def natural_log(values: ArrayLike) -> F64:
    """Return natural logarithms of numbers above 0, by series: to 3 units in the last place.

    Of m 2^e with m from sqrt(1/2) to sqrt(2), it is e ln 2 + 2 artanh((m - 1) / (m + 1)).

    Example:
        >>> natural_log([1.0, 10.0]).round(12).tolist()
        [0.0, 2.302585092994]
    """
    mantissa, exponent = np.frexp(np.asarray(values, np.float64))
    low = mantissa < ROOT_HALF
    m, e = np.where(low, 2 * mantissa, mantissa), np.where(low, exponent - 1, exponent)
    s = (m - 1) / (m + 1)
    square, series = s * s, np.zeros_like(s)
    for k in range(TERMS, -1, -1):
        series = series * square + 1 / (2 * k + 1)
    return e * LN_2 + 2 * s * series
