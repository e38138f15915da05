"""Pet: a cat or a dog that sleeps most of the day, and roams through the home in between."""

from datetime import timedelta
from typing import ClassVar

from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.configuration.problems import problem
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.place import available_rooms
from fleet2d.entities.plan import Plan
from fleet2d.entities.users.resident import Spots
from fleet2d.routines.activity import AnyDurationDistribution, DurationDistribution
from fleet2d.runtime.determinism import Draws

# How many naps are planned at once.
NAPS = 10


@register("behavior", "pet")
class Pet(Behavior):
    """Nap somewhere, roam through a few spots of the home, nap somewhere else.

    The durations of naps and stops are drawn at random. The next spot is in the same room
    with probability `stays_in_room`, else in any room that it may enter.

    Attributes:
        rooms: Rooms and kinds of rooms that it may enter; none: all.
        nap: How long it sleeps at a time.
        stop: How long it stops at a spot while it roams.
        spots: Smallest and largest number of stops between two naps.
        stays_in_room: Probability that its next spot is in the same room.
    """

    usual_height: ClassVar[float] = 0.3

    rooms: tuple[str, ...] = ()
    nap: AnyDurationDistribution = DurationDistribution(
        mean=timedelta(minutes=50), std=timedelta(minutes=40)
    )
    stop: AnyDurationDistribution = DurationDistribution(
        mean=timedelta(seconds=40), std=timedelta(seconds=40)
    )
    spots: tuple[int, int] = (3, 12)
    stays_in_room: float = Field(default=0.6, ge=0, le=1)

    def model_post_init(self, _: object, /) -> None:
        """Require a range of spots."""
        least, most = self.spots
        if not 0 <= least <= most:
            raise problem(f"spots: expected [least, most] like [3, 12], got {list(self.spots)}")

    def start(self, actor: Actor) -> None:
        """Find the rooms that it may enter."""
        rooms = available_rooms(actor, "pet.rooms", self.rooms)
        self.allowed_rooms = rooms or actor.reachable_rooms()
        self.places = Spots(actor)
        self.durations = self.nap.table(), self.stop.table()
        self.naps = 0
        self.room = Draws(actor.stream("first room"), 0).choice(self.allowed_rooms)

    def decide(self, now: Situation) -> Plan:
        """Plan the next naps, and the stops between them."""
        plan = now.plan()
        nap, stop = self.durations
        least, most = self.spots
        for _ in range(NAPS):
            draws = Draws(now.actor.stream("roam"), self.naps)
            self.naps += 1
            for _ in range(least + draws.below(most - least + 1)):
                self._walk(plan, draws)
                plan.stay(timedelta(seconds=stop.draw(draws)))
            self._walk(plan, draws)
            plan.take("lie").stay(timedelta(seconds=nap.draw(draws)))
        return plan

    def _walk(self, plan: Plan, draws: Draws) -> None:
        """Walk to the next spot."""
        if draws.uniform() >= self.stays_in_room:
            self.room = draws.choice(self.allowed_rooms)
        draws.choice(self.places.in_room(self.room)).walk(plan)
