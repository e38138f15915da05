"""Follow: stay behind a person in view, and look for a person who was lost."""

from datetime import timedelta
from typing import ClassVar

from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.configuration.units import Duration, Length, PositiveDuration
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.place import avoided_rooms
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import (
    approach,
    check_has_camera,
    is_in_rooms,
)

# Distance from where a person was lost at which it looks for the person [m].
SEARCH_DISTANCE_M = 0.3
# A person who moves no farther than this between two looks rests: the interval doubles [m].
STILL_M = 0.3
MAX_INTERVAL = timedelta(seconds=32)


@register("behavior", "follow")
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
        avoid: Rooms, or kinds of rooms if the home has them, into which it follows nobody.
    """

    records: ClassVar[frozenset[str]] = frozenset({"follows", "lost"})
    listens: ClassVar[frozenset[str]] = frozenset({"user_seen"})

    user: str = Field(default="", min_length=0)
    distance: Length = Field(default=1.5, ge=0.3, le=10)
    update: PositiveDuration = timedelta(seconds=2)
    longest: Duration = timedelta(0)
    avoid: tuple[str, ...] = ()

    def about(self) -> tuple[str, ...]:
        """Return the user that it follows, if it is one by name."""
        return (self.user,) if self.user else ()

    def start(self, actor: Actor) -> None:
        """Check that it has a camera."""
        check_has_camera(actor, "follow")
        self.avoided = avoided_rooms(actor, "follow.avoid", self.avoid)
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
        self.person, self.is_searching = None, False

    def decide(self, now: Situation) -> Plan | None:
        """Follow the person, look where the person was lost, or leave it to later behaviors."""
        in_view = now.in_view
        if self.person is None:
            self.person = self._person_in_view(now)
            if self.person is None:
                return None
            self.since = now.time
            return self._follow(now, now.plan().note("follows", self.person))
        if self.longest and now.time - self.since >= self.longest:
            self.person = None
            return None
        if self.person in in_view:
            return self._follow(now, now.plan())
        if self.is_searching:  # it has looked round where the person was last, without success
            self.person, self.is_searching = None, False
            return None
        self.is_searching = True
        plan = now.plan().note("lost", self.person).interrupt_on("user_seen")
        if not is_in_rooms(now, *self.last, self.avoided):
            approach(now, plan, *self.last, SEARCH_DISTANCE_M)
        return plan.turn_by(1.0)

    def _person_in_view(self, now: Situation) -> str | None:
        names = sorted(now.in_view)
        if self.user:
            return self.user if self.user in names else None
        return names[0] if names else None

    def _follow(self, now: Situation, plan: Plan) -> Plan:
        self.is_searching = False
        (x, y), (old_x, old_y) = now.in_view[self.person or ""], self.last
        is_resting = (x - old_x) ** 2 + (y - old_y) ** 2 <= STILL_M**2
        longest = max(MAX_INTERVAL, self.update)
        self.pause = min(2 * self.pause, longest) if is_resting else self.update
        self.last = x, y
        if not is_in_rooms(now, x, y, self.avoided):
            approach(now, plan, x, y, self.distance)
        plan.face(*now.home.plan.lattice.point_at((x, y)))
        until = now.time + self.pause
        if self.longest:
            until = min(until, self.since + self.longest)
        # It looks again before the end of a long way, as the person may walk on.
        return plan.interrupt_on("user_lost").stay(until=until).ask_by(until)
