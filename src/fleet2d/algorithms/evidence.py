"""Evidence: what robots watched and whom they perceived there, in bins of time."""

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.observations import NOWHERE
from fleet2d.kernels.presence import count_sightings

if TYPE_CHECKING:
    from fleet2d.floorplan.plan import FloorPlan

# Length of a bin; one step where a step is longer.
BIN_US = 60_000_000


class Evidence(NamedTuple):
    """What robots watched and whom they perceived there, in bins of equal length, in order of time.

    That nobody was perceived where a robot looked is evidence, too: it is what tells a user who is
    somewhere else from one whom nobody looked for.

    Attributes:
        begin: Step at which the first bin begins.
        bin_steps: Steps of a bin; bins begin at step 0, and last a minute, or a step if that is
            longer.
        watched: float64 (bins, rooms), share of each room's cells in view, averaged over the steps
            of the bin; of several robots, that of the robot that saw most of the room.
        seen: int64 (bins, users + 1, rooms), steps of the bin at which each user was perceived in
            each room; the last is for anybody, known or not.

    Example:
        >>> Evidence(0, 60, np.array([[0.5, 0.0]]), np.array([[[30, 0], [30, 0]]])).seen.shape
        (1, 2, 2)
    """

    begin: int
    bin_steps: int
    watched: NDArray[np.float64]
    seen: NDArray[np.int64]

    def __len__(self) -> int:
        """Return the number of bins."""
        return len(self.watched)


def steps_of_bin(step_us: int) -> int:
    """Return how many steps a bin has.

    Example:
        >>> steps_of_bin(1_000_000), steps_of_bin(25_000_000), steps_of_bin(300_000_000)
        (60, 2, 1)
    """
    return max(1, BIN_US // step_us)


def cells_of_rooms(plan: "FloorPlan") -> NDArray[np.int64]:
    """Return the number of cells of each room: int64 (rooms,)."""
    rooms = plan.room_of_cell
    return np.bincount(rooms[rooms != NOWHERE], minlength=len(plan.rooms))


class Sighted(Protocol):
    """Who was perceived where, in order of time: Observations, or what is needed of them."""

    @property
    def step(self) -> NDArray[np.int64]:
        """When."""

    @property
    def user(self) -> NDArray[np.integer[Any]]:
        """For whom somebody was taken, below 0 for nobody known."""

    @property
    def room(self) -> NDArray[np.integer[Any]]:
        """In which room, NOWHERE for none."""


class Sightings(NamedTuple):
    """Who was perceived where, in order of time; arrays of one length."""

    step: NDArray[np.int64]
    user: NDArray[np.int64]
    room: NDArray[np.int16]


def count_seen(
    sighted: Sighted, begin: int, bins: int, bin_steps: int, users: int, rooms: int
) -> NDArray[np.int64]:
    """Return Evidence.seen: a user perceived twice at a step in a room counts once."""
    seen = np.zeros((bins, users + 1, rooms), np.int64)
    user, room = sighted.user.astype(np.int64), sighted.room.astype(np.int64)
    count_sightings(sighted.step - begin, user, room, bin_steps, seen)
    return seen
