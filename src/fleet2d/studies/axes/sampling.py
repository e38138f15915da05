"""Random and Latin-hypercube samples of several parameters at once."""

import math
from collections.abc import Mapping
from typing import Any, Literal, Self

import numpy as np
from pydantic import model_validator

from fleet2d.component import Settings
from fleet2d.extras import extra
from fleet2d.kernels import F64
from fleet2d.problems import problem

Method = Literal["random", "latin_hypercube"]
DIGITS = 6  # significant digits of a sampled number, so that tables print the very value


class Parameter(Settings):
    """One sampled or searched parameter: a range, or a list to choose from.

    Attributes:
        key: The key path that it sets.
        low: The smallest value.
        high: The largest value.
        log: Whether values are uniform in the logarithm.
        integer: Whether values are whole numbers.
        unit: The unit to write after the number: d, cm, %.
        choices: A list to choose from, instead of a range.
    """

    key: str
    low: float | None = None
    high: float | None = None
    log: bool = False
    integer: bool = False
    unit: str = ""
    choices: tuple[Any, ...] = ()

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if self.choices:
            if self.low is not None or self.high is not None:
                raise problem("give low and high, or choices, not both")
            return self
        if self.low is None or self.high is None or not self.low < self.high:
            raise problem("give low and high, low below high; or choices")
        if self.log and self.low <= 0:
            raise problem(f"low is {self.low:g}; with log it must be above 0")
        return self

    def at(self, share: float) -> Any:
        """Return the value at a share of the range, from 0 to 1.

        >>> Parameter(key="a.b", low=1, high=100, log=True).at(0.5)
        10.0
        """
        if self.choices:
            return self.choices[min(int(share * len(self.choices)), len(self.choices) - 1)]
        assert self.low is not None
        assert self.high is not None
        if self.integer:
            return min(int(self.low + share * (self.high - self.low + 1)), int(self.high))
        if self.log:
            return rounded(math.exp(math.log(self.low) + share * math.log(self.high / self.low)))
        return rounded(self.low + share * (self.high - self.low))

    def with_unit(self, value: Any) -> Any:
        """Return a value as the scenario file spells it, with its unit.

        >>> Parameter(key="a.b", low=1, high=9, unit="d").with_unit(2.5)
        '2.5 d'
        """
        return f"{value!r} {self.unit}" if self.unit and not self.choices else value


def rounded(value: float, digits: int = DIGITS) -> float:
    """Return a number rounded to a number of significant digits.

    >>> rounded(0.123456789)
    0.123457
    """
    return float(f"{value:.{digits}g}")


def shares(method: Method, count: int, dimensions: int, seed: int) -> F64:
    """Return points of the unit cube: float64 (count, dimensions), the same at each call.

    Raises:
        InputError: scipy is missing, which Latin hypercubes need.
    """
    generator = np.random.Generator(np.random.Philox(seed))
    if method == "random":
        return generator.random((count, dimensions))
    with extra("study", "a Latin hypercube needs scipy"):
        from scipy.stats import qmc
    return qmc.LatinHypercube(dimensions, rng=generator).random(count)


def draw(
    parameters: Mapping[str, Parameter], method: Method, count: int, seed: int
) -> list[dict[str, Any]]:
    """Return `count` samples, each a mapping of parameter name to value."""
    points = shares(method, count, len(parameters), seed)
    return [
        {
            name: parameter.at(float(share))
            for (name, parameter), share in zip(parameters.items(), row, strict=True)
        }
        for row in points
    ]
