"""Schedule: a fixed daily or weekly agenda of places."""

from datetime import datetime, timedelta
from itertools import chain
from typing import NamedTuple

from pydantic import Field

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem, problem_at
from fleet2d.configuration.units import Duration, OnDays, TimeOfDay, format_time_of_day, weekdays_of
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.place import Place, Point, RoomChoice, available_places, is_point, seat_at
from fleet2d.entities.plan import Plan
from fleet2d.runtime.clock import DAY, midnight_of, midnights, next_midnight
from fleet2d.runtime.events import EventKind
from fleet2d.runtime.local_time import at_reading

AWAY: tuple[()] = ()


class Item(Settings):
    """An entry of an agenda: its time, place and duration.

    Attributes:
        at: The beginning; left out: the end of the item before.
        place: The place: a room, a kind of room, or a point.
        away: Whether the person is out of the home instead.
        dwell: The duration; left out: until the next item begins.
        activity: The activity there, for the events table; left out: that of the item before.
    """

    at: TimeOfDay | None = None
    place: Place | None = None
    away: bool = False
    dwell: Duration | None = None
    activity: str = ""

    def model_post_init(self, _: object, /) -> None:
        """Require either a place or `away`."""
        if self.away == (self.place is not None):
            raise problem("an item needs a place, or 'away: true', and not both")


class Agenda(Settings):
    """An agenda, and the days on which it holds.

    Attributes:
        on: The days on which it holds.
        items: Its items, in order.
    """

    on: OnDays = "daily"
    items: tuple[Item, ...] = Field(min_length=1)

    @property
    def weekdays(self) -> set[int]:
        """The days of the week that the agenda applies to, 0 = Monday."""
        return weekdays_of(self.on)


class AgendaEntry(NamedTuple):
    """A resolved item of an agenda.

    Attributes:
        at: The time of day of the item, or of the last item before it with one.
        later: The dwells from then until the beginning, in real time.
        place: The place; () is out of the home.
        activity: The activity there.
    """

    at: timedelta
    later: timedelta
    place: RoomChoice | Point | tuple[()]
    activity: str

    @property
    def begins(self) -> timedelta:
        """The beginning since midnight on a day of 24 hours; for a rest, maybe on a later day."""
        return self.at + self.later

    def moment(self, midnight: datetime, time: datetime) -> datetime:
        """Return the beginning on the day of a midnight, by the clock of a time."""
        return at_reading(time, midnight + self.at) + self.later


class Schedule(Behavior):
    """Be at fixed places at fixed times, daily or by weekday.

    At an item's time the body walks to its place by the shortest path; in a room, to a spot drawn
    each time. When an item with a dwell is over and no other is due, the body goes to the place
    `rest`, even on a later day. A later day of the list replaces an earlier one on the weekdays
    they share.

    Attributes:
        days: The agendas of the days of the week.
        rest: The place to go to when an item is over and nothing is due.
    """

    always_decides = True

    days: tuple[Agenda, ...] = Field(min_length=1)
    rest: Place = ("living_room", "any")

    def model_post_init(self, _: object, /) -> None:
        """Refuse days that overlap, are not in order, or are all replaced by later ones."""
        for number, day in enumerate(self.days):
            _entries(day, self.rest, number)
            others = self.days[number + 1 :]
            if day.weekdays <= frozenset().union(*(other.weekdays for other in others)):
                raise problem_at(
                    ("days", number),
                    "later entries of the list replace it on each of its days: list those of more"
                    " days first, or leave it out",
                )

    def start(self, actor: Actor) -> None:
        """Resolve the week, and check that every place exists and can be reached."""
        self.week = self._week()
        self.plan: Plan | None = None  # the last plan returned
        self.until = actor.clock.start  # midnight at its end
        entries = chain.from_iterable(self.week)
        places = dict.fromkeys(entry.place for entry in entries if entry.place)
        for place in places:
            if is_point(place):
                actor.point(place)  # type: ignore[arg-type]
        available = {(), *available_places(actor, "schedule.days", places)}
        for day in self.week:
            day[:] = [entry for entry in day if entry.place in available]
        at_home = [entry.activity for entry in chain.from_iterable(self.week) if entry.place]
        if any(at_home) and not all(at_home):
            actor.notes.append(
                "schedule.days: where an item at home has no activity, that of the item before goes"
                " on, such as sleep: give each of them one"
            )

    def begins_at(self, time: datetime) -> RoomChoice | Point | tuple[()] | None:
        """Return the place of the last item before the run."""
        entry = self._current(self._week(), time)
        return entry.place if entry else None

    def decide(self, now: Situation) -> Plan:
        """Plan the rest of the day; after another behavior's turn, first go to the present item."""
        plan = now.plan()
        since = now.time
        if now.actor.plan is self.plan:  # the own plan may end later than midnight
            since = self.until
        elif entry := self._current(self.week, now.time):
            seat = seat_at(now.actor, entry.place) if entry.place else None
            if now.step or now.actor.entity.start or seat is not None:
                _add(plan, entry)
            elif entry.activity:  # which began before the run
                plan.note(EventKind.ACTIVITY, entry.activity)
        self.until = next_midnight(now.time)
        for midnight in midnights(since, self.until):
            entries = self.week[midnight.weekday()]
            moments = [entry.moment(midnight, now.time) for entry in entries]
            for number, (entry, moment) in enumerate(zip(entries, moments, strict=True)):
                # When clocks are put forward, an item after a dwell may be due after a later item.
                is_overtaken = any(later < moment for later in moments[number + 1 :])
                if moment >= since and not is_overtaken:
                    _add(plan.stay(until=moment), entry)
        self.plan = plan.stay(until=self.until)
        return self.plan

    def activities(self) -> tuple[str, ...]:
        """Return the activities of the agendas."""
        names = (entry.activity for entry in chain.from_iterable(self.week))
        return tuple(dict.fromkeys(filter(None, names)))

    def perform(self, plan: Plan, activity: str) -> None:
        """Go to the first place that an agenda has for an activity."""
        entries = chain.from_iterable(self.week)
        place = next(entry.place for entry in entries if entry.activity == activity)
        if place:
            plan.come_home().go_to(place)
        else:
            plan.leave_home()

    def _week(self) -> list[list[AgendaEntry]]:
        week: list[list[AgendaEntry]] = [[] for _ in range(7)]
        for day in self.days:
            for weekday in day.weekdays:
                week[weekday] = _entries(day, self.rest)
        _rest_later(week)
        return week

    @staticmethod
    def _current(week: list[list[AgendaEntry]], time: datetime) -> AgendaEntry | None:
        """Return the last entry that began before `time`, up to a week ago."""
        midnight = midnight_of(time)
        for back in range(8):
            day = midnight - back * DAY
            earlier = [entry for entry in week[day.weekday()] if entry.moment(day, time) < time]
            if earlier:
                return earlier[-1]
        return None


