"""The cells that a camera sees: those whose centre is in range, in its angle, and in sight.

The visible region of the camera's exact place is filled row by row, piece by piece. Each border of
a piece and each border of the camera's angle is a line that is followed from row to row by integer
steps with a remainder (as Bresenham does), so a cell is in view exactly when a line of sight to its
centre says so, and nothing is divided in the inner loop.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.headings import QUARTER, TURN, half_sine
from fleet2d.kernels.mesh import CELL_CENTRE, SUB, Int32, Int64, Mesh, locate
from fleet2d.kernels.region import look_around
from fleet2d.kernels.sight import scratch_for

# A bound that never binds: no column is so far out.
FAR_OUT = 1 << 40


class Reach(NamedTuple):
    """How far and how wide a camera sees."""

    near_squared: int  # lattice units squared
    far_squared: int
    half_angle: int  # 1/8192 of a turn; 4096 and more is all round


class Bench(NamedTuple):
    """Scratch space to find cells in view with, for one mesh and one grid."""

    right: Int32  # pieces of the visible region
    wall: Int32
    stack: Int32
    low: Int64  # (rows,) the first and the last column within range and angle
    high: Int64
    spans: Int32  # (cells, 3) row, first and last column


@kernel
def bench_for(mesh: Mesh, rows: int, columns: int) -> Bench:
    """Return scratch space for a mesh and a grid."""
    wall, stack = scratch_for(mesh.vertices)
    low, high = np.empty(rows, np.int64), np.empty(rows, np.int64)
    return Bench(
        np.empty_like(wall), wall, stack, low, high, np.empty((rows * columns, 3), np.int32)
    )


@kernel
def _root(square: int) -> int:
    """Return the whole square root of a number below 2**52."""
    root = int(np.sqrt(np.float64(square)))
    while root * root > square:
        root -= 1
    while (root + 1) * (root + 1) <= square:
        root += 1
    return root


@kernel
def _limit_to_half_plane(
    a: int, b: int, least: int, x: int, y: int, rows: tuple[int, int], low: Int64, high: Int64
) -> None:
    """Keep, in each row, the columns whose centre x + dx, y + dy has a dx + b dy >= least."""
    first, last = rows
    dy = first * SUB + CELL_CENTRE - y
    if a == 0:
        for row in range(first, last + 1):
            if b * dy < least:
                high[row] = low[row] - 1
            dy += SUB
        return
    # Of a c SUB >= bound, whose right side falls by b SUB from row to row.
    size = SUB * abs(a)
    bound = (x - CELL_CENTRE) * a + least - b * dy
    if a > 0:
        bound += size - 1  # rounded down below, it is rounded up
        step = -b * SUB
    else:
        bound, step = -bound, b * SUB
    column, rest = bound // size, bound % size
    stride, extra = step // size, step % size
    for row in range(first, last + 1):
        if a > 0:
            low[row] = max(low[row], column)
        else:
            high[row] = min(high[row], column)
        column += stride
        rest += extra
        if rest >= size:
            column += 1
            rest -= size


@kernel
def _limit_to_range(
    x: int, y: int, far_squared: int, columns: int, rows: tuple[int, int], low: Int64, high: Int64
) -> None:
    """Set the first and last column in range, row by row."""
    for row in range(rows[0], rows[1] + 1):
        dy = row * SUB + CELL_CENTRE - y
        width = _root(far_squared - dy * dy)
        low[row] = max(0, -((CELL_CENTRE - x + width) // SUB))
        high[row] = min(columns - 1, (x + width - CELL_CENTRE) // SUB)


@kernel
def _add_span(
    spans: Int32, count: int, row: int, first: int, last: int, x: int, y: int, near_squared: int
) -> int:
    """Write the columns from first to last, without those too near; return the new count."""
    dy = row * SUB + CELL_CENTRE - y
    if dy * dy < near_squared:
        width = _root(near_squared - dy * dy - 1)
        hole_first = -((CELL_CENTRE - x + width) // SUB)
        hole_last = (x + width - CELL_CENTRE) // SUB
        if hole_first <= hole_last and hole_first <= last and hole_last >= first:
            if first < hole_first:
                spans[count, 0], spans[count, 1], spans[count, 2] = row, first, hole_first - 1
                count += 1
            first = hole_last + 1
    if first <= last:
        spans[count, 0], spans[count, 1], spans[count, 2] = row, first, last
        count += 1
    return count


@kernel
def _fill_row_of_eye(
    x: int,
    y: int,
    sign: int,
    rx: int,
    ry: int,
    ly: int,
    wall: tuple[int, int, int, int],
    bounds: tuple[int, int],
) -> tuple[int, int]:
    """Return the columns that a piece has in the row through the eye, on the side of `sign`."""
    if not (sign * ry <= 0 < sign * ly):
        return 0, -1
    ax, ay, ux, uy = wall
    # In coordinates turned by half a turn for sign -1, along +x: the first c' with c' SUB > bound.
    offset = sign * CELL_CENTRE
    first = (sign * x - offset) // SUB + 1
    if ry == 0:  # right along the border: visible up to its corner
        last = (sign * (x + rx) - offset - 1) // SUB
    else:
        # uy (px - ax) < ux (y - ay), where the eye itself lies before the wall: uy > 0.
        size = SUB * sign * uy
        last = (sign * (sign * ax - offset) * uy + ux * (y - ay) - 1) // size
    if sign > 0:
        return max(first, bounds[0]), min(last, bounds[1])
    return max(-last, bounds[0]), min(-first, bounds[1])


@kernel
def _follow(start: int, rise: int, run: int) -> tuple[int, int, int, int, int]:
    """Return how columns at most start / (SUB run) go on when start grows by SUB rise a row.

    Returns:
        The column and what is left over, in parts of `size`; how much both grow per row; `size`.
    """
    size = SUB * run
    column, step = start // size, rise // run
    return column, start - column * size, step, SUB * (rise - step * run), size


@kernel
def _last_row(
    ex: int, ey: int, borders: tuple[int, int, int, int], wall: tuple[int, int, int, int], base: int
) -> int:
    """Return a row that no cell of a piece is above, and at most one row more than needed.

    The highest point of a piece is the eye, or where a border meets the wall.
    """
    rx, ry, lx, ly = borders
    ax, ay, ux, uy = wall
    across = float(ux) * (ay - ey) - float(uy) * (ax - ex)
    top = 0.0
    if ry > 0:
        top = across / (float(ux) * ry - float(uy) * rx) * ry
    if ly > 0:
        top = max(top, across / (float(ux) * ly - float(uy) * lx) * ly)
    return int((ey + int(top) + 2 - base) // SUB)


@kernel
def _fill_side(
    x: int,
    y: int,
    sign: int,
    borders: tuple[int, int, int, int],
    wall: tuple[int, int, int, int],
    rows: tuple[int, int],
    near_squared: int,
    low: Int64,
    high: Int64,
    spans: Int32,
    count: int,
) -> int:
    """Write the spans of a piece above the eye (sign 1) or below it (-1); return the new count.

    Below, everything is turned by half a turn about the origin, columns and rows with it.
    """
    rx, ry, lx, ly = borders
    ax, ay, ux, uy = wall
    ex, ey, base = sign * x, sign * y, sign * CELL_CENTRE
    row, last_row = max((ey - base) // SUB + 1, rows[0]), rows[1]
    last_row = min(last_row, _last_row(ex, ey, borders, wall, base))
    if row > last_row:
        return count
    dy = row * SUB + base - ey
    # The right border: up to `right`, less what is right on it and not before its corner.
    right, right_rest, right_step, right_extra, right_size = FAR_OUT, 1, 0, 0, 2
    if ry > 0:
        right, right_rest, right_step, right_extra, right_size = _follow(
            (ex - base) * ry + dy * rx, rx, ry
        )
    # The left border: beyond `left`.
    left, left_rest, left_step, left_extra, left_size = -FAR_OUT, 1, 0, 0, 2
    if ly > 0:
        left, left_rest, left_step, left_extra, left_size = _follow(
            (ex - base) * ly + dy * lx, lx, ly
        )
    # The wall: up to `end` for a wall to the right, beyond it for one to the left.
    end, end_rest, end_step, end_extra, end_size = FAR_OUT, 1, 0, 0, 2
    start = (ax - base) * uy + ux * (row * SUB + base - ay)
    if uy > 0:
        end, end_rest, end_step, end_extra, end_size = _follow(start - 1, ux, uy)
    elif uy < 0:
        end, end_rest, end_step, end_extra, end_size = _follow(-start, -ux, -uy)
    for r in range(row, last_row + 1):
        first, last = left + 1, right
        if right_rest == 0 and dy >= ry:
            last -= 1
        if uy > 0:
            last = min(last, end)
        elif uy < 0:
            first = max(first, end + 1)
        elif ux * (r * SUB + base - ay) <= 0:
            break
        if sign > 0:
            first, last = max(first, low[r]), min(last, high[r])
        else:
            first, last = max(-last, low[-r]), min(-first, high[-r])
        if first <= last:
            count = _add_span(spans, count, sign * r, first, last, x, y, near_squared)
        dy += SUB
        right, right_rest = right + right_step, right_rest + right_extra
        if right_rest >= right_size:
            right, right_rest = right + 1, right_rest - right_size
        left, left_rest = left + left_step, left_rest + left_extra
        if left_rest >= left_size:
            left, left_rest = left + 1, left_rest - left_size
        end, end_rest = end + end_step, end_rest + end_extra
        if end_rest >= end_size:
            end, end_rest = end + 1, end_rest - end_size
    return count


@kernel
def _fill_pieces(
    mesh: Mesh,
    x: int,
    y: int,
    pieces: int,
    planes: tuple[int, int, int, int],
    rows: tuple[int, int],
    near_squared: int,
    bench: Bench,
    count: int,
) -> int:
    """Write the spans of all pieces within the bounds of each row; return the new count."""
    vertices, triangles = mesh.vertices, mesh.triangles
    rights, walls, low, high, spans = bench.right, bench.wall, bench.low, bench.high, bench.spans
    a, b, c, d = planes
    eye_row = (y - CELL_CENTRE) // SUB
    in_row = (y - CELL_CENTRE) % SUB == 0 and rows[0] <= eye_row <= rows[1]
    if in_row and (x - CELL_CENTRE) % SUB == 0:
        column = (x - CELL_CENTRE) // SUB
        if low[eye_row] <= column <= high[eye_row]:
            count = _add_span(spans, count, eye_row, column, column, x, y, near_squared)
    for i in range(pieces):
        right, left = rights[i], rights[i + 1 if i + 1 < pieces else 0]
        rx, ry = vertices[right, 0] - x, vertices[right, 1] - y
        lx, ly = vertices[left, 0] - x, vertices[left, 1] - y
        # A piece beside the angle of view: the left border isn't part of it, the right one is.
        if (a * rx + b * ry < 0 and a * lx + b * ly <= 0) or (
            c * rx + d * ry < 0 and c * lx + d * ly <= 0
        ):
            continue
        triangle = int(walls[i]) // 3
        k = int(walls[i]) - 3 * triangle
        start, stop = triangles[triangle, k], triangles[triangle, k + 1 if k < 2 else 0]
        ax, ay = vertices[start, 0], vertices[start, 1]
        ux, uy = vertices[stop, 0] - ax, vertices[stop, 1] - ay
        borders, wall = (rx, ry, lx, ly), (ax, ay, ux, uy)
        if ry > 0 or ly > 0:
            count = _fill_side(
                x, y, 1, borders, wall, rows, near_squared, low, high, spans, count
            )  # fmt: skip
        if ry < 0 or ly < 0:
            turned = (-rx, -ry, -lx, -ly)
            turned_rows = (-rows[1], -rows[0])
            count = _fill_side(
                x, y, -1, turned, (-ax, -ay, -ux, -uy), turned_rows, near_squared, low, high,
                spans, count,
            )  # fmt: skip
        if in_row:
            bounds = (low[eye_row], high[eye_row])
            for sign in (1, -1):
                first, last = _fill_row_of_eye(x, y, sign, rx, ry, ly, wall, bounds)
                if first <= last:
                    count = _add_span(spans, count, eye_row, first, last, x, y, near_squared)
    return count


@kernel
def left_of(half: int) -> tuple[int, int]:
    """Return (a, b), so that a dx + b dy >= 0 left of a direction [1/8192 turn], and on it."""
    return -half_sine(half), half_sine(half + 2 * QUARTER)


@kernel
def cells_in_view(mesh: Mesh, x: int, y: int, heading: int, reach: Reach, bench: Bench) -> int:
    """Find the cells whose centre is in view: in range, within the angle, and in line of sight.

    Args:
        mesh: Free space.
        x: Where the camera is, lattice units.
        y: Where the camera is, lattice units.
        heading: Where it looks, 1/4096 turn.
        reach: How far and wide it sees.
        bench: Scratch space; its `spans` are the answer: row, first and last column, none twice,
            in no particular order.

    Returns:
        The number of spans; 0 for a camera outside or on a wall.
    """
    low, high = bench.low, bench.high
    height, columns = low.shape[0], bench.spans.shape[0] // low.shape[0]
    pieces, _ = look_around(
        mesh.vertices, mesh.triangles, mesh.neighbors, x, y, locate(mesh, x, y),
        bench.right, bench.wall, bench.stack,
    )  # fmt: skip
    if pieces == 0:
        return 0
    far = _root(reach.far_squared)
    bottom = max(0, -((CELL_CENTRE - y + far) // SUB))
    top = min(height - 1, (y + far - CELL_CENTRE) // SUB)
    half = reach.half_angle
    # An angle wider than half a turn is seen in two parts: right of the heading, and left of it.
    parts = 2 if 2 * QUARTER < half < TURN else 1
    count = 0
    for part in range(parts):
        a, b, c, d, least = 0, 0, 0, 0, 0  # left of one line, right of another
        if half < TURN:
            a, b = left_of(2 * heading - half if part == 0 else 2 * heading)
            c, d = left_of(2 * heading + half if part == parts - 1 else 2 * heading)
            c, d, least = -c, -d, part  # the heading itself belongs to the first part
        first, last = bottom, top
        _limit_to_range(x, y, reach.far_squared, columns, (first, last), low, high)
        _limit_to_half_plane(a, b, least, x, y, (first, last), low, high)
        _limit_to_half_plane(c, d, 0, x, y, (first, last), low, high)
        while first <= last and low[first] > high[first]:
            first += 1
        while last > first and low[last] > high[last]:
            last -= 1
        count = _fill_pieces(
            mesh, x, y, pieces, (a, b, c, d), (first, last), reach.near_squared, bench, count
        )
    return count


@kernel
def mark_spans(spans: Int32, count: int, mask: NDArray[np.bool_]) -> None:
    """Set the cells of the first `count` spans."""
    for i in range(count):
        for column in range(spans[i, 1], spans[i, 2] + 1):
            mask[spans[i, 0], column] = True
