"""Opportunistic: approach people who come into view, and interact for a while."""

from datetime import datetime, timedelta
from typing import ClassVar

from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.configuration.units import Duration, Length, Share
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.place import avoided_rooms
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import (
    approach,
    check_has_camera,
    is_in_rooms,
)
from fleet2d.interactions.interaction import Request


@register("behavior", "opportunistic")
class Opportunistic(Behavior):
    """Approach a person who comes into view, and interact for a while.

    The behavior that it interrupts goes on afterwards. It goes to where the person was perceived; a
    person who walks on in the meantime isn't followed. Events: `approaches`, `interacts`, with the
    name of the person as perceived, and `interaction_over`. If the robot wants something of the
    person (`interactions:`), it asks for it (`asks`), and carries out what is accepted
    (`delivered`).

    Attributes:
        users: Users that it approaches; left out: everybody, recognized or not.
        distance: How near it comes [m]; personal space ends at 1.2 m.
        interaction: How long it interacts.
        chance: Probability that it takes an opportunity.
        again: Minimum time between two approaches to the same person.
        avoid: Rooms, or kinds of rooms if the home has them, in which it leaves people alone.
    """

    records: ClassVar[frozenset[str]] = frozenset(
        {"approaches", "asks", "collects", "delivered", "interaction_over", "interacts"}
    )
    listens: ClassVar[frozenset[str]] = frozenset({"user_seen"})

    users: tuple[str, ...] = ()
    distance: Length = Field(default=1.2, ge=0.3, le=10)
    interaction: Duration = timedelta(minutes=1)
    chance: Share = 1.0
    again: Duration = timedelta(minutes=15)
    avoid: tuple[str, ...] = ()

    def about(self) -> tuple[str, ...]:
        """Return the users that it approaches, if only some."""
        return self.users

    def start(self, actor: Actor) -> None:
        """Check that it has a camera."""
        check_has_camera(actor, "opportunistic")
        self.avoided = avoided_rooms(actor, "opportunistic.avoid", self.avoid)
        self.asked: tuple[Request, str] | None = None  # the request, as events named it
        self.last_opportunity: dict[str, datetime] = {}  # by person

    def decide(self, now: Situation) -> Plan | None:
        """Approach somebody in view, or leave the decision to later behaviors."""
        if (accepted := self._accepted(now)) is not None:
            request, text = accepted
            person = text.rpartition(" ")[2]
            done = "delivered" if person == request.interaction.to else "collects"
            plan = now.plan().stay(request.interaction.takes).note(done, text)
            return plan.note("interaction_over", person)
        avoided = self.avoided | now.actor.banned(now.step)
        for name, (x, y) in sorted(now.in_view.items()):
            if not self._is_opportunity(name, now) or is_in_rooms(now, x, y, avoided):
                continue
            self.last_opportunity[name] = now.time
            if now.random(f"chance {name}").uniform() < self.chance:
                return self._approach(now, name, x, y)
        return None

    def _is_opportunity(self, name: str, now: Situation) -> bool:
        """Return whether it may approach a person: one of its users, left alone for long enough."""
        if self.users and name not in self.users:
            return False
        last = self.last_opportunity.get(name)
        return last is None or now.time - last >= self.again

    def _approach(self, now: Situation, name: str, x: float, y: float) -> Plan:
        plan = now.plan().note("approaches", name)
        approach(now, plan, x, y, self.distance)
        plan.face(*now.home.plan.lattice.point_at((x, y)))
        plan.note("interacts", name)
        ready = [] if now.requests is None else now.requests.ready(now.time, (name,))
        self.asked = (ready[0], ready[0].text) if ready else None
        if self.asked is not None:
            plan.note("asks", self.asked[1]).interrupt_on("accepted")
        return plan.stay(self.interaction).note("interaction_over", name)

    def _accepted(self, now: Situation) -> tuple[Request, str] | None:
        """Return the request that the person it is with has just accepted, and its text."""
        asked, self.asked = self.asked, None
        texts = [event.user for event in now.events if event.event == "accepted"]
        return asked if asked is not None and asked[1] in texts else None
