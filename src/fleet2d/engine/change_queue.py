"""Changes of the home during a run: their times and order, and the bodies that they stop.

A queue holds known changes by step: changes by scripts, scheduled doors, doors on the way of a
body, doors that close by themselves, and steps at which people may switch lights. Changes are made
before decisions in a step, so they hold for all bodies in it.
"""

import heapq
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely import LineString

from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import micros
from fleet2d.engine.basis import Basis
from fleet2d.entities.behavior import DARK, Actor, HoursSpan, holds
from fleet2d.entities.body import Track
from fleet2d.entities.decisions import DecidingActor, StandStill
from fleet2d.entities.home_object import Door, door_hint
from fleet2d.errors import ComponentError, PlacementError, ScenarioError, errors_as
from fleet2d.floorplan.home import ALL_ROOMS, Home, HomeChange, lattice_footprint
from fleet2d.floorplan.mesh import Segment
from fleet2d.floorplan.placed_objects import POSTURES, move_object
from fleet2d.floorplan.rooms.room import PRIORITY, usual_type
from fleet2d.floorplan.slow_area import SlowArea
from fleet2d.floorplan.space import grow_shape
from fleet2d.kernels import F64, Breakpoints, rooms_at
from fleet2d.runtime.clock import Sun, midnights
from fleet2d.runtime.events import HOME, Event, EventKind

LYING = POSTURES.index("lie")
NOWHERE = -1


def switch(home: Home, rooms: Sequence[int], step: int, *, is_on: bool) -> list[Event]:
    """Switch the lights of rooms; return an event for each light that changed."""
    kind = EventKind.LIGHT_ON if is_on else EventKind.LIGHT_OFF
    changed = [room for room in rooms if (room in home.unlit) == is_on]
    home.set_lights(changed, is_on=is_on)
    return [Event(step, HOME, kind, home.rooms[room].name) for room in changed]


class PeopleSwitches:
    """The switches of people with `lights`: each is in one room, or asleep or away.

    All lights are off at first. A person who enters a room within the own hours, gets up there, or
    is there when the hours begin, switches the light on; one who leaves or lies down switches it
    off, unless another of these people is there awake. People who hold still, as after a fall,
    switch none.
    """

    def __init__(self, basis: Basis) -> None:
        self._home = basis.home
        self._clock = basis.clock
        self._bodies = basis.bodies
        sun = basis.clock.sun
        self._hours: dict[int, tuple[HoursSpan | Sun, ...]] = {}
        for row, user in enumerate(basis.scenario.users.values()):
            if user.lights:
                hours = (sun if span == DARK and sun else span for span in user.lights)
                self._hours[row] = tuple(hours)
        self._awake_in = dict.fromkeys(self._hours, NOWHERE)
        if self._hours:
            basis.home.set_lights(range(len(basis.home.rooms)), is_on=False)

    def steps(self, row: int, actor: Actor) -> list[int]:
        """Return the steps of a body's new plan at which it may switch a light."""
        if row not in self._hours or not isinstance(actor.motion, Track):
            return []
        first = actor.planned_at
        clock = self._clock
        over_at = actor.plan.over_at
        end = clock.steps if over_at is None else min(over_at, clock.steps)
        runs = self._bodies.runs(row, first, max(end, first + 1))
        rooms = rooms_at(self._home.plan.room_of_place, runs.x, runs.y)
        is_awake = (runs.away == 0) & (runs.posture != LYING)
        changes = np.diff(np.where(is_awake, rooms, NOWHERE)) != 0
        steps = [first, *runs.step[1:][changes].tolist()]
        for span in self._hours[row]:
            begin = span.next_begin(clock.time(first))
            while (step := clock.step_at_or_after(clock.elapsed(begin))) < end:
                steps.append(step)
                begin = span.next_begin(begin)
        return steps

    def switch_lights(self, row: int, actor: Actor, step: int) -> list[Event]:
        """Let a body switch lights where it is at a step; return the events."""
        if isinstance(actor, DecidingActor) and isinstance(actor.order, StandStill):
            return []
        pose = actor.state
        clock = self._clock
        before = self._awake_in[row]
        is_awake = not pose.away and actor.posture_code(step * clock.step_us) != LYING
        room = self._home.plan.room_of_point(pose.x, pose.y)
        now = NOWHERE if room is None or not is_awake else room.index
        self._awake_in[row] = now
        events: list[Event] = []
        if before not in {NOWHERE, *self._awake_in.values()}:
            events += switch(self._home, [before], step, is_on=False)
        hours = self._hours[row]
        time = clock.time(step)
        begins = step > 0 and not holds(hours, clock.time(step - 1))
        if now != NOWHERE and holds(hours, time) and (now != before or begins):
            events += switch(self._home, [now], step, is_on=True)
        return events


