"""Residents: people who do one activity after another, and the places of these in the home."""

import math
from bisect import bisect_right
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence, Set
from contextlib import suppress
from datetime import datetime
from functools import lru_cache, partial
from typing import NamedTuple, TypeVar

import numpy as np

from fleet2d import kernels
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.place import RoomChoice, is_kind, matching_rooms, nearest_room
from fleet2d.entities.plan import Plan, PlanEnd, new_note
from fleet2d.errors import PlacementError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.floorplan.placed_objects import POSTURES, UsePlace
from fleet2d.floorplan.plan import Room
from fleet2d.kernels import ANY_ROOM, NO_GAP_S, CoreVenue, Resident
from fleet2d.routines.activity import NOT_LIVED_IN, Activity, seconds
from fleet2d.routines.distributions import Distribution, exponential
from fleet2d.routines.planner import REST, SLEEP, Episode
from fleet2d.runtime.clock import SECOND_US, Clock, next_midnight
from fleet2d.runtime.determinism import Draws
from fleet2d.runtime.events import EventKind

T = TypeVar("T")

# Bodies of the usual radius of 0.2 m on two spots this far apart don't touch [m].
SPACING = 0.6
# Maximum number of spots of a room that a body uses.
MAX_SPOTS = 8


class Spot(NamedTuple):
    """A place to stand, a lattice point."""

    x: int
    y: int

    def walk(self, plan: "Plan") -> None:
        """Walk to the spot."""
        if plan.away or plan.position != (self.x, self.y):
            plan.go_to_point(self.x, self.y)


class Seat(NamedTuple):
    """A place at a piece of furniture: the furniture's name, and the number of the place."""

    thing: str
    place: int


# Furniture that everybody uses, one after the other.
FIXTURES = frozenset({"toilet", "washbasin", "shower", "bathtub"})


class Spots:
    """The spots of one body.

    The spots of a room are a grid. The members of a household divide them by rank: spot i belongs
    to the member i modulo the number of members. So two members never stand on the same spot, and
    none has to know where the others are. Places at furniture are divided in the same way. In a
    room with fewer spots than members, members share spots.

    Attributes:
        rank: The number of the body among the members of its household.
        members: The number of members.
        apart: Whether a body without a place of its own at furniture uses a spot of the room,
            except in a bathroom. Members of a household take turns instead.
    """

    def __init__(
        self, actor: Actor, rank: int = 0, members: int = 1, *, apart: bool = False
    ) -> None:
        self.rank = rank
        self.members = members
        self.apart = apart
        self._actor = actor
        self._of_room: dict[int, list[Spot]] = {}
        self._at_furniture: dict[Hashable, list[Seat]] = {}
        self._version = -1  # version of the home when the spots were chosen

    def __getstate__(self) -> dict[str, object]:
        """Leave out caches, which are computed again."""
        return {**self.__dict__, "_of_room": {}, "_at_furniture": {}}

    def reachable(self, rooms: list[Room]) -> list[Room]:
        """Return the rooms that the body can reach at present, as doors may be locked."""
        actor = self._actor
        if not actor.home.may_block_routes:
            return rooms
        return [room for room in rooms if len(actor.space.cells(room.index, actor.part))]

    def nearest(self, rooms: list[Room], x: int, y: int) -> Room:
        """Return the room whose middle is nearest to a lattice point, in a straight line."""
        return nearest_room(rooms, self._actor.home.lattice.xy_of(x, y))

    def in_room(self, room: Room) -> list[Spot]:
        """Return the body's habitual spots of a room as it is at present, at least one."""
        self._check_version()
        if room.index not in self._of_room:
            actor = self._actor
            key = "spots", actor.space, actor.part, room.index, self.members
            grid = actor.home.cached(key, lambda: self._grid(room))
            own = part_of(grid, self.rank, self.members)
            draws = Draws(actor.stream(f"spots of {room.name}"), 0)
            self._of_room[room.index] = draws.shuffled(own)[:MAX_SPOTS]
        return self._of_room[room.index]

    def at_furniture(
        self, activity: Activity, rooms: Sequence[Room], share: tuple[int, int] | None = None
    ) -> list[Seat]:
        """Return the body's own places for an activity at the furniture in some rooms.

        Places of the first type that exists are used, and those of the next types as long as there
        are fewer places than bodies that share them.

        Args:
            activity: The activity.
            rooms: The rooms to look in.
            share: Rank of the body, and number of sharing bodies; None: as in its household.
        """
        self._check_version()
        indices = frozenset(room.index for room in rooms)
        kinds = activity.objects
        key = kinds, indices, activity.posture, share, self._actor.part
        if key not in self._at_furniture:
            rank, members = share or (self.rank, self.members)
            seats = seats_at(self._actor.home, activity, indices, members, self._can_reach)
            lacks_own = self.apart and len(seats) <= rank % members
            if not seats or (lacks_own and FIXTURES.isdisjoint(kinds)):
                self._at_furniture[key] = []
            else:
                self._at_furniture[key] = list(part_of(seats, rank, members))
        return self._at_furniture[key]

    def _check_version(self) -> None:
        """Forget the places of an earlier arrangement of doors and furniture."""
        if self._version != self._actor.home.version:
            self._version = self._actor.home.version
            self._of_room.clear()
            self._at_furniture.clear()

    def can_reach(self, seat: Seat) -> bool:
        """Return whether the body can get to a place at furniture at present."""
        thing = self._actor.home.object(seat.thing)
        return self._can_reach(thing.uses[seat.place])

    def _can_reach(self, use: UsePlace) -> bool:
        """Return whether the body can get to a place at furniture, or close enough to use it."""
        return self._actor.space.part_about(use.approach or use.at) == self._actor.part

    def _grid(self, room: Room) -> tuple[Spot, ...]:
        """Return the spots of a room: a grid of cells, a finer one in a small room."""
        actor = self._actor
        lattice = actor.home.lattice
        cells = actor.space.cells(room.index, actor.part)
        pitch = math.ceil(SPACING / lattice.cell)
        while pitch:
            half = pitch // 2
            on_grid = cells[(cells % pitch == half).all(axis=1)]
            if len(on_grid) >= self.members:
                return tuple(Spot(*lattice.cell_centre(*cell)) for cell in on_grid.tolist())
            pitch = half
        return (Spot(*actor.middle(room)),)


