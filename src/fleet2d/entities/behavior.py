"""Behaviors, the situations in which they decide, and the bodies that they decide for."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from fleet2d.configuration.components import Component
from fleet2d.configuration.problems import problem, shown
from fleet2d.configuration.units import Duration, format_time_of_day, parse_time_of_day, weekdays_of
from fleet2d.entities.body import NEVER, Body, Motion, Pose
from fleet2d.entities.equipment import Charge, Displacement
from fleet2d.entities.place import ANY, Point, RoomChoice, is_kind, is_point
from fleet2d.entities.plan import Plan
from fleet2d.errors import FloorPlanError, blame
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.placed_objects import PlacedObject
from fleet2d.floorplan.plan import Room
from fleet2d.interactions.interaction import RequestQueue
from fleet2d.kernels import TURN
from fleet2d.runtime.clock import DAY, MICROSECOND, Sun, midnight_of
from fleet2d.runtime.determinism import Draws
from fleet2d.runtime.local_time import next_reading, written

# A body tries again to pass a shut door after this time.
DOOR_WAIT = timedelta(seconds=10)


class HoursSpan(NamedTuple):
    """Hours on some days of the week; hours that end before they begin last past midnight.

    Hours hold whenever the clock reads a time within them, so hours that it reads twice, when put
    back, last longer.

    Attributes:
        days: The days on which the hours begin, 0 is Monday.
        begin: Their begin, since midnight.
        end: Their end, since the same midnight, up to a day after `begin`.
        text: The hours in a scenario.
    """

    days: tuple[int, ...]
    begin: timedelta
    end: timedelta
    text: str

    def end_at(self, time: datetime) -> datetime | None:
        """Return the end of the hours that a moment lies in; None if it lies outside."""
        moment = time
        end = self._end_of(written(time))
        while end is not None:
            moment = next_reading(moment, end)
            if written(moment) == end:
                return moment
            end = self._end_of(written(moment))  # the clock was changed since
        return None if moment is time else moment

    def next_begin(self, time: datetime) -> datetime:
        """Return the next beginning of the hours after a moment."""
        while True:
            reading = written(time)
            days = (midnight_of(reading) + i * DAY for i in range(8))
            begins = (day + self.begin for day in days if day.weekday() in self.days)
            begin = next(begin for begin in begins if begin > reading)
            time = next_reading(time, begin)
            if written(time) == begin:
                return time
            # The clock was changed before, and may read these hours since then.
            if self._end_of(written(time)) and not self._end_of(written(time - MICROSECOND)):
                return time

    def _end_of(self, reading: datetime) -> datetime | None:
        """Return the end of the hours that the clock reads; None outside of them."""
        midnight = midnight_of(reading)
        for day in (midnight - DAY, midnight):
            if day.weekday() in self.days and day + self.begin <= reading < day + self.end:
                return day + self.end
        return None


def parse_span(value: object) -> HoursSpan:
    """Read hours: ``08:00-18:00``, ``weekdays 22:00-06:00`` or ``monday,friday 9:00-12:00``.

    Example:
        >>> span = parse_span("weekend 22:00-06:00")
        >>> span.end_at(datetime(2026, 1, 12, 5)), span.end_at(datetime(2026, 1, 10, 5))
        (datetime.datetime(2026, 1, 12, 6, 0), None)
    """
    if isinstance(value, HoursSpan):
        return value
    words = value.split() if isinstance(value, str) else []
    if not 1 <= len(words) <= 2 or words[-1].count("-") != 1:
        raise problem(
            f"expected hours, got {shown(value)}: write them like '08:00-22:00',"
            " 'weekdays 9:00-17:00' or 'monday,friday 22:00-06:00'"
        )
    *named, hours = words
    begin, end = (parse_time_of_day(text) for text in hours.split("-"))
    if begin == end:
        raise problem(f"hours must begin and end at different times, got {shown(value)}")
    (names,) = named or ("daily",)
    days = sorted(weekdays_of(names.split(",")))
    text = " ".join([*named, f"{format_time_of_day(begin)}-{format_time_of_day(end)}"])
    return HoursSpan(tuple(days), begin, end if end > begin else end + DAY, text)


def _parse_hours(value: object) -> tuple[HoursSpan, ...]:
    if isinstance(value, Sequence) and not isinstance(value, str | HoursSpan):
        return tuple(parse_span(item) for item in value)
    return (parse_span(value),)


def _hours_schema(description: str, *examples: str | list[str]) -> WithJsonSchema:
    forms = [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]
    head = {"description": description, "x-quantity": "hours", "anyOf": forms}
    return WithJsonSchema({**head, "examples": list(examples)})


_AS_TEXTS = PlainSerializer(lambda spans: [span.text for span in spans])
Hours = Annotated[
    tuple[HoursSpan, ...],
    BeforeValidator(_parse_hours),
    _AS_TEXTS,
    _hours_schema(
        "hours of the week, like '08:00-22:00' or 'weekdays 9:00-17:00', or a list of them",
        "08:00-22:00",
        ["weekdays 9:00-17:00", "weekend 10:00-20:00"],
    ),
]
"""Hours of the week, in one or several spans; what an empty list means is up to the field."""


DARK = HoursSpan((), timedelta(0), timedelta(0), "dark")
"""The hours from sunset to sunrise, which `fleet2d.runtime.clock.Sun` has for each day."""


def _parse_light_hours(value: object) -> tuple[HoursSpan, ...]:
    if value in ("dark", ["dark"], (DARK,)):
        return (DARK,)
    if isinstance(value, str) and value.isalpha():
        raise problem(f"expected hours like '17:00-08:00', or dark, got {shown(value)}")
    return _parse_hours(value)


LightHours = Annotated[
    tuple[HoursSpan, ...],
    BeforeValidator(_parse_light_hours),
    _AS_TEXTS,
    _hours_schema(
        "hours of the week, like '17:00-08:00', a list of them, or 'dark', from sunset to sunrise",
        "17:00-08:00",
        "dark",
    ),
]
"""Hours of the week, or those in which it is dark."""


def holds(hours: "Sequence[HoursSpan | Sun]", time: datetime) -> datetime | None:
    """Return the end of the hours that a moment lies in; None if it lies outside."""
    ends = [end for span in hours if (end := span.end_at(time))]
    return max(ends, default=None)


class Attention(NamedTuple):
    """The distances between the middles at which a person reacts to a robot [lattice].

    Attributes:
        notices: A robot in sight and nearer than this is the event robot_near.
        in_way: A robot nearer than this that drives up to a standing person: robot_coming.
        too_close: A robot that stays nearer than this: robot_close.
        patience: Number of steps too close after which robot_close happens.
        hears: A robot that calls within this distance: robot_calls.
    """

    notices: int
    in_way: int
    too_close: int
    patience: int
    hears: int


class Command(NamedTuple):
    """A call of a robot by a user or an app: see `Behavior.answers`.

    Attributes:
        do: The kind of command: "come", "find", "dock", or one that a custom behavior answers.
        target: The person to find; empty for other kinds.
        place: The place to come to; () for other kinds.
    """

    do: str
    target: str = ""
    place: RoomChoice | Point | tuple[()] = ()

    @property
    def text(self) -> str:
        """The command for the table of events."""
        place: Sequence[object] = self.place
        if self.place and is_point(self.place):
            place = [f"({self.place[0]:g}, {self.place[1]:g})"]
        return " ".join(map(str, filter(None, [self.do, self.target, *place])))


class SightEvent(NamedTuple):
    """An event that interrupts a plan: somebody in or out of view, a robot near, a command.

    Attributes:
        event: user_seen or user_lost of a robot's camera, robot_seen or robot_lost of a user's;
            robot_near, robot_coming, robot_close or robot_calls, see `Attention`; called, when a
            robot got a command, see `Situation.command`; or the name of an interrupt.
        user: The user as perceived, empty if not recognized; or the robot; empty for interrupts.
        x: The last perceived position of the user or robot; for an interrupt, that of the body [m].
        y: Likewise.
    """

    event: str
    user: str
    x: float
    y: float


@dataclass(frozen=True, init=False)
class Situation:
    """The knowledge of a behavior that is asked for a plan.

    Attributes:
        actor: The body, with its plan.
        step: The step at which the plan begins.
        events: The events that interrupted the last plan; empty if it just ended.
        outputs: The newest output of every algorithm, by its name in the scenario.
        time: The local time.
    """

    actor: "Actor"
    step: int
    events: Sequence[SightEvent]
    outputs: Mapping[str, Any]
    time: datetime

    def __init__(
        self,
        actor: "Actor",
        step: int,
        events: Sequence[SightEvent] = (),
        outputs: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        # A run makes many situations, so the fields are set at once.
        time = actor.clock.time(step)
        self.__dict__.update(actor=actor, step=step, events=events, outputs=outputs, time=time)

    @property
    def home(self) -> Home:
        """The home."""
        return self.actor.home

    @property
    def xy(self) -> tuple[float, float]:
        """The position of the body [m]."""
        return self.actor.xy

    @property
    def room(self) -> Room | None:
        """The room that the body is in; None when it is away."""
        state = self.actor.state
        return None if state.away else self.home.plan.room_of_point(state.x, state.y)

    @property
    def in_view(self) -> Mapping[str, "Point"]:
        """The people in view of the body's cameras, and where each was perceived last [m].

        A person counts as in view until lost. The empty name is somebody not recognized.
        """
        return self.actor.in_view()

    @property
    def command(self) -> Command | None:
        """The command to the body, until a behavior takes it up."""
        return self.actor.command

    @property
    def requests(self) -> RequestQueue | None:
        """The robot's present requests to people; None: the scenario has no interactions."""
        return self.actor.requests

    def take_command(self, do: str) -> Command | None:
        """Return the body's command and remove it, if it is of a kind; else None."""
        command = self.actor.command
        if command is None or command.do != do:
            return None
        self.actor.command = None
        return command

    def nearest_free(self, x: float, y: float) -> tuple[float, float]:
        """Return the nearest place to (x, y) [m] that the body fits in and can reach."""
        actor = self.actor
        lattice = self.home.lattice
        at_x, at_y = lattice.point_at((x, y))
        if actor.space.part_at(at_x, at_y) != actor.part:
            near = actor.space.nearest(at_x, at_y, actor.part)
            at_x, at_y = near or actor.state.position
        return lattice.xy_of(at_x, at_y)

    def random(self, purpose: str) -> Draws:
        """Return the random draws of this body at this step, for one purpose of the behavior."""
        return Draws(self.actor.stream(purpose), self.step)

    def plan(self) -> Plan:
        """Return an empty plan that begins at the present step."""
        return Plan(self.actor, self.step)


