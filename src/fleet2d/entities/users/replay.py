"""Replay: people at the rooms or positions of a log."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema

from fleet2d.configuration import units
from fleet2d.configuration.problems import counted
from fleet2d.configuration.units import Duration, InputFileOrFolder, Length, PositiveDuration
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.place import Nearest
from fleet2d.entities.plan import Note, Plan
from fleet2d.errors import errors_as
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.floorplan.space import straight_way
from fleet2d.kernels import F64, I64, TURN, heading_of, line_of_sight, time_route
from fleet2d.logs import placement
from fleet2d.logs.layout import Layout, read_log
from fleet2d.logs.log import (
    AWAY,
    ActivityLog,
    Day,
    LogError,
    LogKeys,
    PositionLog,
    files_of,
    in_run,
)
from fleet2d.logs.placement import (
    COORDINATE_LIMIT_M,
    DOOR,
    MAX_OUTSIDE,
    UNKNOWN,
    LogFrame,
    LoggedVisit,
    LoggedVisits,
    RoomChoice,
)
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.runtime.events import EventKind

# A leg faster than this is counted as implausible.
FASTEST_M_S = 3.0
# A move shorter than this is ignored for the heading [m].
MIN_HEADING_MOVE_M = 0.1


@dataclass(frozen=True)
class Fixes:
    """Fixes that the body can follow.

    Attributes:
        time_us: Times [us since the start of the run], ascending, int64 (n,).
        xy: Positions, all free and reachable [lattice], int64 (n, 2).
        heading: Headings [1/4096 turn], -1 for none in the log, int64 (n,).
        snapped: The number of fixes that were moved to the nearest free place.
        outside: The number of fixes that were left out, too far from any free place.
        beyond_m: Median distance of these from the nearest free place [m]; 0 without any.
    """

    time_us: I64
    xy: I64
    heading: I64
    snapped: int
    outside: int
    beyond_m: float


def place_fixes(actor: Actor, time_us: I64, xy: F64, turns: F64, reach: float) -> Fixes:
    """Return fixes moved to the nearest place where the body can be.

    Args:
        actor: The body.
        time_us: Times [us since the start of the run], ascending, int64 (n,).
        xy: Positions in the plan [m], float64 (n, 2).
        turns: Headings in the plan [turns], NaN where there is none.
        reach: A fix farther than this from any such place is left out [m].
    """
    lattice = actor.home.lattice
    space = actor.space
    size = 1 << 20  # beyond any home, and squared within 64 bits
    clipped = np.clip(xy, -COORDINATE_LIMIT_M, COORDINATE_LIMIT_M)
    points: I64 = np.clip(lattice.to_lattice(clipped), -size, size)
    fits = [
        0 <= x < size and 0 <= y < size and space.part_at(x, y) == actor.part
        for x, y in points.tolist()
    ]
    off = np.flatnonzero(~np.array(fits, bool))
    near = Nearest(actor).of(points[off])
    away: I64 = near - points[off]
    is_outside = (away * away).sum(axis=1) > (reach * lattice.units_per_m) ** 2
    outside = off[is_outside]
    beyond_m = 0.0
    if len(outside):
        dx, dy = (xy[outside] - lattice.to_metres(near[is_outside])).T
        beyond_m = float(np.median(np.hypot(dx, dy)))
    points[off] = near
    known = np.isfinite(turns)
    heading = np.full(len(turns), -1, np.int64)
    heading[known] = np.floor(turns[known] * TURN + 0.5).astype(np.int64) % TURN
    columns = (np.delete(column, outside, axis=0) for column in (time_us, points, heading))
    time_us, points, heading = columns
    snapped = len(off) - len(outside)
    return Fixes(time_us, points, heading, snapped, len(outside), beyond_m)


class FixFollower:
    """Plans the way through fixes: straight from each to the next if that is free, else around.

    Args:
        actor: The body.
        fixes: Its positions.
        gap_us: Two fixes farther apart in time than this have a gap between them.
        gaps: The behavior in a gap: "unknown": the body is away; "hold": it stays, and leaves in
            time for the next fix; "walk": it takes all that time for the way.
    """

    def __init__(self, actor: Actor, fixes: Fixes, gap_us: int, gaps: str) -> None:
        self.actor = actor
        self.fixes = fixes
        self.gap_us = gap_us
        self.gaps = gaps
        self.fastest = FASTEST_M_S * actor.home.lattice.units_per_m
        self.unknown_us = self.gap_count = self.implausible = self.around = 0
        self.top_speed = 0.0
        self.heading = self._headings()

    def follow(self, plan: Plan) -> Plan:
        """Fill a plan from its beginning, with a jump to the present fix, to the last fix."""
        time = self.fixes.time_us
        end_us = self.actor.clock.steps * self.actor.clock.step_us
        i = int(np.searchsorted(time, plan.time_us, side="right")) - 1
        if i < 0 or plan.time_us - time[i] > self.gap_us:
            _vanish(plan, plan.time_us)
        else:
            plan.follow(self._row(i, plan.time_us))
        for j in range(i + 1, len(time)):
            if time[j] >= end_us:
                break
            if plan.away:
                self._appear(plan, j)
            elif time[j] - time[j - 1] <= self.gap_us:
                self._leg(plan, j, plan.time_us)
            elif self.gaps == "unknown":
                _vanish(plan, plan.time_us + 1)  # at the fix itself, the position is known
                self.gap_count += 1
                self.unknown_us += int(time[j] - time[j - 1])
                self._appear(plan, j)
            else:
                leave = plan.time_us
                if self.gaps == "hold":
                    speeds = (self.actor.speed, self.actor.turn_rate)
                    heading = self.heading[j - 1]
                    takes = time_route(self._route(j), 0, int(heading), *speeds)[-1, 0]
                    leave = max(leave, int(time[j] - takes))
                self._leg(plan, j, leave)
        if len(time) and not plan.away and end_us - plan.time_us > self.gap_us:
            _vanish(plan, plan.time_us + 1)
        return plan.stay()

    def _headings(self) -> I64:
        """Return the heading at each fix: the log's, else the direction to the next fix."""
        xy = self.fixes.xy
        heading = self.fixes.heading.copy()
        stir = MIN_HEADING_MOVE_M * self.actor.home.lattice.units_per_m
        last = 0
        moves = np.diff(xy, axis=0, append=xy[-1:])
        for i, (dx, dy) in enumerate(moves.tolist()):
            if heading[i] < 0:
                has_moved = dx * dx + dy * dy >= stir * stir
                heading[i] = heading_of(dx, dy) if has_moved else last
            last = int(heading[i])
        return heading

    def _row(self, i: int, at_us: int) -> I64:
        """Return a breakpoint at a fix, int64 (1, 5)."""
        x, y = self.fixes.xy[i].tolist()
        return np.array([[at_us, x, y, self.heading[i], 0]], np.int64)

    def _appear(self, plan: Plan, i: int) -> None:
        x, y = self.fixes.xy[i].tolist()
        at_us = int(self.fixes.time_us[i])
        heading = int(self.heading[i])
        plan.jump(at_us, x=x, y=y, heading=heading, away=0).note(EventKind.KNOWN)

    def _route(self, j: int) -> I64:
        """Return the route to a fix from the one before, straight if that is free; int64 (n, 2)."""
        (ax, ay), (bx, by) = self.fixes.xy[j - 1 : j + 1].tolist()
        space = self.actor.space
        straight = straight_way((ax, ay), (bx, by))
        if (ax, ay) == (bx, by) or line_of_sight(space.mesh, ax, ay, bx, by):
            return straight
        route = space.route((ax, ay), (bx, by))
        return straight if route is None else route

    def _leg(self, plan: Plan, j: int, leave_us: int) -> None:
        """Go from the fix before fix j, from a moment on, to that one, at a constant speed."""
        route = self._route(j)
        arrive_us = int(self.fixes.time_us[j])
        moves = np.diff(route, axis=0)
        lengths = np.sqrt((moves * moves).sum(axis=1).astype(np.float64))
        total = float(lengths.sum())
        speed = total * 1e6 / max(arrive_us - leave_us, 1)
        self.top_speed = max(self.top_speed, speed)
        self.implausible += speed > self.fastest
        self.around += len(route) > 2
        rows = []
        if leave_us > plan.time_us:
            rows.append([leave_us, plan.x, plan.y, plan.heading, 0])
        done = 0.0
        corners = route[1:-1].tolist()
        before = lengths[:-1].tolist()
        after = moves[1:].tolist()
        for (x, y), length, (dx, dy) in zip(corners, before, after, strict=True):
            done += length
            at_us = leave_us + int((arrive_us - leave_us) * (done / total))
            rows.append([at_us, x, y, int(heading_of(dx, dy)), 0])
        last = self._row(j, arrive_us)
        breakpoints = np.array(rows, np.int64).reshape(-1, 5)
        plan.follow(np.concatenate([breakpoints, last]))