def seats_at(
    home: Home,
    activity: Activity,
    indices: Set[int],
    bodies: int,
    can_reach: Callable[[UsePlace], bool] = lambda _: True,
) -> list[Seat]:
    """Return the places for an activity at the furniture in some rooms.

    The activity's types of furniture are tried in turn until there are as many places as bodies. If
    a piece has places for the activity's posture, only those are used.

    Args:
        home: The home.
        activity: The activity.
        indices: The numbers of the rooms.
        bodies: The number of bodies that share the places.
        can_reach: Tells whether a place can be used.
    """
    seats: list[Seat] = []
    for kind in activity.objects:
        for thing in home.objects:
            room = home.room_of(thing) if thing.type == kind else None
            if room is not None and room.index in indices:
                usable = [i for i, use in enumerate(thing.uses) if can_reach(use)]
                fit = [i for i in usable if thing.uses[i].posture == activity.posture]
                seats += [Seat(thing.name, i) for i in fit or usable]
        if len(seats) >= bodies:
            break
    return seats


def part_of(things: Sequence[T], rank: int, members: int) -> Sequence[T]:
    """Return one member's share of things divided among several members; at least one."""
    return things[rank % members :: members] or [things[rank % len(things)]]


# The core numbers ways of choosing rooms, small moves and events in these orders.
POLICIES = tuple(policy.name.lower() for policy in kernels.RoomPolicy)
MOVE_KINDS = tuple(kind.name.lower() for kind in kernels.MoveKind)
EVENTS = tuple(EventKind[event.name] for event in kernels.Happening)


@lru_cache(512)  # most people share them
def exponential_waits(mean_s: int) -> kernels.Waits:
    """Return random times between two moves, of a mean [s]."""
    return kernels.Waits(np.array(exponential(mean_s).knots, np.int64) * SECOND_US)


class Venue(NamedTuple):
    """The places and small moves of a body's activity in its home.

    Attributes:
        activity: The activity.
        rooms: The rooms of the activity; empty if it is done out of the home.
        seats: The places at furniture; empty: anywhere in the rooms.
        stores: The rooms from which the body fetches things.
        small_moves: The small moves within the activity, in the order of MOVE_KINDS: the kind,
            and the mean time between two of each [s].
        fetch_takes: The distribution of the time to fetch something [s], if the body does.
    """

    activity: Activity
    rooms: list[Room]
    seats: list[Seat]
    stores: list[Room]
    small_moves: tuple[tuple[str, int], ...]
    fetch_takes: Distribution | None


