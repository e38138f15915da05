"""
The compiled core of Fleet2D: arrays and integers in, arrays and integers out.
"""

from collections.abc import Callable, Sequence
import enum
from typing import Any, overload

import numpy
import numpy.typing


SUB: int = 64

CELL_CENTRE: int = 33

BUCKET: int = 256

OUTSIDE: int = -1

WALL: int = -1

class Mesh:
    """
    A triangulation of free space without extra points; it never changes.

    It may have holes and several components.

    Args:
        vertices: int64 (n, 2), lattice units, sorted by (x, y), so numbers don't depend on the triangles.
        triangles: int32 (t, 3), numbers of vertices, counter-clockwise.
        neighbors: int32 (t, 3), the triangle across edge k (vertex k to vertex k + 1), -1 for a wall.

    Raises:
        ValueError: An array has another shape, or a number in it is none of a vertex or triangle.
    """

    def __init__(self, vertices: numpy.typing.NDArray[numpy.int64], triangles: numpy.typing.NDArray[numpy.int32], neighbors: numpy.typing.NDArray[numpy.int32]) -> None: ...

    @property
    def vertices(self) -> numpy.typing.NDArray[numpy.int64]:
        """int64 (n, 2), lattice units, sorted by (x, y)."""

    @property
    def triangles(self) -> numpy.typing.NDArray[numpy.int32]:
        """int32 (t, 3), numbers of vertices, counter-clockwise."""

    @property
    def neighbors(self) -> numpy.typing.NDArray[numpy.int32]:
        """
        int32 (t, 3), the triangle across edge k (vertex k to vertex k + 1), -1 for a wall.
        """

    @property
    def bucket_start(self) -> numpy.typing.NDArray[numpy.int32]:
        """
        int32 (rows * columns + 1,), where each square bucket begins in `bucket_triangles`.
        """

    @property
    def bucket_triangles(self) -> numpy.typing.NDArray[numpy.int32]:
        """int32, the triangles that overlap each square bucket, ascending."""

    @property
    def bucket_columns(self) -> int:
        """Number of buckets along x."""

    @property
    def bucket_rows(self) -> int:
        """Number of buckets along y."""

    def with_neighbors(self, neighbors: numpy.typing.NDArray[numpy.int32]) -> Mesh:
        """Return the mesh with other walls: `neighbors` as for the class."""

    def __getstate__(self) -> tuple[Any, ...]: ...

    def __setstate__(self, arg: tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int32]], /) -> None: ...

def locate(mesh: Mesh, x: int, y: int) -> int:
    """
    Return the lowest triangle that holds the point (borders included), or -1 outside.
    """

def orient(ax: int, ay: int, bx: int, by: int, cx: int, cy: int) -> int:
    """
    Return twice the signed area of (a, b, c): positive when c lies left of the line from a to b.
    """

def contains_triangle(mesh: Mesh, triangle: int, x: int, y: int) -> bool:
    """Return whether the closed triangle holds the point."""

def strictly_inside(mesh: Mesh, x: int, y: int) -> bool:
    """Return whether the point lies in free space and on no wall."""

def rasterize_cells(mesh: Mesh, rows: int, columns: int) -> numpy.typing.NDArray[numpy.int32]:
    """
    Return the triangle of every cell centre that lies strictly inside free space.

    Returns:
        int32 (rows, columns): the lowest triangle that holds the centre; -1 for a centre outside or
        on a wall.
    """

def label_triangles(neighbors: numpy.typing.NDArray[numpy.int32]) -> numpy.typing.NDArray[numpy.int32]:
    """
    Number the connected parts of a mesh; returns each triangle's part, int32 (triangles,).
    """

TURN: int = 4096

HALF_TURN: int = 2048

QUARTER: int = 1024

UNIT: int = 1073741824

SINES: numpy.ndarray = ...

def half_sine(half: int) -> int:
    """Return UNIT * sine of `half` / 8192 of a turn."""

def sine(heading: int) -> int:
    """Return UNIT * sine of a heading (any integer)."""

def cosine(heading: int) -> int:
    """Return UNIT * cosine of a heading (any integer)."""

def heading_of(dx: int, dy: int) -> int:
    """
    Return the heading nearest to the vector (dx, dy) [lattice units]; 0 for a null vector.
    """

def turn_between(start: int, end: int) -> int:
    """
    Return the shorter signed turn from `start` to `end`, in [-2048, 2047].
    """

BELL_MEAN: int = 1020

BELL_STD: float = 209.0215299915

def random_bits(key: int | numpy.uint64, counter: int | numpy.integer[Any]) -> int:
    """
    Return 64 random bits for `counter` (0 to 2**64 - 1) of the stream `key`.
    """

def random_below(key: int | numpy.uint64, counter: int | numpy.integer[Any], bound: int) -> int:
    """
    Return an integer in [0, bound), 0 < bound < 2**31, by multiply and shift.
    """

def random_uniform(key: int | numpy.uint64, counter: int | numpy.integer[Any]) -> float:
    """Return a float in [0, 1), a multiple of 2**-53."""

def random_bell(key: int | numpy.uint64, counter: int | numpy.integer[Any]) -> int:
    """
    Return a bell-shaped integer in [-1020, 1020], mean 0, standard deviation BELL_STD.

    The sum of eight uniform bytes: close to normal (excess kurtosis -0.15), cut at 4.88 standard
    deviations, and exact on every machine, which a logarithm or a cosine is not.
    """

def random_bells(key: int, counters: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.int64]:
    """Return the bell-shaped integer of each counter, int64 (n,)."""

class StepDraws:
    """
    The draws of one stream at one step, one after the other.

    Args:
        key: Of the stream.
        step: 0 to 2**64 - 1.
    """

    def __init__(self, key: int | numpy.uint64, step: int | numpy.integer[Any]) -> None: ...

    def below(self, bound: int | numpy.integer[Any]) -> int:
        """Return an integer from 0 to bound - 1; `bound` is below 2**31."""

    def uniform(self) -> float:
        """Return a float64 in [0, 1)."""

    def __getstate__(self) -> tuple[int, int]: ...

    def __setstate__(self, state: tuple[int, int], /) -> None: ...

class Bits:
    """Small draws, several from each draw of a stream."""

    def __init__(self, draws: StepDraws) -> None: ...

    def take(self, count: int) -> int:
        """
        Return a number from 0 to 2**count - 1, all equally likely; `count` is 30 at most.
        """

def near_wedge(heading: int, half_angle: int, dx: int, dy: int, reach: int) -> bool:
    """
    Return whether anything within `reach` of (dx, dy) may lie in a wedge; exact at reach 0.
    """

def in_wedge(heading: int, half_angle: int, dx: int, dy: int) -> bool:
    """
    Return whether (dx, dy) lies within `half_angle` [1/8192 turn] of a heading, or on the border.
    """

def camera_pose(lenses: tuple[Any, ...], camera: int, x: int, y: int, heading: int, moment_us: int) -> tuple[int, int, int]:
    """
    Return where a camera is and where it looks; the offset is rounded to the lattice.
    """

def hides(px: int, py: int, bx: int, by: int, radius: int) -> bool:
    """
    Return whether a body hides a point, both from the eye [lattice units].

    The point of the sight line that is nearest to the body's centre lies between the ends, neither
    included, and not farther from it than its radius.
    """

def points_in_view(walls: Mesh, lenses: tuple[Any, ...], camera: int, user: int, x: int, y: int, heading: int, dx: int, dy: int) -> int:
    """
    Return which points of a user's body are in view of a camera, bit i for number i; its centre is at (dx, dy).
    """

@overload
def line_of_sight(mesh: Mesh, qx: int, qy: int, triangle: int, px: int, py: int) -> bool:
    """
    Return whether p is visible from q: the segment between them touches no wall point.

    A point outside or on a wall sees nothing and isn't seen.

    Args:
        mesh: Free space.
        qx: Position of the eye [lattice units].
        qy: Position of the eye [lattice units].
        triangle: A triangle that holds q, from `locate`; -1 is allowed.
        px: Position of the point [lattice units].
        py: Position of the point [lattice units].
    """

@overload
def line_of_sight(mesh: Mesh, qx: int, qy: int, px: int, py: int) -> bool:
    """Return whether p is visible from q, wherever q is; see the other form."""

def nearest_cells_in_sight(mesh: Mesh, cells: numpy.typing.NDArray[numpy.bool_], x: int, y: int, reach: int, most: int, wanted: int) -> numpy.typing.NDArray[numpy.int64]:
    """
    Return the cells of a mask whose centres are visible from a point, nearest first.

    Args:
        mesh: Free space.
        cells: The mask, bool (rows, columns).
        x: The point [lattice units].
        y: The point [lattice units].
        reach: Largest distance of a centre from it [lattice units].
        most: So many of the nearest cells are looked at.
        wanted: So many are returned at most.

    Returns:
        Rows and columns, int64 (n, 2); of equally near cells the first in the mask comes first.
    """

def build_fans(mesh: Mesh) -> tuple[numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int32]]:
    """
    List the triangles around each vertex.

    Returns:
        int32 (vertices + 1,), where the triangles of each vertex begin in the list; and the list,
        int32, ascending for each vertex.
    """

def vertices_seen_from_point(mesh: Mesh, x: int, y: int) -> numpy.typing.NDArray[numpy.int32]:
    """
    Return the vertices visible from a point.

    The segment between the point and the vertex touches no wall and no other vertex. A point on a wall
    also sees the ends of that wall. A point at a vertex sees only that vertex.

    Args:
        mesh: Free space.
        x: The point, lattice units.
        y: The point, lattice units.

    Returns:
        int32 (n,), in no particular order, each once; none from a point outside.
    """

def vertices_seen_from_vertex(mesh: Mesh, vertex: int) -> numpy.typing.NDArray[numpy.int32]:
    """
    Return the vertices visible from a vertex.

    The segment between the two touches no wall and no other vertex, or it runs along one wall.

    Args:
        mesh: Free space.
        vertex: The vertex to start from.

    Returns:
        int32 (n,), in no particular order, each once.
    """

def pairs_in_sight(mesh: Mesh, eyes: numpy.typing.NDArray[numpy.int64], places: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.bool_]:
    """
    Return for each pair whether the two see each other; places on a wall see nothing.

    Fastest if pairs of the same eye follow each other.

    Args:
        mesh: Free space.
        eyes: int64 (n, 2), lattice points.
        places: int64 (n, 2), lattice points, one for each eye.

    Returns:
        bool (n,).
    """

def label_frames(labels: numpy.typing.NDArray[numpy.int32], count: int) -> numpy.typing.NDArray[numpy.int64]:
    """
    Return the smallest box of cells around each label.

    Args:
        labels: int32 (rows, columns), below `count`, -1 for none.
        count: Number of labels.

    Returns:
        First row, first column, last row and last column, plus one, int64 (count, 4); of a label
        without cells first ones beyond the last.
    """

def fill_from_neighbors(labels: numpy.typing.NDArray[numpy.int16]) -> numpy.typing.NDArray[numpy.int16]:
    """
    Label cells without a label like a cell that touches them.

    First of one across a side, then of one across a corner; west before east, south before north.

    Args:
        labels: int16 (rows, columns), -1 for none.

    Returns:
        Labels, int16 (rows, columns).
    """

