"""What the core is told of a body that gives way, and what it answers: see `Timelines.way_past`."""

from collections.abc import Callable
from typing import NamedTuple

from fleet2d.kernels import I16, I32, I64, Legs, Mesh, Routes


class Yielder(NamedTuple):
    """A body that gives way, and how it goes somewhere.

    Attributes:
        row: Its number.
        space: Where its middle may be.
        routes: The shortest ways in it; None if it takes others.
        speed: How fast it goes [lattice units per second].
        turn_rate: How fast it turns [1/4096 turn per second].
        beat_us: If it is late, it leaves a stop at a multiple of that [us].
        walk: Called with time [us], x, y, heading, the x and y of a goal to which no route leads,
            and the discs to keep clear of, as for `Routes.around`; returns the breakpoints of a way
            there, int64 (n, 5), or None.
    """

    row: int
    space: Mesh
    routes: Routes | None
    speed: float
    turn_rate: float
    beat_us: int
    walk: Callable[..., I64 | None]


class BodyInWay(NamedTuple):
    """A body in the way of another one, and where that one may pass it.

    Attributes:
        other: The body in the way.
        near: How near to a stop of the other one it must stand to take it [lattice].
        distance: At which distance the other one passes it [lattice].
        room_of_place: int16 (rows, columns), the room of each cell, -1 for none.
        parts: int32 (triangles,), the part of each triangle of the space of the other one, or a
            function that returns the part of a point.
        part: The part in which the other one is.
    """

    other: int
    near: int
    distance: int
    room_of_place: I16
    parts: I32 | Callable[[int, int], int]
    part: int


class AsideSearch(NamedTuple):
    """Where a body looks for places to step aside to.

    Attributes:
        part_of_cell: int32 (rows, columns), the part of its space of each cell.
        part: Its part.
        begin: Returns the point from which it goes there [lattice].
        near_cells: How many cells to each side it looks first.
        far_cells: And then.
        spacing: It looks at every so many of them.
        most: For how many places it looks.
        reach: int64 (bodies,), how near the others may come to a place [lattice].
    """

    part_of_cell: I32
    part: int
    begin: Callable[[], tuple[int, int]]
    near_cells: int
    far_cells: int
    spacing: int
    most: int
    reach: I64


class Delay(NamedTuple):
    """By how much later a part of a track comes.

    Attributes:
        after_us: What was planned up to that moment has happened, or has the delay before.
        since_us: What was planned before that moment happens at it.
        later_us: How much later all is, up to the edge.
        edge_us: A rest that begins then is shortened, so that the body is on time again after it.
    """

    after_us: int
    since_us: int
    later_us: int
    edge_us: int

    def of(self, time_us: int) -> int:
        """Return when something happens that was planned for a moment."""
        time_us = max(time_us, self.since_us)
        if time_us <= self.edge_us:
            return time_us + self.later_us
        return max(time_us, self.edge_us + self.later_us)


Continued = tuple[Legs, tuple[int, int, int, int, int], list[tuple[int, int, int, int]]]
"""Breakpoints from now on that continue a track, the last of them, and the delays of its parts, one
after the other: see `Delay`."""
