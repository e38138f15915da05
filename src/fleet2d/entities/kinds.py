"""One rule for what a home lacks: kinds are left out with a note, single things are refused.

A scenario names a kind ("bathroom", "sofa") or one thing ("bathroom_0", a point). A kind that this
home lacks, or that a body can't reach, is left out wherever there is something left to do; the
actor's `notes` say so. One thing that isn't there is refused, by a message that names the key.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING, TypeVar

from fleet2d.entities.place import ANY, Point, RoomChoice, is_point
from fleet2d.errors import PlacementError
from fleet2d.floorplan.furniture.catalogue import FURNITURE
from fleet2d.floorplan.rooms.vocabulary import PRIORITY, usual_type

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.floorplan.plan import Room

P = TypeVar("P", bound=RoomChoice | Point)


def kept_places(actor: "Actor", key: str, places: Iterable[P], *, needed: bool = True) -> list[P]:
    """Return the places that there are, and note which kinds of places there are not.

    Args:
        actor: The body that goes there.
        key: Of the scenario, below the body: "patrol.rooms"; for messages.
        places: Rooms, furniture, kinds of them, lists of those, or points.
        needed: Whether one of them at least has to be there.

    Raises:
        PlacementError: A single thing is not there, or nothing is left.
    """
    kept, missing, last = [], [], None
    for place in places:
        try:
            if not is_point(place):
                actor.rooms(place)  # type: ignore[arg-type]
            kept.append(place)
        except PlacementError as error:
            if not is_kind(actor, place):
                raise PlacementError(f"{key}: {error}") from None
            missing.append(" or ".join(map(str, place)))
            last = error
    if last is not None and not kept and needed:
        raise PlacementError(f"{key}: nothing is left of it in this home: {last}") from None
    if missing:
        actor.notes.append(
            f"{key}: left out, for this home has none to go to: {', '.join(missing)}"
        )
    return kept


def kept_rooms(
    actor: "Actor", key: str, names: Iterable[str], *, needed: bool = True
) -> "list[Room]":
    """Return the rooms that names and kinds of rooms stand for, left out as `kept_places` says."""
    kept = kept_places(actor, key, [(name,) for name in names], needed=needed)
    return list(dict.fromkeys(room for name in kept for room in actor.rooms(name)))


def is_kind(actor: "Actor", place: RoomChoice | Point) -> bool:
    """Tell whether a place names kinds of things, and no single one of this home."""
    if is_point(place):
        return False
    names = {room.name for room in actor.home.rooms} | {t.name for t in actor.home.objects}
    types = {room.type for room in actor.home.rooms} | {t.type for t in actor.home.objects}
    return all(
        name not in names
        and not str(name)[-1:].isdigit()  # bathroom_7 is one bathroom
        and (name in types or name in FURNITURE or usual_type(str(name)) in PRIORITY)
        for name in place
        if name != ANY
    )