def spread_labels(labels: numpy.typing.NDArray[numpy.int32], mask: numpy.typing.NDArray[numpy.bool_]) -> numpy.typing.NDArray[numpy.int32]:
    """
    Label every cell of a mask that has no label like the nearest labelled cell, in steps across sides.

    Of equally near labels, the lowest counts.

    Args:
        labels: int32 (rows, columns), -1 for none; labels outside the mask are ignored.
        mask: Where labels may spread, bool (rows, columns).

    Returns:
        Labels, int32 (rows, columns); -1 outside the mask and for cells that can't be reached from a label.
    """

def label_parts(mask: numpy.typing.NDArray[numpy.bool_], diagonal: bool) -> numpy.typing.NDArray[numpy.int32]:
    """
    Number the connected parts of a mask in the order of their first pixels, row by row.

    Args:
        mask: bool (rows, columns).
        diagonal: Whether pixels that share only a corner are connected.

    Returns:
        Each pixel's part, int32 (rows, columns); -1 outside the mask.
    """

def count_steps(start: numpy.typing.NDArray[numpy.bool_], mask: numpy.typing.NDArray[numpy.bool_]) -> numpy.typing.NDArray[numpy.int32]:
    """
    Count the steps from pixel to pixel across sides, inside a mask, from the nearest start.

    Args:
        start: Where to start, bool (rows, columns); pixels outside the mask don't count.
        mask: Where steps may lead, bool (rows, columns).

    Returns:
        Steps, int32 (rows, columns); 0 at the start, -1 for unreachable pixels.
    """

def trace_rings(mask: numpy.typing.NDArray[numpy.bool_]) -> tuple[numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int64]]:
    """
    Return the border rings of a mask, along the sides of the pixels.

    Rings have the mask on their left: outer ones run counter-clockwise, holes clockwise (x is the
    column, y is the row). Where two pixels of the mask share only a corner, a ring turns right, so
    each ring round one part (connected across sides) passes a point at most once.

    Args:
        mask: bool (rows, columns).

    Returns:
        The corners of all rings, int32 (n, 2) as (x, y), 0 to columns and 0 to rows; and where each
        ring starts among them, int64 (rings + 1,).
    """

MAX_COST: int = 1000

def squared_distance(mask: numpy.typing.NDArray[numpy.bool_]) -> numpy.typing.NDArray[numpy.int64]:
    """
    Return each cell's exact squared distance to the nearest cell that is not in `mask`.

    Cells outside the array are ignored: surround the mask by one line of False where the
    border is a wall.

    Args:
        mask: Cells to measure, bool (rows, columns).

    Returns:
        Squared distances in cells, int64 (rows, columns); 0 outside the mask, and
        (rows + columns)² everywhere in a mask that has no outside.
    """

def box_sums(values: numpy.typing.NDArray[numpy.int64], reach: int) -> numpy.typing.NDArray[numpy.int64]:
    """
    Return the sum of the values in the square of cells that reaches so far to all sides of each.

    Args:
        values: int64 (rows, columns); outside the array they are 0.
        reach: Cells to each side.

    Returns:
        int64 (rows, columns).
    """

def climb(labels: numpy.typing.NDArray[numpy.int32], height: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.int32]:
    """
    Return the peak of each cell, to which the steepest way up leads.

    Ways lead across sides, from label to equal label. Of equally high cells, later ones count as higher.

    Args:
        labels: int32 (rows, columns), -1 for none.
        height: int64 (rows, columns).

    Returns:
        Peaks, numbered row by row, int32 (rows, columns); -1 for cells without a label.
    """

def walking_distance(mask: numpy.typing.NDArray[numpy.bool_], goals: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.int32]:
    """
    Return the walking distance from each cell to the nearest goal.

    A step to a side costs 5 and one across a corner 7, which is open only if both cells beside it
    are.

    Args:
        mask: Cells that can be walked, bool (rows, columns).
        goals: Goal cells, int64 (n, 2) as (row, column); goals outside the mask are ignored.

    Returns:
        int32 (rows, columns), fifths of a cell's side; -1 where no goal can be reached.
    """

def step_cost(cost: numpy.typing.NDArray[numpy.int32], row: int, column: int, r: int, c: int) -> int:
    """
    Return the cost of a step between two neighboring cells [1/1000 of a cell's side].
    """

def cheapest_cells(cost: numpy.typing.NDArray[numpy.int32], start: tuple[int, int], goal: tuple[int, int]) -> numpy.typing.NDArray[numpy.int64]:
    """
    Return the cells of a cheapest path from one cell to another.

    A step to a side is 5 long and one across a corner 7, which is open only if both cells beside it
    are; half of it counts by the cost of the cell that it leaves, half by that of the one it enters.
    Of equally cheap next cells it takes the first.

    Args:
        cost: int32 (rows, columns), in percent of what a way costs besides: 100 counts double; from
            0 to 1000, or -1 where no way leads.
        start: The cell (row, column) where it begins.
        goal: The cell (row, column) where it ends.

    Returns:
        int64 (n, 2) as (row, column); empty if there is no path.
    """

def corner_sums(mask: numpy.typing.NDArray[numpy.bool_]) -> numpy.typing.NDArray[numpy.int32]:
    """
    Count the cells of a mask above and left of each corner of the cells.

    Args:
        mask: bool (rows, columns).

    Returns:
        int32 (rows + 1, columns + 1).
    """

def group_places(floor: tuple[Any, ...], occupied: numpy.typing.NDArray[numpy.bool_], group: tuple[Any, ...]) -> numpy.typing.NDArray[numpy.int64]:
    """
    Return where a group of furniture can be in a room, and how good each place is.

    Args:
        floor: The room, a `RoomFloor`.
        occupied: Cells that other things occupy, bool (rows, columns).
        group: The group, a `GroupRule`.

    Returns:
        Turn, first row and first column in the turned window, and points, int64 (n, 4); by turn, row
        and column.
    """

INNER_WALL: int = 2

DEEPEST_STRIP: int = 240

def squarest_rooms(trees: tuple[Any, ...], areas: numpy.typing.NDArray[numpy.float64], sides: numpy.typing.NDArray[numpy.int64], mouths: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.int64]:
    """
    Return the rooms of the tree that makes them squarest in a rectangle, the first if tied.

    Args:
        trees: The trees, `Divisions`.
        areas: Gross area of each room, float64 (rooms,) [units²].
        sides: The rectangle x0, y0, x1, y1, int64 (4,) [units].
        mouths: Ends of corridors at a side of it, at which no wall should end, int64 (n, 4).

    Returns:
        Room and sides of each box, int64 (n, 5).
    """

def is_promising(boxes: numpy.typing.NDArray[numpy.int64], limits: numpy.typing.NDArray[numpy.float64]) -> bool:
    """
    Return whether rooms could fit at another scale: none is far too narrow or too long.

    Args:
        boxes: Room and sides of each box, int64 (n, 5) [units].
        limits: Least shorter side [units] and largest ratio of the sides of each room, float64
            (rooms, 2).
    """

def strip_rooms(slots: numpy.typing.NDArray[numpy.int64], areas: numpy.typing.NDArray[numpy.float64], length: int, least: int, most: int) -> numpy.typing.NDArray[numpy.int64]:
    """
    Return rooms side by side along x, from 0 on, with their front at y = 0.

    Args:
        slots: A room, the one behind it or -1, and how much deeper than the others they are, int64 (n, 3).
        areas: Gross area of each room, float64 (rooms,) [units²].
        length: Their length [units].
        least: Least depth [units].
        most: Largest depth [units].

    Returns:
        Room and sides of each box, int64 (n, 5); none if no such depth has that length.
    """

def row_rooms(slots: numpy.typing.NDArray[numpy.int64], areas: numpy.typing.NDArray[numpy.float64], corridor: tuple[Any, ...], length: int, least: int, most: int) -> numpy.typing.NDArray[numpy.int64]:
    """
    Return the rooms of a strip above a corridor that begins at y = 0; see `strip_rooms`.

    Args:
        slots: As of `strip_rooms`.
        areas: Gross area of each room, float64 (rooms,) [units²].
        corridor: The corridor, a `CorridorRule`.
        length: The length of both [units].
        least: Least depth of the strip [units].
        most: Its largest depth [units].

    Returns:
        Room and sides of each box, int64 (n, 5), those of the corridor last; none if they don't fit.
    """

def wing_rooms(front: numpy.typing.NDArray[numpy.int64], back: numpy.typing.NDArray[numpy.int64], areas: numpy.typing.NDArray[numpy.float64], corridor: tuple[Any, ...], back_depth: int, least: int, most: int) -> tuple[numpy.typing.NDArray[numpy.int64], int]:
    """
    Return the rooms of a wing: a strip below a corridor that begins at y = 0, and one above.

    Args:
        front: The slots of the strip below it, as of `strip_rooms`.
        back: Those of the strip above it.
        areas: Gross area of each room, float64 (rooms,) [units²].
        corridor: The corridor, a `CorridorRule`.
        back_depth: Depth of the strip above it [units].
        least: Least depth of the strip below it [units].
        most: Its largest depth [units].

    Returns:
        Room and sides of each box, int64 (n, 5), and the depth of the strip below; none if they don't
        fit together.
    """

def squarest_depth(front: numpy.typing.NDArray[numpy.int64], back: numpy.typing.NDArray[numpy.int64], areas: numpy.typing.NDArray[numpy.float64], corridor: tuple[Any, ...], depths: numpy.typing.NDArray[numpy.int64], least: int, most: int, limits: numpy.typing.NDArray[numpy.float64]) -> int:
    """
    Return which depth of the strip above makes the rooms of a wing squarest, the first if tied.

    Args:
        front: As of `wing_rooms`.
        back: As of `wing_rooms`.
        areas: As of `wing_rooms`.
        corridor: As of `wing_rooms`.
        depths: The depths to try, int64 (n,) [units].
        least: As of `wing_rooms`.
        most: As of `wing_rooms`.
        limits: As of `is_promising`.

    Returns:
        The index of the depth; -1 if none makes promising rooms.
    """

def move_walls(ring: numpy.typing.NDArray[numpy.int64], reach: int, half: int) -> numpy.typing.NDArray[numpy.int64]:
    """
    Return an outline whose walls along the axes are moved to their left, into the free space.

    Where it turns right, an octagon goes round the corner.

    Args:
        ring: Its corners, each once, int64 (n, 2) [lattice units].
        reach: Distance of the octagon's straight sides from its middle [lattice units].
        half: Half the length of these sides [lattice units].

    Returns:
        Its corners, int64 (m, 2); none if a wall is slanted, or if one but a step that the octagon
        hides would vanish.
    """

def wall_obstacles(corners: numpy.typing.NDArray[numpy.int64], ring_of: numpy.typing.NDArray[numpy.int64], reach: int, half: int) -> numpy.typing.NDArray[numpy.int64]:
    """
    Return the obstacles that walls are to a body, for `add_obstacles`.

    Args:
        corners: Those of closed rings, the first of each once more at its end, int64 (n, 2) [lattice units].
        ring_of: The ring of each corner, int64 (n,).
        reach: Distance of the straight sides of the body's octagon from its middle [lattice units].
        half: Half the length of these sides [lattice units].

    Returns:
        int64 (walls, 10): least and greatest x, y, x + y and x - y of each, a number that it shares
        with those that it touches, also through others, and whether it is slanted.
    """

