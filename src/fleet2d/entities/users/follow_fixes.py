"""Plans that follow position fixes: the body is at each fix at the time of the log."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fleet2d.entities.nearest import Nearest
from fleet2d.floorplan.home.space import straight_way
from fleet2d.kernels import F64, I64
from fleet2d.kernels.motion import time_route
from fleet2d.kernels.numbers import TURN, heading_of
from fleet2d.kernels.sight import line_of_sight
from fleet2d.kernels.space import locate

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.plan import Plan


# Coordinates are clipped to this, far outside of any home [m].
FAR = 1e6
# A move shorter than this is ignored for the heading [m].
STIR = 0.1


@dataclass(frozen=True)
class Fixes:
    """Fixes that the body can follow.

    Attributes:
        time_us: Times [us since the start of the run], ascending, int64 (n,).
        xy: Positions, all free and reachable [lattice], int64 (n, 2).
        heading: Headings [1/4096 turn], -1 where the log has none, int64 (n,).
        snapped: The number of fixes that were moved to the nearest free place.
        outside: The number of fixes that were left out, too far from any free place.
    """

    time_us: I64
    xy: I64
    heading: I64
    snapped: int
    outside: int


def place_fixes(actor: "Actor", time_us: I64, xy: F64, turns: F64, reach: float) -> Fixes:
    """Return fixes moved to the nearest place where the body can be.

    Args:
        actor: The body.
        time_us: Times [us since the start of the run], ascending, int64 (n,).
        xy: Positions in the plan [m], float64 (n, 2).
        turns: Headings in the plan [turns], NaN where there is none.
        reach: A fix farther than this from any such place is left out [m].
    """
    lattice, space = actor.home.plan.lattice, actor.space
    size = 1 << 20  # beyond any home, within 64 bits when squared
    points: I64 = np.clip(lattice.to_lattice(np.clip(xy, -FAR, FAR)), -size, size)
    fits = [
        0 <= x < size and 0 <= y < size and space.part_at(x, y) == actor.part
        for x, y in points.tolist()
    ]
    off = np.flatnonzero(~np.array(fits, bool))
    near = Nearest(actor).of(points[off])
    away: I64 = near - points[off]
    far = (away * away).sum(axis=1) > (reach * lattice.units_per_m) ** 2
    points[off] = near
    is_inside = np.ones(len(points), bool)
    is_inside[off[far]] = False
    known = np.isfinite(turns)
    heading = np.full(len(turns), -1, np.int64)
    heading[known] = np.floor(turns[known] * TURN + 0.5).astype(np.int64) % TURN
    outside = int(np.count_nonzero(~is_inside))
    return Fixes(
        time_us[is_inside],
        points[is_inside],
        heading[is_inside],
        snapped=len(off) - outside,
        outside=outside,
    )


class FixFollower:
    """Plans the way through fixes: straight from each to the next if that is free, else around.

    Args:
        actor: The body.
        fixes: Its positions.
        gap_us: Two fixes farther apart in time than this have a gap between them.
        gaps: What happens in a gap: "unknown": the body is away; "hold": it stays, and leaves in
            time for the next fix; "walk": it takes all that time for the way.
        fastest: A leg faster than this is counted as implausible [m/s].
    """

    def __init__(
        self, actor: "Actor", fixes: Fixes, gap_us: int, gaps: str, fastest: float
    ) -> None:
        self.actor = actor
        self.fixes = fixes
        self.gap_us, self.gaps = gap_us, gaps
        self.fastest = fastest * actor.home.plan.lattice.units_per_m
        self.unknown_us = self.gap_count = self.implausible = self.around = 0
        self.top_speed = 0.0
        self.heading = self._headings()

    def follow(self, plan: "Plan") -> "Plan":
        """Fill a plan from its beginning, with a jump to the present fix, to the last fix."""
        time = self.fixes.time_us
        end_us = self.actor.clock.steps * self.actor.clock.step_us
        i = int(np.searchsorted(time, plan.time_us, side="right")) - 1
        if i < 0 or plan.time_us - time[i] > self.gap_us:
            self._vanish(plan, plan.time_us)
        else:
            plan.follow(self._row(i, plan.time_us))
        for j in range(i + 1, len(time)):
            if time[j] >= end_us:
                break
            if plan.away:
                self._appear(plan, j)
            elif time[j] - time[j - 1] <= self.gap_us:
                self._leg(plan, j - 1, j, plan.time_us)
            elif self.gaps == "unknown":
                self._vanish(plan, plan.time_us + 1)  # at the fix itself it is known
                self.gap_count += 1
                self.unknown_us += int(time[j] - time[j - 1])
                self._appear(plan, j)
            else:
                leave = plan.time_us
                if self.gaps == "hold":
                    leave = max(leave, int(time[j]) - self._takes(j - 1, j))
                self._leg(plan, j - 1, j, leave)
        if len(time) and not plan.away and end_us - plan.time_us > self.gap_us:
            self._vanish(plan, plan.time_us + 1)
        return plan.stay()

    def _headings(self) -> I64:
        """Return the heading at each fix: the log's, else the direction to the next fix."""
        xy, heading = self.fixes.xy, self.fixes.heading.copy()
        stir = STIR * self.actor.home.plan.lattice.units_per_m
        last = 0
        moves = np.diff(xy, axis=0, append=xy[-1:])
        for i, (dx, dy) in enumerate(moves.tolist()):
            if heading[i] < 0:
                has_moved = dx * dx + dy * dy >= stir * stir
                heading[i] = heading_of(dx, dy) if has_moved else last
            last = int(heading[i])
        return heading

    def _row(self, i: int, at_us: int) -> I64:
        """Return a breakpoint at a fix, int64 (1, 5)."""
        x, y = self.fixes.xy[i].tolist()
        return np.array([[at_us, x, y, self.heading[i], 0]], np.int64)

    def _vanish(self, plan: "Plan", at_us: int) -> None:
        """Make the body's position unknown: it is away, without having walked out."""
        plan.jump(at_us, away=1).note("unknown")

    def _appear(self, plan: "Plan", i: int) -> None:
        x, y = self.fixes.xy[i].tolist()
        at_us, heading = int(self.fixes.time_us[i]), int(self.heading[i])
        plan.jump(at_us, x=x, y=y, heading=heading, away=0).note("known")

    def _route(self, i: int, j: int) -> I64:
        """Return the route from a fix to another, straight if that is free; int64 (n, 2)."""
        (ax, ay), (bx, by) = self.fixes.xy[i].tolist(), self.fixes.xy[j].tolist()
        space = self.actor.space
        straight = straight_way((ax, ay), (bx, by))
        if (ax, ay) == (bx, by):
            return straight
        if line_of_sight(space.mesh, ax, ay, locate(space.mesh, ax, ay), bx, by):
            return straight
        route = space.route((ax, ay), (bx, by))
        return straight if route is None else route

    def _takes(self, i: int, j: int) -> int:
        """Return how long the body takes from one fix to another [us]."""
        route, heading = self._route(i, j), int(self.heading[i])
        rows = time_route(route, 0, heading, self.actor.speed, self.actor.turn_rate)
        return int(rows[-1, 0])

    def _leg(self, plan: "Plan", i: int, j: int, leave_us: int) -> None:
        """Go from fix i, from a moment on, to fix j, at a constant speed."""
        route = self._route(i, j)
        arrive_us = int(self.fixes.time_us[j])
        moves = np.diff(route, axis=0)
        lengths = np.sqrt((moves * moves).sum(axis=1).astype(np.float64))
        total = float(lengths.sum())
        speed = total * 1e6 / max(arrive_us - leave_us, 1)
        self.top_speed = max(self.top_speed, speed)
        self.implausible += speed > self.fastest
        self.around += len(route) > 2
        rows = []
        if leave_us > plan.time_us:
            rows.append([leave_us, plan.x, plan.y, plan.heading, 0])
        done = 0.0
        for (x, y), length, (dx, dy) in zip(
            route[1:-1].tolist(), lengths[:-1].tolist(), moves[1:].tolist(), strict=True
        ):
            done += length
            at_us = leave_us + int((arrive_us - leave_us) * (done / total))
            rows.append([at_us, x, y, int(heading_of(dx, dy)), 0])
        last = self._row(j, arrive_us)
        plan.follow(np.concatenate([np.array(rows, np.int64).reshape(-1, 5), last]))
