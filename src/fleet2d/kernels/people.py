"""The stays of all people of a run, day by day: `fleet2d.kernels.stays` for many people at once."""

from typing import NamedTuple

import numpy as np

from fleet2d._core import follow_people, smooth_people
from fleet2d.kernels import F64, I64, U8

__all__ = ["PeopleEvidence", "PeoplePlaces", "follow_people", "smooth_people"]


class PeopleEvidence(NamedTuple):
    """Evidence of consecutive bins of a day.

    Attributes:
        minute: int64 (bins,), beginning of each bin [minutes since midnight].
        view: int64 (bins,), the row of `views`; consecutive bins with the same view have the same.
        views: uint8 (views, patches), as in `fleet2d.kernels.stays.Stretches`.
        begin: int64 (people + 1,), offsets of each person's sightings in `bin`, `patch`, `steps`.
        bin: int64 (sightings,), ascending for each person.
        patch: int64 (sightings,), where the person was perceived, ascending within each bin.
        steps: int64 (sightings,), number of steps with a sighting in that bin and patch.
    """

    minute: I64
    view: I64
    views: U8
    begin: I64
    bin: I64
    patch: I64
    steps: I64


class PeoplePlaces(NamedTuple):
    """Where people were in consecutive stretches of bins, those of one person after the other.

    Attributes:
        probability: float64 (stretches, rooms + 1), of each room, and of away.
        bins: int64 (stretches,), number of bins of each stretch.
        begin: int64 (people + 1,), offsets of each person's stretches.
    """

    probability: F64
    bins: I64
    begin: I64

    def by_bin(self, person: int) -> F64:
        """Return the probability of one person's places in each bin: float64 (bins, rooms + 1)."""
        own = slice(self.begin[person], self.begin[person + 1])
        return np.repeat(self.probability[own], self.bins[own], axis=0)
