"""Decisions: the choice of the plan that a body follows next.

Behaviors are in order of priority, the highest first. When a body's plan is over or interrupted, it
asks them in turn, and follows the first plan that one returns. While it follows the plan of one,
those of higher priority may take over: when their hours begin, when their cooldown is over, at a
time that they named, or at an event that they listen for. If none of them returns a plan, the
present plan goes on as if they had not been asked.

An order decides in place of the behaviors, until the body is released. A body has one order at a
time. Nothing interrupts an order, but a robot still gives way and its battery still runs down. It
ends after its duration, with the next order, or on release.
"""

import copy
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Protocol

from fleet2d.configuration.units import micros
from fleet2d.entities.behavior import (
    DOOR_WAIT,
    Actor,
    Behavior,
    Command,
    SightEvent,
    Situation,
    holds,
)
from fleet2d.entities.body import Pose
from fleet2d.entities.place import Point, RoomChoice, lies_in, nearest_room
from fleet2d.entities.plan import Plan
from fleet2d.entities.power import EMPTY
from fleet2d.errors import ComponentError, InputError, NoWayError, PlacementError, blame
from fleet2d.floorplan.placed_objects import Posture
from fleet2d.runtime.events import EventKind

if TYPE_CHECKING:
    from fleet2d.entities.entity import GivesWay
    from fleet2d.entities.giving_way import Surroundings, WaitForPeople

Ask = Callable[[Behavior, Situation], Plan | None]


