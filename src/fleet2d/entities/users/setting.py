"""Settings: where and how a body does an activity in its home."""

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.entities.plan import Plan
from fleet2d.entities.users.spots import Seat, Spot
from fleet2d.floorplan.cache import read_only
from fleet2d.kernels.random import Bits
from fleet2d.routines.activity import Activity
from fleet2d.routines.laws import KNOTS, Law, exponential

if TYPE_CHECKING:
    from fleet2d.floorplan.plan import Room

SECOND_US = 1_000_000
# Bits of the number of a quantile.
WAIT_BITS = KNOTS.bit_length() - 1
# A person turns aside by up to half of two to the power of that: an eighth of a turn.
SIDEWAYS_BITS = 10
# Kinds of moves that all people share.
KINDS_KEPT = 512


class SmallMove(NamedTuple):
    """A kind of move within an activity.

    Attributes:
        kind: "shifts", "moves" or "fetches".
        waits_us: int64 (KNOTS,), quantiles of the time to the next such move [us].
    """

    kind: str
    waits_us: NDArray[np.int64]

    def wait_us(self, bits: Bits) -> int:
        """Draw the time to the next move [us] from its quantiles."""
        return self.waits_us.item(bits.take(WAIT_BITS))


@lru_cache(KINDS_KEPT)
def small_move(kind: str, mean_s: int) -> SmallMove:
    """Return a kind of move of which the next one comes after a mean time [s], at random."""
    return SmallMove(kind, read_only(np.array(exponential(mean_s).knots, np.int64) * SECOND_US))


class Setting(NamedTuple):
    """Where and how a body does an activity in its home.

    Attributes:
        activity: The activity.
        rooms: The rooms where it is done; none if it is done out of the home.
        seats: The places at furniture where it is done; none: anywhere in the rooms.
        stores: The rooms from which the body fetches things.
        small_moves: The small moves within the activity.
        fetch_takes: The law of how long the body is away to fetch something [s].
    """

    activity: Activity
    rooms: list["Room"]
    seats: list[Seat]
    stores: list["Room"]
    small_moves: tuple["SmallMove", ...]
    fetch_takes: Law


def settle_at(plan: Plan, setting: Setting, place: Spot | Seat) -> None:
    """Go to a place, and take the activity's posture, or else that of the furniture."""
    place.walk(plan)
    if setting.activity.posture != "stand":
        plan.take(setting.activity.posture)


def turn_aside(
    plan: Plan, move: SmallMove, bits: Bits, facing: int, next_us: int, until_us: int
) -> int:
    """Turn aside on the spot, at random moments before `until_us`.

    Args:
        plan: The plan of the person.
        move: The times between two turns.
        bits: Draws of sides and times.
        facing: The heading about which the person turns.
        next_us: The moment of the first turn.
        until_us: The moment before which the person turns.

    Returns:
        The moment of the next turn, `until_us` or later.
    """
    now = plan.time_us, plan.x, plan.y, plan.heading, plan.away
    plan.time_us, plan.heading, next_us = plan.legs.turn_aside(
        now, plan.turn_rate, facing, (next_us, until_us), SIDEWAYS_BITS, move.waits_us, bits
    )
    return next_us
