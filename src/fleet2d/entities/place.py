"""Places: rooms, furniture and points as a scenario names them, and the points to stop at.

A scenario names a kind ("bathroom", "sofa") or a single place ("bathroom_1", a point). A kind that
this home lacks, or that the body can't reach, is left out as long as another place remains; the
body's `notes` say so. A single place that is missing is an error that names the key.
"""

import difflib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from numbers import Real
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import numpy as np
import shapely
from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from fleet2d.configuration.problems import did_you_mean, problem
from fleet2d.errors import PlacementError
from fleet2d.floorplan.furniture import FURNITURE
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.floorplan.placed_objects import PlacedObject
from fleet2d.floorplan.plan import Room
from fleet2d.floorplan.rooms.room import LIVING_ROOM, PRIORITY, day_room, usual_type
from fleet2d.kernels import I64, TURN, UNIT, cosine, sine
from fleet2d.runtime.determinism import Draws

if TYPE_CHECKING:
    from fleet2d.entities.body import Body

ANY = "any"
# Separates a piece of furniture from its owner: "bed of ana".
OWNER_SEPARATOR = " of "

RoomChoice = tuple[str, ...]
Point = tuple[float, float]
P = TypeVar("P", bound=RoomChoice | Point)


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
        value = f"{value['object']}{OWNER_SEPARATOR}{value['of']}"
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
    """Return whether a value is a coordinate within 1000 km [m]; NaN is none."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    size: Any = abs(value)
    return bool(size < 1e6)


def _dump(place: RoomChoice | Point) -> str | list[str] | list[float]:
    return place[0] if len(place) == 1 else list(place)  # type: ignore[return-value]


_NAME = {"type": "string"}
_OWNED = {"type": "object", "properties": {"object": _NAME, "of": _NAME}}
_FORMS = [
    _NAME,
    {"type": "array", "items": _NAME, "minItems": 1},
    {**_OWNED, "required": ["object", "of"], "additionalProperties": False},
    {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2},
]
_EXAMPLES = [
    "kitchen",
    ["dining_room", "kitchen", "any"],
    [4.0, 2.5],
    {"object": "bed", "of": "ana"},
]
Place = Annotated[
    RoomChoice | Point,
    BeforeValidator(parse_place),
    PlainSerializer(_dump),
    WithJsonSchema(
        {
            "description": "a room, a kind of room, a piece or kind of furniture, a list of those"
            " to try in turn, or [x, y] in metres; 'any' is any room",
            "x-quantity": "place",
            "anyOf": _FORMS,
            "examples": _EXAMPLES,
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
    never_in: RoomChoice = (),
    stands_in: bool = False,
) -> tuple[str, list[Room]]:
    """Return the first name that matches a reachable room, and all reachable rooms that match.

    Args:
        names: Rooms and kinds of rooms to try in turn.
        rooms: All rooms of the home.
        reachable: The rooms that the body can get to.
        objects: Furniture, which a place may name as well; only for the message.
        never_in: Rooms and kinds of rooms that 'any' leaves out, as long as there are others.
        stands_in: Whether the largest room to spend the day in serves as a missing living room.

    Raises:
        PlacementError: No name matches a reachable room; the message lists the rooms.
    """
    for name in names:
        if name == ANY:
            others = [room for room in reachable if not {room.name, room.type} & {*never_in}]
            return ANY, others or list(reachable)
        matches = [room for room in reachable if room.is_called(name)]
        if stands_in and name == LIVING_ROOM and not matches:
            serving = day_room(rooms)
            matches = [room for room in reachable if room == serving]
        if matches:
            return name, matches
    requested = " or ".join(repr(name) for name in names)
    room_names = ", ".join(room.name for room in reachable)
    if any(room.is_called(name) for name in names for room in rooms):
        raise PlacementError(
            f"{requested} can't be reached from where it starts; it can reach: {room_names}"
        )
    choices = []
    for things in (rooms, objects):
        choices += [thing.name for thing in things]
        choices += sorted({thing.type for thing in things})
    unowned = [name.split(OWNER_SEPARATOR)[0] for name in names]
    close = difflib.get_close_matches(unowned[0], choices, n=1)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    if any(thing.name in unowned or thing.type in unowned for thing in objects):
        raise PlacementError(f"no place from which {requested} is used can be reached")
    kinds = sorted({thing.type for thing in objects if thing.uses})
    furniture = f" The furniture is: {', '.join(kinds)}." if kinds else ""
    raise PlacementError(
        f"there is no room {requested}{hint or '.'} The rooms are: {room_names}."
        f"{furniture} A list that ends in 'any' works in every home"
    )


def furniture_of(body: "Body", place: RoomChoice | Point) -> PlacedObject | None:
    """Return the piece of furniture that a place names, if it names one and no room before it.

    Of several of a kind that it can get to, a body uses one for the whole run.
    """
    if is_point(place):
        return None
    rooms = {word for room in body.reachable_rooms() for word in room.words}
    for name in place:
        if name == ANY or name in rooms:
            return None
        named = (thing for thing in body.home.objects if name in (thing.name, thing.type))
        if pieces := [thing for thing in named if _gets_to(body, thing)]:
            return Draws(body.stream(f"object of {name}"), 0).choice(pieces)
        if OWNER_SEPARATOR in str(name):
            owned = _owned(body, *str(name).split(OWNER_SEPARATOR, 1))
            if owned is not None and _gets_to(body, owned):
                return owned
    return None


def _owned(body: "Body", kind: str, person: str) -> PlacedObject | None:
    """Return the piece of furniture of a kind that a person uses for the whole run.

    Raises:
        PlacementError: There is no such person.
    """
    if person not in body.people:
        raise PlacementError(
            f"there is no user {person!r} who could have a {kind}"
            f"{did_you_mean(person, body.people)}"
        )
    owner = body.people[person] or body  # one not built yet is asked again when somebody goes there
    return owner.own_furniture(kind) or furniture_of(owner, (kind,))


def seat_at(body: "Body", place: object) -> PlacedObject | None:
    """Return the furniture that a place names, if the body uses furniture; else None."""
    return furniture_of(body, parse_place(place)) if body.entity.uses_furniture else None


def stop_at(body: "Body", place: RoomChoice | Point) -> LatticePoint:
    """Return the lattice point at which a body stops for a place.

    For a point, that point; for a room, its middle; for furniture, the point in front of it.

    Raises:
        PlacementError: There is no such place, or it can't be reached.
    """
    return stops_at(body, place)[0]


def stops_at(body: "Body", place: RoomChoice | Point) -> list[LatticePoint]:
    """Return the lattice points at which a body stops for a place: one per room of its kind."""
    if is_point(place):
        return [body.point(place)]  # type: ignore[arg-type]
    thing = furniture_of(body, place)
    if thing is not None:
        return [body.place_at(thing, 0).approach]
    return [body.middle(room) for room in body.rooms(place)]  # type: ignore[arg-type]


def _gets_to(body: "Body", thing: PlacedObject) -> bool:
    """Return whether a body can get to the first place at which a piece of furniture is used."""
    if not thing.uses:
        return False
    x, y = body.place_at(thing, 0).approach
    use = thing.uses[0]
    lattice = body.home.lattice
    at_x, at_y = lattice.point_at(use.approach or use.at)
    # If the place itself is too tight, a point within a metre does, but none behind a wall.
    return (x - at_x) ** 2 + (y - at_y) ** 2 <= lattice.units_per_m**2


def available_places(
    body: "Body", key: str, places: Iterable[P], *, needed: bool = True
) -> list[P]:
    """Return the places that the home has, and note which kinds of places it lacks.

    Args:
        body: The body that goes there.
        key: The key of the scenario, below the body, for messages: "patrol.rooms".
        places: Rooms, furniture, kinds of them, lists of those, or points.
        needed: Whether at least one place has to remain.

    Raises:
        PlacementError: The home lacks a single place, or no place remains.
    """
    available = []
    missing = []
    last_error = None
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
        note = f"{key}: left out, because this home has none that can be reached: {names}"
        body.notes.append(note)
    return available


def available_rooms(
    body: "Body", key: str, names: Iterable[str], *, needed: bool = True
) -> list[Room]:
    """Return the rooms of some names and kinds, as `available_places` does."""
    places = available_places(body, key, [(name,) for name in names], needed=needed)
    return list(dict.fromkeys(room for place in places for room in body.rooms(place)))


def avoided_rooms(body: "Body", key: str, names: tuple[str, ...]) -> frozenset[int]:
    """Return the indices of the rooms, or kinds of rooms, that a behavior stays out of.

    Args:
        body: The robot.
        key: The key of the scenario, for notes about kinds of rooms that the home lacks.
        names: The rooms and kinds of rooms.

    Raises:
        PlacementError: There is no such room.
    """
    passed = frozenset[int]() if body.rules is None else body.rules.no_stops
    avoided = (room.index for room in available_rooms(body, key, names, needed=False))
    return passed.union(avoided)


def lies_in(body: "Body", point: LatticePoint, rooms: frozenset[int]) -> bool:
    """Return whether a lattice point lies in one of some rooms or areas: see `Home.area`."""
    room = body.home.plan.room_of_point(*point) if rooms else None
    if room is not None and room.index in rooms:
        return True
    return any(zone < 0 and body.home.is_in_area(point, zone) for zone in rooms)


def is_kind(body: "Body", place: RoomChoice | Point) -> bool:
    """Whether a place gives a type ('bathroom'), not a particular room or object ('bathroom_1')."""
    if is_point(place):
        return False
    things: tuple[Room | PlacedObject, ...] = (*body.home.rooms, *body.home.objects)
    names = {thing.name for thing in things}
    types = {*FURNITURE, *(thing.type for thing in things)}
    types = types.union(*(room.labels for room in body.home.rooms))
    for name in place:
        is_single = name in names or str(name)[-1:].isdigit()  # bathroom_8 is a single bathroom
        is_type = name in types or usual_type(str(name)) in PRIORITY
        if name != ANY and (is_single or not is_type):
            return False
    return True


def nearest_room(rooms: Iterable[Room], point: Point) -> Room:
    """Return the room whose middle is nearest to a point [m], in a straight line."""

    def squared_distance(room: Room) -> float:
        x, y = room.anchor_xy
        return (x - point[0]) ** 2 + (y - point[1]) ** 2

    return min(rooms, key=squared_distance)


def points_at_distance(
    body: "Body", center: LatticePoint, distance: int, directions: int
) -> Iterator[LatticePoint]:
    """Yield the points at a distance from a point where a body can stand, in the point's room.

    Args:
        body: The body.
        center: The point [lattice].
        distance: The distance [lattice].
        directions: Number of directions that are tried, evenly spaced.
    """
    plan = body.home.plan
    space = body.space
    room = plan.room_of_point(*center)
    for i in range(directions):
        heading = i * TURN // directions
        x = center[0] + distance * cosine(heading) // UNIT
        y = center[1] + distance * sine(heading) // UNIT
        if plan.room_of_point(x, y) == room and space.part_at(x, y) == body.part:
            yield x, y


class Nearest:
    """Centres [lattice] of the free cells that a body can get to, in one room or in all."""

    def __init__(self, body: "Body", room: int | None = None) -> None:
        rows, columns = body.space.cells(room, body.part).T
        xs, ys = body.home.lattice.centre_axes()
        self.centres: I64 = np.stack([xs[columns], ys[rows]], 1)

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree([shapely.Point(x, y) for x, y in self.centres.tolist()])

    def of(self, points: I64) -> I64:
        """Return the centre nearest to each point, int64 (n, 2).

        Of several at the same distance, return that of the lowest row, then of the lowest column.
        """
        if not len(points) or not len(self.centres):
            return np.empty((0, 2), np.int64)
        of_point, centre = self._tree.query_nearest(shapely.points(points), all_matches=True)
        best = np.full(len(points), len(self.centres), np.int64)
        np.minimum.at(best, of_point, centre)
        return self.centres[best]
