"""Inhabitant: what behaviors share that live by activities: where one does them, and how."""

import math
from collections.abc import Iterable, Sequence
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pydantic import Field

from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.place import matching_rooms
from fleet2d.entities.plan import Plan
from fleet2d.entities.users.spots import Seat, Spot, Spots
from fleet2d.errors import PlacementError
from fleet2d.kernels.headings import TURN
from fleet2d.routines.activity import Activity, seconds
from fleet2d.routines.laws import KNOTS, Law, exponential
from fleet2d.routines.planner import SLEEP, Doing
from fleet2d.streams import Draws

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.place import RoomChoice
    from fleet2d.floorplan.plan import Room

SECOND_US = 1_000_000
# A day has fewer activities than that: a draw's address is the day's number times this.
DOINGS_A_DAY = 1024
# Nobody sets out for another spot when what they do is over sooner than that.
NEARLY_OVER_US = 90 * SECOND_US
# How far one turns from side to side, at most.
SIDEWAYS = TURN // 8


class Setting(NamedTuple):
    """Where and how a body does an activity in its home.

    Attributes:
        activity: What.
        rooms: Where; none if it is done out of the home.
        seats: At which furniture; none: anywhere in the rooms.
        stores: Rooms from which it fetches things.
        restless: What moves one, and the law of the time to the next such move [s].
        fetch_takes: How long one is away to fetch something [s].
    """

    activity: Activity
    rooms: list["Room"]
    seats: list[Seat]
    stores: list["Room"]
    restless: tuple[tuple[str, Law], ...]
    fetch_takes: Law


class Inhabitant(Behavior):
    """Base of behaviors that live by activities: a subclass says what is done on a day."""

    small_moves: bool = Field(
        default=True,
        description="whether it turns, gets up and fetches things within an activity",
    )

    def day(self, ordinal: int) -> Sequence[Doing]:
        """Return what is done on the day of a date's ordinal, from its beginning to the next's."""
        raise NotImplementedError

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
        self.turn_rate = actor.turn_rate
        self.spots = spots
        self.settings = {name: self._setting(actor, a) for name, a in activities.items()}
        if sleeps_in is not None:
            self.settings[SLEEP] = self._bed(actor, activities[SLEEP], sleeps_in, side)

    def decide(self, now: Situation) -> Plan:
        """Plan the rest of the day."""
        ordinal = now.time.toordinal()
        midnight = datetime.fromordinal(ordinal)
        if (now.time - midnight) < timedelta(seconds=self.day(ordinal)[0].begin):
            ordinal -= 1
        midnight_us = now.actor.clock.elapsed(datetime.fromordinal(ordinal))
        plan = now.plan()
        for i, doing in enumerate(self.day(ordinal)):
            end_us = midnight_us + doing.end * SECOND_US
            if plan.time_us < end_us:  # else the way to it took longer than it lasts
                draws = Draws(self.key, ordinal * DOINGS_A_DAY + i)
                self._do(plan, doing.activity, end_us, draws)
        return plan

    def _do(self, plan: Plan, name: str, end_us: int, draws: Draws) -> None:
        setting = self.settings[name]
        if setting.activity.away:
            plan.leave_home().note("activity", name)
        else:
            place = self._go(plan, setting, draws)
            plan.note("activity", name)
            if self.small_moves and setting.restless:
                self._fidget(plan, setting, place, end_us, draws)
        _stay_until(plan, end_us)

    def _go(self, plan: Plan, setting: Setting, draws: Draws) -> Spot | Seat:
        """Go to where the activity is done: a place at its furniture, else a spot in its room."""
        room = draws.choice(setting.rooms)
        place: Spot | Seat = (
            draws.choice(setting.seats) if setting.seats else draws.choice(self.spots.in_room(room))
        )
        _settle_at(plan, setting, place)
        return place

    def _fidget(
        self, plan: Plan, setting: Setting, place: Spot | Seat, end_us: int, draws: Draws
    ) -> None:
        """Turn, move and fetch things at the activity's rates until it is nearly over."""
        next_us = [plan.time_us + _wait_us(law, draws) for _, law in setting.restless]
        turns = _Turns(plan, self.turn_rate)
        end_us -= NEARLY_OVER_US
        while True:
            k = min(range(len(next_us)), key=next_us.__getitem__)
            if next_us[k] >= end_us:
                turns.add_to_plan()
                return
            what, law = setting.restless[k]
            if what == "shifts":
                turns.turn(next_us[k], draws.below(2 * SIDEWAYS + 1) - SIDEWAYS)
            else:
                turns.add_to_plan()
                _stay_until(plan, next_us[k])
                if what == "moves":
                    place = self._go_elsewhere(plan, setting, place, draws)
                else:
                    self._fetch(plan, setting, place, end_us, draws)
                turns = _Turns(plan, self.turn_rate)
            next_us[k] = turns.time_us + _wait_us(law, draws)

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
        """Go to another room, stay a moment, and come back, if there is time for that."""
        takes_us = setting.fetch_takes.draw(draws) * SECOND_US
        spot = draws.choice(self.spots.in_room(draws.choice(setting.stores)))
        if plan.time_us + takes_us < end_us:
            spot.walk(plan)
            plan.stay(timedelta(microseconds=takes_us))
            _settle_at(plan, setting, place)

    def _setting(self, actor: "Actor", activity: Activity) -> Setting:
        if activity.away:
            return Setting(activity, [], [], [], (), activity.fetch_takes.table())
        rooms = self._own_rooms(actor, activity.rooms)
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

    def _own_rooms(self, actor: "Actor", names: "RoomChoice") -> list["Room"]:
        """Return the rooms that a list of names stands for: of several of a kind, its own one."""
        name, rooms = _match(actor, names)
        if name == "any":
            return rooms
        return [Draws(actor.stream(f"room of {name}"), 0).choice(rooms)]


