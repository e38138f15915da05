"""Private rooms: where members of a household do activities that they don't share a room for."""

from typing import TYPE_CHECKING

from fleet2d.entities.place import ANY
from fleet2d.routines.household import Household, MemberRooms

if TYPE_CHECKING:
    from fleet2d.floorplan.home.home import Home
    from fleet2d.floorplan.plan import Room
    from fleet2d.routines.activity import Activity

# All members must get the same rooms, whatever their radius: those of a body of this radius [m].
USUAL_RADIUS = 0.2


def private_rooms(household: Household, home: "Home") -> MemberRooms:
    """Return the rooms of each member's exclusive activities: indices by activity, by member.

    Activities that are done only in such rooms, like laundry in the bathroom, count as exclusive,
    too. If the home has none of the rooms of an activity, the activity has no entry.
    """
    reachable = usual_rooms(home)
    rooms = {
        name: {
            activity: [room.index for room in _rooms_of(fields, reachable)]
            for activity, fields in persona.used_activities.items()
            if not fields.away
        }
        for name, persona in household.members.items()
    }
    private = {
        room
        for name, persona in household.members.items()
        for activity in persona.interruptions.private & set(rooms[name])
        for room in rooms[name][activity]
    }
    return {
        name: {
            activity: indices
            for activity, indices in own.items()
            if indices and private.issuperset(indices)
        }
        for name, own in rooms.items()
    }


def usual_rooms(home: "Home") -> "list[Room]":
    """Return the rooms that members of a household can get to, the same for all of them."""
    space = home.space(USUAL_RADIUS, opens_doors=True)
    return [room for room in home.rooms if len(space.cells(room.index, 0))]


def _rooms_of(activity: "Activity", reachable: "list[Room]") -> "list[Room]":
    """Return the rooms of the activity's first kind that exists, or of all its kinds.

    All kinds count if the activity may be done in a different room each time.
    """
    kinds = [name for name in activity.rooms if name != ANY]
    by_kind = [[room for room in reachable if kind in (room.name, room.type)] for kind in kinds]
    if activity.choose == "own":
        return next((rooms for rooms in by_kind if rooms), [])
    return list(dict.fromkeys(room for rooms in by_kind for room in rooms))
