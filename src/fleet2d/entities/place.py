"""Places as a scenario names them: rooms, kinds of rooms, furniture, lists of those, points."""

import difflib
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Annotated, Any

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from fleet2d.errors import PlacementError
from fleet2d.floorplan.objects import PlacedObject
from fleet2d.floorplan.plan import Room
from fleet2d.units import problem

ANY = "any"
# Separates a piece of furniture from its owner: "bed of ana".
OF = " of "

RoomChoice = tuple[str, ...]
Point = tuple[float, float]


def parse_place(value: object) -> RoomChoice | Point:
    """Read a place: ``kitchen``, ``[dining_room, kitchen, any]`` or ``[x, y]`` in metres.

    The furniture of a person, ``{object: bed, of: ana}``, is also written ``bed of ana``.

    Example:
        >>> parse_place("kitchen"), parse_place([1, 2.5])
        (('kitchen',), (1.0, 2.5))
        >>> parse_place({"object": "bed", "of": "ana"})
        ('bed of ana',)
    """
    if isinstance(value, Mapping) and set(value) == {"object", "of"}:
        value = f"{value['object']}{OF}{value['of']}"
    if isinstance(value, str) and value:
        return (value,)
    if isinstance(value, Sequence) and value and not isinstance(value, str):
        if all(isinstance(item, str) and item for item in value):
            return tuple(value)
        if len(value) == 2 and all(map(_is_coordinate, value)):
            return float(value[0]), float(value[1])
    raise problem(
        f"expected a place, got {value!r}: give a room, kind of room or piece of furniture like"
        " 'kitchen' or 'sofa', that of a person like {object: bed, of: ana},"
        " a list of them to try in turn like [dining_room, kitchen, any], or a point [x, y] in"
        " metres"
    )


def _is_coordinate(value: Any) -> bool:
    """Whether a value is a coordinate within 1000 km [m]; NaN is none."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    size: Any = abs(value)
    return bool(size < 1e6)


def _dump(place: RoomChoice | Point) -> str | list[str] | list[float]:
    return place[0] if len(place) == 1 else list(place)  # type: ignore[return-value]


Place = Annotated[
    RoomChoice | Point,
    BeforeValidator(parse_place),
    PlainSerializer(_dump),
    WithJsonSchema(
        {
            "description": "a room, a kind of room, a piece or kind of furniture, a list of those"
            " to try in turn, or [x, y] in metres; 'any' is any room",
            "x-quantity": "place",
            "anyOf": [
                {"type": "string"},
                {"type": "array", "items": {"type": "string"}, "minItems": 1},
                {
                    "type": "object",
                    "properties": {"object": {"type": "string"}, "of": {"type": "string"}},
                    "required": ["object", "of"],
                    "additionalProperties": False,
                },
                {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2},
            ],
            "examples": [
                "kitchen",
                ["dining_room", "kitchen", "any"],
                [4.0, 2.5],
                {"object": "bed", "of": "ana"},
            ],
        }
    ),
]


def is_point(place: RoomChoice | Point) -> bool:
    """Return whether a place is a point."""
    return not isinstance(place[0], str)


def matching_rooms(
    names: RoomChoice,
    rooms: Sequence[Room],
    reachable: Sequence[Room],
    objects: Sequence[PlacedObject] = (),
) -> tuple[str, list[Room]]:
    """Return the first name that matches a reachable room, and all reachable rooms it matches.

    Args:
        names: Rooms and kinds of rooms to try in turn.
        rooms: All rooms of the home.
        reachable: The rooms that the body can get to.
        objects: Furniture, which a place may name as well; only for the message.

    Raises:
        PlacementError: No name matches a reachable room; the message lists the rooms.
    """
    for name in names:
        if name == ANY:
            return ANY, list(reachable)
        matches = [room for room in reachable if name in (room.name, room.type)]
        if matches:
            return name, matches
    requested = " or ".join(repr(name) for name in names)
    room_names = ", ".join(room.name for room in reachable)
    if any(name in (room.name, room.type) for name in names for room in rooms):
        raise PlacementError(
            f"{requested} can't be reached from where it starts; it can reach: {room_names}"
        )
    choices = [room.name for room in rooms] + sorted({room.type for room in rooms})
    choices += [thing.name for thing in objects] + sorted({thing.type for thing in objects})
    close = difflib.get_close_matches(names[0].split(OF)[0], choices, n=1)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    if any(name.split(OF)[0] in (t.name, t.type) for name in names for t in objects):
        raise PlacementError(f"no place from which {requested} is used can be reached")
    raise PlacementError(
        f"there is no room {requested}{hint or '.'} The rooms are: {room_names}."
        f"{_furniture(objects)} A list that ends in 'any' works in every home"
    )


def _furniture(objects: Sequence[PlacedObject]) -> str:
    """Return a sentence that lists the kinds of furniture that are places, for messages."""
    kinds = sorted({thing.type for thing in objects if thing.uses})
    return f" The furniture is: {', '.join(kinds)}." if kinds else ""