Course = tuple[PlanEnd, int, list[tuple[int, int]], list[tuple[int, int, int]]]
"""The end of a plan, its posture, and the postures and notes that were added; see `Resident`."""
Stint = tuple[CoreVenue, int, int, int, bool]
"""A time in which an activity is done; see `Resident.live`."""


class KnownHome:
    """The home as one person knows it.

    The core asks for spots, places at furniture and ways when it needs them, and keeps the answers
    until doors or furniture change.
    """

    def __init__(self, person: "ResidentBehavior", actor: Actor) -> None:
        self._person = person
        self._actor = actor
        self._last = kernels.LastStint()
        # The number of each place and of each activity's name, in the order of their first use.
        self._seats: dict[Seat, int] = {}  # `_last` refers to these numbers
        self._names: dict[str, int] = {}
        self._core_venues: dict[Hashable, CoreVenue] = {}
        self._resident: tuple[object, Resident | None] = None, None

    def __getstate__(self) -> dict[str, object]:
        """Leave out caches, which are computed again."""
        return {**self.__dict__, "_core_venues": {}, "_resident": (None, None)}

    def live(self, plan: Plan, stints: Sequence[Stint], until_us: int, *, continues: bool) -> None:
        """Add activities to a plan, until the last one is over or shut doors block one.

        Args:
            plan: The plan.
            stints: The activities.
            until_us: The time before which all of them begin [us since the start].
            continues: Whether the first one may continue the last one of the plan before.
        """
        live = self.update().live
        walk = partial(self._walk, plan)
        now = _end_of(plan)
        course = live(self, walk, plan.legs, *now, stints, until_us, continues, self._last)
        self._take(plan, course)

    def go(self, plan: Plan, activity: str, venue: Venue, draws: Draws) -> None:
        """Go to where an activity is done, and take its posture."""
        go = self.update().go
        walk = partial(self._walk, plan)
        now = _end_of(plan)
        core_venue = self.in_core(activity, venue)
        self._take(plan, go(self, walk, plan.legs, *now, core_venue, draws))

    def update(self) -> Resident:
        """Forget an earlier arrangement of doors and furniture; return the body for the core."""
        actor = self._actor
        space = actor.space
        rates = (actor.speed, actor.turn_rate)
        present = actor.home.version, space, actor.part, rates
        of, resident = self._resident
        if resident is None or of != present:
            routes = space.shortest if actor.drive is None else None
            steps = ((at, actor.step_off(*at)) for at in actor.home.approaches)
            steps_off = [(*at, *off) for at, off in steps if off is not None]
            resident = Resident(self._person.key, *rates, routes, steps_off)
            self._resident = present, resident
            self._core_venues.clear()
        return resident

    def in_core(self, name: str, venue: Venue) -> CoreVenue:
        """Return the venue of an activity in the form of the core, after an `update`."""
        key: Hashable = name
        if venue is not self._person.venues.get(name):
            rooms = tuple(room.index for room in venue.rooms)
            stores = tuple(room.index for room in venue.stores)
            key = name, rooms, tuple(venue.seats), stores
        if key not in self._core_venues:
            self._core_venues[key] = self._make_core_venue(name, venue)
        return self._core_venues[key]

    def spots(self, room: int) -> Sequence[Spot]:
        """Return the points of a room where the body stands."""
        return self._person.spots.in_room(self._actor.home.rooms[room])

    def seats(self, venue: Venue, room: int) -> list[int]:
        """Return the numbers of the places for an activity at the furniture in a room."""
        rooms = (self._actor.home.rooms[room],)
        return self._numbers_of(self._person.spots.at_furniture(venue.activity, rooms))

    def seat(self, number: int) -> tuple[int, int, int, int, int, int]:
        """Return a place at furniture: x, y, heading, posture, and x, y from where one gets there.

        Raises:
            PlacementError: There is no such furniture now, or no place to use it from.
        """
        at = self._actor.place_at(*list(self._seats)[number])
        return at.x, at.y, at.heading, POSTURES.index(at.posture), *at.approach

    def nearest(self, venue: Venue, x: int, y: int) -> int:
        """Return the room whose middle is nearest to a lattice point, in a straight line."""
        return self._person.spots.nearest(venue.rooms, x, y).index

    def room_at(self, x: int, y: int) -> int:
        """Return the room that holds a lattice point; -1 for none."""
        room = self._actor.home.plan.room_of_point(x, y)
        return -1 if room is None else room.index

    def wait(self, room: int, now_us: int, takes_us: int) -> int | None:
        """Return the time to wait before the body may use a room [us]; None: not now."""
        return self._person.wait_for(room, self._actor.clock, now_us, takes_us)

    def way_out(self) -> LatticePoint:
        """Return the lattice point where the body leaves the home."""
        return self._actor.way_out

    def _make_core_venue(self, name: str, venue: Venue) -> CoreVenue:
        activity = venue.activity
        moves = venue.small_moves
        return CoreVenue(
            venue,
            self._names.setdefault(name, len(self._names)),
            activity.away,
            POLICIES.index(activity.choose),
            POSTURES.index(activity.posture),
            [room.index for room in venue.rooms],
            self._numbers_of(venue.seats),
            [room.index for room in venue.stores],
            [(MOVE_KINDS.index(kind), exponential_waits(mean_s)) for kind, mean_s in moves],
            venue.fetch_takes,
        )

    def _numbers_of(self, seats: Sequence[Seat]) -> list[int]:
        return [self._seats.setdefault(seat, len(self._seats)) for seat in seats]

    def _walk(self, plan: Plan, course: Course, place: tuple[int, int, int]) -> tuple[PlanEnd, int]:
        """Go where no shortest route leads, as plans do: wait, take another way, or raise."""
        self._take(plan, course)
        number, x, y = place
        if number < 0:
            plan.go_to_point(x, y)
        else:
            plan.use(*list(self._seats)[number])
        return _end_of(plan)

    def _take(self, plan: Plan, course: Course) -> None:
        """Let a plan take over the core's additions."""
        end, posture, postures, notes = course
        plan.end = end
        plan.posture = POSTURES[posture]
        plan.postures += postures
        names = list(self._names)
        things = [seat.thing for seat in self._seats]
        details = names, names, things, [""], [""]  # details by event
        plan.notes += [
            new_note((time_us, EVENTS[what], details[what][number]))
            for time_us, what, number in notes
        ]


