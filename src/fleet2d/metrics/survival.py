"""Times that may be cut short: the estimator of Kaplan and Meier."""

from collections.abc import Sequence

import numpy as np


def kaplan_meier(times: Sequence[float], happened: Sequence[bool]) -> list[tuple[float, float]]:
    """Return the share that is left after each time at which something happened.

    Kaplan and Meier, Journal of the American Statistical Association 53, 1958. Whoever is cut short
    at a time counts as at risk up to it, and including it.

    Args:
        times: How long each was watched.
        happened: Whether it happened then; else it was cut short.

    Returns:
        Times, rising, and the share for which it hasn't happened by then, included.

    Example:
        >>> kaplan_meier([1.0, 2.0, 2.0, 5.0], [True, False, True, False])
        [(1.0, 0.75), (2.0, 0.5)]
    """
    share, curve = 1.0, list[tuple[float, float]]()
    for time in sorted({t for t, h in zip(times, happened, strict=True) if h}):
        at_risk = sum(t >= time for t in times)
        events = sum(t == time and h for t, h in zip(times, happened, strict=True))
        share *= 1 - events / at_risk
        curve.append((time, share))
    return curve


def quantile(curve: Sequence[tuple[float, float]], share: float) -> float | None:
    """Return the first time by which it has happened for a share; None if it never has.

    >>> quantile([(1.0, 0.75), (2.0, 0.5)], 0.5)
    2.0
    """
    return next((time for time, left in curve if left <= 1 - share + 1e-12), None)


def restricted_mean(curve: Sequence[tuple[float, float]], until: float) -> float:
    """Return the area under the curve up to a time: the mean of times cut at it.

    >>> restricted_mean([(1.0, 0.75), (2.0, 0.5)], 4.0)
    2.75
    """
    times = [0.0, *(min(time, until) for time, _ in curve), until]
    shares = [1.0, *(left for _, left in curve)]
    return float(sum(np.diff(times) * np.array(shares)))
