"""Room types: one spelling for each, and which type a room with several labels has."""

import re

UNKNOWN = "unknown"

# HouseExpo's 25 categories and nothing else need no entry of their own: `room_type` spells them.
# The order decides the type of a room with several labels. It puts first what a household does
# its living in, the special before the general (a child's room is a bedroom), catch-alls last.
PRIORITY = (
    "kitchen",
    "child_room",
    "guest_room",
    "bedroom",
    "living_room",
    "bathroom",
    "dining_room",
    "office",
    "toilet",
    "laundry",
    "gym",
    "garage",
    "boiler_room",
    "wardrobe",
    "storage",
    "entryway",
    "lobby",
    "hallway",
    "hall",
    "balcony",
    "loggia",
    "terrace",
    "passenger_elevator",
    "freight_elevator",
    "aeration",
)
_LAST = ("room", UNKNOWN)


def room_type(label: str) -> str:
    """Return the snake_case room type that a label in a floor plan file means.

    Example:
        >>> room_type("Child_Room"), room_type("Living room"), room_type("Yoga-Studio ")
        ('child_room', 'living_room', 'yoga_studio')
        >>> room_type("  ")
        'unknown'
    """
    words = re.findall(r"[^\W_]+", label.lower())
    return "_".join(words) or UNKNOWN


def leading_type(types: tuple[str, ...]) -> str:
    """Return the type of a room that carries all of `types`.

    A type that is not in the vocabulary comes after those that are; among several of them the
    first given wins.

    Example:
        >>> leading_type(("toilet", "bathroom"))
        'bathroom'
        >>> leading_type(("room", "yoga_studio"))
        'yoga_studio'
    """
    return min(types, key=_rank) if types else UNKNOWN


def _rank(kind: str) -> int:
    if kind in PRIORITY:
        return PRIORITY.index(kind)
    if kind in _LAST:
        return len(PRIORITY) + 1 + _LAST.index(kind)
    return len(PRIORITY)