# In visits shorter than this, the body stops at the nearest point of the room [us].
BRIEF_VISIT_US = 10_000_000


class RoomFollower:
    """Plans the way through visits: the body leaves each room in time for the next visit.

    Args:
        actor: The body.
        visits: Its visits, in order; the first begins at step 0 or before.
        at_once: Whether the body goes to the next room as soon as it may, and waits there.
    """

    def __init__(self, actor: Actor, visits: Sequence[LoggedVisit], at_once: bool) -> None:
        self.actor = actor
        self.visits = visits
        self.at_once = at_once
        self.step_us = actor.clock.step_us
        self.walks = self.hurried = self.implausible = 0
        self.top_speed = 0.0  # top speed of the walks [m/s]
        self._nearest: dict[int, Nearest] = {}

    def follow(self, plan: Plan, current: int, *, rejoin: bool) -> Plan:
        """Fill a plan from its beginning, in visit `current`, to the end of the log.

        Args:
            plan: An empty plan.
            current: The number of the visit at the beginning of the plan.
            rejoin: Whether the body may be elsewhere and walks to the visit's room first; else it
                is put there.
        """
        if rejoin:
            self._catch_up(plan, self.visits[current])
        elif self.visits[current].place == UNKNOWN:
            _vanish(plan, plan.time_us)
        else:
            self._appear(plan, self.visits[current], plan.time_us, known=False)
        for i in range(current + 1, len(self.visits)):
            before = self.visits[i - 1]
            visit = self.visits[i]
            arrive_us = visit.first * self.step_us
            self._note_activities(plan, before)
            if arrive_us <= plan.time_us:  # the body is still catching up
                self._catch_up(plan, visit)
            elif visit.place == UNKNOWN:
                _vanish(plan, arrive_us)
            elif before.place == UNKNOWN:
                self._appear(plan, visit, arrive_us)
            else:
                self._walk(plan, before, visit)
        self._note_activities(plan, self.visits[-1])
        return plan.stay()

    def _catch_up(self, plan: Plan, visit: LoggedVisit) -> None:
        """Walk to a visit that has already begun."""
        if visit.place == UNKNOWN:
            _vanish(plan, plan.time_us)
        elif visit.place == AWAY:
            plan.leave_home()
        else:
            plan.go_to_point(*self._spot(visit, plan))

    def _spot(self, visit: LoggedVisit, plan: Plan) -> LatticePoint:
        if visit.place in (DOOR, AWAY):
            return self.actor.way_out
        begin_us = max(visit.first, 0) * self.step_us
        return self.actor.find((visit.place,), begin_us, "spot")

    def _appear(self, plan: Plan, visit: LoggedVisit, at_us: int, *, known: bool = True) -> None:
        """Put the body at its place in the log."""
        x, y = self._spot(visit, plan)
        plan.jump(at_us, x=x, y=y, away=int(visit.place == AWAY))
        if known:
            plan.note(EventKind.KNOWN, visit.place)

    def _walk(self, plan: Plan, before: LoggedVisit, visit: LoggedVisit) -> None:
        """Walk from one visit to the next, so as to arrive in time."""
        arrive_us = visit.first * self.step_us
        may_leave = max(plan.time_us, before.keep * self.step_us)
        if before.place == AWAY:
            ends_us = (before.last + 1) * self.step_us
            back_us = max(plan.time_us, min(ends_us, arrive_us - 1))
            plan.jump(back_us, away=0).note(EventKind.CAME_HOME)
            may_leave = max(plan.time_us, may_leave)
        spot = self._spot(visit, plan)
        rows = self._way(plan, spot)
        lasts_us = (visit.keep - visit.first) * self.step_us
        is_late = rows[-1, 0] > arrive_us - may_leave
        hurries = is_late or lasts_us < BRIEF_VISIT_US
        if hurries and visit.place not in (DOOR, AWAY):
            rows = self._way(plan, self._near(plan, spot))
        self._set_out(plan, rows, may_leave, arrive_us, before)
        if visit.place == AWAY:
            plan.jump(arrive_us, away=1).note(EventKind.LEFT_HOME)

    def _near(self, plan: Plan, spot: LatticePoint) -> LatticePoint:
        """Return the place in the room of a spot that is nearest to the body."""
        room = self.actor.home.plan.room_of_point(*spot)
        if room is None:
            return spot
        if room.index not in self._nearest:
            self._nearest[room.index] = Nearest(self.actor, room.index)
        here = np.array([plan.position], np.int64)
        ((x, y),) = self._nearest[room.index].of(here).tolist()
        return x, y

    def _way(self, plan: Plan, spot: LatticePoint) -> I64:
        """Return the breakpoints of the way to a spot: time since its beginning, x, y, heading."""
        route = self.actor.space.route(plan.position, spot)
        if route is None:  # a shut door didn't stop the person in the log
            route = straight_way(plan.position, spot)
        return time_route(route, 0, plan.heading, self.actor.speed, self.actor.turn_rate)

    def _set_out(
        self, plan: Plan, rows: I64, may_leave: int, arrive_us: int, before: LoggedVisit
    ) -> None:
        """Follow the breakpoints of a way, at a time and speed that let the body arrive in time."""
        takes = int(rows[-1, 0])
        if not takes:
            plan.follow(np.array([[arrive_us, *rows[-1, 1:], 0]], np.int64))
            return
        leave = max(may_leave, arrive_us - takes)
        if self.at_once:
            leave = min(leave, max(may_leave, (before.last + 1) * self.step_us))
        window = arrive_us - leave
        self.walks += 1
        times = rows[:, 0]
        if takes > window:
            times = times * window // takes
            self.hurried += 1
            speed = self.actor.entity.speed * takes / max(window, 1)
            self.implausible += speed > FASTEST_M_S
            self.top_speed = max(self.top_speed, speed)
        block = np.zeros((len(rows) + 1, 5), np.int64)
        block[:-1, 0] = leave + times
        block[:-1, 1:4] = rows[:, 1:]
        block[-1] = block[-2]
        block[-1, 0] = arrive_us
        plan.follow(block)

    def _note_activities(self, plan: Plan, visit: LoggedVisit) -> None:
        """Add rows for the activities of a visit, except those before the plan begins."""
        for step, activity in visit.activities:
            at_us = max(step, 0) * self.step_us
            if activity and at_us >= plan.began[0] * self.step_us:
                plan.notes.append(Note(at_us, EventKind.ACTIVITY, activity))


