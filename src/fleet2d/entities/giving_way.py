"""Giving way: the continuation of plans when somebody is in the way.

A robot stops in front of people, waits, and goes around them or gives up. Any body waits for
another one that blocks it, or goes around it. The rest of a plan is resumed from wherever the body
is by then.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import timedelta
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from fleet2d import kernels
from fleet2d.configuration.units import micros
from fleet2d.entities.behavior import Actor, Situation
from fleet2d.entities.body import Arrangement, Body, Track
from fleet2d.entities.entity import GivesWay
from fleet2d.entities.plan import Note, Plan
from fleet2d.entities.yielder import Continued, Delay, Yielder
from fleet2d.errors import NoWayError
from fleet2d.floorplan.costmap import CLOSED, route_by_cost
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.kernels import (
    CELL_CENTRE,
    I32,
    I64,
    SUB,
    TURN,
    Breakpoints,
    Legs,
    Timelines,
    strictly_inside,
    turn_between,
)
from fleet2d.runtime.events import EventKind

# Of the free cells at most this many cells farther from a place than the nearest one, the one
# nearest to the body is taken.
NEARLY_CELLS = 3
ANY_ROOM = -1
Detour = Callable[[LatticePoint, LatticePoint], I64 | None]


def resumed(plan: Plan, interrupted: Plan, step: int, detour: Detour | None = None) -> Plan | None:
    """Fill a plan with the rest of one that was interrupted.

    The body goes straight to the next place at which it would have stopped. From there on, the plan
    is the same, only later; an interrupted stop takes the remaining time.

    Args:
        plan: An empty plan that begins at the present step.
        interrupted: The plan that was interrupted.
        step: The step at which it was interrupted.
        detour: Returns a route between two lattice points, or None; left out: the shortest route.

    Returns:
        The plan; None if nothing is left to do, or no way leads there at present.
    """
    return _rest(plan, interrupted, step * plan.step_us, detour)


def without_next_stop(plan: Plan, interrupted: Plan, step: int) -> Plan | None:
    """Fill a plan with the rest of one that was interrupted, without its next stop.

    Returns:
        The plan; None if there is no later stop, or no way leads to it at present.
    """
    motion = interrupted.finish()
    if not isinstance(motion, Track):
        return None
    x = motion.breakpoints.x
    y = motion.breakpoints.y
    time = motion.breakpoints.time
    stop = next_stop(plan.body, motion.breakpoints, step * plan.step_us)
    if stop is None:
        return None
    leaves = np.flatnonzero((x[stop:] != x[stop]) | (y[stop:] != y[stop]))
    if not len(leaves):
        return None
    rest = _rest(plan, interrupted, int(time[stop + leaves[0]]))
    if rest is not None:
        rest.root = rest  # one stop is missing, so this is a plan of its own
    return rest


def _rest(
    plan: Plan, interrupted: Plan, interrupted_us: int, detour: Detour | None = None
) -> Plan | None:
    """Fill a plan with the part of another one that comes after a moment."""
    motion = interrupted.finish()
    if not isinstance(motion, Track) or interrupted.postures or plan.away:
        return None
    track = motion.breakpoints
    stop = next_stop(plan.body, track, interrupted_us)
    if stop is None or track.away[stop:].any():
        return None
    goes_on_us = max(int(track.time[stop]), interrupted_us)
    goal = int(track.x[stop]), int(track.y[stop])
    route = detour(plan.position, goal) if detour else None
    if detour and route is None:
        return None
    try:
        plan.go_to_point(*goal, route=route)
    except NoWayError:
        return None
    plan.turn_to(heading_at(track, stop, goes_on_us))
    rest = _rows(track)[stop + 1 :]
    return _continue(plan, interrupted, interrupted_us, goes_on_us, rest, hurries=False)


def next_stop(body: Body, track: Breakpoints, interrupted_us: int) -> int | None:
    """Return the index of the breakpoint at which the body next stands still, or None."""
    stop = kernels.next_stop(body.space.mesh, track, interrupted_us)
    return None if stop < 0 else stop


def heading_at(track: Breakpoints, stop: int, time_us: int) -> int:
    """Return the heading at a moment between a breakpoint and the next."""
    times = track.time
    headings = track.heading
    begin = int(times[stop])
    end = int(times[stop + 1])
    turn = int(turn_between(int(headings[stop]), int(headings[stop + 1])))
    return (int(headings[stop]) + turn * (time_us - begin) // max(end - begin, 1)) % TURN


# A robot checks whether the way is clear after each tenth of the time waited so far, within these
# limits.
LOOK_INTERVALS = timedelta(seconds=1), timedelta(seconds=10)
# A wait that begins this soon after another one continues it. For this time after it begins to go
# round people, a robot may come as near to them as TOUCHING_GAP_M.
REPEATED_WAIT = timedelta(seconds=15)
# Gap at which a robot passes a person if there is no more room, and gap below which the bodies
# count as touching [m].
PASSING_GAP_M = 0.1
TOUCHING_GAP_M = 0.03


class Surroundings(NamedTuple):
    """The people and obstacles around a robot, which waits while they stay the same.

    Attributes:
        people: x and y of the people at home, and the distance between the middles at which the
            bodies touch [lattice], int64 (n, 3).
        users: x and y of all users, and whether they are away, int64 (users, 3).
        arrangement: The versions of doors and furniture, see `Body.arrangement`.
    """

    people: I64
    users: I64
    arrangement: Arrangement

    def is_unchanged_since(self, other: "Surroundings") -> bool:
        """Return whether no person and no object has moved."""
        is_same = self.arrangement == other.arrangement
        return is_same and np.array_equal(self.users, other.users)


@dataclass(eq=False)
class WaitForPeople:
    """The wait of a robot that has stopped in front of a person.

    The steps of its looks are fixed beforehand. A look is skipped if nothing has moved since the
    one before, so the plan to wait lasts until the first look with a result in any case;
    `Clearance` ends it at an earlier look if somebody moves.

    Attributes:
        interrupted: The interrupted plan.
        step: The step of the interruption.
        since: The step of the first stop in front of a person.
        interrupts: The events that interrupt that plan.
        surroundings: The people and obstacles at the last look.
    """

    interrupted: Plan
    step: int
    since: int
    interrupts: frozenset[str]
    surroundings: Surroundings

    def look_from(self, step: int) -> int:
        """Return the step of the first look from `step` on."""
        look = self.step
        while look < step:
            look = self._look_after(look)
        return look

    def look_before(self, step: int) -> int:
        """Return the step of the last look before `step`."""
        look = self.step
        while (after := self._look_after(look)) < step:
            look = after
        return look

    def _look_after(self, look: int) -> int:
        shortest, longest = (micros(interval) for interval in LOOK_INTERVALS)
        interval = min(max(shortest, self._waited(look) // 10), longest)
        return look + max(-(-interval // self.interrupted.step_us), 1)

    def _waited(self, step: int) -> int:
        """Return the time waited at a step [us]."""
        return (step - self.since) * self.interrupted.step_us

    def stand_still(self, now: Situation, person: str, gives_way: GivesWay) -> Plan:
        """Return a plan to stand still until the next look at whether the way is free.

        The plan ends when the robot goes round the person or gives up, at the latest.
        """
        plan = now.plan()
        look = self._look_after(now.step)
        patience = micros(gives_way.patience)
        if now.step == self.since:
            plan.note(EventKind.GIVES_WAY, person)
        if self._waited(now.step) >= patience:  # the robot has already looked for a way round
            patience = max(patience, micros(gives_way.gives_up))
        # At the first look the robot may still turn towards its next leg.
        while self.interrupted.began[0] == now.step and self._waited(look) < patience:
            look = self._look_after(look)
        plan.stay_until(look * plan.step_us).interrupts = self.interrupts
        return plan

    def continued(self, now: Situation) -> Plan | None:
        """Return the rest of the plan; None if nothing is left."""
        return self._with_interrupts(resumed(now.plan(), self.interrupted, self.step))

    def go_around(self, now: Situation, people: I64, distance: float) -> Plan | None:
        """Return the rest of the plan by a way that keeps clear of people; None without such a way.

        Args:
            now: The situation.
            people: The people, as in `Surroundings.people`.
            distance: The gap to keep where there is room [m].
        """
        actor = now.actor
        lattice = actor.home.lattice
        for gap in (max(distance, PASSING_GAP_M) + lattice.cell, PASSING_GAP_M):
            around = people + np.array([0, 0, int(gap * lattice.units_per_m)], np.int64)
            plan = self._stand_for_a_step(now)
            detour = RoutesAround(actor, around)
            rest = resumed(plan, self.interrupted, self.step, detour)
            if rest is not None:
                return self._with_interrupts(rest)
        return None

    def skip_stop(self, now: Situation, person: str) -> Plan | None:
        """Return the plan without the blocked stop; None if that was the last."""
        plan = self.give_up(now, person)
        return self._with_interrupts(without_next_stop(plan, self.interrupted, self.step))

    def give_up(self, now: Situation, person: str) -> Plan:
        """Stand for a step, after which the behaviors are asked again."""
        return self._stand_for_a_step(now).note(EventKind.GIVES_UP, person)

    def _stand_for_a_step(self, now: Situation) -> Plan:
        """Return a plan that begins with a step of standing, so that people in the way are seen."""
        return now.plan().stay(timedelta(microseconds=now.actor.clock.step_us))

    def _with_interrupts(self, plan: Plan | None) -> Plan | None:
        if plan is not None:
            plan.interrupts = self.interrupts
        return plan


class RoutesAround:
    """Routes that keep clear of people, or of other bodies, that stand in the way.

    Args:
        body: The body that goes there.
        people: x and y of each of them, and the distance to keep [lattice], int64 (n, 3).
    """

    def __init__(self, body: Body, people: I64) -> None:
        self._body = body
        self.people = people

    @cached_property
    def cost(self) -> I32:
        """int32 (rows, columns), CLOSED near them."""
        xs, ys = self._body.home.lattice.centre_axes()
        cost = np.zeros(self._body.space.part_of_cell.shape, np.int32)
        for x, y, reach in self.people.tolist():
            rows = _cells_between(y - reach, y + reach)
            columns = _cells_between(x - reach, x + reach)
            away = (xs[columns] - x) ** 2 + (ys[rows, None] - y) ** 2
            cost[rows, columns][away <= reach * reach] = CLOSED
        return cost

    def __call__(self, start: LatticePoint, goal: LatticePoint) -> I64 | None:
        """Return a route between two lattice points, or None if none keeps clear."""
        space = self._body.space
        if space.shortest is not None and strictly_inside(space.mesh, *start):
            return space.shortest.around(*start, *goal, self.people)
        return route_by_cost(space, self.cost, start, goal)


def _cells_between(low: int, high: int) -> slice:
    """Return the rows, or columns, of cells whose centres are at coordinates from low to high."""
    first = -((CELL_CENTRE - low) // SUB)
    end = (high - CELL_CENTRE) // SUB + 1
    return slice(max(first, 0), max(end, 0))


def plan_after(now: Situation, interrupted: Plan, step: int, notes: Sequence[Note] = ()) -> Plan:
    """Return a plan that stands until a step, and then continues the present one.

    A random walk isn't continued: the behavior is asked again.

    Args:
        now: The situation.
        interrupted: The present plan.
        step: The step until which the body stands.
        notes: Rows for the events table at the stop.
    """
    begin_us = now.step * interrupted.step_us
    plan = now.plan().stay_until(step * interrupted.step_us)
    motion = interrupted.finish()
    plan.notes += notes
    if isinstance(motion, Track):
        first = int(np.searchsorted(motion.breakpoints.time, begin_us, side="right"))
        return _continue(plan, interrupted, begin_us, begin_us, _rows(motion.breakpoints)[first:])
    return plan


def yielder(actor: Actor, beat_us: int = 1) -> Yielder:
    """Return the ways of a body that gives way, for the core.

    Args:
        actor: The body.
        beat_us: A late body leaves a stop at a multiple of this time [us].
    """
    space = actor.space
    drives_plainly = actor.drive is None and not actor.slows
    is_plain = drives_plainly and actor.step_off(*actor.state.position) is None
    routes = space.shortest if is_plain else None
    walk = partial(_way, actor)
    return Yielder(actor.row, space.mesh, routes, actor.speed, actor.turn_rate, beat_us, walk)


def _way(
    actor: Actor, time_us: int, x: int, y: int, heading: int, to_x: int, to_y: int, discs: I64
) -> I64 | None:
    """Return the breakpoints of a way by the drive, or from the border of the space, or None."""
    route = None
    if len(discs):
        route = RoutesAround(actor, discs)((x, y), (to_x, to_y))
        if route is None:
            return None
    plan = Plan(actor, time_us // actor.clock.step_us)
    plan.end = time_us, x, y, heading, 0
    plan.legs = Legs()
    try:
        return plan.go_to_point(to_x, to_y, route=route).legs.rows()
    except NoWayError:
        return None


def plan_along(now: Situation, interrupted: Plan, continued: Continued) -> Plan:
    """Return the plan that the core found, which continues the present one later."""
    legs, end, delays = continued
    plan = now.plan().take("stand").go_on_along(legs, end)
    if not interrupted.is_random_walk:
        _take_over(plan, interrupted, delays)
    return plan


def plan_around(
    now: Situation,
    interrupted: Plan,
    timelines: Timelines,
    bodies: I64,
    met_at: int | None = None,
    waits_for: LatticePoint | None = None,
    beat_us: int = 1,
) -> Plan | None:
    """Return the rest of the present plan, by a way round other bodies to its next stop.

    If another body stands at that stop, this one stops beside it in the room. A body on a random
    walk turns round, and its behavior is asked again.

    Args:
        now: The situation.
        interrupted: The present plan.
        timelines: The ways of all bodies.
        bodies: x and y of other bodies, and the distance to keep [lattice], int64 (n, 3).
        met_at: The step in which the other bodies are in the way; left out: now.
        waits_for: A place beside which the body doesn't stop: its charger.
        beat_us: See `yielder`.

    Returns:
        The plan; None if there is no way round.
    """
    actor = now.actor
    if interrupted.is_random_walk:
        return now.plan().turn_by(0.5)

    def free_place(x: int, y: int) -> LatticePoint | None:
        if (x, y) == waits_for or interrupted.postures:
            return None
        return beside(actor, (x, y), RoutesAround(actor, bodies))

    met_us = (now.step if met_at is None else met_at + 1) * interrupted.step_us
    body = yielder(actor, beat_us)
    continued = timelines.way_round(body, now.step, met_us, bodies, free_place)
    return None if continued is None else plan_along(now, interrupted, continued)


def plan_here(
    now: Situation, interrupted: Plan, timelines: Timelines, met_at: int, beat_us: int
) -> Plan | None:
    """Return the rest of the present plan, with its next stop where the body is.

    Args:
        now: The situation.
        interrupted: The present plan.
        timelines: The ways of all bodies.
        met_at: The step in which somebody stands in the way to that stop.
        beat_us: See `yielder`.

    Returns:
        The plan; None if that stop is in another room.
    """
    if interrupted.is_random_walk:
        return None
    home = now.actor.home.plan
    room = home.room_of_point(*now.actor.state.position)

    def is_here(x: int, y: int) -> bool:
        return home.room_of_point(x, y) == room

    met_us = (met_at + 1) * interrupted.step_us
    body = yielder(now.actor, beat_us)
    continued = timelines.way_from_here(body, now.step, met_us, is_here)
    return None if continued is None else plan_along(now, interrupted, continued)


def _continue(
    plan: Plan, interrupted: Plan, begin_us: int, since_us: int, rest: I64, *, hurries: bool = True
) -> Plan:
    """Continue a plan with the part of another one after a moment, delayed, and return it.

    Notes planned before that moment are written at it.

    Args:
        plan: A plan that ends where the other one is at that moment; the delay is from that moment
            to its end.
        interrupted: The other plan.
        begin_us: The moment up to which the other plan was followed; its later rows are copied.
        since_us: The moment.
        rest: The breakpoints of the other plan after the moment, int64 (n, 5); they are delayed.
        hurries: Whether the first rest that is long enough is shortened by the delay, so that the
            body is on time again after it.
    """
    later = plan.time_us - since_us
    row = np.array([[since_us, *plan.end[1:]]], np.int64)
    rows = np.concatenate([row, rest])
    stands = (rows[1:, 1:] == rows[:-1, 1:]).all(axis=1)
    is_long_rest = stands & (np.diff(rows[:, 0]) >= later)
    last = np.argmax(is_long_rest) if hurries and is_long_rest.any() else -1
    edge = int(rows[last, 0])
    times = rest[:, 0]
    rest[:, 0] = np.where(times <= edge, times + later, np.maximum(times, edge + later))
    plan.follow(rest)
    return _take_over(plan, interrupted, [(begin_us, since_us, later, edge)])


def _take_over(plan: Plan, interrupted: Plan, delays: Sequence[tuple[int, int, int, int]]) -> Plan:
    """Let a plan take over the notes and postures of another one, delayed, and return it."""
    after_us = delays[0][0]
    if interrupted.postures or any(note.time_us > after_us for note in interrupted.notes):
        _repeat_later(plan, interrupted, [Delay(*delay) for delay in delays])
    if interrupted.postures:
        plan.posture = interrupted.posture
    plan.endless = interrupted.endless
    plan.asks_us = interrupted.asks_us
    plan.root = interrupted.root
    return plan


def _repeat_later(plan: Plan, interrupted: Plan, delays: Sequence[Delay]) -> None:
    """Add the notes and the postures of another plan, delayed."""
    ends = [*(delay.after_us for delay in delays[1:]), math.inf]
    for delay, until in zip(delays, ends, strict=True):
        plan.notes += [
            Note(delay.of(at), event, detail)
            for at, event, detail in interrupted.notes
            if delay.after_us < at <= until
        ]
        plan.postures += [
            (delay.of(at), code)
            for at, code in interrupted.postures
            if delay.after_us < at <= until
        ]


def _rows(track: Breakpoints) -> I64:
    """Return breakpoints as rows of time, x, y, heading and away, int64 (n, 5)."""
    return np.stack([column.astype(np.int64) for column in track], axis=-1)


def beside(
    actor: Actor, goal: LatticePoint, detour: RoutesAround, *, in_room: bool = True
) -> LatticePoint | None:
    """Return a free place nearest to an occupied one, in its room; None if there is none.

    Of several places about as near, take the one nearest to the body.
    """
    plan = actor.home.plan
    room = int(plan.room_of_cell[goal[1] // SUB, goal[0] // SUB]) if in_room else ANY_ROOM
    return kernels.place_beside(
        actor.space.part_of_cell,
        actor.part,
        plan.room_of_cell,
        room,
        goal,
        actor.state.position,
        NEARLY_CELLS * SUB,
        detour.people,
    )
