"""Routine: days drawn from a persona, alone or in a household."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from functools import partial
from itertools import islice
from typing import NamedTuple

from fleet2d.configuration.problems import problem, suggest
from fleet2d.configuration.units import micros
from fleet2d.entities.behavior import Actor
from fleet2d.entities.place import ANY, Point, RoomChoice
from fleet2d.entities.users import resident
from fleet2d.entities.users.resident import EPISODES_PER_DAY, ResidentBehavior, Seat, Spots, Venue
from fleet2d.errors import PlacementError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.placed_objects import PlacedObject
from fleet2d.floorplan.plan import Room
from fleet2d.kernels import ANY_ROOM, NO_GAP_S
from fleet2d.routines.activity import Activity, catalogue
from fleet2d.routines.household import AWAY, AnyHousehold, AnyPeriod, Household, with_absences
from fleet2d.routines.life import CACHED_DAYS, WELCOME, Life, Lives, MemberRooms
from fleet2d.routines.persona import AnyPersona, Persona, bundled_persona
from fleet2d.routines.planner import PLANNED, REST, RESUMES, SLEEP, Episode
from fleet2d.runtime.clock import DAY_S, SECOND_US, Clock, midnight_of
from fleet2d.runtime.determinism import Draws, stream_key
from fleet2d.runtime.local_time import written

# Rooms must be the same for all members, so they are computed for this radius [m].
DEFAULT_RADIUS = 0.2


def private_rooms(household: Household, home: Home) -> MemberRooms:
    """Return the rooms of each member's exclusive activities: indices by activity, by member.

    Activities that are done only in such rooms, like laundry in the bathroom, count as exclusive,
    too. If the home has none of the rooms of an activity, the activity has no entry.
    """
    reachable = usual_rooms(home)
    private = set[int]()
    rooms: dict[str, dict[str, list[int]]] = {}
    for member, persona in household.members.items():
        of_member = rooms[member] = {}
        for name, activity in persona.used_activities.items():
            if activity.away:
                continue
            indices = [room.index for room in _rooms_of(activity, home, reachable)]
            if indices:
                of_member[name] = indices
            if name in persona.interruptions.exclusive:
                private.update(indices)
    result = {}
    for member, of_member in rooms.items():
        activities = of_member.items()
        result[member] = {a: indices for a, indices in activities if private.issuperset(indices)}
    return result


def usual_rooms(home: Home) -> list[Room]:
    """Return the rooms that members of a household can get to, the same for all of them."""
    space = home.space(DEFAULT_RADIUS, opens_doors=True, uses_portals=True)
    return [room for room in home.rooms if len(space.cells(room.index, 0))]


def _rooms_of(activity: Activity, home: Home, reachable: list[Room]) -> list[Room]:
    """Return the rooms of the activity's first kind that fits, or of all its kinds.

    All kinds count if the activity may be done in a different room each time.
    """
    if activity.choose == "own":
        try:
            name, rooms = resident.rooms_for(activity, home, reachable)
        except PlacementError:
            return []
        return rooms if name != ANY else []
    kinds = [kind for kind in activity.rooms if kind != ANY]
    found = [room for kind in kinds for room in reachable if room.is_called(kind)]
    return list(dict.fromkeys(found))


# Bodies of the usual radius nearer to each other than this touch [m].
TOUCHING_M = 2 * DEFAULT_RADIUS

Places = Mapping[tuple[int, int], Seat | None]
"""The place of each member's episode, by the numbers of both; None: others have all places."""


class SeatClaim(NamedTuple):
    """A time in which a member wants a place at furniture.

    Attributes:
        is_asleep: Whether the member sleeps there, which takes precedence.
        begin: The beginning [s since the midnight of ordinal 0].
        rank: The number of the member.
        end: The end [s since the midnight of ordinal 0].
        episodes: The numbers of its episodes of the day.
        seats: The possible places, the member's own first.
        own: The number of own places, which are preferred.
    """

    is_asleep: bool
    begin: int
    rank: int
    end: int
    episodes: tuple[int, ...]
    seats: Sequence[Seat]
    own: int

    @property
    def precedence(self) -> tuple[bool, int, int]:
        """The sort key of claims: the first one gets its place."""
        return not self.is_asleep, self.begin, self.rank