def add_obstacles(obstacles: numpy.typing.NDArray[numpy.int64], boxes: numpy.typing.NDArray[numpy.int64], reach: int, half: int) -> tuple[numpy.typing.NDArray[numpy.int64], int]:
    """
    Add rectangles to obstacles, and count how often they may cut a body's space in two.

    Args:
        obstacles: From `wall_obstacles` or this, int64 (n, 10).
        boxes: Least x and y, and greatest, of further ones, int64 (m, 4) [lattice units].
        reach: As of `wall_obstacles`.
        half: As of `wall_obstacles`.

    Returns:
        All obstacles, int64 (n + m, 10), and the count: 0 if each part of the space that isn't covered
        whole certainly stays in one piece.
    """

def leg_cost(cost: numpy.typing.NDArray[numpy.int32], ax: int, ay: int, bx: int, by: int) -> float:
    """
    Return the cost of a straight leg [percent times lattice units]; infinite if it is blocked.

    Each part of it has the cost of the cell that it crosses.

    Args:
        cost: int32 (rows, columns), -1 where no way leads.
        ax: Position of its begin [lattice units].
        ay: Position of its begin [lattice units].
        bx: Position of its end [lattice units].
        by: Position of its end [lattice units].
    """

def pull_taut(mesh: Mesh, cost: numpy.typing.NDArray[numpy.int32], way: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.int64]:
    """
    Return a path with fewer corners: legs are joined while the result is free and not more expensive.

    Args:
        mesh: The space that the path must stay in.
        cost: int32 (rows, columns), -1 where no way leads.
        way: int64 (n, 2), lattice points; each leg lies in the space.

    Returns:
        int64 (m, 2), a subset of the points, with the first and the last.
    """

def visible_region(mesh: Mesh, x: int, y: int) -> tuple[numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int32]]:
    """
    Compute the region visible from a point.

    The pieces come counter-clockwise, the first is the one whose right border has the smallest angle in
    [0, one turn) from the x axis.

    Args:
        mesh: Free space.
        x: Position of the eye [lattice units].
        y: Position of the eye [lattice units].

    Returns:
        `right` int32 (n,), the vertex on each piece's right border, and `wall` int32 (n,), the wall
        edge, 3 * triangle + k, at which each piece ends; empty for an eye outside or on a wall.
    """

def region_contains(mesh: Mesh, x: int, y: int, right: numpy.typing.NDArray[numpy.int32], wall: numpy.typing.NDArray[numpy.int32], px: int, py: int) -> bool:
    """
    Return whether p is in the region of (x, y), as by a line of sight.

    Args:
        mesh: Free space.
        x: Position of the eye [lattice units].
        y: Position of the eye [lattice units].
        right: int32 (n,), the vertex on the right border of each of the region's pieces.
        wall: int32 (n,), the wall edge of each piece.
        px: The point, lattice units.
        py: The point, lattice units.
    """

def region_contains_points(mesh: Mesh, x: int, y: int, right: numpy.typing.NDArray[numpy.int32], wall: numpy.typing.NDArray[numpy.int32], points: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.bool_]:
    """
    Return which points are in the region of (x, y): bool (n,).

    Args:
        mesh: Free space.
        x: Position of the eye [lattice units].
        y: Position of the eye [lattice units].
        right: int32 (pieces,), as from `visible_region`.
        wall: int32 (pieces,).
        points: int64 (n, 2), lattice units.
    """

def regions_of_cells(mesh: Mesh, cells: numpy.typing.NDArray[numpy.int64], cell_triangles: numpy.typing.NDArray[numpy.int32]) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int32]]:
    """
    Find the regions visible from the centres of many cells.

    Args:
        mesh: Free space.
        cells: int64 (n, 2), row and column of each cell.
        cell_triangles: int32 (rows, columns), from `rasterize_cells`.

    Returns:
        `start` int64 (n + 1,), `right` int32, `wall` int32: the pieces of cell i are
        `right[start[i]:start[i + 1]]` and `wall[start[i]:start[i + 1]]`, as from `visible_region`.
    """

def region_outline(mesh: Mesh, x: int, y: int, right: numpy.typing.NDArray[numpy.int32], wall: numpy.typing.NDArray[numpy.int32]) -> tuple[numpy.typing.NDArray[numpy.float64], float]:
    """
    Measure a region, and list the corners of its outline.

    Args:
        mesh: Free space.
        x: Position of the eye [lattice units].
        y: Position of the eye [lattice units].
        right: int32 (n,), as from `visible_region`.
        wall: int32 (n,).

    Returns:
        For each piece the ends of its wall, right before left, float64 (2 n, 2), lattice units; and
        the area, square lattice units.
    """

def cells_in_view(mesh: Mesh, x: int, y: int, heading: int, reach: tuple[Any, ...], rows: int, columns: int) -> numpy.typing.NDArray[numpy.int32]:
    """
    Find the cells whose centre is in view: in range, within the angle, and in line of sight.

    Args:
        mesh: Free space.
        x: Position of the camera [lattice units].
        y: Position of the camera [lattice units].
        heading: Its heading [1/4096 turn].
        reach: Its range and angle, a `Reach`.
        rows: Height of the grid of cells.
        columns: Width of the grid.

    Returns:
        int32 (n, 3), row, first and last column of cells in view: none twice, in no particular order;
        empty for a camera outside or on a wall.
    """

def mark_spans(spans: numpy.typing.NDArray[numpy.int32], mask: numpy.typing.NDArray[numpy.bool_]) -> None:
    """
    Set the cells of spans in a mask.

    Args:
        spans: int32 (n, 3), row, first and last column of each.
        mask: Out: bool (rows, columns).
    """

NEVER: int = -1

def record_coverage(setup: tuple[Any, ...], window: Window, body: int, first: int, end: int, cache: tuple[Any, ...], record: tuple[Any, ...]) -> None:
    """
    Record what a robot sees in the steps from `first` to `end` - 1.

    Args:
        setup: Its cameras and the home, a `CoverageSetup`.
        window: The motion of the bodies.
        body: Number of the robot among the bodies.
        first: The first step.
        end: One past the last step.
        cache: The cached poses; emptied when it is full.
        record: What it has seen; `last` isn't updated for poses in the cache: see `settle_coverage`.
    """

def settle_coverage(setup: tuple[Any, ...], cache: tuple[Any, ...], seen: numpy.typing.NDArray[numpy.int64]) -> None:
    """
    Update the last step of each cell for the poses in the cache.

    Args:
        setup: Its cameras and the home, a `CoverageSetup`.
        cache: The cached poses.
        seen: Out: int64 (rows, columns), the last step at which each cell was in view, -1 for never.
    """

def trace_track(track: tuple[Any, ...], begin: int, step: int, out: tuple[Any, ...]) -> None:
    """
    Write the poses of a track at times begin, begin + step, ... to `out`.

    Args:
        track: Breakpoints, in order of time; of two at one time the later one counts.
        begin: Time of the first pose [us].
        step: Time between two poses [us], 1 or more.
        out: Poses, to be written to.

    Raises:
        ValueError: The times don't ascend, or a leg is so long that its interpolation leaves 64 bits.
    """

def time_route(route: numpy.typing.NDArray[numpy.int64], begin: int, heading: int, speed: float, turn_rate: float) -> numpy.typing.NDArray[numpy.int64]:
    """
    Turn a polyline into breakpoints: turn on the spot towards each leg, then walk it.

    Args:
        route: int64 (n, 2), lattice points.
        begin: Time at route[0] [us].
        heading: Heading at route[0] [1/4096 turn].
        speed: Lattice units per second.
        turn_rate: Headings per second.

    Returns:
        int64 (m, 4), rows (time, x, y, heading); the first is the start. A point twice in a row has one.
    """

def trace_meander(walls: Mesh, space: Mesh, rule: tuple[Any, ...], first: int, start: tuple[int, int, int], out: tuple[Any, ...]) -> None:
    """
    Walk at random from `start`, for as many steps as `out` has poses.

    In each step the body turns by a bell-shaped random angle and goes one stride forward. If that
    would leave `space`, the places its centre may be, it stays and turns by any angle within its
    limit instead, all equally likely, so that it comes away from the wall.

    Args:
        walls: What the body can't walk through, as Mesh.
        space: Where its centre may be, as Mesh.
        rule: WalkRule.
        first: The step of the first pose.
        start: x, y [lattice units] and heading [1/4096 turn] at that step.
        out: Poses, to be written to.
    """

def rooms_at(room_of_place: numpy.typing.NDArray[numpy.int16], x: numpy.typing.NDArray[numpy.int64], y: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.int16]:
    """
    Return the room of each place; outside of the map that at its nearest border.

    Args:
        room_of_place: int16 (rows, columns), the room of each cell.
        x: int64 (n,), lattice units.
        y: int64 (n,), lattice units.

    Returns:
        int16 (n,).
    """

def count_together(begin: numpy.typing.NDArray[numpy.int64], room: numpy.typing.NDArray[numpy.int16], other_begin: numpy.typing.NDArray[numpy.int64], other_room: numpy.typing.NDArray[numpy.int16], steps: int) -> int:
    """
    Return at how many steps two bodies are in the same room.

    Args:
        begin: int64 (n,), the step at which each visit of a body begins; rising from 0.
        room: int16 (n,), the room of each visit, below 0 for none.
        other_begin: int64 (m,), the same of the other body.
        other_room: int16 (m,), the same of the other body.
        steps: Number of steps.
    """

def sum_moves(poses: tuple[Any, ...], portals: numpy.typing.NDArray[numpy.int64]) -> float:
    """
    Return the summed length of the moves from pose to pose [lattice units].

    Args:
        poses: The poses.
        portals: int64 (m, 5), the ends of portals, which have no length: x, y, x, y, and how far from them bodies stand
            [lattice units].
    """

class ViewQueryColumn(enum.IntEnum):
    """
    The columns of a query of `view_queries`: the pose of the camera, the centre of the body.
    """

    CAMERA = 0

    BODY = 1

    EYE_X = 2

    EYE_Y = 3

    EYE_HEADING = 4

    BODY_X = 5

    BODY_Y = 6

def points_in_sight(mesh: Mesh, x: int, y: int, points: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.bool_]:
    """
    Return which of the points, int64 (n, 2), a line of sight leads to from (x, y): bool (n,).
    """

def best_view(mesh: Mesh, places: numpy.typing.NDArray[numpy.int64], points: numpy.typing.NDArray[numpy.int64], range_squared: float, halves: numpy.typing.NDArray[numpy.float64], cosine: float) -> tuple[int, int] | None:
    """
    Return the place and the direction from which a camera has most points in view.

    Args:
        mesh: Free space.
        places: int64 (m, 2), lattice points.
        points: int64 (n, 2), lattice points.
        range_squared: The range of the camera, squared [lattice units].
        halves: float64 (d, 2), unit vectors of the first half of the directions; the others, from
            number d on, are opposite to these.
        cosine: The cosine of half the angle of the camera.

    Returns:
        The number of the place and of the direction, the first ones if tied; None where no point is in
        view from any place.
    """

