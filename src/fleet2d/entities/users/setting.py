"""Where and how a body does an activity in its home."""

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
        activity: What.
        rooms: Where; none if it is done out of the home.
        seats: At which furniture; none: anywhere in the rooms.
        stores: Rooms from which it fetches things.
        restless: What moves one, and the law of the time to the next such move [s].
        fetch_takes: How long one is away to fetch something [s].
    """

    activity: Activity
    rooms: list["Room"]
    seats: list[Seat]
    stores: list["Room"]
    restless: tuple[tuple[str, Law], ...]
    fetch_takes: Law


def settle_at(plan: Plan, setting: Setting, place: Spot | Seat) -> None:
    """Go to a place and sit or lie down as the activity wants; on foot, as the furniture does."""
    place.walk(plan)
    if setting.activity.posture != "stand":
        plan.take(setting.activity.posture)
