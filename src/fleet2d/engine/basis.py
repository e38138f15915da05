"""The basis that all parts of a run share, and what follows its bodies from span to span."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from fleet2d.artifacts.store import RunStore
from fleet2d.entities.behavior import SightEvent
from fleet2d.entities.body import Bodies
from fleet2d.entities.decisions import DecidingActor
from fleet2d.floorplan.home import Home
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import Event
from fleet2d.scenario.model import Scenario


class Watcher:
    """Base of followers of the bodies from span to span.

    A span is a block of steps without decisions. A watcher that may have to end one looks ahead in
    `limit`; all others process many spans at once.

    Attributes:
        next_step: The first step that it has not processed.
    """

    next_step: int = 0

    @property
    def waits(self) -> bool:
        """Whether an event of it may end the present span."""
        return False

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step before which the present span ends at the latest, `end` or earlier."""
        return end

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Take in the steps from `next_step` to `end` - 1; return their events."""
        self.next_step = end
        return ()

    def interruptions(self, events: Sequence[Event]) -> Iterable[tuple[int, SightEvent]]:
        """Return the bodies, by row, whose plans an event of the last step ends, and the event.

        Args:
            events: The result of `take`.
        """
        return ()


@dataclass(frozen=True)
class Basis:
    """What the parts of a run are made from.

    Attributes:
        scenario: The scenario.
        clock: The steps of the run.
        seed: The seed of all random draws.
        store: The store of its tables.
        home: The home before the first step.
        actors: Users, then robots.
        bodies: Their poses, in the same order.
    """

    scenario: Scenario
    clock: Clock
    seed: int
    store: RunStore
    home: Home
    actors: list[DecidingActor]
    bodies: Bodies

    @property
    def users(self) -> list[DecidingActor]:
        """The users."""
        return self.actors[: self.bodies.users]

    @property
    def robots(self) -> list[DecidingActor]:
        """The robots."""
        return self.actors[self.bodies.users :]

    @property
    def may_change(self) -> bool:
        """Whether the home may change during the run."""
        scenario = self.scenario
        changes = bool(scenario.objects or scenario.changes)
        changes |= any(user.lights for user in scenario.users.values())
        if changes or not scenario.script:
            return changes
        from fleet2d.interventions.home import HomeIntervention  # only scripts need it

        return any(isinstance(entry.act, HomeIntervention) for entry in scenario.script)
