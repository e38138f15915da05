"""Stays of a person, hidden or seen: a semi-Markov chain over patches of rooms, filtered.

No logarithm, no library's product, and one order of sums: what is learned, and where a robot goes
because of it, is the same on every machine.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d import _core
from fleet2d._core import WHOLE_PATCH, follow

__all__ = ["WHOLE_PATCH", "Moments", "Stretches", "Ways", "follow", "take_together"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]


class Stretches(NamedTuple):
    """Evidence of one user, of which bins that are alike are taken together.

    Attributes:
        bins: int64 (stretches,), how many bins each has.
        hour: int64 (stretches,), of the day.
        shown: uint8 (stretches, patches), what part of each patch was in view, in 1/255; the last
            patch is away, which never is.
        begin: int64 (stretches + 1,), where each stretch's sightings begin in the next two.
        patch: int64 (sightings,), where the user was perceived.
        share: float64 (sightings,), at what share of the steps with a sighting.
    """

    bins: I64
    hour: I64
    shown: U8
    begin: I64
    patch: I64
    share: F64


class Ways(NamedTuple):
    """How a person goes on: in stages of a stay, and from room to room.

    A stage is that of a room, or of away, the last; number room * stages + stage.

    Attributes:
        stay: float64 (stages,), chance to be in the same stage a bin later.
        follow: float64 (stages, rooms + 2), where a person goes after a stage: to each room, away,
            and the next stage of the same; rows sum to one.
        spread: float64 (patches,), chance that a person who comes to a room comes to the patch.
        restless: float64 (rooms + 1,), chance a bin to change patch while staying in a room.
        first: int64 (rooms + 2,), the first patch of each room, that of away, and their number.
        detection: Chance that a person in view is perceived in a bin.
    """

    stay: F64
    follow: F64
    spread: F64
    restless: F64
    first: I64
    detection: float


class Moments(NamedTuple):
    """What is expected of a person's stays, given all evidence.

    Attributes:
        time: float64 (stages,), bins.
        exits: float64 (stages, rooms + 2), how often each is followed by what.
        arrivals: float64 (patches,), how often a person who came, or changed patch, came there.
        moves: float64 (rooms + 1,), changes of patch.
        rests: float64 (rooms + 1,), bins without one.
    """

    time: F64
    exits: F64
    arrivals: F64
    moves: F64
    rests: F64


def take_together(
    minute: I64, shown: U8, seen_bin: I64, patch: I64, steps: I64, longest: int
) -> Stretches:
    """Take together bins in which the same was in view and the user was perceived alike.

    Bins in which the user was perceived in several patches stay by themselves.

    Args:
        minute: (bins,) since midnight; no stretch goes on into another hour.
        shown: (bins, patches), as in Stretches, away left out.
        seen_bin: (sightings,), ascending, the bins in which the user was perceived.
        patch: (sightings,), where, ascending in each bin.
        steps: (sightings,), at how many steps.
        longest: Most bins of a stretch.

    Raises:
        ValueError: The arrays aren't of the same bins and patches.
    """
    return Stretches(*_core.take_together(minute, shown, seen_bin, patch, steps, longest))
