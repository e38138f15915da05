"""Inhabitant: what behaviors share that live by activities: where one does them, and how."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

from pydantic import Field

from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.kinds import is_kind
from fleet2d.entities.place import matching_rooms
from fleet2d.entities.plan import Plan
from fleet2d.entities.users.setting import Setting, settle_at
from fleet2d.entities.users.spots import Seat, Spot, Spots
from fleet2d.errors import PlacementError
from fleet2d.kernels.headings import TURN, turn_between
from fleet2d.kernels.random import Bits
from fleet2d.routines.activity import Activity, seconds
from fleet2d.routines.laws import KNOTS, Law, exponential
from fleet2d.routines.planner import NO_GAP_S, PLANNED, REST, RESUMES, SLEEP, Doing
from fleet2d.streams import Draws

if TYPE_CHECKING:
    from fleet2d.clock import Clock
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.place import RoomChoice
    from fleet2d.floorplan.plan import Room

SECOND_US = 1_000_000
# A day has fewer activities than half of that: a draw's address is the day's number times this.
DOINGS_A_DAY = 1024
# What goes on after midnight has draws of its own.
GOING_ON = DOINGS_A_DAY // 2
# Nobody sets out for another spot when what they do is over sooner than that.
NEARLY_OVER_US = 90 * SECOND_US
# Who may be interrupted any time plans what begins within that.
AHEAD_US = 1800 * SECOND_US
# One turns to the side by up to half of two to the power of that: an eighth of a turn.
SIDEWAYS_BITS = 10


@dataclass
class _Last:
    """What was done last.

    Attributes:
        which: The day's ordinal and the number of the doing.
        place: Where.
        base: Where what was interrupted is done.
        step: Up to which step that was planned.
        given_up: What is not to be gone on with.
    """

    which: tuple[int, int] | None = None
    place: Spot | Seat | None = None
    base: Spot | Seat | None = None
    step: int = -1
    given_up: tuple[int, int] | None = None


class Inhabitant(Behavior):
    """Base of behaviors that live by activities: a subclass says what is done on a day."""

    small_moves: bool = Field(
        default=True,
        description="whether it turns, gets up and fetches things within an activity",
    )

    def day(self, ordinal: int) -> Sequence[Doing]:
        """Return what is done on the day of a date's ordinal, from its beginning to the next's."""
        raise NotImplementedError

    def wait_for(self, room: int, clock: "Clock", begin_us: int, takes_us: int) -> int | None:
        """Return how long to wait before one may use a room [us]; None: better not at all."""
        return 0

    def settle(
        self,
        actor: "Actor",
        activities: dict[str, Activity],
        spots: Spots,
        sleeps_in: int | None = None,
        side: tuple[int, int] = (0, 1),
    ) -> None:
        """Find where each activity is done in the home.

        Args:
            actor: The body.
            activities: What it may do, by name.
            spots: Where it can stand.
            sleeps_in: Which of the bedrooms it sleeps in, counted on; None: any one, for good.
            side: Which of how many sleepers of its bed it is.

        Raises:
            PlacementError: The home has none of an activity's rooms.
        """
        self.key = actor.stream("activity")
        self.last = _Last()
        self.clock = actor.clock
        self.spots = spots
        self.own_part = actor.reachable_rooms()
        self.settings = {name: self._setting(actor, a) for name, a in activities.items()}
        self._leave_out(actor)
        exclusive = (s for s in self.settings.values() if s.activity.exclusive)
        self.private_rooms = {room.index for setting in exclusive for room in setting.rooms}
        if sleeps_in is not None:
            self.settings[SLEEP] = self._bed(actor, activities[SLEEP], sleeps_in, side)

    def activities(self) -> tuple[str, ...]:
        """Return the activities of its persona."""
        return tuple(self.settings)

    def perform(self, plan: Plan, activity: str) -> None:
        """Go to where an activity is done, and sit or lie down as one does."""
        setting = self._at_present(self.settings[activity])
        if setting.activity.away:
            plan.leave_home()
        elif setting.rooms:
            self._go(plan.come_home(), setting, Draws(self.key, plan.time_us))
        else:
            raise PlacementError(f"{activity} can't be done at present: shut doors are in the way")

    def _leave_out(self, actor: "Actor") -> None:
        """Rest instead of what this home has no room for, and note it."""
        none = [n for n, s in self.settings.items() if not (s.rooms or s.activity.away)]
        for name in none:
            rooms = " or ".join(self.settings[name].activity.rooms)
            actor.notes.append(f"activities.{name}.rooms: left out, for this home has no {rooms}")
            self.settings[name] = self.settings[REST]

    def decide(self, now: Situation) -> Plan:
        """Plan the rest of the date.

        All plans end at midnight, so that many bodies decide at the same step: the engine then has
        few spans to take. Who reacts to robots plans less far ahead: it may all be for nothing.
        """
        plan, clock = now.plan(), now.actor.clock
        midnight_us = clock.elapsed(datetime.fromordinal(now.time.toordinal() + 1))
        far_us = plan.time_us + AHEAD_US if now.actor.attention else midnight_us
        for ordinal, i, doing in self._doings(now.time):
            day_us = clock.elapsed(datetime.fromordinal(ordinal))
            if (
                plan.time_us >= min(far_us, midnight_us)
                or day_us + doing.begin * SECOND_US >= midnight_us
            ):
                break
            end_us = min(day_us + doing.end * SECOND_US, midnight_us)
            if plan.time_us >= end_us:  # the way to it took longer than it lasts
                continue
            if not self._do(plan, doing, (ordinal, i), end_us):
                break
        self.last.step = clock.step_at_or_after(plan.time_us)
        return plan

    def furniture(self, actor: "Actor", kind: str) -> str | None:
        """Return the name of the furniture of a kind at which it does things; where it sleeps."""
        sleeps = [self.settings[SLEEP]] if SLEEP in self.settings else []
        for setting in (*sleeps, *self.settings.values()):
            for seat in setting.seats:
                if kind in (seat.thing, actor.home.object(seat.thing).type):
                    return seat.thing
        return None

    def give_up(self, now: Situation) -> None:
        """Rest instead of what one is doing, from the next plan on."""
        for ordinal, i, doing in self._doings(now.time):
            day_us = now.actor.clock.elapsed(datetime.fromordinal(ordinal))
            if day_us + doing.end * SECOND_US > now.step * now.actor.clock.step_us:
                self.last.given_up = (ordinal, i)
                return

    def _doings(self, time: datetime) -> Iterator[tuple[int, int, Doing]]:
        """Yield what is done from a time on: the day's ordinal, the number in it, the doing."""
        ordinal = time.toordinal()
        if time < datetime.fromordinal(ordinal) + timedelta(seconds=self.day(ordinal)[0].begin):
            ordinal -= 1
        while True:
            yield from ((ordinal, i, doing) for i, doing in enumerate(self.day(ordinal)))
            ordinal += 1

    def _do(self, plan: Plan, doing: Doing, which: tuple[int, int], end_us: int) -> bool:
        """Do something until `end_us`; which doing it is names its random draws.

        Returns:
            Whether it can be done. Where doors keep one from all of its rooms, the plan ends, for
            they may be open when it is time; if that is now, one stays where one is instead.
        """
        last = self.last
        if which == last.given_up:
            doing = doing._replace(activity=REST)
        setting = self._at_present(self._in_its_room(doing))
        if not (setting.rooms or setting.activity.away):
            if plan.time_us <= plan.began[0] * self.clock.step_us:
                plan.note("way_blocked", doing.activity).stay_until(end_us)
            return False
        goes_on = last.which == which and plan.began[0] == last.step
        number = which[0] * DOINGS_A_DAY + which[1]
        draws = Draws(self.key, number + GOING_ON if goes_on else number)
        if not goes_on:
            last.place = None
            last.base = None if doing.role == PLANNED else last.base
            if setting.activity.away:
                plan.leave_home()
            elif doing.activity != REST or doing.end - doing.begin >= NO_GAP_S:
                if doing.role == RESUMES and last.base is not None:
                    last.place = last.base
                    settle_at(plan, setting, last.base)
                else:
                    last.place = self._go(plan, setting, draws)
                if doing.role == PLANNED:
                    last.base = last.place
            plan.note("activity", doing.activity)
        if last.place is not None and self.small_moves and setting.restless:
            last.place = self._fidget(plan, setting, last.place, end_us, draws)
        last.which = which
        plan.stay_until(end_us)
        return True

    def _at_present(self, setting: Setting) -> Setting:
        """Return where an activity is done while doors keep one from some of its rooms."""
        reached = self.spots.reached(setting.rooms)
        if len(reached) < len(setting.rooms):
            did = setting.activity
            seats = self.spots.at_furniture(did.objects, reached, did.posture)
            setting = setting._replace(rooms=reached, seats=seats)
        return setting._replace(stores=self.spots.reached(setting.stores))

    def _in_its_room(self, doing: Doing) -> Setting:
        """Return where a doing is done, in the room that its household chose for it, if any."""
        setting = self.settings[doing.activity]
        room = next((room for room in self.own_part if room.index == doing.room), None)
        return setting if room is None else self._within(setting, room)

    def _within(self, setting: Setting, room: "Room") -> Setting:
        """Return where an activity is done in a given room."""
        did = setting.activity
        seats = self.spots.at_furniture(did.objects, [room], did.posture)
        return setting._replace(rooms=[room], seats=seats)

    def _go(self, plan: Plan, setting: Setting, draws: Draws) -> Spot | Seat:
        """Go to where the activity is done: a place at its furniture, else a spot in its room."""
        choose = setting.activity.choose
        if choose == "here":
            return self._stay_in_the_room(plan, setting, draws)
        if choose == "nearest" and len(setting.rooms) > 1:
            setting = self._within(setting, self._nearest(plan, setting.rooms))
        room = draws.choice(setting.rooms)
        if choose == "each_time":
            setting = self._within(setting, room)
        place: Spot | Seat = (
            draws.choice(setting.seats) if setting.seats else draws.choice(self.spots.in_room(room))
        )
        settle_at(plan, setting, place)
        return place

    def _stay_in_the_room(self, plan: Plan, setting: Setting, draws: Draws) -> Spot | Seat:
        """Do something in the room where one is: at its furniture, else on the spot."""
        plan.come_home()
        room = self.spots.room_at(plan.x, plan.y)
        seats = [] if room is None else self._within(setting, room).seats
        place = draws.choice(seats) if seats else Spot(plan.x, plan.y)
        settle_at(plan, setting, place)
        return place

    def _nearest(self, plan: Plan, rooms: list["Room"]) -> "Room":
        """Return the room whose middle is nearest, as the crow flies."""
        x, y = self.spots.in_metres(plan.x, plan.y)

        def distance(room: "Room") -> float:
            across, along = room.anchor_xy[0] - x, room.anchor_xy[1] - y
            return across * across + along * along

        return min(rooms, key=distance)

    def _fidget(
        self, plan: Plan, setting: Setting, place: Spot | Seat, end_us: int, draws: Draws
    ) -> Spot | Seat:
        """Turn, move and fetch things at the activity's rates until it is nearly over.

        Returns:
            The place that one ends at.
        """
        bits = Bits(draws)
        next_us = [plan.time_us + _wait_us(law, bits) for _, law in setting.restless]
        facing = plan.heading
        end_us -= NEARLY_OVER_US
        while True:
            k = min(range(len(next_us)), key=next_us.__getitem__)
            if next_us[k] >= end_us:
                return place
            what, law = setting.restless[k]
            plan.stay_until(next_us[k])
            if what == "shifts":
                aside = bits.take(SIDEWAYS_BITS) - (1 << SIDEWAYS_BITS) // 2
                plan.turn_by(turn_between(plan.heading, (facing + aside) % TURN) / TURN)
            elif what == "moves":
                place = self._go_elsewhere(plan, setting, place, draws)
                facing = plan.heading
            else:
                self._fetch(plan, setting, place, end_us, draws)
                facing = plan.heading
            next_us[k] = plan.time_us + _wait_us(law, bits)

    def _go_elsewhere(
        self, plan: Plan, setting: Setting, place: Spot | Seat, draws: Draws
    ) -> Spot | Seat:
        """Go from the furniture to a spot in the room, from there back or to another spot."""
        if setting.seats and isinstance(place, Spot):
            return self._go(plan, setting, draws)
        spot = draws.choice(self.spots.in_room(draws.choice(setting.rooms)))
        spot.walk(plan)
        return spot

    def _fetch(
        self, plan: Plan, setting: Setting, place: Spot | Seat, end_us: int, draws: Draws
    ) -> None:
        """Go to another room, stay a moment, and come back, if there is time and a way."""
        if not setting.stores:
            return
        takes_us = setting.fetch_takes.draw(draws) * SECOND_US
        room = draws.choice(setting.stores)
        spot = draws.choice(self.spots.in_room(room))
        wait_us = self.wait_for(room.index, self.clock, plan.time_us, takes_us)
        if wait_us is not None and plan.time_us + wait_us + takes_us < end_us:
            plan.stay_until(plan.time_us + wait_us)
            spot.walk(plan)
            plan.stay(timedelta(microseconds=takes_us))
            settle_at(plan, setting, place)

    def _setting(self, actor: "Actor", activity: Activity) -> Setting:
        if activity.away:
            return Setting(activity, [], [], [], (), activity.fetch_takes.table())
        rooms = (
            self._own_rooms(actor, activity.rooms)
            if activity.choose == "own"
            else self._all_rooms(actor, activity.rooms)
        )
        restless = [
            (what, exponential(seconds(mean)))
            for what in ("shifts", "moves", "fetches")
            if (mean := getattr(activity, what)) is not None
        ]
        return Setting(
            activity,
            rooms,
            self.spots.at_furniture(activity.objects, rooms, activity.posture),
            self._own_rooms(actor, activity.fetches_from) if activity.fetches else [],
            tuple(restless),
            activity.fetch_takes.table(),
        )

    def _bed(
        self, actor: "Actor", sleep: Activity, sleeps_in: int, side: tuple[int, int]
    ) -> Setting:
        """Return where a member of a household sleeps: beside nobody but its partner."""
        rooms = _match(actor, sleep.rooms)[1]
        room = rooms[sleeps_in % len(rooms)]
        seats = self.spots.at_furniture(sleep.objects, [room], sleep.posture, side)
        return self._setting(actor, sleep)._replace(rooms=[room], seats=seats)

    def _all_rooms(self, actor: "Actor", names: "RoomChoice") -> list["Room"]:
        """Return the rooms of all kinds that a list names and that there are."""
        rooms = [r for name in names for r in self.own_part if name in (r.name, r.type)]
        return list(dict.fromkeys(rooms)) or _match(actor, names)[1]

    def _own_rooms(self, actor: "Actor", names: "RoomChoice") -> list["Room"]:
        """Return the rooms that a list of names stands for: of several of a kind, its own one."""
        name, rooms = _match(actor, names)
        if name == "any" or not rooms:
            return rooms
        return [Draws(actor.stream(f"room of {name}"), 0).choice(rooms)]


def _match(actor: "Actor", names: "RoomChoice") -> tuple[str, list["Room"]]:
    try:
        return matching_rooms(names, actor.home.rooms, actor.reachable_rooms())
    except PlacementError as error:
        if is_kind(actor, names):
            return "", []
        raise PlacementError(f"{actor.path}: {error}") from None


def rooms_at(doings: Iterable[Doing], time_s: int, activities: dict[str, Activity]) -> "RoomChoice":
    """Return the rooms of what is done at a time; () if that is out of the home."""
    for doing in doings:
        if doing.begin <= time_s < doing.end:
            activity = activities[doing.activity]
            return () if activity.away else activity.rooms
    return ("any",)


def _wait_us(law: Law, bits: Bits) -> int:
    """Return one of a law's quantiles [us]: fine enough for when somebody stirs."""
    return law.knots[bits.take(KNOTS.bit_length() - 1)] * SECOND_US