class Arbiter:
    """Asks the behaviors of one body.

    Attributes:
        active: The number of the behavior whose plan is followed; None: none.
        wake_step: The step at which earlier behaviors are asked during the plan.
        own: The events by which the present plan asks to be interrupted.
        off: The numbers of the behaviors that are switched off.
    """

    def __init__(self, behaviors: Sequence[Behavior]) -> None:
        self.behaviors = behaviors
        self.active: int | None = None
        self.wake_step: int | None = None
        self._cool_at: dict[int, datetime] = {}  # end of each cooldown
        # The present time in which the hours hold or don't, by behavior.
        self._hours: dict[int, tuple[datetime, datetime, bool]] = {}
        # The plan to resume by behavior, with the step of its interruption, its own interrupts, and
        # the rooms that the body kept out of.
        self._interrupted: dict[int, tuple[Plan, int, frozenset[str], frozenset[int]]] = {}
        self.own: frozenset[str] = frozenset()
        self.off: frozenset[int] = frozenset()
        # Only behaviors before the active one are asked at these events.
        self._preempting_events: frozenset[str] = frozenset()

    def keeps_plan(self, now: Situation, plan: Plan, ask: Ask) -> bool | Plan:
        """Ask the behaviors before the active one, if only they have to be asked.

        Args:
            now: The situation.
            plan: The present plan.
            ask: Asks one behavior.

        Returns:
            True if the plan goes on, the plan of a behavior that takes over, or False if all
            behaviors have to be asked.
        """
        events = {event.event for event in now.events}
        is_due = events <= self._preempting_events if events else self.wake_step == now.step
        if self.active is None or plan.is_over(now.step) or not is_due:
            return False
        if self._minds_hours(self.active) and not self._hours_of(self.active, now.time)[1]:
            return False
        for number in range(self.active):
            if self.behaviors[number].preempts and self._may_decide(number, now):
                other = ask(self.behaviors[number], now)
                if other is not None:
                    self._activate(number, now, plan)
                    return other
        return True

    def asks_first(self, now: Situation, plan: Plan) -> bool:
        """Return whether `keeps_plan` or `choose` would ask the first behavior."""
        goes_on = self.active == 0 and not plan.is_over(now.step) and not now.events
        return self._may_decide(0, now) and not (goes_on and self.wake_step == now.step)

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

    def watch(self, now: Situation, plan: Plan, *, fresh: bool) -> None:
        """Set the times and events at which behaviors before the active one are asked.

        Args:
            now: The situation.
            plan: The plan that the body follows.
            fresh: Whether the plan begins now.
        """
        if fresh:
            self.own = plan.interrupts
        times: list[datetime | None] = []
        events = self.own
        if self.active is not None and self._minds_hours(self.active):
            ends, holds_now = self._hours_of(self.active, now.time)
            if holds_now:
                times.append(ends)
        for number, behavior in enumerate(self.behaviors[: self.active]):
            if not behavior.preempts or number in self.off:
                continue
            opens = self._opens_at(number, now)
            if opens is not None:
                times.append(opens)
            else:
                times.append(behavior.wakes_at(now, plan))
                events |= behavior.awaits(now)
        self._preempting_events = events - self.own
        plan.interrupts = events
        clock = now.actor.clock
        steps = [clock.step_at_or_after(clock.elapsed(time)) for time in times if time is not None]
        self.wake_step = max(min(steps), now.step + 1) if steps else None

    def hear(self, plan: Plan, event: str) -> None:
        """Let an event end a plan, at which only behaviors before the active one are asked."""
        if event not in self.own:
            self._preempting_events |= {event}
            plan.interrupts |= {event}

    def _may_decide(self, number: int, now: Situation) -> bool:
        """Return whether a behavior may be asked: it is on, in its hours, and past its cooldown."""
        behavior = self.behaviors[number]
        if number in self.off:
            return False
        if not (behavior.when or behavior.cooldown) or behavior.busy():
            return True
        return self._opens_at(number, now) is None

    def _opens_at(self, number: int, now: Situation) -> datetime | None:
        """Return the time at which a behavior may be asked next; None: now."""
        when = self.behaviors[number].when
        time = now.time
        cool = self._cool_at.get(number)
        if cool is not None and cool > time:
            time = cool
        if when:
            changes, holds_now = self._hours_of(number, time)
            if not holds_now:
                return changes
        return time if time > now.time else None

    def _hours_of(self, number: int, time: datetime) -> tuple[datetime, bool]:
        """Return the time until which a behavior's hours hold or don't, and whether they do."""
        since, until, holds_now = self._hours.get(number, (time, time, False))
        if not since <= time < until:
            when = self.behaviors[number].when
            end = holds(when, time)
            holds_now = end is not None
            until = min(span.next_begin(time) for span in when) if end is None else end
            self._hours[number] = time, until, holds_now
        return until, holds_now

    def _minds_hours(self, number: int) -> bool:
        """Return whether a behavior ends with its hours."""
        behavior = self.behaviors[number]
        return bool(behavior.when) and not behavior.busy()

    def _activate(self, number: int | None, now: Situation, plan: Plan) -> None:
        """Make a behavior the active one; the plan of the one before may be resumed later."""
        last = self.active
        self.active = number
        if last is None or last == number:
            return
        is_interrupted = number is not None and number < last and not plan.is_over(now.step)
        if is_interrupted and self.behaviors[last].resumes:
            self._interrupted[last] = plan, now.step, self.own, now.actor.kept_out
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
        interrupted, step, interrupts, kept_out = self._interrupted.pop(number)
        if kept_out != now.actor.kept_out:
            return None  # the way may lead through a room that is forbidden now
        from fleet2d.entities.giving_way import resumed  # few runs need it

        plan = resumed(now.plan(), interrupted, step)
        if plan is not None:
            plan.interrupts = interrupts
        return plan


class Order(Protocol):
    """Base of orders, which decide in place of a body's behaviors."""

    def decide(self, now: Situation) -> Plan | None:
        """Return the plan from now on; None: the order is over."""


@dataclass
class StandStill:
    """Stand still, wherever it is.

    Attributes:
        duration: Its duration; None: for good.
        posture: Its posture; None: as before.
    """

    duration: timedelta | None = None
    posture: Posture | None = None
    _until: datetime | None = None

    def decide(self, now: Situation) -> Plan | None:
        """Stay for the rest of the time."""
        plan = now.plan()
        if self.posture is not None:
            plan.take(self.posture)
        if self.duration is None:
            return plan.stay()
        self._until = self._until or now.time + self.duration
        return None if now.time >= self._until else plan.stay(until=self._until)


