"""Where bodies can be: the space of a round body, its shortest routes, and places to stand."""

import heapq
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.lattice import UNITS_PER_CELL, Lattice, LatticePoint
from fleet2d.floorplan.mesh import Segment, build_mesh, cross_products, snap_polygon
from fleet2d.floorplan.placed_objects import PORTAL_REACH_M, PlacedObject, Portal, UsePlace
from fleet2d.floorplan.plan import FloorPlan, cells_of, read_only
from fleet2d.kernels import (
    CELL_CENTRE,
    F64,
    I32,
    I64,
    SUB,
    Bool,
    Corners,
    Mesh,
    Routes,
    label_triangles,
    line_of_sight,
    locate,
    move_walls,
    nearest_cells_in_sight,
    rasterize_cells,
    strictly_inside,
    walking_distance,
)

# Snapping of the shrunk walls and rounding of a pose add up to less than this [lattice].
ROUNDING = 3
# Number of free cells that are tried for a way back into the space, nearest first.
ESCAPE_ATTEMPTS = 200
# The free cells nearest to a point are sought so many rows and columns round it first.
NEAR_CELLS = 16
SECOND_US = 1_000_000
# Number of results that a space caches of each of its searches.
CACHED_ROUTES = 4096


class SpaceShape(NamedTuple):
    """The shape of a space, which processes may share.

    Attributes:
        polygons: Its outlines [lattice].
        mesh: The same in triangles.
        part_of_cell: As in `Space`, int32 (rows, columns).
        part_of_triangle: The connected part of each triangle of the mesh, int32 (triangles,).
        parts: Number of connected parts.
    """

    polygons: list[Polygon]
    mesh: Mesh
    part_of_cell: I32
    part_of_triangle: I32
    parts: int


def shape_space(
    plan: FloorPlan, radius: float, obstacles: Sequence[Polygon] = (), shut: Sequence[Segment] = ()
) -> SpaceShape:
    """Return the shape of the space of a body.

    Args:
        plan: The floor plan.
        radius: The body's radius [m].
        obstacles: Further obstacles to movement [lattice].
        shut: The lines of shut doors [lattice].

    Raises:
        FloorPlanError: The body fits nowhere.
    """
    lattice = plan.lattice
    reach = radius * lattice.units_per_m
    blocks = grow_polygons([Polygon(o.exterior) for o in obstacles], reach)
    blocks += [grow_shape(np.array(segment, np.float64), reach) for segment in shut]
    polygons = shrink(plan.polygons, reach, blocks)
    if not polygons:
        raise FloorPlanError(
            f"a body of radius {radius:g} m fits nowhere in {plan.name}: give it a smaller"
            " radius or check the scale of the plan"
        )
    mesh = build_mesh(polygons, lattice.columns, lattice.rows)
    triangles = rasterize_cells(mesh, lattice.rows, lattice.columns)
    part = label_triangles(mesh.neighbors)
    part_of_cell = np.where(triangles >= 0, part[triangles], -1)
    # Parts without a cell's centre rank last and aren't counted.
    sizes = np.bincount(part_of_cell[part_of_cell >= 0], minlength=int(part.max()) + 1)
    rank = np.argsort(np.argsort(-sizes, kind="stable"))
    ranked = np.where(triangles >= 0, rank[part_of_cell], -1)
    return SpaceShape(
        polygons,
        mesh,
        ranked.astype(np.int32),
        rank[part].astype(np.int32),
        int(np.count_nonzero(sizes)),
    )


