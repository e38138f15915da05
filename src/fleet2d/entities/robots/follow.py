"""Follow: stay behind somebody who is in view, and look for who was lost."""

from datetime import timedelta
from typing import TYPE_CHECKING, ClassVar

from pydantic import Field

from fleet2d.component import register
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import approach, check_has_camera, face
from fleet2d.units import Duration, Length, PositiveDuration

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor

# Who was lost is looked for from as near as this to where that was [m].
SOUGHT_FROM = 0.3
# Of who was perceived no farther than this from the last time [m] it looks ever more seldom.
STILL = 0.3
SELDOM = timedelta(seconds=32)


@register("behavior", "follow")
class Follow(Behavior):
    """Follow a person at a distance for as long as the cameras have the person in view.

    It looks up where the person is every `update`, and drives there by the shortest path; while
    the person rests, at twice the interval each time, up to 32 s. Who is lost is looked for where
    the person was perceived last: it drives there and turns round once; then the robot is left to
    the behaviors behind, until the person comes into view again. Events: `follows`, `lost`, with
    the person's name.
    """

    records: ClassVar[frozenset[str]] = frozenset({"follows", "lost"})
    listens: ClassVar[frozenset[str]] = frozenset({"user_seen"})

    user: str = Field(
        default="", min_length=0, description="whom it follows; left out: who is seen first"
    )
    distance: Length = Field(default=1.5, ge=0.3, le=10, description="how far behind it stays [m]")
    update: PositiveDuration = Field(
        default=timedelta(seconds=2), description="how often it looks where the person is"
    )
    longest: Duration = Field(
        default=timedelta(0), description="for how long it follows at most; 0: without end"
    )

    def about(self) -> tuple[str, ...]:
        """Return whom it follows."""
        return (self.user,) if self.user else ()

    def start(self, actor: "Actor") -> None:
        """Check that it sees anybody."""
        check_has_camera(actor, "follow")
        self.whom: str | None = None
        self.last = (0.0, 0.0)  # where the person was perceived last [m]
        self.pause = self.update
        self.since = actor.clock.start
        self.searching = False

    def busy(self) -> bool:
        """Tell whether it is after somebody."""
        return self.whom is not None

    def decide(self, now: Situation) -> Plan | None:
        """Go on after the person, look where the person was lost, or leave it to others."""
        in_view = now.in_view
        if self.whom is None:
            self.whom = self._somebody(now)
            if self.whom is None:
                return None
            self.since = now.time
            return self._follow(now, now.plan().note("follows", self.whom))
        if self.longest and now.time - self.since >= self.longest:
            self.whom = None
            return None
        if self.whom in in_view:
            return self._follow(now, now.plan())
        if self.searching:  # it has turned round where the person was last, in vain
            self.whom, self.searching = None, False
            return None
        self.searching = True
        plan = now.plan().note("lost", self.whom).interrupt_on("user_seen")
        approach(now, plan, *self.last, SOUGHT_FROM)
        return plan.turn_by(1.0)

    def _somebody(self, now: Situation) -> str | None:
        names = sorted(now.in_view)
        if self.user:
            return self.user if self.user in names else None
        return names[0] if names else None

    def _follow(self, now: Situation, plan: Plan) -> Plan:
        self.searching = False
        (x, y), (old_x, old_y) = now.in_view[self.whom or ""], self.last
        rests = (x - old_x) ** 2 + (y - old_y) ** 2 <= STILL**2
        self.pause = min(2 * self.pause, max(SELDOM, self.update)) if rests else self.update
        self.last = x, y
        approach(now, plan, x, y, self.distance)
        face(plan, *now.home.plan.lattice.point_at((x, y)))
        until = now.time + self.pause
        if self.longest:
            until = min(until, self.since + self.longest)
        # A long way is looked at again before its end: the person goes on.
        return plan.interrupt_on("user_lost").stay(until=until).ask_by(until)
