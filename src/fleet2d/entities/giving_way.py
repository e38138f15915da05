"""Giving way: a robot that stops in front of people, waits, and goes round them or gives up."""

from datetime import timedelta
from typing import NamedTuple

import numpy as np
from pydantic import Field

from fleet2d.component import Settings
from fleet2d.entities.behavior import Situation
from fleet2d.entities.body import Body
from fleet2d.entities.plan import Plan
from fleet2d.entities.resume import resumed, without_next_stop
from fleet2d.floorplan.home.costmap import CLOSED, route_by_cost
from fleet2d.kernels import I64
from fleet2d.units import Length, PositiveDuration, micros

# Time between two looks whether the way is clear again: a tenth of the time waited so far, within
# these limits.
LOOKS_EVERY = timedelta(seconds=1), timedelta(seconds=10)
# A wait that begins this soon after another one continues it. For this long after going round
# people begins, the robot may come as near to them as TOUCHING.
JUST_WAITED = timedelta(seconds=15)
# Gap between the bodies at which it passes a person where there is no more room, and the gap below
# which it counts as touching [m].
PASSING = 0.1
TOUCHING = 0.03


class GivesWay(Settings):
    """Keep clear of people: wait before them, in doorways as elsewhere; go round, or give up.

    Attributes:
        distance: Gap between the bodies below which it doesn't drive nearer [m].
        patience: How long it waits before it goes round, by 0.1 m where there is no more room.
        gives_up: How long it waits where there is no way round before it skips the stop.
    """

    distance: Length = Field(default=0.4, ge=0, le=3)
    patience: PositiveDuration = timedelta(seconds=10)
    gives_up: PositiveDuration = timedelta(minutes=2)


class Surroundings(NamedTuple):
    """The people and obstacles around a robot that waits; it waits while they stay the same.

    Attributes:
        people: x and y of the people at home, and the distance between the middles at which the
            bodies touch [lattice], int64 (n, 3).
        everybody: x and y of all users, and whether they are away, int64 (users, 3).
        arrangement: The versions of doors and furniture, see `Body.arrangement`.
    """

    people: I64
    everybody: I64
    arrangement: tuple[int, int]

    def is_as(self, other: "Surroundings") -> bool:
        """Return whether no person and no object has moved."""
        same = np.array_equal(self.everybody, other.everybody)
        return same and self.arrangement == other.arrangement


class WaitForPeople:
    """The wait of a robot that has stopped in front of a person.

    The steps at which it looks are fixed beforehand. A look is skipped if nothing has moved since
    the one before, as its result is known: the plan to wait lasts until the first look that has a
    result in any case, and `Clearance` ends it at an earlier look if somebody moves.

    Attributes:
        interrupted: The plan that it was following.
        step: The step at which it stopped following it.
        since: The step at which it first stopped in front of a person.
        interrupts: The events that interrupt that plan.
        surroundings: The people and obstacles at its last look.
    """

    def __init__(
        self,
        interrupted: Plan,
        step: int,
        since: int,
        interrupts: frozenset[str],
        surroundings: Surroundings,
    ) -> None:
        self.interrupted, self.step, self.since = interrupted, step, since
        self.interrupts, self.surroundings = interrupts, surroundings
        self._step_us = interrupted.step_us

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
        shortest, longest = (micros(interval) for interval in LOOKS_EVERY)
        interval = min(max(shortest, self._waited(look) // 10), longest)
        return look + max(-(-interval // self._step_us), 1)

    def _waited(self, step: int) -> int:
        """Return how long it has waited at a step [us]."""
        return (step - self.since) * self._step_us

    def stand_still(self, now: Situation, person: str, gives_way: GivesWay) -> Plan:
        """Return a plan to stand still until the next look at whether the way is free.

        At the latest it ends when the robot goes round the person, or gives up.
        """
        plan, look, patience = now.plan(), self._look_after(now.step), micros(gives_way.patience)
        if now.step == self.since:
            plan.note("gives_way", person)
        if self._waited(now.step) >= patience:  # it has already looked for a way round
            patience = max(patience, micros(gives_way.gives_up))
        # At its first look it may still turn towards its next leg.
        while self.interrupted.began[0] == now.step and self._waited(look) < patience:
            look = self._look_after(look)
        plan.stay_until(look * self._step_us)
        plan.interrupts = self.interrupts
        return plan

    def continued(self, now: Situation) -> Plan | None:
        """Return the rest of the plan; None if nothing is left."""
        return self._with_interrupts(resumed(now.actor, now.plan(), self.interrupted, self.step))

    def go_round(self, now: Situation, people: I64, distance: float) -> Plan | None:
        """Return the rest of the plan by a way that keeps clear of people; None without such a way.

        Args:
            now: The situation.
            people: As `Surroundings.people`.
            distance: The gap to keep where there is room [m].
        """
        actor, lattice = now.actor, now.actor.home.plan.lattice
        for gap in (max(distance, PASSING) + lattice.cell, PASSING):
            around = people + np.array([0, 0, int(gap * lattice.units_per_m)], np.int64)
            plan, detour = self._stand_for_a_step(now), RoutesAround(actor, around)
            rest = resumed(actor, plan, self.interrupted, self.step, detour)
            if rest is not None:
                return self._with_interrupts(rest)
        return None

    def leave_out(self, now: Situation, person: str) -> Plan | None:
        """Return the plan without the stop that it can't get to; None if that was the last."""
        plan = self._stand_for_a_step(now).note("gives_up", person)
        return self._with_interrupts(
            without_next_stop(now.actor, plan, self.interrupted, self.step)
        )

    def give_up(self, now: Situation, person: str) -> Plan:
        """Stand for a step, after which the behaviors are asked again."""
        return self._stand_for_a_step(now).note("gives_up", person)

    def _stand_for_a_step(self, now: Situation) -> Plan:
        """Return a plan that begins with a step of standing, so that people in the way are seen."""
        return now.plan().stay(timedelta(microseconds=now.actor.clock.step_us))

    def _with_interrupts(self, plan: Plan | None) -> Plan | None:
        if plan is not None:
            plan.interrupts = self.interrupts
        return plan


class RoutesAround:
    """Routes that keep clear of people, or of other bodies, that stand in the way.

    Attributes:
        cost: int32 (rows, columns), CLOSED near them.

    Args:
        body: The body that goes there.
        people: x and y of each of them, and the distance to keep [lattice], int64 (n, 3).
    """

    def __init__(self, body: Body, people: I64) -> None:
        self._space = body.space
        xs, ys = body.home.plan.lattice.centre_axes()
        self.cost = np.zeros(body.space.part_of_cell.shape, np.int32)
        for x, y, reach in people.tolist():
            near = (xs[None, :] - x) ** 2 + (ys[:, None] - y) ** 2 <= reach * reach
            self.cost[near] = CLOSED

    def __call__(self, start: tuple[int, int], goal: tuple[int, int]) -> I64 | None:
        """Return a route between two lattice points, or None if none keeps clear."""
        return route_by_cost(self._space, self.cost, start, goal)
