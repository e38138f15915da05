"""Frames: the similarity transform from the coordinates of a log to those of the floor plan."""

from typing import Self

import numpy as np
from pydantic import Field, model_validator

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import AngleDeg, Length
from fleet2d.kernels import F64
from fleet2d.runtime.determinism import sum_in_order

Pair = tuple[float, float]


class Match(Settings):
    """One place in both frames.

    Attributes:
        log: Its coordinates in the log, in the log's units.
        plan: Its coordinates in the floor plan [m].
    """

    log: Pair
    plan: Pair


class Frame(Settings):
    """How the positions of a log lie in the floor plan: mirrored, scaled, turned, then moved.

    Attributes:
        scale: Metres in one unit of the log.
        rotation_deg: Direction of the log's x axis in the plan, counter-clockwise.
        flip_y: Whether the log's y axis is the other way, as in pictures.
        origin: Where the log's (0, 0) is in the plan [m].
        matches: Places in both frames, two or more, instead of scale, rotation and origin: the best
            fit to them in the least squares.

    Example:
        >>> feet = Frame(scale=0.3048, rotation_deg=90, origin=(1, 2))
        >>> feet.to_plan(np.array([[10.0, 0.0]])).round(3).tolist()
        [[1.0, 5.048]]
        >>> corners = [{"log": (0, 0), "plan": (1, 2)}, {"log": (10, 0), "plan": (1, 5.048)}]
        >>> Frame(matches=corners).to_plan(np.array([[10.0, 10.0]])).round(3).tolist()
        [[-2.048, 5.048]]
    """

    scale: float = Field(default=1.0, gt=0)
    rotation_deg: AngleDeg = 0.0
    flip_y: bool = False
    origin: tuple[Length, Length] = (0.0, 0.0)
    matches: tuple[Match, ...] = ()

    @model_validator(mode="after")
    def _is_defined_in_one_way(self) -> Self:
        if self.matches and {"scale", "rotation_deg", "origin"} & self.model_fields_set:
            raise problem("give matches, or scale, rotation_deg and origin, and not both")
        if self.matches and len({match.log for match in self.matches}) < 2:
            raise problem("matches: two different places are needed at least")
        return self

    def to_plan(self, xy: F64) -> F64:
        """Return positions of the log, float64 (n, 2), as positions in the plan [m]."""
        (ax, ay), (bx, by) = self._factor()
        x, y = xy[:, 0], -xy[:, 1] if self.flip_y else xy[:, 1]
        return np.stack([ax * x - ay * y + bx, ay * x + ax * y + by], 1)

    def turn_headings(self, heading: F64) -> F64:
        """Return headings of the log [turns], float64 (n,), as headings in the plan [turns]."""
        ax, ay = self._factor()[0]
        turn = np.arctan2(ay, ax) / (2 * np.pi)  # callers round headings to 1/4096 turn
        sign = -1.0 if self.flip_y else 1.0
        return np.asarray(sign * heading + turn)

    def errors(self) -> F64:
        """Return the distance between each match's place in the plan and its fit [m], (n,)."""
        log = np.array([match.log for match in self.matches], np.float64).reshape(-1, 2)
        plan = np.array([match.plan for match in self.matches], np.float64).reshape(-1, 2)
        residuals = self.to_plan(log) - plan
        return np.sqrt(residuals[:, 0] ** 2 + residuals[:, 1] ** 2)

    def _factor(self) -> tuple[Pair, Pair]:
        """Return the complex numbers a and b of plan = a * log + b, as pairs."""
        if not self.matches:
            cosine, sine = _direction(self.rotation_deg)
            return (self.scale * cosine, self.scale * sine), self.origin
        sign = -1.0 if self.flip_y else 1.0
        log = [(match.log[0], sign * match.log[1]) for match in self.matches]
        plan = [match.plan for match in self.matches]
        (lx, ly), (px, py) = _mean(log), _mean(plan)
        ax = ay = size = 0.0
        for (x, y), (u, v) in zip(log, plan, strict=True):
            x, y, u, v = x - lx, y - ly, u - px, v - py
            ax += x * u + y * v
            ay += x * v - y * u
            size += x * x + y * y
        ax, ay = ax / size, ay / size
        return (ax, ay), (px - (ax * lx - ay * ly), py - (ay * lx + ax * ly))


def _mean(points: list[Pair]) -> Pair:
    return sum_in_order(x for x, _ in points) / len(points), sum_in_order(
        y for _, y in points
    ) / len(points)


def _direction(degrees: float) -> Pair:
    """Return the cosine and sine of an angle, the same on every machine.

    They are computed by their series, as the sines of C libraries differ in the last digit.
    """
    quarters, rest = divmod(degrees, 90.0)
    angle = rest * (3.141592653589793 / 180.0)
    cosine = sine = 0.0
    term = 1.0
    for n in range(24):  # later terms are below 1e-18
        if n % 2 == 0:
            cosine += term if n % 4 == 0 else -term
        else:
            sine += term if n % 4 == 1 else -term
        term = term * angle / (n + 1)
    for _ in range(int(quarters) % 4):
        cosine, sine = -sine, cosine
    return cosine, sine
