"""Spots: points in rooms where people stand, distinct for the members of a household."""

import math
from collections.abc import Callable, Hashable, Sequence, Set
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from fleet2d.runtime.determinism import Draws

if TYPE_CHECKING:
    from fleet2d.entities.behavior import Actor
    from fleet2d.entities.place import Point
    from fleet2d.entities.plan import Plan
    from fleet2d.floorplan.home.home import Home
    from fleet2d.floorplan.objects import UsePlace
    from fleet2d.floorplan.plan import Room

T = TypeVar("T")

# Distance between two spots, at which bodies of the usual radius of 0.2 m don't touch [m].
SPACING = 0.6
# The most spots of a room that a body uses.
HABITUAL = 8


class Spot(NamedTuple):
    """A place to stand, a lattice point."""

    x: int
    y: int

    def walk(self, plan: "Plan") -> None:
        """Go there."""
        if plan.away or (plan.x, plan.y) != (self.x, self.y):
            plan.go_to_point(self.x, self.y)


class Seat(NamedTuple):
    """A place at a piece of furniture: the furniture's name, and the number of the place."""

    thing: str
    place: int


class Spots:
    """The spots of one body.

    The spots of a room are a grid. The members of a household divide them by rank: spot i belongs
    to the member i modulo the number of members. So two members never stand on the same spot, and
    none has to know where the others are. Places at furniture are divided likewise. In a room with
    fewer spots than members, members share spots.

    Attributes:
        rank: The number of the body among the members of its household.
        members: The number of members.
    """

    def __init__(self, actor: "Actor", rank: int = 0, members: int = 1) -> None:
        self.rank = rank
        self.members = members
        self._actor = actor
        self._of_room: dict[int, list[Spot]] = {}
        self._at_furniture: dict[Hashable, list[Seat]] = {}
        self._version = -1  # of the home, when the spots were chosen

    def __getstate__(self) -> dict[str, object]:
        """Leave out caches, which are computed again."""
        return {**self.__dict__, "_of_room": {}, "_at_furniture": {}}

    def reachable(self, rooms: list["Room"]) -> list["Room"]:
        """Return those of some rooms that the body can get to at present: doors may be locked."""
        actor = self._actor
        if not actor.home.hinders:
            return rooms
        return [room for room in rooms if len(actor.space.cells(room.index, actor.part))]

    def in_metres(self, x: int, y: int) -> "Point":
        """Return a lattice point [m]."""
        return self._actor.home.plan.lattice.xy_of(x, y)

    def room_at(self, x: int, y: int) -> "Room | None":
        """Return the room that holds a lattice point."""
        return self._actor.home.plan.room_of_point(x, y)

    def nearest(self, rooms: list["Room"], x: int, y: int) -> "Room":
        """Return the room whose middle is nearest to a lattice point, in a straight line."""
        x_m, y_m = self.in_metres(x, y)

        def distance(room: "Room") -> float:
            across, along = room.anchor_xy[0] - x_m, room.anchor_xy[1] - y_m
            return across * across + along * along

        return min(rooms, key=distance)

    def in_room(self, room: "Room") -> list[Spot]:
        """Return the body's habitual spots of a room as it is at present, at least one."""
        self._check_version()
        if room.index not in self._of_room:
            space, part = self._actor.space, self._actor.part
            grid = self._actor.home.cached(
                ("spots", space, part, room.index, self.members), lambda: self._grid(room)
            )
            own = part_of(grid, self.rank, self.members)
            draws = Draws(self._actor.stream(f"spots of {room.name}"), 0)
            self._of_room[room.index] = draws.shuffled(own)[:HABITUAL]
        return self._of_room[room.index]

    def at_furniture(
        self,
        kinds: Sequence[str],
        rooms: Sequence["Room"],
        posture: str,
        share: tuple[int, int] | None = None,
    ) -> list[Seat]:
        """Return the body's own places at the furniture in some rooms.

        Places of the first type that exists are used, and those of the next types as long as there
        are fewer places than bodies that share them.

        Args:
            kinds: Types of furniture, to try in turn.
            rooms: The rooms to look in.
            posture: If a piece has places for this posture, only those of its places are used.
            share: Rank of the body, and number of bodies that share; None: as in its household.
        """
        self._check_version()
        key = (tuple(kinds), *[room.index for room in rooms], posture, share, self._actor.part)
        seats = self._at_furniture.get(key)
        if seats is None:
            indices = frozenset(room.index for room in rooms)
            seats = self._find_seats(kinds, indices, posture, share or (self.rank, self.members))
            self._at_furniture[key] = seats
        return seats

    def _check_version(self) -> None:
        """Forget the places of an earlier arrangement of doors and furniture."""
        if self._version != self._actor.home.version:
            self._version = self._actor.home.version
            self._of_room.clear()
            self._at_furniture.clear()

    def _find_seats(
        self, kinds: Sequence[str], indices: Set[int], posture: str, share: tuple[int, int]
    ) -> list[Seat]:
        rank, members = share
        seats = seats_at(self._actor.home, kinds, indices, posture, members, self._can_reach)
        return list(part_of(seats, rank, members)) if seats else []

    def can_reach(self, seat: Seat) -> bool:
        """Return whether the body can get to a place at furniture at present."""
        return self._can_reach(self._actor.home.object(seat.thing).uses[seat.place])

    def _can_reach(self, use: "UsePlace") -> bool:
        """Return whether the body can get to a place at furniture, or close enough to use it."""
        at = (use.x, use.y) if use.approach is None else use.approach
        return self._actor.space.part_about(at) == self._actor.part

    def _grid(self, room: "Room") -> tuple[Spot, ...]:
        """Return the spots of a room: a grid of cells, a finer one in a small room."""
        actor, lattice = self._actor, self._actor.home.plan.lattice
        cells = actor.space.cells(room.index, actor.part)
        pitch = math.ceil(SPACING / lattice.cell)
        while pitch:
            half = pitch // 2
            on_grid = cells[(cells[:, 0] % pitch == half) & (cells[:, 1] % pitch == half)]
            if len(on_grid) >= self.members:
                return tuple(Spot(*lattice.cell_centre(*cell)) for cell in on_grid.tolist())
            pitch = half
        return (Spot(*actor.middle(room)),)


def seats_at(
    home: "Home",
    kinds: Sequence[str],
    indices: Set[int],
    posture: str,
    bodies: int,
    can_reach: "Callable[[UsePlace], bool] | None" = None,
) -> list[Seat]:
    """Return the places at the furniture in some rooms.

    Args:
        home: The home.
        kinds: Types of furniture, to try in turn until there are `bodies` places.
        indices: The numbers of the rooms.
        posture: If a piece has places for this posture, only those of its places are used.
        bodies: The number of bodies that share the places.
        can_reach: Tells whether a place can be used; None: all can.
    """
    seats: list[Seat] = []
    for kind in kinds:
        for thing in (thing for thing in home.objects if thing.type == kind):
            room = home.room_of(thing)
            if room is not None and room.index in indices:
                usable = [i for i, use in enumerate(thing.uses) if not can_reach or can_reach(use)]
                fit = [i for i in usable if thing.uses[i].posture == posture]
                seats += [Seat(thing.name, i) for i in fit or usable]
        if len(seats) >= bodies:
            break
    return seats


def part_of(things: Sequence[T], rank: int, members: int) -> Sequence[T]:
    """Return the things of one of several members who divide them; at least one."""
    return things[rank % members :: members] or [things[rank % len(things)]]
