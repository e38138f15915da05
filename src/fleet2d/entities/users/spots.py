"""Spots: where people are in a room, so that two of a household are never in the same."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from fleet2d.streams import Draws

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.place import Point
    from fleet2d.entities.plan import Plan
    from fleet2d.floorplan.objects import UsePlace
    from fleet2d.floorplan.plan import Room

T = TypeVar("T")

# Between two spots [m]: two bodies of the usual radius of 0.2 m stand clear of each other.
SPACING = 0.6
# Of the spots of a room that are its own, a body has so many that it uses.
HABITUAL = 8


class Spot(NamedTuple):
    """A place to stand: a lattice point."""

    x: int
    y: int

    def walk(self, plan: "Plan") -> None:
        """Go there."""
        if plan.away or (plan.x, plan.y) != (self.x, self.y):
            plan.go_to_point(self.x, self.y)


class Seat(NamedTuple):
    """A place at a piece of furniture: its name, and the number of the place."""

    thing: str
    place: int

    def walk(self, plan: "Plan") -> None:
        """Go there and use it."""
        plan.use(self.thing, self.place)


class Spots:
    """The spots of one body.

    The spots of a room are a grid. The members of a household share them out by their rank: spot i
    is that of member i modulo their number, so two of them never stand on the same, and nobody has
    to know where the others are. So with the places at furniture. Where a room has fewer spots than
    the household has members, they share.

    Attributes:
        rank: Which member of its household the body is.
        members: How many there are.
    """

    def __init__(self, actor: "Actor", rank: int = 0, members: int = 1) -> None:
        self.rank = rank
        self.members = members
        self._actor = actor
        self._of_room: dict[int, list[Spot]] = {}
        self._version = -1  # of the home that the spots were found in

    def reached(self, rooms: list["Room"]) -> list["Room"]:
        """Return the rooms that the body can get to at present: doors may be locked."""
        actor = self._actor
        if not actor.home.hinders:
            return rooms
        return [room for room in rooms if len(actor.space.cells(room.index, actor.part))]

    def in_metres(self, x: int, y: int) -> "Point":
        """Return a lattice point [m]."""
        return self._actor.home.plan.lattice.xy_of(x, y)

    def room_at(self, x: int, y: int) -> "Room | None":
        """Return the room that holds a lattice point."""
        return self._actor.home.plan.room_at(*self.in_metres(x, y))

    def in_room(self, room: "Room") -> list[Spot]:
        """Return the body's habitual spots of a room as it is at present, at least one."""
        if self._version != self._actor.home.version:  # furniture was moved, a door was shut
            self._version = self._actor.home.version
            self._of_room.clear()
        if room.index not in self._of_room:
            space, part = self._actor.space, self._actor.part
            grid = self._actor.home.cached(
                ("spots", space, part, room.index, self.members), lambda: self._grid(room)
            )
            own = _shared(grid, self.rank, self.members)
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

        Of the types given, the first that is there is used, and the next ones as well while it has
        fewer places than there are bodies to share them.

        Args:
            kinds: Types of furniture, to try in turn.
            rooms: Where.
            posture: Of the places of a piece, those for this posture, if it has any.
            share: Which of how many bodies it is that use it; None: as in its household.
        """
        home, indices = self._actor.home, {room.index for room in rooms}
        rank, members = share or (self.rank, self.members)
        seats: list[Seat] = []
        for kind in kinds:
            for thing in (thing for thing in home.objects if thing.type == kind):
                room = home.room_of(thing)
                if room is not None and room.index in indices:
                    usable = [i for i, use in enumerate(thing.uses) if self._gets_to(use)]
                    fit = [i for i in usable if thing.uses[i].posture == posture]
                    seats += [Seat(thing.name, i) for i in fit or usable]
            if len(seats) >= members:
                break
        return list(_shared(seats, rank, members)) if seats else []

    def _gets_to(self, use: "UsePlace") -> bool:
        """Tell whether the body gets to a place at furniture, from nearby if that is too tight."""
        at = (use.x, use.y) if use.approach is None else use.approach
        return self._actor.space.part_about(at) == self._actor.part

    def _grid(self, room: "Room") -> tuple[Spot, ...]:
        """Return the spots of a room: a grid of cells, a tighter one in a small room."""
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


def _shared(things: Sequence[T], rank: int, members: int) -> Sequence[T]:
    """Return the part of one of several who share things, at least one."""
    return things[rank % members :: members] or [things[rank % len(things)]]
