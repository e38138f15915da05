"""Resuming: the rest of a plan that was interrupted, from wherever the body is by now."""

from collections.abc import Callable

import numpy as np

from fleet2d.entities.body import Body
from fleet2d.entities.motion import Track
from fleet2d.entities.plan import Note, Plan
from fleet2d.errors import NoWayError
from fleet2d.kernels import I64
from fleet2d.kernels.motion import Breakpoints
from fleet2d.kernels.numbers import TURN, turn_between

Detour = Callable[[tuple[int, int], tuple[int, int]], I64 | None]


def resumed(
    body: Body, plan: Plan, interrupted: Plan, step: int, detour: Detour | None = None
) -> Plan | None:
    """Fill a plan with the rest of one that was interrupted.

    The body goes straight to the next place at which it would have stopped. From there on all is as
    it was planned, only later; of a stop that was interrupted, the remaining time.

    Args:
        body: The body.
        plan: An empty plan that begins at the present step.
        interrupted: The plan that was interrupted.
        step: The step at which it was interrupted.
        detour: Returns a route between two lattice points, or None; left out: the shortest route.

    Returns:
        The plan; None if nothing is left to do, or no way leads there at present.
    """
    return _rest(body, plan, interrupted, step * body.clock.step_us, detour)


def without_next_stop(body: Body, plan: Plan, interrupted: Plan, step: int) -> Plan | None:
    """Fill a plan with the rest of one that was interrupted, without its next stop.

    Returns:
        The plan; None if there is no later stop, or no way leads to it at present.
    """
    motion = interrupted.finish()
    if not isinstance(motion, Track):
        return None
    x, y, time = motion.breakpoints.x, motion.breakpoints.y, motion.breakpoints.time
    stop = next_stop(body, motion.breakpoints, step * body.clock.step_us)
    if stop is None:
        return None
    leaves = np.flatnonzero((x[stop:] != x[stop]) | (y[stop:] != y[stop]))
    if not len(leaves):
        return None
    rest = _rest(body, plan, interrupted, int(time[stop + leaves[0]]), None)
    if rest is not None:
        rest.root = rest  # a plan of its own: one stop of the interrupted one is missing
    return rest


def _rest(
    body: Body, plan: Plan, interrupted: Plan, interrupted_us: int, detour: Detour | None
) -> Plan | None:
    """Fill a plan with the part of another one that comes after a moment."""
    motion = interrupted.finish()
    if not isinstance(motion, Track) or interrupted.postures or plan.away:
        return None
    track = motion.breakpoints
    stop = next_stop(body, track, interrupted_us)
    if stop is None or track.away[stop:].any():
        return None
    goes_on_us = max(int(track.time[stop]), interrupted_us)
    goal = int(track.x[stop]), int(track.y[stop])
    route = detour((plan.x, plan.y), goal) if detour else None
    if detour and route is None:
        return None
    try:
        plan.go_to_point(*goal, route=route)
    except NoWayError:
        return None
    plan.turn_by(turn_between(plan.heading, heading_at(track, stop, goes_on_us)) / TURN)
    later = plan.time_us - goes_on_us
    # Rows that were planned for the way there are written on arrival.
    plan.notes += [
        Note(max(n.time_us, goes_on_us) + later, n.event, n.detail)
        for n in interrupted.notes
        if n.time_us > interrupted_us
    ]
    rest = np.stack([column[stop + 1 :].astype(np.int64) for column in track], axis=-1)
    rest[:, 0] += later
    plan.follow(rest).endless = interrupted.endless
    plan.asks_us, plan.root = interrupted.asks_us, interrupted.root
    return plan


def next_stop(body: Body, track: Breakpoints, interrupted_us: int) -> int | None:
    """Return the index of the breakpoint at which the body next stands still; None: no such."""
    x, y, time = track.x, track.y, track.time
    at = max(int(np.searchsorted(time, interrupted_us, side="right")) - 1, 0)
    for i in range(at, len(time) - 1):
        still = x[i] == x[i + 1] and y[i] == y[i + 1] and time[i + 1] > interrupted_us
        # A turn at a corner, on the border of the space, is not a stop.
        if still and body.space.part_at(int(x[i]), int(y[i])) == body.part:
            return i
    return None


def heading_at(track: Breakpoints, stop: int, time_us: int) -> int:
    """Return the heading at a moment between a breakpoint and the next."""
    times, headings = track.time, track.heading
    begin, end = int(times[stop]), int(times[stop + 1])
    turn = int(turn_between(int(headings[stop]), int(headings[stop + 1])))
    return (int(headings[stop]) + turn * (time_us - begin) // max(end - begin, 1)) % TURN
