"""Drives of robots besides the differential one."""

from collections.abc import Iterator
from math import isqrt, sqrt

import numpy as np
from pydantic import Field

from fleet2d.entities.drive import Differential, Drive, Moment, Route
from fleet2d.kernels import F64, turn_between

SHORTEST_MM = 2
"""The shortest piece of a change of speed: some lattice units, so that the robot moves in it."""


class Holonomic(Drive):
    """Drives in any direction at constant speed, without stopping to turn.

    Attributes:
        turns: Whether the robot turns into the direction of motion; else it keeps its heading.
    """

    turns: bool = True

    def moments(self, route: Route) -> Iterator[Moment]:
        """Yield the ends of legs, and of the turns on them."""
        seconds = 0.0
        metres = 0.0
        heading = route.heading
        for leg in route.legs:
            lasts = leg.length / route.speed
            turn = turn_between(heading, leg.direction) if self.turns else 0
            turning = abs(turn) / route.turn_rate
            if 0 < turning < lasts:
                heading = leg.direction
                yield Moment(seconds + turning, metres + turning * route.speed, heading)
            elif turning:  # the leg is too short to turn all the way
                heading += round(turn * (lasts / turning))
            seconds = seconds + lasts
            metres = metres + leg.length
            yield Moment(seconds, metres, heading)


class Trapezoidal(Differential):
    """Turns on the spot towards each leg; on it, accelerates, drives at constant speed, brakes.

    Gathering speed and braking take `pieces` equal times each, of constant speed: the position is
    at most speed² / (8 acceleration pieces²) off, 6 mm at 0.6 m/s. Turns are at constant rate,
    and a plan begins at rest, also where another one was interrupted.

    Attributes:
        acceleration: Acceleration and deceleration [m/s²].
        pieces: Number of constant speeds that approximate acceleration, and braking.
    """

    acceleration: float = Field(default=0.5, ge=0.01, le=100)
    pieces: int = Field(default=4, ge=1, le=64)

    def straight(self, length: float, speed: float) -> Iterator[tuple[float, float]]:
        """Yield times [s] and distances [m] at which the speed changes on a leg, and its end."""
        ramp = min(speed * speed / self.acceleration, length) / 2  # distance to full speed [m]
        rising = sqrt(2 * ramp / self.acceleration)
        full = self.acceleration * rising
        pieces = max(1, min(self.pieces, isqrt(int(ramp * 1000 / SHORTEST_MM))))
        for k in range(1, pieces + 1):
            yield rising * k / pieces, ramp * k * k / pieces**2
        braking = rising + (length - 2 * ramp) / full
        if braking > rising:
            yield braking, length - ramp
        for k in range(pieces - 1, -1, -1):
            yield braking + rising * (pieces - k) / pieces, length - ramp * k * k / pieces**2

    def seconds(self, metres: F64, speed: float) -> F64:
        """Return the robot's estimates of the time to many places, each way as one leg [s]."""
        changing = speed * speed / self.acceleration  # distance of acceleration and braking [m]
        at_speed = np.maximum(metres - changing, 0.0) / speed
        return 2 * np.sqrt(np.minimum(metres, changing) / self.acceleration) + at_speed