class Behavior(Component):
    """Base of behaviors; a subclass declares its configuration as fields and implements `decide`.

    The behaviors of a body are in order of priority: the first one that returns a plan is followed.
    State that a behavior keeps between decisions is set in `start`, as attributes that aren't
    fields.

    Attributes:
        when: The hours in which it may decide; left out: at all times.
        cooldown: Time after the end of its plan during which it makes no new one.
        preempts: Whether it may interrupt behaviors after it; else it waits.

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

    kind = "behavior"
    # Whether it resumes its plan after an interruption by an earlier behavior.
    resumes: ClassVar[bool] = False
    # Layers of seen cells that it reads: explored, first_seen, last_seen …
    needs: ClassVar[frozenset[str]] = frozenset()
    # Kinds of events that its plans record: all kinds of its own, and those of EventKind that a
    # script may wait for.
    records: ClassVar[frozenset[str]] = frozenset()
    # Events at which it may interrupt the behaviors after it: all that `awaits` can return.
    listens: ClassVar[frozenset[str]] = frozenset()
    # Whether it does nothing in a scenario without requests of its robot to people.
    serves_requests: ClassVar[bool] = False
    # Whether it follows a log or a real body, whose positions nothing in the run may change.
    is_recorded: ClassVar[bool] = False
    # Whether it reads its robot's memory of sightings, by `actor.recall`.
    remembers: ClassVar[bool] = False
    # Whether it always has a plan, so that later behaviors are never asked.
    always_decides: ClassVar[bool] = False
    # Kinds of commands that it carries out: find, come, dock, or a name of its own.
    answers: ClassVar[frozenset[str]] = frozenset()
    # Default height of a user with this behavior [m].
    usual_height: ClassVar[float] = 1.7

    when: Hours = ()
    cooldown: Duration = timedelta(0)
    preempts: bool = True

    def start(self, actor: "Actor") -> None:
        """Prepare for a run, and check that the named places exist."""

    def begins_at(self, time: datetime) -> RoomChoice | Point | None:
        """Return the place of the body when the run begins; None: drawn; (): away."""
        return None

    def attention(self, actor: "Actor") -> Attention | None:
        """Return the attention of the body, whose events interrupt any of its plans; None: none."""
        return None

    def reacts_to(self, actor: "Actor", event: SightEvent, step: int) -> bool:
        """Return whether an event of its `attention` interrupts the plan."""
        return True

    def furniture(self, actor: "Actor", kind: str) -> str | None:
        """Return the name of the piece of furniture of a kind that the body always uses, if any."""
        return None

    def give_up(self, now: Situation) -> None:
        """Give up the present plan, which can't be continued."""

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return the time at which to ask this behavior during a plan of a later one."""
        return None

    def awaits(self, now: Situation) -> frozenset[str]:
        """Return the events at which to ask this behavior during a plan of a later one."""
        return self.listens

    def about(self) -> tuple[str, ...]:
        """Return the users named by its fields; a scenario that lacks one of them is refused."""
        return ()

    def reads(self) -> tuple[str, ...]:
        """Return the algorithms to read; a scenario that lacks one of them is refused."""
        return ()

    def takes(self, command: Command) -> bool:
        """Return whether it carries out a command."""
        return command.do in self.answers

    def activities(self) -> tuple[str, ...]:
        """Return the names of the activities that the behavior can perform."""
        return ()

    def perform(self, plan: Plan, activity: str) -> None:
        """Add the way to the place of an activity to a plan."""
        raise NotImplementedError

    def leaves_turns(self) -> bool:
        """Return whether later behaviors may ever be asked."""
        return not self.always_decides or bool(self.when or self.cooldown)

    def busy(self) -> bool:
        """Return whether a task is under way that hours and cooldown don't end."""
        return False

    def dismiss(self) -> None:
        """Drop the present task, since the robot was sent away; by default, do nothing."""

    def decide(self, now: Situation) -> Plan | None:
        """Return the plan from now on; None leaves the decision to the next behavior."""
        raise NotImplementedError


