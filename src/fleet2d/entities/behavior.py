"""Behaviors: what decides where a body goes next."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from fleet2d.component import Component
from fleet2d.entities.plan import Plan
from fleet2d.streams import Draws

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.place import Point, RoomChoice
    from fleet2d.floorplan.home import Home
    from fleet2d.floorplan.plan import Room


class SightEvent(NamedTuple):
    """Somebody came into view of a camera, or was lost from it."""

    event: str  # user_seen | user_lost
    user: str  # for whom somebody was taken; empty for somebody not recognized
    x: float  # where the user was perceived last [m]
    y: float


@dataclass(frozen=True)
class Situation:
    """What a behavior knows when it is asked for a plan.

    Attributes:
        step: The step at which the plan begins.
        events: The events that interrupted the last plan; empty when it just ended.
        outputs: The newest output of every algorithm, by its name in the scenario.
    """

    actor: "Actor"
    step: int
    events: Sequence[SightEvent] = ()
    outputs: Mapping[str, Any] = field(default_factory=dict)

    @property
    def time(self) -> datetime:
        """The local time."""
        return self.actor.clock.time(self.step)

    @property
    def home(self) -> "Home":
        """The home."""
        return self.actor.home

    @property
    def xy(self) -> tuple[float, float]:
        """Where the body is [m]."""
        state = self.actor.state
        x, y = self.home.plan.lattice.to_metres([state.x, state.y]).tolist()
        return x, y

    @property
    def room(self) -> "Room | None":
        """The room that the body is in; None when it is away."""
        return None if self.actor.state.away else self.home.plan.room_at(*self.xy)

    def nearest_free(self, x: float, y: float) -> tuple[float, float]:
        """Return the place nearest to (x, y) [m] where the body fits and that it can get to."""
        actor, lattice = self.actor, self.home.plan.lattice
        at_x, at_y = lattice.to_lattice((x, y)).tolist()
        found = (at_x, at_y)
        if actor.space.part_at(at_x, at_y) != actor.part:
            found = actor.space.nearest(at_x, at_y, actor.part) or (actor.state.x, actor.state.y)
        near_x, near_y = lattice.to_metres(found).tolist()
        return near_x, near_y

    def random(self, purpose: str) -> Draws:
        """Return random draws of this body, for a purpose of the behavior's own, at this step."""
        return Draws(self.actor.stream(purpose), self.step)

    def plan(self) -> Plan:
        """Return a plan that begins here and now, to be filled."""
        return Plan(self.actor, self.step)


class Behavior(Component):
    """Base of what decides; a subclass declares its configuration as fields and writes `decide`.

    Behaviors of a body stand in order: the first that returns a plan is followed. The state that a
    behavior keeps between decisions is set in `start`, as attributes that aren't fields.

    Example:
        >>> from fleet2d import Behavior, Plan, Situation
        >>> class Pace(Behavior):
        ...     '''Walk between two rooms, a minute in each.'''
        ...     rooms: tuple[str, str] = ("kitchen", "living_room")
        ...     def start(self, actor):
        ...         self.turn = 0
        ...     def decide(self, now: Situation) -> Plan:
        ...         self.turn = 1 - self.turn
        ...         return now.plan().go_to(self.rooms[self.turn]).stay(timedelta(minutes=1))
        >>> Pace(rooms=("office", "kitchen")).rooms
        ('office', 'kitchen')
    """

    kind: ClassVar[str] = "behavior"

    def start(self, actor: "Actor") -> None:
        """Prepare for a run; check here that the places it names exist."""

    def begins_at(self, time: datetime) -> "RoomChoice | Point | None":
        """Return where the body is when the run begins; None leaves it to chance, () is away."""
        return None

    def decide(self, now: Situation) -> Plan | None:
        """Return what to do from now on; None leaves it to the next behavior."""
        raise NotImplementedError