def points_near(points: numpy.typing.NDArray[numpy.int64], line: numpy.typing.NDArray[numpy.int64], reach: float) -> numpy.typing.NDArray[numpy.bool_]:
    """
    Return which points are nearer to a line than a distance, which is rounded as in GEOS.

    Args:
        points: int64 (n, 2), lattice points.
        line: int64 (m, 2), lattice points along the line.
        reach: The distance [lattice units].

    Returns:
        bool (n,); a line of fewer than two points is near nothing.
    """

def points_in_reach(x: int, y: int, heading: int, reach: tuple[int, int, int], points: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.bool_]:
    """
    Return which points are in range and within the angle, regardless of walls.

    Args:
        x: Position of the camera [lattice units].
        y: Position of the camera [lattice units].
        heading: Its heading [1/4096 turn].
        reach: Its range and angle, a `Reach`.
        points: int64 (n, 2).

    Returns:
        bool (n,).
    """

def view_queries(lenses: tuple[Any, ...], widest: numpy.typing.NDArray[numpy.int64], slack: int, robot: tuple[Any, ...], x: numpy.typing.NDArray[numpy.int64], y: numpy.typing.NDArray[numpy.int64], away: numpy.typing.NDArray[numpy.uint8], first: int, step_us: int) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int32]]:
    """
    List the steps at which a body may be in view of a camera: near enough, and not far beside the angle.

    Args:
        lenses: Lenses.
        widest: int64 (cameras, bodies), the largest squared distance in view.
        slack: Largest distance beside the angle [lattice units].
        robot: The n poses of the body with the cameras.
        x: int64 (bodies, n), positions of the others.
        y: int64 (bodies, n).
        away: uint8 (bodies, n), not 0 while the body is away.
        first: The step of the first pose.
        step_us: Length of a step.

    Returns:
        int64 (m, 7) by camera and body, and int32 (cameras, bodies, n): the number of the query that
        each step, from 1 on; 0 for none. Equal consecutive queries are listed once.
    """

ONE: int = 2147483648

POSTURES: int = 3

MINUTES: int = 1440

DOUBLINGS: int = 62

MAX_GHOSTS: int = 20

NOBODY: int = -1

BINS: int = 512

TABLE: int = 9235

class TablePart(enum.IntEnum):
    """The first entry of each part of a camera's table."""

    DISTANCE = 0
    """Factor to notice a user, by bin of the distance [2**-31]."""

    BEARING = 512
    """By 1/4096 turn left of the optical axis, + HALF_TURN."""

    FACING = 4608
    """By how far the user is turned away from the camera."""

    POSTURE = 6657
    """By the user's posture."""

    SHOWN = 6660
    """By the number of the body's points in view."""

    LIGHT = 6694
    """By the minute of the day."""

    STAY = 8134
    """That attention outlasts 2**i steps."""

    RIGHT = 8196
    """That a user is recognized, by bin of the distance."""

    MISTAKEN = 8708
    """That a user is mistaken for another one, likewise."""

    SEEMS = 9220
    """The perceived posture by the true one, cumulative."""

    SHIFT = 9229
    """A distance of d lattice units is in bin d >> SHIFT."""

    KEEPS = 9230
    """1 if an identity lasts as long as the user is tracked."""

    RANGE_NOISE = 9231
    """2**-16 lattice units per unit of random_bell."""

    RANGE_SHARE = 9232
    """The same per lattice unit of distance, times 2**16."""

    BEARING_NOISE = 9233
    """2**-16 / 8192 of a turn per unit of random_bell."""

    HEADING_NOISE = 9234
    """2**-16 headings per unit of random_bell."""

class UserDraw(enum.IntEnum):
    """
    What each draw about one user decides: the last axis of `ErrorTables.keys`.
    """

    DETECT = 0
    """Whether a user in view is noticed."""

    ATTEND = 1
    """Whether the last draw still holds."""

    IDENTIFY = 2
    """Whether a user is recognized, mistaken for another one, or unknown."""

    MISTAKE = 3
    """Which other user a user is mistaken for."""

    RANGE = 4
    """Error of the distance."""

    BEARING = 5
    """Error of the direction from the camera."""

    HEADING = 6
    """Error of the user's heading."""

    POSTURE = 7
    """Which posture is perceived."""

class GhostDraw(enum.IntEnum):
    """
    What each draw about false positives decides: the last axis of `ErrorTables.ghost_keys`.
    """

    COUNT = 0
    """Their number in a look."""

    SOURCE = 1
    """The source of one."""

    PLACE = 2
    """Its position."""

    IDENTITY = 3
    """Which user it looks like."""

    HEADING = 4
    """Its heading."""

class About(enum.IntEnum):
    """
    What a camera stores about one user: the last axis of `SightMemory.about`.
    """

    DRAW = 0
    """The latest draw of UserDraw.DETECT [2**-53]."""

    DRAW_STEP = 1
    """The last step at which the user was in view; -1: never."""

    LAST_IDENTITY = 2
    """The identity at the last sighting, or NOBODY."""

    TRACK_STEP = 3
    """The last step at which the user was noticed; -1: never."""

    IN_VIEW = 4
    """Looks at which the user was in view."""

    NOTICED = 5
    """Looks at which the user was noticed."""

    FORCED = 6
    """
    What an intervention makes of a user in view: 0 nothing, FORCED_MISS, or FORCED_IDENTITY + identity.
    """

FORCED_MISS: int = 1

FORCED_IDENTITY: int = 3

def random_share(key: int, counter: int) -> int:
    """Return an integer in [0, ONE)."""

def random_shares(key: int, counters: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.int64]:
    """Return the integer in [0, ONE) of each counter, int64 (n,)."""

def pick(cumulative: numpy.typing.NDArray[numpy.int64], draw: int) -> int:
    """
    Return the first outcome whose cumulative probability is above `draw`; their number if none.

    Example:
        >>> pick(np.array([ONE // 2, ONE]), ONE // 2)
        1
    """

def length(dx: int, dy: int) -> int:
    """Return the length of (dx, dy) [lattice units], rounded down."""

def distance_bin(table: numpy.typing.NDArray[numpy.int64], camera: int, dx: int, dy: int) -> int:
    """Return the bin of (dx, dy) in the tables by distance."""

def persistence_chance(table: numpy.typing.NDArray[numpy.int64], camera: int, steps: int) -> int:
    """Return the probability that attention outlasts `steps`."""

def steady_chance(table: numpy.typing.NDArray[numpy.int64], camera: int, heading: int, dx: int, dy: int, faces: int, posture: int, shown: int) -> int:
    """
    Return the product of all factors but light [2**-31] for a user at (dx, dy) from the camera.

    Args:
        table: The cameras' tables, int64 (cameras, TABLE).
        camera: Which camera.
        heading: Its heading [1/4096 turn].
        dx: Position of the user relative to the camera [lattice units].
        dy: The same.
        faces: Heading of the user [1/4096 turn].
        posture: 0 stands, 1 sits, 2 lies.
        shown: Number of points of the body in view.
    """

def notice_chance(steady: int, light: int, chance: int) -> int:
    """
    Return the probability to notice [2**-53], from [2**-31], [2**-31] and the camera's own [2**-53].
    """

def turn_and_stretch(dx: int, dy: int, turn: int, distance: int, target_length: int) -> tuple[int, int]:
    """
    Return (dx, dy), `distance` long, turned by `turn`/8192 of a turn and stretched to the length `target_length`.
    """

def perceived_offset(table: numpy.typing.NDArray[numpy.int64], keys: numpy.typing.NDArray[numpy.uint64], camera: int, user: int, now: int, dx: int, dy: int) -> tuple[int, int]:
    """
    Return the perceived position of a user at (dx, dy), relative to the camera.
    """

def perceived_posture(table: numpy.typing.NDArray[numpy.int64], camera: int, posture: int, draw: int) -> int:
    """Return the perceived posture for a true one, by a random draw."""

class SightingColumn(enum.IntEnum):
    """
    The columns of a row of sightings.

    STEP is when it becomes known. Where a camera was wrong about a person, USER is NOBODY; where it
    didn't recognize one, IDENTITY is. X to POSTURE are as perceived: lattice units, 1/4096 turn, and 0
    for standing, 1 sitting, 2 lying.
    """

    STEP = 0

    CAMERA = 1

    USER = 2

    IDENTITY = 3

    X = 4

    Y = 5

    HEADING = 6

    POSTURE = 7

    TRUE_X = 8

    TRUE_Y = 9

    TRUE_HEADING = 10

    TRUE_POSTURE = 11

USER_LOST: int = 0

USER_SEEN: int = 1

def detect(walls: Mesh, lenses: tuple[Any, ...], errors: tuple[Any, ...], rule: tuple[Any, ...], window: Window, body: int, first_other: int, memory: tuple[Any, ...], shown: numpy.typing.NDArray[numpy.uint64] | None = None, radii: numpy.typing.NDArray[numpy.int64] | None = None, heights: tuple[Any, ...] | None = None) -> tuple[int, numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int64], list[int], list[tuple[int, int, int]]]:
    """
    Look at all others in the steps of a window, up to the first with an event that stops it.

    Args:
        walls: The free space.
        lenses: The cameras of a body.
        errors: Their errors.
        rule: The settings that they share.
        window: The motion of all bodies.
        body: Number of the body with the cameras.
        first_other: Number of the first of the others, who are as many as the lenses' users.
        memory: The state of its perception between spans; updated.
        shown: uint64 (cameras, users, steps), which points of each are in view, bit i for number i,
            where another method decides that; None: lines of sight do.
        radii: int64 (bodies,), of all bodies of the window, which hide each other; None: they don't.
        heights: The heights of cameras, bodies and furniture, a `fleet2d.kernels.Heights`; None: they don't matter.

    Returns:
        The steps done (the stopping one included); of each sighting the step, int64 (n,), and the number among the
        distinct ones, int32 (n,); these, int64 (SIGHTING, k), with the columns of `SightingColumn` and the step of the
        first; the number of the last sighting of each identity, -1 for none; and the events of identities that came into
        view or were lost, in order of (step, identity): step, identity and kind (USER_SEEN or USER_LOST).

    Raises:
        ValueError: Shapes don't agree, or a number is none of a user or camera.
    """

class Routes:
    """
    Shortest paths in a space: its corners, and the straight legs between them.

    Args:
        mesh: The space.
        corners: Corners, its reflex corners.

    Raises:
        ValueError: The corners have another shape, or are none of the mesh.
    """

    def __init__(self, mesh: Mesh, corners: tuple[Any, ...]) -> None: ...

    def find(self, ax: int, ay: int, bx: int, by: int) -> numpy.typing.NDArray[numpy.int64] | None:
        """
        Return the shortest path from (ax, ay) to (bx, by), int64 (n, 2).

        Ties go to the corner that is lower by (x, y), so the path depends on the walls only.

        Returns:
            None where there is no way, or an end isn't strictly inside the space.
        """

    def around(self, ax: int, ay: int, bx: int, by: int, discs: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.int64] | None:
        """
        Return the shortest path from (ax, ay) to (bx, by) round some discs, int64 (n, 2).

        It bends at corners of the space, and at those of octagons around the discs. From a start within a disc it leads away.

        Args:
            ax: Position of its begin [lattice units].
            ay: Position of its begin [lattice units].
            bx: Position of its end [lattice units].
            by: Position of its end [lattice units].
            discs: x and y of the middle of each, and a distance that the path stays above [lattice units], int64 (n, 3).

        Returns:
            None where there is no way, or an end isn't strictly inside the space.
        """

    @property
    def leg_start(self) -> numpy.typing.NDArray[numpy.int32]:
        """
        int32 (corners + 1,), where the legs from each corner begin in `leg_end`.
        """

    @property
    def leg_end(self) -> numpy.typing.NDArray[numpy.int32]:
        """int32 (legs,), the corner that each leads to."""

    @property
    def leg_length(self) -> numpy.typing.NDArray[numpy.float64]:
        """float64 (legs,) [lattice units]."""

    def __getstate__(self) -> tuple[Any, ...]: ...

    def __setstate__(self, arg: tuple[Mesh, tuple[Any, ...]], /) -> None: ...

