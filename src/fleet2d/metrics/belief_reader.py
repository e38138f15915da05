"""Outputs of algorithms as presence, for the metrics that measure it."""

from datetime import timedelta
from typing import Any

import numpy as np

from fleet2d.algorithms.algorithm import Present, RoomDistribution
from fleet2d.algorithms.history import History
from fleet2d.algorithms.presence.belief import BeliefSeries, Presence
from fleet2d.errors import ComponentError
from fleet2d.kernels import F64, I64


def presence_of(name: str, state: Present) -> Presence | None:
    """Return an algorithm's newest output as presence; None before the first.

    A RoomDistribution counts for every user and for anyone, who are never away.

    Raises:
        ComponentError: The output is neither a Presence nor a RoomDistribution.
    """
    output: Any = state.outputs.get(name)
    if output is None or isinstance(output, Presence):
        return output
    if isinstance(output, RoomDistribution):
        rows = len(state.users) + 1
        home = np.tile(output.share, (rows, 1))
        return Presence(state.users, home, np.zeros(rows), state.time)
    raise ComponentError(
        f"algorithms.{name} returned a {type(output).__name__}; this metric measures presence:"
        " a Presence or a RoomDistribution"
    )


class BeliefReader:
    """Reads what an algorithm believed at the end of each bin of a period.

    That is the output's `track`; for an output without one, it is the forecast of the newest output
    before the period.

    Attributes:
        name: Name of the algorithm.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._previous: Presence | None = None

    def at(self, history: History, state: Present, ends: I64) -> tuple[F64, F64] | None:
        """Return shares of rooms (bins, users + 1, rooms) and of away (bins, users + 1).

        Args:
            history: The period.
            state: The present, with the algorithm's newest output.
            ends: The last step of each whole bin of the period.

        Returns:
            None if the algorithm has no output for these bins.

        Raises:
            ComponentError: The algorithm has another period than the metric.
        """
        previous, presence = self._previous, presence_of(self.name, state)
        self._previous = presence if presence is not None else previous
        if not len(ends):
            return None
        if presence is not None and presence.track is not None:
            return self._tracked(presence.track, history, ends)
        if previous is None:
            return None
        times = [state.start + timedelta(seconds=(int(e) + 1) * history.step_s) for e in ends]
        arrays = [previous.at(time).arrays for time in times]
        return np.array([home for home, _ in arrays]), np.array([away for _, away in arrays])

    def _tracked(self, track: BeliefSeries, history: History, ends: I64) -> tuple[F64, F64] | None:
        last = track.begin + len(track.away) * track.bin_steps - 1
        begin = int(ends[0]) + 1 - track.bin_steps
        if last < history.first:  # an output of an earlier period: this one had no whole bin
            return None
        if track.begin != begin or last != ends[-1]:
            raise ComponentError(
                f"the output of algorithms.{self.name} is about the steps {track.begin} to {last},"
                f" but this metric needs steps {begin} to {int(ends[-1])}, the whole bins of its"
                " period: give both the same period"
            )
        return track.home, track.away
