"""Plans: the timed paths that behaviors return, followed until they are over or interrupted."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from functools import partial
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from fleet2d import kernels
from fleet2d.configuration.components import Component
from fleet2d.configuration.problems import did_you_mean, problem, refusal
from fleet2d.configuration.units import MAX_DURATION, micros
from fleet2d.entities.body import STANDING, Body, Motion, RandomWalk, Track
from fleet2d.entities.place import Point, RoomChoice, seat_at
from fleet2d.errors import ComponentError, NoWayError, errors_as
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.floorplan.placed_objects import POSTURES, PlacedObject, Posture
from fleet2d.floorplan.slow_area import slowed
from fleet2d.floorplan.space import Space, straight_way
from fleet2d.kernels import I8, I64, SUB, TURN, Breakpoints, Legs, WalkRule
from fleet2d.runtime.events import KINDS, EventKind


class Note(NamedTuple):
    """A row that a plan adds to the events table: its time, kind and detail."""

    time_us: int
    event: str
    detail: str


# Plans have many notes: this makes one from a tuple of its fields without calling Python code.
new_note: Callable[[tuple[int, str, str]], Note] = partial(tuple.__new__, Note)

PlanEnd = tuple[int, int, int, int, int]
"""Time [us], x, y [lattice], heading [1/4096 turn], and whether the body is away."""


class Plan:
    """A timed path, built leg by leg: ``now.plan().go_to("kitchen").stay(timedelta(minutes=5))``.

    The behavior is asked again when the plan is over, or when one of `interrupts` happens.

    Attributes:
        body: The body that follows it.
        began: The step at which it begins, and the state of the body then.
        time_us: The moment up to which it is planned [us since the start].
        legs: Its breakpoints so far.
        notes: Events on the way, for the events table.
        interrupts: Events that end the plan early.
        asks_us: The latest time at which the behavior is asked again [us since the start]; None: at
            the plan's end.
        posture: The posture of the body at the end of the plan.
        postures: Times at which the posture changes [us since the start], with its number in
            POSTURES.
    """

    def __init__(self, body: Body, step: int) -> None:
        state = body.state
        self.body = body
        self.began = (step, state)
        self.legs = Legs()
        self._motion: Motion | None = None
        self._over: tuple[int | None] | None = None  # `over_at` of a complete plan
        self.time_us = step * body.clock.step_us
        self.x, self.y, self.heading, self.away = state
        self.notes: list[Note] = []
        self.interrupts: frozenset[str] = frozenset()
        self.asks_us: int | None = None
        self._root: Plan | None = None
        self.endless = False
        self._posture_before = body.posture_code(self.time_us)
        self.posture: Posture = POSTURES[self._posture_before]
        self.postures: list[tuple[int, int]] = []
        self._mark()

    @property
    def root(self) -> "Plan":
        """The plan that it continues; itself, unless it resumes one that was broken off."""
        return self if self._root is None else self._root

    @root.setter
    def root(self, plan: "Plan") -> None:
        # A reference to itself would keep the plan until the next garbage collection.
        self._root = None if plan is self else plan

    @property
    def step_us(self) -> int:
        """Length of a step [us]."""
        return self.body.clock.step_us

    @property
    def end(self) -> PlanEnd:
        """The end so far: the moment, and the pose there."""
        return self.time_us, self.x, self.y, self.heading, self.away

    @end.setter
    def end(self, end: PlanEnd) -> None:
        self.time_us, self.x, self.y, self.heading, self.away = end

    @property
    def position(self) -> LatticePoint:
        """The position of the body at the end so far [lattice]."""
        return self.x, self.y

    @property
    def time(self) -> datetime:
        """The local time of the end so far."""
        return self.body.clock.start + timedelta(microseconds=self.time_us)

    def go_to(
        self, place: RoomChoice | Point | str | Iterable[object], purpose: str = "spot"
    ) -> Self:
        """Walk to a place by the shortest path, turning on the spot towards every leg.

        A robot takes the cheapest path where the home has a costmap, and moves as its drive does.

        In a room, the place is a spot drawn from its free cells by the stream `purpose`. People use
        furniture that they go to; robots stop in front of it.
        """
        thing = seat_at(self.body, place)
        if thing is not None:
            return self.use(thing)
        return self.go_to_point(*self.body.find(place, self.time_us, purpose))

    def go_to_point(self, x: int, y: int, *, route: I64 | None = None) -> Self:
        """Walk to a lattice point by the shortest path, or by a route (n, 2) that leads there.

        Raises:
            NoWayError: There is no way to it, or none at present.
        """
        self.come_home()
        self._check_goes_on()
        body = self.body
        space = body.space
        self.take("stand")
        off = body.step_off(self.x, self.y)
        if route is None and self._go_shortest(space, x, y, off):
            return self
        if off is not None:
            self._step_to(*off)
        for passing in space.passings(self.position, (x, y)) if route is None else ():
            self.go_to_point(*passing.begin)
            self.stay_until(self.time_us + passing.takes_us // 2)
            self.jump(self.time_us, x=passing.end[0], y=passing.end[1])
            self.stay_until(self.time_us + passing.takes_us - passing.takes_us // 2)
        if route is None:
            route = space.route(self.position, (x, y))
        if route is None:
            at = body.home.lattice.to_metres([x, y]).round(2).tolist()
            raise NoWayError(f"{body.path}: there is no way to {at} for a body of its radius")
        self._walk(route)
        return self

    def visit(self, stops: Sequence[LatticePoint], turns: float, dwell: timedelta) -> Self:
        """Go to lattice points in turn; at each of them turn on the spot, and stay.

        Raises:
            NoWayError: There is no way to one of them, or none at present.
        """
        for number, stop in enumerate(stops):
            if number == 1 and self._visit_all(stops[1:], turns, dwell):
                break
            self.go_to_point(*stop)
            self.turn_by(turns)
            self.stay(dwell)
        return self

    def _visit_all(self, stops: Sequence[LatticePoint], turns: float, dwell: timedelta) -> bool:
        """Visit points by shortest ways without an object in them, if that is all."""
        body = self.body
        routes = body.space.shortest
        is_driven = body.drive is not None or body.slows
        places = [self.position, *stops]
        if routes is None or is_driven or any(map(body.home.approach_of, places)):
            return False
        way = routes, np.array(stops, np.int64), body.speed, body.turn_rate
        end = self.legs.visit(*self.end[:4], *way, round(turns * TURN), micros(dwell))
        if end is not None:
            self.end = end
        return end is not None

    def _go_shortest(self, space: Space, x: int, y: int, off: LatticePoint | None) -> bool:
        """Step `off` an object and walk a shortest route, if that is all; return whether it was."""
        body = self.body
        routes = space.shortest
        if routes is None or body.drive is not None or body.slows:
            return False
        end = self.legs.go(*self.end[:4], routes, x, y, body.speed, body.turn_rate, off)
        if end is not None:
            self.end = end
        return end is not None

    def _walk(self, route: I64) -> None:
        body = self.body
        walk = self.time_us, self.heading, route, body.speed, body.turn_rate
        if body.drive is None and not body.slows:
            self.end = self.legs.walk(*walk)
            return
        legs = Legs()
        legs.mark(*self.end)
        if body.drive is None:
            legs.walk(*walk)
        else:
            legs.add(body.breakpoints(route, self.time_us, self.heading))
        rows = legs.rows()
        self.follow((slowed(rows, body.slows) if body.slows else rows)[1:])

    def use(self, thing: PlacedObject | str, place: int = 0) -> Self:
        """Walk to an object and use it, with the heading and the posture of one of its places.

        The last step may lead onto the object, into a bed or onto a chair; before the next walk,
        the body gets up. The events table has a row `uses` with the object's name.

        Args:
            thing: An object of the home, or its name.
            place: The number of one of its places, modulo their count.

        Raises:
            PlacementError: There is no such object, or no place to use it from.
            NoWayError: There is no way to it, or none at present.
        """
        at = self.body.place_at(thing, place)
        if self.away or self.position != (at.x, at.y):
            self.go_to_point(*at.approach)
        self._check_goes_on()
        body = self.body
        if body.drive is None:
            there = at.x, at.y, at.heading
            self.end = self.legs.settle(*self.end[:4], *there, body.speed, body.turn_rate)
        else:
            self._step_to(at.x, at.y)
            self.turn_to(at.heading)
        self.take(at.posture)
        return self.note(EventKind.USES, at.thing.name)

    def take(self, posture: Posture) -> Self:
        """Stand, sit or lie from the present end of the plan until the next walk."""
        if posture != self.posture:
            self.postures.append((self.time_us, POSTURES.index(posture)))
            self.posture = posture
        return self

    def posture_at(self, time_us: int) -> int:
        """Return the posture at a moment within the plan, by number in POSTURES."""
        changes = reversed(self.postures)
        return next((code for time, code in changes if time <= time_us), self._posture_before)

    def posture_times(self) -> tuple[I64, I8]:
        """Return times of changes of posture [us], int64 (n,), and the postures, int8 (n + 1,)."""
        if not self.postures and self._posture_before == 0:
            return STANDING
        codes = [self._posture_before, *(code for _, code in self.postures)]
        times = [time for time, _ in self.postures]
        return np.array(times, np.int64), np.array(codes, np.int8)

    def _step_to(self, x: int, y: int) -> None:
        """Go straight to a lattice point; neither walls nor furniture count."""
        if (x, y) != self.position:
            self._walk(straight_way(self.position, (x, y)))

    def reaches(self, x: int, y: int) -> bool:
        """Return whether there is a way to a lattice point from where the plan ends so far."""
        space = self.body.space
        way = self.position, (x, y)
        return space.route(*way) is not None or bool(space.passings(*way))

    def follow(self, breakpoints: I64) -> Self:
        """Follow given breakpoints; between two of the same time, the body jumps.

        Args:
            breakpoints: Time [us since the start], x, y [lattice], heading [1/4096 turn], away;
                int64 (n, 5).

        Raises:
            ComponentError: The times are not ascending, or begin before the end of the plan.
        """
        self._check_goes_on()
        if len(breakpoints):
            times = breakpoints[:, 0]
            if times[0] < self.time_us or bool((times[1:] < times[:-1]).any()):
                raise ComponentError(
                    f"{self.body.path}: breakpoints must be in order of time, from"
                    f" {self.time_us} us on"
                )
            self.legs.add(breakpoints)
            self.end = breakpoints[-1].tolist()
        return self

    def go_on_along(self, legs: Legs, end: PlanEnd) -> Self:
        """Follow breakpoints of the core from the plan's beginning, in place of those so far.

        Args:
            legs: The breakpoints.
            end: Time, x, y, heading and away at the last of them.
        """
        self.legs = legs
        self.end = end
        return self

    def jump(self, time_us: int, **changes: int) -> Self:
        """Change x, y, heading or away at once, at a moment [us since the start]."""
        before = {"x": self.x, "y": self.y, "heading": self.heading, "away": self.away}
        after = before | changes
        rows = [[time_us, *before.values()], [time_us, *after.values()]]
        return self.follow(np.array(rows, np.int64))

    def turn_by(self, turns: float) -> Self:
        """Turn on the spot by a number of turns, counter-clockwise if positive."""
        return self._turn(round(turns * TURN))

    def turn_to(self, heading: int) -> Self:
        """Turn on the spot to a heading [1/4096 turn], the shorter way."""
        return self._turn(kernels.turn_between(self.heading, heading))

    def face(self, x: int, y: int) -> Self:
        """Turn on the spot towards a lattice point."""
        return self.turn_to(kernels.heading_of(x - self.x, y - self.y))

    def face_place(self, place: Point) -> Self:
        """Turn on the spot towards a place [m]."""
        return self.face(*self.body.home.lattice.point_at(place))

    def _turn(self, headings: int) -> Self:
        self._check_goes_on()
        if headings:
            self.end = self.legs.turn(*self.end, headings, self.body.turn_rate)
        return self

    def stay(self, duration: timedelta | None = None, *, until: datetime | None = None) -> Self:
        """Stay for a duration, or until a local time; without either, for good.

        A past time means not to stay at all.

        Raises:
            ComponentError: The duration is negative, or longer than 1000 years.
        """
        self._check_goes_on()
        if duration is not None:
            if not timedelta(0) <= duration <= MAX_DURATION:
                raise ComponentError(
                    f"{self.body.path}: can't stay for {duration}: 0 to 1000 years are possible;"
                    " leave the duration out to stay for good"
                )
            self.time_us += micros(duration)
        elif until is not None:
            self.time_us = max(self.time_us, self.body.clock.elapsed(until))
        else:
            self.endless = True
        self._mark()
        return self

    def stay_until(self, time_us: int) -> Self:
        """Stay until a moment [us since the start]; not at all if that is past."""
        self._check_goes_on()
        if time_us > self.time_us:
            self.time_us = time_us
            self._mark()
        return self

    def leave_home(self) -> Self:
        """Walk to the way out of the home, and be away from then on."""
        if not self.away:
            self.go_to_point(*self.body.way_out)
            self.away = 1
            self.note(EventKind.LEFT_HOME)
            self._mark()
        return self

    def come_home(self) -> Self:
        """Be at home again, at the point where the body left; no effect if it is at home."""
        if self.away:
            self.away = 0
            self.note(EventKind.CAME_HOME)
            self._mark()
        return self

    def meander(self, rule: WalkRule) -> Self:
        """Walk at random, for good; must be all that the plan does."""
        self.come_home()
        self._check_goes_on()
        if len(self.legs) > 2 or self.time_us != self.began[0] * self.step_us:
            raise ComponentError(f"{self.body.path}: a plan that meanders can do nothing before")
        self.take("stand")
        home = self.body.home
        body = self.body
        # A random walk doesn't open doors: a shut one is a wall.
        space = home.space(body.entity.radius, without=body.kept_out)
        self._motion = RandomWalk(home.barriers, space.mesh, rule)
        self.endless = True
        return self

    def note(self, event: str, detail: str = "") -> Self:
        """Add a row to the events table, at the present end of the plan.

        Raises:
            ComponentError: Neither Fleet2D nor a behavior of the body declares such events.
        """
        if event not in KINDS and not self.body.may_record(event):
            raise ComponentError(
                f"{self.body.path}: there is no event {event!r}{did_you_mean(event, KINDS)} A"
                f" behavior declares its own: records = frozenset({{{event!r}}})"
            )
        self.notes.append(new_note((self.time_us, event, detail)))
        return self

    def call(self, user: str = "") -> Self:
        """Call a person by name, or everybody who is near: people who react to robots may come."""
        return self.note(EventKind.CALLS, user)

    def interrupt_on(self, *events: "str | type[Component]") -> Self:
        """Ask the behavior again as soon as one of these events happens.

        A robot with a camera has the events user_seen and user_lost, a user with a camera
        robot_seen and robot_lost. All bodies have the interrupts of `fleet2d.engine.interrupt`;
        one of your own is its class.

        Raises:
            ComponentError: No such event interrupts plans of the body.
        """
        body = self.body
        names = frozenset(event if isinstance(event, str) else event.type_name for event in events)
        for name in sorted(names - body.interrupts):
            with errors_as(ComponentError, body.path, of=ComponentError):
                body.entity.check_interrupt(name)
            body.interrupts |= {name}
        self.interrupts |= names
        return self

    def ask_by(self, time: datetime) -> Self:
        """Ask the behavior again no later than a local time, even if the plan isn't over."""
        asks_us = self.body.clock.elapsed(time)
        self._over = None
        self.asks_us = asks_us if self.asks_us is None else min(asks_us, self.asks_us)
        return self

    @property
    def over_at(self) -> int | None:
        """The step at which the plan is over, after its first one; None: never."""
        return self._over_at() if self._over is None else self._over[0]

    def _over_at(self) -> int | None:
        end_us = self.asks_us
        if not self.endless:
            end_us = self.time_us if end_us is None else min(end_us, self.time_us)
        if end_us is None:
            return None
        # Without this, a behavior whose plans take no time would be asked forever at one step.
        return max(self.body.clock.step_at_or_after(end_us), self.began[0] + 1)

    def is_over(self, step: int) -> bool:
        """Return whether the plan is over at a step."""
        end = self.over_at
        return end is not None and end <= step

    @property
    def is_random_walk(self) -> bool:
        """Whether the motion is a random walk."""
        return isinstance(self._motion, RandomWalk)

    def finish(self) -> Motion:
        """Complete the plan, and return its motion."""
        if self._motion is None:
            self._motion = Track(Breakpoints(*self.legs.track()), self.step_us)
        self._over = (self._over_at(),)
        return self._motion

    def _check_goes_on(self) -> None:
        if self.endless:
            raise ComponentError(
                f"{self.body.path}: a plan that stays or meanders for good can't go on: give"
                " stay() a duration, or make that the end"
            )

    def _mark(self) -> None:
        self.legs.mark(*self.end)