def place_beside(part_of_cell: numpy.typing.NDArray[numpy.int32], part: int, room_of_cell: numpy.typing.NDArray[numpy.int16], room: int, place: tuple[int, int], start: tuple[int, int], slack: int, discs: numpy.typing.NDArray[numpy.int64]) -> tuple[int, int] | None:
    """
    Return the centre of the clear cell nearest to a place.

    Of several that are about as near, it is the one nearest to where the body comes from.

    Args:
        part_of_cell: int32 (rows, columns), the part of its space of each cell.
        part: The part in which the cell must be.
        room_of_cell: int16 (rows, columns), the room of each cell.
        room: The room in which the cell must be; below 0: any.
        place: The place [lattice units].
        start: Where the body comes from [lattice units].
        slack: By how much other cells may be farther from the place than the nearest one [lattice units].
        discs: As for `Routes.around`.

    Returns:
        (x, y) [lattice units]; None where no cell is clear.
    """

def distance(ax: int, ay: int, bx: int, by: int) -> float:
    """Return the distance of two lattice points [lattice units]."""

def advance(probability: numpy.typing.NDArray[numpy.float64], transition: numpy.typing.NDArray[numpy.float64], bins: int) -> numpy.typing.NDArray[numpy.float64]:
    """
    Return the state probabilities of a chain `bins` bins later, without evidence.

    Args:
        probability: float64 (states,), the present probabilities.
        transition: float64 (states, states), from row to column within a bin.
        bins: How many bins.

    Returns:
        float64 (states,).
    """

def resampled(key: int | numpy.uint64, days: numpy.typing.NDArray[numpy.float64], replicates: int) -> numpy.typing.NDArray[numpy.float64]:
    """
    Sum days drawn with replacement.

    Args:
        key: Of the stream of draws.
        days: float64 (days, values).
        replicates: How many sums.

    Returns:
        float64 (replicates, values), each the sum of as many days as there are.
    """

def list_sightings(step: numpy.typing.NDArray[numpy.int64], index: numpy.typing.NDArray[numpy.int32], user: numpy.typing.NDArray[numpy.int64], room: numpy.typing.NDArray[numpy.int64], bin_steps: int, bins: int, users: int, rooms: int) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64]]:
    """
    Count the steps at which each user was perceived in each room, each step once, where that isn't 0.

    Args:
        step: int64 (n,), in order of time, from the beginning of the first bin.
        index: int32 (n,), the number of each sighting among the distinct ones.
        user: int64 (k,), of each distinct one, below 0 for somebody unknown.
        room: int64 (k,), likewise, below 0 for none.
        bin_steps: Steps of a bin.
        bins: How many bins there are.
        users: How many users there are, and one more for anybody.
        rooms: How many rooms there are.

    Returns:
        User, bin, room, and number of steps, int64 (n,) each, in ascending order.
    """

def gather_views(cells: numpy.typing.NDArray[numpy.int64], room: numpy.typing.NDArray[numpy.int64], patch_cells: numpy.typing.NDArray[numpy.int64], room_cells: numpy.typing.NDArray[numpy.int64], bin_steps: int) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint8]]:
    """
    Return how much was in view in each bin; of several robots, the one that saw most counts.

    Args:
        cells: int64 (bins, robots, 2, patches), cells in view: the sum over the steps of a bin, and the maximum.
        room: int64 (patches,), the room of each patch, ascending, none left out.
        patch_cells: int64 (patches,), number of cells of each.
        room_cells: int64 (rooms,), number of cells of each room, at least 1.
        bin_steps: Steps of a bin.

    Returns:
        Shares of the cells in view, averaged over the steps: float64 (bins, rooms), and (bins, patches); at most at
        one step: float64 (bins, patches); and that in parts of 255: uint8 (bins, patches).
    """

def watched_views(shown: numpy.typing.NDArray[numpy.uint8], user: numpy.typing.NDArray[numpy.int64], bin: numpy.typing.NDArray[numpy.int64], patch: numpy.typing.NDArray[numpy.int64], steps: numpy.typing.NDArray[numpy.int64], users: int) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.uint8]]:
    """
    Return what was in view but for patches with an unknown person, who may be any user.

    An unknown person was where anybody was perceived in more steps than all users together; nowhere with one user.

    Args:
        shown: uint8 (bins, patches), the part of each patch in view.
        user: int64 (n,), who was perceived; the last of `users` is anybody.
        bin: int64 (n,).
        patch: int64 (n,).
        steps: int64 (n,), in how many steps.
        users: How many users there are, and one more for anybody.

    Returns:
        The number of the view in each bin, int64 (bins,), and the views, each other than the one before: uint8 (views,
        patches + 1), the last column 0.
    """

def sum_places(chains: tuple[Any, ...], unknown: numpy.typing.NDArray[numpy.bool_], users: int, first: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.float64]:
    """
    Sum presence by hour, in the order of NumPy's add.reduceat over the first axis.

    Args:
        chains: Consecutive stretches of bins, those of one user after the other: float64 (stretches, places),
            probability of each place, away last; int64 (stretches,), number of bins of each; and where those of each
            user begin, int64 (users + 1,).
        unknown: bool (bins, places - 1), the rooms with an unknown person.
        users: Number of users; 0: `chains` holds one person, who is anyone.
        first: int64 (hours,), the bins at which hours begin, the first 0.

    Returns:
        float64 (hours, users + 1, 2 places + 1), anyone last: sums of the probability p of each place, of p (1 - p),
        and of 1.
    """

class Legs:
    """The breakpoints of a plan, which is built leg by leg."""

    def __init__(self) -> None: ...

    def __len__(self) -> int: ...

    def mark(self, time: int, x: int, y: int, heading: int, away: int) -> None:
        """
        Add a breakpoint: time [us], x, y [lattice], heading [1/4096 turn], away.
        """

    def add(self, rows: numpy.typing.NDArray[numpy.int64]) -> None:
        """Add breakpoints, int64 (n, 5)."""

    def turn(self, time: int, x: int, y: int, heading: int, away: int, headings: int, turn_rate: float) -> tuple[int, int, int, int, int]:
        """
        Turn on the spot by a number of headings, counter-clockwise if positive.

        Returns:
            time, x, y, heading and away at the end.
        """

    def walk(self, time: int, heading: int, route: numpy.typing.NDArray[numpy.int64], speed: float, turn_rate: float) -> tuple[int, int, int, int, int]:
        """
        Turn towards each leg of a route (n, 2) and walk it, at home, as `time_route` does.

        Returns:
            time, x, y, heading and away at the end.
        """

    def go(self, time: int, x: int, y: int, heading: int, routes: Routes, to_x: int, to_y: int, speed: float, turn_rate: float, off: tuple[int, int] | None = None) -> tuple[int, int, int, int, int] | None:
        """
        Walk the shortest way to a point, at home, from the point `off` to which it first steps, if that is given.

        Returns:
            time, x, y, heading and away at the end; None if no way leads there, or an end isn't strictly inside.
        """

    def visit(self, time: int, x: int, y: int, heading: int, routes: Routes, stops: numpy.typing.NDArray[numpy.int64], speed: float, turn_rate: float, headings: int, stay: int) -> tuple[int, int, int, int, int] | None:
        """
        Walk the shortest ways from stop to stop, int64 (n, 2), at home; at each turn and stay.

        Args:
            headings: By how many headings it turns at each stop.
            stay: How long it stays then [us].

        Returns:
            time, x, y, heading and away at the end; None, without a breakpoint, if no way leads to one of them.
        """

    def settle(self, time: int, x: int, y: int, heading: int, at_x: int, at_y: int, at_heading: int, speed: float, turn_rate: float) -> tuple[int, int, int, int, int]:
        """
        Walk straight to a point, and turn to a heading there, at home.

        Returns:
            time, x, y, heading and away at the end.
        """

    def rows(self) -> numpy.typing.NDArray[numpy.int64]:
        """Return all breakpoints: int64 (n, 5)."""

    def track(self) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.uint8]]:
        """
        Return all breakpoints by column: time, x, y, heading, int64 (n,), and away, uint8 (n,).
        """

    def __getstate__(self) -> numpy.typing.NDArray[numpy.int64]: ...

    def __setstate__(self, arg: numpy.typing.NDArray[numpy.int64], /) -> None: ...

WHOLE_PATCH: int = 255

def merge_bins(minute: numpy.typing.NDArray[numpy.int64], view: numpy.typing.NDArray[numpy.int64], bin: numpy.typing.NDArray[numpy.int64], patch: numpy.typing.NDArray[numpy.int64], steps: numpy.typing.NDArray[numpy.int64], longest: int) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.float64]]:
    """
    Merge consecutive bins with the same view and the same sightings.

    Bins in which the user was perceived in several patches aren't merged.

    Args:
        minute: int64 (bins,), beginning of each bin [minutes since midnight]; no stretch crosses an
            hour.
        view: int64 (bins,), the row of `views`; consecutive bins with the same view have the same.
        bin: int64 (sightings,), ascending; where the user was perceived.
        patch: int64 (sightings,), ascending within each bin.
        steps: int64 (sightings,), number of steps with a sighting there.
        longest: Largest number of bins in a stretch.

    Returns:
        The fields of `Stretches` without `views`.
    """

def follow(model: tuple[Any, ...], stretches: tuple[Any, ...], now: numpy.typing.NDArray[numpy.float64], shown: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.float64]:
    """
    Return the distribution over rooms, given the evidence up to each stretch; see `smooth`.

    Args:
        model: The transition probabilities of the person.
        stretches: The evidence, at least one stretch.
        now: float64 (2, stages, patches), probability before the first stretch, of states in view and
            of hidden ones; becomes that after the last.
        shown: int64 (patches,), what part of each patch was in view before, in 1/255, -1 if that isn't
            known; becomes that of the last.

    Returns:
        P(room), away last, in each stretch: float64 (stretches, rooms + 1).

    Raises:
        ValueError: Arrays aren't of one person, or hold numbers of patches or sightings that aren't.
    """

def follow_people(model: tuple[Any, ...], day: tuple[Any, ...], longest: int, now: numpy.typing.NDArray[numpy.float64]) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64]]:
    """
    Return `follow` of each person, from merged bins of a day, when no view is known before.

    Args:
        model: The transition probabilities: as of one person, with people as the first dimension.
        day: The evidence.
        longest: Largest number of bins in a stretch.
        now: float64 (people, stages, patches), probability before the first bin; becomes that after the last.

    Returns:
        P(room), away last, in all stretches of one person after the other: float64 (stretches, rooms + 1); the number
        of bins of each, int64 (stretches,); and where those of each person begin, int64 (people + 1,).

    Raises:
        ValueError: Arrays aren't of the same people, rooms and patches, or hold numbers of patches or bins that aren't.
    """

