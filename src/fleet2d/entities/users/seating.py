"""Seating: which place at furniture each member of a household has, so that no two share one."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from fleet2d.entities.place import ANY, matching_rooms
from fleet2d.entities.users.private_rooms import USUAL_RADIUS, usual_rooms
from fleet2d.entities.users.spots import Seat, part_of, seats_at
from fleet2d.errors import PlacementError
from fleet2d.routines.household import Lives
from fleet2d.routines.occupancy import ANY_ROOM
from fleet2d.routines.planner import DAY_S, NO_GAP_S, PLANNED, REST, RESUMES, SLEEP, Doing
from fleet2d.streams import Draws, stream_key

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.place import Point
    from fleet2d.floorplan.objects import PlacedObject
    from fleet2d.floorplan.plan import Room
    from fleet2d.routines.activity import Activity

# Bodies of the usual radius that are nearer to each other touch [m].
TOUCHING_M = 2 * USUAL_RADIUS
# The number of days whose places are kept, and of doings of a day that have draws of their own.
CACHED_DAYS, DOINGS_A_DAY = 3, 1024

Places = Mapping[tuple[int, int], Seat | None]
"""The place of each member's doing, by the numbers of both; None: others have all places."""


class SeatClaim(NamedTuple):
    """A time in which a member wants a place at furniture.

    Attributes:
        is_asleep: Whether the member sleeps there, which has precedence.
        begin: Its beginning [s since the midnight of ordinal 0].
        rank: The number of the member.
        end: Its end.
        doings: The numbers of the doings of the day that it is for.
        seats: The places that the member may have, those of its own first.
        own: The number of its own places, one of which it prefers.
    """

    is_asleep: bool
    begin: int
    rank: int
    end: int
    doings: tuple[int, ...]
    seats: Sequence[Seat]
    own: int


