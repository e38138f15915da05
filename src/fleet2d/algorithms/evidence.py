"""Evidence: what robots watched and whom they perceived there, in bins of time."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.patches import Patches
from fleet2d.kernels.evidence import gather_views
from fleet2d.kernels.presence import count_sightings

# Length of a bin; one step where a step is longer.
BIN_US = 60_000_000


class Parts(NamedTuple):
    """Evidence by patches of rooms, each in view as a whole or not at all for the most part.

    Attributes:
        room: int64 (patches,), the room of each patch, in ascending order.
        cells: int64 (patches,), how many cells each has.
        watched: float64 (bins, patches), as in Evidence.
        shown: float64 (bins, patches), share of each patch's cells in view at one step of the bin,
            at most; of several robots, that of the robot that saw most of it.
        seen: int64 (bins, users + 1, patches), as in Evidence.
        shown_parts: uint8 (bins, patches), `shown` in parts of 255; None: not worked out yet.
    """

    room: NDArray[np.int64]
    cells: NDArray[np.int64]
    watched: NDArray[np.float64]
    shown: NDArray[np.float64]
    seen: NDArray[np.int64]
    shown_parts: NDArray[np.uint8] | None = None


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
        parts: The same by patches of rooms; None: each room is one.

    Example:
        >>> Evidence(0, 60, np.array([[0.5, 0.0]]), np.array([[[30, 0], [30, 0]]])).seen.shape
        (1, 2, 2)
    """

    begin: int
    bin_steps: int
    watched: NDArray[np.float64]
    seen: NDArray[np.int64]
    parts: Parts | None = None

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


class Sightings(NamedTuple):
    """Who was perceived where, in order of time; arrays of one length."""

    step: NDArray[np.int64]
    user: NDArray[np.int64]  # for whom somebody was taken, below 0 for nobody known
    room: NDArray[np.integer[Any]]  # NOWHERE for none


def gather(
    first: int,
    bin_steps: int,
    patches: Patches,
    cells: NDArray[np.int64],
    sighted: Sightings,
    users: int,
) -> Evidence:
    """Return the evidence of some bins.

    Args:
        first: Step at which the first bin begins.
        bin_steps: Steps of a bin.
        patches: The patches of rooms.
        cells: int64 (bins, robots, 2, patches), cells of each patch in view of each robot, summed
            over the steps of the bin, and at most at one.
        sighted: Who was perceived in which patch.
        users: How many users there are.
    """
    count = len(patches.room)
    watched, by_patch, shown, shown_parts = gather_views(
        cells, patches.room, patches.cells, patches.room_cells, bin_steps
    )
    sizes = (first, len(cells), bin_steps, users)
    in_room = sighted._replace(room=patches.room[sighted.room])
    seen = count_seen(sighted, *sizes, count)
    parts = Parts(patches.room, patches.cells, by_patch, shown, seen, shown_parts)
    in_rooms = count_seen(in_room, *sizes, len(patches.first))
    return Evidence(first, bin_steps, watched, in_rooms, parts)


def count_seen(
    sighted: Sightings, begin: int, bins: int, bin_steps: int, users: int, rooms: int
) -> NDArray[np.int64]:
    """Return Evidence.seen: a user perceived twice at a step in a room counts once.

    With patches in place of rooms it is Parts.seen.
    """
    seen = np.zeros((bins, users + 1, rooms), np.int64)
    user, room = sighted.user.astype(np.int64), sighted.room.astype(np.int64)
    count_sightings(sighted.step - begin, user, room, bin_steps, seen)
    return seen