GAP_OF_ROOMS = timedelta(minutes=10)
GAP_OF_FIXES = timedelta(minutes=1)


def _vanish(plan: Plan, at_us: int) -> None:
    """Make the body's position unknown: away without having walked out."""
    plan.jump(at_us, away=1).note(EventKind.UNKNOWN)


def report_rooms(
    log: ActivityLog,
    mapped: Mapping[str, RoomChoice | None],
    logged: LoggedVisits,
    follower: RoomFollower,
) -> tuple[str, ...]:
    """Return lines about a log of rooms: the meaning of labels, omissions, gaps, haste."""
    lines = [_head(log, len(log.readings), "readings"), *log.notes]
    for label, count in sorted(log.rooms.items()):
        choice = mapped[label]
        meaning = "left out" if choice is None else f"taken for {choice[0]}"
        lines.append(f"{label}: {meaning}, {count} readings")
    if logged.overruled:
        lines.append(
            f"{logged.overruled} readings yield to later ones of another room in their step"
        )
    gaps = [visit for visit in logged.visits if visit.place == UNKNOWN]
    steps = follower.actor.clock.steps
    step_us = follower.step_us
    lengths = (min(gap.last + 1, steps) - max(gap.first, 0) for gap in gaps)
    hours = sum_in_order(length * step_us / 3.6e9 for length in lengths)
    if gaps:
        lines.append(f"nobody knows where it is in {len(gaps)} gaps, {hours:.1f} h in all")
    if follower.hurried:
        lines.append(
            f"{follower.hurried} of {follower.walks} walks are faster than the body walks, since"
            f" the log leaves no more time; {follower.implausible} of them faster than"
            f" {FASTEST_M_S:g} m/s, the fastest at {follower.top_speed:.1f} m/s"
        )
    return tuple(lines)


