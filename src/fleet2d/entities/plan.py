"""Plans: the timed path that a behavior decided on, followed until it is over or interrupted."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from fleet2d.errors import ComponentError, NoWayError, PlacementError
from fleet2d.floorplan.objects import POSTURES, PlacedObject, Posture
from fleet2d.kernels.headings import TURN, turn_between
from fleet2d.kernels.mesh import Mesh
from fleet2d.kernels.motion import (
    Breakpoints,
    Poses,
    WalkRule,
    time_route,
    trace_meander,
    trace_track,
)
from fleet2d.units import micros

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.place import Point, RoomChoice

# What can interrupt a plan: the sight events of the body's own camera.
INTERRUPTS = frozenset({"user_seen", "user_lost"})

I64 = NDArray[np.int64]


class State(NamedTuple):
    """Where a body is at one step: lattice units, 1/4096 turn, 1 = away."""

    x: int
    y: int
    heading: int
    away: int


class Motion(Protocol):
    """What the engine follows between two decisions."""

    def trace(self, first: int, start: State, out: Poses) -> None:
        """Write the poses of the steps from `first` on, where the body is at `start`."""


@dataclass(frozen=True)
class Track:
    """A motion along breakpoints that are known in advance."""

    breakpoints: Breakpoints
    step_us: int

    def __deepcopy__(self, memo: dict[int, object]) -> "Track":
        """Return itself: it never changes."""
        return self

    def trace(self, first: int, start: State, out: Poses) -> None:
        """Write the poses of the steps from `first` on."""
        trace_track(self.breakpoints, first * self.step_us, self.step_us, len(out.x), out)


@dataclass(frozen=True)
class Walk:
    """A random walk, drawn step by step."""

    walls: Mesh
    space: Mesh
    rule: WalkRule

    def __deepcopy__(self, memo: dict[int, object]) -> "Walk":
        """Return itself: it never changes."""
        return self

    def trace(self, first: int, start: State, out: Poses) -> None:
        """Write the poses of the steps from `first` on."""
        trace_meander(self.walls, self.space, self.rule, first, np.array(start[:3]), out)


class Note(NamedTuple):
    """Something that a plan says happens at a moment: a row of the events table."""

    time_us: int
    event: str
    detail: str


class Plan:
    """A timed path, built leg by leg: ``now.plan().go_to("kitchen").stay(timedelta(minutes=5))``.

    The behavior is asked again when the plan is over, or when one of `interrupts` happens.

    Attributes:
        began: The step at which it begins, and the state of the body then.
        time_us: The moment up to which it is planned [us since the start].
        notes: What happens on the way, for the events table.
        interrupts: Events that end the plan early.
        posture: How the body stands at the moment up to which it is planned.
        postures: When it takes another posture [us since the start], and which.
    """

    def __init__(self, actor: "Actor", step: int) -> None:
        state = actor.state
        self._actor = actor
        self.began = (step, state)
        self._rows: list[I64] = []
        self._motion: Motion | None = None
        self.time_us = step * actor.clock.step_us
        self.x, self.y, self.heading, self.away = state
        self.notes: list[Note] = []
        self.interrupts: frozenset[str] = frozenset()
        self.endless = False
        self._posture_before = actor.posture_code(self.time_us)
        self.posture: Posture = POSTURES[self._posture_before]
        self.postures: list[tuple[int, int]] = []
        self._mark()

    @property
    def time(self) -> datetime:
        """The local time up to which it is planned."""
        clock = self._actor.clock
        return clock.start + timedelta(microseconds=self.time_us)

    def go_to(
        self, place: "RoomChoice | Point | str | Iterable[object]", purpose: str = "spot"
    ) -> Self:
        """Walk to a place by the shortest path, turning on the spot towards every leg.

        In a room, the place is a spot drawn from its free cells; `purpose` names the random stream.
        """
        return self.go_to_point(*self._actor.find(place, self.time_us, purpose))

    def go_to_point(self, x: int, y: int) -> Self:
        """Walk to a lattice point by the shortest path.

        Raises:
            NoWayError: There is no way to it, or none at present.
        """
        self.come_home()
        self._check_goes_on()
        actor = self._actor
        self._get_up()
        route = actor.space.route((self.x, self.y), (x, y))
        if route is None:
            at = actor.home.plan.lattice.to_metres([x, y]).round(2).tolist()
            raise NoWayError(f"{actor.path}: there is no way to {at} for a body of its radius")
        rows = np.empty((2 * len(route), 4), np.int64)
        count = time_route(route, self.time_us, self.heading, actor.speed, actor.turn_rate, rows)
        block = np.zeros((count - 1, 5), np.int64)
        block[:, :4] = rows[1:count]
        self._rows.append(block)
        self.time_us, self.x, self.y, self.heading = rows[count - 1].tolist()
        return self

    def use(self, thing: PlacedObject | str, place: int = 0) -> Self:
        """Walk to an object and use it: step to one of its places, face and sit as one does there.

        The last step may lead onto the object, into a bed or onto a chair; whoever goes on from
        there gets up first. The events table has a row `uses` with the object's name.

        Args:
            thing: An object of the home, or its name.
            place: Which of its places, by number; counted round where it has fewer.

        Raises:
            PlacementError: There is no such object, or no place to use it from.
            NoWayError: There is no way to it, or none at present.
        """
        home, lattice = self._actor.home, self._actor.home.plan.lattice
        thing = home.object(thing) if isinstance(thing, str) else thing
        if not thing.uses:
            raise PlacementError(f"{self._actor.path}: {thing.name} has no place to use it from")
        use = thing.uses[place % len(thing.uses)]
        x, y = lattice.to_lattice((use.x, use.y)).tolist()
        if self.away or (self.x, self.y) != (x, y):
            self.go_to_point(*home.approach(use, self._actor.space, self._actor.part))
            self._step_to(x, y)
        turn = turn_between(self.heading, round(use.heading / (2 * np.pi) * TURN) % TURN)
        self.turn_by(turn / TURN)
        self.take(use.posture)
        return self.note("uses", thing.name)

    def take(self, posture: Posture) -> Self:
        """Stand, sit or lie from the moment up to which it is planned; walking makes one stand."""
        if posture != self.posture:
            self.postures.append((self.time_us, POSTURES.index(posture)))
            self.posture = posture
        return self

    def posture_at(self, times_us: I64) -> NDArray[np.int8]:
        """Return the posture at moments within the plan, by its number in POSTURES, int8."""
        begins = np.array([time for time, _ in self.postures], np.int64)
        codes = np.array([self._posture_before, *(code for _, code in self.postures)], np.int8)
        taken: NDArray[np.int8] = codes[np.searchsorted(begins, times_us, side="right")]
        return taken

    def _get_up(self) -> None:
        """Stand, and step off the object that one sits or lies on."""
        self.take("stand")
        approach = self._actor.home.approach_of((self.x, self.y))
        if approach is not None and self._actor.space.part_at(self.x, self.y) < 0:
            self._step_to(*approach)

    def _step_to(self, x: int, y: int) -> None:
        """Go straight to a point, whatever is in the way."""
        if (x, y) == (self.x, self.y):
            return
        actor, rows = self._actor, np.empty((4, 4), np.int64)
        route = np.array([(self.x, self.y), (x, y)], np.int64)
        count = time_route(route, self.time_us, self.heading, actor.speed, actor.turn_rate, rows)
        block = np.zeros((count - 1, 5), np.int64)
        block[:, :4] = rows[1:count]
        self._rows.append(block)
        self.time_us, self.x, self.y, self.heading = rows[count - 1].tolist()

    def reaches(self, x: int, y: int) -> bool:
        """Tell whether there is a way to a lattice point from where the plan ends at present."""
        return self._actor.space.route((self.x, self.y), (x, y)) is not None

    def follow(self, breakpoints: I64) -> Self:
        """Follow breakpoints known beforehand, from where it is; two of one time are a jump.

        Args:
            breakpoints: Time [us since the start], x, y [lattice], heading [1/4096 turn], away;
                int64 (n, 5).

        Raises:
            ComponentError: Their times run backwards, or begin before what is planned.
        """
        self._check_goes_on()
        if len(breakpoints):
            times = breakpoints[:, 0]
            if times[0] < self.time_us or bool((times[1:] < times[:-1]).any()):
                raise ComponentError(
                    f"{self._actor.path}: breakpoints must be in order of time, from"
                    f" {self.time_us} us on"
                )
            self._rows.append(breakpoints)
            self.time_us, self.x, self.y, self.heading, self.away = breakpoints[-1].tolist()
        return self

    def turn_by(self, turns: float) -> Self:
        """Turn on the spot by a number of turns, counter-clockwise if positive."""
        self._check_goes_on()
        whole = round(turns * TURN)
        sign = 1 if whole > 0 else -1
        left = abs(whole)
        while left > 0:  # a third of a turn at most, so that the shorter way is the one meant
            part = min(left, TURN // 3)
            left -= part
            self.time_us += int(np.ceil(part * 1e6 / self._actor.turn_rate))
            self.heading = (self.heading + sign * part) % TURN
            self._mark()
        return self

    def stay(self, duration: timedelta | None = None, *, until: datetime | None = None) -> Self:
        """Stay for a while, or until a local time (at once over if that is past); else for good.

        Raises:
            ComponentError: The duration is negative.
        """
        self._check_goes_on()
        if duration is not None:
            if duration < timedelta(0):
                raise ComponentError(f"{self._actor.path}: can't stay for {duration}")
            self.time_us += micros(duration)
        elif until is not None:
            self.time_us = max(self.time_us, self._actor.clock.elapsed(until))
        else:
            self.endless = True
        self._mark()
        return self

    def leave_home(self) -> Self:
        """Walk to the way out and be away from then on."""
        if not self.away:
            self.go_to_point(*self._actor.way_out)
            self.away = 1
            self.note("left_home")
            self._mark()
        return self

    def come_home(self) -> Self:
        """Be at home again, where the body went away; nothing if it is at home."""
        if self.away:
            self.away = 0
            self.note("came_home")
            self._mark()
        return self

    def meander(self, rule: WalkRule) -> Self:
        """Walk at random, for good; must be all that the plan does."""
        self.come_home()
        self._check_goes_on()
        if len(self._rows) > 2 or self.time_us != self._rows[0][0, 0]:
            raise ComponentError(f"{self._actor.path}: a plan that meanders can do nothing before")
        home, actor = self._actor.home, self._actor
        # Who wanders about takes a shut door for a wall.
        self._motion = Walk(home.walls, home.space(actor.entity.radius).mesh, rule)
        self.endless = True
        return self

    def note(self, event: str, detail: str = "") -> Self:
        """Add a row to the events table, at the moment up to which it is planned."""
        self.notes.append(Note(self.time_us, event, detail))
        return self

    def interrupt_on(self, *events: str) -> Self:
        """Ask the behavior again as soon as one of these events happens.

        Raises:
            ComponentError: There is no such event, or the body has no camera to notice it.
        """
        if not getattr(self._actor.entity, "eyes", None):
            raise ComponentError(
                f"{self._actor.path}: a camera interrupts plans by what it sees, but there is none"
            )
        unknown = set(events) - INTERRUPTS
        if unknown:
            allowed = ", ".join(sorted(INTERRUPTS))
            raise ComponentError(
                f"{self._actor.path}: no event {sorted(unknown)[0]!r}; there are: {allowed}"
            )
        self.interrupts |= frozenset(events)
        return self

    def finish(self) -> Motion:
        """Return the motion of the plan."""
        if self._motion is None:
            rows = np.concatenate(self._rows)
            time, x, y, heading = (np.ascontiguousarray(rows[:, i]) for i in range(4))
            track = Breakpoints(time, x, y, heading, rows[:, 4].astype(np.uint8))
            self._motion = Track(track, self._actor.clock.step_us)
        return self._motion

    def _check_goes_on(self) -> None:
        if self.endless:
            raise ComponentError(
                f"{self._actor.path}: a plan that stays or meanders for good can't go on: give"
                " stay() a duration, or make that the end"
            )

    def _mark(self) -> None:
        self._rows.append(
            np.array([[self.time_us, self.x, self.y, self.heading, self.away]], np.int64)
        )
