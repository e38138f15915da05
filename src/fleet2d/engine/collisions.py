"""Collisions: bodies that are about to walk or drive into another one, step by step.

Collisions follow from the poses alone, and the moving body decides at that step, before it moves,
so results don't depend on spans. Bodies that block each other wait, go round or squeeze past: a
body is in the way if another moves towards it so that they would overlap before the next step.
Robots that give way keep clear of people: a person is in the way if the next move would bring the
robot nearer and within its distance or, for a robot that goes round people, if the bodies would
touch.
"""

from collections.abc import Callable, Sequence
from datetime import timedelta
from functools import partial
from typing import NamedTuple

import numpy as np

from fleet2d.configuration.units import micros
from fleet2d.engine.basis import Basis, Watcher
from fleet2d.entities.behavior import Situation
from fleet2d.entities.body import Bodies, poses_of
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.entity import Robot
from fleet2d.entities.giving_way import TOUCHING_GAP_M, Surroundings, plan_after, plan_around
from fleet2d.entities.plan import Note, Plan
from fleet2d.kernels import I64, U8, Bool, Poses, line_of_sight
from fleet2d.runtime.events import EventKind

# Time for which a body ignores another one that it goes round or squeezes past.
PASSING_TIME = timedelta(seconds=10)


class Wait(NamedTuple):
    """A wait of one body for another.

    Attributes:
        since: The step at which it began to wait.
        until: The step before which it stands, by its last decision.
        blocker: The row of the body in its way.
    """

    since: int = -1
    until: int = -1
    blocker: int = -1


class Pass(NamedTuple):
    """A body that has waited for another one goes round it, or squeezes past.

    Attributes:
        until: The step before which it ignores the other one.
        blocker: The row of the other one.
    """

    until: int = -1
    blocker: int = -1


Places = tuple[I64, I64, I64 | U8]
"""x and y of bodies at consecutive steps, and whether they are away: (bodies, steps) each."""


class BlockedWays(Watcher):
    """The watcher of bodies that block each other's way, which steers all of them."""

    def __init__(self, basis: Basis) -> None:
        """Track bodies if `simulation.people_block` sets a time of waiting."""
        self._actors = basis.actors
        self._users = basis.bodies.users
        patience = basis.scenario.simulation.people_block
        self._patience_us = 0 if patience is None else micros(patience)
        self._radii = np.array([actor.entity.radius for actor in self._actors])
        self._waits = [Wait()] * len(self._actors)
        self._passes = [Pass()] * len(self._actors)
        # Robots yield anyway, unless bodies are ghosts to each other.
        steered = len(self._actors) if basis.scenario.simulation.ghosts else self._users
        self.steered = range(0 if patience is None else steered)

    @property
    def is_needed(self) -> bool:
        """Whether bodies block each other."""
        return bool(self.steered)

    waits = is_needed

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step after the span's first at which a body has to decide, or `end`."""
        first = self.next_step
        block = bodies.block(first, end + 1)  # a move leads to the step after
        places = block.x, block.y, block.away
        for row in self.steered:
            meeting = self._first_meeting(places, row, first, np.arange(1, end - first))
            end = end if meeting is None else first + meeting[0]
        return end

    def in_way(self, bodies: Bodies, row: int) -> int | None:
        """Return the row of the body into which a body would walk next; None if its way is free."""
        step = bodies.step
        if bodies.pose_at(row, step)[:2] == bodies.pose_at(row, step + 1)[:2]:
            return None  # mostly the body rests
        x, y, _, away = bodies.poses(np.array([step, step + 1])).T
        meeting = self._first_meeting((x, y, away), row, step, np.array([0]))
        return None if meeting is None else meeting[1]

    def evasion(self, bodies: Bodies, now: Situation) -> Callable[[], None] | None:
        """Let a body wait for another one in its way, or go round it."""
        row = now.actor.row
        if (other := self.in_way(bodies, row)) is None:
            return None
        if (plan := self.plan(bodies, now, other)) is None:
            return None
        return partial(self._actors[row].follow_instead, plan, now)

    def plan(self, bodies: Bodies, now: Situation, other: int) -> Plan | None:
        """Return a plan to wait for another body, or to go round it; None to squeeze past."""
        row = now.actor.row
        lattice = now.actor.home.lattice
        actor = self._actors[row]
        step = now.step
        step_us = actor.clock.step_us
        wait = self._waits[row]
        since = wait.since if wait.until == step else step
        # Of two bodies that wait for each other, the later one in the scenario waits twice as long.
        is_later = other < row and self._avoids(other, row, step)
        patience_us = self._patience_us * (2 if is_later else 1)
        if (step - since) * step_us < patience_us:
            notes = []
            if since == step:
                notes = [Note(step * step_us, EventKind.GIVES_WAY, self._actors[other].name)]
            plan: Plan | None = plan_after(now, actor.plan, step + 1, notes)
            self._waits[row] = Wait(since, step + 1, other)
        else:
            present = [other for other in self._actors if not other.state.away]
            others = [other for other in present if other.row != row]
            reach = self._reach(row, np.array([other.row for other in others], np.int64))
            cell = int(lattice.cell * lattice.units_per_m)
            points = [other.state.position for other in others]
            positions = np.array(points, np.int64).reshape(-1, 2)
            clear = np.column_stack([positions, reach + cell])
            plan = plan_around(now, actor.plan, bodies.timelines, clear)
            until = step + micros(PASSING_TIME) // step_us + 1
            self._waits[row] = Wait()
            self._passes[row] = Pass(until, other)
        if plan is not None:
            plan.interrupts = actor.arbiter.own
        return plan

    def _avoids(self, row: int, other: int, step: int) -> bool:
        """Whether a body waits for another one at a step, or is about to pass it."""
        pairs = (self._waits[row], self._passes[row])
        return any(pair.blocker == other and pair.until > step for pair in pairs)

    def _first_meeting(
        self, places: Places, row: int, first: int, columns: I64
    ) -> tuple[int, int] | None:
        """Return the first of some columns at which a body is blocked, and the blocker's row."""
        x, y, away = places
        after = columns + 1
        has_moved = (x[row, after] != x[row, columns]) | (y[row, after] != y[row, columns])
        is_home = (away[row, columns] | away[row, after]) == 0
        moves = columns[has_moved & is_home]
        # `gives_way` already keeps a robot clear of people.
        polite = getattr(self._actors[row].entity, "gives_way", None) is not None
        others = np.arange(self._users if polite else 0, len(self._actors))
        others = others[others != row]
        if not len(moves) or not len(others):
            return None
        others = others[:, None]
        reach = self._reach(row, others)
        met = _approach(x, y, row, others, moves, reach)
        met &= (away[others, moves] | away[others, moves + 1]) == 0
        passed = self._passes[row]
        met &= (others != passed.blocker) | (first + moves >= passed.until)
        blocked = met.any(axis=0)
        if not blocked.any():
            return None
        at = int(blocked.argmax())
        return int(moves[at]), int(others[met[:, at].argmax(), 0])

    def _reach(self, row: int, others: I64) -> I64:
        """Return the distances at which a body touches others [lattice units], int64 (n,)."""
        units_per_m = self._actors[row].home.lattice.units_per_m
        reach_m = self._radii[row] + self._radii[others]
        return (reach_m * units_per_m).astype(np.int64)


