"""Rounds of a robot through rooms, along waypoints or a recorded path, and visits at set times."""

import math
from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from itertools import islice
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import Duration, InputPath, Length, OnDays, TimeOfDay, weekdays_of
from fleet2d.entities.behavior import DOOR_WAIT, Actor, Behavior, Situation
from fleet2d.entities.place import (
    Nearest,
    Place,
    Point,
    available_places,
    avoided_rooms,
    furniture_of,
    is_point,
    lies_in,
    stop_at,
    stops_at,
)
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import stops_with_view, unwatched
from fleet2d.errors import FloorPlanError, PlacementError
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.floorplan.load import source_of
from fleet2d.floorplan.plan import Room
from fleet2d.kernels import I64
from fleet2d.runtime.clock import DAY, midnight_of
from fleet2d.runtime.events import EventKind

SPACING_M = 0.1  # nearer points of a retraced path are left out
MAX_NAMED = 6  # most rooms that a note names


class Patrol(Behavior):
    """Make rounds: go to each room or waypoint in turn, look around, stay a while, go on.

    In a room the robot stops at the point farthest from its walls, or where it sees the room's
    places. Stops behind a shut door are left out of a round.

    Attributes:
        rooms: The rooms of a round; all: every room that the robot can enter.
        waypoints: Points [x, y] in metres to go to instead of rooms.
        dwell: Time at each stop.
        order: Stops in the order given, or reshuffled for each round.
        look_around: Turn once on the spot on arriving at a stop.
        no_stops_in: Rooms, or kinds of rooms if the home has them, without stops.
        stop_at: The stops in a room that a round names: its middle, or up to four points with a
            view of all places at the room's furniture (without any, 95 % of the floor).
    """

    always_decides = True
    resumes = True

    rooms: Literal["all"] | tuple[Place, ...] = "all"
    waypoints: tuple[Point, ...] = ()
    dwell: Duration = timedelta(minutes=5)
    order: Literal["fixed", "random"] = "fixed"
    look_around: bool = True
    no_stops_in: tuple[str, ...] = ()
    stop_at: Literal["middle", "view"] = "middle"

    def model_post_init(self, _: object, /) -> None:
        """Require rooms or waypoints, not both."""
        if self.waypoints and self.rooms != "all":
            raise problem("rooms and waypoints are both given: keep one of them")
        if not self.waypoints and not self.rooms:
            raise problem("there is nowhere to go: name rooms, or waypoints, or leave out 'rooms'")

    def start(self, actor: Actor) -> None:
        """Find the stops, and note the places that are never in view from them."""
        if self.waypoints:
            stops = [actor.point(point) for point in self.waypoints]
        elif self.rooms == "all":
            rooms = actor.reachable_rooms()
            stops = [stop for room in rooms for stop in self._stops_in(actor, room)]
        else:
            places = available_places(actor, "patrol.rooms", self.rooms)
            stops = [stop for place in places for stop in self._stops_at(actor, place)]
        if self.no_stops_in or (actor.rules is not None and actor.rules.no_stops):
            avoided = avoided_rooms(actor, "patrol.no_stops_in", self.no_stops_in)
            stops = [stop for stop in stops if not lies_in(actor, stop, avoided)]
        self.stops = stops if self.waypoints else list(dict.fromkeys(stops))
        only_patrols = all(isinstance(each, Patrol) for each in actor.behaviors)
        sees = actor.entity.eyes and self.look_around and only_patrols
        if sees and (hidden := unwatched(actor, self.stops)):
            more = f", and {len(hidden) - MAX_NAMED} more" if len(hidden) > MAX_NAMED else ""
            hint = "" if self.stop_at == "view" else "; stop_at: view stops where it sees them"
            actor.notes.append(
                f"patrol: people there are never in view from its {len(self.stops)} stops:"
                f" {', '.join(hidden[:MAX_NAMED])}{more}{hint}"
            )

    def _stops_at(self, actor: Actor, place: Place) -> list[LatticePoint]:
        if self.stop_at == "middle" or is_point(place) or furniture_of(actor, place) is not None:
            return stops_at(actor, place)
        rooms = actor.rooms(place)  # type: ignore[arg-type]
        return [stop for room in rooms for stop in self._stops_in(actor, room)]

    def _stops_in(self, actor: Actor, room: Room) -> Sequence[LatticePoint]:
        return stops_with_view(actor, room) if self.stop_at == "view" else [actor.middle(room)]

    def decide(self, now: Situation) -> Plan:
        """Plan one round."""
        stops = self.stops
        if self.order == "random":
            stops = now.random("order").shuffled(stops)
        plan = now.plan()
        turns = 1.0 if self.look_around else 0.0
        if not now.actor.may_block_routes:
            return plan.visit(stops, turns, self.dwell) if stops else plan.stay(self.dwell)
        # In a later round, a door may be open again, or costs lower.
        reached = [stop for stop in stops if self._visits(plan, stop, turns)]
        return plan if reached else plan.stay(self.dwell)

    def _visits(self, plan: Plan, stop: LatticePoint, turns: float) -> bool:
        """Visit a stop, if there is a way to it."""
        if not plan.reaches(*stop):
            return False
        plan.visit([stop], turns, self.dwell)
        return True


