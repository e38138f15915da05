"""Ways that mind costs: distance from walls, no-go areas, and a user's own costs."""

from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.component import Settings
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.space import Space
from fleet2d.kernels.fields import MOST_COST, cost_distance, descend, squared_distance
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
        default=0.5, ge=0, le=5, description="distance from walls from which on nothing is added"
    )
    wall_cost: int = Field(
        default=200, ge=0, le=MOST_COST, description="cost beside a wall [%]; less farther away"
    )
    no_go: Literal["forbid", "cost", "ignore"] = Field(
        default="forbid", description="what the floor plan's no-go areas are"
    )
    no_go_cost: int = Field(
        default=500, ge=0, le=MOST_COST, description="cost of a no-go area with no_go: cost [%]"
    )


def costs_of(plan: FloorPlan, settings: CostmapSettings) -> I32:
    """Return the cost of each cell [%]: int32 (rows, columns), -1 where no way leads."""
    cell = plan.lattice.cell
    # Walls run between cells, not through the middle of the nearest one that isn't free.
    walls_away = (np.sqrt(squared_distance(plan.free.copy()).astype(np.float64)) - 0.5) * cell
    near = 1.0 - np.minimum(walls_away / max(settings.clearance, cell), 1.0)
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


def route_by_cost(
    space: Space, cost: NDArray[np.signedinteger], start: tuple[int, int], goal: tuple[int, int]
) -> I64 | None:
    """Return a cheapest path (n, 2) from `start` to `goal` [lattice], or None.

    It is found on cells and then pulled taut where that makes it no dearer, so it is the cheapest
    up to what a grid of cells can tell. A start where no way leads is left by the shortest way.

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
