"""Ways that mind costs: distance from walls, no-go areas, and a user's own costs."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.component import Settings
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.home.space import ROUTES_KEPT, Space
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels.fields import MOST_COST, cost_distance, descend, squared_distance
from fleet2d.kernels.masks import label_parts
from fleet2d.kernels.mesh import CELL_CENTRE, SUB
from fleet2d.kernels.taut import pull_taut
from fleet2d.units import Length

I64 = NDArray[np.int64]
I32 = NDArray[np.int32]

NO_WAY = -1


class CostmapSettings(Settings):
    """What makes ways of robots dearer than they are long.

    A cost of 100 % counts a cell double. Robots take the cheapest way; without a costmap it is the
    shortest.
    """

    clearance: Length = Field(
        default=0.5,
        ge=0,
        le=5,
        description="distance from walls and furniture from which on nothing is added",
    )
    wall_cost: int = Field(
        default=200,
        ge=0,
        le=MOST_COST,
        description="cost beside a wall or furniture [%]; less farther away",
    )
    no_go: Literal["forbid", "cost", "ignore"] = Field(
        default="forbid", description="what the floor plan's no-go areas are"
    )
    no_go_cost: int = Field(
        default=500, ge=0, le=MOST_COST, description="cost of a no-go area with no_go: cost [%]"
    )


def costs_of(
    plan: FloorPlan, settings: CostmapSettings, obstacles: Sequence[shapely.Polygon] = ()
) -> I32:
    """Return the cost of each cell [%]: int32 (rows, columns), -1 where no way leads.

    Args:
        plan: The floor plan.
        settings: What makes ways dear.
        obstacles: What stands in the way besides the walls [m].
    """
    cell = plan.lattice.cell
    free = plan.free & ~cells_within(plan, tuple(obstacles))
    # Walls run between cells, not through the middle of the nearest one that isn't free.
    walls_away = (np.sqrt(squared_distance(free).astype(np.float64)) - 0.5) * cell
    near = 1.0 - np.clip(walls_away / max(settings.clearance, cell), 0.0, 1.0)
    costs = np.rint(settings.wall_cost * near).astype(np.int32)
    if settings.no_go != "ignore":
        no_go = cells_within(plan, plan.no_go)
        if settings.no_go == "forbid":
            costs[no_go] = NO_WAY
        else:
            costs[no_go] += settings.no_go_cost
    return np.minimum(costs, MOST_COST).astype(np.int32)


def cells_within(plan: FloorPlan, areas: tuple[shapely.Polygon, ...]) -> NDArray[np.bool_]:
    """Return the cells whose centre is within one of some areas [m]: bool (rows, columns)."""
    mask = np.zeros(plan.free.shape, np.bool_)
    if areas:
        xs, ys = plan.lattice.centre_axes()
        grid = np.stack(np.broadcast_arrays(xs[None, :], ys[:, None]), axis=-1)
        centres = plan.lattice.to_metres(grid)
        whole = shapely.union_all(list(areas))
        shapely.prepare(whole)
        mask = shapely.intersects_xy(whole, centres[..., 0], centres[..., 1])
    return mask


class CostedSpace(Space):
    """The places where a body may be that minds costs: none of those where no way leads.

    The body keeps its radius from them. The connected parts are those between which a way leads,
    and routes are the cheapest.

    Attributes:
        base: Where the body fits.
        cost: int32 (rows, columns) [%], below 0 where its centre may not be.
    """

    def __init__(self, base: Space, cost: NDArray[np.signedinteger]) -> None:
        """Take the places out of a space where no way leads.

        Args:
            base: Where the body fits.
            cost: int (rows, columns), as for `route_by_cost`.

        Raises:
            FloorPlanError: No place is left.
        """
        self.__dict__.update(base.__dict__)
        cells = base.radius / base.plan.lattice.cell + 0.5  # up to the border of a cell
        near = squared_distance(np.ascontiguousarray(cost >= 0)) <= cells * cells
        self._given = cost
        self.base, self.cost = base, np.where(near, NO_WAY, cost).astype(np.int32)
        self.route = lru_cache(ROUTES_KEPT)(self._find_route)
        self.cells = lru_cache(None)(self._find_cells)
        self.nearest = lru_cache(ROUTES_KEPT)(self._find_nearest)
        self.part_about = lru_cache(ROUTES_KEPT)(self._find_part)
        self.rooms_of = lru_cache(None)(self._find_rooms)
        # Where a body fits, cells that share a side are never of two parts.
        part = label_parts((base.part_of_cell >= 0) & (self.cost >= 0), diagonal=False)
        sizes = np.bincount(part[part >= 0])
        self.parts = len(sizes)
        if not self.parts:
            raise FloorPlanError(
                f"the costmap of {base.plan.name} is below 0 wherever a body of radius"
                f" {base.radius:g} m fits: leave it a place to be"
            )
        rank = np.empty(self.parts, np.int32)
        rank[np.argsort(-sizes, kind="stable")] = np.arange(self.parts, dtype=np.int32)
        self.part_of_cell = np.where(part >= 0, rank[part], np.int32(-1))

    def __reduce__(self) -> tuple[object, ...]:
        """Make it anew from what it was made from."""
        return CostedSpace, (self.base, self._given)

    def part_at(self, x: int, y: int) -> int:
        """Return the connected part of a lattice point; -1 where the body can't be or go."""
        row, column = y // SUB, x // SUB
        if self.base.part_at(x, y) < 0 or self.cost[row, column] < 0:
            return -1
        near = (row, column)
        if self.part_of_cell[near] < 0:  # the point is in the space, the centre of its cell isn't
            near = _nearest(self.base, self.part_of_cell >= 0, (x, y)) or near
        return int(self.part_of_cell[near])

    def part_near(self, x: int, y: int) -> int:
        """Return the largest part that a body comes to which leaves the closed cells round it."""
        closed = closed_round(self.base, self.cost, (x, y))
        if closed is None:
            return super().part_near(x, y)
        ring = np.pad(closed, 1)
        ring = ring[:-2, 1:-1] | ring[2:, 1:-1] | ring[1:-1, :-2] | ring[1:-1, 2:]
        beside = self.part_of_cell[ring]
        return int(beside[beside >= 0].min(initial=self.parts)) % self.parts

    def _find_route(self, start: tuple[int, int], goal: tuple[int, int]) -> I64 | None:
        """Return a cheapest path (n, 2) from `start` to `goal` [lattice], or None."""
        return route_by_cost(self.base, self.cost, start, goal)


