"""Observations: what the robots perceived, and the truth behind it."""

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fleet2d.algorithms.activities import ROBOT, Activities, Names
from fleet2d.floorplan.cache import read_only
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I8, I16, I32, I64
from fleet2d.kernels.motion import rooms_at
from fleet2d.kernels.numbers import in_radians
from fleet2d.kernels.sight import SightingColumn as Column
from fleet2d.kernels.space import fill_from_neighbors

NOWHERE = -1  # the room of a body that is away
NO_NAMES: Names = np.empty(0, object)
OBSERVATION = ROBOT + 1  # number of columns of a row of observations


class Rows:
    """Rows of observations in consecutive blocks; columns are joined on demand."""

    def __init__(self, blocks: Sequence[I64]) -> None:
        self._blocks = blocks or [np.empty((0, OBSERVATION), np.int64)]

    def __len__(self) -> int:
        """Return the number of rows."""
        return sum(map(len, self._blocks))

    def column(self, number: int) -> I64:
        """Return a column of all rows: int64 (n,); of a single block it is a view."""
        columns = [block[:, number] for block in self._blocks]
        return columns[0] if len(columns) == 1 else np.concatenate(columns)

    @cached_property
    def whole(self) -> I64:
        """All columns of all rows: int64 (n, OBSERVATION)."""
        return np.concatenate(self._blocks) if len(self._blocks) > 1 else self._blocks[0]


class Observations:
    """What the robots perceived, in order of step and robot; all arrays of one length.

    `step` is when it became known. Users, robots and rooms are indices into the scenario's users
    and robots and the home's rooms. Errors aren't marked: a user may be mistaken for another, or
    not be there at all. Arrays are read-only, and computed on demand.
    """

    def __init__(
        self, plan: FloorPlan, rooms: "NearestRooms", rows: Rows, activities: Activities
    ) -> None:
        self._plan, self._rooms, self._rows, self._activities = plan, rooms, rows, activities

    def __len__(self) -> int:
        """Return the number of observations."""
        return len(self._rows)

    @cached_property
    def step(self) -> I64:
        """Step at which the observation became known: int64 (n,)."""
        return read_only(self._rows.column(Column.STEP))

    @cached_property
    def robot(self) -> I32:
        """Index of the robot: int32 (n,)."""
        return read_only(self._rows.column(ROBOT).astype(np.int32))

    @cached_property
    def user(self) -> I32:
        """Index of the recognized user, NOBODY if not recognized: int32 (n,)."""
        return read_only(self._rows.column(Column.IDENTITY).astype(np.int32))

    @cached_property
    def _xy(self) -> F64:
        return read_only(
            self._plan.lattice.to_metres(
                np.stack([self._rows.column(Column.X), self._rows.column(Column.Y)], 1)
            )
        )

    @property
    def x(self) -> F64:
        """Perceived position along x [m]: float64 (n,)."""
        return self._xy[:, 0]

    @property
    def y(self) -> F64:
        """Perceived position along y [m]: float64 (n,)."""
        return self._xy[:, 1]

    @cached_property
    def room(self) -> I16:
        """Room of the perceived position, or the nearest room: int16 (n,)."""
        return read_only(self._rooms.of(self._rows.column(Column.X), self._rows.column(Column.Y)))

    @cached_property
    def heading(self) -> F64:
        """Perceived heading [rad]: float64 (n,)."""
        return read_only(in_radians(self._rows.column(Column.HEADING)))

    @cached_property
    def posture(self) -> I8:
        """Perceived posture, 0 stands, 1 sits, 2 lies: int8 (n,)."""
        return read_only(self._rows.column(Column.POSTURE).astype(np.int8))

    @cached_property
    def camera(self) -> I8:
        """Index among the robot's cameras: int8 (n,)."""
        return read_only(self._rows.column(Column.CAMERA).astype(np.int8))

    @cached_property
    def activity(self) -> Names:
        """Perceived activity; None where activities aren't perceived: object (n,)."""
        return read_only(self._activities.perceived(self._rows.whole))


class Truth(NamedTuple):
    """The truth, row by row of the observations; for metrics only.

    For a false positive, `user` is NOBODY, and the other columns mean nothing.
    """

    user: I32
    x: F64  # position of the user at the look [m]
    y: F64
    heading: F64  # [rad]
    posture: I8
    activity: Names = NO_NAMES  # activity of the user; None where its behavior records none


class Looks(NamedTuple):
    """How often each camera looked at a user in view, and how often it noticed; for metrics."""

    robot: I32  # (cameras,) index of the camera's robot
    camera: tuple[str, ...]  # (cameras,) name of the camera
    in_view: I64  # (cameras, users) looks with the user in view
    detected: I64  # (cameras, users) looks with the user in view and noticed


class NearestRooms:
    """The room of any place; in a wall or outside, the nearest room."""

    def __init__(self, plan: FloorPlan, of_cell: I16 | None = None) -> None:
        """Use the rooms of a plan, or other parts of it, such as the patches of its rooms.

        Args:
            plan: The floor plan.
            of_cell: int16 (rows, columns), the part that each cell belongs to, NOWHERE for none;
                None: its room.
        """
        self._plan = plan
        self._rooms = None if of_cell is None else _shared(fill_from_neighbors(of_cell))

    def of(self, x: I64, y: I64) -> I16:
        """Return the rooms of places [lattice units]; NOWHERE only in a home without rooms."""
        if self._rooms is None:
            self._rooms = self._plan.room_of_place
        rooms: I16 = rooms_at(self._rooms, x, y)
        while len(rooms) and rooms.min() == NOWHERE and self._plan.rooms:
            padded = np.pad(self._rooms, 1, constant_values=NOWHERE)
            self._rooms = _shared(fill_from_neighbors(padded)[1:-1, 1:-1])
            rooms = rooms_at(self._rooms, x, y)
        return rooms


def _shared(rooms: I16) -> I16:
    """Return a map of rooms as a contiguous, read-only array."""
    rooms = np.ascontiguousarray(rooms)
    rooms.setflags(write=False)
    return rooms


def truth(plan: FloorPlan, rows: I64, activities: Activities) -> Truth:
    """Return the truth behind rows of observations."""
    xy = plan.lattice.to_metres(rows[:, [Column.TRUE_X, Column.TRUE_Y]])
    return Truth(
        rows[:, Column.USER].astype(np.int32),
        xy[:, 0],
        xy[:, 1],
        in_radians(rows[:, Column.TRUE_HEADING]),
        rows[:, Column.TRUE_POSTURE].astype(np.int8),
        activities.true(rows),
    )