@dataclass
class Trip:
    """Go somewhere and stay there: the base of orders that move the body.

    Attributes:
        duration: Time of staying there; None: for good.
    """

    duration: timedelta | None = field(default=None, kw_only=True)
    _until: datetime | None = field(default=None, init=False)
    _goal: tuple[int, int, int] | None = field(default=None, init=False)  # x, y, away

    def decide(self, now: Situation) -> Plan | None:
        """Go there, unless already there, and stay for the rest of the time."""
        plan = now.plan()
        if self._goal != (plan.x, plan.y, plan.away):
            self.go(now, plan)
            self._goal = plan.x, plan.y, plan.away
            self._until = None if self.duration is None else plan.time + self.duration
        elif self._until is not None and now.time >= self._until:
            return None
        return plan.stay(until=self._until)

    def has_reached(self, pose: Pose) -> bool:
        """Return whether a pose is at the planned end of the trip."""
        return self._goal == (pose.x, pose.y, pose.away)

    def go(self, now: Situation, plan: Plan) -> None:
        """Add the way there to the plan."""
        raise NotImplementedError


@dataclass
class GoTo(Trip):
    """Walk to a place and stay there; a body that is away comes home first.

    Attributes:
        place: A room, furniture, or a point [m].
        heading: Heading on arrival [1/4096 turn]; None: as on the last leg.
    """

    place: RoomChoice | Point
    heading: int | None = None

    def go(self, now: Situation, plan: Plan) -> None:
        """Go to the place, and turn."""
        plan.come_home().go_to(self.place, "send")
        if self.heading is not None:
            plan.turn_to(self.heading)


@dataclass
class LeaveRoom:
    """Leave a banned room for the nearest allowed one.

    Attributes:
        about: The ban, for the events table.
    """

    about: str
    _has_tried: bool = False

    def decide(self, now: Situation) -> Plan | None:
        """Go to the nearest allowed room that bans don't enclose, once."""
        actor = now.actor
        banned = actor.banned(now.step)
        if self._has_tried or not lies_in(actor, actor.state.position, banned):
            return None
        self._has_tried = True
        plan = now.plan().note(EventKind.WITHDRAWS, self.about)
        room = now.room
        if room is None or room.index not in banned:  # the ban is of a drawn area
            outside = actor.space_without(banned).nearest(*plan.position)
            if outside is not None and plan.reaches(*outside):
                plan.go_to_point(*outside)
            return plan.stay(timedelta(seconds=1))
        allowed = actor.space_without(banned).rooms_of(0)
        reachable = actor.reachable_rooms()
        others = [room for room in reachable if room.index in allowed - banned]
        if others:
            plan.go_to([nearest_room(others, now.xy).name], "withdraw")
        return plan.stay(timedelta(seconds=1))


class GoOut(Trip):
    """Leave the home, and stay away."""

    def go(self, now: Situation, plan: Plan) -> None:
        """Leave by the way out."""
        plan.leave_home()


@dataclass
class DoActivity(Trip):
    """Do an activity at its place.

    Attributes:
        activity: The activity's name, for the events table.
        place: The place; None: that of the body's own behavior.
    """

    activity: str
    place: RoomChoice | Point | None

    def decide(self, now: Situation) -> Plan | None:
        """Do the activity; the order is over if no behavior does it any more."""
        is_possible = self.place is not None or self._performer(now) is not None
        return super().decide(now) if is_possible else None

    def go(self, now: Situation, plan: Plan) -> None:
        """Go to the place of the activity, and begin."""
        performer = self._performer(now)
        if self.place is not None:
            plan.come_home().go_to(self.place, "send")
        elif performer is not None:
            performer.perform(plan, self.activity)
        plan.note(EventKind.ACTIVITY, self.activity)

    def _performer(self, now: Situation) -> Behavior | None:
        capable = (b for b in now.actor.behaviors if self.activity in b.activities())
        return next(capable, None)


# Without a plan from any behavior, a body stands still this long before they are asked again.
PAUSE = timedelta(minutes=1)


