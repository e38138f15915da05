"""Private rooms: where members of a household do what wants a room to itself."""

from typing import TYPE_CHECKING

from fleet2d.entities.place import ANY
from fleet2d.routines.household import Household, MemberRooms

if TYPE_CHECKING:
    from fleet2d.floorplan.home.home import Home
    from fleet2d.floorplan.plan import Room
    from fleet2d.routines.activity import Activity

# All members must find the same rooms, so they are those that a body of this radius gets to [m].
USUAL_RADIUS = 0.2


def private_rooms(household: Household, home: "Home") -> MemberRooms:
    """Return the rooms of each member's activities that want a room to themselves, by index.

    What is done nowhere but in such rooms, laundry in the bathroom, wants one as well. Where a home
    has none of the rooms that an activity names, it is done in one unknown room.
    """
    space = home.space(USUAL_RADIUS, opens_doors=True)
    reachable = [room for room in home.rooms if len(space.cells(room.index, 0))]
    rooms = {
        name: {
            activity: [room.index for room in _rooms_of(fields, reachable)]
            for activity, fields in persona.used_activities.items()
            if not fields.away
        }
        for name, persona in household.members.items()
    }
    alone = {
        room
        for name, persona in household.members.items()
        for activity in persona.body.private & set(rooms[name])
        for room in rooms[name][activity]
    }
    return {
        name: {activity: some for activity, some in own.items() if some and alone.issuperset(some)}
        for name, own in rooms.items()
    }


def _rooms_of(activity: "Activity", reachable: "list[Room]") -> "list[Room]":
    """Return the rooms of the first kind that there is, or of all kinds where any will do."""
    kinds = [name for name in activity.rooms if name != ANY]
    by_kind = [[room for room in reachable if kind in (room.name, room.type)] for kind in kinds]
    if activity.choose == "own":
        return next((rooms for rooms in by_kind if rooms), [])
    return list(dict.fromkeys(room for rooms in by_kind for room in rooms))
