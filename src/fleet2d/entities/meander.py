"""Meander: the random walk of the paper, for users and robots."""

import math
from typing import Literal

from pydantic import Field

from fleet2d.configuration.units import AngleDeg
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.plan import Plan
from fleet2d.kernels import BELL_STD, TURN, WalkRule

# This limit, a step longer than any home, keeps products within 64 bits.
MAX_STRIDE = 256 << 21


class Meander(Behavior):
    """Walk at random, for good: two-dimensional Brownian motion at a constant speed.

    In each step the body turns by a normally distributed angle, no faster than its turn rate, and
    goes forward at its speed. Where a wall is in the way it turns instead, by any angle that its
    turn rate allows. With `at_walls: stay` it turns by the same small angles as everywhere, like
    the published Fleet2D, and so spends most of the time at walls.

    Attributes:
        turn_std_deg: Standard deviation of the turn in one second [deg/sqrt(s)].
        at_walls: At a wall: turn by any angle, or by small ones until the way is free.
    """

    always_decides = True

    turn_std_deg: AngleDeg = Field(default=15.0, ge=0, le=36000)

    at_walls: Literal["turn", "stay"] = "turn"

    def start(self, actor: Actor) -> None:
        """Convert the rule of the walk to lattice units per step."""
        step_s = actor.clock.step_us / 1e6
        std = self.turn_std_deg / 360 * TURN * math.sqrt(step_s)  # headings per step
        self.rule = WalkRule(
            key=actor.stream("meander"),
            stride=min(round(actor.speed * step_s * 256), MAX_STRIDE),
            sway=round(std / BELL_STD * 65536),
            turn_limit=min(max(1, math.floor(actor.turn_rate * step_s)), TURN // 2),
            stays=int(self.at_walls == "stay"),
        )

    def decide(self, now: Situation) -> Plan:
        """Walk on."""
        return now.plan().meander(self.rule)
