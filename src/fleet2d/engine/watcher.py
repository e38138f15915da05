"""Watchers: what follows the bodies of a run, and finds out what happens."""

from collections.abc import Iterable, Sequence
from typing import Protocol

from fleet2d.engine.bodies import Bodies
from fleet2d.entities.behavior import SightEvent
from fleet2d.events import Event


class Watcher(Protocol):
    """What follows the bodies from span to span.

    A span is a block of steps in which nobody decides. A watcher that may have to end one looks
    ahead when it is asked for the limit; any other is handed many spans at once.

    Attributes:
        taken: The step before which it has taken everything in.
    """

    taken: int

    @property
    def waits(self) -> bool:
        """Whether something that it may notice ends the present span."""

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step before which the present span ends at the latest, `end` or earlier."""

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Take in the steps from `taken` to `end` - 1; return what happened."""

    def interruptions(self, events: Sequence[Event]) -> Iterable[tuple[int, SightEvent]]:
        """Return whose plans, by row, something in the last step taken in ends.

        Args:
            events: What `take` returned.
        """
