"""Behaviors: what decides where a body goes next."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from pydantic import Field

from fleet2d.component import Component
from fleet2d.entities.hours import Hours
from fleet2d.entities.plan import Plan
from fleet2d.streams import Draws
from fleet2d.units import Duration

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.place import Point, RoomChoice
    from fleet2d.floorplan.home.home import Home
    from fleet2d.floorplan.plan import Room


class Attention(NamedTuple):
    """What somebody takes notice of in robots: distances [lattice units] between the bodies.

    Attributes:
        notices: Nearer robots in sight are noticed: the event robot_near.
        in_way: Nearer robots that drive up to somebody who stands are in the way: robot_coming.
        too_close: Nearer ones are too close, when that lasts: robot_close.
        patience: For so many steps.
        hears: Within that a call is heard: robot_calls.
    """

    notices: int
    in_way: int
    too_close: int
    patience: int
    hears: int


class Command(NamedTuple):
    """What a user or an app calls a robot to do: see `Behavior.answers`.

    Attributes:
        do: What it is to do: "come", "find", "dock", or what a behavior of one's own answers to.
        target: The person to find; empty for others.
        place: Where to come to; () for others.
    """

    do: str
    target: str = ""
    place: "RoomChoice | Point | tuple[()]" = ()

    @property
    def text(self) -> str:
        """The command for the table of events."""
        where = self.place if self.place and isinstance(self.place[0], str) else None
        spot = [f"({self.place[0]:g}, {self.place[1]:g})"] if self.place and not where else []
        return " ".join([self.do, *filter(None, [self.target]), *(where or spot)])


class SightEvent(NamedTuple):
    """Somebody came into view of a camera, or was lost from it; or a robot met somebody."""

    # user_seen | user_lost; of a user's camera, robot_seen | robot_lost; of Attention, robot_near |
    # robot_coming | robot_close | robot_calls; called, of a robot that was: see Situation.command
    event: str
    user: str  # for whom somebody was taken; empty for somebody not recognized; or the robot
    x: float  # where that was perceived last [m]
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
        return self.home.plan.lattice.xy_of(state.x, state.y)

    @property
    def room(self) -> "Room | None":
        """The room that the body is in; None when it is away."""
        return None if self.actor.state.away else self.home.plan.room_at(*self.xy)

    @property
    def in_view(self) -> Mapping[str, "Point"]:
        """Whom the body's cameras have in view, and where each was perceived last [m].

        Somebody counts as in view until lost. The empty name is somebody not recognized.
        """
        return self.actor.in_view()

    @property
    def command(self) -> Command | None:
        """What the body was called to do, as long as no behavior has taken it up."""
        return self.actor.command

    def take_command(self, do: str) -> Command | None:
        """Take up a command of a kind, if the body was called to do that: nobody else gets it."""
        command = self.actor.command
        if command is None or command.do != do:
            return None
        self.actor.command = None
        return command

    def nearest_free(self, x: float, y: float) -> tuple[float, float]:
        """Return the place nearest to (x, y) [m] where the body fits and that it can get to."""
        actor, lattice = self.actor, self.home.plan.lattice
        at_x, at_y = lattice.point_at((x, y))
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
    # Whether, broken off by one before it, it later goes on with the rest of its plan.
    resumes: ClassVar[bool] = False
    # Layers of what its robot has seen that it goes by: explored, first_seen, last_seen …
    needs: ClassVar[frozenset[str]] = frozenset()
    # Kinds of events that its plans record: all of its own, and of those of EventKind the ones that
    # a script may wait for.
    records: ClassVar[frozenset[str]] = frozenset()
    # Events of its cameras at which it may break in on those behind it.
    listens: ClassVar[frozenset[str]] = frozenset()

    # What it does when its robot is called to: find, come, dock, or a word of one's own.
    answers: ClassVar[frozenset[str]] = frozenset()

    when: Hours = Field(
        default=(), description="the hours in which it may have its way; left out: at all times"
    )
    cooldown: Duration = Field(
        default=timedelta(0), description="how long it isn't asked again after it had its way"
    )
    preempts: bool = Field(
        default=True, description="whether it may break in on behaviors behind it; else it waits"
    )

    def start(self, actor: "Actor") -> None:
        """Prepare for a run; check here that the places it names exist."""

    def begins_at(self, time: datetime) -> "RoomChoice | Point | None":
        """Return where the body is when the run begins; None leaves it to chance, () is away."""
        return None

    def attention(self, actor: "Actor") -> Attention | None:
        """Return what of robots interrupts any plan of the body; None: nothing does."""
        return None

    def heeds(self, actor: "Actor", event: SightEvent, step: int) -> bool:
        """Tell whether something that it pays attention to interrupts the plan."""
        return True

    def furniture(self, actor: "Actor", kind: str) -> str | None:
        """Return the name of the piece of furniture of a kind that it uses for good, if any."""
        return None

    def give_up(self, now: Situation) -> None:
        """Don't go on with what one is doing, when the next plan is made."""

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return when it wants to be asked while the body follows the plan of one behind it."""
        return None

    def about(self) -> tuple[str, ...]:
        """Return the users that its fields name: a scenario without one of them is refused."""
        return ()

    def reads(self) -> tuple[str, ...]:
        """Return the algorithms that it goes by: a scenario without one of them is refused."""
        return ()

    def takes(self, command: Command) -> bool:
        """Tell whether it would do what its robot is called to do."""
        return command.do in self.answers

    def activities(self) -> tuple[str, ...]:
        """Return the activities that it knows how to perform."""
        return ()

    def perform(self, plan: Plan, activity: str) -> None:
        """Let a plan lead to where one of its activities is done."""
        raise NotImplementedError

    def busy(self) -> bool:
        """Tell whether it is in the middle of something, which neither hours nor cooldown end."""
        return False

    def decide(self, now: Situation) -> Plan | None:
        """Return what to do from now on; None leaves it to the next behavior."""
        raise NotImplementedError
