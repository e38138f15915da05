"""Furniture as places: "sofa" is where a body uses the sofa, or stands in front of it."""

from typing import TYPE_CHECKING

from fleet2d.entities.place import ANY, OF, Point, RoomChoice, is_point, parse_place
from fleet2d.errors import PlacementError
from fleet2d.problems import did_you_mean
from fleet2d.streams import Draws

if TYPE_CHECKING:
    from fleet2d.entities.body import Body
    from fleet2d.floorplan.objects import PlacedObject
    from fleet2d.floorplan.plan import Room


def furniture_of(body: "Body", place: RoomChoice | Point) -> "PlacedObject | None":
    """Return the piece of furniture that a place names, if it names one and no room before it.

    Of several of a kind that it can get to, a body uses one for the whole run.
    """
    if is_point(place):
        return None
    rooms = {name for room in body.reachable_rooms() for name in (room.name, room.type)}
    for name in place:
        if name == ANY or name in rooms:
            return None
        pieces = [
            thing
            for thing in body.home.objects
            if name in (thing.name, thing.type) and _gets_to(body, thing)
        ]
        if pieces:
            return Draws(body.stream(f"object of {name}"), 0).choice(pieces)
        if OF in str(name):
            owned = _owned(body, *str(name).split(OF, 1))
            if owned is not None and _gets_to(body, owned):
                return owned
    return None


def _owned(body: "Body", kind: str, person: str) -> "PlacedObject | None":
    """Return the piece of furniture of a kind that a person uses for the whole run.

    Raises:
        PlacementError: There is no such person.
    """
    if person not in body.people:
        raise PlacementError(
            f"there is no user {person!r} who could have a {kind}"
            f"{did_you_mean(person, body.people)}"
        )
    owner = body.people[person]
    if owner is None:  # not built yet; asked again when somebody goes there
        owner = body
    return owner.own_furniture(kind) or furniture_of(owner, (kind,))


def room_of_furniture(body: "Body", place: RoomChoice | Point) -> "list[Room]":
    """Return the room from which the furniture of a place is used; empty if it names none."""
    thing = furniture_of(body, place)
    if thing is None:
        return []
    plan = body.home.plan
    room = plan.room_at(*plan.lattice.to_metres(body.place_at(thing, 0).approach).tolist())
    return [] if room is None else [body.home.rooms[room.index]]


def seat_at(body: "Body", place: object) -> "PlacedObject | None":
    """Return the furniture that a place names, if the body uses furniture; else None."""
    return furniture_of(body, parse_place(place)) if body.entity.uses_furniture else None


def stop_at(body: "Body", place: RoomChoice | Point) -> tuple[int, int]:
    """Return the lattice point at which a body stops for a place.

    For a point, that point; for a room, its middle; for furniture, the point in front of it.

    Raises:
        PlacementError: There is no such place, or it can't be reached.
    """
    if is_point(place):
        return body.point(place)  # type: ignore[arg-type]
    thing = furniture_of(body, place)
    if thing is not None:
        return body.place_at(thing, 0).approach
    return body.middle(body.rooms(place)[0])  # type: ignore[arg-type]


def stops_at(body: "Body", place: RoomChoice | Point) -> list[tuple[int, int]]:
    """Return the lattice points at which a body stops for a place: one per room of its kind."""
    if is_point(place) or furniture_of(body, place) is not None:
        return [stop_at(body, place)]
    return [body.middle(room) for room in body.rooms(place)]  # type: ignore[arg-type]


def _gets_to(body: "Body", thing: "PlacedObject") -> bool:
    """Return whether a body can get to the first place at which a piece of furniture is used."""
    if not thing.uses:
        return False
    x, y = body.place_at(thing, 0).approach
    use = thing.uses[0]
    at = body.home.plan.lattice.point_at(use.approach or (use.x, use.y))
    # Within a metre, if the place itself is too tight: not from another room behind a wall.
    metre = body.home.plan.lattice.units_per_m
    return bool((x - at[0]) ** 2 + (y - at[1]) ** 2 <= metre * metre)
