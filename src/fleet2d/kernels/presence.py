"""Where a person probably is: forecasts, filtering and smoothing of stays, and transport costs.

The stays of a person are a hidden semi-Markov chain over patches of rooms. BLAS and einsum add in
an order that depends on the machine. These loops don't, and use no logarithms, so learned models,
and the decisions of robots that follow from them, are the same everywhere.
"""

from typing import NamedTuple

import numpy as np

# Names that are imported as themselves are part of this module.
# isort: off
from fleet2d._core import (
    TRACE_FEATURES as TRACE_FEATURES,
    advance as advance,
    earth_mover as earth_mover,
    follow as follow,
    follow_people as follow_people,
    gather_views as gather_views,
    list_sightings as list_sightings,
    place_probabilities as place_probabilities,
    resampled as resampled,
    smooth_people as smooth_people,
    sum_places as sum_places,
    trace_evidence as trace_evidence,
    trace_size as trace_size,
)
# isort: on

from fleet2d._core import merge_bins as merge_bin_arrays
from fleet2d.kernels import F64, I64, U8


class Stretches(NamedTuple):
    """Evidence of one user, with runs of identical consecutive bins merged.

    Attributes:
        bins: int64 (stretches,), number of bins of each stretch.
        view: int64 (stretches,), the row of `views`.
        views: uint8 (views, patches), the part of each patch in view, in 1/255; 0 for away, the
            last patch. The stretches of all users share it.
        begin: int64 (stretches + 1,), offsets of each stretch's sightings in `patch` and `share`.
        patch: int64 (sightings,), where the user was perceived.
        share: float64 (sightings,), share of the steps with a sighting.
    """

    bins: I64
    view: I64
    views: U8
    begin: I64
    patch: I64
    share: F64

    @property
    def shown(self) -> U8:
        """The part of each patch in view, in 1/255, by stretch: uint8 (stretches, patches)."""
        return self.views[self.view]


class StayModel(NamedTuple):
    """The transition probabilities of a person: between stages of a stay, and between rooms.

    Each room, and being away, the last one, has the same number of stages of a stay. A node is a
    stage in a room, by number room * stages per room + stage. A patch is a part of a room's floor.

    Attributes:
        stay: float64 (nodes,), probability of remaining in the stage for another bin.
        follow: float64 (nodes, rooms + 2), distribution after a stage: each room, away, and the
            next stage of the same room; rows sum to one.
        spread: float64 (patches,), probability of the patch given that a person comes to its room.
        restless: float64 (rooms + 1,), probability per bin of changing patch during a stay.
        first: int64 (rooms + 2,), the first patch of each room and of away, then the
            number of patches.
        detection: Probability that a person in view is perceived in a bin.
    """

    stay: F64
    follow: F64
    spread: F64
    restless: F64
    first: I64
    detection: float


class Moments(NamedTuple):
    """Expected moments of a person's stays, given all evidence.

    Attributes:
        time: float64 (nodes,), bins spent in the stage.
        exits: float64 (nodes, rooms + 2), transitions to each room, away, and the next stage.
        arrivals: float64 (patches,), arrivals at the patch, from another room or patch.
        moves: float64 (rooms + 1,), changes of patch.
        rests: float64 (rooms + 1,), bins without a change of patch.
    """

    time: F64
    exits: F64
    arrivals: F64
    moves: F64
    rests: F64


def merge_bins(
    minute: I64, view: I64, views: U8, seen: tuple[I64, I64, I64], longest: int
) -> Stretches:
    """Merge consecutive bins with the same view and the same sightings.

    Bins in which the user was perceived in several patches aren't merged.

    Args:
        minute: int64 (bins,), beginning of each bin [minutes since midnight]; no stretch crosses an
            hour.
        view: int64 (bins,), the row of `views`; consecutive bins with the same view have the same.
        views: uint8 (views, patches), as in Stretches.
        seen: Where the user was perceived: the bin of each sighting, int64 (sightings,), ascending;
            the patch, ascending within each bin; and the number of steps with a sighting there.
        longest: Largest number of bins in a stretch.

    Raises:
        ValueError: The arrays have different numbers of bins or sightings.
    """
    bins, view, begin, patch, share = merge_bin_arrays(minute, view, *seen, longest)
    return Stretches(bins, view, views, begin, patch, share)


class PeopleEvidence(NamedTuple):
    """Evidence of consecutive bins of a day.

    Attributes:
        minute: int64 (bins,), beginning of each bin [minutes since midnight].
        view: int64 (bins,), the row of `views`; consecutive bins with the same view have the same.
        views: uint8 (views, patches), as in `fleet2d.kernels.presence.Stretches`.
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


class TracedRooms(NamedTuple):
    """The rooms of a home, as `trace_evidence` takes them.

    Attributes:
        share: float64 (rooms,), the share of each room in the floor of all.
        distance: float64 (rooms, rooms), from middle to middle [10 m].
    """

    share: F64
    distance: F64


class TracedEvidence(NamedTuple):
    """Evidence of one person in consecutive bins.

    Attributes:
        day: int64 (bins,), the day of each bin, as `date.toordinal` counts.
        minute: int64 (bins,), its beginning [minutes since midnight].
        watched: float64 (bins, rooms), the share of the room in view.
        seen: float64 (bins, rooms), the share of the steps at which the person was perceived there.
        unknown: uint8 (bins, rooms), 1 where an unknown person was perceived.
        belief: float64 (bins, rooms + 1), the belief of another model, away last.
    """

    day: I64
    minute: I64
    watched: F64
    seen: F64
    unknown: U8
    belief: F64


class PlaceNetwork(NamedTuple):
    """The weights of a network over the set of places, in which all places share their weights.

    With x the features of a place and z what doesn't change of it, a = max(x first + z, 0), b =
    max(a second + mean(a) context + bias, 0), and the score of the place is b score + x_last; the
    mean is over all places. Probabilities are the softmax of the scores.

    Attributes:
        first: float64 (features, hidden).
        second: float64 (hidden, hidden).
        context: float64 (hidden, hidden).
        bias: float64 (hidden,).
        score: float64 (hidden,).
    """

    first: F64
    second: F64
    context: F64
    bias: F64
    score: F64
