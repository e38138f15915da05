"""Sighting share: the share of sightings in each room, regardless of what was watched."""

import numpy as np

from fleet2d.algorithms.evidence import Evidence
from fleet2d.algorithms.presence.estimator import Estimator, normalized
from fleet2d.configuration.components import register
from fleet2d.kernels import F64


@register("presence_estimator", "sighting_share")
class SightingShare(Estimator):
    """Share of a user's sightings in each room: n_r / sum of n.

    n_r is the number of steps at which the user was perceived in room r. Away is the share of the
    bins with a view of any room in which the user was not perceived at all: sightings alone can't
    distinguish a user who is away from one who wasn't found, so that is far too high.

    It is right when every room is watched equally. It fails under feedback: a robot that goes to
    the rooms where it saw somebody sees somebody there even more often, until one room has all.

    Without any sighting all rooms are equal, and nobody is away until a room was watched.
    """

    def width(self, rooms: int) -> int:
        """Return the number of columns of `sums`: one for each room, and three counts of bins."""
        return rooms + 3

    def sums(self, evidence: Evidence) -> F64:
        """Return sightings per room, then bins: watched, watched without a sighting, and all."""
        seen = evidence.seen.astype(np.float64)
        is_seen = np.any(seen > 0, axis=2)
        has_view = np.any(evidence.watched > 0, axis=1)[:, np.newaxis] | is_seen
        return np.concatenate(
            [seen, np.stack([has_view, has_view & ~is_seen, np.ones_like(is_seen)], axis=-1)],
            axis=-1,
        )

    def shares(self, sums: F64) -> tuple[F64, F64]:
        """Return sightings per room by all, and bins without a sighting by bins with a view."""
        watched = sums[..., -3]
        away = np.where(watched > 0, sums[..., -2] / np.where(watched > 0, watched, 1), 0.0)
        return normalized(sums[..., :-3]), away
