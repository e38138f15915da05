"""Arbitration: which of a body's behaviors decides on its plan.

Behaviors are in order of priority, the highest first. When a body's plan is over or interrupted, it
asks them in turn, and follows the first plan that one returns. While it follows the plan of one,
those of higher priority may take over: when their hours begin, when their cooldown is over, at a
time that they named, or at an event that they listen for. If none of them returns a plan, the
present plan goes on as if they had not been asked.
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
        active: The number of the behavior whose plan is followed; None: of no behavior.
        wake_step: The step at which those before it are asked, though the plan isn't over.
        own: The events that interrupt the present plan by its own request.
        off: The numbers of the behaviors that are switched off.
    """

    def __init__(self, behaviors: Sequence[Behavior]) -> None:
        self.behaviors = behaviors
        self.active: int | None = None
        self.wake_step: int | None = None
        self._cool_at: dict[int, datetime] = {}  # when the cooldown of each is over
        # By behavior: the plan to resume, the step of its interruption, and its own interrupts.
        self._interrupted: dict[int, tuple[Plan, int, frozenset[str]]] = {}
        self.own: frozenset[str] = frozenset()
        self.off: frozenset[int] = frozenset()
        # Events at which only behaviors before the active one are asked.
        self._preempting_events: frozenset[str] = frozenset()

    def goes_on(self, now: Situation, plan: Plan, ask: Ask) -> bool | Plan:
        """Ask the behaviors before the active one, if only they have to be asked.

        Args:
            now: The situation.
            plan: The present plan.
            ask: Asks one behavior.

        Returns:
            True if the plan goes on, the plan of a behavior that takes over, or False if all
            behaviors have to be asked.
        """
        only_preempting = bool(now.events) and all(
            event.event in self._preempting_events for event in now.events
        )
        is_time = self.wake_step == now.step and not now.events
        if self.active is None or plan.is_over(now.step) or not (is_time or only_preempting):
            return False
        if self._closed(self.active, now):
            return False
        for number in range(self.active):
            if self.behaviors[number].preempts and self._may_decide(number, now):
                other = ask(self.behaviors[number], now)
                if other is not None:
                    self._activate(number, now, plan)
                    return other
        return True

    def choose(self, now: Situation, plan: Plan, ask: Ask) -> Plan | None:
        """Ask all behaviors in turn; return the first plan, or None if none returns one."""
        if self.active is not None and plan.is_over(now.step):
            self._cool_down(self.active, now)
        for number, behavior in enumerate(self.behaviors):
            if not self._may_decide(number, now):
                self._interrupted.pop(number, None)
                continue
            chosen = self._resumed(number, now) or ask(behavior, now)
            if chosen is not None:
                self._activate(number, now, plan)
                return chosen
        self._activate(None, now, plan)
        return None

    def give_up(self, now: Situation) -> None:
        """Let the active behavior give up its plan, which can't be continued."""
        if self.active is not None:
            self.behaviors[self.active].give_up(now)

    def watch(self, now: Situation, plan: Plan, *, fresh: bool) -> None:
        """Set when, and at which events, behaviors before the active one are asked.

        Args:
            now: The situation.
            plan: The plan that the body follows.
            fresh: Whether the plan begins now.
        """
        if fresh:
            self.own = plan.interrupts
        active = len(self.behaviors) if self.active is None else self.active
        times, events = [self._closes_at(active, now)], self.own
        for number, behavior in enumerate(self.behaviors[:active]):
            if not behavior.preempts or number in self.off:
                continue
            opens = self._opens_at(number, now)
            if opens is not None:
                times.append(opens)
            else:
                times.append(behavior.wakes_at(now, plan))
                events |= behavior.listens
        self._preempting_events = events - self.own
        plan.interrupts = events
        clock = now.actor.clock
        steps = [clock.step_at_or_after(clock.elapsed(time)) for time in times if time is not None]
        self.wake_step = max(min(steps), now.step + 1) if steps else None

    def _may_decide(self, number: int, now: Situation) -> bool:
        """Return whether a behavior may be asked: it is on, in its hours, and past its cooldown."""
        behavior = self.behaviors[number]
        if number in self.off:
            return False
        if not (behavior.when or behavior.cooldown) or behavior.busy():
            return True
        return self._opens_at(number, now) is None

    def _opens_at(self, number: int, now: Situation) -> datetime | None:
        """Return when a behavior may be asked next; None: now."""
        when, time = self.behaviors[number].when, now.time
        cool = self._cool_at.get(number)
        if cool is not None and cool > time:
            time = cool
        if when and holds(when, time) is None:
            return min(span.next_begin(time) for span in when)
        return time if time > now.time else None

    def _closes_at(self, number: int, now: Situation) -> datetime | None:
        """Return when the hours of the active behavior are over; None if they don't end it."""
        if number >= len(self.behaviors) or self.behaviors[number].busy():
            return None
        when = self.behaviors[number].when
        return holds(when, now.time) if when else None

    def _closed(self, number: int, now: Situation) -> bool:
        behavior = self.behaviors[number]
        return (
            bool(behavior.when) and holds(behavior.when, now.time) is None and not behavior.busy()
        )

    def _activate(self, number: int | None, now: Situation, plan: Plan) -> None:
        """Make a behavior the active one; the plan of the one before may be resumed later."""
        last, self.active = self.active, number
        if last is None or last == number:
            return
        is_interrupted = number is not None and number < last and not plan.is_over(now.step)
        if is_interrupted and self.behaviors[last].resumes:
            self._interrupted[last] = plan, now.step, self.own
        else:
            self._cool_down(last, now)

    def _cool_down(self, number: int, now: Situation) -> None:
        behavior = self.behaviors[number]
        is_cooling = number in self._cool_at and self._cool_at[number] > now.time
        if behavior.cooldown and not behavior.busy() and not is_cooling:
            self._cool_at[number] = now.time + behavior.cooldown

    def _resumed(self, number: int, now: Situation) -> Plan | None:
        """Return the rest of the interrupted plan of a behavior, if there is one."""
        if number not in self._interrupted:
            return None
        interrupted, step, interrupts = self._interrupted.pop(number)
        plan = resumed(now.actor, now.plan(), interrupted, step)
        if plan is not None:
            plan.interrupts = interrupts
        return plan