class ScheduledVisit(Settings):
    """A visit: its time, place and duration.

    Attributes:
        at: Time of day at which the robot sets out.
        place: The destination: a room, a kind of room, or a point.
        dwell: Time of staying there.
        on: The days of the visit.
        look_around: Turn once on the spot on arriving.
        task: The task there, for the events table.
    """

    at: TimeOfDay
    place: Place
    dwell: Duration = timedelta(minutes=10)
    on: OnDays = "daily"
    look_around: bool = True
    task: str = ""


class Scheduled(Behavior):
    """Visit rooms at fixed times of the day; between visits, later behaviors decide.

    A visit interrupts them when it is due. If `preempts` is false, a visit is made once they have
    no plan, no later than `late` after its time; a visit behind a shut door, once the door is open.
    In a room the robot stops at the point farthest from its walls. Events: `visits`, with the task,
    else the room, and `way_blocked`, with the room.

    Attributes:
        visits: The visits.
        late: A visit that can't begin within this time is left out.
        no_stops_in: Rooms, or kinds of rooms if the home has them, not to visit: visits there are
            left out, with a note.
    """

    records = frozenset({EventKind.VISITS, EventKind.WAY_BLOCKED})

    visits: tuple[ScheduledVisit, ...] = Field(min_length=1)
    late: Duration = timedelta(minutes=30)
    no_stops_in: tuple[str, ...] = ()

    def start(self, actor: Actor) -> None:
        """Find the stops."""
        self.stops = [stop_at(actor, visit.place) for visit in self.visits]
        avoided = avoided_rooms(actor, "scheduled.no_stops_in", self.no_stops_in)
        stops = enumerate(self.stops)
        self.left_out = {number for number, stop in stops if lies_in(actor, stop, avoided)}
        if self.left_out:
            names = sorted({self._room_name(actor, number) for number in self.left_out})
            actor.notes.append(
                f"scheduled.visits: left out, because of `no_stops_in`: those of {', '.join(names)}"
            )
        self.last_decision = actor.clock.start - timedelta(microseconds=1)
        self.pending: list[tuple[datetime, int]] = []  # due time and number of visits to make

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return the time at which the next visit is due, or a shut door is tried again."""
        visits = self._due(max(self.last_decision, now.time))
        times = [due for due, _ in islice(visits, 1)]
        if self.pending:
            times.append(now.time + DOOR_WAIT)
        return min(times, default=None)

    def decide(self, now: Situation) -> Plan | None:
        """Make a visit that is due, or leave the decision to later behaviors."""
        fresh = [visit for visit in self._due(self.last_decision) if visit[0] <= now.time]
        self.last_decision = now.time
        visits = self.pending + fresh
        self.pending = [visit for visit in visits if now.time - visit[0] <= self.late]
        for due, number in self.pending:
            if not now.actor.may_block_routes or now.plan().reaches(*self.stops[number]):
                self.pending.remove((due, number))
                return self._visit(now, number)
        blocked = [number for due, number in self.pending if (due, number) in fresh]
        if blocked:
            name = self._room_name(now.actor, blocked[0])
            return now.plan().note(EventKind.WAY_BLOCKED, name).stay(DOOR_WAIT)
        return None

    def _visit(self, now: Situation, number: int) -> Plan:
        visit = self.visits[number]
        name = visit.task or self._room_name(now.actor, number)
        plan = now.plan().go_to_point(*self.stops[number]).note(EventKind.VISITS, name)
        if visit.look_around:
            plan.turn_by(1.0)
        return plan.stay(visit.dwell)

    def _room_name(self, actor: Actor, number: int) -> str:
        """Return the name of the room of a visit; empty for a point between two rooms."""
        room = actor.home.plan.room_of_point(*self.stops[number])
        return room.name if room else ""

    def _due(self, since: datetime) -> Iterator[tuple[datetime, int]]:
        """Yield time and number of the visits due within eight days after a moment, in order."""
        midnight = midnight_of(since)
        for ahead in range(9):
            day = midnight + ahead * DAY
            today = [
                (day + visit.at, number)
                for number, visit in enumerate(self.visits)
                if number not in self.left_out and day.weekday() in weekdays_of(visit.on)
            ]
            for entry in sorted(today):
                if entry[0] > since:
                    yield entry


class Retrace(Behavior):
    """Drive the path in the map of a Valetudo robot, in the home of that map, at the robot's speed.

    The map has no times; for a log with times use the behavior `replay`. Points nearer to each
    other than 0.1 m are thinned out. A point that the body can't reach is replaced by the nearest
    reachable one, if that is within `reach`. At the end of the path the robot starts again, after
    `cooldown`. Events: `retraces`, with the number of points, and `retraced`.

    Attributes:
        path: The map's JSON file.
        reach: A point farther than this from free space is left out [m].
        no_stops_in: Rooms, or kinds of rooms if the home has them, whose part of the path is
            left out.
    """

    always_decides = True
    records = frozenset({EventKind.RETRACED, EventKind.RETRACES})
    resumes = True

    path: InputPath
    reach: Length = Field(default=1.0, ge=0)
    no_stops_in: tuple[str, ...] = ()

    def files(self) -> tuple[Path, ...]:
        """Return the files that it reads."""
        return (self.path,)

    def start(self, actor: Actor) -> None:
        """Read the path and move its points to free places.

        Raises:
            PlacementError: The map has no path, or none that the robot can drive here.
        """
        try:
            pieces = source_of("valetudo", path=self.path).driven_ways()
        except FloorPlanError as error:
            raise PlacementError(
                f"{actor.path}: {error}; it retraces the map of a Valetudo robot, and a log of"
                " positions with times is for the behavior 'replay'"
            ) from error
        if not pieces:
            raise PlacementError(f"{actor.path}: {self.path} holds no path to retrace")
        lattice = actor.home.lattice
        points: I64 = lattice.to_lattice(np.concatenate(pieces))
        near: I64 = Nearest(actor).of(points)
        squared_moves = ((near - points) ** 2).sum(axis=1)
        reachable = near[squared_moves <= (self.reach * lattice.units_per_m) ** 2]
        avoided = avoided_rooms(actor, "retrace.no_stops_in", self.no_stops_in)
        points_left = _thin_out(reachable, SPACING_M * lattice.units_per_m)
        self.points = [p for p in points_left if not lies_in(actor, p, avoided)]
        if len(self.points) < 2:
            raise PlacementError(
                f"{actor.path}: of the path in {self.path}, {len(self.points)} points are within"
                f" {self.reach:g} m of where the robot can be and goes: is this the home of that"
                " map?"
            )

    def decide(self, now: Situation) -> Plan:
        """Drive the whole path."""
        plan = now.plan().note(EventKind.RETRACES, f"{len(self.points)} points")
        for x, y in self.points:
            if not now.actor.may_block_routes or plan.reaches(x, y):
                plan.go_to_point(x, y)
        return plan.note(EventKind.RETRACED)


def _thin_out(points: I64, spacing: float) -> list[LatticePoint]:
    """Return points in order, each farther than `spacing` from the one before [lattice]."""
    path: list[LatticePoint] = []
    for x, y in points.tolist():
        last_x, last_y = path[-1] if path else (math.inf, math.inf)
        if (x - last_x) ** 2 + (y - last_y) ** 2 > spacing * spacing:
            path.append((x, y))
    return path
