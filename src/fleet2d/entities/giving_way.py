"""Giving way: a robot that stops before people, waits, and goes round them or gives up."""

from datetime import timedelta
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.component import Settings
from fleet2d.entities.plan import Plan
from fleet2d.entities.resume import resumed, without_next_stop
from fleet2d.floorplan.home.costmap import NO_WAY, route_by_cost
from fleet2d.units import Length, PositiveDuration

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.behavior import Situation

# It looks so often whether the way is clear again: at first, then whenever it has waited a tenth
# longer, and at the least.
LOOKS_EVERY = timedelta(seconds=1), timedelta(seconds=10)
# So soon after it waited it goes on counting; going round, it minds for so long not to touch.
JUST_WAITED = timedelta(seconds=15)
# Beside who doesn't go on it passes with so much between the bodies, where there is no more room,
# and with so much at the very least [m].
PASSING = 0.1
TOUCHING = 0.03

I64 = NDArray[np.int64]


class GivesWay(Settings):
    """Keep clear of people: wait before them, in doorways as elsewhere; go round, or give up."""

    distance: Length = Field(
        default=0.4, ge=0, le=3, description="it comes no nearer on its own, from body to body [m]"
    )
    patience: PositiveDuration = Field(
        default=timedelta(seconds=10),
        description="how long it waits before it goes round, by 0.1 m where there is no more room",
    )
    gives_up: PositiveDuration = Field(
        default=timedelta(minutes=2),
        description="how long it waits where there is no way round: then it leaves out that stop",
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
        """Stand still a moment, the longer the longer it has waited."""
        plan, waited = now.plan(), (now.step - self.since) * now.actor.clock.step_us
        if now.step == self.since:
            plan.note("gives_way", whom)
        often, seldom = LOOKS_EVERY
        plan.stay(min(max(often, timedelta(microseconds=waited // 10)), seldom))
        plan.interrupts = self.interrupts
        return plan

    def go_on(self, now: "Situation") -> Plan | None:
        """Return the rest of the plan; None if nothing is left."""
        return self._heard(resumed(now.actor, now.plan(), self.broken, self.step))

    def go_round(self, now: "Situation", people: I64, distance: float) -> Plan | None:
        """Return the rest of the plan by a way that keeps clear; None if there is none.

        Args:
            now: The situation.
            people: Where people are, and at which distance the bodies touch, int64 (n, 3).
            distance: How far to keep where there is room [m].
        """
        actor, lattice = now.actor, now.actor.home.plan.lattice
        for gap in (max(distance, PASSING) + lattice.cell, PASSING):
            around = people + np.array([0, 0, int(gap * lattice.units_per_m)], np.int64)
            begun, detour = self._looking_again(now), _Detour(actor, around)
            plan = resumed(actor, begun, self.broken, self.step, detour)
            if plan is not None:
                return self._heard(plan)
        return None

    def leave_out(self, now: "Situation", whom: str) -> Plan | None:
        """Return the plan without the stop that it can't get to; None if that was the last."""
        plan = self._looking_again(now).note("gives_up", whom)
        return self._heard(without_next_stop(now.actor, plan, self.broken, self.step))

    def give_up(self, now: "Situation", whom: str) -> Plan:
        """Stand for a step, after which the behaviors are asked anew."""
        return self._looking_again(now).note("gives_up", whom)

    def _looking_again(self, now: "Situation") -> Plan:
        """Return a plan that begins with a step of standing: whoever is in the way is seen."""
        return now.plan().stay(timedelta(microseconds=now.actor.clock.step_us))

    def _heard(self, plan: Plan | None) -> Plan | None:
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
