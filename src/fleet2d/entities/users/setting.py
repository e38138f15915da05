"""Settings: where and how a body does an activity in its home."""

from typing import TYPE_CHECKING, NamedTuple

from fleet2d.entities.plan import Plan
from fleet2d.entities.users.spots import Seat, Spot
from fleet2d.routines.activity import Activity
from fleet2d.routines.laws import Law

if TYPE_CHECKING:
    from fleet2d.floorplan.plan import Room


class Setting(NamedTuple):
    """Where and how a body does an activity in its home.

    Attributes:
        activity: The activity.
        rooms: The rooms where it is done; none if it is done out of the home.
        seats: The places at furniture where it is done; none: anywhere in the rooms.
        stores: The rooms from which the body fetches things.
        small_moves: Kinds of moves within the activity ("shifts", "moves" or "fetches"), each with
            the law of the time to the next one [s].
        fetch_takes: The law of how long the body is away to fetch something [s].
    """

    activity: Activity
    rooms: list["Room"]
    seats: list[Seat]
    stores: list["Room"]
    small_moves: tuple[tuple[str, Law], ...]
    fetch_takes: Law


def settle_at(plan: Plan, setting: Setting, place: Spot | Seat) -> None:
    """Go to a place, and take the activity's posture, or else that of the furniture."""
    place.walk(plan)
    if setting.activity.posture != "stand":
        plan.take(setting.activity.posture)
