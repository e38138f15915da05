"""Observations: what the robots made of what their cameras showed, and what was really there."""

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.activities import ROBOT, Activities, Names
from fleet2d.floorplan.kept import read_only
from fleet2d.floorplan.rooms.room import beside_rooms
from fleet2d.kernels.headings import in_radians
from fleet2d.kernels.look import (
    CAMERA,
    HEADING,
    IDENTITY,
    POSTURE,
    STEP,
    TRUE_HEADING,
    TRUE_POSTURE,
    TRUE_X,
    TRUE_Y,
    USER,
    X,
    Y,
)
from fleet2d.kernels.measure import rooms_at

if TYPE_CHECKING:
    from fleet2d.floorplan.plan import FloorPlan

NOWHERE = -1  # the room of who is away
NO_NAMES: Names = np.empty(0, object)
OBSERVATION = ROBOT + 1  # columns of a row of observations


class Rows:
    """Rows of observations in blocks that follow on each other, joined by column when asked for."""

    def __init__(self, blocks: Sequence[NDArray[np.int64]]) -> None:
        self._blocks = blocks or [np.empty((0, OBSERVATION), np.int64)]

    def __len__(self) -> int:
        """Return the number of rows."""
        return sum(map(len, self._blocks))

    def column(self, number: int) -> NDArray[np.int64]:
        """Return a column of all rows: int64 (n,)."""
        return np.concatenate([block[:, number] for block in self._blocks])

    @cached_property
    def whole(self) -> NDArray[np.int64]:
        """All columns of all rows: int64 (n, OBSERVATION)."""
        return np.concatenate(self._blocks) if len(self._blocks) > 1 else self._blocks[0]


class Observations:
    """What the robots perceived, in order of step and robot; all arrays of one length.

    `step` is when it became known. Users, robots and rooms are indices into the scenario's users
    and robots and the home's rooms. Nobody can tell from it what is wrong: a user may be mistaken
    for another, or not be there at all. Arrays are read-only, and worked out when asked for.
    """

    def __init__(
        self,
        plan: "FloorPlan",
        rooms: "NearestRooms",
        rows: Rows,
        activities: Activities,
    ) -> None:
        self._plan, self._rooms, self._rows, self._activities = plan, rooms, rows, activities

    def __len__(self) -> int:
        """Return the number of observations."""
        return len(self._rows)

    @cached_property
    def step(self) -> NDArray[np.int64]:
        """Step at which it became known: int64 (n,)."""
        return read_only(self._rows.column(STEP))

    @cached_property
    def robot(self) -> NDArray[np.int32]:
        """Index of the robot: int32 (n,)."""
        return read_only(self._rows.column(ROBOT).astype(np.int32))

    @cached_property
    def user(self) -> NDArray[np.int32]:
        """For whom somebody was taken, NOBODY if not recognized: int32 (n,)."""
        return read_only(self._rows.column(IDENTITY).astype(np.int32))

    @cached_property
    def _xy(self) -> NDArray[np.float64]:
        return read_only(
            self._plan.lattice.to_metres(np.stack([self._rows.column(X), self._rows.column(Y)], 1))
        )

    @property
    def x(self) -> NDArray[np.float64]:
        """Perceived position along x [m]: float64 (n,)."""
        return self._xy[:, 0]

    @property
    def y(self) -> NDArray[np.float64]:
        """Perceived position along y [m]: float64 (n,)."""
        return self._xy[:, 1]

    @cached_property
    def room(self) -> NDArray[np.int16]:
        """Room of that position, or the nearest room: int16 (n,)."""
        return read_only(self._rooms.of(self._rows.column(X), self._rows.column(Y)))

    @cached_property
    def heading(self) -> NDArray[np.float64]:
        """Perceived heading [rad]: float64 (n,)."""
        return read_only(in_radians(self._rows.column(HEADING)))

    @cached_property
    def posture(self) -> NDArray[np.int8]:
        """Perceived posture, 0 stands, 1 sits, 2 lies: int8 (n,)."""
        return read_only(self._rows.column(POSTURE).astype(np.int8))

    @cached_property
    def camera(self) -> NDArray[np.int8]:
        """Index among the robot's cameras: int8 (n,)."""
        return read_only(self._rows.column(CAMERA).astype(np.int8))

    @cached_property
    def activity(self) -> Names:
        """What somebody is taken to do; None where that isn't perceived: object (n,)."""
        return read_only(self._activities.perceived(self._rows.whole))


class Truth(NamedTuple):
    """What was really there, row by row of the observations; only metrics may know.

    Of a false positive, `user` is NOBODY, and the rest means nothing.
    """

    user: NDArray[np.int32]
    x: NDArray[np.float64]  # where the user was at the look [m]
    y: NDArray[np.float64]
    heading: NDArray[np.float64]  # [rad]
    posture: NDArray[np.int8]
    activity: Names = NO_NAMES  # what the user did, as far as behaviors tell; None: not told


class Looks(NamedTuple):
    """How often each camera looked at a user in view, and how often it noticed; for metrics."""

    robot: NDArray[np.int32]  # (cameras,) index of its robot
    camera: tuple[str, ...]  # (cameras,) its name
    in_view: NDArray[np.int64]  # (cameras, users) looks at which the user was in view
    detected: NDArray[np.int64]  # (cameras, users) of these, those at which it was noticed


class NearestRooms:
    """The room of any place, also of one in a wall or outside: there it is the nearest room's."""

    def __init__(self, plan: "FloorPlan", of_cell: NDArray[np.int16] | None = None) -> None:
        """Take the rooms of a plan, or other parts of it, as the patches of its rooms.

        Args:
            plan: The floor plan.
            of_cell: int16 (rows, columns), the part that each cell belongs to, NOWHERE for none;
                left out: its room.
        """
        self._plan = plan
        self._rooms = None if of_cell is None else _shared(beside_rooms(of_cell))

    def of(self, x: NDArray[np.int64], y: NDArray[np.int64]) -> NDArray[np.int16]:
        """Return the rooms of places [lattice units]; NOWHERE only in a home without rooms."""
        if self._rooms is None:
            self._rooms = self._plan.room_of_place
        found: NDArray[np.int16] = rooms_at(self._rooms, x, y)
        while len(found) and found.min() == NOWHERE and self._plan.rooms:
            padded = np.pad(self._rooms, 1, constant_values=NOWHERE)
            self._rooms = _shared(beside_rooms(padded)[1:-1, 1:-1])
            found = rooms_at(self._rooms, x, y)
        return found


def _shared(rooms: NDArray[np.int16]) -> NDArray[np.int16]:
    """Return a map of rooms as the plan's own are: in one piece, and not to be changed."""
    rooms = np.ascontiguousarray(rooms)
    rooms.setflags(write=False)
    return rooms


def truth(plan: "FloorPlan", rows: NDArray[np.int64], activities: Activities) -> Truth:
    """Return rows of observations as what was there."""
    xy = plan.lattice.to_metres(rows[:, [TRUE_X, TRUE_Y]])
    return Truth(
        rows[:, USER].astype(np.int32),
        xy[:, 0],
        xy[:, 1],
        in_radians(rows[:, TRUE_HEADING]),
        rows[:, TRUE_POSTURE].astype(np.int8),
        activities.true(rows),
    )
