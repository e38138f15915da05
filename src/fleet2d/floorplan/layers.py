"""Layers: named arrays with a value for each cell, and the costmap, which routes avoid."""

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import timedelta
from typing import Any, Literal, Self, get_args

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, model_validator

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem_at, suggest
from fleet2d.configuration.units import Length, PositiveDuration
from fleet2d.errors import ComponentError, FloorPlanError
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.space import Space
from fleet2d.kernels import I32, I64, Bool
from fleet2d.kernels.space import (
    CELL_CENTRE,
    MOST_COST,
    SUB,
    cost_distance,
    descend,
    label_parts,
    pull_taut,
    squared_distance,
)

LayerType = Literal[
    "bool", "int", "float", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32",
    "float32", "float64",
]  # fmt: skip

SEEN_LAYERS = ("explored", "first_seen", "last_seen", "time_since_seen")
"""Layers that a run itself maintains for each robot with a camera, as NAME.ROBOT."""
COSTMAP = "costmap"

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*(\.[A-Za-z][A-Za-z0-9_-]*)?")


class LayerSettings(Settings):
    """A layer of the floor plan: type and unit of its values, and when it is stored.

    Attributes:
        dtype: Type of the values.
        fill: Initial value of every cell.
        unit: Unit of the values.
        description: One line for a reader of the file.
        store: Whether a run stores it at its end.
        every: How often it is stored besides; null: only at the end.
    """

    dtype: LayerType = "float"
    fill: float = 0.0
    unit: str = ""
    description: str = ""
    store: bool = True
    every: PositiveDuration | None = None

    @model_validator(mode="after")
    def _fill_fits(self) -> Self:
        if not holds(np.dtype(self.dtype), self.fill):
            raise problem_at(("fill",), f"{self.fill:g} is not a value of {self.dtype}")
        if self.every is not None and not self.store:
            raise problem_at(("every",), "the layer isn't stored: leave out 'every' or 'store'")
        return self


def check_layers(layers: dict[str, LayerSettings]) -> dict[str, LayerSettings]:
    """Refuse invalid names, and settings that don't apply to layers which the run maintains."""
    for name, settings in layers.items():
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name):
            raise problem_at(
                (name,), f"the name {name!r} must be letters, digits, '_' and '-', a letter first"
            )
        if name in (*SEEN_LAYERS, COSTMAP):
            for key, value in LayerSettings():
                if key in ("store", "every") or getattr(settings, key) == value:
                    continue  # a stored scenario has all keys
                raise problem_at(
                    (name, key),
                    f"{name} is a layer that the run maintains itself: leave out {key!r}",
                )
    return layers


def holds(dtype: np.dtype[Any], value: float) -> bool:
    """Return whether an array of a type can hold a number exactly (floats: about)."""
    if dtype.kind == "f":
        return math.isnan(value) or abs(value) <= float(np.finfo(dtype).max)
    if not math.isfinite(value) or value != int(value):
        return False
    if dtype.kind == "b":
        return value in (0, 1)
    info = np.iinfo(dtype)
    return int(info.min) <= value <= int(info.max)


