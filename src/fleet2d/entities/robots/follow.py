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

# Distance from where a person was lost at which it looks for the person [m].
SEARCH_DISTANCE_M = 0.3
# A person who moves no farther than this between two looks rests: the interval doubles [m].
STILL_M = 0.3
MAX_INTERVAL = timedelta(seconds=32)

# How far from a room that it doesn't enter it waits, so that others can pass the door [m].
OFF_DOOR_M = 0.8


class Follow(Behavior):
    """Follow a person at a distance for as long as the cameras have the person in view.

    Every `update` it looks where the person is, and drives there by the shortest path; while the
    person rests, the interval doubles each time, up to 32 s. It looks for a person whom it lost
    where the person was perceived last: it drives there and turns once. After that, later behaviors
    decide until the person comes into view again. Events: `follows`, `lost`, with the person's
    name.

    Attributes:
        user: User that it follows; left out: the first in view.
        distance: How far behind it stays [m].
        update: How often it looks where the person is.
        longest: For how long it follows at most; 0: without end.
        no_stops_in: Rooms, or kinds of rooms if the home has them, into which it follows nobody.
    """

    records = frozenset({EventKind.FOLLOWS, EventKind.LOST})
    listens = frozenset({EventKind.USER_SEEN})

    user: str = Field(default="", min_length=0)
    distance: Length = Field(default=1.5, ge=0.3, le=10)
    update: PositiveDuration = timedelta(seconds=2)
    longest: Duration = timedelta(0)
    no_stops_in: tuple[str, ...] = ()

    def about(self) -> tuple[str, ...]:
        """Return the user that it follows, if it is one by name."""
        return (self.user,) if self.user else ()

    def start(self, actor: Actor) -> None:
        """Check that it has a camera."""
        check_has_camera(actor, "follow")
        self.avoided = avoided_rooms(actor, "follow.no_stops_in", self.no_stops_in)
        self.person: str | None = None  # the one that it follows now
        self.last = (0.0, 0.0)  # where the person was perceived last [m]
        self.pause = self.update
        self.since = actor.clock.start
        self.is_searching = False

    def busy(self) -> bool:
        """Return whether it follows or looks for a person."""
        return self.person is not None

    def dismiss(self) -> None:
        """Let the person go; it follows again when somebody comes into view."""
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
        if self.is_searching:  # it has looked round where the person was last, without success
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
        # It looks again before the end of a long way, as the person may walk on.
        return plan.interrupt_on(EventKind.USER_LOST).stay(until=until).ask_by(until)


class Come(Behavior):
    """Go where the robot is called to, and wait there for a while.

    It only acts on an intervention `call` with a place. In a room it stops at the point farthest
    from the walls. If a shut door is in the way, it waits and tries again. Event: `visits`, with
    the place.

    Attributes:
        stay: How long it waits there.
        no_stops_in: Rooms, or kinds of rooms if the home has them, that it doesn't enter: called
            into one of them, it waits outside, near the door.
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
        """Return whether it is on its way."""
        return self.command is not None

    def dismiss(self) -> None:
        """Stay away from where it was called to."""
        self.command = None

    def decide(self, now: Situation) -> Plan | None:
        """Go where it is called to, if it is."""
        command = self.command = now.take_command("come") or self.command
        if command is None:
            return None
        goal = self._outside(now.actor, stop_at(now.actor, command.place))
        _, _, place = command.text.partition(" ")
        plan = now.plan().go_to_point(*goal).note(EventKind.VISITS, place)
        self.command = None
        return plan.stay(self.stay)

    def _outside(self, actor: Actor, goal: LatticePoint) -> LatticePoint:
        """Return a goal, or where the robot waits for it if that is in a room it doesn't enter."""
        if not lies_in(actor, goal, self.avoided):
            return goal
        space = actor.space_without(self.avoided)
        cells = centres(space.cells(None, space.part_near(*actor.state.position)))
        metres = actor.space.distances(goal, cells)
        if not np.isfinite(metres).any():
            return goal  # behind a shut door: there is no way at present
        off_m = np.abs(metres - metres.min() - OFF_DOOR_M)
        x, y = cells[off_m.argmin()].tolist()
        return x, y