@dataclass(eq=False)
class DecidingActor(Actor):
    """An actor as the engine runs it: decides on its plans, and takes orders and commands.

    Attributes:
        arbiter: Asks its behaviors.
        order: The order that decides in place of its behaviors; None: there is none.
        waiting: Its wait, if it has stopped in front of a person.
        is_stuck: Whether it can't move, whatever its behaviors or an order want.
        off_at: Its pose when it was off last.
        is_displaced: Whether it was ever put somewhere, so that no way may lead out.
        passes_until: Before that step it goes round people, and may come near without touching.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        self.arbiter = Arbiter(self.behaviors)
        self.order: Order | None = None
        self.is_stuck = self.is_displaced = False
        self.off_at = self.state
        self.passes_until = 0
        self._chosen: Plan | None = None  # set by `choose` or `keeps_plan` for the next `decide`
        self.waiting: WaitForPeople | None = None
        self._waited = (0, -1)  # beginning of the last wait, and the step up to which it counts
        self._no_way_round: object = None  # situation without a way round people
        self._blocked = ("", -1)  # obstacle, and the step up to which it waits there

    @property
    def is_immobile(self) -> bool:
        """Whether a fault or an empty battery keeps it from moving at present."""
        return self.is_stuck or (self.charge is not None and self.charge.is_empty)

    def choose(self, plan: Plan) -> None:
        """Set the plan of the decision that is due now."""
        self._chosen = plan
        self.waiting = None
        self.order = None

    def follow_order(self, order: Order | None, step: int) -> None:
        """Follow an order from a step on, in place of its behaviors; None: follow them again."""
        self.order = order
        self.waiting = None
        self.arbiter.own = frozenset()
        self._chosen = None
        self.decide_again(step)

    def put(self, pose: Pose, step: int) -> None:
        """Move to a pose at a step, and replan there, since the present plan is void."""
        self.state = pose
        self._chosen = None
        self.waiting = None
        self.is_displaced = True
        banned = self.banned(step)
        if not self.state.away and self._is_in(banned):
            self.kept_out = frozenset()  # the way out may lead through other forbidden rooms
            self.order = LeaveRoom("keep_out")
        self.part = self._present_part()
        self.decide_again(step)

    def decide_again(self, step: int) -> None:
        """Ask all behaviors at a step, even if the plan isn't over."""
        self.ask(step)
        self.arbiter.wake_step = None

    def keep_out(self, room: int, step: int, until: int, about: str) -> None:
        """Keep out of a room from a step on, after leaving it if inside.

        Args:
            room: The index of the room.
            step: The step.
            until: The first step at which it may enter again.
            about: The ban, for the events table.
        """
        self.bans = {**self.bans, room: max(until, self.bans.get(room, 0))}
        is_here = not self.state.away and self._is_in(frozenset({room}))
        self.follow_order(LeaveRoom(about) if is_here else self.order, step)

    def _is_in(self, zones: frozenset[int]) -> bool:
        """Return whether the body is in one of some rooms, by index, or areas."""
        return lies_in(self, self.state.position, zones)

    def _heeds_rules(self, now: Situation) -> bool:
        """Update the rules of keeping out that hold; return whether they have changed."""
        ruled = self.rules_at(now.time)
        if ruled == self.ruled:
            return False
        self.ruled = ruled
        banned = self.banned(now.step)
        if not self.state.away and self._is_in(banned):
            self.order = LeaveRoom("keep_out")
        else:
            self.kept_out = banned
        self._chosen = None
        self.waiting = None
        return True

    def _runs_down(self, now: Situation) -> bool:
        """Update the charge of its battery, if it has one; return whether it is empty."""
        if self.charge is None:
            return False
        self.charge.follow(self.motion, now.step * self.clock.step_us)
        return self.charge.is_empty

    def receive(self, command: Command, step: int) -> bool:
        """Keep a command until a behavior takes it up; return whether one is asked at once.

        A behavior after the active one has to wait for its turn; a body that is off hears no
        command.
        """
        if self.is_off:
            return False
        self.command = command
        takers = (i for i, behavior in enumerate(self.behaviors) if behavior.takes(command))
        first = next(takers, None)
        active = self.arbiter.active
        now = self.order is None and first is not None and (active is None or first <= active)
        if now:
            self.decide_again(step)
        return now

    def dismiss(self, step: int) -> None:
        """Drop the command, and replan."""
        self.command = None
        for behavior in self.behaviors:
            behavior.dismiss()
        self.decide_again(step)

    def reboot(self, step: int) -> None:
        """Begin anew after having been off, without the present tasks of the behaviors."""
        off = self.arbiter.off
        for number in range(len(self.behaviors)):
            with suppress(InputError):  # the home may have changed so that it can't begin
                self.replace(number, self._declared[number])
        self.arbiter = Arbiter(self.behaviors)
        self.arbiter.off = off
        self.command = None
        self._waited = (0, -1)
        self._blocked = ("", -1)
        self.passes_until = 0
        self.follow_order(None, step)

    def reacts_to(self, event: SightEvent, step: int) -> bool:
        """Return whether the body reacts to an action of a robot."""
        if self.order is not None:
            return False
        return self._attentive is not None and self._attentive[0].reacts_to(self, event, step)

    def keeps_plan(self, now: Situation) -> bool:
        """Return whether the plan goes on at a step at which behaviors want to be asked.

        If one of them returns another plan, `decide` takes that.
        """
        if self._runs_down(now):
            return False
        if self.rules is not None and self._heeds_rules(now):
            return False
        # Once outside of banned rooms, ways avoid them.
        if self.bans or self.ruled or self.kept_out != self.forbidden:
            banned = self.banned(now.step)
            if banned != self.kept_out and not self._is_in(banned):
                self.kept_out = banned
        if self._chosen is not None or self.order is not None or self.is_stuck:
            return False
        if self.arbiter.active is None or self.plan.is_over(now.step):
            return False
        with blame(self.path, now.step):
            answer = self.arbiter.keeps_plan(now, self.plan, self._ask_behavior)
            if answer is True:
                self._set_next_decision(now, fresh=False)
                return True
        self._chosen = answer if isinstance(answer, Plan) else None
        return False

    def asks_first(self, now: Situation) -> bool:
        """Return whether the due decision asks the first behavior for a plan.

        The question changes nothing.
        """
        if self.is_stuck or self._chosen is not None or self._runs_down(now):
            return False
        waits = self.waiting is not None and not now.events
        if waits and self.waiting.continued(now) is not None:  # type: ignore[union-attr]
            return False
        return self._is_order_over(now) and self.arbiter.asks_first(now, self.plan)

    def _is_order_over(self, now: Situation) -> bool:
        """Return whether there is no order, or one that is over; nothing changes."""
        if self.order is None:
            return True
        try:
            return copy.copy(self.order).decide(now) is None
        except (PlacementError, NoWayError):
            return False

    def decide(self, now: Situation) -> None:
        """Ask the behaviors, in order, for a plan that begins now."""
        step = now.step
        plan = self._chosen
        self._chosen = None
        if self.is_immobile:
            plan = now.plan().stay()
        waiting = self.waiting
        self.waiting = None
        if waiting is not None:
            self._waited = waiting.since, waiting.look_before(step) + self._continuation_steps
        if plan is None and waiting is not None and not now.events:
            plan = waiting.continued(now)
        with blame(self.path, step):
            if plan is None and self.order is not None:
                plan = self._ask_behavior(self.order, now)
                self.order = self.order if plan else None
            plan = plan or self.arbiter.choose(now, self.plan, self._ask_behavior)
        if plan is None:
            plan = now.plan()
            plan = plan.stay(PAUSE) if self.behaviors else plan.stay()
        if not isinstance(plan, Plan):
            raise ComponentError(f"{self.path}: decide() returned {plan!r}, not a plan or None")
        if plan.began != (step, self.state):
            raise ComponentError(
                f"{self.path}: decide() returned a plan that doesn't begin here and now: make one"
                " by now.plan()"
            )
        self._follow(plan, step)
        if self.charge is not None:
            self.charge.record(plan)
        with blame(self.path, step):
            self._set_next_decision(now, fresh=True)

    def reason(self) -> tuple[str, str]:
        """Return the source of the plan, a behavior or `order`, and its last note."""
        if self.off_for is not None:
            return "off", self.off_for
        active = self.arbiter.active
        notes = self.plan.notes
        note = f"{notes[-1].event} {notes[-1].detail}".strip() if notes else ""
        if self.order is not None:
            return "order", note
        return "" if active is None else self.behaviors[active].type_name, note

    @property
    def _continuation_steps(self) -> int:
        """The steps after a wait within which another one counts as its continuation."""
        from fleet2d.entities.giving_way import REPEATED_WAIT  # few robots need it

        return micros(REPEATED_WAIT) // self.clock.step_us + 1

    def give_way(self, now: Situation, person: str, surroundings: "Surroundings") -> None:
        """Stop in front of a person who is in the way; go round after a while, or give up.

        Args:
            now: The situation.
            person: The name of the person.
            surroundings: The places of people.
        """
        from fleet2d.entities.giving_way import WaitForPeople

        step = now.step
        just = self._continuation_steps
        since = self._waited[0] if step <= self._waited[1] else step
        wait = WaitForPeople(self.plan, step, since, self.arbiter.own, surroundings)
        people = surroundings.people
        self._waited = (since, step + just)
        self.passes_until = step
        gives_way: GivesWay = self.entity.gives_way  # type: ignore[attr-defined]
        waited = (step - since) * self.clock.step_us
        plan = None
        where = self.state, self.plan.root, people.tobytes()
        if waited >= micros(gives_way.patience) and where != self._no_way_round:
            plan = wait.go_around(now, people, gives_way.distance)
            self.passes_until = step + just if plan is not None else step
            self._no_way_round = where
        if plan is None and waited >= micros(max(gives_way.patience, gives_way.gives_up)):
            plan = wait.skip_stop(now, person)
            self._waited = (0, -1)
            if plan is None:
                plan = wait.give_up(now, person)
                if self.order is None and self.arbiter.active is not None:
                    self.behaviors[self.arbiter.active].give_up(now)
        if plan is None:
            plan = wait.stand_still(now, person, gives_way)
            self.waiting = wait
        self.follow_instead(plan, now)

    def follow_instead(self, plan: Plan, now: Situation) -> None:
        """Follow a plan from now on in place of the present one, which may have begun just now."""
        step = now.step
        now_us = step * self.clock.step_us
        self._runs_down(now)
        if self.plan.began[0] == step:  # its first rows have happened, though it ends at once
            plan.notes[:0] = [n for n in self.plan.notes if n.time_us <= now_us]
        self._follow(plan, step)
        self._set_next_decision(now, fresh=True)

    def _follow(self, plan: Plan, step: int) -> None:
        self.plan = plan
        self.motion = plan.finish()
        self.planned_at = step

    def _set_next_decision(self, now: Situation, *, fresh: bool) -> None:
        """Set the next decision, at the end of the plan or when a behavior may interrupt it."""
        if self.is_off or (self.charge is not None and self.charge.is_empty):
            self.ask(self._wakes_at(now))
            return
        if self.order is None and not self.is_stuck:
            self.arbiter.watch(now, self.plan, fresh=fresh)
        steps = [s for s in (self.plan.over_at, self.arbiter.wake_step) if s is not None]
        if self.rules is not None:
            clock = self.clock
            times = self.rules.changes_at(now.time)
            steps += [clock.step_at_or_after(clock.elapsed(time)) for time in times]
            if self.rules.minds_sleep and self.entity.eyes:
                self.arbiter.hear(self.plan, EventKind.USER_SEEN)
        if self.charge is not None:
            empty_us = self.charge.falls_to(0.0, self.motion)
            if empty_us is not None:
                steps.append(max(self.clock.step_at_or_after(empty_us), now.step + 1))
        self.ask(min(steps, default=None))

    def _wakes_at(self, now: Situation) -> int | None:
        """Return the step at which an empty battery is charged enough to be on; None: never."""
        if self.charge is None or self.off_for not in (None, EMPTY):
            return None
        wakes_after_us = self.charge.wakes_after(self.motion)
        if wakes_after_us is None:
            return None
        moment_us = now.step * self.clock.step_us + wakes_after_us
        return max(self.clock.step_at_or_after(moment_us), now.step + 1)

    def _ask_behavior(self, behavior: Behavior | Order, now: Situation) -> Plan | None:
        """Return the plan of a behavior or an order.

        If a place can't be reached because the home has changed or the body was put elsewhere, the
        plan is to wait, since the way may open again.
        """
        try:
            return behavior.decide(now)
        except (PlacementError, NoWayError) as error:
            if not (self.may_block_routes or self.home.version or self.is_displaced):
                raise
            plan = now.plan()
            reason = str(error)
            if self._blocked != (reason, now.step):  # the row is written once per wait
                plan.note(EventKind.WAY_BLOCKED, reason)
            plan.stay(DOOR_WAIT)
            self._blocked = reason, self.clock.step_at_or_after(plan.time_us)
            return plan
