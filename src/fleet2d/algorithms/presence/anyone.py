"""Anyone, from what is believed of each user apart from the others."""

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.presence.counts import Bins

F64 = NDArray[np.float64]


def unknown_seen(bins: Bins) -> NDArray[np.bool_]:
    """Return where somebody was seen who is none of the users: bool (bins, rooms)."""
    users = bins.seen[:, :-1]
    found: NDArray[np.bool_] = bins.seen[:, -1] > users.sum(axis=1)
    return found if users.shape[1] else np.zeros_like(found)


def with_anyone(chains: list[F64], unknown: NDArray[np.bool_]) -> F64:
    """Add the row of anyone to the probabilities of the users' places.

    A room has somebody in it unless each user, apart from the others, is somewhere else, and for
    sure where somebody unknown was perceived.

    Args:
        chains: Each user's probability of each place, float64 (bins, rooms + 1).
        unknown: From `unknown_seen`.

    Returns:
        float64 (bins, users + 1, rooms + 1).
    """
    empty = np.where(unknown, 0.0, 1.0)
    gone = np.where(unknown.any(axis=1), 0.0, 1.0)
    for places in chains:
        empty = empty * (1 - np.minimum(places[:, :-1], 1))
        gone = gone * places[:, -1]
    anyone = np.concatenate([1 - empty, gone[:, None]], axis=1)
    return np.stack([*chains, anyone], axis=1)