def _approach(x: I64, y: I64, row: int, others: I64, columns: I64, reach: I64) -> Bool:
    """Return in which columns a body moves towards others so that they would overlap.

    All bodies move straight from one step to the next. Sums and products of integers are exact if
    no body moves farther than about 100 m in a step.

    Args:
        x: int64 (bodies, steps).
        y: int64 (bodies, steps).
        row: Row of the body.
        others: Rows of the others, int64 (n, 1).
        columns: int64 (m,).
        reach: Distances at which the body touches them [lattice units], int64 (n, 1).

    Returns:
        bool (n, m).
    """
    after = columns + 1
    dx = x[row, after] - x[row, columns]
    dy = y[row, after] - y[row, columns]
    away_x = x[others, columns] - x[row, columns]
    away_y = y[others, columns] - y[row, columns]
    vx = dx - (x[others, after] - x[others, columns])
    vy = dy - (y[others, after] - y[others, columns])
    way = vx * vx + vy * vy
    towards = away_x * vx + away_y * vy
    near = reach * reach
    ends = (away_x - vx) ** 2 + (away_y - vy) ** 2 < near
    beside = (away_x * vy - away_y * vx).astype(np.float64)
    passes = beside * beside < near.astype(np.float64) * way.astype(np.float64)
    nearer = (towards > 0) & (away_x * dx + away_y * dy > 0)
    return nearer & np.where(towards < way, passes, ends)


