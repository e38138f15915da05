"""Arguments and results of the core for a body that gives way: see `Timelines.way_past`."""

from collections.abc import Callable
from typing import NamedTuple

from fleet2d.kernels import I16, I32, I64, Legs, Mesh, Routes


class Yielder(NamedTuple):
    """A body that gives way, and its motion.

    Attributes:
        row: The number of the body.
        space: The space in which its middle may be.
        routes: The shortest routes in the space; None if the body takes others.
        speed: Its speed [lattice units per second].
        turn_rate: Its turn rate [1/4096 turn per second].
        beat_us: A late body leaves a stop at a multiple of this time [us].
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
    """A body in the way of another one, and the space to pass it.

    Attributes:
        other: The body in the way.
        near: Distance from a stop of the other one below which the body takes it [lattice].
        distance: Distance at which the other one passes [lattice].
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
    """The search of a body for a place to step aside to.

    Attributes:
        part_of_cell: int32 (rows, columns), the part of its space of each cell.
        part: The part of the body.
        begin: Returns the point from which it goes there [lattice].
        near_cells: Cells to each side that are searched first.
        far_cells: Cells to each side that are searched then.
        spacing: Distance between tried cells [cells].
        most: The maximum number of places.
        reach: int64 (bodies,), least distance of each other body from a place [lattice].
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
    """The delay of a part of a track.

    Attributes:
        after_us: The moment up to which plans have happened, or have the delay before.
        since_us: The moment at which earlier plans happen.
        later_us: The delay, up to the edge.
        edge_us: The beginning of a rest that is shortened, so that the body is on time afterwards.
    """

    after_us: int
    since_us: int
    later_us: int
    edge_us: int

    def of(self, time_us: int) -> int:
        """Return the time at which something planned for a moment happens."""
        time_us = max(time_us, self.since_us)
        if time_us <= self.edge_us:
            return time_us + self.later_us
        return max(time_us, self.edge_us + self.later_us)


Continued = tuple[Legs, tuple[int, int, int, int, int], list[tuple[int, int, int, int]]]
"""Breakpoints from now on that continue a track, the last of them, and the delays of its parts, one
after the other: see `Delay`."""
