"""What a robot takes for true of where somebody is: the output of an algorithm, or nothing yet."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.entities.behavior import Situation
from fleet2d.errors import ComponentError

ANYONE = "anyone"


class Belief(NamedTuple):
    """Where somebody is.

    Attributes:
        share: float64 (rooms,), probability of each room, given that somebody is at home.
        away: Probability of being out of the home.
    """

    share: NDArray[np.float64]
    away: float

    @property
    def joint(self) -> NDArray[np.float64]:
        """Probability of each room: float64 (rooms,), sums to 1 - away."""
        joint: NDArray[np.float64] = self.share * (1 - self.away)
        return joint


def room_belief(now: Situation, source: str | None, user: str) -> Belief:
    """Return where somebody is likely now.

    What a presence algorithm puts out is asked for the present time and the user; any other
    output with a `share` per room counts for everybody. Without a source, and before its first
    output, all rooms are as likely as they are large.

    Args:
        now: The situation.
        source: The algorithm, by its name in the scenario.
        user: Whom it is about, or ANYONE.

    Raises:
        ComponentError: The output doesn't say in which rooms people are.
    """
    output = now.outputs.get(source) if source else None
    if output is None:
        cells = np.array([room.cells for room in now.home.rooms], np.float64)
        return Belief(cells / cells.sum(), 0.0)
    if callable(getattr(output, "at", None)):
        output = output.at(now.time)
    share: Any = getattr(output, "share", None)
    away: Any = getattr(output, "away", 0.0)
    if callable(share):
        share = share(user)
        away = away(user) if callable(away) else away
    rooms = len(now.home.rooms)
    if share is None or np.shape(share) != (rooms,):
        raise ComponentError(
            f"the output of {source!r} says nothing of where people are: a presence algorithm, or a"
            f" RoomDistribution over the {rooms} rooms, is wanted"
        )
    return Belief(np.asarray(share, np.float64), float(away))
