"""An entity in a run: a body with behaviors, and the plan that it follows."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import timedelta

import numpy as np

from fleet2d.blame import blame
from fleet2d.entities.arbitration import Arbiter
from fleet2d.entities.battery import Charge
from fleet2d.entities.behavior import Attention, Behavior, Command, SightEvent, Situation
from fleet2d.entities.body import NEVER, Body
from fleet2d.entities.giving_way import JUST_WAITED, Crowd, GivesWay, Waiting
from fleet2d.entities.kinds import is_kind
from fleet2d.entities.motion import Motion, Pose
from fleet2d.entities.orders import Order
from fleet2d.entities.place import ANY, Point, is_point
from fleet2d.entities.plan import Plan
from fleet2d.errors import ComponentError, NoWayError, PlacementError
from fleet2d.floorplan.objects import PlacedObject
from fleet2d.kernels.headings import TURN
from fleet2d.streams import Draws
from fleet2d.units import micros

# Nobody has a plan: stand still this long, then ask again.
PAUSE = timedelta(minutes=1)
# A shut door is in the way: wait this long, then ask again.
AT_A_DOOR = timedelta(seconds=10)


@dataclass(eq=False)
class Actor(Body):
    """An entity in a run.

    Attributes:
        plan: What it follows.
        motion: The motion of the plan.
        planned_at: The step at which it was last asked.
        notes: What of its scenario this home lacks, and what was left out for it.
    """

    behaviors: list[Behavior] = field(init=False)
    notes: list[str] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.in_view: Callable[[], Mapping[str, Point]] = dict  # set where it has cameras
        self.behaviors = [behavior.model_copy(deep=True) for behavior in self.entity.behaviors]
        with blame(self.path, None):
            self._state = self._begin()
            battery = getattr(self.entity, "battery", None)
            self.charge = None if battery is None else Charge(battery, self)
            for behavior in self.behaviors:
                behavior.start(self)
            pays = ((behavior, behavior.attention(self)) for behavior in self.behaviors)
            self._attentive = next((pair for pair in pays if pair[1] is not None), None)
        self.arbiter = Arbiter(self.behaviors)
        self.order: Order | None = None  # what it does in place of its behaviors
        self.is_stuck = False  # it can't move, whatever it or an order wants
        self.command: Command | None = None  # what it was called to do, and hasn't taken up
        self._chosen: Plan | None = None
        self._waiting: Waiting | None = None
        self._waited = (0, -1)  # since when it last waited, and up to which step that counts
        self.passes_until = 0  # before that step it goes round people: it minds not to touch them
        self._stuck: object = None  # where it last looked for a way round people, and for which
        self._blocked = ("", -1)  # what was in its way, and up to which step it waits there
        self.plan: Plan = Plan(self, 0).stay()
        self.motion: Motion = self.plan.finish()
        self.planned_at = 0

    def ask(self, step: int | None) -> None:
        """Set the step at which it decides next; None: never."""
        if self._bodies is not None:
            self._bodies.ask_at[self.row] = NEVER if step is None else step

    def choose(self, plan: Plan) -> None:
        """Take a plan from outside as its next decision, which is due now."""
        self._chosen, self._waiting = plan, None

    def obey(self, order: Order | None, step: int) -> None:
        """Follow an order from a step on, in place of its behaviors; None: hand back to them."""
        self.order, self._waiting, self.arbiter.own = order, None, frozenset()
        self.decide_anew(step)

    def decide_anew(self, step: int) -> None:
        """Ask all its behaviors at a step, whatever it is doing."""
        self.ask(step)
        self.arbiter.wake_step = None

    def hear(self, command: Command, step: int) -> bool:
        """Keep a command until a behavior takes it up; tell whether one is to be asked now.

        One behind the behavior that has its way has to wait for its turn.
        """
        self.command = command
        takers = (i for i, behavior in enumerate(self.behaviors) if behavior.takes(command))
        first, active = next(takers, None), self.arbiter.active
        now = self.order is None and first is not None and (active is None or first <= active)
        if now:
            self.decide_anew(step)
        return now

    @property
    def attention(self) -> Attention | None:
        """What of robots interrupts its plans: that of the first behavior that pays any."""
        return self._attentive[1] if self._attentive else None

    def heeds(self, event: SightEvent, step: int) -> bool:
        """Tell whether it reacts to what a robot does."""
        if self.order is not None:
            return False
        return self._attentive is not None and self._attentive[0].heeds(self, event, step)

    def own_furniture(self, kind: str) -> PlacedObject | None:
        """Return the piece of furniture of a kind that is its own, if its behaviors say so."""
        names = (behavior.furniture(self, kind) for behavior in self.behaviors)
        return next((self.home.object(name) for name in names if name is not None), None)

    def posture_code(self, time_us: int) -> int:
        """Return the posture at a moment, by its number in POSTURES."""
        plan: Plan | None = getattr(self, "plan", None)  # none yet when the first is made
        if plan is None or not (plan.postures or plan.posture != "stand"):
            return 0
        return int(plan.posture_at(np.array([time_us]))[0])

    def goes_on(self, now: Situation) -> bool:
        """Tell whether, of those who want to be asked at a step, nobody has anything better to do.

        If somebody has, that plan is what `decide` takes.
        """
        if self.charge is not None:
            self.charge.follow(self.motion, now.step * self.clock.step_us)
            if self.charge.is_empty:
                return False
        if self._chosen is not None or self.order is not None or self.is_stuck:  # from outside
            return False
        with blame(self.path, now.step):
            found = self.arbiter.goes_on(now, self.plan, self._asked)
            if found is True:
                self._watch(now, fresh=False)
                return True
        self._chosen = found if isinstance(found, Plan) else None
        return False

    def decide(self, now: Situation) -> None:
        """Ask the behaviors, in order, for a plan that begins now."""
        step, (plan, self._chosen) = now.step, (self._chosen, None)
        if self.is_stuck or (self.charge is not None and self.charge.is_empty):
            plan = now.plan().stay()
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            self._waited = waiting.since, waiting.look_before(step) + self._just
        if plan is None and waiting is not None and not now.events:
            plan = waiting.go_on(now)
        with blame(self.path, step):
            if plan is None and self.order is not None:
                plan = self._asked(self.order, now)
                self.order = self.order if plan else None
            plan = plan or self.arbiter.choose(now, self.plan, self._asked)
        if plan is None:
            plan = now.plan()
            plan = plan.stay(PAUSE) if self.behaviors else plan.stay()
        if not isinstance(plan, Plan):
            raise ComponentError(
                f"{self.path}: decide() returned {plan!r}; a plan or None is wanted"
            )
        if plan.began != (step, self.state):
            raise ComponentError(
                f"{self.path}: decide() returned a plan that doesn't begin here and now: make one"
                " by now.plan()"
            )
        self.plan, self.motion, self.planned_at = plan, plan.finish(), step
        if self.charge is not None:
            self.charge.tell(plan)
        with blame(self.path, step):
            self._watch(now, fresh=True)

    @property
    def _just(self) -> int:
        """For how many steps after it has waited it goes on counting."""
        return micros(JUST_WAITED) // self.clock.step_us + 1

    @property
    def waiting(self) -> Waiting | None:
        """What it waits for, if it has stopped before somebody."""
        return self._waiting

    def give_way(self, now: Situation, whom: str, crowd: Crowd) -> None:
        """Stop before somebody at whom the plan would drive now; in the end go round, or give up.

        Args:
            now: The situation.
            whom: Who is in the way.
            crowd: Where people are.
        """
        step, just = now.step, self._just
        since = self._waited[0] if step <= self._waited[1] else step
        waits, people = Waiting(self.plan, step, since, self.arbiter.own, crowd), crowd.people
        self._waited, self.passes_until = (since, step + just), step
        gives_way: GivesWay = self.entity.gives_way  # type: ignore[attr-defined]
        waited, plan = (step - since) * self.clock.step_us, None
        stuck = self.state, self.plan.root, people.tobytes()
        if waited >= micros(gives_way.patience) and stuck != self._stuck:
            plan = waits.go_round(now, people, gives_way.distance)
            self.passes_until = step + just if plan is not None else step
            self._stuck = stuck
        if plan is None and waited >= micros(max(gives_way.patience, gives_way.gives_up)):
            plan, self._waited = waits.leave_out(now, whom), (0, -1)
            if plan is None:
                plan = waits.give_up(now, whom)
                if self.order is None:
                    self.arbiter.give_up(now)
        if plan is None:
            plan, self._waiting = waits.wait(now, whom, gives_way), waits
        if self.plan.began[0] == step:  # it has begun, and is over at once
            begun = [n for n in self.plan.notes if n.time_us <= step * self.clock.step_us]
            plan.notes[:0] = begun
        self.plan, self.motion, self.planned_at = plan, plan.finish(), step
        self._watch(now, fresh=True)

    def _watch(self, now: Situation, *, fresh: bool) -> None:
        """Set when it is asked again: the plan is over, or somebody may want to break in."""
        if self.charge is not None and self.charge.is_empty:
            self.ask(None)  # it stands there for good
            return
        if self.order is None and not self.is_stuck:
            self.arbiter.watch(now, self.plan, fresh=fresh)
        steps = [s for s in (self.plan.over_at, self.arbiter.wake_step) if s is not None]
        if self.charge is not None:
            empty_us = self.charge.falls_to(0.0, self.motion)
            if empty_us is not None:
                steps.append(max(self.clock.step_at_or_after(empty_us), now.step + 1))
        self.ask(min(steps, default=None))

    def _asked(self, behavior: Behavior | Order, now: Situation) -> Plan | None:
        """Return a behavior's or an order's plan; wait where a door or a cost is in its way."""
        try:
            return behavior.decide(now)
        except (PlacementError, NoWayError) as error:
            if not self.home.hinders:
                raise
            plan, told = now.plan(), str(error)
            if self._blocked != (told, now.step):  # else it has waited for that already
                plan.note("way_blocked", told)
            plan.stay(AT_A_DOOR)
            self._blocked = told, self.clock.step_at_or_after(plan.time_us)
            return plan

    def _begin(self) -> Pose:
        """Return the state at step 0."""
        place = self.entity.start
        if place is None:
            begins = (behavior.begins_at(self.clock.start) for behavior in self.behaviors)
            place = next((begin for begin in begins if begin is not None), (ANY,))
            if place and is_kind(self, place) and not self._has_any(place):
                place = (ANY,)
        away = int(len(place) == 0)
        if away:
            x, y = self.way_out
        elif is_point(place):
            x, y = self.home.plan.lattice.point_at(place)  # type: ignore[arg-type]
            self.part = max(self.space.part_at(x, y), 0)
            x, y = self.point(place)  # type: ignore[arg-type]
        else:
            self.part = self._first_part(place)  # type: ignore[arg-type]
            x, y = self.find(place, 0, "start")
        heading = self.entity.start_heading_deg
        if heading is None:
            return Pose(x, y, Draws(self.stream("start heading"), 0).below(TURN), away)
        return Pose(x, y, round(heading / 360 * TURN) % TURN, away)
