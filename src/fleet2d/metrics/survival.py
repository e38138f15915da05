"""Survival curves from censored times: the estimator of Kaplan and Meier."""

from collections.abc import Sequence

import numpy as np

from fleet2d.runtime.determinism import sum_in_order


def kaplan_meier(times: Sequence[float], happened: Sequence[bool]) -> list[tuple[float, float]]:
    """Return the survival curve: the share without an event by each time of an event.

    Kaplan and Meier, Journal of the American Statistical Association 53, 1958. A time censored at t
    counts as at risk up to and including t.

    Args:
        times: The duration of each observation.
        happened: Whether the event happened at its end; else the time is censored.

    Returns:
        (time, share) pairs, ascending: the share without an event up to and including the time.

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
    """Return the first time by which the event has happened for a share; None if it never has.

    >>> quantile([(1.0, 0.75), (2.0, 0.5)], 0.5)
    2.0
    """
    return next((time for time, rest in curve if rest <= 1 - share + 1e-12), None)


def restricted_mean(curve: Sequence[tuple[float, float]], until: float) -> float:
    """Return the area under the curve up to a time: the mean of min(time, until).

    >>> restricted_mean([(1.0, 0.75), (2.0, 0.5)], 4.0)
    2.75
    """
    times = [0.0, *(min(time, until) for time, _ in curve), until]
    shares = [1.0, *(share for _, share in curve)]
    return sum_in_order((np.diff(times) * np.array(shares)).tolist())
