"""Labels: which room of a home each room label of a log stands for."""

from collections.abc import Collection, Mapping, Sequence

from fleet2d.configuration.problems import suggest
from fleet2d.floorplan.plan import Room
from fleet2d.floorplan.rooms.vocabulary import room_type
from fleet2d.logs.log import AWAY, LogError

RoomChoice = tuple[str, ...]

DOOR = "door"
"""The front door: after a long silence there, the person is out."""

USUAL: dict[str, RoomChoice] = {
    "away": (AWAY,),
    "outsidedoor": (DOOR,),
    "outside_door": (DOOR,),
    "maindoor": (DOOR,),
    "frontdoor": (DOOR,),
    "front_door": (DOOR,),
    "entrance": (DOOR,),
    "livingroom": ("living_room",),
    "living": ("living_room",),
    "lounge": ("living_room",),
    "loungechair": ("living_room",),
    "diningroom": ("dining_room", "kitchen"),
    "dining_room": ("dining_room", "kitchen"),
    "dining": ("dining_room", "kitchen"),
    "workarea": ("office", "living_room"),
    "home_office": ("office", "living_room"),
    "office": ("office", "living_room"),
    "toilet": ("toilet", "bathroom"),
    "bathroom": ("bathroom", "toilet"),
    "hallway": ("hallway", "hall"),
    "hall": ("hall", "hallway"),
    # activities of a log that tells no rooms
    "sleeping": ("bedroom",),
    "toileting": ("bathroom", "toilet"),
    "showering": ("bathroom",),
    "grooming": ("bathroom",),
    "breakfast": ("kitchen",),
    "lunch": ("kitchen",),
    "dinner": ("kitchen",),
    "snack": ("kitchen",),
    "spare_time_tv": ("living_room",),
}
"""Meanings of the labels of known data sets: rooms or kinds of rooms to be tried in turn."""


def map_rooms(
    labels: Mapping[str, int], overrides: Mapping[str, RoomChoice | None], rooms: Sequence[Room]
) -> dict[str, RoomChoice | None]:
    """Return the candidate rooms of each label of a log, best first.

    `("away",)` means absent and `("door",)` the front door; None leaves the readings out.

    Args:
        labels: How many readings each label has.
        overrides: The user's choices for some labels; they take precedence over the usual meaning.
        rooms: The rooms of the home.

    Raises:
        LogError: A label is unknown, or stands for no room of this home.
    """
    _check_overrides(labels, overrides, rooms)
    mapped: dict[str, RoomChoice | None] = {}
    for label, count in labels.items():
        choice = overrides[label] if label in overrides else _usual(label, rooms)
        if choice is None and label not in overrides:
            raise LogError(
                f"no room of this home stands for {label!r} (readings in the log: {count}); choose"
                f" one by rooms: {{{label}: …}}: {', '.join(_names(rooms))}, away, door, or null to"
                " leave these readings out"
            )
        mapped[label] = choice
    return mapped


def _check_overrides(
    labels: Mapping[str, int], overrides: Mapping[str, RoomChoice | None], rooms: Sequence[Room]
) -> None:
    """Refuse labels that are not in the log, and rooms that are not in the home."""
    for label, choice in overrides.items():
        if label not in labels:
            raise LogError(
                f"rooms: the log has no room {label!r}{suggest(label, sorted(labels), 'It has')}"
            )
        if choice is not None and _first_fit(choice, rooms) is None:
            names = _names(rooms)
            raise LogError(
                f"rooms: {label!r} is mapped to {' or '.join(choice)}, but there is no such room"
                f"{suggest(choice[0], names)}, away, door"
            )


def _usual(label: str, rooms: Sequence[Room]) -> RoomChoice | None:
    """Return the usual meaning of a label in this home, if it has one."""
    if any(room.name == label for room in rooms):
        return (label,)
    kind = room_type(label)
    return _first_fit(USUAL.get(kind, (kind,)), rooms)


def _first_fit(choice: RoomChoice, rooms: Sequence[Room]) -> RoomChoice | None:
    """Return the first of some names that is a room, a kind of room, away or door; else None."""
    names = {AWAY, DOOR, "any", *(room.name for room in rooms), *(room.type for room in rooms)}
    return next(((name,) for name in choice if name in names), None)


def _names(rooms: Collection[Room]) -> list[str]:
    return [room.name for room in rooms] + sorted({room.type for room in rooms})
