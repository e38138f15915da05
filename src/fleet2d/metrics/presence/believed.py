"""What algorithms put out, read as presence by the metrics that measure it."""

from datetime import timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.history import History
from fleet2d.algorithms.output import RoomDistribution
from fleet2d.algorithms.presence.belief import Presence, Track
from fleet2d.errors import ComponentError

if TYPE_CHECKING:
    from fleet2d.algorithms.algorithm import Present

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


def presence_of(name: str, state: "Present") -> Presence | None:
    """Return an algorithm's newest output as presence; None before the first.

    A RoomDistribution is taken as that of every user and of anyone, who are never away.

    Raises:
        ComponentError: It is neither.
    """
    output: Any = state.outputs.get(name)
    if output is None or isinstance(output, Presence):
        return output
    if isinstance(output, RoomDistribution):
        rows = len(state.users) + 1
        home = np.tile(output.share, (rows, 1))
        return Presence(state.users, home, np.zeros(rows), state.time)
    raise ComponentError(
        f"algorithms.{name} put out a {type(output).__name__}; this metric measures presence:"
        " a Presence or a RoomDistribution"
    )


class Belief:
    """What an algorithm believed at the end of each bin of a period.

    That is its track of the bins; of an algorithm without one it is the forecast of its newest
    output before the period.

    Attributes:
        name: The algorithm.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._before: Presence | None = None

    def at(self, history: History, state: "Present", ends: I64) -> tuple[F64, F64] | None:
        """Return shares of rooms (bins, users + 1, rooms) and of away (bins, users + 1).

        Args:
            history: The period.
            state: The present, with the algorithm's newest output.
            ends: The last step of each whole bin of the period.

        Returns:
            None if it has told nothing of these bins.

        Raises:
            ComponentError: It has another period.
        """
        before, presence = self._before, presence_of(self.name, state)
        self._before = presence if presence is not None else before
        if not len(ends):
            return None
        if presence is not None and presence.track is not None:
            return self._tracked(presence.track, history, ends)
        if before is None:
            return None
        times = [state.start + timedelta(seconds=(int(e) + 1) * history.step_s) for e in ends]
        arrays = [before.at(time).arrays for time in times]
        return np.array([home for home, _ in arrays]), np.array([away for _, away in arrays])

    def _tracked(self, track: Track, history: History, ends: I64) -> tuple[F64, F64] | None:
        last = track.begin + len(track.away) * track.bin_steps - 1
        begin = int(ends[0]) + 1 - track.bin_steps
        if last < history.first:  # an old one: it had no whole bin in this period
            return None
        if track.begin != begin or last != ends[-1]:
            raise ComponentError(
                f"algorithms.{self.name} tells of the steps {track.begin} to {last}, but this"
                f" metric's period has the whole bins {begin} to {int(ends[-1])}: give both the"
                " same period"
            )
        return track.home, track.away
