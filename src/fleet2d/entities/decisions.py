"""Decisions: which plan an actor follows next, chosen among behaviors, orders and giving way."""

from dataclasses import dataclass
from datetime import timedelta

from fleet2d.blame import blame
from fleet2d.entities.actor import Actor
from fleet2d.entities.arbitration import Arbiter
from fleet2d.entities.behavior import Behavior, Command, SightEvent, Situation
from fleet2d.entities.giving_way import JUST_WAITED, GivesWay, Surroundings, WaitForPeople
from fleet2d.entities.orders import Order
from fleet2d.entities.plan import Plan
from fleet2d.errors import ComponentError, NoWayError, PlacementError
from fleet2d.units import micros

# Without a plan from any behavior, stand still this long, then ask again.
PAUSE = timedelta(minutes=1)
# With a shut door in the way, wait this long, then ask again.
AT_A_DOOR = timedelta(seconds=10)


@dataclass(eq=False)
class DecidingActor(Actor):
    """An actor as the engine runs it: decides on its plans, and takes orders and commands.

    Attributes:
        arbiter: Asks its behaviors.
        order: The order that decides in place of its behaviors; None: there is none.
        is_stuck: Whether it can't move, whatever its behaviors or an order want.
        passes_until: Before that step it goes round people, and may come near without touching.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        self.arbiter = Arbiter(self.behaviors)
        self.order: Order | None = None
        self.is_stuck = False
        self.passes_until = 0
        self._chosen: Plan | None = None  # by `choose` or `goes_on`, for the next `decide`
        self._waiting: WaitForPeople | None = None
        self._waited = (0, -1)  # since when it last waited, and up to which step that counts
        self._no_way_round: object = None  # where no way round people was found, and for what
        self._blocked = ("", -1)  # what was in its way, and up to which step it waits there

    def choose(self, plan: Plan) -> None:
        """Set the plan that its next decision, which is due now, results in."""
        self._chosen, self._waiting = plan, None

    def obey(self, order: Order | None, step: int) -> None:
        """Follow an order from a step on, in place of its behaviors; None: follow them again."""
        self.order, self._waiting, self.arbiter.own = order, None, frozenset()
        self.decide_anew(step)

    def decide_anew(self, step: int) -> None:
        """Ask all its behaviors at a step, even if its plan isn't over."""
        self.ask(step)
        self.arbiter.wake_step = None

    def hear(self, command: Command, step: int) -> bool:
        """Keep a command until a behavior takes it up; return whether one is asked at once.

        A behavior that comes after the active one has to wait for its turn.
        """
        self.command = command
        takers = (i for i, behavior in enumerate(self.behaviors) if behavior.takes(command))
        first, active = next(takers, None), self.arbiter.active
        now = self.order is None and first is not None and (active is None or first <= active)
        if now:
            self.decide_anew(step)
        return now

    def heeds(self, event: SightEvent, step: int) -> bool:
        """Return whether it reacts to an action of a robot."""
        if self.order is not None:
            return False
        return self._attentive is not None and self._attentive[0].heeds(self, event, step)

    def goes_on(self, now: Situation) -> bool:
        """Return whether its plan goes on at a step at which behaviors want to be asked.

        If one of them returns another plan, `decide` takes that.
        """
        if self.charge is not None:
            self.charge.follow(self.motion, now.step * self.clock.step_us)
            if self.charge.is_empty:
                return False
        if self._chosen is not None or self.order is not None or self.is_stuck:
            return False
        with blame(self.path, now.step):
            answer = self.arbiter.goes_on(now, self.plan, self._ask_behavior)
            if answer is True:
                self._set_next_decision(now, fresh=False)
                return True
        self._chosen = answer if isinstance(answer, Plan) else None
        return False

    def decide(self, now: Situation) -> None:
        """Ask the behaviors, in order, for a plan that begins now."""
        step, (plan, self._chosen) = now.step, (self._chosen, None)
        if self.is_stuck or (self.charge is not None and self.charge.is_empty):
            plan = now.plan().stay()
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            self._waited = waiting.since, waiting.look_before(step) + self._just_waited
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
            raise ComponentError(
                f"{self.path}: decide() returned {plan!r}, expected a plan or None"
            )
        if plan.began != (step, self.state):
            raise ComponentError(
                f"{self.path}: decide() returned a plan that doesn't begin here and now: make one"
                " by now.plan()"
            )
        self.plan, self.motion, self.planned_at = plan, plan.finish(), step
        if self.charge is not None:
            self.charge.record(plan)
        with blame(self.path, step):
            self._set_next_decision(now, fresh=True)

    @property
    def _just_waited(self) -> int:
        """The steps after a wait within which another one counts as its continuation."""
        return micros(JUST_WAITED) // self.clock.step_us + 1

    @property
    def waiting(self) -> WaitForPeople | None:
        """Its wait, if it has stopped in front of a person; else None."""
        return self._waiting

    def give_way(self, now: Situation, person: str, surroundings: Surroundings) -> None:
        """Stop in front of a person who is in the way; go round after a while, or give up.

        Args:
            now: The situation.
            person: The name of the person.
            surroundings: Where people are.
        """
        step, just = now.step, self._just_waited
        since = self._waited[0] if step <= self._waited[1] else step
        wait = WaitForPeople(self.plan, step, since, self.arbiter.own, surroundings)
        people = surroundings.people
        self._waited, self.passes_until = (since, step + just), step
        gives_way: GivesWay = self.entity.gives_way  # type: ignore[attr-defined]
        waited, plan = (step - since) * self.clock.step_us, None
        where = self.state, self.plan.root, people.tobytes()
        if waited >= micros(gives_way.patience) and where != self._no_way_round:
            plan = wait.go_round(now, people, gives_way.distance)
            self.passes_until = step + just if plan is not None else step
            self._no_way_round = where
        if plan is None and waited >= micros(max(gives_way.patience, gives_way.gives_up)):
            plan, self._waited = wait.leave_out(now, person), (0, -1)
            if plan is None:
                plan = wait.give_up(now, person)
                if self.order is None:
                    self.arbiter.give_up(now)
        if plan is None:
            plan, self._waiting = wait.stand_still(now, person, gives_way), wait
        self.follow_instead(plan, now)

    def follow_instead(self, plan: Plan, now: Situation) -> None:
        """Follow a plan from now on in place of the present one, which may have begun just now."""
        step, now_us = now.step, now.step * self.clock.step_us
        if self.charge is not None:
            self.charge.follow(self.motion, now_us)
        if self.plan.began[0] == step:  # its first rows happened, though it ends at once
            plan.notes[:0] = [n for n in self.plan.notes if n.time_us <= now_us]
        self.plan, self.motion, self.planned_at = plan, plan.finish(), step
        self._set_next_decision(now, fresh=True)

    def _set_next_decision(self, now: Situation, *, fresh: bool) -> None:
        """Set when it decides next: the plan is over, or another behavior may interrupt it."""
        if self.charge is not None and self.charge.is_empty:
            self.ask(None)  # it stands still for good
            return
        if self.order is None and not self.is_stuck:
            self.arbiter.watch(now, self.plan, fresh=fresh)
        steps = [s for s in (self.plan.over_at, self.arbiter.wake_step) if s is not None]
        if self.charge is not None:
            empty_us = self.charge.falls_to(0.0, self.motion)
            if empty_us is not None:
                steps.append(max(self.clock.step_at_or_after(empty_us), now.step + 1))
        self.ask(min(steps, default=None))

    def _ask_behavior(self, behavior: Behavior | Order, now: Situation) -> Plan | None:
        """Return the plan of a behavior or an order; one to wait if a door or a cost blocks it."""
        try:
            return behavior.decide(now)
        except (PlacementError, NoWayError) as error:
            if not self.home.hinders:
                raise
            plan, reason = now.plan(), str(error)
            if self._blocked != (reason, now.step):  # else the row was written before the wait
                plan.note("way_blocked", reason)
            plan.stay(AT_A_DOOR)
            self._blocked = reason, self.clock.step_at_or_after(plan.time_us)
            return plan