def _match(actor: "Actor", names: "RoomChoice") -> tuple[str, list["Room"]]:
    try:
        return matching_rooms(names, actor.home.rooms, actor.reachable_rooms())
    except PlacementError as error:
        raise PlacementError(f"{actor.path}: {error}") from None


def rooms_at(doings: Iterable[Doing], time_s: int, activities: dict[str, Activity]) -> "RoomChoice":
    """Return the rooms of what is done at a time; () if that is out of the home."""
    for doing in doings:
        if doing.begin <= time_s < doing.end:
            activity = activities[doing.activity]
            return () if activity.away else activity.rooms
    return ("any",)


def _wait_us(law: Law, draws: Draws) -> int:
    """Draw one of a law's quantiles [us]: fine enough for when somebody stirs."""
    return law.knots[draws.below(KNOTS)] * SECOND_US


def _settle_at(plan: Plan, setting: Setting, place: Spot | Seat) -> None:
    """Go to a place and sit or lie down as the activity wants; on foot, as the furniture does."""
    place.walk(plan)
    if setting.activity.posture != "stand":
        plan.take(setting.activity.posture)


class _Turns:
    """Turns on the spot, gathered before they are added to a plan all at once: most of them all."""

    def __init__(self, plan: Plan, turn_rate: float) -> None:
        self.time_us = plan.time_us
        self._plan = plan
        self._turn_rate = turn_rate  # headings per second
        self._heading = plan.heading
        self._rows: list[tuple[int, int, int, int, int]] = []

    def turn(self, time_us: int, aside: int) -> None:
        """Turn to so many headings beside the one in which it all began."""
        plan = self._plan
        heading = (plan.heading + aside) % TURN
        turn = abs((heading - self._heading + TURN // 2) % TURN - TURN // 2)
        began_us = max(time_us, self.time_us)
        self.time_us = began_us + math.ceil(turn * SECOND_US / self._turn_rate)
        self._rows.append((began_us, plan.x, plan.y, self._heading, 0))
        self._rows.append((self.time_us, plan.x, plan.y, heading, 0))
        self._heading = heading

    def add_to_plan(self) -> None:
        """Let the plan turn."""
        if self._rows:
            self._plan.follow(np.array(self._rows, np.int64))
            self._rows.clear()


def _stay_until(plan: Plan, time_us: int) -> None:
    if time_us > plan.time_us:
        plan.stay(timedelta(microseconds=time_us - plan.time_us))
