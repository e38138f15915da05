"""Clearance: the robots that are about to drive at people, step by step.

It follows from the poses alone. A robot that gives way is in a person's way at a step if its next
move would bring it nearer to the person, and within its distance; for a robot that goes round
people, if the bodies would touch. It decides at that step, before it moves, so the result doesn't
depend on spans.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fleet2d.engine.bodies import Bodies, poses_of
from fleet2d.engine.watchers.watcher import Watcher
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.entity import Robot
from fleet2d.entities.giving_way import TOUCHING, Surroundings
from fleet2d.kernels import I64, U8
from fleet2d.kernels.motion import Poses
from fleet2d.kernels.sight import line_of_sight
from fleet2d.kernels.space import locate


class Clearance(Watcher):
    """Ends plans of robots that give way, when a person comes too near or goes away.

    Attributes:
        robots: The robots that give way, by their rows among the bodies.
    """

    def __init__(self, users: Sequence[DecidingActor], robots: Sequence[DecidingActor]) -> None:
        self._users = users
        self.robots = {
            len(users) + i: robot
            for i, robot in enumerate(robots)
            if isinstance(robot.entity, Robot) and robot.entity.gives_way is not None and users
        }

    @property
    def waits(self) -> bool:
        """Whether any robot gives way."""
        return bool(self.robots)

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step at which a robot has to decide: not the first of the span."""
        first = self.next_step
        block = bodies.block(first, end + 1)  # a move leads to the step after
        people = slice(0, len(self._users))
        xs, ys, away = block.x[people], block.y[people], block.away[people]
        for row, robot in self.robots.items():
            meeting = self._first(robot, poses_of(block, row), xs, ys, away, first, begin=1)
            if meeting is not None:
                end = min(end, first + meeting[0])
            end = min(end, self._next_look(robot, xs, ys, away, first, end))
        return end

    def _next_look(
        self, robot: DecidingActor, xs: I64, ys: I64, away: U8, first: int, end: int
    ) -> int:
        """Return the step at which a waiting robot checks whether its way is clear."""
        waiting = robot.waiting
        if waiting is None:
            return end
        x, y, was_away = waiting.surroundings.everybody.T[:, :, None]
        has_changed = ((xs != x) | (ys != y) | (away != was_away)).any(axis=0)
        has_changed |= waiting.surroundings.arrangement != robot.arrangement
        column = int(has_changed.argmax())
        return waiting.look_from(max(first + column, first + 1)) if has_changed[column] else end

    def looks(self, row: int, step: int) -> bool:
        """Whether a waiting robot checks its way at a step, because a person has moved."""
        waiting = self.robots[row].waiting if row in self.robots else None
        if waiting is None or waiting.look_from(step) != step:
            return False
        return not waiting.surroundings.is_as(self.surroundings(self.robots[row]))

    def in_way(self, bodies: Bodies, row: int) -> DecidingActor | None:
        """Return the person at whom a robot would drive next, if people stay where they are."""
        robot = self.robots.get(row)
        if robot is None:
            return None
        step = bodies.step
        columns = zip(bodies.pose_at(row, step), bodies.pose_at(row, step + 1), strict=True)
        poses = Poses(*(np.array(column) for column in columns))
        if poses.x[0] == poses.x[1] and poses.y[0] == poses.y[1]:
            return None
        states = np.array([user.state for user in self._users], np.int64)
        x, y, _, away = np.repeat(states[:, :, None], 2, axis=2).swapaxes(0, 1)
        meeting = self._first(robot, poses, x, y, away, step, begin=0)
        return None if meeting is None else self._users[meeting[1]]

    def surroundings(self, robot: DecidingActor) -> Surroundings:
        """Return the present places of people."""
        units = robot.home.plan.lattice.units_per_m
        rows = [
            (u.state.x, u.state.y, int((u.entity.radius + robot.entity.radius) * units))
            for u in self._users
            if not u.state.away
        ]
        everybody = [(u.state.x, u.state.y, u.state.away) for u in self._users]
        people = np.array(rows, np.int64).reshape(-1, 3)
        return Surroundings(people, np.array(everybody, np.int64), robot.arrangement)

    def _first(
        self,
        robot: DecidingActor,
        poses: Poses,
        xs: I64,
        ys: I64,
        away: NDArray[np.integer],
        first: int,
        begin: int,
    ) -> tuple[int, int] | None:
        """Return the first column, from `begin` to the last but one, and the user it drives at."""
        assert isinstance(robot.entity, Robot)
        assert robot.entity.gives_way is not None
        x, y = poses.x, poses.y
        moves = np.flatnonzero((x[1:] != x[:-1]) | (y[1:] != y[:-1]))
        moves = moves[moves >= begin]
        if not len(moves):  # the usual case: it stands
            return None
        units = robot.home.plan.lattice.units_per_m
        first_meeting: tuple[int, int] | None = None
        now_x, now_y, next_x, next_y = x[moves], y[moves], x[moves + 1], y[moves + 1]
        gap = np.where(
            first + moves < robot.passes_until, TOUCHING, robot.entity.gives_way.distance
        )
        for number, user in enumerate(self._users):
            clearance = user.entity.radius + robot.entity.radius + gap
            user_x, user_y = xs[number, moves], ys[number, moves]
            distance = (now_x - user_x) ** 2 + (now_y - user_y) ** 2
            next_distance = (next_x - user_x) ** 2 + (next_y - user_y) ** 2
            is_close = (next_distance <= (clearance * units) ** 2) & (next_distance < distance)
            is_close &= (away[number, moves] == 0) & (poses.away[moves] == 0)
            for move in np.flatnonzero(is_close).tolist():
                column = int(moves[move])
                if first_meeting is not None and column >= first_meeting[0]:
                    break
                user_place = int(user_x[move]), int(user_y[move])
                if _sees(robot, int(now_x[move]), int(now_y[move]), user_place):
                    first_meeting = column, number
                    break
        return first_meeting


def _sees(robot: DecidingActor, x: int, y: int, place: tuple[int, int]) -> bool:
    walls = robot.home.walls
    return bool(line_of_sight(walls, x, y, locate(walls, x, y), *place))
