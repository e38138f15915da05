"""Beliefs of robots about where a person is, from the output of an algorithm."""

from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.errors import ComponentError
from fleet2d.kernels import F64

ANYONE = "anyone"


class RoomBelief(NamedTuple):
    """Probabilities of where a person is.

    Attributes:
        share: Probability of each room, given that the person is at home, float64 (rooms,).
        away: Probability that the person is out of the home.
    """

    share: F64
    away: float

    @property
    def joint(self) -> F64:
        """Probability of each room, float64 (rooms,); sums to 1 - away."""
        return self.share * (1 - self.away)


def room_belief(now: Situation, source: str | None, user: str) -> RoomBelief:
    """Return the probabilities of where a person is now.

    The output of a presence algorithm is evaluated at the present time, for the user; any other
    output with a `share` per room holds for everybody. Without a source, and before its first
    output, the probability of a room is proportional to its area.

    Args:
        now: The situation.
        source: The algorithm, by its name in the scenario.
        user: The person, or ANYONE.

    Raises:
        ComponentError: The output has no probabilities of rooms.
    """
    output = now.outputs.get(source) if source else None
    if output is None:
        cells = np.array([room.cells for room in now.home.rooms], np.float64)
        return RoomBelief(cells / cells.sum(), 0.0)
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
            f"the output of {source!r} has no room probabilities: name a presence algorithm, or"
            f" one whose output is a RoomDistribution over the {rooms} rooms"
        )
    return RoomBelief(np.asarray(share, np.float64), float(away))


class BeliefBehavior(Behavior):
    """Base of behaviors that depend on where a person is believed to be.

    Attributes:
        user: The user to look for or to be near, or anyone.
        source: The algorithm with probabilities of where people are; left out: the probability of a
            room is proportional to its area.
    """

    user: str = Field(default=ANYONE, min_length=1)
    source: str | None = None

    def about(self) -> tuple[str, ...]:
        """Return the user that it depends on, if it is one by name."""
        return () if self.user == ANYONE else (self.user,)

    def reads(self) -> tuple[str, ...]:
        """Return the algorithm that it reads."""
        return () if self.source is None else (self.source,)

    def belief(self, now: Situation, user: str) -> RoomBelief:
        """Return the probabilities of where a user is now, by its source."""
        return room_belief(now, self.source, user)