def _check_posture(change: list[int]) -> list[int]:
    _, code = change
    if not 0 <= code < len(POSTURES):
        raise ValueError(f"no posture has the number {code}")
    return change


_Integer = Annotated[int, Field(gt=-(2**61), lt=2**61)]
_FIVE = Field(min_length=5, max_length=5)


def data_of(plan: Plan) -> dict[str, Any]:
    """Return a plan as numbers and texts, from which `plan_of` makes the same plan again."""
    motion = plan.finish()
    return {
        "rows": plan.legs.rows().tolist(),
        "walk": [int(n) for n in motion.rule] if isinstance(motion, RandomWalk) else None,
        "notes": [list(note) for note in plan.notes],
        "interrupts": sorted(plan.interrupts),
        "asks_us": plan.asks_us,
        "endless": plan.endless,
        "postures": [list(change) for change in plan.postures],
    }


def check_data(data: dict[str, Any]) -> dict[str, Any]:
    """Return `data` if `plan_of` can read it: an edited manifest may hold anything.

    Raises:
        PydanticCustomError: The data describes no plan.
    """
    try:
        _PlanForm.model_validate(data)
    except ValidationError as error:
        raise problem(str(refusal("", error))) from None
    return data


class _PlanForm(BaseModel):
    """The form of a plan from `data_of`."""

    model_config = ConfigDict(strict=True, extra="forbid", defer_build=True)

    rows: list[Annotated[list[_Integer], _FIVE]]
    walk: Annotated[list[Annotated[int, Field(ge=0, lt=2**64)]], _FIVE] | None
    notes: list[Annotated[tuple[int, str, str], Field(strict=False)]]
    interrupts: list[str]
    asks_us: _Integer | None
    endless: bool
    postures: list[Annotated[list[_Integer], AfterValidator(_check_posture)]]


