"""Reactions: how people react to robots."""

from datetime import timedelta

from fleet2d.configuration.units import micros
from fleet2d.entities.behavior import Actor, Attention, Behavior, SightEvent, Situation
from fleet2d.entities.place import points_at_distance
from fleet2d.entities.plan import Plan
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.routines.activity import DurationDistribution
from fleet2d.routines.distributions import Distribution
from fleet2d.routines.persona import Manners
from fleet2d.runtime.determinism import Draws
from fleet2d.runtime.events import EventKind

# The manner that holds the probability of a reaction, by event, the most important first.
PROBABILITIES = {
    "robot_calls": "comes",
    "robot_close": "leaves",
    "robot_coming": "steps_aside",
    "robot_near": "turns",
}
RANKS = list(PROBABILITIES)
# Distances to which a person steps aside, and at which one stops before a calling robot [m].
STEP_M = 0.7
MEET_M = 0.9
CLEAR_M = 0.1  # margin beyond the distance that is too close
# Time for which a person who has left a robot stays in the other room.
LEAVES_FOR = DurationDistribution(mean=timedelta(minutes=5))
# Time for which a person waits for a robot to pass.
PASSING_TIME = timedelta(seconds=4)
DIRECTIONS = 16


class Reactions(Behavior):
    """React to robots: turn to them, step aside, come, leave; list it before other behaviors.

    The probability of each reaction, and the distances, are the person's manners: those given here,
    else those of the persona of a later `routine`, else the usual ones.

    Attributes:
        manners: The manners; left out: those of the persona.
    """

    records = frozenset({EventKind.REACTS})

    manners: Manners | None = None

    def attention(self, actor: Actor) -> Attention:
        """Determine the manners, which may be those of a persona, and return their distances."""
        personas = (getattr(behavior, "resolved_persona", None) for behavior in actor.behaviors)
        persona = next((p for p in personas if p is not None), None)
        manners: Manners = self.manners or getattr(persona, "manners", None) or Manners()
        self.used_manners = manners
        self.durations = {
            "looks": manners.looks.table(),
            "leaves": LEAVES_FOR.table(),
            "comes": manners.comes_for.table(),
        }
        # rank of the present reaction, and the step at which it ends
        self.rank = 0
        self.until = -1
        units = actor.home.lattice.units_per_m
        return Attention(
            notices=round(manners.notices * units),
            in_way=round(manners.in_the_way * units),
            too_close=round(manners.too_close * units),
            patience=max(1, actor.clock.step_at_or_after(micros(manners.patience))),
            hears=round(manners.hears * units),
        )

    def reacts_to(self, actor: Actor, event: SightEvent, step: int) -> bool:
        """Return whether the person reacts to an event at a step; drawn by its probability."""
        if step < self.until and RANKS.index(event.event) >= self.rank:
            return False  # the present reaction is more important
        probability: float = getattr(self.used_manners, PROBABILITIES[event.event])
        draws = Draws(actor.stream(f"{event.event} {event.user}"), step)
        return draws.uniform() < probability

    def decide(self, now: Situation) -> Plan | None:
        """React to an event of the present step; without one, leave it to the next behavior."""
        events = [event for event in now.events if event.event in PROBABILITIES]
        if not events:
            return None
        event = min(events, key=lambda event: RANKS.index(event.event))
        draws = now.random("reaction")
        plan = now.plan()
        if event.event == "robot_calls":
            self._come(now, plan, event, draws)
        elif event.event == "robot_close":
            self._leave(now, plan, event, draws)
        elif event.event == "robot_coming":
            self._step_aside(now, plan, event, draws)
        else:
            plan.note(EventKind.REACTS, f"turns to {event.user}")
            self._look_at(now, plan, event, self.durations["looks"], draws)
        self.rank = RANKS.index(event.event)
        self.until = now.actor.clock.step_at_or_after(plan.time_us)
        return plan

    def _come(self, now: Situation, plan: Plan, event: SightEvent, draws: Draws) -> None:
        plan.note(EventKind.REACTS, f"comes to {event.user}")
        self._maybe_stop(now, draws)
        distance_m = max(MEET_M, self.used_manners.too_close + CLEAR_M)
        points = self._points_around(now, _robot(now, event), distance_m)
        within_reach = [point for point in points if plan.reaches(*point)]
        if within_reach:
            nearest = min(within_reach, key=lambda p: _squared(p[0] - plan.x, p[1] - plan.y))
            plan.go_to_point(*nearest)
        self._look_at(now, plan, event, self.durations["comes"], draws)

    def _leave(self, now: Situation, plan: Plan, event: SightEvent, draws: Draws) -> None:
        plan.note(EventKind.REACTS, f"leaves {event.user}")
        self._maybe_stop(now, draws)
        rooms = [room for room in now.actor.reachable_rooms() if room != now.room]
        if rooms:
            plan.go_to((draws.choice(rooms).name,), "retreat")
        plan.stay(timedelta(seconds=self.durations["leaves"].draw(draws)))

    def _step_aside(self, now: Situation, plan: Plan, event: SightEvent, draws: Draws) -> None:
        """Step out of the robot's way, to a random free point beside it."""
        plan.note(EventKind.REACTS, f"steps aside for {event.user}")
        at_x, at_y = _robot(now, event)
        dx = plan.x - at_x
        dy = plan.y - at_y
        across = []
        for x, y in self._points_around(now, plan.position, STEP_M):
            step_x = x - plan.x
            step_y = y - plan.y
            along = step_x * dx + step_y * dy
            # The step goes across the robot's way, as along it the robot would come closer again.
            if 4 * along**2 <= _squared(dx, dy) * _squared(step_x, step_y):
                across.append((x, y))
        if across:
            plan.go_to_point(*draws.choice(across))
        plan.stay(PASSING_TIME)

    def _look_at(
        self, now: Situation, plan: Plan, event: SightEvent, lasts: Distribution, draws: Draws
    ) -> None:
        plan.face(*_robot(now, event))
        plan.stay(timedelta(seconds=lasts.draw(draws)))

    def _points_around(
        self, now: Situation, center: LatticePoint, distance_m: float
    ) -> list[LatticePoint]:
        """Return free points at a distance [m] from a point, in the same room."""
        distance = round(distance_m * now.home.lattice.units_per_m)
        return list(points_at_distance(now.actor, center, distance, DIRECTIONS))

    def _maybe_stop(self, now: Situation, draws: Draws) -> None:
        if draws.uniform() < self.used_manners.stops:
            for behavior in now.actor.behaviors:
                behavior.give_up(now)


def _robot(now: Situation, event: SightEvent) -> LatticePoint:
    return now.home.lattice.point_at((event.x, event.y))


def _squared(dx: int, dy: int) -> int:
    return dx * dx + dy * dy
