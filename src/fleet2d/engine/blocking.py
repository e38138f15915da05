"""Blocking: the bodies that are about to walk into another one, step by step.

It follows from the poses alone. A body is in another one's way at a step if that one moves towards
it, and they would overlap before the next step. The body that moves decides at that step, before it
moves, so the result doesn't depend on spans.
"""

from collections.abc import Iterable, Iterator, Sequence
from datetime import timedelta
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.engine.bodies import Bodies
from fleet2d.entities.behavior import SightEvent, Situation
from fleet2d.entities.blocking import plan_after_a_step, plan_around
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.plan import Note, Plan
from fleet2d.events import Event
from fleet2d.units import micros

# Time for which a body ignores another one that it goes round or squeezes past.
PASSES = timedelta(seconds=10)

I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]


class Wait(NamedTuple):
    """A body waits for another one.

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


class PoseColumns(NamedTuple):
    """Places of bodies at consecutive steps, (bodies, steps) each."""

    x: I64
    y: I64
    away: NDArray[np.uint8]


class Blocking:
    """The bodies of a run that block each other's way.

    Attributes:
        rows: Their rows among the bodies; empty if bodies don't block each other.
    """

    def __init__(
        self,
        users: Sequence[DecidingActor],
        robots: Sequence[DecidingActor],
        patience: timedelta | None,
    ) -> None:
        self.next_step = 0
        self._actors, self._users = [*users, *robots], len(users)
        self._patience_us = 0 if patience is None else micros(patience)
        self._waits = [Wait()] * len(self._actors)
        self._passes = [Pass()] * len(self._actors)
        self.rows = range(0 if patience is None else len(self._actors))

    @property
    def waits(self) -> bool:
        """Whether bodies block each other."""
        return len(self.rows) > 0

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step at which a body has to decide: not the first of the span."""
        first = self.next_step
        block = bodies.block(first, end + 1)  # a move leads to the step after
        poses = PoseColumns(block.x, block.y, block.away)
        for row in self.rows:
            columns = np.arange(1, end - first)
            for column, _ in self._meetings(poses, row, first, columns):
                end = first + column
        return end

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Advance to a step."""
        self.next_step = end
        return ()

    def interruptions(self, events: Sequence[Event]) -> Iterable[tuple[int, SightEvent]]:
        """Return nothing: it is checked at every decision."""
        return ()

    def in_way(self, bodies: Bodies, row: int) -> int | None:
        """Return the row of the body into which one would walk next; None if its way is free."""
        step = bodies.step
        if bodies.pose_at(row, step)[:2] == bodies.pose_at(row, step + 1)[:2]:
            return None  # mostly it rests
        (x, y, _, away), (next_x, next_y, _, next_away) = bodies.poses(step), bodies.poses(step + 1)
        poses = PoseColumns(
            np.stack([x, next_x], axis=1),
            np.stack([y, next_y], axis=1),
            np.stack([away, next_away], axis=1),
        )
        return next((other for _, other in self._meetings(poses, row, step, np.array([0]))), None)

    def plan(self, now: Situation, other: int) -> Plan | None:
        """Return a plan to wait for another body, or to go round it; None to squeeze past."""
        row, lattice = now.actor.row, now.actor.home.plan.lattice
        actor = self._actors[row]
        around = [
            (a.state.x, a.state.y, int(self._reach(row, r) + lattice.cell * lattice.units_per_m))
            for r, a in enumerate(self._actors)
            if r != row and not a.state.away
        ]
        clear = np.array(around, np.int64)
        step, step_us, wait = now.step, actor.clock.step_us, self._waits[row]
        since = wait.since if wait.until == step else step
        # Of two who wait for each other, the later one in the scenario waits twice as long.
        patience_us = self._patience_us * (
            2 if other < row and self._minds(other, row, step) else 1
        )
        if (step - since) * step_us < patience_us:
            first = since == step
            notes = [Note(step * step_us, "gives_way", self._actors[other].name)] if first else []
            plan: Plan | None = plan_after_a_step(now, actor.plan, notes)
            self._waits[row] = Wait(since, step + 1, other)
        else:
            plan = plan_around(now, actor.plan, clear)
            until = step + micros(PASSES) // step_us + 1
            self._waits[row] = Wait()
            self._passes[row] = Pass(until, other)
        if plan is not None:
            plan.interrupts = actor.arbiter.own
        return plan

    def _minds(self, row: int, other: int, step: int) -> bool:
        """Whether a body waits for another one at a step, or is about to pass it."""
        pairs = (self._waits[row], self._passes[row])
        return any(pair.blocker == other and pair.until > step for pair in pairs)

    def _meetings(
        self, poses: PoseColumns, row: int, first: int, columns: I64
    ) -> Iterator[tuple[int, int]]:
        """Yield for each other body the first column at which it blocks a body, and its row.

        Only columns earlier than all before are yielded.
        """
        x, y, away = poses
        dx, dy = (c[row, columns + 1] - c[row, columns] for c in (x, y))
        home = (away[row, columns] | away[row, columns + 1]) == 0
        moves = columns[((dx != 0) | (dy != 0)) & home]
        for other in self._heeded(row):
            if not len(moves):
                return
            overlaps = _approach(x, y, row, other, moves, self._reach(row, other))
            overlaps &= (away[other, moves] | away[other, moves + 1]) == 0
            for column in moves[overlaps].tolist():
                if not self._is_past(row, other, first + column):
                    moves = moves[moves < column]
                    yield column, other
                    break

    def _heeded(self, row: int) -> Iterable[int]:
        """Return the rows that a body waits for; a robot with `gives_way` skips people."""
        polite = getattr(self._actors[row].entity, "gives_way", None) is not None
        return (r for r in range(self._users if polite else 0, len(self._actors)) if r != row)

    def _reach(self, row: int, other: int) -> int:
        """Return the distance at which two bodies touch [lattice units]."""
        radii = (self._actors[r].entity.radius for r in (row, other))
        return int(sum(radii) * self._actors[row].home.plan.lattice.units_per_m)

    def _is_past(self, row: int, other: int, step: int) -> bool:
        """Whether a body passes another one at a step."""
        return self._passes[row].blocker == other and step < self._passes[row].until


def _approach(x: I64, y: I64, row: int, other: int, columns: I64, reach: int) -> Bool:
    """Return in which columns a body moves towards another one so that they would overlap.

    Both move straight from one step to the next. Sums and products of integers are exact if no body
    moves farther than about 100 m in a step.
    """
    dx, dy = (c[row, columns + 1] - c[row, columns] for c in (x, y))
    other_dx, other_dy = (c[other, columns + 1] - c[other, columns] for c in (x, y))
    away_x, away_y = (c[other, columns] - c[row, columns] for c in (x, y))
    vx, vy = dx - other_dx, dy - other_dy
    way, towards = (vx * vx + vy * vy), (away_x * vx + away_y * vy)
    ends = (away_x - vx) ** 2 + (away_y - vy) ** 2 < reach * reach
    beside = (away_x * vy - away_y * vx).astype(np.float64)
    passes = beside * beside < float(reach * reach) * way.astype(np.float64)
    nearer: Bool = (towards > 0) & (away_x * dx + away_y * dy > 0)
    overlaps: Bool = nearer & np.where(towards < way, passes, ends)
    return overlaps