class Space:
    """The places where the centre of a body of one radius may be (its configuration space).

    Walls, obstacles and shut doors are grown by a regular octagon round the body: a body keeps its
    radius from each, on all sides alike, and at most 8 % more from slanted ones.

    Attributes:
        radius: The body's radius [m].
        polygons: The space's outlines [lattice].
        mesh: The same in triangles.
        part_of_cell: The connected part that holds each cell's centre, int32 (rows, columns), -1
            where the body can't be.
        parts: Number of connected parts; part 0 is the largest.
    """

    def __init__(
        self,
        plan: FloorPlan,
        radius: float,
        *,
        walls: Mesh | None = None,
        shape: SpaceShape | None = None,
    ) -> None:
        """Make the space.

        Args:
            plan: The floor plan.
            radius: The body's radius [m].
            walls: The mesh that bounds where a body can be; None for the plan's.
            shape: Its shape, from `shape_space`; None for that between the plan's walls.

        Raises:
            FloorPlanError: The body fits nowhere.
        """
        shape = shape_space(plan, radius) if shape is None else shape
        self.plan = plan
        self.walls = plan.mesh if walls is None else walls
        self._cache_searches()
        self.radius = radius
        self.key: tuple[Any, ...] = ()  # the home's key of this space
        self.polygons = shape.polygons
        self.mesh: Mesh = shape.mesh
        self.part_of_cell = read_only(shape.part_of_cell)
        self._part_of_triangle = read_only(shape.part_of_triangle)
        self.parts = shape.parts

    def _cache_searches(self) -> None:
        """Cache the searches, since behaviors repeat them for the same rooms and routes."""
        self.route = lru_cache(CACHED_ROUTES)(self._find_route)
        self.cells = lru_cache(None)(self._find_cells)
        self.nearest = lru_cache(CACHED_ROUTES)(self._find_nearest)
        self.part_about = lru_cache(CACHED_ROUTES)(self._find_part)
        self.part_of = lru_cache(CACHED_ROUTES)(self.part_at)  # of places that bodies come back to
        self.rooms_of = lru_cache(None)(self._find_rooms)

    def __deepcopy__(self, memo: dict[int, object]) -> "Space":
        """Return itself, as nothing in it changes."""
        return self

    @cached_property
    def routes(self) -> Routes:
        """The corners of the space and the legs between them, built at their first use."""
        return Routes(self.mesh, self._corners())

    @property
    def shortest(self) -> Routes | None:
        """The routes between points strictly inside; None if routes aren't the shortest."""
        return self.routes

    def part_at(self, x: int, y: int) -> int:
        """Return the connected part of a lattice point strictly inside the space, else -1."""
        if not strictly_inside(self.mesh, x, y):
            return -1
        return int(self._part_of_triangle[locate(self.mesh, x, y)])

    @property
    def part_lookup(self) -> I32 | Callable[[int, int], int]:
        """The parts of the triangles, int32 (triangles,), if they say `part_at`; else `part_at`."""
        return self._part_of_triangle if type(self).part_at is Space.part_at else self.part_at

    def passings(self, start: LatticePoint, goal: LatticePoint) -> Sequence[Any]:
        """Return the portals on the way from one lattice point to another: here none are used."""
        return ()

    def part_near(self, x: int, y: int) -> int:
        """Return the part of a point; outside of the space, the nearest one."""
        part = self.part_at(x, y)
        if part >= 0:
            return part
        near = self.nearest(x, y)
        return 0 if near is None else self.part_at(*near)

    def _find_rooms(self, part: int) -> frozenset[int]:
        """Return the indices of the rooms in which a part of the space has cells."""
        rooms = self.plan.room_of_cell[self.part_of_cell == part]
        return frozenset(np.flatnonzero(np.bincount(rooms[rooms >= 0])).tolist())

    def _find_part(self, xy: tuple[float, float]) -> int:
        """Return the part of a place [m], or the nearest one."""
        return self.part_near(*self.plan.lattice.point_at(xy))

    def _find_cells(self, room: int | None = None, part: int = 0) -> I64:
        """Return the cells (row, column) of a part of the space, or of a room, int64 (n, 2)."""
        mask = self.part_of_cell == part
        if room is not None:
            mask &= self.plan.room_of_cell == room
        return read_only(cells_of(mask))

    def _find_nearest(
        self, x: int, y: int, part: int | None = None, room: int | None = None
    ) -> LatticePoint | None:
        """Return the centre of the free cell nearest to a point; ties: lowest row, column."""
        cells = self.by_distance(x, y, 1, part, room)
        return self.plan.lattice.cell_centre(*cells[0].tolist()) if len(cells) else None

    def _find_route(self, start: LatticePoint, goal: LatticePoint) -> I64 | None:
        """Return the shortest path (n, 2) from `start` to `goal` [lattice], or None.

        From a start on the border of the space, where a walk may end early, it first leads inside.
        """
        if not strictly_inside(self.mesh, *goal):
            return None
        if strictly_inside(self.mesh, *start):
            route = self.routes.find(*start, *goal)
            return None if route is None else read_only(route)
        inside = self._way_in(*start)
        route = None if inside is None else self.routes.find(*inside, *goal)
        return None if route is None else read_only(np.concatenate([[start], route]))

    def distance_field(self, places: I64) -> F64:
        """Return the walking distance of each cell from the nearest of some places.

        Args:
            places: Lattice points (n, 2).

        Returns:
            float64 (rows, columns) [m], by steps to sides and corners of cells, so up to 8 % longer
            than the straight line; infinite where the body can't be or come from.
        """
        return self._metres(self._steps(places))

    def distances(self, place: LatticePoint, points: I64) -> F64:
        """Return the walking distances of points from a place, as `distance_field` measures them.

        Args:
            place: Lattice point.
            points: Lattice points (n, 2).

        Returns:
            float64 (n,) [m].
        """
        steps = self._steps(np.array([place], np.int64))
        return self._metres(steps[points[:, 1] // SUB, points[:, 0] // SUB])

    def _steps(self, places: I64) -> I32:
        cells = np.asarray(places, np.int64).reshape(-1, 2)[:, ::-1] // SUB
        return walking_distance(self.part_of_cell >= 0, np.ascontiguousarray(cells))

    def _metres(self, steps: NDArray[np.signedinteger]) -> F64:
        return np.where(steps >= 0, steps * (self.plan.lattice.cell / 5), np.inf)

    def _way_in(self, x: int, y: int) -> LatticePoint | None:
        walls = self.walls
        triangle = locate(walls, x, y)
        for row, column in self.by_distance(x, y, ESCAPE_ATTEMPTS).tolist():
            target = self.plan.lattice.cell_centre(row, column)
            if triangle >= 0 and line_of_sight(walls, x, y, triangle, *target):
                return target
        return None

    def by_distance(
        self, x: int, y: int, most: int, part: int | None = None, room: int | None = None
    ) -> I64:
        """Return the free cells (row, column) nearest to a point, at most so many, in order."""
        near = (_near(y // SUB), _near(x // SUB))
        for window in (near, (slice(0, None), slice(0, None))):
            parts = self.part_of_cell[window]
            mask = parts >= 0 if part is None else parts == part
            if room is not None:
                mask = mask & (self.plan.room_of_cell[window] == room)
            cells = cells_of(mask) + np.array([window[0].start, window[1].start])
            away = self.plan.lattice.squared_distances(cells, (x, y))
            # All others are farther away than the border of these.
            if np.count_nonzero(away <= (NEAR_CELLS * SUB) ** 2) >= most:
                break
        if len(cells) > most:
            is_near = away <= np.partition(away, most - 1)[most - 1]
            cells = cells[is_near]
            away = away[is_near]
        return cells[np.argsort(away, kind="stable")[:most]]

    def _corners(self) -> Corners:
        """Return the reflex vertices of the border, round which shortest ways bend."""
        vertices = self.mesh.vertices
        outlines = shapely.get_rings(self.polygons)
        rings = [shapely.get_coordinates(ring)[:-1].astype(np.int64) for ring in outlines]
        corners = np.concatenate(rings)
        before = np.concatenate([np.roll(ring, 1, axis=0) for ring in rings])
        after = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
        into = corners - before
        out = after - corners
        # The free space lies to the left.
        reflex = cross_products(into, out) < 0
        keys = vertices[:, 0] << 32 | vertices[:, 1]  # sorted, as the vertices are
        ids = np.searchsorted(keys, corners[:, 0] << 32 | corners[:, 1])
        walls_meeting = np.bincount(ids, minlength=len(vertices))
        vertex, first = np.unique(ids[reflex], return_index=True)
        return Corners(
            vertex=vertex.astype(np.int64),
            before=before[reflex][first],
            after=after[reflex][first],
            simple=walls_meeting[vertex] == 1,
        )


class PointDistances:
    """The walking distances of some points from any place, as `Space.distances` measures them.

    It measures from the place, until it has done so for as many places as there are points; then it
    measures from each point once, as a way back is as long.

    Attributes:
        space: Where the body can be.

    Example:
        >>> import fleet2d
        >>> space = fleet2d.Home(fleet2d.load_floorplan()).space(radius=0.2)
        >>> (row, column), *_ = space.cells(0).tolist()
        >>> place = space.plan.lattice.cell_centre(row, column)
        >>> PointDistances(space, np.array([place])).of(place).tolist()
        [0.0]
    """

    def __init__(self, space: Space, points: I64) -> None:
        self.space = space
        self._points = points
        self._measured = 0
        self._steps: NDArray[np.signedinteger] | None = None  # (rows, columns, points)

    def of(self, place: LatticePoint) -> F64:
        """Return the distances from a lattice point, float64 (points,) [m]."""
        if self._steps is None and self._measured < len(self._points):
            self._measured += 1
            return self.space.distances(place, self._points)
        if self._steps is None:
            steps = np.stack([self.space._steps(point) for point in self._points], axis=-1)
            self._steps = steps.astype(np.min_scalar_type(-int(steps.max())))  # half the memory
        x, y = place
        return self.space._metres(self._steps[y // SUB, x // SUB])


@dataclass(frozen=True)
class Passing:
    """The use of a portal.

    Attributes:
        begin: Where the body walks to [lattice].
        end: Where it walks on from [lattice].
        takes_us: How long it takes from one to the other [us].
    """

    begin: LatticePoint
    end: LatticePoint
    takes_us: int


class LinkedSpace(Space):
    """The space of a body that uses portals: parts that these link are one part.

    Routes are within one storey, as before; `passings` has the portals on the way to another.
    """

    def __init__(self, base: Space, portals: Sequence[Portal]) -> None:
        """Link the parts of a space.

        Args:
            base: The space without portals.
            portals: The portals of its plan.
        """
        self.__dict__.update(base.__dict__)
        self.base = base
        self.portals = tuple(portals)
        self._cache_searches()
        self._passings: list[Passing] = []
        owner = np.arange(base.parts)
        for portal in portals:
            begin = self._end(portal.start)
            end = self._end(portal.end)
            if begin is None or end is None:
                continue  # furniture bars it
            ways = ((begin, end), (end, begin))
            self._passings += [Passing(*way, portal.takes_us) for way in ways]
            first, second = (owner[base.part_at(*place)] for place in (begin, end))
            owner[owner == max(first, second)] = min(first, second)
        # Part 0 stays the largest, unless parts that portals link are larger together.
        sizes = np.bincount(base.part_of_cell[base.part_of_cell >= 0], minlength=base.parts)
        total = np.bincount(owner, sizes, minlength=base.parts)
        self._rank = np.argsort(np.argsort(-total, kind="stable"))[owner].astype(np.int32)
        self.part_of_cell = read_only(np.append(self._rank, np.int32(-1))[base.part_of_cell])
        self.parts = len(set(owner.tolist()))

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle it by the arguments that it was made from."""
        return LinkedSpace, (self.base, self.portals)

    def part_at(self, x: int, y: int) -> int:
        """Return the part of a lattice point strictly inside the space, else -1."""
        part = self.base.part_at(x, y)
        return int(self._rank[part]) if 0 <= part < len(self._rank) else -1

    def passings(self, start: LatticePoint, goal: LatticePoint) -> list[Passing]:
        """Return the portals on the way from one lattice point to another, in order.

        The way is the shortest, in straight lines and with the times of portals as metres.
        """
        base = self.base
        metre = self.plan.lattice.units_per_m
        goal_part = base.part_near(*goal)
        queue: list[tuple[float, int, LatticePoint, list[Passing]]] = [(0.0, 0, start, [])]
        best: dict[LatticePoint, float] = {}
        tries = 0
        while queue:
            length, _, place, used = heapq.heappop(queue)
            if place == goal:
                return used
            if best.get(place, np.inf) <= length:
                continue
            best[place] = length
            part = base.part_near(*place)
            ways = [(goal, used, 0.0)] if part == goal_part else []
            ways += [
                (p.end, [*used, p], math.dist(place, p.begin) / metre + p.takes_us / SECOND_US)
                for p in self._passings
                if base.part_at(*p.begin) == part
            ]
            for other, through, metres in ways:
                tries += 1
                far = metres or math.dist(place, goal) / metre
                heapq.heappush(queue, (length + far, tries, other, through))
        return []

    def _end(self, at: tuple[float, float]) -> LatticePoint | None:
        """Return where a body stands at the end of a portal [lattice], or None if nowhere."""
        x, y = self.plan.lattice.point_at(at)
        if 0 <= self.base.part_at(x, y) < self.base.parts:
            return x, y
        near = self.base.nearest(x, y)
        if near is None or math.dist(near, (x, y)) > PORTAL_REACH_M * self.plan.lattice.units_per_m:
            return None
        return near


def shrink(
    polygons: Sequence[Polygon], radius: float, blocked: Sequence[BaseGeometry] = ()
) -> list[Polygon]:
    """Shrink polygons by an octagon of at least `radius` to each side.

    Args:
        polygons: Free space [lattice].
        radius: The radius of the body [lattice].
        blocked: Shapes that are removed from the result.
    """
    octagon = body_octagon(radius)
    shrunk: list[Polygon] = []
    for polygon in polygons:
        moved = _with_walls_moved(polygon, octagon)
        if moved is not None:
            if len(blocked):
                rest = shapely.difference(moved, shapely.union_all(blocked))
                shrunk += _snapped_parts(rest)
            else:
                shrunk.append(moved)
            continue
        grown = [_grow_walls(np.asarray(r.coords), octagon) for r in shapely.get_rings(polygon)]
        grown.append(np.array(blocked, np.object_))
        rest = shapely.difference(polygon, shapely.union_all(np.concatenate(grown)))
        shrunk += _snapped_parts(rest)
    return shrunk


def _snapped_parts(shape: BaseGeometry) -> list[Polygon]:
    """Return the parts of a shape that have an area, on the lattice."""
    parts = shapely.get_parts(shape)
    sound = [part for part in parts if part.geom_type == "Polygon" and part.area > 0]
    return [polygon for part in sound for polygon in snap_polygon(part).polygons]


def _with_walls_moved(polygon: Polygon, octagon: I64) -> Polygon | None:
    """Return a polygon whose sides are parallel to the axes, shrunk by an octagon, side by side.

    None if a side would vanish, or sides would cross: there only the shapes can tell what is left.
    """
    reach, half = octagon[0].tolist()
    rings = []
    for ring in shapely.get_rings(shapely.orient_polygons(polygon)):
        corners = shapely.get_coordinates(ring)[:-1].astype(np.int64)
        rings.append(move_walls(corners, reach, half))
    if not all(map(len, rings)):
        return None
    shape = Polygon(rings[0], rings[1:])
    return shape if shape.is_valid else None


def _near(cell: int) -> slice:
    return slice(max(0, cell - NEAR_CELLS), max(0, cell + NEAR_CELLS + 1))


@lru_cache(64)
def body_octagon(radius: float) -> I64:
    """Return the corners of the octagon that approximates a body."""
    a = 2 * math.ceil((radius + ROUNDING) / 2)
    # tan(22.5 degrees), rounded up: the slanted sides are no nearer than the straight ones.
    b = 2 * math.ceil(a * 0.41421357 / 2)
    return read_only(_octagon(a, b))


def _octagon(a: int, b: int) -> I64:
    """Return the corners of an octagon whose straight sides are at `a` and reach to `b`."""
    return np.array([(a, b), (b, a), (-b, a), (-a, b), (-a, -b), (-b, -a), (b, -a), (a, -b)])


def grow_shape(corners: F64, radius: float) -> BaseGeometry:
    """Grow a line, or the inside of a ring [lattice], by the octagon of a body.

    Args:
        corners: Two ends, or the closed ring of an outline, float64 (n, 2).
        radius: The radius of the body [lattice].
    """
    if len(corners) < 4:
        return shapely.union_all(_grow_walls(corners, body_octagon(radius)))
    return grow_polygons([Polygon(corners)], radius)[0]


def grow_polygons(polygons: Sequence[Polygon], radius: float) -> list[BaseGeometry]:
    """Grow polygons without holes [lattice] by the octagon of a body; see `grow_shape`."""
    octagon = body_octagon(radius)
    solid = np.array(polygons, np.object_)
    grown = np.empty(len(solid), np.object_)
    is_round = shapely.area(solid) >= shapely.area(shapely.convex_hull(solid)) * (1 - CONVEX_SLACK)
    corners, number = shapely.get_coordinates(solid[is_round], return_index=True)
    ends = (corners[:, None] + octagon).reshape(-1, 2)
    ends_of = shapely.multipoints(ends, indices=np.repeat(number, len(octagon)))
    grown[is_round] = shapely.convex_hull(ends_of)
    for i in np.flatnonzero(~is_round):
        walls = _grow_walls(shapely.get_coordinates(solid[i]), octagon)
        grown[i] = shapely.union_all([*walls, solid[i]])
    return list(grown)


def grow_boxes(boxes: I64, radius: float) -> NDArray[np.object_]:
    """Grow upright rectangles by the octagon of a body, as `grow_polygons` does.

    Args:
        boxes: Least x and y, and greatest, int64 (n, 4) [lattice].
        radius: The radius of the body [lattice].
    """
    return np.asarray(shapely.polygons(boxes[:, _BOX_CORNERS] + body_octagon(radius)))


# Which x and which y of a box is the middle of each corner of an octagon's way round it.
_BOX_CORNERS = np.array([(2, 3), (2, 3), (0, 3), (0, 3), (0, 1), (0, 1), (2, 1), (2, 1)])


# What an area may lack of that of its hull, by rounding.
CONVEX_SLACK = 1e-9


def _grow_walls(ring: F64, octagon: I64) -> NDArray[np.object_]:
    """Grow every wall of a ring by the octagon; return convex polygons."""
    ends = np.concatenate([ring[:-1, None] + octagon, ring[1:, None] + octagon], axis=1)
    return np.asarray(shapely.convex_hull(shapely.multipoints(ends)))


@lru_cache(CACHED_ROUTES)
def straight_way(begin: LatticePoint, end: LatticePoint) -> I64:
    """Return the straight route, int64 (2, 2), read-only as those of `Space.route` are."""
    return read_only(np.array([begin, end], np.int64))


BODY_RADIUS = 0.25
"""The radius of the body that furniture leaves space for [m]: that of a large person."""

# How far from a place of use a body may stand [m]; and how far from it a body that sits or lies
# there may get up.
STAND_REACH = 0.35
SIT_REACH = 1.6
# Number of cells that are tried for a way onto a piece of furniture, nearest first.
ATTEMPTS = 600
# So many of them in sight are sought at first.
FIRST_ATTEMPTS = 6
# What snapping of the grown footprint may add [lattice].
SLACK = 8
HALF = UNITS_PER_CELL // 2

Window = tuple[slice, slice]


def standing_cells(
    plan: FloorPlan, radius: float, objects: Iterable[PlacedObject] | None = None
) -> Bool:
    """Return the cells where the middle of a body can be, bool (rows, columns).

    A cell beside furniture counts only if the body can be at every point of it, so that a body can
    walk between neighboring cells.

    Args:
        plan: The floor plan.
        radius: The body's radius [m].
        objects: The furniture in the way; None for the plan's.

    Raises:
        FloorPlanError: The body fits nowhere between the walls.
    """
    cells = Space(plan, radius).part_of_cell >= 0
    for thing in plan.objects if objects is None else objects:
        if thing.blocks != "nothing":
            window, covered = grown_cells(plan.lattice, thing.footprint, radius)
            cells[window] &= ~covered
    return cells


def grown_cells(lattice: Lattice, footprint: Polygon, radius: float) -> tuple[Window, Bool]:
    """Return the cells on which a body of a radius [m] would touch a footprint [m].

    Returns:
        The rows and columns of the smallest window that holds them, and which of its cells.
    """
    reach = radius * lattice.units_per_m + HALF + SLACK
    a = int(np.ceil(reach))
    b = int(np.ceil(reach * 0.41421357))
    upright = _upright_rectangle(footprint)
    if upright is not None:
        return _cells_by_rectangle(lattice, lattice.to_lattice(upright), a, b)
    octagon = _octagon(a, b)
    convex: BaseGeometry = footprint
    solid_area = footprint.convex_hull.area * (1 - CONVEX_SLACK)
    if footprint.interiors or footprint.area < solid_area:
        convex = shapely.constrained_delaunay_triangles(footprint)
    hulls = []
    for piece in shapely.get_parts(convex):
        corners = lattice.to_lattice(shapely.get_coordinates(piece)[:-1])
        hull = shapely.convex_hull(shapely.multipoints((corners[:, None] + octagon).reshape(-1, 2)))
        hulls.append(shapely.get_coordinates(shapely.orient_polygons(hull)).astype(np.int64))
    corners = np.concatenate(hulls)
    window = _window(lattice, corners.min(axis=0).tolist(), corners.max(axis=0).tolist())
    rows, columns = window
    x = _centres(columns)[None, :]
    y = _centres(rows)[:, None]
    covered = np.zeros((y.shape[0], x.shape[1]), np.bool_)
    for corners in hulls:
        inside = np.ones_like(covered)
        for (ax, ay), (bx, by) in pairwise(corners.tolist()):
            inside &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0
        covered |= inside
    return window, covered


def _upright_rectangle(footprint: Polygon) -> F64 | None:
    """Return the low and high corner of a rectangle that is parallel to the axes, float64 (2, 2).

    None for another shape.
    """
    corners = shapely.get_coordinates(footprint)
    if (corners[1:] == corners[:-1]).tolist() not in _UPRIGHT_SIDES:
        return None
    return np.reshape(footprint.bounds, (2, 2))


# Which coordinate each side of an upright rectangle leaves as it is.
_UPRIGHT_SIDES = ([[True, False], [False, True]] * 2, [[False, True], [True, False]] * 2)


def _cells_by_rectangle(lattice: Lattice, corners: I64, a: int, b: int) -> tuple[Window, Bool]:
    """Return the cells in a rectangle that is grown by an octagon; see `grown_cells`.

    Args:
        lattice: The lattice.
        corners: The low and the high corner of the rectangle [lattice], int64 (2, 2).
        a: How far the octagon's straight sides are from its middle [lattice].
        b: Half the length of these sides [lattice].
    """
    (x0, y0), (x1, y1) = corners.tolist()
    rows, columns = _window(lattice, (x0 - a, y0 - a), (x1 + a, y1 + a))
    xs = _centres(columns)
    ys = _centres(rows)
    # How far they are beyond its nearer side; less than 0 between the two.
    x = np.maximum(x0 - xs, xs - x1)
    y = np.maximum(y0 - ys, ys - y1)
    is_near = (x <= a)[None, :] & (y <= a)[:, None]
    return (rows, columns), is_near & (x[None, :] + y[:, None] <= a + b)


def with_approaches(
    plan: FloorPlan, thing: PlacedObject, standing: Bool, others: Iterable[PlacedObject] = ()
) -> PlacedObject:
    """Return an object with only those places of use that a body can get to.

    A person who stands at an object stands on the nearest cell where a body can stand. A person who
    sits or lies on it gets there from the nearest such cell in sight of the place.

    Args:
        plan: The floor plan.
        thing: The object; `standing` already excludes its footprint.
        standing: Cells where the middle of the body can be, bool (rows, columns).
        others: Other objects, over which no body steps, except for a chair to sit on.
    """
    if not thing.uses:
        return thing
    x0, y0, x1, y1 = thing.footprint.bounds
    near = shapely.box(x0 - SIT_REACH, y0 - SIT_REACH, x1 + SIT_REACH, y1 + SIT_REACH)
    blocking = [o.footprint for o in others if o.blocks != "nothing" and o is not thing]
    solid = np.array(blocking, np.object_)
    solid = solid[shapely.intersects(near, solid)]
    uses = []
    for use in thing.uses:
        is_seat = use.posture != "stand"
        reach = SIT_REACH if is_seat else STAND_REACH
        obstacles = solid
        if is_seat:
            obstacles = solid[~shapely.intersects_xy(solid, use.x, use.y)]
        cell = nearest_standing(plan, use, standing, reach, obstacles)
        if cell is None:
            continue
        x, y = plan.lattice.to_metres(plan.lattice.cell_centre(*cell)).tolist()
        if use.posture == "stand":
            use = replace(use, x=x, y=y)
        uses.append(replace(use, approach=(x, y)))
    return replace(thing, uses=tuple(uses))


def nearest_standing(
    plan: FloorPlan,
    use: UsePlace,
    standing: Bool,
    reach: float,
    obstacles: Sequence[Polygon] | NDArray[np.object_] = (),
) -> LatticePoint | None:
    """Return the cell (row, column) from which a body gets to a place of use, or None.

    Args:
        plan: The floor plan.
        use: The place.
        standing: Cells where the middle of the body can be, bool (rows, columns).
        reach: Largest distance from the place [m].
        obstacles: Shapes over which no body steps [m].
    """
    lattice = plan.lattice
    x, y = lattice.point_at(use.at)
    if not strictly_inside(plan.mesh, x, y):
        return None
    units = int(reach * lattice.units_per_m) + HALF
    tried = 0
    # Mostly one of the first will do, so others are sought only if none does.
    for wanted in (FIRST_ATTEMPTS, ATTEMPTS):
        cells = nearest_cells_in_sight(plan.mesh, standing, x, y, units, ATTEMPTS, wanted)
        for row, column in cells[tried:].tolist():
            ends = [use.at, lattice.xy_of(*lattice.cell_centre(row, column))]
            step = shapely.linestrings(ends)  # quicker than the constructor
            if not shapely.intersects(step, obstacles).any():
                return row, column
        tried = wanted
    return None


def _window(lattice: Lattice, low: Sequence[int], high: Sequence[int]) -> Window:
    """Return the rows and columns of the cells between two lattice points."""
    columns, rows = (
        slice(min(max(first // SUB, 0), count), min(max(last // SUB + 1, 0), count))
        for first, last, count in zip(low, high, (lattice.columns, lattice.rows), strict=True)
    )
    return rows, columns


def _centres(cells: slice) -> I64:
    """Return the x of the centres of some columns, or the y of those of rows, int64 (n,)."""
    return np.arange(cells.start, cells.stop, dtype=np.int64) * SUB + CELL_CENTRE
