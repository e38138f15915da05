"""Between which values the numbers of metrics are; readers of studies import no more of metrics."""

import math
from collections.abc import Mapping
from typing import Protocol


class Bounded(Protocol):
    """What declares the units and the limits of numbers, as metrics do."""

    @property
    def unit(self) -> str:
        """The unit of its numbers."""

    @property
    def units(self) -> Mapping[str, str]:
        """The units of single numbers, by name."""

    @property
    def least(self) -> Mapping[str, float]:
        """The least values, by name; "" for all others."""

    @property
    def largest(self) -> Mapping[str, float]:
        """The largest values, likewise."""


SHARE = "share"
"""The unit of numbers from 0 to 1 begins with it."""


def limits_of(metric: Bounded, name: str) -> tuple[float, float]:
    """Return the least and the largest value that a number of a metric can have, by its name.

    Example:
        >>> from fleet2d.metrics.metric import Metric
        >>> class Rooms(Metric):
        ...     units = {"seen": "share of rooms"}
        ...     least = {"": 0}
        >>> limits_of(Rooms(), "seen"), limits_of(Rooms(), "rooms")
        ((0.0, 1.0), (0, inf))
    """
    if metric.units.get(name, metric.unit).startswith(SHARE):
        return 0.0, 1.0
    least = metric.least.get(name, metric.least.get("", -math.inf))
    return least, metric.largest.get(name, metric.largest.get("", math.inf))
