"""Replay: be where a person was according to a log, in its rooms or at its positions."""

from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema

from fleet2d.clock import DAY_US, midnight_of
from fleet2d.component import register
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.plan import Plan
from fleet2d.entities.users.follow_fixes import FixFollower, place_fixes
from fleet2d.entities.users.follow_rooms import RoomFollower
from fleet2d.entities.users.replay_report import report_fixes, report_rooms
from fleet2d.logs.frame import Frame
from fleet2d.logs.log import ActivityLog, LogError, PositionLog
from fleet2d.logs.read import Layout, read_log
from fleet2d.logs.rooms import map_rooms
from fleet2d.logs.visits import LoggedVisit, VisitRule, visits_of
from fleet2d.paths import InputFileOrFolder
from fleet2d.units import Duration, Length, PositiveDuration, Speed, micros

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor

GAP_OF_ROOMS = timedelta(minutes=10)
GAP_OF_FIXES = timedelta(minutes=1)


def _rooms(value: object) -> object:
    """Accept a room without a list around it."""
    if isinstance(value, dict):
        return {key: (v,) if isinstance(v, str) else v for key, v in value.items()}
    return value


RoomMap = Annotated[
    dict[str, tuple[str, ...] | None],
    BeforeValidator(_rooms),
    WithJsonSchema(
        {
            "type": "object",
            "additionalProperties": {
                "anyOf": [
                    {"type": "string"},
                    {"type": "array", "items": {"type": "string"}, "minItems": 1},
                    {"type": "null"},
                ]
            },
            "x-quantity": "mapping of labels to rooms",
        }
    ),
]


@register("behavior", "replay")
class Replay(Behavior):
    """Be where a person was according to a log: a smart home's events, a script, or positions.

    When the log names a room, the body is in it at that step, as it left for it early enough. Where
    the log says nothing, nothing is invented: the body is away then, and the events `unknown` and
    `known` mark the gap.

    Attributes:
        path: The log, or the folder of a home's logs.
        format: The layout of the log; auto: recognized by its content.
        id: The tag to follow, if a log of positions has several.
        columns: The names of the columns of positions, as {x: east}.
        time_zone: The time zone of the home, if the times of positions have one.
        sort: Sort lines whose time runs backwards; else they are refused.
        frame: The transform from the positions of the log to the floor plan.
        rooms: The room or kind of room of this home for each room label of the log, or away, or
            door; null leaves it out; labels that aren't listed have their usual meaning.
        day: The day of the log that is the first of the run: a number from 0, its date, or the
            first of the same weekday.
        gaps: In a gap: unknown: the body is away; hold: it stays and leaves in time; walk: it goes
            at once.
        gap: Silence longer than this is a gap; left out: 10 min between rooms, 1 min between
            positions.
        still: Silence in one room up to this length is not a gap: sleepers trigger no sensor.
        reach: A position farther than this from free space is left out.
        fastest: Walks faster than this are reported as implausible [m/s].
    """

    records: ClassVar[frozenset[str]] = frozenset({"known", "replay", "unknown"})

    path: InputFileOrFolder
    format: Layout = "auto"
    id: str | None = None
    columns: dict[str, str] = Field(default={})
    time_zone: str | None = None
    sort: bool = False
    frame: Frame = Frame()
    rooms: RoomMap = Field(default={})
    day: int | Literal["date", "weekday"] = 0
    gaps: Literal["unknown", "hold", "walk"] = "unknown"
    gap: PositiveDuration | None = None
    still: Duration = timedelta(hours=12)
    reach: Length = Field(default=1.0, ge=0)
    fastest: Speed = 3.0

    def files(self) -> tuple[Path, ...]:
        """Return the files that it reads."""
        return tuple(sorted(self.path.glob("*.txt"))) if self.path.is_dir() else (self.path,)

    def start(self, actor: "Actor") -> None:
        """Read the log, plan the way through it, and report on it in `notes`."""
        self.visits: list[LoggedVisit] = []
        try:
            log = read_log(
                self.path,
                self.format,
                id=self.id,
                columns=self.columns,
                time_zone=self.time_zone,
                sort=self.sort,
            )
            begin_us = self._begin(log, actor)
            if isinstance(log, ActivityLog):
                self._start_rooms(actor, log, begin_us)
            else:
                self._start_fixes(actor, log, begin_us)
        except LogError as error:
            raise LogError(f"{actor.path}: {error}") from None

    def decide(self, now: Situation) -> Plan:
        """Follow the log to its end, from the present step.

        After another behavior's turn, the body first walks to where the log has it; in a log of
        positions, it is put there.
        """
        plan = now.plan()
        if now.step == 0:
            for note in self.notes:
                plan.note("replay", note)
        if isinstance(self.follower, FixFollower):
            return self.follower.follow(plan)
        current = max((i for i, v in enumerate(self.visits) if v.first <= now.step), default=0)
        return self.follower.follow(plan, current, rejoin=now.step > 0)

    def _begin(self, log: ActivityLog | PositionLog, actor: "Actor") -> int:
        """Return the moment of the log that is step 0 [us since its first midnight]."""
        start = actor.clock.start
        clock_us = micros(start - midnight_of(start))
        day = self.day
        if isinstance(day, str):
            if log.first_day is None:
                raise LogError(f"day: {day} needs a log with dates, and this one has none")
            ahead = (start.date() - log.first_day).days
            day = ahead if day == "date" else ahead % 7
        if not 0 <= day < log.days:
            raise LogError(
                f"the run begins on day {day} of the log, which has the days 0 to {log.days - 1};"
                " choose another by 'day'"
            )
        return day * DAY_US + clock_us

    def _start_rooms(self, actor: "Actor", log: ActivityLog, begin_us: int) -> None:
        mapped = map_rooms(log.rooms, self.rooms, actor.home.rooms)
        clock = actor.clock
        gap_us = micros(self.gap or GAP_OF_ROOMS)
        rule = VisitRule(
            step_us=clock.step_us,
            begin_us=begin_us,
            steps=clock.steps,
            gap_us=gap_us,
            still_us=micros(self.still),
            unknown=self.gaps == "unknown",
            door_us=gap_us,
        )
        logged = visits_of(log, mapped, rule)
        self.visits = logged.visits
        self.follower: RoomFollower | FixFollower = RoomFollower(
            actor, self.visits, self.gaps == "walk", self.fastest
        )
        # Planned once before the run, for the report on its walks.
        self.follower.follow(Plan(actor, 0), 0, rejoin=False)
        self.notes = report_rooms(log, mapped, logged, rule, self.follower.paces, self.fastest)

    def _start_fixes(self, actor: "Actor", log: PositionLog, begin_us: int) -> None:
        if self.rooms:
            raise LogError("a log of positions names no rooms: leave out 'rooms'")
        clock = actor.clock
        time_us = log.time_us - begin_us
        step = time_us // clock.step_us
        # The first fix of each step of the run.
        used = np.append(True, step[1:] != step[:-1]) & (time_us < clock.steps * clock.step_us)
        fixes = place_fixes(
            actor,
            time_us[used],
            self.frame.to_plan(log.xy[used]),
            self.frame.turn_headings(log.heading[used] / (2 * np.pi)),
            self.reach,
        )
        gap_us = micros(self.gap or GAP_OF_FIXES)
        self.follower = FixFollower(actor, fixes, gap_us, self.gaps, self.fastest)
        self.follower.follow(Plan(actor, 0))
        thinned = int(np.count_nonzero(step[1:] == step[:-1]))
        self.notes = report_fixes(log, fixes, self.follower, thinned, self.frame)