def learned_stays(moments: tuple[Any, ...], length: numpy.typing.NDArray[numpy.float64], spread: numpy.typing.NDArray[numpy.float64], possible: numpy.typing.NDArray[numpy.float64], first: numpy.typing.NDArray[numpy.int64], restless: float) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Return the most probable transitions of people: expected counts by expected time, with a prior.

    Args:
        moments: What was learned, with people as the first dimension.
        length: float64 (stages,), mean length of each stage of a stay before anything is learned [bins].
        spread: float64 (patches,), the share of each patch in its room.
        possible: float64 (rooms + 1,), 1 for the places where people may be, away last, 0 for the others.
        first: int64 (rooms + 2,), as of `StayModel`.
        restless: Probability per bin of changing patch before anything is learned.

    Returns:
        The fields of `StayModel` before `first`, with people as the first dimension.

    Raises:
        ValueError: Arrays aren't of the same people, stages, rooms and patches.
    """

def smooth_people(model: tuple[Any, ...], day: tuple[Any, ...], longest: int, prior: numpy.typing.NDArray[numpy.float64], future: numpy.typing.NDArray[numpy.float64], moments: tuple[Any, ...]) -> tuple[tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64]], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Return `smooth` of each person, from merged bins of a day.

    Args:
        model: The transition probabilities: as of one person, with people as the first dimension.
        day: The evidence.
        longest: Largest number of bins in a stretch.
        prior: float64 (people, stages, patches), probability before the first bin.
        future: float64 (people, stages, patches), likelihood of the evidence after the last one.
        moments: To add to; with people as the first dimension.

    Returns:
        What `follow_people` returns, given all evidence; the probability of stage and patch after the last bin, given
        what was before, and how likely each before the first makes the evidence, largest 1: float64 (people, stages,
        patches) each.

    Raises:
        ValueError: Arrays aren't of the same people, rooms and patches, or hold numbers of patches or bins that aren't.
    """

TRACE_FEATURES: int = 25

def trace_size(home: tuple[Any, ...]) -> int:
    """Return the size of the memory of `trace_evidence`."""

def trace_evidence(memory: numpy.typing.NDArray[numpy.float64], home: tuple[Any, ...], evidence: tuple[Any, ...]) -> numpy.typing.NDArray[numpy.float64]:
    """
    Add evidence of a person to what it has left behind, and return it as features of each place.

    Args:
        memory: float64 (trace_size(home),), zeros before the first bin; it is updated.
        home: The rooms.
        evidence: The evidence of one person in consecutive bins.

    Returns:
        float64 (bins, rooms + 1, TRACE_FEATURES), away last.
    """

def place_probabilities(network: tuple[Any, ...], places: numpy.typing.NDArray[numpy.float64], features: numpy.typing.NDArray[numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
    """
    Return the probability of each place by a network over the set of places.

    Args:
        network: The weights.
        places: float64 (places, hidden), what the first layer makes of what doesn't change.
        features: float64 (bins, places, features), the last one the logarithm of the belief that is corrected.

    Returns:
        float64 (bins, places), rows sum to one.
    """

def smooth(model: tuple[Any, ...], stretches: tuple[Any, ...], prior: numpy.typing.NDArray[numpy.float64], future: numpy.typing.NDArray[numpy.float64], moments: tuple[Any, ...]) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Return the distribution over rooms in each stretch, given all evidence.

    Between two stretches a person may make one transition: leave a stage, with the probability of doing
    so within the later stretch, or change patch within the room. With stretches of one bin that is a
    hidden Markov chain; with longer ones, transitions within a stretch count as if they happened at its
    begin. A person who comes to a patch is in its visible part with the probability of its size, and
    stays in or out of view until the person moves or the view changes. A person in view is missed in
    all of n bins with probability (1 - detection)^n; a person out of view is never perceived, unless
    nothing of the patch is in view: positions may be noisy.

    Args:
        model: The transition probabilities of the person.
        stretches: The evidence.
        prior: float64 (stages, patches), probability before the first stretch.
        future: float64 (stages, patches), likelihood of the evidence after the last one.
        moments: To add to.

    Returns:
        P(room) in each stretch, float64 (stretches, rooms + 1); the probability of stage and patch
        after the last, given what was before, and how likely each before the first makes the
        evidence, largest 1: float64 (stages, patches) each.

    Raises:
        ValueError: Arrays aren't of one person, or hold numbers of patches or sightings that aren't.
    """

class Window:
    """
    The runs of equal pose of some bodies over consecutive steps.

    The runs of body b are number start[b] to start[b + 1] - 1. Each lasts until the next one of its body
    begins, the last one until `end`. Arrays are read-only.

    Args:
        first: The first step.
        x: int64 (bodies, steps), the pose of each body at each step, lattice units.
        y: int64 (bodies, steps), lattice units.
        heading: int64 (bodies, steps), 1/4096 turn.
        away: uint8 (bodies, steps), not 0 while a body isn't at home.
        posture: int8 (bodies, steps), number of the posture.
    """

    def __init__(self, first: int, x: numpy.typing.NDArray[numpy.int64], y: numpy.typing.NDArray[numpy.int64], heading: numpy.typing.NDArray[numpy.int64], away: numpy.typing.NDArray[numpy.uint8], posture: numpy.typing.NDArray[numpy.int8]) -> None: ...

    @property
    def first(self) -> int:
        """The first step."""

    @property
    def end(self) -> int:
        """One past the last step."""

    @property
    def start(self) -> numpy.typing.NDArray[numpy.int64]:
        """int64 (bodies + 1,), the first run of each body."""

    @property
    def step(self) -> numpy.typing.NDArray[numpy.int64]:
        """int64 (runs,), the step at which each begins."""

    @property
    def x(self) -> numpy.typing.NDArray[numpy.int64]:
        """int64 (runs,), lattice units."""

    @property
    def y(self) -> numpy.typing.NDArray[numpy.int64]:
        """int64 (runs,), lattice units."""

    @property
    def heading(self) -> numpy.typing.NDArray[numpy.int64]:
        """int64 (runs,), 1/4096 turn."""

    @property
    def away(self) -> numpy.typing.NDArray[numpy.uint8]:
        """uint8 (runs,), not 0 while the body isn't at home."""

    @property
    def posture(self) -> numpy.typing.NDArray[numpy.int8]:
        """int8 (runs,), number of the posture."""

    def dense(self, body: int, first: int, end: int) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.uint8], numpy.typing.NDArray[numpy.int8]]:
        """
        Return the poses of a body at each of the steps from `first` to `end` - 1.

        Returns:
            x, y, heading int64, away uint8 and posture int8, (steps,) each.
        """

    def __getstate__(self) -> tuple[Any, ...]: ...

    def __setstate__(self, state: tuple[Any, ...]) -> None: ...

def due_rows(steps: numpy.typing.NDArray[numpy.int64], now: int) -> list[int]:
    """
    Return the rows that are due at a step, in order.

    Args:
        steps: int64 (rows,), the step at which each is due.
        now: The step.
    """