def _end_of(plan: Plan) -> tuple[PlanEnd, int]:
    return plan.end, POSTURES.index(plan.posture)


# Draws of an episode are addressed by the day's ordinal times this, plus its number. A day has
# fewer episodes than half of it: the core adds the other half for the part of one after midnight.
EPISODES_PER_DAY = 1024

# People whom robots may interrupt at any time plan this far ahead.
AHEAD_US = 1800 * SECOND_US


class ResidentBehavior(Behavior):
    """Base of behaviors that do activities: a subclass implements `day`, the episodes of a day.

    Attributes:
        small_moves: Whether the person turns, gets up and fetches things within an activity.
        own_places: Whether the person keeps to spots and seats of its own, apart from all other
            users with this key; members of a household have such anyway.
    """

    always_decides = True

    small_moves: bool = True
    own_places: bool = False

    def day(self, ordinal: int) -> Sequence[Episode]:
        """Return the episodes of a day, given by its ordinal, until the next begins."""
        raise NotImplementedError

    def wait_for(self, room: int, clock: Clock, begin_us: int, takes_us: int) -> int | None:
        """Return the time to wait before the person may use a room [us]; None: not now."""
        return 0

    def make_spots(self, actor: Actor) -> Spots:
        """Return the spots of a person without a household."""
        if not self.own_places:
            return Spots(actor)
        names = list(actor.people)
        return Spots(actor, names.index(actor.name), len(names), apart=True)

    def settle(
        self,
        actor: Actor,
        activities: dict[str, Activity],
        spots: Spots,
        sleeps_in: int | None = None,
        side: tuple[int, int] = (0, 1),
    ) -> None:
        """Find the venue of each activity in the home.

        Args:
            actor: The body.
            activities: The activities that its days may have, by name.
            spots: The spots of the body.
            sleeps_in: The number of its bedroom, modulo their count; None: drawn once for the run.
            side: Its rank among the people who sleep in its bed, and their number.

        Raises:
            PlacementError: The home has none of an activity's rooms.
        """
        self.key = actor.stream("activity")
        self.clock = actor.clock
        self.spots = spots
        self.known_home = KnownHome(self, actor)
        self.planned_until = -1  # end of the last plan
        self.given_up: tuple[int, int] | None = None  # an episode not to be continued
        self.reachable_rooms = actor.reachable_rooms()
        venues = activities.items()
        self.venues = {name: self._venue(actor, activity) for name, activity in venues}
        for name, venue in self.venues.items():
            if not (venue.rooms or venue.activity.away):  # rest replaces this activity
                rooms = " or ".join(venue.activity.rooms)
                note = f"activities.{name}.rooms: left out, because this home has no {rooms}"
                actor.notes.append(note)
                self.venues[name] = self.venues[REST]
        exclusive = (venue for venue in self.venues.values() if venue.activity.exclusive)
        self.private_rooms = {room.index for venue in exclusive for room in venue.rooms}
        if sleeps_in is not None:
            self.venues[SLEEP] = self._bed(actor, activities[SLEEP], sleeps_in, side)

    def activities(self) -> tuple[str, ...]:
        """Return the names of the persona's activities."""
        return tuple(self.venues)

    def perform(self, plan: Plan, activity: str) -> None:
        """Go to where an activity is done, and take its posture."""
        venue = self._at_present(self.venues[activity])
        if venue.activity.away:
            plan.leave_home()
        elif venue.rooms:
            draws = Draws(self.key, plan.time_us)
            self.known_home.go(plan.come_home(), activity, venue, draws)
        else:
            raise PlacementError(f"{activity} can't be done at present: shut doors are in the way")

    def decide(self, now: Situation) -> Plan:
        """Plan the rest of the date.

        All plans end at midnight: bodies that decide at the same step make fewer spans. People who
        react to robots plan less far ahead, as they are interrupted more often.
        """
        plan = now.plan()
        clock = now.actor.clock
        self.is_hindered = now.home.may_block_routes  # shut doors may hinder the whole plan
        midnight_us = clock.elapsed(next_midnight(now.time))
        last_us = midnight_us
        if now.actor.attention:
            last_us = min(plan.time_us + AHEAD_US, midnight_us)
        self.known_home.update()
        stints = []
        for which, episode in self._episodes(now.time):
            ordinal, _ = which
            if clock.reading(ordinal, episode.begin) >= last_us:
                break
            end_us = min(self._end_us(ordinal, episode), midnight_us)
            stints.append(self._stint(episode, which, end_us))
        self.known_home.live(plan, stints, last_us, continues=now.step == self.planned_until)
        self.planned_until = clock.step_at_or_after(plan.time_us)
        return plan

    def furniture(self, actor: Actor, kind: str) -> str | None:
        """Return the name of a used piece of furniture of a kind, the own bed before others."""
        sleeps = [self.venues[SLEEP]] if SLEEP in self.venues else []
        for venue in (*sleeps, *self.venues.values()):
            for seat in venue.seats:
                if kind in (seat.thing, actor.home.object(seat.thing).type):
                    return seat.thing
        return None

    def give_up(self, now: Situation) -> None:
        """Rest for the remaining time of the present episode, from the next plan on."""
        self.given_up = next(self._episodes(now.time))[0]

    def _episodes(self, time: datetime) -> Iterator[tuple[tuple[int, int], Episode]]:
        """Yield the episodes that are not over at a time.

        Yields:
            The day's ordinal and the number in it, and the episode.
        """
        ordinal = time.toordinal()
        now_us = self.clock.elapsed(time)
        first = self.day(ordinal)[0]
        if now_us < self.clock.reading(ordinal, first.begin):
            ordinal -= 1
        while True:
            day = self.day(ordinal)
            begin = bisect_right(day, now_us, key=partial(self._end_us, ordinal))
            for number in range(begin, len(day)):
                yield (ordinal, number), day[number]
            ordinal += 1

    def _end_us(self, ordinal: int, episode: Episode) -> int:
        """Return the end of an episode of a day [us since the start]."""
        return self.clock.reading(ordinal, episode.end)

    def _stint(self, episode: Episode, which: tuple[int, int], end_us: int) -> Stint:
        """Return an episode in the form of the core; `which` is the address of its random draws."""
        if which == self.given_up:
            episode = episode._replace(activity=REST)
        activity, begin, end, _, room, role = episode
        venue = self.venues[activity]
        if room != ANY_ROOM or self.is_hindered:
            venue = self._in_room(venue, room)
        core_venue = self.known_home.in_core(activity, self.seated(venue, which))
        is_short = end - begin < NO_GAP_S
        stays = activity == REST and is_short and not self.makes_room(which)
        ordinal, number = which
        return core_venue, ordinal * EPISODES_PER_DAY + number, end_us, role, stays

    def seated(self, venue: Venue, which: tuple[int, int]) -> Venue:
        """Return the venue with only the person's places at furniture for the episode."""
        return venue

    def makes_room(self, which: tuple[int, int]) -> bool:
        """Return whether the person leaves the room before a short rest, as others may need it."""
        return False

    def _at_present(self, venue: Venue) -> Venue:
        """Return the venue of an activity, without the rooms that shut doors block at present."""
        rooms = self.spots.reachable(venue.rooms)
        if rooms is venue.rooms:  # no shut door blocks any
            return venue
        if len(rooms) < len(venue.rooms):
            venue = self._within(venue, rooms)
        return venue._replace(stores=self.spots.reachable(venue.stores))

    def _in_room(self, venue: Venue, index: int) -> Venue:
        """Return the present venue of an activity, in a room chosen by the household, if any."""
        if index != ANY_ROOM:
            room = next((room for room in self.reachable_rooms if room.index == index), None)
            venue = venue if room is None else self._within(venue, [room])
        return self._at_present(venue) if self.is_hindered else venue

    def _within(self, venue: Venue, rooms: list[Room]) -> Venue:
        """Return the venue of an activity, in some of its rooms only."""
        seats = self.spots.at_furniture(venue.activity, rooms)
        return venue._replace(rooms=rooms, seats=seats)

    def _venue(self, actor: Actor, activity: Activity) -> Venue:
        if activity.away:
            return Venue(activity, [], [], [], (), None)
        names = activity.rooms
        if activity.choose == "own":
            rooms = self._own_rooms(actor, activity)
        else:
            reachable = self.reachable_rooms
            named = (room for name in names for room in reachable if room.is_called(name))
            rooms = list(dict.fromkeys(named)) or _match(actor, Activity(rooms=names))[1]
        moves = []
        for kind in MOVE_KINDS if self.small_moves else ():
            mean = getattr(activity, kind)
            if mean is not None:
                moves.append((kind, max(1, seconds(mean))))
        seats = self.spots.at_furniture(activity, rooms)
        if not activity.fetches:
            return Venue(activity, rooms, seats, [], tuple(moves), None)
        stores = self._own_rooms(actor, Activity(rooms=activity.fetches_from))
        return Venue(activity, rooms, seats, stores, tuple(moves), activity.fetch_takes.table())

    def _bed(self, actor: Actor, sleep: Activity, sleeps_in: int, side: tuple[int, int]) -> Venue:
        """Return the venue of sleep for a member of a household, maybe in a shared bed."""
        rooms = _match(actor, sleep)[1]
        room = rooms[sleeps_in % len(rooms)]
        seats = self.spots.at_furniture(sleep, [room], side)
        return self._venue(actor, sleep)._replace(rooms=[room], seats=seats)

    @staticmethod
    def _own_rooms(actor: Actor, activity: Activity) -> list[Room]:
        """Return the rooms of the first name that matches; of several of a kind, one for good."""
        name, rooms = _match(actor, activity)
        if name == "any" or not rooms:
            return rooms
        return [Draws(actor.stream(f"room of {name}"), 0).choice(rooms)]