def crossings(track: Breakpoints, line: Segment, *, jumps: bool = True) -> list[int]:
    """Return the times [us] at which a track crosses a segment.

    A leg that only touches the line counts once; one along the line doesn't.

    Args:
        track: The motion [lattice units].
        line: The segment from jamb to jamb [lattice units].
        jumps: Whether legs that take no time count.
    """
    x = track.x
    y = track.y
    side = _side_of(line, x, y)
    crosses = (side[:-1] > 0) != (side[1:] > 0)
    if not jumps:
        crosses &= np.diff(track.time) > 0
    times: list[int] = []
    for i in np.flatnonzero(crosses).tolist():
        leg = (int(x[i]), int(y[i])), (int(x[i + 1]), int(y[i + 1]))
        a, b = (_side_of(leg, *jamb) for jamb in line)
        if (a > 0) != (b > 0) or 0 in (a, b):
            near = abs(int(side[i]))
            far = abs(int(side[i + 1]))
            begin = int(track.time[i])
            lasts = int(track.time[i + 1]) - begin
            times.append(begin + lasts * near // max(near + far, 1))
    return times


def _side_of(line: Segment, x: Any, y: Any) -> Any:
    """Return the side of a line on which points are: above 0 on its left; exact for integers."""
    (ax, ay), (bx, by) = line
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


def way_ahead(actor: Actor, now_us: int) -> LineString | None:
    """Return the rest of a body's route [lattice units]; None if it stays where it is."""
    assert isinstance(actor.motion, Track)
    track = actor.motion.breakpoints
    ahead = track.time > now_us
    rest = np.column_stack([track.x[ahead], track.y[ahead]])
    points = np.vstack([actor.state.position, rest])
    return LineString(points) if (points != points[0]).any() else None


# Time from the opening of a door to the moment when a body reaches its line [us].
OPENS_AHEAD_US = 1_000_000
# Time after which a change that a body blocks is tried again [us].
RETRY_US = 1_000_000


class DueChange(NamedTuple):
    """A change that waits for its step.

    Attributes:
        step: The step.
        change: The change; None: the door opens for a body or closes by itself or, without a door,
            the body may switch a light.
        by: The body or thing that causes the change, for the table of events.
        door: Number of that door; else -1.
        opens_for: Row of the body that the door opens for, and the step of its decision: the
            opening is void if the body has replanned since.
        passed_us: The time at which the body passes the line of the door [us].
    """

    step: int
    change: HomeChange | None
    by: str = ""
    door: int = -1
    opens_for: tuple[int, int] | None = None
    passed_us: int = 0


class ChangeQueue:
    """The changes of a run.

    Attributes:
        doors: The doors by number, in the order of the scenario.
        names: Their names.
    """

    def __init__(self, basis: Basis) -> None:
        self.home = basis.home
        self.clock = basis.clock
        self._actors = basis.actors
        objects = basis.scenario.objects
        self.doors = {name: item for name, item in objects.items() if isinstance(item, Door)}
        self.names = list(self.doors)
        self._used_us = [-1] * len(self.names)
        self._switches = PeopleSwitches(basis)
        self._floor = basis.scenario.floorplan.slows
        for number, area in enumerate(self._floor):
            with errors_as(ScenarioError, f"floorplan.slows.{number}", of=PlacementError):
                basis.home.plan.check_area(area.area)
        self.home.slows = tuple(area.on(basis.home.lattice) for area in self._floor)
        # Changes by step; those of one step are made in the order of the queue.
        self._queue: list[tuple[int, int, DueChange]] = []
        self._count = 0
        for name, door in self.doors.items():
            if door.locked:
                self._put(DueChange(0, HomeChange(lock=name), "at first"))
            if not door.open:
                self._put(DueChange(0, HomeChange(shut=name), "at first"))
            self._schedule(name, door)

    def slow(self, areas: Sequence[SlowArea], step: int) -> None:
        """Set the areas that slow robots down, besides those of the floor plan, at a step."""
        lattice = self.home.lattice
        before = self.home.slows
        self.home.slows = tuple(area.on(lattice) for area in (*self._floor, *areas))
        robots = [actor for actor in self._actors if actor.entity.minds_floor]
        for region in {*before} ^ {*self.home.slows}:
            self._stop(step, np.array(region.corners, np.float64), robots)

    def next_due(self) -> int | None:
        """Return the step of the next change; None if there is none."""
        return self._queue[0][0] if self._queue else None

    def ask(self, change: HomeChange, step: int, by: str) -> None:
        """Schedule a change that an algorithm or a script requests.

        Raises:
            ComponentError: The change names something unknown.
        """
        with errors_as(ComponentError, f"{by} requests an impossible change", of=ScenarioError):
            self.check_names(change)
        self._put(DueChange(step, change, by))

    def expect(self, row: int, actor: Actor) -> None:
        """Schedule the doors and lights on the way of a body that has a new plan."""
        plan = (row, actor.planned_at)
        for step in self._switches.steps(row, actor):
            self._put(DueChange(step, None, actor.name, opens_for=plan))
        if not self.names or not actor.entity.opens_doors or not isinstance(actor.motion, Track):
            return
        jumps = not self.home.plan.portals
        for door in range(len(self.names)):
            line = self.home.door_line(door)
            for moment in crossings(actor.motion.breakpoints, line, jumps=jumps):
                opens_at = (moment - OPENS_AHEAD_US) // self.clock.step_us
                step = max(actor.planned_at, opens_at)
                self._put(DueChange(step, None, actor.name, door, plan, moment))

    def make(self, step: int) -> list[Event]:
        """Make all changes that are due at a step; bodies whose way is blocked replan.

        Raises:
            ComponentError: A request of an algorithm or a script is impossible.
        """
        events: list[Event] = []
        while self._queue and self._queue[0][0] <= step:
            due = heapq.heappop(self._queue)[2]
            if due.change is not None:
                events += self._make_change(due, due.change, step)
            elif due.door < 0 and due.opens_for is not None:
                row = due.opens_for[0]
                events += self._switches.switch_lights(row, self._actors[row], step)
            elif due.opens_for is not None:
                events += self._open_for(due, step)
            else:
                events += self._close_unused(due, step)
        return events

    def _make_change(self, due: DueChange, change: HomeChange, step: int) -> list[Event]:
        verb = change.verb
        target = change.target
        if verb == "room":
            room = self.home.plan.room(target)
            self.home.use_room_as(room, usual_type(str(change.type)))
            return [Event(step, HOME, EventKind.ROOM_CHANGED, f"{target}: {change.type}")]
        if verb == "move":
            return self._move(due, change, step)
        if verb == "lights":
            lit = [r.index for r in self.home.rooms if target in (r.name, r.type, ALL_ROOMS)]
            return switch(self.home, lit, step, is_on=change.turn == "on")
        door = self.names.index(target)
        if verb in ("lock", "unlock"):
            locks = verb == "lock"
            self.home.set_lock(door, locked=locks)
            self._stop(step, self._door_shape(door))
            kind = EventKind.LOCKED if locks else EventKind.UNLOCKED
            return [Event(step, target, kind, due.by)]
        is_open = verb == "open"
        if is_open != (door in self.home.shut):
            return []
        return self._turn(door, is_open, due, step)

    def _open_for(self, due: DueChange, step: int) -> list[Event]:
        row, planned_at = due.opens_for or (0, 0)
        if self._actors[row].planned_at != planned_at:
            return []
        door = due.door
        self._use(door, due.passed_us, step)
        if door not in self.home.shut or door in self.home.locked:
            return []
        return self._turn(door, True, due, step)

    def _use(self, door: int, moment_us: int, step: int) -> None:
        """Note at a step that a door is used at a moment, after which it may close by itself."""
        after = self.doors[self.names[door]].closes_after
        if after is not None:
            self._used_us[door] = max(self._used_us[door], moment_us)
            shuts = self.clock.step_at_or_after(moment_us + micros(after))
            self._put(DueChange(max(shuts, step + 1), None, door=door))

    def _close_unused(self, due: DueChange, step: int) -> list[Event]:
        """Shut a door that has not been used for its `closes_after`."""
        door = due.door
        after = self.doors[self.names[door]].closes_after
        if after is None or door in self.home.shut:
            return []
        unused_us = step * self.clock.step_us - self._used_us[door]
        return [] if unused_us < micros(after) else self._turn(door, False, due, step)

    def _turn(self, door: int, is_open: bool, due: DueChange, step: int) -> list[Event]:
        shape = self._door_shape(door)
        if not is_open and self._is_blocked(shape):
            self._retry(due, step)
            return []
        self.home.set_door(door, is_open=is_open)
        self._stop(step, None if is_open else shape)
        if is_open and due.opens_for is None:
            self._use(door, step * self.clock.step_us, step)
        kind = EventKind.OPENED if is_open else EventKind.SHUT
        return [Event(step, self.names[door], kind, due.by)]

    def _move(self, due: DueChange, change: HomeChange, step: int) -> list[Event]:
        plan = self.home.plan
        old = self.home.object(change.target)
        assert change.to is not None
        new = move_object(old, plan.lattice, change.to, change.turn_deg)
        shape = np.asarray(lattice_footprint(plan, new).exterior.coords)
        is_solid = new.blocks != "nothing"
        if is_solid and self._is_blocked(shape):
            self._retry(due, step)
            return []
        self.home.put(new)
        self._stop(step, shape if is_solid else None)
        x, y = change.to
        return [Event(step, HOME, EventKind.MOVED, f"{new.name} to ({x:g}, {y:g})")]

    def _door_shape(self, door: int) -> F64:
        return np.array(self.home.door_line(door), np.float64)

    def _is_blocked(self, shape: F64) -> bool:
        """Return whether a body stands in a shape [lattice units]."""
        units = self.home.lattice.units_per_m
        for actor in self._actors:
            if not actor.state.away:
                zone = grow_shape(shape, actor.entity.radius * units)
                if shapely.intersects_xy(zone, actor.state.x, actor.state.y):
                    return True
        return False

    def _stop(self, step: int, shape: F64 | None, actors: Sequence[Actor] | None = None) -> None:
        """Make bodies replan if their way is blocked or they walk at random along walls."""
        units = self.home.lattice.units_per_m
        for actor in self._actors if actors is None else actors:
            if not isinstance(actor.motion, Track):
                actor.ask(step)
            elif shape is not None and not self._passes(actor, shape):
                zone = grow_shape(shape, actor.entity.radius * units)
                way = way_ahead(actor, step * self.clock.step_us)
                if way is not None and way.intersects(zone):
                    actor.ask(step)

    def _passes(self, actor: Actor, shape: F64) -> bool:
        """Return whether a shape is a door that the body opens."""
        if not actor.entity.opens_doors or len(shape) > 2:
            return False
        door = next(d for d in range(len(self.names)) if np.array_equal(self._door_shape(d), shape))
        return door not in self.home.locked

    def _put(self, due: DueChange) -> None:
        heapq.heappush(self._queue, (due.step, self._count, due))
        self._count += 1

    def _retry(self, due: DueChange, step: int) -> None:
        wait = max(1, self.clock.step_at_or_after(RETRY_US))
        self._put(due._replace(step=step + wait))

    def _schedule(self, name: str, door: Door) -> None:
        """Put the schedule of a door into the queue, for all days of the run."""
        clock = self.clock
        for midnight in midnights(clock.start, clock.time(clock.steps)):
            for turn in door.schedule:
                moment = midnight + turn.at
                if moment < clock.start:
                    continue
                step = clock.step_at_or_after(clock.elapsed(moment))
                opens = {True: "open", False: "shut", None: ""}[turn.open]
                locks = {True: "lock", False: "unlock", None: ""}[turn.locked]
                for verb in filter(None, (opens, locks)):
                    change = HomeChange.model_validate({verb: name})
                    self._put(DueChange(step, change, "schedule"))

    def check_names(self, change: HomeChange) -> None:
        """Refuse a change of something unknown.

        Raises:
            ScenarioError: There is no such thing; the message lists all names.
        """
        noun = "door"
        names = self.names
        rooms = self.home.rooms
        if change.verb == "room":
            noun = "room"
            names = [room.name for room in rooms]
        elif change.verb == "lights":
            kinds = dict.fromkeys(room.type for room in rooms)
            noun = "room"
            names = [*(room.name for room in rooms), *kinds, ALL_ROOMS]
        elif change.verb == "move":
            noun = "object in the floor plan"
            names = [item.name for item in self.home.objects]
        if change.target not in names:
            hint = door_hint(self.home.plan, change.target) if noun == "door" else ""
            raise ScenarioError(
                f"there is no {noun} {change.target!r}{suggest(change.target, names)}{hint}"
            )
        if change.verb == "move":
            self._check_move(change)
        types = dict.fromkeys([*PRIORITY, *(room.type for room in rooms)])
        if change.type is not None and usual_type(change.type) not in types:
            raise ScenarioError(
                f"there is no room type {change.type!r}{suggest(change.type, types)}"
            )

    def _check_move(self, change: HomeChange) -> None:
        plan = self.home.plan
        old = self.home.object(change.target)
        assert change.to is not None
        with errors_as(ScenarioError, of=(PlacementError, OverflowError)):
            new = move_object(old, plan.lattice, change.to, change.turn_deg)
        free = shapely.MultiPolygon(plan.polygons)
        footprint = lattice_footprint(plan, new)
        if shapely.intersection(free, footprint).area == 0:
            x, y = change.to
            raise ScenarioError(
                f"({x:g}, {y:g}) m is not in the home: {old.name} can't stand there"
            )
