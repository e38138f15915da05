"""Giving way: a robot that stops before people, waits, and goes round who doesn't go on."""

from datetime import timedelta
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.component import Settings
from fleet2d.entities.plan import Plan
from fleet2d.entities.resume import resumed
from fleet2d.floorplan.costmap import NO_WAY, route_by_cost
from fleet2d.units import Length, PositiveDuration

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.behavior import Situation

# It looks so often whether the way is clear again.
LOOKS_EVERY = timedelta(seconds=1)
# So soon after it waited it goes on counting; so long it goes on without giving way again.
JUST_WAITED = timedelta(seconds=15)
# Beside who doesn't go on it passes with so much between the bodies, where there is room [m].
PASSING = 0.1

I64 = NDArray[np.int64]


class GivesWay(Settings):
    """Keep clear of people: wait before them, in doorways as elsewhere, then go round."""

    distance: Length = Field(
        default=0.4, ge=0, le=3, description="it comes no nearer on its own, from body to body [m]"
    )
    patience: PositiveDuration = Field(
        default=timedelta(seconds=10), description="how long it waits before it goes round, or on"
    )


class Waiting:
    """A robot that has stopped before somebody.

    Attributes:
        broken: The plan that it was following.
        step: The step at which it stopped following it.
        since: The step at which it first stopped before somebody.
        interrupts: What that plan wants to hear of.
    """

    def __init__(self, broken: Plan, step: int, since: int, interrupts: frozenset[str]) -> None:
        self.broken, self.step, self.since = broken, step, since
        self.interrupts = interrupts

    def wait(self, now: "Situation", whom: str) -> Plan:
        """Stand still a moment."""
        plan = now.plan()
        if now.step == self.since:
            plan.note("gives_way", whom)
        plan.stay(LOOKS_EVERY)
        plan.interrupts = self.interrupts
        return plan

    def go_on(self, now: "Situation", around: I64 | None = None) -> Plan | None:
        """Return the rest of the plan, round some places if given; None if nothing is left."""
        actor = now.actor
        route = None if around is None else _Detour(actor, around)
        plan = resumed(actor, now.plan(), self.broken, self.step, route)
        if plan is not None:
            plan.interrupts = self.interrupts
        return plan


class _Detour:
    """Ways that keep clear of people who stand about.

    Args:
        actor: The robot.
        people: Lattice points and how far to keep from each, int64 (n, 3).
    """

    def __init__(self, actor: "Actor", people: I64) -> None:
        self._space = actor.space
        xs, ys = actor.home.plan.lattice.centre_axes()
        self._cost = np.zeros(actor.space.part_of_cell.shape, np.int32)
        for x, y, reach in people.tolist():
            near = (xs[None, :] - x) ** 2 + (ys[:, None] - y) ** 2 <= reach * reach
            self._cost[near] = NO_WAY

    def __call__(self, start: tuple[int, int], goal: tuple[int, int]) -> I64 | None:
        """Return a way, or None if there is none that keeps clear."""
        return route_by_cost(self._space, self._cost, start, goal)
