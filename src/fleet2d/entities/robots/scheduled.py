"""Scheduled: a robot's fixed visits, at times of the day, between which others have their way."""

from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from fleet2d.component import Settings, register
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.hours import DAY
from fleet2d.entities.place import Place, Point, RoomChoice, is_point
from fleet2d.entities.plan import Plan
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
    as they leave the robot to it, if that is no later than `late` after its time. In a room the
    robot stops at the point farthest from its walls. Event: `visits`, with the task, else the room.
    """

    visits: tuple[Visit, ...] = Field(min_length=1, description="the visits")
    late: Duration = Field(
        default=timedelta(minutes=30),
        description="a visit that can't begin within that time is left out",
    )

    def start(self, actor: "Actor") -> None:
        """Find the stops."""
        self.stops = [_stop(actor, visit.place) for visit in self.visits]
        # Visits that were due up to then are made, or left out.
        self.made = actor.clock.start - timedelta(microseconds=1)

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return when the next visit is due."""
        return next((due for due, _ in self._due(max(self.made, now.time))), None)

    def decide(self, now: Situation) -> Plan | None:
        """Make the visit that is due, or leave the robot to the behaviors behind."""
        waiting = [(due, number) for due, number in self._due(self.made) if due <= now.time]
        for due, number in waiting:
            self.made = due
            if now.time - due <= self.late:
                return self._visit(now, number)
        return None

    def _visit(self, now: Situation, number: int) -> Plan:
        visit, (x, y) = self.visits[number], self.stops[number]
        room = now.home.plan.room_at(*now.home.plan.lattice.to_metres([x, y]).tolist())
        plan = (
            now.plan().go_to_point(x, y).note("visits", visit.task or (room.name if room else ""))
        )
        if visit.look_around:
            plan.turn_by(1.0)
        return plan.stay(visit.dwell)

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


def _stop(actor: "Actor", place: RoomChoice | Point) -> tuple[int, int]:
    if is_point(place):
        return actor.point(place)  # type: ignore[arg-type]
    return actor.middle(actor.rooms(place)[0])  # type: ignore[arg-type]
