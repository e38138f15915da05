"""Poses of one body over a stretch of steps, as arrays in metres and radians."""

from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.observations import NOWHERE
from fleet2d.kernels.headings import in_radians
from fleet2d.kernels.measure import count_rooms, rooms_at, sum_moves
from fleet2d.kernels.motion import Poses

if TYPE_CHECKING:
    from fleet2d.floorplan.home import Home

Array = TypeVar("Array", bound=NDArray[Any])


class BodyPoses:
    """Poses of one body, one entry per step; columns are worked out when they are asked for."""

    def __init__(self, home: "Home", poses: Poses) -> None:
        self._home, self._poses = home, poses

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self._poses.x)

    @cached_property
    def xy(self) -> NDArray[np.float64]:
        """Positions (n, 2) [m]; where it left while it is away."""
        lattice = self._home.plan.lattice
        return _shared(lattice.to_metres(np.stack([self._poses.x, self._poses.y], axis=-1)))

    def at(self, index: int) -> tuple[float, float]:
        """Return the position (x, y) [m] at one step; -1 is the last."""
        point = self._poses.x[index], self._poses.y[index]
        x, y = self._home.plan.lattice.to_metres(point).tolist()
        return x, y

    @property
    def x(self) -> NDArray[np.float64]:
        """Positions along x [m]."""
        return self.xy[:, 0]

    @property
    def y(self) -> NDArray[np.float64]:
        """Positions along y [m]."""
        return self.xy[:, 1]

    @cached_property
    def heading(self) -> NDArray[np.float64]:
        """Headings, counter-clockwise from +x, 0 to 2 pi [rad]."""
        radians: NDArray[np.float64] = in_radians(self._poses.heading)
        return _shared(radians)

    @cached_property
    def away(self) -> NDArray[np.bool_]:
        """Whether it is out of the home."""
        return _shared(self._poses.away.astype(bool))

    @cached_property
    def room(self) -> NDArray[np.int16]:
        """Index of the room, NOWHERE while it is away."""
        room = rooms_at(self._home.plan.room_of_place, self._poses.x, self._poses.y)
        return _shared(np.where(self.away, np.int16(NOWHERE), room))

    @cached_property
    def time_in_rooms(self) -> NDArray[np.int64]:
        """Number of steps in each room, and last away: int64 (rooms + 1,)."""
        counts = np.zeros(len(self._home.rooms) + 1, np.int64)
        count_rooms(self._poses, self._home.plan.room_of_place, counts)
        return _shared(counts)

    @cached_property
    def distance(self) -> float:
        """Length of the way from the first to the last step [m]."""
        return float(sum_moves(self._poses)) / self._home.plan.lattice.units_per_m


def _shared(array: Array) -> Array:
    """Refuse changes: whoever is updated at the same step gets the same array."""
    array.setflags(write=False)
    return array
