"""Orders: actions that a body does in place of its behaviors, until it is released.

A body has one order at a time. Nothing interrupts it, but a robot still gives way and its battery
still runs down. An order ends after its duration, with the next order, or on release.
"""

from datetime import timedelta
from typing import Protocol

from fleet2d.entities.behavior import Situation
from fleet2d.entities.place import Point, RoomChoice
from fleet2d.entities.plan import Plan
from fleet2d.kernels.numbers import TURN, turn_between
from fleet2d.units import micros


class Order(Protocol):
    """Base of orders, which decide in place of a body's behaviors."""

    def decide(self, now: Situation) -> Plan | None:
        """Return what to do from now on; None: it is over."""


class StandStill:
    """Stand still, wherever it is.

    Args:
        duration: For how long; None: for good.
    """

    def __init__(self, duration: timedelta | None = None) -> None:
        self._lasts_us = None if duration is None else micros(duration)
        self._until_us: int | None = None

    def decide(self, now: Situation) -> Plan | None:
        """Stay for the rest of the time."""
        plan = now.plan()
        if self._lasts_us is None:
            return plan.stay()
        if self._until_us is None:
            self._until_us = plan.time_us + self._lasts_us
        return None if plan.time_us >= self._until_us else plan.stay_until(self._until_us)


class Trip:
    """Go somewhere and stay there: the base of orders that move the body.

    Args:
        duration: For how long it stays once it is there; None: for good.
    """

    def __init__(self, duration: timedelta | None = None) -> None:
        self._lasts_us = None if duration is None else micros(duration)
        self._until_us: int | None = None
        self._goal: tuple[int, int, int] | None = None  # where it stays: x, y, away

    def decide(self, now: Situation) -> Plan | None:
        """Go there, unless it is there already, and stay for the rest of the time."""
        plan = now.plan()
        if self._goal != (plan.x, plan.y, plan.away):
            self.go(now, plan)
            self._goal = plan.x, plan.y, plan.away
            self._until_us = None if self._lasts_us is None else plan.time_us + self._lasts_us
        elif self._until_us is not None and plan.time_us >= self._until_us:
            return None
        return plan.stay() if self._until_us is None else plan.stay_until(self._until_us)

    def go(self, now: Situation, plan: Plan) -> None:
        """Add the way there to the plan."""
        raise NotImplementedError


class GoTo(Trip):
    """Walk to a place and stay there; a body that is away comes home first.

    Args:
        place: A room, furniture, or a point [m].
        heading: Where it faces on arrival [1/4096 turn]; None: as on its last leg.
        duration: For how long it stays; None: for good.
    """

    def __init__(
        self,
        place: RoomChoice | Point,
        heading: int | None = None,
        duration: timedelta | None = None,
    ) -> None:
        super().__init__(duration)
        self._place, self._heading = place, heading

    def go(self, now: Situation, plan: Plan) -> None:
        """Go to the place, and turn."""
        plan.come_home().go_to(self._place, "send")
        if self._heading is not None:
            plan.turn_by(turn_between(plan.heading, self._heading) / TURN)


class GoOut(Trip):
    """Leave the home, and stay away."""

    def go(self, now: Situation, plan: Plan) -> None:
        """Leave by the way out."""
        plan.leave_home()


class DoActivity(Trip):
    """Do an activity at its place.

    Args:
        activity: The activity's name, for the events table.
        place: Where to do it; None: where the body's own behavior does it.
        duration: For how long; None: for good.
    """

    def __init__(
        self, activity: str, place: RoomChoice | Point | None, duration: timedelta | None
    ) -> None:
        super().__init__(duration)
        self._activity, self._place = activity, place

    def go(self, now: Situation, plan: Plan) -> None:
        """Go to where it is done, and begin."""
        if self._place is not None:
            plan.come_home().go_to(self._place, "send")
        else:
            capable = (b for b in now.actor.behaviors if self._activity in b.activities())
            next(capable).perform(plan, self._activity)
        plan.note("activity", self._activity)
