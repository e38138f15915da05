"""Settings: where and how a body does an activity in its home."""

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fleet2d.entities.users.spots import Seat
from fleet2d.kernels.motion import Waits
from fleet2d.routines.activity import Activity
from fleet2d.routines.laws import Law, exponential

if TYPE_CHECKING:
    from fleet2d.floorplan.plan import Room

SECOND_US = 1_000_000
# The kinds of small moves; what comes first is done first of what is due at once.
MOVE_KINDS = ("shifts", "moves", "fetches")
# Times between moves that all people share.
WAITS_KEPT = 512


class SmallMove(NamedTuple):
    """A kind of move within an activity.

    Attributes:
        kind: One of MOVE_KINDS.
        mean_s: The mean time to the next such move [s].
    """

    kind: str
    mean_s: int

    def waits(self) -> Waits:
        """Return the times to the next such move."""
        return _exponential_waits(self.mean_s)


@lru_cache(WAITS_KEPT)
def _exponential_waits(mean_s: int) -> Waits:
    return Waits(np.array(exponential(mean_s).knots, np.int64) * SECOND_US)


class Setting(NamedTuple):
    """Where and how a body does an activity in its home.

    Attributes:
        activity: The activity.
        rooms: The rooms where it is done; none if it is done out of the home.
        seats: The places at furniture where it is done; none: anywhere in the rooms.
        stores: The rooms from which the body fetches things.
        small_moves: The small moves within the activity.
        fetch_takes: The law of how long the body is away to fetch something [s], if it does.
    """

    activity: Activity
    rooms: list["Room"]
    seats: list[Seat]
    stores: list["Room"]
    small_moves: tuple[SmallMove, ...]
    fetch_takes: Law | None