class Seating:
    """The places at furniture that members of a household have on each day.

    The member who comes first has a place until the end of the activity, interruptions included;
    later ones get another place of that furniture or of another piece, or else a spot in the room.
    Of members who come at once, the first in the household is first. Sleepers come before all
    others of their day. All members compute the same result from the plans of the household, so
    that none has to know where the others are.
    """

    def __init__(self, actor: Actor, lives: Lives) -> None:
        """Prepare for the members of a household who are in the scenario."""
        self._home = actor.home
        self._lives = lives
        names = list(lives.household.members)
        self._members = {i: name for i, name in enumerate(names) if name in actor.people}
        users = actor.path.rpartition(".")[0]
        self._paths = {i: f"{users}.{name}" for i, name in self._members.items()}
        self._seed = actor.seed
        self._keys = {i: stream_key(self._seed, p, "seat") for i, p in self._paths.items()}
        self._count = len(names)
        self._objects: object = None  # the furniture of the places

    def _restart(self) -> None:
        self._next = self._lives.first
        self._days: dict[int, Places] = {}
        self._taken: dict[Seat, list[tuple[int, int]]] = {}  # times by the first place of a spot
        self._wanted: dict[tuple[int, str], tuple[Sequence[Seat], int]] = {}
        self._spot = _spots(self._home.objects)
        self._reachable = usual_rooms(self._home)

    def places(self, ordinal: int, number: int, rank: int) -> Sequence[Seat] | None:
        """Return the place that a member has for an episode of a day.

        Args:
            ordinal: The ordinal of the day's date.
            number: The number of the episode in the day.
            rank: The number of the member.

        Returns:
            The place; empty if others have all places; None if places aren't shared.
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
        yesterday = (ordinal - 1) * DAY_S
        for spot, times in self._taken.items():
            self._taken[spot] = [(begin, end) for begin, end in times if end > yesterday]
        places: dict[tuple[int, int], Seat | None] = {}
        for claim in sorted(self._claims(ordinal), key=lambda claim: claim.precedence):
            address = ordinal * EPISODES_PER_DAY + claim.episodes[0]
            first = Draws(self._keys[claim.rank], address).below(claim.own)
            seats = (claim.seats[first], *claim.seats[:first], *claim.seats[first + 1 :])
            seat = next((seat for seat in seats if self._is_free(seat, claim)), None)
            for number in claim.episodes:
                places[claim.rank, number] = seat
            if seat is not None:
                times = self._taken.setdefault(self._spot[seat], [])
                times.append((claim.begin, claim.end))
        return places

    def _is_free(self, seat: Seat, claim: SeatClaim) -> bool:
        taken = self._taken.get(self._spot[seat], ())
        return all(end <= claim.begin or begin >= claim.end for begin, end in taken)

    def _claims(self, ordinal: int) -> Iterator[SeatClaim]:
        """Yield the claims of all members on a day."""
        midnight = ordinal * DAY_S
        days = self._lives.day(ordinal)
        for rank, name in self._members.items():
            episodes = days[name]
            for numbers in _stays(episodes, partial(self._lives.is_out, name)):
                first = episodes[numbers[0]]
                seats, own = self._wanted_by(rank, first)
                if seats:
                    begin = midnight + first.begin
                    end = midnight + episodes[numbers[-1]].end
                    is_asleep = first.activity == SLEEP
                    yield SeatClaim(is_asleep, begin, rank, end, tuple(numbers), seats, own)

    def _wanted_by(self, rank: int, episode: Episode) -> tuple[Sequence[Seat], int]:
        """Return the possible places of a member for an episode, and the number of its own."""
        if episode.room != ANY_ROOM:
            return (), 0
        key = rank, episode.activity
        if key not in self._wanted:
            self._wanted[key] = self._find(*key)
        return self._wanted[key]

    def _find(self, rank: int, name: str) -> tuple[Sequence[Seat], int]:
        household = self._lives.household
        member = self._members[rank]
        activity = household.members[member].activity(name)
        is_shared = activity.objects and activity.choose == "own"
        if activity.away or activity.exclusive or not is_shared:
            return (), 0
        bedroom = household.bedrooms()[member] if name == SLEEP else None
        rooms = self._rooms(rank, activity, bedroom)
        share = household.side_of_bed(member) if name == SLEEP else (rank, self._count)
        indices = frozenset(room.index for room in rooms)
        seats = self._seats(activity, indices, self._count)
        shared = self._seats(activity, indices, share[1])
        own = list(resident.part_of(shared, *share)) if seats else []
        return (*own, *(seat for seat in seats if seat not in own)), len(own)

    def _seats(self, activity: Activity, rooms: frozenset[int], wanted: int) -> Sequence[Seat]:
        """Return the places for an activity in some rooms, only the first of those at one spot."""
        seats = resident.seats_at(self._home, activity, rooms, wanted)
        first_at_spot = {self._spot[seat]: seat for seat in reversed(seats)}
        return list(first_at_spot.values())[::-1]

    def _rooms(self, rank: int, activity: Activity, bedroom: int | None) -> Sequence[Room]:
        """Return the rooms that `ResidentBehavior` chooses for a member's activity."""
        try:
            name, rooms = resident.rooms_for(activity, self._home, self._reachable)
        except PlacementError:  # rest replaces the activity
            return ()
        if bedroom is not None:
            return (rooms[bedroom % len(rooms)],)
        if name == ANY:
            return rooms
        key = stream_key(self._seed, self._paths[rank], f"room of {name}")
        return (Draws(key, 0).choice(rooms),)


