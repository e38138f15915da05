"""Blocked bodies: plans to wait for another body, and to go round it."""

from collections.abc import Sequence

import numpy as np

from fleet2d.entities.actor import Actor
from fleet2d.entities.behavior import Situation
from fleet2d.entities.giving_way import RoutesAround
from fleet2d.entities.motion import Track
from fleet2d.entities.plan import Note, Plan
from fleet2d.entities.resume import heading_at, next_stop
from fleet2d.floorplan.home.costmap import CLOSED
from fleet2d.kernels import I64
from fleet2d.kernels.motion import Breakpoints
from fleet2d.kernels.numbers import TURN, turn_between
from fleet2d.kernels.space import SUB


def plan_after_a_step(now: Situation, interrupted: Plan, notes: Sequence[Note] = ()) -> Plan:
    """Return a plan that stands for a step, and then continues the present one.

    A random walk isn't continued: the behavior is asked again.

    Args:
        now: The situation.
        interrupted: The present plan.
        notes: Rows for the events table at the stop.
    """
    begin_us, step_us = now.step * interrupted.step_us, interrupted.step_us
    plan, motion = now.plan().stay_until(begin_us + step_us), interrupted.finish()
    plan.notes += notes
    if isinstance(motion, Track):
        first = int(np.searchsorted(motion.breakpoints.time, begin_us, side="right"))
        _continue(plan, interrupted, begin_us, begin_us, _rows(motion.breakpoints)[first:])
    return plan


def plan_around(now: Situation, interrupted: Plan, bodies: I64) -> Plan | None:
    """Return the rest of the present plan, by a way round other bodies to its next stop.

    If a body stands at that stop, and it is the last one, it stops beside it in the room. A body on
    a random walk turns round, and its behavior is asked again.

    Args:
        now: The situation.
        interrupted: The present plan.
        bodies: x and y of other bodies, and the distance to keep [lattice], int64 (n, 3).

    Returns:
        The plan; None if there is no way round.
    """
    motion, actor, begin_us = interrupted.finish(), now.actor, now.step * interrupted.step_us
    if not isinstance(motion, Track):
        return now.plan().turn_by(0.5)
    stop = next_stop(actor, motion.breakpoints, begin_us)
    if stop is None:
        return None
    rows, detour = _rows(motion.breakpoints), RoutesAround(actor, bodies)
    goal, rest = (int(rows[stop, 1]), int(rows[stop, 2])), rows[stop + 1 :]
    if detour.cost[goal[1] // SUB, goal[0] // SUB] < 0:
        if (rest[:, 1:3] != rows[stop, 1:3]).any() or rest[:, 4].any() or interrupted.postures:
            return None
        beside = _beside(actor, goal, detour)
        if beside is None:
            return None
        goal = beside
        rest = rest.copy()
        rest[:, 1:3] = goal
    plan = now.plan()
    route = detour((plan.x, plan.y), goal)
    if route is None:
        return None
    since_us = max(int(rows[stop, 0]), begin_us)
    plan.go_to_point(*goal, route=route)
    heading = heading_at(motion.breakpoints, stop, since_us)
    plan.turn_by(turn_between(plan.heading, heading) / TURN)
    _continue(plan.stay_until(since_us), interrupted, begin_us, since_us, rest)
    return plan


def _continue(plan: Plan, interrupted: Plan, begin_us: int, since_us: int, rest: I64) -> None:
    """Continue a plan with the part of another one after a moment, delayed.

    The first rest that is long enough is shortened by the delay, so that the body is on time again
    after it.

    Args:
        plan: A plan that ends where the other one is at that moment; the delay is from that moment
            to its end.
        interrupted: The other plan.
        begin_us: The moment up to which the other plan was followed; its later rows are copied.
        since_us: The moment.
        rest: The breakpoints of the other plan after the moment, int64 (n, 5).
    """
    later = plan.time_us - since_us
    row = np.array([[since_us, plan.x, plan.y, plan.heading, plan.away]], np.int64)
    rows = np.concatenate([row, rest])
    rests = (rows[1:, 1:] == rows[:-1, 1:]).all(axis=1) & (np.diff(rows[:, 0]) >= later)
    edge = int(rows[np.argmax(rests), 0]) if rests.any() else int(rows[-1, 0])

    def delayed(time_us: int) -> int:
        return time_us + later if time_us <= edge else max(time_us, edge + later)

    times, shifted = rest[:, 0], rest.copy()
    shifted[:, 0] = np.where(times <= edge, times + later, np.maximum(times, edge + later))
    plan.notes += [
        Note(delayed(max(note.time_us, since_us)), note.event, note.detail)
        for note in interrupted.notes
        if note.time_us > begin_us
    ]
    plan.postures += [
        (delayed(max(time_us, since_us)), code)
        for time_us, code in interrupted.postures
        if time_us > begin_us
    ]
    plan.posture = interrupted.posture
    plan.follow(shifted).endless = interrupted.endless
    plan.asks_us, plan.root = interrupted.asks_us, interrupted.root


def _rows(track: Breakpoints) -> I64:
    """Return breakpoints as rows of time, x, y, heading and away, int64 (n, 5)."""
    return np.stack([column.astype(np.int64) for column in track], axis=-1)


def _beside(actor: Actor, goal: tuple[int, int], detour: RoutesAround) -> tuple[int, int] | None:
    """Return the free place nearest to an occupied one, in its room; None if there is none."""
    plan, space = actor.home.plan, actor.space
    room = plan.room_of_cell[goal[1] // SUB, goal[0] // SUB]
    free = (space.part_of_cell == actor.part) & (detour.cost != CLOSED)
    cells = np.argwhere(free & (plan.room_of_cell == room))
    if not len(cells):
        return None
    xs, ys = plan.lattice.centre_axes()
    away = (xs[cells[:, 1]] - goal[0]) ** 2 + (ys[cells[:, 0]] - goal[1]) ** 2
    row, column = cells[int(np.argmin(away))].tolist()
    return plan.lattice.cell_centre(row, column)
