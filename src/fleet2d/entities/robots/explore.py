"""Explore: drive to where what was seen borders on what wasn't, until all is seen."""

from datetime import timedelta
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.component import register
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import check_has_camera
from fleet2d.kernels.fields import squared_distance
from fleet2d.units import Length, Share

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor

Bool = NDArray[np.bool_]


@register("behavior", "explore")
class Explore(Behavior):
    """Complete the layer `explored` of the robot, frontier by frontier.

    A frontier is floor not yet seen beside floor that was (Yamauchi 1997). The robot drives to the
    nearest place on foot from which a frontier is no farther than `reach`, turns round once, and
    decides anew. A frontier that stays unseen from there is given up. When so little is left that
    `enough` of the floor of all rooms that it can enter is seen, or no frontier is left, it leaves
    the robot to the behaviors behind it, for good. Events: `explores`, with the share seen, and
    `explored` at the end.
    """

    needs: ClassVar[frozenset[str]] = frozenset({"explored"})

    enough: Share = Field(default=0.98, description="share of the floor to be seen")
    reach: Length = Field(
        default=0.6, ge=0.1, le=5, description="how near it goes to a frontier [m]"
    )

    def start(self, actor: "Actor") -> None:
        """Find the floor that there is to see."""
        check_has_camera(actor, "explore")
        plan = actor.home.plan
        rooms = [room.index for room in actor.reachable_rooms()]
        self.floor: Bool = np.isin(plan.room_of_cell, rooms) & plan.free
        self.given_up: Bool = np.zeros_like(self.floor)
        self.looked = self.done = False
        self.cells = max(1, round(self.reach / plan.lattice.cell))

    def decide(self, now: Situation) -> Plan | None:
        """Drive to the nearest frontier and look round; None when there is nothing left to see."""
        if self.done:
            return None
        plan = now.plan()
        if not self.looked:
            self.looked = True
            return plan.turn_by(1.0)
        explored: Bool = now.home.layers[f"explored.{now.actor.name}"].values
        share = float((explored & self.floor).sum()) / max(1.0, float(self.floor.sum()))
        goal = None if share >= self.enough else self._goal(now, explored)
        if goal is None:
            self.done = True
            return plan.note("explored", f"{100 * share:.1f} %").stay(timedelta(microseconds=1))
        row, column = goal
        plan.note("explores", f"{100 * share:.1f} %")
        plan.go_to_point(*now.home.plan.lattice.cell_centre(row, column))
        return plan.turn_by(1.0)

    def _goal(self, now: Situation, explored: Bool) -> tuple[int, int] | None:
        """Return the nearest cell on foot from which a frontier is near, and give that one up."""
        frontier = self.floor & ~explored & ~self.given_up & _beside(explored & self.floor)
        if not frontier.any():
            return None
        actor = now.actor
        near = squared_distance(np.pad(~frontier, 1, constant_values=True))[1:-1, 1:-1]
        here = np.array([[actor.state.x, actor.state.y]], np.int64)
        metres = actor.space.distance_field(here)
        metres[(near > self.cells * self.cells) | (actor.space.part_of_cell != actor.part)] = np.inf
        best = int(np.argmin(metres))
        row, column = best // metres.shape[1], best % metres.shape[1]
        if not np.isfinite(metres[row, column]):
            return None
        rows, columns = np.indices(frontier.shape)
        away = (rows - row) ** 2 + (columns - column) ** 2
        self.given_up |= frontier & (away <= self.cells * self.cells)
        return row, column


def _beside(mask: Bool) -> Bool:
    """Return the cells with a neighbor in a mask, across a side or a corner."""
    padded = np.pad(mask, 1)
    rows, columns = mask.shape
    shifted = [padded[r : r + rows, c : c + columns] for r in range(3) for c in range(3)]
    beside: Bool = np.logical_or.reduce(shifted)
    return beside
