"""Steering: the motion of a robot whose velocity another program or a joystick commands.

The path is computed in pieces of equal time, each with one speed and one rate of turning, from
integers and the sines of the core, so it is the same on every machine.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from typing import NamedTuple

import numpy as np

from fleet2d.configuration.units import micros
from fleet2d.entities.behavior import Situation
from fleet2d.entities.body import Body
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.drives import Holonomic, Trapezoidal
from fleet2d.kernels import I64, TURN, UNIT, cosine, sine

# Within a piece of this length, the speed is constant and the way straight.
PIECE_US = 50_000
# Walls and bodies are looked for at points of a way this far apart [m].
SPACING_M = 0.01
# Within an order, places and headings have this many times the resolution of the lattice.
FINE = 1 << 16


class Velocity(NamedTuple):
    """The velocity of a robot, in its own frame.

    Attributes:
        forward: Speed ahead, or back if negative [m/s].
        left: Speed to the left; 0 unless the drive is holonomic [m/s].
        turn_deg: Rate of turning, counter-clockwise [deg/s].
    """

    forward: float = 0.0
    left: float = 0.0
    turn_deg: float = 0.0

    def within_limits(self, body: Body) -> "Velocity":
        """Return the nearest velocity within a robot's limits, in the same direction."""
        left = self.left if isinstance(body.drive, Holonomic) else 0.0
        speed = _length(self.forward, left)
        share = min(1.0, body.entity.speed / speed) if speed else 0.0
        limit = body.entity.turn_rate_deg
        turn_deg = max(-limit, min(self.turn_deg, limit))
        return Velocity(self.forward * share, left * share, turn_deg)

    def towards(self, wanted: "Velocity", most: float) -> "Velocity":
        """Return the velocity after a change of speed by at most `most` [m/s]."""
        ahead = wanted.forward - self.forward
        across = wanted.left - self.left
        change = _length(ahead, across)
        share = min(1.0, most / change) if change else 0.0
        return Velocity(self.forward + ahead * share, self.left + across * share, wanted.turn_deg)


class Disc(NamedTuple):
    """A disc about another body in which a robot's centre must not be [lattice]."""

    x: int
    y: int
    reach: int

    def blocks(self, old: tuple[int, int], new: tuple[int, int]) -> bool:
        """Return whether a move ends within the disc, no farther from its centre than before."""
        after = self._squared_distance(*new)
        return after < self.reach**2 and after <= self._squared_distance(*old)

    def _squared_distance(self, x: int, y: int) -> int:
        return (x - self.x) ** 2 + (y - self.y) ** 2


class Progress(NamedTuple):
    """The state of a steered robot.

    Attributes:
        velocity: The velocity if nothing were in its way.
        rest: The remainder of rounding to the lattice, which a slow robot would lose otherwise: x,
            y [1/FINE lattice], heading [1/FINE of 1/4096 turn].
    """

    velocity: Velocity = Velocity()
    rest: tuple[int, int, int] = (0, 0, 0)


AT_REST = Progress()


@dataclass
class Steering:
    """The order to move at a velocity for a while, stopping at walls and in front of bodies.

    Attributes:
        velocity: The desired velocity.
        duration: Time for which it is kept.
        others: The bodies that are in the way.
        first: The state of the robot when the order came.
    """

    velocity: Velocity
    duration: timedelta
    others: Sequence[Disc] = ()
    first: Progress = AT_REST
    _progress: dict[int, Progress] = field(default_factory=dict, init=False)  # by time [us]

    def decide(self, now: Situation) -> Plan | None:
        """Return the plan for the whole time; None once that is over."""
        if self._progress:
            return None
        plan = now.plan()
        return plan.follow(self._way(now.actor, plan))

    def progress_at(self, time_us: int) -> Progress:
        """Return the state of a robot at a moment; at rest if the time is over."""
        passed = [end_us for end_us in self._progress if end_us <= time_us]
        if not passed or time_us > max(self._progress):
            return AT_REST
        at_us = max(passed)
        progress = self._progress[at_us]
        return progress if at_us == time_us else Progress(progress.velocity)

    def _way(self, body: Body, plan: Plan) -> I64:
        units = body.home.lattice.units_per_m
        wanted = self.velocity.within_limits(body)
        rest_x, rest_y, rest_heading = self.first.rest
        x = FINE * plan.x + rest_x
        y = FINE * plan.y + rest_y
        heading = FINE * plan.heading + rest_heading
        at = plan.position
        is_free = True
        rows = []
        duration_us = micros(self.duration)
        self._progress[plan.time_us] = self.first
        for begin_us in range(0, duration_us, PIECE_US):
            end_us = min(begin_us + PIECE_US, duration_us)
            seconds = (end_us - begin_us) / 1e6
            velocity = self.first.velocity.towards(wanted, _speed_change(body, end_us))
            turn = round(velocity.turn_deg * seconds * TURN * FINE / 360)
            dx, dy = _rotated_way(velocity, seconds * units, (heading + turn // 2) // FINE)
            x += dx
            y += dy
            heading += turn
            if is_free:
                goal = _rounded(x), _rounded(y)
                at, is_free = self._move(body, at, goal, units)
            at_x, at_y = at
            if not is_free:
                x = FINE * at_x
                y = FINE * at_y
            faced = _rounded(heading)
            rest = x - FINE * at_x, y - FINE * at_y, heading - FINE * faced
            time_us = plan.time_us + end_us
            rows.append((time_us, at_x, at_y, faced % TURN, 0))
            self._progress[time_us] = Progress(velocity, rest)
        return np.array(rows, np.int64).reshape(-1, 5)

    def _move(
        self, body: Body, start: tuple[int, int], goal: tuple[int, int], units: float
    ) -> tuple[tuple[int, int], bool]:
        """Return the point that the body reaches, and whether nothing was in its way."""
        x, y = start
        dx = goal[0] - x
        dy = goal[1] - y
        pieces = max(1, math.ceil(_length(dx, dy) / (SPACING_M * units)))
        at = start
        for piece in range(1, pieces + 1):
            to = x + dx * piece // pieces, y + dy * piece // pieces
            if to == at:
                continue
            if body.space.part_at(*to) < 0 or any(disc.blocks(at, to) for disc in self.others):
                return at, False
            at = to
        return at, True


def _rounded(value: int) -> int:
    """Return a number in 1/FINE, rounded to an integer."""
    return (value + FINE // 2) // FINE


def _length(x: float, y: float) -> float:
    """Return the length of a vector; `math.hypot` isn't the same in all versions of Python."""
    return math.sqrt(x * x + y * y)


def _speed_change(body: Body, time_us: int) -> float:
    """Return the largest change of a robot's speed in a time [m/s]."""
    if not isinstance(body.drive, Trapezoidal):
        return math.inf
    return body.drive.acceleration * time_us / 1e6


def _rotated_way(velocity: Velocity, scale: float, heading: int) -> tuple[int, int]:
    """Return a way of `scale` lattice units for each m/s, in the frame of the home [1/FINE]."""
    ahead = round(velocity.forward * scale * FINE)
    across = round(velocity.left * scale * FINE)
    x = ahead * cosine(heading) - across * sine(heading)
    y = ahead * sine(heading) + across * cosine(heading)
    return (x + UNIT // 2) // UNIT, (y + UNIT // 2) // UNIT
