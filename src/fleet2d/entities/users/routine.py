"""Routine: days drawn from a persona, alone or in a household."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Self

from pydantic import model_validator

from fleet2d.component import register
from fleet2d.entities.users.inhabitant import Inhabitant, rooms_at
from fleet2d.entities.users.private_rooms import private_rooms
from fleet2d.entities.users.seating import Seating
from fleet2d.entities.users.setting import SECOND_US, Setting
from fleet2d.entities.users.spots import Spots
from fleet2d.errors import PlacementError
from fleet2d.problems import problem, suggest
from fleet2d.routines.activity import Activity, catalogue
from fleet2d.routines.household import WELCOME, AnyHousehold, Lives
from fleet2d.routines.life import Life
from fleet2d.routines.periods import AWAY, AnyPeriod, with_absences
from fleet2d.routines.persona import AnyPersona, Persona, bundled_persona
from fleet2d.routines.planner import DAY_S, Doing

if TYPE_CHECKING:
    from fleet2d.clock import Clock
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.place import Point, RoomChoice

# Length of a time slot in which one member of a household may go to a private room.
TURN_US = 900 * SECOND_US
# A way there takes less than this.
WAY_US = 60 * SECOND_US


@register("behavior", "routine")
class Routine(Inhabitant):
    """Live by a persona: a day's activities with their times, durations, order and probability.

    Every day is drawn independently and satisfies the persona's template. An activity is done at
    its furniture, else in its room; meanwhile the person turns, gets up and fetches things. Members
    of a household have the persona that it gives them, and common appointments.

    Attributes:
        persona: The persona: a bundled name, a YAML file, or a mapping that may extend either; left
            out: works_outside.
        household: The household it belongs to: a mapping or a YAML file, the same for all of its
            members.
        away: When it is out of the home, on holiday.
        visits: When it is in the home, if it is only a visitor.
    """

    persona: AnyPersona | None = None
    household: AnyHousehold | None = None
    away: tuple[AnyPeriod, ...] = ()
    visits: tuple[AnyPeriod, ...] = ()

    @model_validator(mode="after")
    def _is_one_person(self) -> Self:
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
        return self

    def start(self, actor: "Actor") -> None:
        """Set up the days of the person, and find where the activities are done in the home."""
        self.name = actor.name
        spots, sleeps_in, side = Spots(actor), None, (0, 1)
        if self.household is None:
            self.life = Life(self.resolved_persona, actor.seed, actor.path)
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

    def _join_household(self, actor: "Actor") -> None:
        """Share the days and places of the members, or prepare them if it is the first of them."""
        assert self.household is not None
        bodies = (body for body in actor.people.values() if body is not None)
        behaviors = (each for body in bodies for each in getattr(body, "behaviors", ()))
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
        """The persona, of its own or of the household's member."""
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

    def begins_at(self, time: datetime) -> "RoomChoice | Point | None":
        """Return the rooms of a likely activity at that time."""
        likely_day, today = Life(self.resolved_persona, 0, "").day, time.toordinal()
        time_s = (time - datetime.fromordinal(today)) // timedelta(seconds=1)
        if time_s < likely_day(today)[0].begin:
            today, time_s = today - 1, time_s + DAY_S
        return rooms_at(self._with_absences(likely_day(today), today), time_s, self._activities())

    def day(self, ordinal: int) -> Sequence[Doing]:
        """Return what is done on the day of a date's ordinal."""
        if self.household is None:
            return self._with_absences(self.life.day(ordinal), ordinal)
        return self.lives.day(ordinal)[self.name]

    def wait_for(self, room: int, clock: "Clock", begin_us: int, takes_us: int) -> int | None:
        """Return how long to wait before it may use a room [us]; None: not now.

        Members of a household take turns in private rooms: for short visits, each of them has a
        slot of a quarter of an hour in turn, outside the planned activities of others there.
        """
        if self.household is None or room not in self.private_rooms:
            return 0
        rank, members = self.spots.rank, self.spots.members
        turn = begin_us // TURN_US
        begins_us = max(begin_us, (turn + (rank - turn) % members) * TURN_US)
        ends_us = begins_us + takes_us + 2 * WAY_US
        if ends_us > (begins_us // TURN_US + 1) * TURN_US:
            begins_us = (begins_us // TURN_US + members) * TURN_US
            ends_us = begins_us + takes_us + 2 * WAY_US
        if ends_us - begins_us > TURN_US:
            return None
        date = clock.start + timedelta(microseconds=begins_us)
        midnight_us = clock.elapsed(datetime.fromordinal(date.toordinal()))
        for begin, end in self.lives.in_use(date.toordinal(), self.name, room):
            if begins_us - WAY_US < midnight_us + end * SECOND_US and (
                midnight_us + begin * SECOND_US < ends_us
            ):
                return None
        return begins_us - begin_us

    def seated(self, setting: Setting, which: tuple[int, int]) -> Setting:
        """Return the setting with the place that the member of a household has for the doing."""
        if self.household is None or not setting.seats:
            return setting
        places = self.seating.places(*which, self.spots.rank)
        if places is None or not all(self.spots.can_reach(seat) for seat in places):
            return setting
        return setting._replace(seats=list(places))

    def _with_absences(self, day: Sequence[Doing], ordinal: int) -> Sequence[Doing]:
        if not self.away and not self.visits:
            return day
        return with_absences(day, datetime.fromordinal(ordinal), self.away, self.visits)
