"""The costmap: what routes cost beyond their length, and the cheapest routes of bodies."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.configuration.components import Settings
from fleet2d.configuration.units import Length
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.plan import FloorPlan, cells_of, read_only
from fleet2d.floorplan.space import Space
from fleet2d.kernels import (
    CELL_CENTRE,
    I32,
    I64,
    MAX_COST,
    SUB,
    Bool,
    cheapest_cells,
    label_parts,
    pull_taut,
    squared_distance,
)

CLOSED = -1
# Cells to each side among which the nearest open one is looked for first.
NEAR_CELLS = 8


class CostmapSettings(Settings):
    """The costs that routes of robots pay in addition to their length.

    A cost of 100 % counts a cell double. Robots take the cheapest route, which without a costmap is
    the shortest.

    Attributes:
        clearance: Distance from walls and furniture from which on no cost is added.
        wall_cost: Cost beside a wall or furniture [%]; less farther away.
        no_go: How routes treat the floor plan's no-go areas.
        no_go_cost: Cost of a no-go area with no_go: cost [%].
    """

    clearance: Length = Field(default=0.5, ge=0, le=5)
    wall_cost: int = Field(default=200, ge=0, le=MAX_COST)
    no_go: Literal["forbid", "cost", "ignore"] = "forbid"
    no_go_cost: int = Field(default=500, ge=0, le=MAX_COST)


def costs_of(
    plan: FloorPlan, settings: CostmapSettings, obstacles: Sequence[shapely.Polygon] = ()
) -> I32:
    """Return the cost of each cell [%]: int32 (rows, columns), -1 where no route leads.

    Args:
        plan: The floor plan.
        settings: The settings of the costmap.
        obstacles: Footprints of obstacles besides the walls [m].
    """
    cell = plan.lattice.cell
    free = plan.free & ~cells_within(plan, obstacles)
    # Walls run along cells that aren't free, half a cell nearer than the middle of these.
    walls_away = (np.sqrt(squared_distance(free).astype(np.float64)) - 0.5) * cell
    near = 1.0 - np.clip(walls_away / max(settings.clearance, cell), 0.0, 1.0)
    costs = np.rint(settings.wall_cost * near).astype(np.int32)
    if settings.no_go != "ignore":
        no_go = cells_within(plan, plan.no_go)
        if settings.no_go == "forbid":
            costs[no_go] = CLOSED
        else:
            costs[no_go] += settings.no_go_cost
    return np.minimum(costs, MAX_COST).astype(np.int32)


def cells_within(plan: FloorPlan, areas: Sequence[shapely.Polygon]) -> Bool:
    """Return the cells whose centre is in one of the areas [m]: bool (rows, columns)."""
    if not areas:
        return np.zeros(plan.free.shape, np.bool_)
    centres = plan.lattice.to_metres(np.stack(np.meshgrid(*plan.lattice.centre_axes()), axis=-1))
    whole = shapely.union_all(areas)
    shapely.prepare(whole)
    return shapely.intersects_xy(whole, centres[..., 0], centres[..., 1])


class CostedSpace(Space):
    """The places of a body that pays costs: those of a space, without closed cells.

    The body keeps its radius from closed cells. Connected parts are joined by routes, and routes
    are the cheapest.

    Attributes:
        base: The space where the body fits.
        cost: Cost of each cell [%], int32 (rows, columns), below 0 where its centre may not be.
    """

    def __init__(self, base: Space, cost: NDArray[np.signedinteger]) -> None:
        """Remove closed cells from a space.

        Args:
            base: The space where the body fits.
            cost: int (rows, columns), as for `route_by_cost`.

        Raises:
            FloorPlanError: No place is left.
        """
        self.__dict__.update(base.__dict__)
        cells = base.radius / base.plan.lattice.cell + 0.5  # up to the border of a cell
        near = squared_distance(np.ascontiguousarray(cost >= 0)) <= cells * cells
        self._original_cost = cost
        self.base = base
        self.cost = np.where(near, CLOSED, cost).astype(np.int32)
        self._cache_searches()
        # Cells of the space that share a side always belong to one part.
        part = label_parts((base.part_of_cell >= 0) & (self.cost >= 0), diagonal=False)
        sizes = np.bincount(part[part >= 0])
        self.parts = len(sizes)
        if not self.parts:
            raise FloorPlanError(
                f"the costmap of {base.plan.name} is below 0 wherever a body of radius"
                f" {base.radius:g} m fits: leave it a place to be"
            )
        rank = np.argsort(np.argsort(-sizes, kind="stable"))
        self.part_of_cell = np.where(part >= 0, rank[part], -1).astype(np.int32)

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle it by the arguments that it was made from."""
        return CostedSpace, (self.base, self._original_cost)

    @property
    def shortest(self) -> None:
        """None: routes are the cheapest."""
        return None

    def part_at(self, x: int, y: int) -> int:
        """Return the connected part of a lattice point; -1 where the body can't be or go."""
        row, column = y // SUB, x // SUB
        if self.base.part_at(x, y) < 0 or self.cost[row, column] < 0:
            return -1
        near = (row, column)
        if self.part_of_cell[near] < 0:  # the point is in the space, its cell's centre isn't
            near = _nearest(self.base, self.part_of_cell >= 0, (x, y)) or near
        return int(self.part_of_cell[near])

    def part_near(self, x: int, y: int) -> int:
        """Return the largest part beside the closed cells around a point, or the nearest part."""
        closed = closed_cells_around(self.base, self.cost, (x, y))
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

    It is searched on cells and then pulled taut where that doesn't raise its cost, so it is the
    cheapest up to the resolution of the grid. A route that starts in closed cells leaves them at
    the highest cost.

    Args:
        space: The space of the body.
        cost: Cost of each cell [%], int (rows, columns), below 0 for closed cells; values above
            1000 count as 1000.
        start: Where the body is (x, y) [lattice].
        goal: Where it is to be (x, y) [lattice].

    Example:
        >>> import fleet2d
        >>> home = fleet2d.Home(fleet2d.load_floorplan())
        >>> space = home.space(0.15)
        >>> a, b = (space.nearest(*home.plan.lattice.to_lattice(r.anchor_xy).tolist())
        ...         for r in home.rooms[:2])
        >>> free = np.zeros(home.plan.free.shape, np.int32)
        >>> route = route_by_cost(space, free, a, b)
        >>> tuple(route[0].tolist()) == a, tuple(route[-1].tolist()) == b
        (True, True)
    """
    part = space.part_at(*goal)
    if part < 0:
        return None
    cells = space.part_of_cell == part
    limited = np.maximum(np.minimum(cost, MAX_COST), CLOSED)  # faster than `clip`
    costs = np.where(cells, limited, CLOSED).astype(np.int32, copy=False)
    last = _nearest(space, costs >= 0, goal)
    if cost[goal[1] // SUB, goal[0] // SUB] < 0 or last is None:
        return None
    closed = closed_cells_around(space, costs, start)
    if closed is not None:
        costs[closed] = MAX_COST  # a body that stands there may leave
    first = _nearest(space, costs >= 0, start)
    assert first is not None
    route_cells = cheapest_cells(costs, first, last)
    if len(route_cells) == 0:
        return None
    centres = route_cells[:, ::-1] * SUB + CELL_CENTRE
    begin = space.route(start, (int(centres[0, 0]), int(centres[0, 1])))
    end = space.route((int(centres[-1, 0]), int(centres[-1, 1])), goal)
    if begin is None or end is None:
        return None
    route = np.concatenate([begin[:-1], centres, end[1:]])
    return read_only(pull_taut(space.mesh, costs, np.ascontiguousarray(route)))


def closed_cells_around(
    space: Space, cost: NDArray[np.signedinteger], at: tuple[int, int]
) -> Bool | None:
    """Return the closed cells around a place, bool (rows, columns); None for an open place."""
    row, column = at[1] // SUB, at[0] // SUB
    if space.part_of_cell[row, column] < 0 or cost[row, column] >= 0:
        return None
    closed = (space.part_of_cell >= 0) & (cost < 0)
    part = label_parts(closed, diagonal=False)
    return part == part[row, column]


def _nearest(space: Space, is_open: Bool, at: tuple[int, int]) -> tuple[int, int] | None:
    """Return the (row, column) of the open cell nearest to a point; ties: lowest row, column."""
    row, column = at[1] // SUB, at[0] // SUB
    if is_open[row, column]:
        return row, column
    for reach in (NEAR_CELLS, sum(is_open.shape)):
        low = max(row - reach, 0), max(column - reach, 0)
        window = is_open[low[0] : row + reach + 1, low[1] : column + reach + 1]
        cells = cells_of(window) + np.array(low)
        if len(cells) == 0:
            continue
        away = space.plan.lattice.squared_distances(cells, at)
        nearest = int(np.argmin(away))
        if away[nearest] <= (reach * SUB) ** 2:  # all beyond the window are farther
            row, column = cells[nearest].tolist()
            return row, column
    return None
