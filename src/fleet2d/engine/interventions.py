"""Interventions in a run: when each is done, and what the manifest keeps of it.

What was done from outside is kept with its step, so that a run is done again from its manifest.
What the scenario's script did is kept with its place there, for readers: the scenario itself does
it again.
"""

from bisect import insort
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from fleet2d.clock import Clock
from fleet2d.events import Event
from fleet2d.interventions.intervention import (
    Intervention,
    Lasting,
    dump_intervention,
    parse_intervention,
)
from fleet2d.interventions.when import Trigger
from fleet2d.units import micros

# The order of what is due at one step.
ENDS, SCRIPT, OUTSIDE = range(3)


class Due(NamedTuple):
    """Something that is to be done at a step.

    Attributes:
        step: The step.
        rank: First what is over ends, then comes the scenario's script, then what is outside.
        number: Among those of a rank: the place in the script, or the order of asking.
        act: What is done, or ends.
        by: Where in the scenario it stands, like "script.0"; empty for what comes from outside.
    """

    step: int
    rank: int
    number: int
    act: Intervention
    by: str = ""

    @property
    def ends(self) -> bool:
        """Whether it is over at that step, and doesn't begin."""
        return self.rank == ENDS

    @property
    def record(self) -> dict[str, Any]:
        """What the manifest keeps of it.

        Example:
            >>> Due(60, OUTSIDE, 0, read_intervention({"replan": "astro"})[1]).record
            {'do': 'replan', 'step': 60, 'entity': 'astro'}
        """
        fields = dump_intervention(self.act)
        by = {"by": self.by} if self.by else {}
        return {"do": fields.pop("do"), "step": self.step, **fields, **by}


@dataclass
class Waiting:
    """An intervention that waits for an event.

    Attributes:
        trigger: The event.
        each: Whether it is done every time that it happens.
        delay_us: How long after it [us].
        act: What is done.
        rank, number, by: See `Due`.
        last: The step for which it was put into the queue last; -1: never.
    """

    trigger: Trigger
    each: bool
    delay_us: int
    act: Intervention
    rank: int
    number: int
    by: str
    last: int = -1

    @property
    def is_over(self) -> bool:
        """Whether it waits no longer."""
        return self.last >= 0 and not self.each


class Interventions:
    """What is done to a run.

    Attributes:
        done: What was done, in order, as the manifest keeps it.
        waiting: What waits for an event.
        lasting: What was begun and isn't over, in order.
    """

    def __init__(self, clock: Clock) -> None:
        self.done: list[dict[str, Any]] = []
        self.waiting: list[Waiting] = []
        self.lasting: list[Lasting] = []
        self._clock = clock
        self._queue: list[Due] = []
        self._count = 0

    def next_number(self) -> int:
        """Return a number that is above all before."""
        self._count += 1
        return self._count

    def repeat(self, records: Sequence[Mapping[str, Any]]) -> None:
        """Let be done again what records of another run say."""
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
        """Let something be done at a step, after all of its rank that was added before."""
        number = self.next_number() if number is None else number
        insort(self._queue, Due(step, rank, number, act, by), key=lambda due: due[:3])

    def next_due(self) -> int | None:
        """Return the step at which something is done next."""
        return self._queue[0].step if self._queue else None

    def take(self, step: int) -> Iterator[Due]:
        """Yield what is due by a step, in order; keep what is begun, and let it end in time."""
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

    def undo(self, is_meant: Callable[[Lasting], bool]) -> list[Lasting]:
        """Take what is under way and meant out of it, and return it."""
        meant = [act for act in self.lasting if is_meant(act)]
        for act in meant:
            self._forget(act)
            self._queue = [due for due in self._queue if not (due.ends and due.act is act)]
        return meant

    def _forget(self, act: Lasting) -> None:
        """Drop what is over: that very one, for another may be just like it."""
        place = next((i for i, other in enumerate(self.lasting) if other is act), None)
        if place is not None:
            del self.lasting[place]

    @property
    def kinds(self) -> frozenset[str]:
        """The kinds of events that something waits for."""
        return frozenset(w.trigger.event for w in self.waiting if not w.is_over)

    def take_events(self, events: Sequence[Event]) -> None:
        """Put what waits for one of these events into the queue: for the step after it, or later.

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
        """What was done, and what is to be done from outside at a known step."""
        return [*self.done, *(due.record for due in self._queue if due.rank == OUTSIDE)]


def read_intervention(content: Mapping[str, Any]) -> tuple[int, Intervention]:
    """Return the step and the intervention that a manifest has.

    Example:
        >>> read_intervention({"do": "replan", "step": 60, "entity": "astro"})[0]
        60
    """
    fields = {key: value for key, value in content.items() if key not in ("step", "by")}
    return int(content.get("step", 0)), parse_intervention(fields)


def is_from_outside(content: Mapping[str, Any]) -> bool:
    """Tell whether an intervention of a manifest is none of the scenario's own script."""
    return "by" not in content