def _add(plan: Plan, entry: AgendaEntry) -> None:
    if entry.place:
        plan.go_to(entry.place)
    else:
        plan.leave_home()
    if entry.activity:
        plan.note(EventKind.ACTIVITY, entry.activity)


def _entries(day: Agenda, rest: RoomChoice | Point, number: int = 0) -> list[AgendaEntry]:
    """Resolve the items of a day, and add entries of rest between them.

    Raises:
        ValidationError: The items don't follow each other within the day, which is `number` in the
            list of days.
    """
    entries: list[AgendaEntry] = []
    over: AgendaEntry | None = None  # rest after the item before, if it has a dwell
    for index, item in enumerate(day.items):
        key = ("days", number, "items", index)
        place = item.place or AWAY
        if item.at is not None:
            entry = AgendaEntry(item.at, timedelta(0), place, item.activity)
        elif over is not None:
            entry = over._replace(place=place, activity=item.activity)
        else:
            raise problem_at(key, "it needs 'at', or a 'dwell' in the item before it")
        before = over or (entries[-1] if entries else None)
        if before is not None and entry.begins < before.begins:
            raise problem_at(
                key,
                f"it begins at {format_time_of_day(entry.begins)}, but the item before it lasts"
                f" until {format_time_of_day(before.begins)}: list the items of a day in order",
            )
        if entry.begins >= DAY:
            raise problem_at(
                key, f"it begins at {format_time_of_day(entry.begins)}: an item begins before 24:00"
            )
        if over is not None and entry.begins > over.begins:
            entries.append(over)
        entries.append(entry)
        over = None
        if item.dwell is not None:
            over = AgendaEntry(entry.at, entry.later + item.dwell, rest, "rest")
    if over is not None:
        entries.append(over)
    return entries


def _rest_later(week: list[list[AgendaEntry]]) -> None:
    """Move a rest that begins after midnight to its day, unless an item begins before it."""
    late = [(day, entries.pop()) for day, entries in enumerate(week) if _is_late(entries)]
    for day, rest in late:
        days = rest.begins // DAY
        moved = rest._replace(at=rest.at - days * DAY)
        target = week[(day + days) % 7]
        is_due_before = bool(target) and target[0].begins <= moved.begins
        between = (week[(day + ahead) % 7] for ahead in range(1, days))
        if not is_due_before and not any(between):
            target.insert(0, moved)


def _is_late(entries: list[AgendaEntry]) -> bool:
    return bool(entries) and entries[-1].begins >= DAY