@dataclass(eq=False)
class Actor(Body):
    """A body with behaviors, and the plan that it follows.

    Attributes:
        behaviors: Copies of the behaviors of its configuration, in order.
        charge: The charge of its battery; None without a battery.
        requests: Its requests to people; None without interactions.
        command: The command to it, until a behavior takes it up.
        displacements: Periods in which it believes itself elsewhere after being carried off.
        bans: The rooms that it was told to keep out of, and the first step at which it may enter.
        in_view: Returns the people that its cameras have in view, and the last place of each [m].
        recall: Returns the robot's `SightingMemory`, if one of its behaviors `remembers`.
        plan: The plan that it follows.
        motion: The motion of that plan.
        planned_at: The step at which it began the plan.
        off_for: The reason for being off, a `SetPower.state`; None: it is on.
    """

    behaviors: list[Behavior] = field(init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.in_view: Callable[[], Mapping[str, Point]] = dict  # set if it has cameras
        self.recall: Callable[[], Any] = dict  # set if it remembers
        # Copies that haven't started, to begin anew with.
        self._declared = list(getattr(self.entity, "behaviors", ()))
        self.requests: RequestQueue | None = None  # set if the scenario has interactions
        self.behaviors = [behavior.model_copy(deep=True) for behavior in self._declared]
        self.displacements: list[Displacement] = []
        self.sleepers: Callable[[], Any] | None = None  # set if it keeps out of bedrooms
        self.ruled = self.kept_out - self.forbidden  # zones of its rules that hold at present
        with blame(self.path, None):
            self._state = self._first_pose()
            self.kept_out = self.forbidden  # behaviors prepare for hours without rules
            self._note_lost_rooms()
            battery = getattr(self.entity, "battery", None)
            self.charge = None if battery is None else Charge(battery, self)
            for behavior in self.behaviors:
                behavior.start(self)
            self._find_attention()
        self.kept_out = self.forbidden | self.ruled
        self.command: Command | None = None
        self.off_for: str | None = None
        self.bans: dict[int, int] = {}
        self.plan: Plan = Plan(self, 0).stay()
        self.motion: Motion = self.plan.finish()
        self.planned_at = 0

    def _find_attention(self) -> None:
        claims = ((behavior, behavior.attention(self)) for behavior in self.behaviors)
        self._attentive = next((pair for pair in claims if pair[1] is not None), None)

    def replace(self, number: int, behavior: Behavior) -> None:
        """Replace a behavior, by its number, with another one, which starts.

        Raises:
            InputError: The new behavior can't start; the present one stays.
        """
        started = behavior.model_copy(deep=True)
        started.start(self)
        self.behaviors[number] = started
        self._declared[number] = behavior
        self._find_attention()

    @property
    def is_recorded(self) -> bool:
        """Whether its motion is recorded, so that it can't do anything else."""
        return any(behavior.is_recorded for behavior in self.behaviors)

    @property
    def is_off(self) -> bool:
        """Whether the body is off: it neither moves, nor sees, nor hears."""
        return self.off_for is not None

    def banned(self, step: int) -> frozenset[int]:
        """Return the rooms, by index, and areas from which the body is banned at a step."""
        bans = (room for room, until in self.bans.items() if until > step)
        return self.forbidden.union(self.ruled, bans)

    def rules_at(self, time: datetime) -> frozenset[int]:
        """Return the zones that its rules forbid at a local time, by its belief."""
        if self.rules is None:
            return frozenset()
        rooms = frozenset[int]() if self.sleepers is None else self.sleepers().rooms
        return self.rules.active(time, rooms)

    def ask(self, step: int | None) -> None:
        """Set the step of the next decision; None: never."""
        if self._bodies is not None:
            self._bodies.ask_at[self.row] = NEVER if step is None else step

    @property
    def asked_at(self) -> int | None:
        """The step of the next decision without interruptions; None: never."""
        at = NEVER if self._bodies is None else int(self._bodies.ask_at[self.row])
        return None if at == NEVER else at

    @property
    def attention(self) -> Attention | None:
        """The attention of the first attentive behavior, whose events interrupt plans."""
        return self._attentive[1] if self._attentive else None

    def may_record(self, event: str) -> bool:
        """Return whether a behavior declares a kind of events in `records`."""
        return any(event in behavior.records for behavior in self.behaviors)

    def own_furniture(self, kind: str) -> PlacedObject | None:
        """Return the body's own piece of furniture of a kind, if its behaviors name one."""
        names = (behavior.furniture(self, kind) for behavior in self.behaviors)
        return next((self.home.object(name) for name in names if name is not None), None)

    def posture_code(self, time_us: int) -> int:
        """Return the posture at a moment, by its number in POSTURES."""
        plan: Plan | None = getattr(self, "plan", None)  # there is none while the first one is made
        if plan is None or not (plan.postures or plan.posture != "stand"):
            return 0
        return plan.posture_at(time_us)

    def _note_lost_rooms(self) -> None:
        """Note the rooms that can't be reached, since every way leads through forbidden ones."""
        if self.rules is None or self._state.away:
            return
        whole = self.whole_space
        x, y = self._state.position
        within_reach = whole.rooms_of(whole.part_at(x, y))
        zones = [(self.forbidden, "")]
        zones += [(self.forbidden | timed.zones, timed.about) for timed in self.rules.timed]
        told: set[int] = set()
        for kept_out, when in zones:
            try:
                space = self.space_without(kept_out)
            except FloorPlanError:
                continue
            # For a body within a forbidden zone, the remainder of the largest part counts.
            part = max(space.part_at(x, y), 0)
            lost = within_reach - space.rooms_of(part) - kept_out - told
            told |= lost
            if kept_out and lost:
                names = ", ".join(self.home.rooms[index].name for index in sorted(lost))
                hint = "; passing: true of a room lets it through"
                self.notes.append(f"keep_out: no way is left to {names}{when}{hint}")

    def _first_pose(self) -> Pose:
        """Return the pose at step 0."""
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
            x, y = self.home.lattice.point_at(place)  # type: ignore[arg-type]
            self.part = max(self.space.part_at(x, y), 0)
            x, y = self.point(place)  # type: ignore[arg-type]
        else:
            self.part = self._start_part(place)  # type: ignore[arg-type]
            x, y = self.find(place, 0, "start")
        heading = self.entity.start_heading_deg
        if heading is None:
            return Pose(x, y, Draws(self.stream("start heading"), 0).below(TURN), away)
        return Pose(x, y, round(heading / 360 * TURN) % TURN, away)


def is_own(actor: Actor) -> bool:
    """Return whether a body has a behavior that isn't Fleet2D's."""
    return any(not type(b).__module__.startswith("fleet2d.") for b in actor.behaviors)