class Clearance(Watcher):
    """Ends the plan of a robot that gives way when a person comes too near or goes away.

    Attributes:
        robots: The robots that give way, by their rows among the bodies.
    """

    def __init__(self, users: Sequence[DecidingActor], robots: Sequence[DecidingActor]) -> None:
        self._users = users
        polite = [r for r in robots if getattr(r.entity, "gives_way", None) is not None]
        self.robots = {robot.row: robot for robot in polite if users}
        self.steered = list(self.robots)

    @property
    def is_needed(self) -> bool:
        """Whether any robot gives way."""
        return bool(self.robots)

    waits = is_needed

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step after the span's first at which a robot has to decide, or `end`."""
        first = self.next_step
        block = bodies.block(first, end + 1)  # a move leads to the step after
        people = slice(0, len(self._users))
        places = block.x[people], block.y[people], block.away[people]
        for row, robot in self.robots.items():
            meeting = self._first_hit(robot, poses_of(block, row), places, first, begin=1)
            if meeting is not None:
                end = min(end, first + meeting[0])
            end = min(end, self._next_look(robot, places, first, end))
        return end

    def _next_look(self, robot: DecidingActor, people: Places, first: int, end: int) -> int:
        """Return the step at which a waiting robot checks whether its way is clear."""
        waiting = robot.waiting
        if waiting is None:
            return end
        x, y, was_away = waiting.surroundings.users.T[:, :, None]
        xs, ys, away = people
        has_changed = ((xs != x) | (ys != y) | (away != was_away)).any(axis=0)
        has_changed |= waiting.surroundings.arrangement != robot.arrangement
        column = int(has_changed.argmax())
        return waiting.look_from(max(first + column, first + 1)) if has_changed[column] else end

    def looks(self, row: int, step: int) -> bool:
        """Whether a waiting robot checks its way at a step, because a person has moved."""
        waiting = self.robots[row].waiting if row in self.robots else None
        if waiting is None or waiting.look_from(step) != step:
            return False
        return not waiting.surroundings.is_unchanged_since(self.surroundings(self.robots[row]))

    def evasion(self, bodies: Bodies, now: Situation) -> Callable[[], None] | None:
        """Let a robot give way to the person at whom it would drive next."""
        row = now.actor.row
        if (person := self.in_way(bodies, row)) is None:
            return None
        robot = self.robots[row]
        return partial(robot.give_way, now, person.name, self.surroundings(robot))

    def in_way(self, bodies: Bodies, row: int) -> DecidingActor | None:
        """Return the person at whom a robot would drive next, if people stay where they are."""
        robot = self.robots.get(row)
        if robot is None:
            return None
        step = bodies.step
        now = bodies.pose_at(row, step)
        then = bodies.pose_at(row, step + 1)
        if now.position == then.position:
            return None
        poses = Poses(*np.array([now, then]).T)
        states = np.array([user.state for user in self._users], np.int64)
        x, y, _, away = np.repeat(states[:, :, None], 2, axis=2).swapaxes(0, 1)
        meeting = self._first_hit(robot, poses, (x, y, away), step, begin=0)
        return None if meeting is None else self._users[meeting[1]]

    def surroundings(self, robot: DecidingActor) -> Surroundings:
        """Return the present places of people."""
        units = robot.home.lattice.units_per_m
        present = []
        everybody = []
        for user in self._users:
            x, y, _, away = user.state
            everybody.append((x, y, away))
            if not away:
                gap_m = user.entity.radius + robot.entity.radius
                present.append((x, y, int(gap_m * units)))
        people = np.array(present, np.int64).reshape(-1, 3)
        return Surroundings(people, np.array(everybody, np.int64), robot.arrangement)

    def _first_hit(
        self, robot: DecidingActor, poses: Poses, people: Places, first: int, begin: int
    ) -> tuple[int, int] | None:
        """Return the first column from `begin` on at which a robot drives at a user, and which."""
        assert isinstance(robot.entity, Robot)
        assert robot.entity.gives_way is not None
        xs, ys, away = people
        x = poses.x
        y = poses.y
        moves = np.flatnonzero((x[1:] != x[:-1]) | (y[1:] != y[:-1]))
        moves = moves[moves >= begin]
        if not len(moves):  # mostly the robot stands
            return None
        units = robot.home.lattice.units_per_m
        first_meeting: tuple[int, int] | None = None
        now_x = x[moves]
        now_y = y[moves]
        next_x = x[moves + 1]
        next_y = y[moves + 1]
        passes = first + moves < robot.passes_until
        polite_gap = robot.entity.gives_way.distance
        gap = np.where(passes, TOUCHING_GAP_M, polite_gap)
        for number, user in enumerate(self._users):
            clearance = user.entity.radius + robot.entity.radius + gap
            user_x = xs[number, moves]
            user_y = ys[number, moves]
            distance = (now_x - user_x) ** 2 + (now_y - user_y) ** 2
            next_distance = (next_x - user_x) ** 2 + (next_y - user_y) ** 2
            is_close = (next_distance <= (clearance * units) ** 2) & (next_distance < distance)
            is_close &= (away[number, moves] | poses.away[moves]) == 0
            for move in np.flatnonzero(is_close).tolist():
                column = int(moves[move])
                if first_meeting is not None and column >= first_meeting[0]:
                    break
                sight = now_x[move], now_y[move], user_x[move], user_y[move]
                if line_of_sight(robot.home.barriers, *map(int, sight)):
                    first_meeting = column, number
                    break
        return first_meeting
