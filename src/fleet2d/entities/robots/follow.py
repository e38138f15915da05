"""Follow and come: stay behind a person in view, or drive to the one who called."""

from datetime import timedelta

import numpy as np
from pydantic import Field

from fleet2d.configuration.units import Duration, Length, PositiveDuration
from fleet2d.entities.behavior import Actor, Behavior, Command, Situation
from fleet2d.entities.place import avoided_rooms, lies_in, stop_at
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import approach, centres, check_has_camera, is_in_rooms
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.runtime.events import EventKind

# The robot looks for a lost person from this distance of the last position [m].
SEARCH_DISTANCE_M = 0.3
# A person who moves no farther than this between two looks rests, and the interval doubles [m].
STILL_M = 0.3
MAX_INTERVAL = timedelta(seconds=32)

# Outside of a forbidden room, it waits this far off, so that others can pass the door [m].
OFF_DOOR_M = 0.8


class Follow(Behavior):
    """Follow a person at a distance for as long as the cameras have the person in view.

    Every `update` the robot looks where the person is, and drives there by the shortest path; while
    the person rests, the interval doubles each time, up to 32 s. It looks for a lost person where
    it perceived them last: it drives there and turns once. After that, later behaviors decide until
    the person comes into view again. Events: `follows`, `lost`, with the person's name.

    Attributes:
        user: The user to follow; left out: the first in view.
        distance: Distance to the person [m].
        update: Time between two looks at the person.
        longest: The longest time to follow; 0: without end.
        no_stops_in: Rooms, or kinds of rooms if the home has them, into which to follow nobody.
    """

    records = frozenset({EventKind.FOLLOWS, EventKind.LOST})
    listens = frozenset({EventKind.USER_SEEN})

    user: str = Field(default="", min_length=0)
    distance: Length = Field(default=1.5, ge=0.3, le=10)
    update: PositiveDuration = timedelta(seconds=2)
    longest: Duration = timedelta(0)
    no_stops_in: tuple[str, ...] = ()

    def about(self) -> tuple[str, ...]:
        """Return the user to follow, if given by name."""
        return (self.user,) if self.user else ()

    def start(self, actor: Actor) -> None:
        """Check that it has a camera."""
        check_has_camera(actor, "follow")
        self.avoided = avoided_rooms(actor, "follow.no_stops_in", self.no_stops_in)
        self.person: str | None = None  # the person followed now
        self.last = (0.0, 0.0)  # last perceived position of the person [m]
        self.pause = self.update
        self.since = actor.clock.start
        self.is_searching = False

    def busy(self) -> bool:
        """Return whether the robot follows or looks for a person."""
        return self.person is not None

    def dismiss(self) -> None:
        """Let the person go, and follow again when somebody comes into view."""
        self.person = None
        self.is_searching = False

    def decide(self, now: Situation) -> Plan | None:
        """Follow the person, look where the person was lost, or leave it to later behaviors."""
        in_view = now.in_view
        if self.person is None:
            wanted = [name for name in in_view if self.user in ("", name)]
            self.person = min(wanted, default=None)
            if self.person is None:
                return None
            self.since = now.time
            return self._follow(now, now.plan().note(EventKind.FOLLOWS, self.person))
        if self.longest and now.time - self.since >= self.longest:
            self.person = None
            return None
        if self.person in in_view:
            return self._follow(now, now.plan())
        if self.is_searching:  # a look round at the last position had no success
            self.person = None
            self.is_searching = False
            return None
        self.is_searching = True
        plan = now.plan().note(EventKind.LOST, self.person).interrupt_on(EventKind.USER_SEEN)
        if not is_in_rooms(now, *self.last, self.avoided):
            approach(now, plan, *self.last, SEARCH_DISTANCE_M)
        return plan.turn_by(1.0)

    def _follow(self, now: Situation, plan: Plan) -> Plan:
        self.is_searching = False
        x, y = now.in_view[self.person or ""]
        old_x, old_y = self.last
        is_resting = (x - old_x) ** 2 + (y - old_y) ** 2 <= STILL_M**2
        longest = max(MAX_INTERVAL, self.update)
        self.pause = min(2 * self.pause, longest) if is_resting else self.update
        self.last = x, y
        if not is_in_rooms(now, x, y, self.avoided):
            approach(now, plan, x, y, self.distance)
        plan.face_place((x, y))
        until = now.time + self.pause
        if self.longest:
            until = min(until, self.since + self.longest)
        # On a long way, it looks again before the end, as the person may walk on.
        return plan.interrupt_on(EventKind.USER_LOST).stay(until=until).ask_by(until)


class Come(Behavior):
    """Go to the place of a call, and wait there for a while.

    This behavior only acts on an intervention `call` with a place. In a room the robot stops at the
    point farthest from the walls. If a shut door is in the way, it waits and tries again. Event:
    `visits`, with the place.

    Attributes:
        stay: Time of waiting there.
        no_stops_in: Rooms, or kinds of rooms if the home has them, not to enter: called into one of
            them, it waits outside, near the door.
    """

    records = frozenset({EventKind.VISITS})
    answers = frozenset({"come"})
    resumes = True

    stay: Duration = timedelta(minutes=10)
    no_stops_in: tuple[str, ...] = ()

    def start(self, actor: Actor) -> None:
        """Start without a command."""
        self.avoided = avoided_rooms(actor, "come.no_stops_in", self.no_stops_in)
        self.command: Command | None = None

    def busy(self) -> bool:
        """Return whether the robot is on its way."""
        return self.command is not None

    def dismiss(self) -> None:
        """Give up the call."""
        self.command = None

    def decide(self, now: Situation) -> Plan | None:
        """Go to the place of a call, if there is one."""
        command = self.command = now.take_command("come") or self.command
        if command is None:
            return None
        goal = self._outside(now.actor, stop_at(now.actor, command.place))
        _, _, place = command.text.partition(" ")
        plan = now.plan().go_to_point(*goal).note(EventKind.VISITS, place)
        self.command = None
        return plan.stay(self.stay)

    def _outside(self, actor: Actor, goal: LatticePoint) -> LatticePoint:
        """Return a goal, or the place to wait at if the goal is in a room not to enter."""
        if not lies_in(actor, goal, self.avoided):
            return goal
        space = actor.space_without(self.avoided)
        cells = centres(space.cells(None, space.part_near(*actor.state.position)))
        metres = actor.space.distances(goal, cells)
        if not np.isfinite(metres).any():
            return goal  # a shut door leaves no way at present
        off_m = np.abs(metres - metres.min() - OFF_DOOR_M)
        x, y = cells[off_m.argmin()].tolist()
        return x, y