def report_fixes(
    log: PositionLog, follower: FixFollower, thinned: int, frame: LogFrame
) -> tuple[str, ...]:
    """Return lines about a log of positions: omitted and moved fixes, gaps, implausible legs."""
    lines = [_head(log, len(log.time_us), "fixes"), *log.notes, *frame.notes()]
    fixes = follower.fixes
    counts = (
        (thinned, "fixes are left out: one in a step is enough"),
        (fixes.outside, "fixes are outside the home and left out"),
        (fixes.snapped, "fixes are moved to the nearest place where the body fits"),
        (follower.around, "legs go around a wall that a straight line would cross"),
    )
    lines += [f"{count} {text}" for count, text in counts if count]
    if follower.gap_count:
        hours = follower.unknown_us / 3.6e9
        lines.append(f"nobody knows where it is in {follower.gap_count} gaps, {hours:.2f} h in all")
    if follower.implausible:
        metres = follower.top_speed / follower.actor.home.lattice.units_per_m
        lines.append(
            f"{follower.implausible} legs are too fast to be true, up to {metres:.1f} m/s: check"
            " the frame and the times"
        )
    return tuple(lines)


def _head(log: ActivityLog | PositionLog, count: int, noun: str) -> str:
    since = f" from {log.first_day}" if log.first_day else ""
    days = counted(log.days, "day")
    return f"{log.path.name}, layout {log.layout}: {count} {noun} of {days}{since}"


