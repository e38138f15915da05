"""Watchers: they follow the bodies of a run, and emit events."""

from collections.abc import Iterable, Sequence

from fleet2d.engine.bodies import Bodies
from fleet2d.entities.behavior import SightEvent
from fleet2d.runtime.events import Event


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
