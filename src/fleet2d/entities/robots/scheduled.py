"""Scheduled: a robot's fixed visits, at times of the day, between which others have their way."""

from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Annotated, ClassVar

from pydantic import Field

from fleet2d.component import Settings, register
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.furniture import stop_at
from fleet2d.entities.hours import DAY
from fleet2d.entities.place import Place
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import AT_A_DOOR
from fleet2d.units import Duration, TimeOfDay
from fleet2d.weekdays import Days, weekdays_of

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor


class Visit(Settings):
    """One visit: when, where, and for how long."""

    at: TimeOfDay = Field(description="time of day at which the robot sets out")
    place: Place = Field(description="where to: a room, a kind of room, or a point")
    dwell: Duration = Field(default=timedelta(minutes=10), description="how long it stays there")
    on: Days | Annotated[tuple[Days, ...], Field(min_length=1)] = Field(
        default="daily", description="the days on which it is made"
    )
    look_around: bool = Field(default=True, description="turn once on the spot on arriving")
    task: str = Field(default="", description="what is done there, for the events table")


@register("behavior", "scheduled")
class Scheduled(Behavior):
    """Visit rooms at fixed times of the day; between visits the behaviors behind have their way.

    It breaks in on them when it is time, unless `preempts` is false: then a visit is made as soon
    as they leave the robot to it, if that is no later than `late` after its time; one behind a shut
    door, as soon as the door is open. In a room the robot stops at the point farthest from its
    walls. Events: `visits`, with the task, else the room, and `way_blocked`, with the room.
    """

    records: ClassVar[frozenset[str]] = frozenset({"visits", "way_blocked"})

    visits: tuple[Visit, ...] = Field(min_length=1, description="the visits")
    late: Duration = Field(
        default=timedelta(minutes=30),
        description="a visit that can't begin within that time is left out",
    )

    def start(self, actor: "Actor") -> None:
        """Find the stops."""
        self.stops = [stop_at(actor, visit.place) for visit in self.visits]
        self.asked = actor.clock.start - timedelta(microseconds=1)
        self.waiting: list[tuple[datetime, int]] = []  # due by then, not made, not yet too late

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return when the next visit is due, or a shut door is tried again."""
        due = next((due for due, _ in self._due(max(self.asked, now.time))), None)
        again = now.time + AT_A_DOOR if self.waiting else None
        return min((time for time in (due, again) if time is not None), default=None)

    def decide(self, now: Situation) -> Plan | None:
        """Make a visit that is due, or leave the robot to the behaviors behind."""
        fresh = [visit for visit in self._due(self.asked) if visit[0] <= now.time]
        self.asked = now.time
        self.waiting = [v for v in self.waiting + fresh if now.time - v[0] <= self.late]
        for due, number in self.waiting:
            if not now.home.hinders or now.plan().reaches(*self.stops[number]):
                self.waiting.remove((due, number))
                return self._visit(now, number)
        shut_out = [number for due, number in self.waiting if (due, number) in fresh]
        if shut_out:
            return now.plan().note("way_blocked", self._name(now, shut_out[0])).stay(AT_A_DOOR)
        return None

    def _visit(self, now: Situation, number: int) -> Plan:
        visit, (x, y) = self.visits[number], self.stops[number]
        plan = now.plan().go_to_point(x, y).note("visits", visit.task or self._name(now, number))
        if visit.look_around:
            plan.turn_by(1.0)
        return plan.stay(visit.dwell)

    def _name(self, now: Situation, number: int) -> str:
        """Return the name of the room of a visit; empty between two."""
        xy = now.home.plan.lattice.to_metres(self.stops[number]).tolist()
        room = now.home.plan.room_at(*xy)
        return room.name if room else ""

    def _due(self, since: datetime) -> Iterator[tuple[datetime, int]]:
        """Yield the visits due after a moment, in order of time, within eight days."""
        midnight = datetime.combine(since.date(), datetime.min.time())
        for ahead in range(9):
            day = midnight + ahead * DAY
            today = [
                (day + visit.at, number)
                for number, visit in enumerate(self.visits)
                if day.weekday() in weekdays_of(visit.on)
            ]
            yield from (entry for entry in sorted(today) if entry[0] > since)