def _spots(objects: Sequence[PlacedObject]) -> dict[Seat, Seat]:
    """Map each place to the first one at which bodies would touch, as at a table and its chairs."""
    points: dict[Seat, Point] = {}
    spots = {}
    for thing in objects:
        for number, use in enumerate(thing.uses):
            seat = Seat(thing.name, number)
            near = (other for other, at in points.items() if math.dist(use.at, at) < TOUCHING_M)
            spots[seat] = next(near, seat)
            if spots[seat] is seat:
                points[seat] = use.at
    return spots


def _stays(episodes: Sequence[Episode], is_out: Callable[[Episode], bool]) -> list[list[int]]:
    """Return the numbers of the episodes of a day that are done in one place, in groups."""
    groups: list[list[int]] = []
    planned = None
    latest = list[int]()
    for i, episode in enumerate(episodes):
        stays = episode.activity == REST and episode.end - episode.begin < NO_GAP_S
        if episode.role == RESUMES and planned is not None and not stays:
            latest = planned
        elif not stays:
            latest = []
            groups.append(latest)
        if episode.role == PLANNED:
            planned = None if stays or is_out(episode) else latest
        latest.append(i)
    return groups


# The time slot in which one member of a household may go to a private room.
TURN_US = 900 * SECOND_US
# A way there takes less than this.
WAY_US = 60 * SECOND_US


