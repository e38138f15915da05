"""Interventions in a run: when each is applied, and its record in the manifest.

Interventions from outside are recorded with their steps, so that a run can be repeated from its
manifest. Those of the scenario's script are recorded for readers, with their place in the script:
when the run is repeated, the scenario applies them again.
"""

from bisect import insort
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from fleet2d.configuration.units import micros
from fleet2d.interventions.intervention import (
    Intervention,
    Lasting,
    dump_intervention,
    parse_intervention,
)
from fleet2d.interventions.when import Trigger
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import Event

# The order at one step: first the ends of interventions, then those of the script and from outside.
ENDS, SCRIPT, OUTSIDE = range(3)


class DueIntervention(NamedTuple):
    """An intervention that begins or ends at a step.

    Attributes:
        step: The step.
        rank: ENDS, SCRIPT or OUTSIDE.
        number: Its order within a rank: its place in the script, or the order of requests.
        act: The intervention.
        by: Its place in the scenario, like "script.0"; empty for one from outside.
    """

    step: int
    rank: int
    number: int
    act: Intervention
    by: str = ""

    @property
    def ends(self) -> bool:
        """Whether it ends at that step, and doesn't begin."""
        return self.rank == ENDS

    @property
    def record(self) -> dict[str, Any]:
        """The entry of the manifest.

        Example:
            >>> DueIntervention(60, OUTSIDE, 0, read_intervention({"replan": "astro"})[1]).record
            {'do': 'replan', 'step': 60, 'entity': 'astro'}
        """
        fields = dump_intervention(self.act)
        by = {"by": self.by} if self.by else {}
        return {"do": fields.pop("do"), "step": self.step, **fields, **by}


@dataclass
class PendingIntervention:
    """An intervention that waits for an event.

    Attributes:
        trigger: The event.
        repeats: Whether it is applied at every such event, not only at the first.
        delay_us: Time from the event to the intervention [us].
        act: The intervention.
        rank, number, by: See `DueIntervention`.
        last: The last step for which it was put into the queue; -1: none.
    """

    trigger: Trigger
    repeats: bool
    delay_us: int
    act: Intervention
    rank: int
    number: int
    by: str
    last: int = -1

    @property
    def is_over(self) -> bool:
        """Whether it no longer waits."""
        return self.last >= 0 and not self.repeats


class Interventions:
    """The interventions on a run.

    Attributes:
        done: Records of those that were applied, in order, for the manifest.
        waiting: Those that wait for an event.
        lasting: Those with a duration that are active, in the order of their begin.
    """

    def __init__(self, clock: Clock) -> None:
        self.done: list[dict[str, Any]] = []
        self.waiting: list[PendingIntervention] = []
        self.lasting: list[Lasting] = []
        self._clock = clock
        self._queue: list[DueIntervention] = []
        self._count = 0

    def next_number(self) -> int:
        """Return a number above all earlier ones."""
        self._count += 1
        return self._count

    def repeat(self, records: Sequence[Mapping[str, Any]]) -> None:
        """Schedule the interventions in the records of another run."""
        for record in records:
            step, intervention = read_intervention(record)
            self.add(intervention, step)

    def add(
        self,
        act: Intervention,
        step: int,
        rank: int = OUTSIDE,
        number: int | None = None,
        by: str = "",
    ) -> None:
        """Schedule an intervention at a step, after those of its rank that were added before."""
        number = self.next_number() if number is None else number
        insort(self._queue, DueIntervention(step, rank, number, act, by), key=lambda due: due[:3])

    def next_due(self) -> int | None:
        """Return the step of the next intervention; None if none is scheduled."""
        return self._queue[0].step if self._queue else None

    def take(self, step: int) -> Iterator[DueIntervention]:
        """Yield what is due by a step, in order, and schedule the end of what begins."""
        while self._queue and self._queue[0].step <= step:
            due = self._queue.pop(0)
            if isinstance(due.act, Lasting):
                if due.ends:
                    self._forget(due.act)
                else:
                    self.lasting.append(due.act)
            yield due
            if due.ends:
                continue
            self.done.append(due.record)
            if due.act.lasts is not None:
                ends = due.step * self._clock.step_us + micros(due.act.lasts)
                self.add(due.act, max(self._clock.step_at_or_after(ends), due.step + 1), ENDS)

    def undo(self, applies: Callable[[Lasting], bool]) -> list[Lasting]:
        """Remove the active interventions to which a condition applies, and return them."""
        removed = [act for act in self.lasting if applies(act)]
        for act in removed:
            self._forget(act)
            self._queue = [due for due in self._queue if not (due.ends and due.act is act)]
        return removed

    def _forget(self, act: Lasting) -> None:
        """Remove an active intervention, by identity: another may be equal to it."""
        self.lasting = [active for active in self.lasting if active is not act]

    @property
    def kinds(self) -> frozenset[str]:
        """The kinds of events that interventions wait for."""
        return frozenset(w.trigger.event for w in self.waiting if not w.is_over)

    def take_events(self, events: Sequence[Event]) -> None:
        """Schedule what waits for one of these events at the step after it, or later by its delay.

        Of several such events at one step, only the first counts.
        """
        for event in events:
            for waiting in self.waiting:
                if waiting.is_over or not waiting.trigger.fits(event):
                    continue
                after = event.step * self._clock.step_us + waiting.delay_us
                step = max(self._clock.step_at_or_after(after), event.step + 1)
                if step != waiting.last:
                    self.add(waiting.act, step, waiting.rank, waiting.number, waiting.by)
                    waiting.last = step

    @property
    def records(self) -> list[dict[str, Any]]:
        """Records of what was applied, and of what is scheduled from outside."""
        return [*self.done, *(due.record for due in self._queue if due.rank == OUTSIDE)]


def read_intervention(content: Mapping[str, Any]) -> tuple[int, Intervention]:
    """Return the step and the intervention of a record in a manifest.

    Example:
        >>> read_intervention({"do": "replan", "step": 60, "entity": "astro"})[0]
        60
    """
    fields = {key: value for key, value in content.items() if key not in ("step", "by")}
    return int(content.get("step", 0)), parse_intervention(fields)


def is_from_outside(content: Mapping[str, Any]) -> bool:
    """Whether an intervention came from a caller, not from the scenario's `script`."""
    return "by" not in content
