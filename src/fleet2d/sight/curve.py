"""Probabilities as curves over a distance, an angle or the time, equal on every machine."""

from collections.abc import Mapping, Sequence
from decimal import Decimal, localcontext
from itertools import pairwise
from typing import Any, Self

import numpy as np
from pydantic import Field, GetJsonSchemaHandler, model_serializer, model_validator
from pydantic_core import CoreSchema

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem, problem_at
from fleet2d.configuration.units import Share
from fleet2d.kernels import F64, I64, ONE

EXACT = 20  # digits: far more than a probability in units of 2**-31 needs
LIMIT = 200  # beyond exp(-200) or exp(200) a probability is 0 or 1
# The natural logarithm of 2, with few bits so that its multiples are exact; and the remainder.
LN_2 = int(Decimal(2).ln() * 2**32) / 2**32
LN_2_REST = float(Decimal(2).ln() - Decimal(LN_2))
TERMS = 15  # of the series of exp, up to half of LN_2: more than the precision of a double needs


class Curve(Settings):
    """A probability as a function: a table with linear interpolation, or a logistic function.

    In a scenario: ``0.9`` (constant), ``[[0, 1], [3, 0.9], [5, 0.2]]`` (constant before the first
    row and after the last), or ``{midpoint: 4, width: 0.5}``:
    top / (1 + exp((x - midpoint) / width)).

    Attributes:
        points: Rows [x, probability], ascending.
        midpoint: Logistic: x at which it is half its top.
        width: Logistic: scale of its decrease, to 27 % in one width.
        top: Logistic: the probability far before the midpoint.

    Example:
        >>> curve = Curve.model_validate([[0, 1], [4, 0.5]])
        >>> [curve.at(x) for x in (-1, 0, 1, 9)]
        [1.0, 1.0, 0.875, 0.5]
        >>> Curve(midpoint=3, width=0.5, top=0.9).at(3)
        0.45
    """

    points: tuple[tuple[float, Share], ...] = Field(default=(), examples=[[[0, 1], [4, 0.6]]])
    midpoint: float | None = None
    width: float | None = Field(default=None, gt=0)
    top: Share = 1.0

    @model_validator(mode="before")
    @classmethod
    def _short_forms(cls, data: Any) -> Any:
        if isinstance(data, Sequence) and not isinstance(data, str):
            return {"points": data}
        if isinstance(data, str | int | float) and not isinstance(data, bool):
            return {"points": [[0.0, data]]}
        return data

    @model_validator(mode="after")
    def _is_one_of_both(self) -> Self:
        logistic = self.midpoint is not None and self.width is not None
        if logistic == bool(self.points) or (self.midpoint is None) != (self.width is None):
            raise problem(
                "a curve is a number, rows like [[0, 1], [4, 0.6]], or {midpoint: …, width: …}"
            )
        for (before, _), (after, _) in pairwise(self.points):
            if not before < after:
                raise problem_at(("points",), f"{after:g} follows {before:g}: rows must ascend")
        return self

    @model_serializer(mode="plain")
    def _shortest(self) -> Any:
        """Return the form of a scenario: rows, or a logistic function with all its keys."""
        if self.points:
            return [list(row) for row in self.points]
        return {"midpoint": self.midpoint, "width": self.width, "top": self.top}

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Add the short forms to the schema."""
        row = {"type": "array", "minItems": 2, "maxItems": 2}
        short = [{"type": "number"}, {"type": "string"}, {"type": "array", "items": row}]
        return {"anyOf": [*short, super().__get_pydantic_json_schema__(schema, handler)]}

    @property
    def reaches_below_zero(self) -> bool:
        """Whether its rows begin at a negative x."""
        return bool(self.points) and self.points[0][0] < 0

    def at(self, x: float) -> float:
        """Return the probability at x."""
        return float(self._shares(np.array([x], np.float64))[0])

    def chances(self, x: Sequence[float]) -> I64:
        """Return the probabilities at many x [2**-31]: int64 (n,)."""
        return np.rint(self._shares(np.array(x, np.float64)) * ONE).astype(np.int64)

    def _shares(self, at: F64) -> F64:
        """Return the probabilities at many x, the same on every machine: float64 (n,)."""
        if self.midpoint is not None and self.width is not None:
            return self.top / (1 + exponential((at - self.midpoint) / self.width))
        x, y = np.array(self.points).T
        after = np.minimum(np.searchsorted(x, at, side="right"), len(x) - 1)
        before = np.maximum(after - 1, 0)
        width = np.where(after > before, x[after] - x[before], 1.0)
        fraction = np.clip(at - x[before], 0.0, width) / width
        return y[before] + (y[after] - y[before]) * fraction

    def around_the_clock(self) -> "Curve":
        """Return the curve repeated over hours -24 to 48, so that midnight is interpolated, too."""
        if len(self.points) < 2:
            return self
        days = tuple((hour + day, p) for day in (-24, 0, 24) for hour, p in self.points)
        # Unchecked: rows at 0 and at 24 may coincide; the curve jumps there.
        return Curve.model_construct(points=days, midpoint=None, width=None)


def chance(share: float) -> int:
    """Return a probability [2**-31].

    >>> chance(0.5) == 2**30
    True
    """
    return round(share * ONE)


def decay(steps: Decimal) -> float:
    """Return exp(-steps), the same on every machine.

    >>> decay(Decimal(1))
    0.36787944117144233
    """
    with localcontext(prec=EXACT):
        return float(_exp(-steps))


def exponential(x: F64) -> F64:
    """Return exp(x), with x clipped to -LIMIT … LIMIT, the same on every machine.

    np.exp differs between machines in the last bit; sums and products don't.

    >>> exponential(np.array([0.0, 1.0])).round(12).tolist()
    [1.0, 2.718281828459]
    """
    x = np.clip(x, -LIMIT, LIMIT)
    doublings = np.rint(x / LN_2)
    rest = x - doublings * LN_2 - doublings * LN_2_REST
    value = np.ones_like(x)
    for term in range(TERMS, 0, -1):
        value = 1 + rest * value / term
    return np.ldexp(value, doublings.astype(np.int32))


def _exp(x: Decimal) -> Decimal:
    """Return exp(x), with x clipped to -LIMIT … LIMIT."""
    limit = Decimal(LIMIT)
    return (limit if x > limit else -limit if x < -limit else x).exp()


def cumulative(weights: Mapping[Any, float], order: Sequence[Any]) -> list[int]:
    """Return the cumulative probabilities [2**-31] of outcomes in an order; missing ones have 0.

    >>> [x / 2**31 for x in cumulative({"a": 0.25, "c": 0.5}, "abc")]
    [0.25, 0.25, 0.75]
    """
    total, sums = 0.0, []
    for name in order:
        total += weights.get(name, 0.0)
        sums.append(chance(total))
    return sums


ALWAYS = Curve(points=((0.0, 1.0),))
NEVER = Curve(points=((0.0, 0.0),))
