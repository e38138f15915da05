"""Evidence: what robots watched, and which users they perceived there, in bins of time."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.patches import Patches
from fleet2d.kernels.evidence import gather_views
from fleet2d.kernels.presence import count_sightings

# Length of a bin [us]; one step where a step is longer.
BIN_US = 60_000_000


class Parts(NamedTuple):
    """Evidence by patches of rooms, each of which is mostly in view as a whole or not at all.

    Attributes:
        room: int64 (patches,), ascending, the room of each patch.
        cells: int64 (patches,), number of cells of each patch.
        watched: float64 (bins, patches), as in Evidence.
        shown: float64 (bins, patches), the largest share of each patch's cells in view at one step
            of the bin; with several robots, that of the robot that saw most of it.
        seen: int64 (bins, users + 1, patches), as in Evidence.
        shown_parts: uint8 (bins, patches), `shown` times 255; None: not computed yet.
    """

    room: NDArray[np.int64]
    cells: NDArray[np.int64]
    watched: NDArray[np.float64]
    shown: NDArray[np.float64]
    seen: NDArray[np.int64]
    shown_parts: NDArray[np.uint8] | None = None


class Evidence(NamedTuple):
    """What robots watched, and which users they perceived there, in bins of equal length.

    Looks at which nobody was perceived are evidence, too: they distinguish a user who is somewhere
    else from one in a room that no robot looked at.

    Attributes:
        begin: First step of the first bin.
        bin_steps: Steps of a bin; bins begin at step 0, and last a minute, or a step if that is
            longer.
        watched: float64 (bins, rooms), share of each room's cells in view, averaged over the steps
            of the bin; with several robots, that of the robot that saw most of the room.
        seen: int64 (bins, users + 1, rooms), steps of the bin at which each user was perceived in
            each room; the last row counts anybody, recognized or not.
        parts: The same by patches of rooms; None: each room is one patch.

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
    """Return the number of steps of a bin.

    Example:
        >>> steps_of_bin(1_000_000), steps_of_bin(25_000_000), steps_of_bin(300_000_000)
        (60, 2, 1)
    """
    return max(1, BIN_US // step_us)


class SightingRows(NamedTuple):
    """Users that were perceived, in order of time; arrays of one length."""

    step: NDArray[np.int64]
    user: NDArray[np.int64]  # index of the recognized user, below 0 if not recognized
    room: NDArray[np.integer[Any]]  # NOWHERE for none


def gather(
    first: int,
    bin_steps: int,
    patches: Patches,
    cells: NDArray[np.int64],
    sightings: SightingRows,
    users: int,
) -> Evidence:
    """Return the evidence of consecutive bins.

    Args:
        first: First step of the first bin.
        bin_steps: Steps of a bin.
        patches: The patches of the rooms.
        cells: int64 (bins, robots, 2, patches), number of cells of each patch in view of each
            robot: the sum over the steps of the bin, and the maximum.
        sightings: Users that were perceived, with patches in place of rooms.
        users: Number of users.
    """
    count = len(patches.room)
    watched, by_patch, shown, shown_parts = gather_views(
        cells, patches.room, patches.cells, patches.room_cells, bin_steps
    )
    sizes = (first, len(cells), bin_steps, users)
    in_room = sightings._replace(room=patches.room[sightings.room])
    seen = count_seen(sightings, *sizes, count)
    parts = Parts(patches.room, patches.cells, by_patch, shown, seen, shown_parts)
    in_rooms = count_seen(in_room, *sizes, len(patches.first))
    return Evidence(first, bin_steps, watched, in_rooms, parts)


def count_seen(
    sightings: SightingRows, begin: int, bins: int, bin_steps: int, users: int, rooms: int
) -> NDArray[np.int64]:
    """Return Evidence.seen: a user perceived twice at a step in a room counts once.

    With patches in place of rooms it returns Parts.seen.
    """
    seen = np.zeros((bins, users + 1, rooms), np.int64)
    user, room = sightings.user.astype(np.int64), sightings.room.astype(np.int64)
    count_sightings(sightings.step - begin, user, room, bin_steps, seen)
    return seen
