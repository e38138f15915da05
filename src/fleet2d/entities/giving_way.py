"""Giving way: a robot that stops before people, waits, and goes round them or gives up."""

from datetime import timedelta
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.component import Settings
from fleet2d.entities.plan import Plan
from fleet2d.entities.resume import resumed, without_next_stop
from fleet2d.floorplan.home.costmap import NO_WAY, route_by_cost
from fleet2d.units import Length, PositiveDuration, micros

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


class Crowd(NamedTuple):
    """What a robot that waits has before it: while it stays the same, waiting goes on.

    Attributes:
        people: Where people at home are, and at which distance the bodies touch [lattice], int64
            (n, 3).
        everybody: Where everybody is, and whether away, int64 (users, 3).
        arrangement: Of doors and furniture.
    """

    people: I64
    everybody: I64
    arrangement: tuple[int, int]

    def is_as(self, other: "Crowd") -> bool:
        """Tell whether nobody and nothing has moved."""
        same = np.array_equal(self.everybody, other.everybody)
        return same and self.arrangement == other.arrangement


class Waiting:
    """A robot that has stopped before somebody.

    It looks at steps that are fixed beforehand. A look at which nothing has moved since the last
    one finds what that found, so it isn't made: the plan to wait reaches up to the first look that
    matters even so, and `Clearance` ends it at an earlier one if somebody moves.

    Attributes:
        broken: The plan that it was following.
        step: The step at which it stopped following it.
        since: The step at which it first stopped before somebody.
        interrupts: What that plan wants to hear of.
        crowd: What it has seen at its last look.
    """

    def __init__(
        self, broken: Plan, step: int, since: int, interrupts: frozenset[str], crowd: Crowd
    ) -> None:
        self.broken, self.step, self.since = broken, step, since
        self.interrupts, self.crowd = interrupts, crowd
        self._step_us = broken.step_us

    def look_from(self, step: int) -> int:
        """Return the first step from `step` on at which it looks."""
        look = self.step
        while look < step:
            look = self._look_after(look)
        return look

    def look_before(self, step: int) -> int:
        """Return the last step before `step` at which it looked."""
        look = self.step
        while (after := self._look_after(look)) < step:
            look = after
        return look

    def _look_after(self, look: int) -> int:
        often, seldom = (micros(moment) for moment in LOOKS_EVERY)
        moment = min(max(often, self._waited(look) // 10), seldom)
        return look + max(-(-moment // self._step_us), 1)

    def _waited(self, step: int) -> int:
        return (step - self.since) * self._step_us

    def wait(self, now: "Situation", whom: str, gives_way: GivesWay) -> Plan:
        """Stand still until it is time to do something else, if nobody moves."""
        plan, look, patience = now.plan(), self._look_after(now.step), micros(gives_way.patience)
        if now.step == self.since:
            plan.note("gives_way", whom)
        if self._waited(now.step) >= patience:  # it has looked for a way round
            patience = max(patience, micros(gives_way.gives_up))
        # At its first look it may turn to where it would go on.
        while self.broken.began[0] == now.step and self._waited(look) < patience:
            look = self._look_after(look)
        plan.stay_until(look * self._step_us)
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