class Routine(ResidentBehavior):
    """Live by a persona: a day's activities with their times, durations, order and probability.

    Every day is drawn independently and satisfies the persona's template. An activity is done at
    its furniture, else in its room; meanwhile the person turns, gets up and fetches things. Members
    of a household have the persona that it gives them, and common appointments.

    Attributes:
        persona: The persona: a bundled name, a YAML file, or a mapping that may extend either; left
            out: works_outside.
        household: The person's household: a mapping or a YAML file, the same for all members.
        away: Holidays, out of the home.
        visits: The times of presence of a visitor, except while its persona is out.
    """

    persona: AnyPersona | None = None
    household: AnyHousehold | None = None
    away: tuple[AnyPeriod, ...] = ()
    visits: tuple[AnyPeriod, ...] = ()

    def model_post_init(self, _: object, /) -> None:
        """Refuse keys that belong in the household of a member."""
        if self.persona is not None and self.household is not None:
            raise problem(
                "a member of a household has the persona that the household gives it: leave out"
                " persona or household"
            )
        if self.household is not None and (self.away or self.visits):
            raise problem(
                "the absences and visits of a member of a household belong in the household's"
                " 'trips' and 'visits', as the other members depend on them"
            )
        if self.household is not None and self.own_places:
            raise problem("members of a household have places of their own: leave out own_places")

    def start(self, actor: Actor) -> None:
        """Set up the days of the person, and find the venues of the activities."""
        self.name = actor.name
        sleeps_in = None
        side = (0, 1)
        if self.household is None:
            spots = self.make_spots(actor)
            self.life = Life(self.resolved_persona, actor.seed, actor.path)
            self._note_strangers(actor)
        else:
            members = list(self.household.members)
            if actor.name not in members:
                raise PlacementError(
                    f"{actor.path}: the household has no member {actor.name!r}"
                    f"{suggest(actor.name, members, 'Its members are')};"
                    " add it there, or leave out `household`"
                )
            self._join_household(actor)
            spots = Spots(actor, members.index(actor.name), len(members))
            sleeps_in = self.household.bedrooms()[actor.name]
            side = self.household.side_of_bed(actor.name)
        actor.speed *= self.resolved_persona.pace
        self.settle(actor, self._activities(), spots, sleeps_in, side)

    def _note_strangers(self, actor: Actor) -> None:
        """Note, once per scenario, that people without a household may share a seat."""
        strangers = (
            name
            for name, body in actor.people.items()
            for behavior in getattr(body, "behaviors", ())
            if body is not actor and isinstance(behavior, Routine) and behavior.household is None
        )
        others = list(islice(strangers, 2))  # two are enough, even of a thousand
        if len(others) == 1 and not self.own_places:
            members = f"{others[0]}: works_outside, {actor.name}: works_outside"
            actor.notes.append(
                f"household: none, and {others[0]} has none either: they may use the same seat or"
                " spot at the same time. People who live together have, in place of a persona,"
                f" household: {{members: {{{members}}}}}; who only shares a home has"
                " own_places: true"
            )

    def _join_household(self, actor: Actor) -> None:
        """Share the days and places of the members, after preparing them for the first member."""
        assert self.household is not None
        others = (actor.people.get(name) for name in self.household.members)
        behaviors = (each for body in others for each in getattr(body, "behaviors", ()))
        for other in behaviors:
            if isinstance(other, Routine) and other.household == self.household:
                self.lives: Lives = other.lives
                self.seating: Seating = other.seating
                return
        first = actor.clock.start.toordinal() - 1
        rooms = private_rooms(self.household, actor.home)
        self.lives = Lives(self.household, actor.seed, first, rooms)
        self.seating = Seating(actor, self.lives)

    @property
    def resolved_persona(self) -> Persona:
        """The persona: the own one, or that of the household's member."""
        if self.household is not None:
            members = self.household.members
            return members[getattr(self, "name", next(iter(members)))]
        return self.persona or bundled_persona("works_outside")

    def _activities(self) -> dict[str, Activity]:
        used = {**self.resolved_persona.used_activities, AWAY: catalogue()[AWAY]}
        if self.household is not None:
            joint = self.household.together
            names = [fields.activity or name for name, fields in joint.items()]
            used |= {name: self.resolved_persona.activity(name) for name in (*names, WELCOME)}
        return used

    def begins_at(self, time: datetime) -> RoomChoice | Point | None:
        """Return the rooms of a likely activity at a time."""
        likely_day = Life(self.resolved_persona, 0, "").day
        today = time.toordinal()
        time_s = (written(time) - midnight_of(time)) // timedelta(seconds=1)
        if time_s < likely_day(today)[0].begin:
            today -= 1
            time_s += DAY_S
        day = self._with_absences(likely_day(today), today)
        return resident.rooms_at(day, time_s, self._activities())

    def day(self, ordinal: int) -> Sequence[Episode]:
        """Return the episodes on the day of a date's ordinal."""
        if self.household is None:
            return self._with_absences(self.life.day(ordinal), ordinal)
        return self.lives.day(ordinal)[self.name]

    def wait_for(self, room: int, clock: Clock, begin_us: int, takes_us: int) -> int | None:
        """Return the time to wait before the person may use a room [us]; None: not now.

        Members of a household take turns in private rooms: for short visits, each of them has a
        slot of a quarter of an hour in turn, outside the planned activities of others there.
        """
        if self.household is None or room not in self.private_rooms:
            return 0
        rank = self.spots.rank
        members = self.spots.members
        turn = begin_us // TURN_US
        own_turn = turn + (rank - turn) % members
        begins_us = max(begin_us, own_turn * TURN_US)
        ends_us = begins_us + takes_us + 2 * WAY_US
        if ends_us > (begins_us // TURN_US + 1) * TURN_US:
            begins_us = (begins_us // TURN_US + members) * TURN_US
            ends_us = begins_us + takes_us + 2 * WAY_US
        if ends_us - begins_us > TURN_US:
            return None
        date = clock.start + timedelta(microseconds=begins_us)
        midnight_us = begins_us - micros(written(date) - midnight_of(date))  # present offset
        first = (begins_us - WAY_US - midnight_us) // SECOND_US
        last = -((midnight_us - ends_us) // SECOND_US)  # rounded up
        if self.lives.in_use(date.toordinal(), self.name, room, first, last):
            return None
        return begins_us - begin_us

    def seated(self, venue: Venue, which: tuple[int, int]) -> Venue:
        """Return the venue with the household member's place for the episode."""
        if self.household is None or not venue.seats:
            return venue
        places = self.seating.places(*which, self.spots.rank)
        if places is None or not all(self.spots.can_reach(seat) for seat in places):
            return venue
        return venue._replace(seats=list(places))

    def makes_room(self, which: tuple[int, int]) -> bool:
        """Return whether other members of the household may need the bathroom."""
        ordinal, number = which
        if self.household is None or number == 0:
            return False
        before = self.day(ordinal)[number - 1]
        return self.venues[before.activity].activity.exclusive

    def _with_absences(self, day: Sequence[Episode], ordinal: int) -> Sequence[Episode]:
        if not self.away and not self.visits:
            return day
        visits = self.visits or None
        return with_absences(day, datetime.fromordinal(ordinal), self.away, visits)
