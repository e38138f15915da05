"""Arbitration: which of a body's behaviors has its way.

They stand in order, the most important first. A body that is done with its plan, or interrupted,
asks them in turn, and follows the first plan that it gets. While it follows the plan of one, those
before it may break in: when their hours begin, when they have cooled down, at a time that they
named, or when something happens that they listen for. If none of them wants to, the plan goes on as
if nobody had been asked.
"""

from collections.abc import Callable, Sequence
from datetime import datetime

from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.hours import holds
from fleet2d.entities.plan import Plan
from fleet2d.entities.resume import resumed

Ask = Callable[[Behavior, Situation], Plan | None]


class Arbiter:
    """Asks the behaviors of one body.

    Attributes:
        active: The behavior whose plan is followed, by number; None: nobody's.
        wake_step: The step at which those before it are asked, though the plan isn't over.
        own: What the plan that is followed wants to hear of itself.
        off: The behaviors that are switched off, by number.
    """

    def __init__(self, behaviors: Sequence[Behavior]) -> None:
        self.behaviors = behaviors
        self.active: int | None = None
        self.wake_step: int | None = None
        self._cool_at: dict[int, datetime] = {}  # when each has cooled down
        # Plans to go on with, since when, and what they want to hear of.
        self._broken: dict[int, tuple[Plan, int, frozenset[str]]] = {}
        self.own: frozenset[str] = frozenset()
        self.off: frozenset[int] = frozenset()
        self._heard: frozenset[str] = frozenset()  # what only those before it want to hear of

    def goes_on(self, now: Situation, plan: Plan, ask: Ask) -> bool | Plan:
        """Ask those before the active behavior, where only they want to be asked.

        Args:
            now: The situation.
            plan: What is being followed.
            ask: Asks one behavior.

        Returns:
            True if the plan goes on, the plan of who breaks in, or False if all are to be asked.
        """
        heard = bool(now.events) and all(event.event in self._heard for event in now.events)
        woken = self.wake_step == now.step and not now.events
        if self.active is None or plan.is_over(now.step) or not (woken or heard):
            return False
        if self._closed(self.active, now):
            return False
        for number in range(self.active):
            if self.behaviors[number].preempts and self._may(number, now):
                found = ask(self.behaviors[number], now)
                if found is not None:
                    self._take(number, now, plan)
                    return found
        return True

    def choose(self, now: Situation, plan: Plan, ask: Ask) -> Plan | None:
        """Ask all in turn; return the first plan, or None if nobody has one."""
        if self.active is not None and plan.is_over(now.step):
            self._cool_down(self.active, now)
        for number, behavior in enumerate(self.behaviors):
            if not self._may(number, now):
                self._broken.pop(number, None)
                continue
            found = self._resumed(number, now) or ask(behavior, now)
            if found is not None:
                self._take(number, now, plan)
                return found
        self._take(None, now, plan)
        return None

    def give_up(self, now: Situation) -> None:
        """Tell the active behavior that its plan can't be gone on with."""
        if self.active is not None:
            self.behaviors[self.active].give_up(now)

    def watch(self, now: Situation, plan: Plan, *, fresh: bool) -> None:
        """Let those who may break in say when and at what.

        Args:
            now: The situation.
            plan: What the body follows.
            fresh: Whether it begins with it, and doesn't go on with it.
        """
        if fresh:
            self.own = plan.interrupts
        active = len(self.behaviors) if self.active is None else self.active
        times, heard = [self._closes_at(active, now)], self.own
        for number, behavior in enumerate(self.behaviors[:active]):
            if not behavior.preempts or number in self.off:
                continue
            opens = self._opens_at(number, now)
            if opens is not None:
                times.append(opens)
            else:
                times.append(behavior.wakes_at(now, plan))
                heard |= behavior.listens
        self._heard = heard - self.own
        plan.interrupts = heard
        clock = now.actor.clock
        steps = [clock.step_at_or_after(clock.elapsed(time)) for time in times if time is not None]
        self.wake_step = max(min(steps), now.step + 1) if steps else None

    def _may(self, number: int, now: Situation) -> bool:
        """Tell whether it is a behavior's time."""
        behavior = self.behaviors[number]
        if number in self.off:
            return False
        if not (behavior.when or behavior.cooldown) or behavior.busy():
            return True
        return self._opens_at(number, now) is None

    def _opens_at(self, number: int, now: Situation) -> datetime | None:
        """Return from when on a behavior may be asked; None: now."""
        when, time = self.behaviors[number].when, now.time
        cool = self._cool_at.get(number)
        if cool is not None and cool > time:
            time = cool
        if when and holds(when, time) is None:
            return min(span.next_begin(time) for span in when)
        return time if time > now.time else None

    def _closes_at(self, number: int, now: Situation) -> datetime | None:
        """Return when the hours of the active behavior are over; None if that ends nothing."""
        if number >= len(self.behaviors) or self.behaviors[number].busy():
            return None
        when = self.behaviors[number].when
        return holds(when, now.time) if when else None

    def _closed(self, number: int, now: Situation) -> bool:
        behavior = self.behaviors[number]
        return (
            bool(behavior.when) and holds(behavior.when, now.time) is None and not behavior.busy()
        )

    def _take(self, number: int | None, now: Situation, plan: Plan) -> None:
        """Note whose turn it is now."""
        last, self.active = self.active, number
        if last is None or last == number:
            return
        broken_off = number is not None and number < last and not plan.is_over(now.step)
        if broken_off and self.behaviors[last].resumes:
            self._broken[last] = plan, now.step, self.own
        else:
            self._cool_down(last, now)

    def _cool_down(self, number: int, now: Situation) -> None:
        behavior = self.behaviors[number]
        cools = number in self._cool_at and self._cool_at[number] > now.time
        if behavior.cooldown and not behavior.busy() and not cools:
            self._cool_at[number] = now.time + behavior.cooldown

    def _resumed(self, number: int, now: Situation) -> Plan | None:
        """Return the rest of the plan of a behavior that was broken off, if there is one."""
        if number not in self._broken:
            return None
        broken, step, interrupts = self._broken.pop(number)
        plan = resumed(now.actor, now.plan(), broken, step)
        if plan is not None:
            plan.interrupts = interrupts
        return plan