def plan_of(body: Body, step: int, data: Mapping[str, Any]) -> Plan:
    """Return the plan that `data` describes, for a body to follow from a step on.

    Raises:
        ComponentError: The plan leads out of the floor plan, goes back in time, or waits for an
            impossible event.
    """
    plan = Plan(body, step)
    if data["walk"] is not None:
        key, *numbers = data["walk"]
        return plan.meander(WalkRule(np.uint64(key), *numbers))
    rows = np.array(data["rows"], np.int64).reshape(-1, 5)
    _check_rows(body, plan.time_us, rows)
    plan.legs = Legs()
    with errors_as(ComponentError, f"{body.path}: the plan of an intervention", of=ValueError):
        plan.legs.add(rows)
    plan.end = data["rows"][-1]
    plan.notes = [Note(*note) for note in data["notes"]]
    plan.interrupt_on(*data["interrupts"])
    plan.asks_us = data["asks_us"]
    plan.endless = data["endless"]
    plan.postures = [(time, code) for time, code in data["postures"]]
    return plan


def _check_rows(body: Body, begin_us: int, rows: I64) -> None:
    """Refuse breakpoints that a body can't follow from a moment on."""
    size = body.home.plan.room_of_place.shape
    x = rows[:, 1] // SUB
    y = rows[:, 2] // SUB
    inside = (x >= 0) & (x < size[1]) & (y >= 0) & (y < size[0])
    times = rows[:, 0]
    goes_back = bool((np.diff(times) < 0).any())
    if not len(rows) or times[0] > begin_us or goes_back or not inside.all():
        raise ComponentError(
            f"{body.path}: the plan of an intervention can't be followed: its breakpoints should be"
            f" in the home and in order of time, the first at {begin_us} us or before"
        )