def route_by_cost(
    space: Space, cost: NDArray[np.signedinteger], start: tuple[int, int], goal: tuple[int, int]
) -> I64 | None:
    """Return a cheapest path (n, 2) from `start` to `goal` [lattice], or None.

    It is found on cells and then pulled taut where that makes it no dearer, so it is the cheapest
    up to what a grid of cells can tell. Closed cells round the start are left, at the highest cost.

    Args:
        space: Where the body can be.
        cost: int (rows, columns) [%], below 0 where no way leads; what is above 1000 counts as
            1000.
        start: Where it is.
        goal: Where it wants to be.

    Example:
        >>> import fleet2d
        >>> home = fleet2d.Home(fleet2d.load_floorplan())
        >>> space = home.space(0.15)
        >>> a, b = (space.nearest(*home.plan.lattice.to_lattice(r.anchor_xy).tolist())
        ...         for r in home.rooms[:2])
        >>> free = np.zeros(home.plan.free.shape, np.int32)
        >>> way = route_by_cost(space, free, a, b)
        >>> tuple(way[0].tolist()) == a, tuple(way[-1].tolist()) == b
        (True, True)
    """
    part = space.part_at(*goal)
    if part < 0:
        return None
    cells = space.part_of_cell == part
    costs = np.where(cells & (cost >= 0), np.minimum(cost, MOST_COST), NO_WAY).astype(np.int32)
    last = _nearest(space, costs >= 0, goal)
    if cost[goal[1] // SUB, goal[0] // SUB] < 0 or last is None:
        return None
    closed = closed_round(space, costs, start)
    if closed is not None:
        costs[closed] = MOST_COST  # somebody who stands there leaves it
    first = _nearest(space, costs >= 0, start)
    assert first is not None
    field = cost_distance(costs, last, first)
    found = descend(costs, field, first)
    if len(found) == 0:
        return None
    centres = found[:, ::-1] * SUB + CELL_CENTRE
    begin = space.route(start, (int(centres[0, 0]), int(centres[0, 1])))
    end = space.route((int(centres[-1, 0]), int(centres[-1, 1])), goal)
    if begin is None or end is None:
        return None
    way = np.concatenate([begin[:-1], centres, end[1:]])
    pulled = pull_taut(space.mesh, costs, np.ascontiguousarray(way))
    pulled.setflags(write=False)
    return pulled


def closed_round(
    space: Space, cost: NDArray[np.signedinteger], at: tuple[int, int]
) -> NDArray[np.bool_] | None:
    """Return the closed cells round a place, bool (rows, columns); None for an open one."""
    closed = (space.part_of_cell >= 0) & (cost < 0)
    row, column = at[1] // SUB, at[0] // SUB
    if not closed[row, column]:
        return None
    part = label_parts(closed, diagonal=False)
    mask: NDArray[np.bool_] = part == part[row, column]
    return mask


def _nearest(space: Space, open_: NDArray[np.bool_], at: tuple[int, int]) -> tuple[int, int] | None:
    """Return the (row, column) of the open cell nearest to a point; ties: lowest row, column."""
    row, column = at[1] // SUB, at[0] // SUB
    if open_[row, column]:
        return row, column
    cells = np.argwhere(open_)
    if len(cells) == 0:
        return None
    xs, ys = space.plan.lattice.centre_axes()
    away = (xs[cells[:, 1]] - at[0]) ** 2 + (ys[cells[:, 0]] - at[1]) ** 2
    nearest = cells[int(np.argmin(away))].tolist()
    return int(nearest[0]), int(nearest[1])
