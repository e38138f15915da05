"""The factors of a detection's probability, of the same form as the curves of a scenario."""

import math

import numpy as np

from fleet2d.kernels import F64

SURE = 12.0  # logits from here on count as a share of 1


def share_of(logit: float) -> float:
    """Return the probability that a logit stands for, exactly 1 from SURE on.

    >>> share_of(0.0), share_of(SURE)
    (0.5, 1.0)
    """
    return 1.0 if logit >= SURE else 1 / (1 + math.exp(-logit))


class Constant:
    """The same factor for every row."""

    least, most = (-SURE,), (SURE,)
    starts = ((2.0,),)

    def __init__(self, name: str, rows: int) -> None:
        self.names: tuple[str, ...] = (name,)
        self._rows = rows

    def shares(self, theta: F64) -> tuple[F64, F64]:
        """Return the factor of each row, and its derivative by the logit."""
        share = share_of(float(theta[0]))
        slope = np.full((self._rows, 1), max(share * (1 - share), 1e-9))
        return np.full(self._rows, share), slope

    def natural(self, index: int, value: float) -> float:
        """Return the probability that a parameter, a logit, stands for."""
        return share_of(value)


class Falling:
    """A factor that decreases logistically with x: 1 / (1 + exp((x - midpoint) / width))."""

    def __init__(self, name: str, values: F64) -> None:
        self.names = (f"{name} midpoint", f"{name} width")
        self._x = values
        span = max(float(values.max()), 1e-6)
        self.least = (-span, math.log(span / 1000))
        self.most = (3 * span, math.log(3 * span))
        self.starts = tuple((share * span, math.log(span / 8)) for share in (0.5, 0.8, 1.1))

    def shares(self, theta: F64) -> tuple[F64, F64]:
        """Return the factor of each row, and its derivatives by midpoint and log of width."""
        midpoint, width = float(theta[0]), math.exp(float(theta[1]))
        scaled = np.clip((self._x - midpoint) / width, -700, 700)
        share = 1 / (1 + np.exp(scaled))
        slope = share * (1 - share)
        return share, np.stack([slope / width, slope * scaled], axis=1)

    def natural(self, index: int, value: float) -> float:
        """Return midpoint or width in the quantity's unit."""
        return math.exp(value) if index else value


class Orientation:
    """A factor that decreases with the angle by which a person is turned away, piecewise linear.

    It is 1 for a person who faces the camera, `side` at 90 degrees and `back` at 180 degrees.
    """

    names = ("side", "back")
    least, most = (-SURE, -SURE), (SURE, SURE)
    starts = ((2.0, 1.0),)

    def __init__(self, degrees: F64) -> None:
        quarters = degrees / 90
        self._side = np.where(quarters < 1, quarters, 2 - quarters)
        self._back = np.maximum(quarters - 1, 0)

    def shares(self, theta: F64) -> tuple[F64, F64]:
        """Return the factor of each row, and its derivatives by the two logits."""
        side, back = share_of(float(theta[0])), share_of(float(theta[1]))
        share = (1 - self._side - self._back) + side * self._side + back * self._back
        slopes = [
            self._side * max(side * (1 - side), 1e-9),
            self._back * max(back * (1 - back), 1e-9),
        ]
        return share, np.stack(slopes, axis=1)

    def natural(self, index: int, value: float) -> float:
        """Return the probability that a parameter, a logit, stands for."""
        return share_of(value)
