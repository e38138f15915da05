"""Poses of one body over a stretch of steps, as arrays in metres and radians."""

from functools import cached_property
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.frozen import frozen
from fleet2d.algorithms.observations import NOWHERE
from fleet2d.floorplan.home.home import Home
from fleet2d.kernels import F64, I16, I64, U8, Bool
from fleet2d.kernels.motion import Poses, count_together, rooms_at, sum_moves
from fleet2d.kernels.numbers import in_radians

Array = TypeVar("Array", bound=NDArray[Any])


class Path(Protocol):
    """Protocol of runs of equal pose of one body, such as `fleet2d.kernels.motion.Window`."""

    @property
    def first(self) -> int:
        """The first step."""

    @property
    def end(self) -> int:
        """One past the last step."""

    @property
    def step(self) -> I64:
        """First step of each run."""

    @property
    def x(self) -> I64:
        """Position along x of each run [lattice units]."""

    @property
    def y(self) -> I64:
        """Position along y of each run [lattice units]."""

    @property
    def heading(self) -> I64:
        """Heading of each run [1/4096 turn]."""

    @property
    def away(self) -> U8:
        """Not 0 for runs away from home."""


class BodyPoses:
    """Poses of one body, one entry per step; columns are computed on demand."""

    def __init__(self, home: Home, runs: Path) -> None:
        self._home, self._runs = home, runs

    def __len__(self) -> int:
        """Return the number of steps."""
        return self._runs.end - self._runs.first

    @cached_property
    def _lengths(self) -> I64:
        """Number of steps of each run of equal pose."""
        return np.diff(self._runs.step, append=self._runs.end)

    @cached_property
    def xy(self) -> F64:
        """Positions: float64 (n, 2) [m]; while away, the place at which the body left."""
        lattice = self._home.plan.lattice
        xy = lattice.to_metres(np.stack([self._runs.x, self._runs.y], axis=-1))
        return _shared(np.repeat(xy, self._lengths, axis=0))

    def at(self, index: int) -> tuple[float, float]:
        """Return the position (x, y) [m] at one step; -1 is the last."""
        runs = self._runs
        step = runs.first + range(len(self))[index]
        run = int(np.searchsorted(runs.step, step, side="right")) - 1
        x, y = self._home.plan.lattice.to_metres((runs.x[run], runs.y[run])).tolist()
        return x, y

    @property
    def x(self) -> F64:
        """Positions along x [m]."""
        return self.xy[:, 0]

    @property
    def y(self) -> F64:
        """Positions along y [m]."""
        return self.xy[:, 1]

    @cached_property
    def heading(self) -> F64:
        """Headings, counter-clockwise from +x, 0 to 2 pi [rad]."""
        radians: F64 = in_radians(self._runs.heading)
        return _shared(np.repeat(radians, self._lengths))

    @cached_property
    def away(self) -> Bool:
        """Whether the body is away from home: bool (n,)."""
        return _shared(np.repeat(self._runs.away.astype(bool), self._lengths))

    @cached_property
    def room(self) -> I16:
        """Index of the room, NOWHERE while the body is away: int16 (n,)."""
        return _shared(np.repeat(self._rooms, self._lengths))

    @cached_property
    def _rooms(self) -> I16:
        """Index of the room of each run."""
        runs = self._runs
        room = rooms_at(self._home.plan.room_of_place, runs.x, runs.y)
        return np.where(runs.away != 0, np.int16(NOWHERE), room)

    @cached_property
    def visits(self) -> tuple[I64, I64, I16]:
        """Stretches of steps in one room: begin, end and room of each, each (stretches,).

        Steps are counted from `first`; the room is NOWHERE while the body is away.
        """
        rooms = self._rooms
        first = np.flatnonzero(np.append(True, rooms[1:] != rooms[:-1])[: len(rooms)])
        begin = self._runs.step[first] - self._runs.first
        return frozen((begin, np.append(begin, len(self))[1:], rooms[first]))

    @cached_property
    def time_in_rooms(self) -> I64:
        """Number of steps in each room, and last away: int64 (rooms + 1,)."""
        begin, end, room = self.visits
        counts = np.zeros(len(self._home.rooms) + 1, np.int64)
        np.add.at(counts, room, end - begin)  # NOWHERE is the last
        return _shared(counts)

    @cached_property
    def steps_at_home(self) -> int:
        """Number of steps at which the body isn't away."""
        return int(self._lengths[self._runs.away == 0].sum())

    def steps_together(self, other: "BodyPoses") -> int:
        """Return the number of steps at which two bodies are in the same room."""
        (begin, _, room), (other_begin, _, other_room) = self.visits, other.visits
        return count_together(begin, room, other_begin, other_room, len(self))

    @cached_property
    def distance(self) -> float:
        """Length of the way from the first to the last step [m]."""
        runs = self._runs
        moved = sum_moves(Poses(runs.x, runs.y, runs.heading, runs.away))
        return moved / self._home.plan.lattice.units_per_m


def _shared(array: Array) -> Array:
    """Make an array read-only: components that are updated at the same step share it."""
    array.setflags(write=False)
    return array