class Timelines:
    """
    The motion of each body of a run, piece after piece.

    A piece begins at a step and holds until the next one of its body begins.

    Args:
        bodies: Number of bodies.
        step_us: Length of a step.
    """

    def __init__(self, bodies: int, step_us: int) -> None: ...

    def follow(self, body: int, step: int, track: tuple[Any, ...], posture_us: numpy.typing.NDArray[numpy.int64], postures: numpy.typing.NDArray[numpy.int8]) -> None:
        """
        Let a body follow a track from a step on, instead of what it would have done from then on.

        Args:
            body: Number of the body.
            step: The first step.
            track: Breakpoints, whose times are since the start of the run.
            posture_us: int64 (n,), when it takes another posture.
            postures: int8 (n + 1,); number i holds before posture_us[i], the last one from then on.
        """

    def walk(self, body: int, step: int, walls: Mesh, space: Mesh, rule: tuple[Any, ...], start: tuple[int, int, int]) -> None:
        """Let a body walk at random from a step on; see `trace_meander`."""

    def pose(self, body: int, step: int) -> tuple[int, int, int, int]:
        """Return x, y, heading and away of a body at a step."""

    def poses(self, steps: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.int64]:
        """
        Return x, y, heading and away of all bodies at some steps: int64 (steps, bodies, 4).
        """

    def meetings(self, rows: numpy.typing.NDArray[numpy.int64], distances: tuple[Any, ...], first: int, end: int) -> list[tuple[int, int, int, int]]:
        """
        Return for each of some bodies the first meeting to which it has to react.

        Two bodies meet when their middles come nearer than a distance while they approach, or when they
        overlap and don't part.

        Args:
            rows: int64 (rows,), the bodies.
            distances: What each of them keeps from all bodies: see `Distances`.
            first: The first step at which one may react.
            end: One past the last one.

        Returns:
            Rows of the body, the step at which it has to react, the step in which they meet, and the other body.
            Bodies without a meeting are left out.
        """

    def meeting_on(self, row: int, track: tuple[Any, ...], distances: tuple[Any, ...], first: int, end: int) -> tuple[int, int]:
        """
        Return the first meeting of a body if it followed a track.

        Args:
            row: The body.
            track: Breakpoints, which it would follow from step `first` on.
            distances: What it keeps from all bodies, (1, bodies) each: see `Distances`.
            first: The first step.
            end: One past the last step at which it has to react.

        Returns:
            The step in which they meet and the other body; -1 and -1 if it meets nobody.
        """

    def meeting_at_rest(self, row: int, distances: tuple[Any, ...], first: int, end: int) -> tuple[int, int]:
        """
        Return the first meeting of a body if it stood still from step `first` on; as `meeting_on`.
        """

    def rests(self, body: int, first: int, end: int) -> bool:
        """
        Return whether a body doesn't leave its place in the steps from `first` to `end` - 1.
        """

    def way_after_a_wait(self, row: int, step: int, waits: numpy.typing.NDArray[numpy.int64], distances: tuple[Any, ...], end: int) -> tuple[Legs, tuple[int, int, int, int, int], list[tuple[int, int, int, int]]] | None:
        """
        Return how a body goes on after the first wait that lets it.

        Args:
            row: The body.
            step: The present step.
            waits: int64 (n,), steps for which it stands.
            distances: What it keeps from all bodies, (1, bodies) each.
            end: One past the last step in which it must meet nobody.

        Returns:
            Breakpoints from now on, the last of them, and how much later they continue the track: see `Continued`. None if
            it is free after no wait.
        """

    def way_by_a_place(self, body: tuple[Any, ...], step: int, met: int, places: numpy.typing.NDArray[numpy.int64], waits: numpy.typing.NDArray[numpy.int64], rests: int, distances: tuple[Any, ...], end: int) -> tuple[Legs, tuple[int, int, int, int, int], list[tuple[int, int, int, int]]] | None:
        """
        Return how a body goes on by the first place that lets it.

        Args:
            body: Its row, how it goes there, and how it can stand: see `Yielder`.
            step: The present step.
            met: The step in which somebody would be in its way; it goes on with its next stop after that.
            places: int64 (n, 2), places to try [lattice].
            waits: int64 (m,), steps for which it stays at a place.
            rests: Steps for which it stays where it could stay until `end`, but go on after none of the waits; 0: it
                needn't be able to stay, and doesn't.
            distances: What it keeps from all bodies, (1, bodies) each.
            end: One past the last step in which it must meet nobody.

        Returns:
            As `way_after_a_wait`.
        """

    def way_past(self, body: tuple[Any, ...], step: int, met: int, in_way: tuple[Any, ...], waits: numpy.typing.NDArray[numpy.int64], distances: tuple[Any, ...], end: int) -> tuple[Legs, tuple[int, int, int, int, int], list[tuple[int, int, int, int]]] | None:
        """
        Return how a body goes on past another one, later or by a point beside it.

        Args:
            body: Its row, how it goes there, and how it can stand: see `Yielder`.
            step: The present step.
            met: The step in which the other one would be in its way.
            in_way: The other one, and where it may pass it: see `BodyInWay`.
            waits: int64 (n,), steps for which it waits first, unless the other one stays.
            distances: What it keeps from all bodies, (1, bodies) each.
            end: One past the last step in which it must meet nobody, and up to which the other one stays.

        Returns:
            As `way_after_a_wait`.
        """

    def way_aside(self, body: tuple[Any, ...], step: int, met: int, aside: tuple[Any, ...], waits: numpy.typing.NDArray[numpy.int64], rests: int, distances: tuple[Any, ...], end: int) -> tuple[Legs, tuple[int, int, int, int, int], list[tuple[int, int, int, int]]] | None:
        """
        Return how a body steps aside and comes back, by a place nearby or else one farther away.

        Args:
            body: Its row, how it goes there, and how it can stand: see `Yielder`.
            step: The present step.
            met: The step in which somebody would be in its way.
            aside: Where it looks for places: see `AsideSearch`.
            waits: int64 (n,), steps for which it stays at a place.
            rests: See `way_by_a_place`; for so many steps nobody may come near to a place.
            distances: What it keeps from all bodies, (1, bodies) each.
            end: One past the last step in which it must meet nobody.

        Returns:
            As `way_after_a_wait`.
        """

    def takes_stop(self, row: int, space: Mesh, step: int, met: int, other: int, near: int, end: int) -> bool:
        """
        Return whether another body stays where a body wants to stop next.

        Args:
            row: The body.
            space: Where its middle may be.
            step: The present step.
            met: The step after which it stops.
            other: The other body.
            near: How near to the stop that one must be [lattice].
            end: One past the last step in which it must stay.
        """

    def way_round(self, body: tuple[Any, ...], step: int, met: int, discs: numpy.typing.NDArray[numpy.int64], beside: Callable[[int, int], tuple[int, int] | None]) -> tuple[Legs, tuple[int, int, int, int, int], list[tuple[int, int, int, int]]] | None:
        """
        Return how a body goes round others that stand, to its next stop.

        Args:
            body: Its row, how it goes there, and how it can stand: see `Yielder`.
            step: The present step.
            met: A moment; it goes on with its next stop after that [us].
            discs: x, y and the distance to keep of each of the others [lattice], int64 (n, 3).
            beside: Called with x and y of a stop that one of them has taken; returns where to stop instead, or None.

        Returns:
            As `way_after_a_wait`; None if there is no way or no place.
        """

    def way_from_here(self, body: tuple[Any, ...], step: int, met: int, may_stop: Callable[[int, int], bool]) -> tuple[Legs, tuple[int, int, int, int, int], list[tuple[int, int, int, int]]] | None:
        """
        Return how a body goes on that stops where it is, in place of its next stop.

        Args:
            body: Its row, how it goes there, and how it can stand: see `Yielder`.
            step: The present step.
            met: A moment; the stop is the next one after that [us].
            may_stop: Called with x and y of the stop; returns whether it may.

        Returns:
            As `way_after_a_wait`; None if it may not, or no way leads on.
        """

    def places_aside(self, row: int, step: int, end: int, part_of_cell: numpy.typing.NDArray[numpy.int32], part: int, from_: tuple[int, int], search: tuple[int, int, int], reach: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.int64]:
        """
        Return places that a body can step aside to, the nearest first: int64 (n, 2) [lattice].

        Args:
            row: The body.
            step: The present step.
            end: The last step at which nobody else may come near.
            part_of_cell: int32 (rows, columns), the part of its space of each cell.
            part: Its part.
            from_: x and y from where it goes [lattice].
            search: How many cells to each side it looks, at every so many of them, and for how many places.
            reach: int64 (bodies,), how near the others may come to a place [lattice].
        """

    def standing(self, row: int, step: int, steps: int, reach: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.int64]:
        """
        Return where others stand, int64 (n, 3): x, y and how far to stay away from each [lattice].

        They stand for so many steps from a step on, or have stopped by the end of those, and stay then.

        Args:
            row: The body from which they are others.
            step: The step.
            steps: How many.
            reach: int64 (bodies,), how far to stay away from each [lattice].
        """

    def window(self, first: int, end: int) -> Window:
        """
        Return the runs of equal pose of all bodies in the steps from `first` to `end` - 1.
        """

    def runs(self, body: int, first: int, end: int) -> Window:
        """
        Return the runs of equal pose of one body in the steps from `first` to `end` - 1.
        """

    def forget(self, before: int) -> None:
        """Drop what is only needed for steps earlier than `before`."""

    def __copy__(self) -> Timelines:
        """Return an independent copy."""

    def __getstate__(self) -> tuple[Any, ...]: ...

    def __setstate__(self, state: tuple[Any, ...]) -> None: ...

def next_stop(space: Mesh, track: tuple[Any, ...], moment: int) -> int:
    """
    Return the breakpoint at which a body next stands still after a moment [us]; -1 for none.

    A turn at a corner, on the border of its space, is no stop.
    """

def distances_between(window: Window, body: int, other: int) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.float64]]:
    """
    Return how far the centres of two bodies are apart.

    Args:
        window: The motion of the bodies.
        body: Number of one of them.
        other: Number of the other.

    Returns:
        The steps at which the distance changes, int64 (n,), and what it is from then on [lattice units], float64 (n,);
        infinite while one of them is away.
    """

def distances_to_shape(window: Window, body: int, edges: numpy.typing.NDArray[numpy.int64]) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.float64]]:
    """
    Return how far the centre of a body is from a shape, 0 inside it.

    Args:
        window: The motion of the bodies.
        body: Number of the body.
        edges: int64 (n, 4), edges from (x, y) to (x, y) [lattice units]; closed rings enclose an inside.

    Returns:
        The steps at which the distance changes, int64 (n,), and what it is from then on [lattice units], float64 (n,);
        infinite while the body is away.
    """

def speeds(window: Window, body: int, before: numpy.typing.NDArray[numpy.int64], portals: numpy.typing.NDArray[numpy.int64]) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.float64]]:
    """
    Return how far a body comes in each step: at a step, the way from the step before.

    Args:
        window: The motion of the bodies.
        body: Number of the body.
        before: int64 (3,), x, y and away at the step before the window; (0,) if there was none.
        portals: int64 (m, 5), as for `sum_moves`.

    Returns:
        The steps at which it changes, int64 (n,), and the way of each step from then on [lattice units], float64 (n,).
    """

def sliding_max(start: numpy.typing.NDArray[numpy.int64], value: numpy.typing.NDArray[numpy.float64], end: int, low: int, high: int, before: float, after: float) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.float64]]:
    """
    Return the greatest value that a signal has from `low` to `high` steps after each step.

    Args:
        start: int64 (n,), ascending, where the signal's stretches begin.
        value: float64 (n,), what it is in them.
        end: The step before which the last one ends.
        low: The first step of the window, from where it is asked about; negative before it.
        high: The last step of the window.
        before: What the signal is before the first step.
        after: What it is from `end` on.

    Returns:
        The steps at which it changes, int64 (m,), and what it is from then on, float64 (m,).
    """

def until(start: numpy.typing.NDArray[numpy.int64], hold: numpy.typing.NDArray[numpy.float64], goal: numpy.typing.NDArray[numpy.float64], after: float) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.float64]]:
    """
    Return how well one signal holds until another one does, from each step on.

    Args:
        start: int64 (n,), ascending, where the stretches of both begin.
        hold: float64 (n,), what must hold.
        goal: float64 (n,), until when.
        after: What comes after the last stretch.

    Returns:
        The steps at which it changes, int64 (m,), and what it is from then on, float64 (m,).
    """