class Layer:
    """A value for each cell of a floor plan.

    Attributes:
        name: Its name.
        fill: Initial value of every cell.
        unit: Unit of the values.
        description: A line that says what it is.
        store: Whether a run stores it at its end.
        every: Interval at which it is also stored before; None for never.
    """

    def __init__(
        self,
        name: str,
        plan: FloorPlan,
        settings: LayerSettings,
        source: Callable[[], NDArray[Any]] | None = None,
    ) -> None:
        """Make a layer filled with its initial value, or one whose values come from `source`."""
        self.name, self.settings = name, settings
        self.fill: float = settings.fill
        self.unit, self.description = settings.unit, settings.description
        self.store, self.every = settings.store, settings.every
        self.dtype: np.dtype[Any] = np.dtype(settings.dtype)
        self._plan, self._source = plan, source
        shape = (plan.lattice.rows, plan.lattice.columns)
        if source is None:
            self._values: NDArray[Any] = np.full(shape, settings.fill, self.dtype)

    def __repr__(self) -> str:
        """Return name, type and unit."""
        return f"<Layer {self.name}: {self.dtype}{f' [{self.unit}]' if self.unit else ''}>"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Return the values, for NumPy functions."""
        return np.array(self.values, dtype=dtype, copy=copy)

    @property
    def values(self) -> NDArray[Any]:
        """The values (rows, columns); write to the array, or assign another.

        The values of a layer that the run maintains itself are recomputed, and are a copy.
        """
        return self._values if self._source is None else self._source()

    @values.setter
    def values(self, values: object) -> None:
        self._check_writable()
        self._values[...] = values

    def at(self, x: float, y: float) -> Any:
        """Return the value of the cell that holds a place [m].

        Raises:
            ComponentError: The place is outside the floor plan's grid.
        """
        return self.values[self._cell(x, y)].item()

    def set_at(self, x: float, y: float, value: float) -> None:
        """Change the value of the cell that holds a place [m].

        Raises:
            ComponentError: The place is outside the grid, or the run keeps the layer itself.
        """
        self._check_writable()
        self._values[self._cell(x, y)] = value

    def _check_writable(self) -> None:
        if self._source is not None:
            raise ComponentError(f"the layer {self.name} is maintained by the run: it is read-only")

    def _cell(self, x: float, y: float) -> tuple[int, int]:
        lattice = self._plan.lattice
        row, column = lattice.cell_of(*lattice.point_at((x, y)))
        if not (0 <= row < lattice.rows and 0 <= column < lattice.columns):
            raise ComponentError(f"({x:g}, {y:g}) m is outside the grid of {self._plan.name}")
        return row, column


class Layers(Mapping[str, Layer]):
    """The layers of a home in a run, by name; copied with it.

    Example:
        >>> import fleet2d
        >>> home = fleet2d.Home(fleet2d.load_floorplan())
        >>> dust = home.layers.add("dust", "float32", unit="g", description="on the floor")
        >>> dust.values[home.plan.free] += 0.5
        >>> float(home.layers["dust"].at(*home.rooms[0].anchor_xy))
        0.5
    """

    def __init__(self, plan: FloorPlan) -> None:
        """Make a mapping without layers."""
        self._plan = plan
        self._layers: dict[str, Layer] = {}

    def __getitem__(self, name: str) -> Layer:
        """Return a layer.

        Raises:
            ComponentError: No layer has that name.
        """
        if name not in self._layers:
            base = name.partition(".")[0]
            advice = (
                f"to have it kept, write floorplan.layers.{base}: {{}} in the scenario, or"
                f" needs = {{{base!r}}} in an algorithm"
                if base in SEEN_LAYERS
                else "add it by home.layers.add(), or in the scenario under floorplan.layers"
            )
            raise ComponentError(
                f"there is no layer {name!r}{suggest(name, self._layers)}; {advice}"
            )
        return self._layers[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._layers)

    def __len__(self) -> int:
        """Return the number of layers."""
        return len(self._layers)

    def __contains__(self, name: object) -> bool:
        """Return whether there is a layer of that name."""
        return name in self._layers

    def add(
        self,
        name: str,
        dtype: LayerType = "float",
        fill: float = 0.0,
        unit: str = "",
        description: str = "",
        *,
        store: bool = True,
        every: timedelta | None = None,
    ) -> Layer:
        """Add a layer and return it; one of the same name, type and unit is returned as it is.

        Args:
            name: Its name: letters, digits, '_' and '-'.
            dtype: Type of the values.
            fill: Initial value of every cell.
            unit: Unit of the values.
            description: A line that says what it is.
            store: Whether the run stores it at its end.
            every: Interval at which it is also stored before.

        Raises:
            ComponentError: The name is taken by another layer, or something is wrong with it.
        """
        if dtype not in get_args(LayerType):
            known = ", ".join(get_args(LayerType))
            raise ComponentError(f"layer {name!r}: there is no dtype {dtype!r}; there are: {known}")
        if not holds(np.dtype(dtype), fill):
            raise ComponentError(f"layer {name!r}: no {dtype} can be {fill:g}, its fill")
        if name.partition(".")[0] in (*SEEN_LAYERS, COSTMAP):
            raise ComponentError(
                f"layer {name!r} is one that the run maintains itself: rename yours"
            )
        settings = LayerSettings.model_construct(
            dtype=dtype, fill=fill, unit=unit, description=description, store=store, every=every
        )
        return self.add_layer(name, settings)

    def add_layer(
        self, name: str, settings: LayerSettings, source: Callable[[], NDArray[Any]] | None = None
    ) -> Layer:
        """Add a layer as a scenario describes it; see `add`."""
        if not _NAME.fullmatch(name):
            raise ComponentError(
                f"a layer can't be named {name!r}: use letters, digits, '_' and '-', a letter first"
            )
        layer = self._layers.get(name)
        if layer is None:
            layer = self._layers[name] = Layer(name, self._plan, settings, source)
        elif (layer.dtype, layer.unit) != (np.dtype(settings.dtype), settings.unit):
            raise ComponentError(
                f"there is a layer {name!r} of {layer.dtype} [{layer.unit}] already: name yours"
                " otherwise"
            )
        return layer


CLOSED = -1


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
    wall_cost: int = Field(default=200, ge=0, le=MOST_COST)
    no_go: Literal["forbid", "cost", "ignore"] = "forbid"
    no_go_cost: int = Field(default=500, ge=0, le=MOST_COST)


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
    free = plan.free & ~cells_within(plan, tuple(obstacles))
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
    return np.minimum(costs, MOST_COST).astype(np.int32)


def cells_within(plan: FloorPlan, areas: tuple[shapely.Polygon, ...]) -> Bool:
    """Return the cells whose centre is in one of the areas [m]: bool (rows, columns)."""
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
        self.base, self.cost = base, np.where(near, CLOSED, cost).astype(np.int32)
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
        rank = np.empty(self.parts, np.int32)
        rank[np.argsort(-sizes, kind="stable")] = np.arange(self.parts, dtype=np.int32)
        self.part_of_cell = np.where(part >= 0, rank[part], np.int32(-1))

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
        if (
            self.part_of_cell[near] < 0
        ):  # the point is in the space, but the centre of its cell isn't
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
    costs = np.where(cells & (cost >= 0), np.minimum(cost, MOST_COST), CLOSED).astype(np.int32)
    last = _nearest(space, costs >= 0, goal)
    if cost[goal[1] // SUB, goal[0] // SUB] < 0 or last is None:
        return None
    closed = closed_cells_around(space, costs, start)
    if closed is not None:
        costs[closed] = MOST_COST  # a body that stands there may leave
    first = _nearest(space, costs >= 0, start)
    assert first is not None
    field = cost_distance(costs, last, first)
    route_cells = descend(costs, field, first)
    if len(route_cells) == 0:
        return None
    centres = route_cells[:, ::-1] * SUB + CELL_CENTRE
    begin = space.route(start, (int(centres[0, 0]), int(centres[0, 1])))
    end = space.route((int(centres[-1, 0]), int(centres[-1, 1])), goal)
    if begin is None or end is None:
        return None
    route = np.concatenate([begin[:-1], centres, end[1:]])
    pulled = pull_taut(space.mesh, costs, np.ascontiguousarray(route))
    pulled.setflags(write=False)
    return pulled


def closed_cells_around(
    space: Space, cost: NDArray[np.signedinteger], at: tuple[int, int]
) -> Bool | None:
    """Return the closed cells around a place, bool (rows, columns); None for an open place."""
    closed = (space.part_of_cell >= 0) & (cost < 0)
    row, column = at[1] // SUB, at[0] // SUB
    if not closed[row, column]:
        return None
    part = label_parts(closed, diagonal=False)
    return part == part[row, column]


def _nearest(space: Space, is_open: Bool, at: tuple[int, int]) -> tuple[int, int] | None:
    """Return the (row, column) of the open cell nearest to a point; ties: lowest row, column."""
    row, column = at[1] // SUB, at[0] // SUB
    if is_open[row, column]:
        return row, column
    cells = np.argwhere(is_open)
    if len(cells) == 0:
        return None
    xs, ys = space.plan.lattice.centre_axes()
    away = (xs[cells[:, 1]] - at[0]) ** 2 + (ys[cells[:, 0]] - at[1]) ** 2
    nearest = cells[int(np.argmin(away))].tolist()
    return int(nearest[0]), int(nearest[1])
