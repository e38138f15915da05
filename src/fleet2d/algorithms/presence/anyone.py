"""The row of anyone, from the probabilities of each user, taken as independent."""

import numpy as np

from fleet2d.algorithms.presence.counts import Bins
from fleet2d.kernels import F64, Bool


def unknown_seen(bins: Bins) -> Bool:
    """Return where somebody was seen who was not recognized as a user: bool (bins, rooms)."""
    unknown = bins.sightings.unknown
    return unknown if bins.sightings.shape[1] > 1 else np.zeros_like(unknown)


def with_anyone(chains: list[F64], unknown: Bool) -> F64:
    """Add the row of anyone to the probabilities of the users' places.

    A room is empty if each user, independently of the others, is somewhere else; it certainly has
    somebody in it where an unknown person was perceived.

    Args:
        chains: Each user's probability of each place, float64 (bins, rooms + 1).
        unknown: bool (bins, rooms), as from `unknown_seen`.

    Returns:
        float64 (bins, users + 1, rooms + 1).
    """
    empty = np.where(unknown, 0.0, 1.0)
    all_away = np.where(unknown.any(axis=1), 0.0, 1.0)
    for places in chains:
        empty = empty * (1 - np.minimum(places[:, :-1], 1))
        all_away = all_away * places[:, -1]
    anyone = np.concatenate([1 - empty, all_away[:, None]], axis=1)
    return np.stack([*chains, anyone], axis=1)