def _rooms(value: object) -> object:
    """Accept a room without a list around it."""
    if isinstance(value, dict):
        return {key: (v,) if isinstance(v, str) else v for key, v in value.items()}
    return value


_NAMES = {"type": "array", "items": {"type": "string"}, "minItems": 1}
_ROOM = {"anyOf": [{"type": "string"}, _NAMES, {"type": "null"}]}
_MAPPING = {"type": "object", "additionalProperties": _ROOM}
RoomMap = Annotated[
    dict[str, tuple[str, ...] | None],
    BeforeValidator(_rooms),
    WithJsonSchema({**_MAPPING, "x-quantity": "mapping of labels to rooms"}),
]


class Replay(Behavior, LogKeys):
    """Follow a person's log: a smart home's events, a script, or positions.

    When the log names a room, the body is in it at that step, having left early enough. In gaps of
    the log nothing is invented: the body is away, and the events `unknown` and `known` mark the
    gap.

    Attributes:
        path: The log, or the folder of a home's logs.
        format: The layout of the log; auto: recognized by its content.
        id: The tag to follow, if a log of positions has several.
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
    """

    always_decides = True
    records = frozenset({EventKind.KNOWN, EventKind.REPLAY, EventKind.UNKNOWN})
    is_recorded = True

    path: InputFileOrFolder
    format: Layout = "auto"
    id: str | None = None
    frame: LogFrame = LogFrame()
    rooms: RoomMap = Field(default={})
    day: Day = 0
    gaps: Literal["unknown", "hold", "walk"] = "unknown"
    gap: PositiveDuration | None = None
    still: Duration = timedelta(hours=12)
    reach: Length = Field(default=1.0, ge=0)

    def files(self) -> tuple[Path, ...]:
        """Return the files that it reads."""
        return files_of(self.path)

    def start(self, actor: Actor) -> None:
        """Read the log, plan the way through it, and report on it in `notes`."""
        self.visits: list[LoggedVisit] = []
        with errors_as(LogError, actor.path, of=LogError):
            log = read_log(
                self.path,
                self.format,
                id=self.id,
                frame=self.frame.name,
                **self.reading(actor.clock),
            )
            log, begin_us, outside_notes = in_run(log, self.day, actor.clock)
            if isinstance(log, ActivityLog):
                self._start_rooms(actor, log, begin_us)
            else:
                self._start_fixes(actor, log, begin_us)
        self.notes += outside_notes

    def decide(self, now: Situation) -> Plan:
        """Follow the log to its end, from the present step.

        After another behavior's turn, the body first walks to its place in the log; in a log of
        positions, it is put there.
        """
        plan = now.plan()
        if now.step == 0:
            for note in self.notes:
                plan.note(EventKind.REPLAY, note)
        if isinstance(self.follower, FixFollower):
            return self.follower.follow(plan)
        begun = [i for i, visit in enumerate(self.visits) if visit.first <= now.step]
        current = max(begun, default=0)
        return self.follower.follow(plan, current, rejoin=now.step > 0)

    def _start_rooms(self, actor: Actor, log: ActivityLog, begin_us: int) -> None:
        mapped = placement.map_rooms(log.rooms, self.rooms, actor.home.rooms)
        clock = actor.clock
        gap_us = units.micros(self.gap or GAP_OF_ROOMS)
        rule = placement.VisitRule(
            step_us=clock.step_us,
            begin_us=begin_us,
            steps=clock.steps,
            gap_us=gap_us,
            still_us=units.micros(self.still),
            unknown=self.gaps == "unknown",
            door_us=gap_us,
        )
        logged = placement.visits_of(log, mapped, rule)
        self.visits = logged.visits
        follower = RoomFollower(actor, self.visits, self.gaps == "walk")
        self.follower: RoomFollower | FixFollower = follower
        # A plan before the run serves for the report on its walks.
        follower.follow(Plan(actor, 0), 0, rejoin=False)
        self.notes = report_rooms(log, mapped, logged, follower)

    def _start_fixes(self, actor: Actor, log: PositionLog, begin_us: int) -> None:
        if self.rooms:
            raise LogError("a log of positions names no rooms: leave out 'rooms'")
        clock = actor.clock
        frame = self.frame.in_unit(log.unit_m)
        time_us = log.time_us - begin_us
        step = time_us // clock.step_us
        # Only the first fix of each step is kept.
        is_first = np.append(True, step[1:] != step[:-1])
        used = is_first & (time_us < clock.steps * clock.step_us)
        fixes = place_fixes(
            actor,
            time_us[used],
            frame.to_plan(log.xy[used]),
            frame.turn_headings(log.heading[used] / (2 * np.pi)),
            self.reach,
        )
        count = int(np.count_nonzero(used))
        if fixes.outside > MAX_OUTSIDE * count:
            raise LogError(
                f"the frame of {self.path} doesn't fit the home: {fixes.outside} of {count} fixes"
                f" are more than {self.reach:g} m outside, by {fixes.beyond_m:.1f} m in the median:"
                " correct 'frame' (scale, origin, rotation_deg, or matches)"
            )
        gap_us = units.micros(self.gap or GAP_OF_FIXES)
        self.follower = FixFollower(actor, fixes, gap_us, self.gaps)
        self.follower.follow(Plan(actor, 0))
        thinned = int(np.count_nonzero(step[1:] == step[:-1]))
        self.notes = report_fixes(log, self.follower, thinned, frame)
