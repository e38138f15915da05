"""Places that a home lacks: kinds of places are left out with a note, single ones are refused.

A scenario names a kind ("bathroom", "sofa") or a single place ("bathroom_0", a point). A kind that
this home lacks, or that the body can't reach, is left out as long as another place remains; the
body's `notes` say so. A single place that is missing is an error that names the key.
"""

from collections.abc import Iterable
from typing import TypeVar

from fleet2d.entities.body import Body
from fleet2d.entities.place import ANY, Point, RoomChoice, is_point
from fleet2d.errors import PlacementError
from fleet2d.floorplan.furniture.catalogue import FURNITURE
from fleet2d.floorplan.plan import Room
from fleet2d.floorplan.rooms.vocabulary import PRIORITY, usual_type

P = TypeVar("P", bound=RoomChoice | Point)


def available_places(body: Body, key: str, places: Iterable[P], *, needed: bool = True) -> list[P]:
    """Return the places that the home has, and note which kinds of places it lacks.

    Args:
        body: The body that goes there.
        key: The key of the scenario, below the body, for messages: "patrol.rooms".
        places: Rooms, furniture, kinds of them, lists of those, or points.
        needed: Whether at least one place has to remain.

    Raises:
        PlacementError: The home lacks a single place, or no place remains.
    """
    available, missing, last_error = [], [], None
    for place in places:
        try:
            if not is_point(place):
                body.rooms(place)  # type: ignore[arg-type]
            available.append(place)
        except PlacementError as error:
            if not is_kind(body, place):
                raise PlacementError(f"{key}: {error}") from None
            missing.append(" or ".join(map(str, place)))
            last_error = error
    if last_error is not None and not available and needed:
        raise PlacementError(f"{key}: this home has none of these places: {last_error}") from None
    if missing:
        names = ", ".join(missing)
        body.notes.append(
            f"{key}: left out, because this home has none that can be reached: {names}"
        )
    return available


def available_rooms(
    body: Body, key: str, names: Iterable[str], *, needed: bool = True
) -> list[Room]:
    """Return the rooms of some names and kinds, as `available_places` does."""
    places = available_places(body, key, [(name,) for name in names], needed=needed)
    return list(dict.fromkeys(room for place in places for room in body.rooms(place)))


def is_kind(body: Body, place: RoomChoice | Point) -> bool:
    """Whether a place gives a type ('bathroom'), not a particular room or object ('bathroom_0')."""
    if is_point(place):
        return False
    names = {room.name for room in body.home.rooms} | {t.name for t in body.home.objects}
    types = {room.type for room in body.home.rooms} | {t.type for t in body.home.objects}
    return all(
        name not in names
        and not str(name)[-1:].isdigit()  # bathroom_7 is a single bathroom
        and (name in types or name in FURNITURE or usual_type(str(name)) in PRIORITY)
        for name in place
        if name != ANY
    )
