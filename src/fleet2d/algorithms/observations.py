"""Observations: what the robots made of what their cameras showed, and what was really there."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.activities import ROBOT, Activities, Names
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


class Observations(NamedTuple):
    """What the robots perceived, in order of step and robot; all arrays of one length.

    `step` is when it became known. Users, robots and rooms are indices into the scenario's users
    and robots and the home's rooms. Nobody can tell from it what is wrong: a user may be mistaken
    for another, or not be there at all.
    """

    step: NDArray[np.int64]
    robot: NDArray[np.int32]
    user: NDArray[np.int32]  # for whom somebody was taken, NOBODY if not recognized
    x: NDArray[np.float64]  # perceived position [m]
    y: NDArray[np.float64]
    room: NDArray[np.int16]  # of that position, or the nearest room
    heading: NDArray[np.float64]  # perceived heading [rad]
    posture: NDArray[np.int8]  # perceived posture: 0 stands, 1 sits, 2 lies
    camera: NDArray[np.int8]  # index among the robot's cameras
    activity: Names = NO_NAMES  # what somebody is taken to do, str; None where that isn't perceived


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


def perceived(
    plan: "FloorPlan", rooms: NearestRooms, rows: NDArray[np.int64], activities: Activities
) -> Observations:
    """Return rows of observations as what was perceived."""
    xy = plan.lattice.to_metres(rows[:, [X, Y]])
    return Observations(
        rows[:, STEP].copy(),
        rows[:, ROBOT].astype(np.int32),
        rows[:, IDENTITY].astype(np.int32),
        xy[:, 0],
        xy[:, 1],
        rooms.of(rows[:, X], rows[:, Y]),
        in_radians(rows[:, HEADING]),
        rows[:, POSTURE].astype(np.int8),
        rows[:, CAMERA].astype(np.int8),
        activities.perceived(rows),
    )


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
