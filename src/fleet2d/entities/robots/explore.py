"""Explore: drive to where what was seen borders on what wasn't, until all is seen."""

from datetime import datetime, timedelta
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.component import register
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import check_has_camera
from fleet2d.entities.robots.looking import centres, seen_from, spread
from fleet2d.kernels.fields import squared_distance
from fleet2d.kernels.headings import TURN
from fleet2d.units import Length, Share

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor

# So many places of the home are tried to look round from, and so many cells as what is to be seen.
STANDS_TRIED = 800
TARGETS_TRIED = 2000
# A look that shows no more than this part of the floor isn't worth its way.
WORTH = 0.002
# Where a shut door is in the way of what isn't seen yet, it tries again after so long.
TRIES_AGAIN = timedelta(minutes=1)

Bool = NDArray[np.bool_]


@register("behavior", "explore")
class Explore(Behavior):
    """Complete the layer `explored` of the robot, frontier by frontier.

    A frontier is floor not yet seen beside floor that was (Yamauchi 1997). Of the places no farther
    than `reach` from a frontier, the robot drives to the one from which most floor comes into view
    that isn't seen yet, per second of the way and a turn (González-Baños and Latombe 2002); there
    it turns round once, and decides anew. Walls and tall furniture count as they are. When `enough`
    of the floor of all rooms is seen that it could enter when the run began, or no look is worth
    its way any more, it leaves the robot to the behaviors behind it for good; where a shut door is
    in its way, until that is open. Events: `explores`, with the share seen, and `explored` at the
    end.
    """

    records: ClassVar[frozenset[str]] = frozenset({"explored", "explores"})
    needs: ClassVar[frozenset[str]] = frozenset({"explored"})

    enough: Share = Field(default=0.98, description="share of the floor to be seen")
    reach: Length = Field(
        default=1.0, ge=0.1, le=5, description="how near it goes to a frontier [m]"
    )

    def start(self, actor: "Actor") -> None:
        """Find the floor that there is to see, and where it may be seen from."""
        check_has_camera(actor, "explore")
        plan = actor.home.plan
        rooms = [room.index for room in actor.reachable_rooms()]
        self.floor: Bool = np.isin(plan.room_of_cell, rooms) & plan.free
        self.stands = spread(actor.space.cells(None, actor.part), STANDS_TRIED)
        self.targets = spread(np.argwhere(self.floor), TARGETS_TRIED)
        self.tried: Bool = np.zeros(len(self.targets), np.bool_)  # looked at, whether seen or not
        self.shown: tuple[int, dict[int, Bool]] = actor.home.version, {}  # targets, by stand
        self.stand: int | None = None
        self.left_out: set[int] = set()  # places that somebody didn't let it get to
        self.plan: Plan | None = None  # the look round that it planned last
        self.looked = self.done = self.shut_out = False

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return when it tries again to get to what isn't seen yet."""
        return now.time + TRIES_AGAIN if self.shut_out else None

    def give_up(self, now: Situation) -> None:
        """Leave out the place that it was going to."""
        if self.stand is not None:
            self.left_out.add(self.stand)

    def decide(self, now: Situation) -> Plan | None:
        """Drive to a frontier and look round; None when there is nothing left to see."""
        if self.done:
            return None
        plan = now.plan()
        if not self.looked:
            self.looked = True
            return plan.turn_by(1.0)
        explored: Bool = now.home.layers[f"explored.{now.actor.name}"].values
        share = float((explored & self.floor).sum()) / max(1.0, float(self.floor.sum()))
        self.shut_out = False
        self.stand = None if share >= self.enough else self._next(now, explored)
        if self.shut_out:
            return None
        if self.stand is None:
            self.done = True
            return plan.note("explored", f"{100 * share:.1f} %").stay(timedelta(microseconds=1))
        plan.note("explores", f"{100 * share:.1f} %")
        row, column = self.stands[self.stand].tolist()
        plan.go_to_point(*now.home.plan.lattice.cell_centre(row, column))
        self.plan = plan.turn_by(1.0)
        return plan

    def _next(self, now: Situation, explored: Bool) -> int | None:
        """Return where to look from next; None where no look is worth it, or doors are shut."""
        last = now.actor.plan
        if self.stand is not None and last.root is self.plan and last.is_over(now.step):
            self.tried |= self._shown(now.actor, self.stand)
        unseen = ~explored[self.targets[:, 0], self.targets[:, 1]] & ~self.tried
        near = np.flatnonzero(self._near_frontier(now, explored))
        gains = [np.count_nonzero(self._shown(now.actor, i) & unseen) for i in near.tolist()]
        worth = np.array(gains, np.int64) > WORTH * len(self.targets)
        near, gain = near[worth], np.array(gains, np.float64)[worth]
        if not len(near):
            return None
        actor, lattice = now.actor, now.home.plan.lattice
        here = (actor.state.x, actor.state.y)
        metres = actor.space.distances(here, centres(self.stands[near]))
        seconds = metres * lattice.units_per_m / actor.speed + TURN / actor.turn_rate
        best = int(np.argmax(gain / seconds))
        self.shut_out = not bool(np.isfinite(seconds[best]))
        return None if self.shut_out else int(near[best])

    def _near_frontier(self, now: Situation, explored: Bool) -> Bool:
        """Return which places are within reach of a frontier."""
        frontier = self.floor & ~explored & _beside(explored & self.floor)
        away = squared_distance(np.pad(~frontier, 1, constant_values=True))[1:-1, 1:-1]
        cells = self.reach / now.home.plan.lattice.cell
        near: Bool = away[self.stands[:, 0], self.stands[:, 1]] <= cells * cells
        near[sorted(self.left_out)] = False
        return near if frontier.any() else np.zeros(len(self.stands), np.bool_)

    def _shown(self, actor: "Actor", stand: int) -> Bool:
        """Return which targets come into view from a place, by walls and furniture as they are."""
        if self.shown[0] != actor.home.version:
            self.shown = actor.home.version, {}
        if stand not in self.shown[1]:
            place = centres(self.stands[stand : stand + 1])[0]
            self.shown[1][stand] = seen_from(actor, place, centres(self.targets))
        return self.shown[1][stand]


def _beside(mask: Bool) -> Bool:
    """Return the cells with a neighbor in a mask, across a side or a corner."""
    padded = np.pad(mask, 1)
    rows, columns = mask.shape
    shifted = [padded[r : r + rows, c : c + columns] for r in range(3) for c in range(3)]
    beside: Bool = np.logical_or.reduce(shifted)
    return beside
