"""Sighting share: in which rooms somebody was seen, whatever was watched."""

import numpy as np

from fleet2d.algorithms.presence.counts import Bins
from fleet2d.algorithms.presence.estimator import F64, Estimator, normalized
from fleet2d.component import register


@register("presence_estimator", "sighting_share")
class SightingShare(Estimator):
    """Share of a user's sightings per room: n_r / sum of n.

    n_r is the number of steps at which the user was perceived in room r. Away is the share of the
    bins with a view of any room in which the user was not perceived at all: sightings alone can't
    tell who is away from who wasn't found, so that is far too high.

    Right when every room is watched equally. Breaks under feedback: a robot that goes where it saw
    somebody sees somebody there more often (the rich get richer), until all shares are of one room.

    Without any sighting all rooms are alike, and nobody is away until something was watched.
    """

    def width(self, rooms: int) -> int:
        """Return how many numbers `sums` has: of each room, bins watched, not found, and all."""
        return rooms + 3

    def sums(self, bins: Bins) -> F64:
        """Count sightings per room, and bins with a view, with a view but nobody, and all."""
        seen = bins.seen.astype(np.float64)
        found = np.any(bins.seen > 0, axis=2)
        view = np.any(bins.watched > 0, axis=1)[:, np.newaxis] | found
        return np.concatenate(
            [seen, np.stack([view, view & ~found, np.ones_like(found)], axis=-1)], axis=-1
        )

    def shares(self, sums: F64) -> tuple[F64, F64]:
        """Return sightings per room by all, and bins in vain by those with a view."""
        watched = sums[..., -3]
        away = np.where(watched > 0, sums[..., -2] / np.where(watched > 0, watched, 1), 0.0)
        return normalized(sums[..., :-3]), away