def earth_mover(start: numpy.typing.NDArray[numpy.float64], end: numpy.typing.NDArray[numpy.float64], metres: numpy.typing.NDArray[numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
    """
    Return the least mean distance by which each of some distributions is moved onto another one.

    The minimum of the sum of f(i, j) * metres(i, j) over flows f >= 0 from place to place, found exactly
    by successive shortest paths. Mass that both have at a place stays.

    Args:
        start: float64 (n, places).
        end: float64 (n, places), each of the sum of that row of `start`.
        metres: float64 (places, places), at least 0.

    Returns:
        float64 (n,).
    """

CHANCE_BITS: int = 10

QUANTILE_BITS: int = 8

class Role(enum.Enum):
    """What a part of a day is."""

    PLANNED = 0
    """As planned."""

    INTERRUPTS = 1
    """An interruption."""

    RESUMES = 2
    """What goes on after one."""

    FINISHES = 3
    """An interruption as the end of what it interrupts."""

class Interruptions:
    """
    Needs and errands of a person, as numbers: times in seconds, chances of 1024.

    Args:
        needs: Of each the steps, each with its activity, chance, and 256 quantiles of its duration; 256 quantiles of the
            time to the next one, and in sleep, or None; its chances on waking, before bed, before leaving and on return;
            the patience; begin and length of its hours, or None; and the activities that meet it.
        errands: Of each its step, and the activities after and before which it is done; None: all.
        away: Activities out of the home.
        uninterruptible: Activities that needs don't interrupt.
        sleep: The activity that is sleep.
        activities: Number of activities.
    """

    def __init__(self, needs: Sequence[tuple[Sequence[tuple[int, int, Sequence[int]]], Sequence[int], Sequence[int] | None, tuple[int, int, int, int], int, tuple[int, int] | None, Sequence[int]]], errands: Sequence[tuple[tuple[int, int, Sequence[int]], Sequence[int] | None, Sequence[int] | None]], away: Sequence[int], uninterruptible: Sequence[int], sleep: int, activities: int) -> None: ...

    def interrupt(self, draws: StepDraws, day: Sequence[tuple[int, int, int, int]], use: RoomUse | None = None, rooms: Sequence[Sequence[int]] = []) -> list[tuple[int, int, int, int, int, int]]:
        """
        Put interruptions into a day.

        Args:
            draws: The draws of the day's interruptions.
            day: Activity, begin, end, and room, or -1, of each planned episode, without a gap.
            use: When others use private rooms; None: never.
            rooms: The rooms where each activity is done alone, the preferred one first; none: it isn't.

        Returns:
            The number of the planned episode, -1 for an interruption; activity, begin, end, role and room of each part.
        """

    def __getstate__(self) -> tuple[list[tuple[list[tuple[int, int, list[int]]], list[int], list[int] | None, tuple[int, int, int, int], int, tuple[int, int] | None, list[int]]], list[tuple[tuple[int, int, list[int]], list[int] | None, list[int] | None]], list[int], list[int], int, int]: ...

    def __setstate__(self, arg: tuple[Sequence[tuple[Sequence[tuple[int, int, Sequence[int]]], Sequence[int], Sequence[int] | None, tuple[int, int, int, int], int, tuple[int, int] | None, Sequence[int]]], Sequence[tuple[tuple[int, int, Sequence[int]], Sequence[int] | None, Sequence[int] | None]], Sequence[int], Sequence[int], int, int], /) -> None: ...

ANY_ROOM: int = -1

NO_GAP_S: int = 300

class RoomUse:
    """
    When people use rooms that only one can use at a time; times in seconds.
    """

    def __init__(self) -> None: ...

    def add(self, room: int, begin: int, end: int) -> None:
        """Add a time in which somebody uses a room."""

    def free(self, rooms: Sequence[int], begin: int, latest: int, shortest: int, end_by: int) -> tuple[int, int, int] | None:
        """
        Return the first time at which one of some rooms is free for long enough.

        Args:
            rooms: The rooms, the preferred one first.
            begin: The earliest beginning.
            latest: The latest beginning.
            shortest: The least duration.
            end_by: The latest end.

        Returns:
            Begin, end and room; None if there is no such time.
        """

class DayPlanner:
    """
    Draws days of a template; times in seconds since midnight.

    A distribution is its quantiles, its least and largest value, and the positions of these among the quantiles.

    Args:
        sleep: The distribution of going to bed.
        min_sleep: The minimum duration of sleep.
        jobs: Of each the activity, the distribution of its beginning, or None, and of its duration; its latest end; the jobs before
            it; its chance per million; whether it is needed; -1 on waking, 1 before bed, else 0.
        pastimes: Of each the activity, the weight, the distribution of its duration, and from when to when it may begin.
        rest: The activity without any.
        asleep: The activity that is sleep.
    """

    def __init__(self, sleep: tuple[Sequence[int], int, int, int, int], min_sleep: int, jobs: Sequence[tuple[int, tuple[Sequence[int], int, int, int, int] | None, tuple[Sequence[int], int, int, int, int], int, Sequence[int], int, bool, int]], pastimes: Sequence[tuple[int, int, tuple[Sequence[int], int, int, int, int], int, int]], rest: int, asleep: int) -> None: ...

    def plan(self, draws: StepDraws, wake: int, next_wake: int, use: RoomUse | None = None, rooms: Sequence[Sequence[int]] = []) -> list[tuple[int, int, int, int, int]]:
        """
        Draw a day.

        Args:
            draws: The day's draws.
            wake: When it begins.
            next_wake: When the next day begins.
            use: When others use private rooms; None: never.
            rooms: The rooms where each job is done alone, the preferred one first; none: it isn't.

        Returns:
            Activity, begin, end, number of the job, or -1, and room, or -1, of each episode; none if the jobs fit in no order.
        """

    def draw_order(self, draws: StepDraws, chosen: Sequence[bool], wake: int, next_wake: int, by_deadline: bool) -> tuple[list[int], list[int], bool]:
        """
        Draw an order of some jobs.

        Args:
            draws: The draws.
            chosen: Whether each job is done.
            wake: When the day begins.
            next_wake: When the next day begins.
            by_deadline: Order them by their latest beginnings instead of the drawn ones.

        Returns:
            The numbers of the jobs in order; the latest beginning of each, and of going to bed; and whether they fit.
        """

    def __getstate__(self) -> tuple[tuple[list[int], int, int, int, int], int, list[tuple[int, tuple[list[int], int, int, int, int] | None, tuple[list[int], int, int, int, int], int, list[int], int, bool, int]], list[tuple[int, int, tuple[list[int], int, int, int, int], int, int]], int, int]: ...

    def __setstate__(self, arg: tuple[tuple[Sequence[int], int, int, int, int], int, Sequence[tuple[int, tuple[Sequence[int], int, int, int, int] | None, tuple[Sequence[int], int, int, int, int], int, Sequence[int], int, bool, int]], Sequence[tuple[int, int, tuple[Sequence[int], int, int, int, int], int, int]], int, int], /) -> None: ...

class RoomPolicy(enum.Enum):
    """How a room is chosen among several."""

    OWN = 0
    """The same each time."""

    NEAREST = 1
    """The nearest one."""

    EACH_TIME = 2
    """Any, drawn each time."""

    HERE = 3
    """The one where somebody is."""

class MoveKind(enum.Enum):
    """
    What somebody does now and then within an activity; of several due, the first.
    """

    SHIFTS = 0
    """Turns on the spot."""

    MOVES = 1
    """Goes to another spot of the room, or to the furniture."""

    FETCHES = 2
    """Goes to another room, and comes back."""

class Happening(enum.Enum):
    """What happens on the way."""

    ACTIVITY = 0
    """An activity begins."""

    WAY_BLOCKED = 1
    """No way leads to it."""

    USES = 2
    """Furniture is used."""

    LEFT_HOME = 3
    """The home is left."""

    CAME_HOME = 4
    """The home is entered."""

class Waits:
    """
    Times between two events.

    Args:
        quantiles: int64 (n,), quantiles [us]; n is a power of two.
    """

    def __init__(self, quantiles: numpy.typing.NDArray[numpy.int64]) -> None: ...

class CoreVenue:
    """
    Where and how somebody does an activity.

    Args:
        asked_with: What `seats` and `nearest` of the home are asked with.
        activity: The number of the activity.
        away: Whether it is done out of the home.
        choose: How a room is chosen: 0 the same each time, 1 the nearest, 2 any, 3 the one where somebody is.
        posture: The number of the posture; 0 is standing.
        rooms: The rooms where it is done; none: it is blocked, or out of the home.
        seats: The places at furniture where it is done; none: anywhere in the rooms.
        stores: The rooms from which things are fetched.
        moves: The kind of each small move, 0 turns, 1 walks, 2 trips to fetch something, and the times between them.
        fetch_takes: The distribution of how long somebody is away to fetch something [s]; None: nothing is fetched.
    """

    def __init__(self, asked_with: object | None, activity: int, away: bool, choose: int, posture: int, rooms: Sequence[int], seats: Sequence[int], stores: Sequence[int], moves: Sequence[tuple[int, Waits]], fetch_takes: tuple[Sequence[int], int, int, int, int] | None) -> None: ...

class LastStint:
    """What somebody did last, where, and what that interrupted."""

    def __init__(self) -> None: ...

    def __getstate__(self) -> tuple[int, tuple[int, int, int] | None, tuple[int, int, int] | None]: ...

    def __setstate__(self, arg: tuple[int, tuple[int, int, int] | None, tuple[int, int, int] | None], /) -> None: ...

class Resident:
    """
    Somebody who does activities in a home.

    Args:
        key: Of the stream of draws.
        speed: Lattice units a second.
        turn_rate: Headings a second.
        routes: Routes of the home; None: `walk` finds all ways.
        steps_off: Points on furniture, and where somebody steps first who leaves them: x, y, x, y [lattice].
    """

    def __init__(self, key: int | numpy.uint64, speed: float, turn_rate: float, routes: Routes | None, steps_off: Sequence[tuple[int, int, int, int]]) -> None: ...

    def live(self, home: object, walk: object, legs: Legs, now: tuple[int, int, int, int, int], posture: int, stints: Sequence[tuple[CoreVenue, int, int, int, bool]], until: int, continues: bool, last: LastStint) -> tuple[tuple[int, int, int, int, int], int, list[tuple[int, int]], list[tuple[int, int, int]]]:
        """
        Do activities, one after the other, until the last one is over or one is blocked.

        Args:
            home: What is asked about the home: spots(room), seats(asked_with, room), seat(number), nearest(asked_with, x, y),
                room_at(x, y), wait(room, now, takes) and way_out().
            walk: Goes to a place where no route is known: from what this returns, and the place's number at furniture, or -1,
                x and y, it returns the new end of the plan, and the posture.
            legs: Where breakpoints are added.
            now: The end of the plan: time [us], x, y [lattice], heading [1/4096 turn], away.
            posture: The posture then.
            stints: Venue, address of draws, end [us], role, and whether it is done wherever somebody is, of each.
            until: After that, none begins [us].
            continues: Whether the first one may be a part of the last one.
            last: What was done last; it is updated.

        Returns:
            The new end of the plan; the posture; when postures are taken; time, kind and detail of what happens: 0 an activity
            begins, 1 the way is blocked, 2 furniture is used, 3 the home is left, 4 or entered.
        """

    def go(self, home: object, walk: object, legs: Legs, now: tuple[int, int, int, int, int], posture: int, venue: CoreVenue, draws: StepDraws) -> tuple[tuple[int, int, int, int, int], int, list[tuple[int, int]], list[tuple[int, int, int]]]:
        """Go to where an activity is done, and take its posture; see `live`."""

def charge_pieces(track: tuple[Any, ...], battery: tuple[Any, ...]) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Return the charge of a battery while a body follows a track.

    Args:
        track: The track; without breakpoints, the body drives for good.
        battery: The battery, a `BatteryState`.

    Returns:
        The moments at which the rate of the charge changes [us], int64 (n,), the charge at each, float64 (n,), and the
        rate from each on [1/us], float64 (n,).
    """

def charge_at(track: tuple[Any, ...], battery: tuple[Any, ...], moment_us: int) -> float:
    """Return the charge, 0 to 1, at a moment of a track [us]."""

def charge_falls_to(track: tuple[Any, ...], battery: tuple[Any, ...], level: float) -> int | None:
    """
    Return the moment of a track at which the charge has fallen to a level [us]; None if it never does.
    """

def remember(step: numpy.typing.NDArray[numpy.int64], index: numpy.typing.NDArray[numpy.int32], identity: numpy.typing.NDArray[numpy.int64], room: numpy.typing.NDArray[numpy.int16], start_us: int, step_us: int, memory: tuple[Any, ...]) -> None:
    """
    Add sightings to a memory.

    Args:
        step: int64 (n,), when.
        index: int32 (n,), the number of each among those that differ not only in the step.
        identity: int64 (m,), whom the robot saw in each of these; -1: somebody whom it didn't recognize.
        room: int16 (m,), where; below 0 for no room: these are left out.
        start_us: Time of day at step 0 [us].
        step_us: Length of a step [us].
        memory: The `RoomMemory`, which changes.
    """

def show_memory(memory: tuple[Any, ...], shown: tuple[Any, ...], visited: numpy.typing.NDArray[numpy.int64], step: int, hour: int, step_s: float, common: Sequence[float], table: numpy.typing.NDArray[numpy.float32]) -> None:
    """
    Fill the columns of an observation that show a memory, and those that all rows have in common.

    Args:
        memory: The `RoomMemory`.
        shown: What it shows, `ShownMemory`.
        visited: int64 (rooms,), the step at which the robot last went to each room; -1: never.
        step: The present step.
        hour: The present hour of the day.
        step_s: Length of a step [s].
        common: The values of the last columns, the same in all rows.
        table: float32 (rows, columns), the observation, which changes; its first rows are the rooms.
    """

def encode_arrays(arrays: Sequence[numpy.typing.NDArray[Any]]) -> bytes:
    """
    Return arrays as bytes: values that repeat or grow slowly take few.

    Args:
        arrays: Arrays (n,) of int32, int64, float64, bool, or uint8 for text.

    Returns:
        For each array a header and its values; see `fleet2d.artifacts.unfinished`.
    """