class Seating:
    """The places at furniture that members of a household have on each day.

    Who comes first has a place until the end of what they do there, interruptions included; who
    comes later has another place of that furniture or of another piece, or none: then it is done on
    a spot in the room. Of those who come at once, the first member of the household is first.
    Sleepers come before all others of their day. All members compute the same from the plans of the
    household, so that none has to know where the others are.
    """

    def __init__(self, actor: "Actor", lives: Lives) -> None:
        """Prepare for the members of a household who are in the scenario."""
        self._home, self._lives = actor.home, lives
        names = list(lives.household.members)
        self._members = {i: name for i, name in enumerate(names) if name in actor.people}
        users = actor.path.rpartition(".")[0]
        self._paths = {i: f"{users}.{name}" for i, name in self._members.items()}
        self._keys = {i: stream_key(actor.seed, p, "seat") for i, p in self._paths.items()}
        self._seed, self._count = actor.seed, len(names)
        self._objects: object = None  # the furniture that the places are of

    def _restart(self) -> None:
        self._next = self._lives.first
        self._days: dict[int, Places] = {}
        self._taken: dict[Seat, list[tuple[int, int]]] = {}  # by the first place of a spot
        self._wanted: dict[tuple[int, str], tuple[Sequence[Seat], int]] = {}
        self._spot = _spots(self._home.objects)

    def places(self, ordinal: int, number: int, rank: int) -> Sequence[Seat] | None:
        """Return the place that a member has for a doing of a day.

        Args:
            ordinal: The ordinal of the day's date.
            number: The number of the doing in the day.
            rank: The number of the member.

        Returns:
            The place; nothing if others have all places; None if it isn't shared with others.
        """
        if self._objects is not self._home.objects:
            self._objects = self._home.objects
            self._restart()
        if ordinal < self._next and ordinal not in self._days:
            self._restart()
        while self._next <= ordinal:
            self._days.pop(self._next - CACHED_DAYS, None)
            self._days[self._next] = self._divide(self._next)
            self._next += 1
        of_day = self._days[ordinal]
        if (rank, number) not in of_day:
            return None
        seat = of_day[rank, number]
        return () if seat is None else (seat,)

    def _divide(self, ordinal: int) -> Places:
        """Divide the places of a day among the members, in the order in which they come."""
        midnight = ordinal * DAY_S
        self._taken = {
            spot: [time for time in times if time[1] > midnight - DAY_S]
            for spot, times in self._taken.items()
        }
        places: dict[tuple[int, int], Seat | None] = {}
        for claim in sorted(self._claims(ordinal), key=lambda c: (not c.is_asleep, *c[1:3])):
            time = claim.begin, claim.end
            free = (s for s in self._by_preference(claim, ordinal) if self._is_free(s, time))
            seat = next(free, None)
            places |= {(claim.rank, number): seat for number in claim.doings}
            if seat is not None:
                self._taken.setdefault(self._spot[seat], []).append(time)
        return places

    def _is_free(self, seat: Seat, time: tuple[int, int]) -> bool:
        taken = self._taken.get(self._spot[seat], ())
        return all(end <= time[0] or begin >= time[1] for begin, end in taken)

    def _by_preference(self, claim: SeatClaim, ordinal: int) -> Sequence[Seat]:
        address = ordinal * DOINGS_A_DAY + claim.doings[0]
        first = Draws(self._keys[claim.rank], address).below(claim.own)
        return (claim.seats[first], *claim.seats[:first], *claim.seats[first + 1 :])

    def _claims(self, ordinal: int) -> Iterator[SeatClaim]:
        """Yield the claims of all members on a day."""
        midnight, days = ordinal * DAY_S, self._lives.day(ordinal)
        for rank, name in self._members.items():
            doings = days[name]
            for numbers in _stays(doings, partial(self._lives.is_out, name)):
                first = doings[numbers[0]]
                seats, own = self._wanted_by(rank, first)
                if seats:
                    begin, end = midnight + first.begin, midnight + doings[numbers[-1]].end
                    is_asleep = first.activity == SLEEP
                    yield SeatClaim(is_asleep, begin, rank, end, tuple(numbers), seats, own)

    def _wanted_by(self, rank: int, doing: Doing) -> tuple[Sequence[Seat], int]:
        """Return the places that a member may have for a doing, and how many are its own."""
        if doing.room != ANY_ROOM:
            return (), 0
        key = rank, doing.activity
        if key not in self._wanted:
            persona = self._lives.household.members[self._members[rank]]
            self._wanted[key] = self._find(rank, persona.activity(doing.activity), doing.activity)
        return self._wanted[key]

    def _find(self, rank: int, activity: "Activity", name: str) -> tuple[Sequence[Seat], int]:
        is_shared = activity.objects and activity.choose == "own"
        if activity.away or activity.exclusive or not is_shared:
            return (), 0
        household, member = self._lives.household, self._members[rank]
        rooms = self._rooms(
            rank, activity.rooms, household.bedrooms()[member] if name == SLEEP else None
        )
        share = household.side_of_bed(member) if name == SLEEP else (rank, self._count)
        indices = frozenset(room.index for room in rooms)
        seats = self._seats(activity, indices, self._count)
        own = list(part_of(self._seats(activity, indices, share[1]), *share)) if seats else []
        return (*own, *(seat for seat in seats if seat not in own)), len(own)

    def _seats(self, activity: "Activity", rooms: frozenset[int], wanted: int) -> Sequence[Seat]:
        """Return the places for an activity in some rooms, of those at one spot the first."""
        seats = seats_at(self._home, activity.objects, rooms, activity.posture, wanted)
        return list({self._spot[seat]: seat for seat in reversed(seats)}.values())[::-1]

    def _rooms(self, rank: int, names: tuple[str, ...], bedroom: int | None) -> "Sequence[Room]":
        """Return the rooms of an activity, as `Inhabitant` chooses them for this member."""
        try:
            name, rooms = matching_rooms(names, self._home.rooms, usual_rooms(self._home))
        except PlacementError:  # then rest replaces the activity
            return ()
        if bedroom is not None:
            return (rooms[bedroom % len(rooms)],)
        if name == ANY:
            return rooms
        key = stream_key(self._seed, self._paths[rank], f"room of {name}")
        return (Draws(key, 0).choice(rooms),)


def _spots(objects: Sequence["PlacedObject"]) -> dict[Seat, Seat]:
    """Return the first of the places at which bodies would touch, as of a table and its chairs."""
    points: dict[Seat, Point] = {}
    spots = {}
    for seat, use in ((Seat(t.name, i), use) for t in objects for i, use in enumerate(t.uses)):
        at = use.x, use.y
        near = (other for other, point in points.items() if math.dist(at, point) < TOUCHING_M)
        spots[seat] = next(near, seat)
        if spots[seat] is seat:
            points[seat] = at
    return spots


def _stays(doings: Sequence[Doing], is_out: Callable[[Doing], bool]) -> list[list[int]]:
    """Return the numbers of the doings of a day that are done in one place, in groups."""
    groups: list[list[int]] = []
    planned, latest = None, list[int]()
    for i, doing in enumerate(doings):
        stays = doing.activity == REST and doing.end - doing.begin < NO_GAP_S
        if doing.role == RESUMES and planned is not None and not stays:
            latest = planned
        elif not stays:
            latest = []
            groups.append(latest)
        if doing.role == PLANNED:
            planned = None if stays or is_out(doing) else latest
        latest.append(i)
    return groups