def _match(actor: Actor, activity: Activity) -> tuple[str, list[Room]]:
    try:
        return rooms_for(activity, actor.home, actor.reachable_rooms())
    except PlacementError as error:
        if is_kind(actor, activity.rooms):
            return "", []
        raise PlacementError(f"{actor.path}: {error}") from None


def rooms_for(activity: Activity, home: Home, reachable: list[Room]) -> tuple[str, list[Room]]:
    """Return the first fitting name of an activity's rooms, and all rooms of that name.

    Rooms with furniture for the activity come before others: first named rooms, then any, but not
    for chairs, which also stand at desks in bedrooms.

    Args:
        activity: The activity.
        home: The home.
        reachable: The rooms that the body can get to.

    Raises:
        PlacementError: No name matches a reachable room.
    """
    match = partial(
        matching_rooms, rooms=home.rooms, reachable=reachable, never_in=NOT_LIVED_IN, stands_in=True
    )
    if activity.objects and activity.first == "furniture":
        for name in activity.rooms:
            kinds = set(activity.objects)
            if name == "any":
                kinds.discard("chair")
            things = (thing for thing in home.objects if thing.type in kinds and thing.uses)
            used = {home.room_of(thing) for thing in things}
            with suppress(PlacementError):  # the home has no such room
                furnished = [room for room in match((name,))[1] if room in used]
                if furnished:
                    return name, furnished
    return match(activity.rooms)


def rooms_at(
    episodes: Iterable[Episode], time_s: int, activities: dict[str, Activity]
) -> RoomChoice:
    """Return the rooms of the episode at a time; () if it is out of the home."""
    for episode in episodes:
        if episode.begin <= time_s < episode.end:
            activity = activities[episode.activity]
            return () if activity.away else activity.rooms
    return ("any",)
