"""Opportunistic: when somebody comes into view, go there and interact for a while."""

from datetime import datetime, timedelta
from typing import TYPE_CHECKING, ClassVar

from pydantic import Field

from fleet2d.component import register
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import approach, check_has_camera, face
from fleet2d.units import Duration, Length, Share

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor


@register("behavior", "opportunistic")
class Opportunistic(Behavior):
    """Approach who comes into view, interact for a while, and leave the robot to others again.

    What is broken off for it goes on afterwards. It approaches where the person was perceived; a
    person who walks on in the meantime isn't followed. Events: `approaches`, `interacts`, with the
    name of the person as perceived, and `interaction_over`.
    """

    records: ClassVar[frozenset[str]] = frozenset({"approaches", "interaction_over", "interacts"})
    listens: ClassVar[frozenset[str]] = frozenset({"user_seen"})

    users: tuple[str, ...] = Field(
        default=(), description="whom it approaches; left out: everybody, recognized or not"
    )
    distance: Length = Field(
        default=1.2, ge=0.3, le=10, description="how near it comes: 1.2 m ends personal space [m]"
    )
    interaction: Duration = Field(default=timedelta(minutes=1), description="how long it interacts")
    chance: Share = Field(
        default=1.0, description="probability that it takes an opportunity; else that one is missed"
    )
    again: Duration = Field(
        default=timedelta(minutes=15), description="how long it leaves the same person alone"
    )

    def about(self) -> tuple[str, ...]:
        """Return whom it approaches."""
        return self.users

    def start(self, actor: "Actor") -> None:
        """Check that it sees anybody."""
        check_has_camera(actor, "opportunistic")
        self.met: dict[str, datetime] = {}  # when it had an opportunity with each person last

    def decide(self, now: Situation) -> Plan | None:
        """Approach somebody in view, or leave the robot to the behaviors behind."""
        for name, (x, y) in sorted(now.in_view.items()):
            if not self._wants(name, now):
                continue
            self.met[name] = now.time
            if now.random(f"chance {name}").uniform() < self.chance:
                return self._approach(now, name, x, y)
        return None

    def _wants(self, name: str, now: Situation) -> bool:
        if self.users and name not in self.users:
            return False
        return name not in self.met or now.time - self.met[name] >= self.again

    def _approach(self, now: Situation, name: str, x: float, y: float) -> Plan:
        plan = now.plan().note("approaches", name)
        approach(now, plan, x, y, self.distance)
        face(plan, *now.home.plan.lattice.point_at((x, y)))
        plan.note("interacts", name).stay(self.interaction)
        return plan.note("interaction_over", name)
