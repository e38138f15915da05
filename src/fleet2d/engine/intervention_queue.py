"""Interventions in a run: the steps at which they are applied, and their records in the manifest.

Interventions from outside are recorded with their steps, so that a run can be repeated from its
manifest. Interventions of the scenario's script are recorded for readers, with their place in the
script, since the scenario applies them again when the run is repeated. The manifest of an
unfinished run has all requests from outside, even if they still wait for a time or an event.
"""

from bisect import insort
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from fleet2d.configuration.units import micros
from fleet2d.interventions.intervention import (
    ENTRY_KEYS,
    Intervention,
    Lasting,
    Trigger,
    dump_intervention,
)
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import Event

# At one step, interventions end first; then come those that follow from others, those of the
# script, and those from outside.
ENDS, FOLLOWS, SCRIPT, OUTSIDE = range(4)
FOLLOWED = "another intervention"
"""The origin, in the manifest, of interventions that follow from others."""


class DueIntervention(NamedTuple):
    """An intervention that begins or ends at a step.

    Attributes:
        step: The step.
        rank: ENDS, FOLLOWS, SCRIPT or OUTSIDE.
        number: The order within a rank: its place in the script or among the requests.
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
        """Whether the intervention ends at that step instead of beginning."""
        return self.rank == ENDS

    @property
    def record(self) -> dict[str, Any]:
        """The entry in the manifest.

        Example:
            >>> from fleet2d.interventions.intervention import parse_intervention
            >>> DueIntervention(60, OUTSIDE, 0, parse_intervention({"replan": "astro"})).record
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
        due: The intervention, at the first step whose events count: earlier ones may become known
            later.
        last: The last step for which it was put into the queue; -1: none.
    """

    trigger: Trigger
    repeats: bool
    delay_us: int
    due: DueIntervention
    last: int = -1

    @property
    def is_over(self) -> bool:
        """Whether the intervention no longer waits."""
        return self.last >= 0 and not self.repeats


class InterventionQueue:
    """The interventions on a run.

    Attributes:
        done: Records of applied interventions, in order, for the manifest.
        requests: Records of all requests from outside, in order: at once at a step, or at a time or
            on an event afterwards.
        waiting: Interventions that wait for an event.
        lasting: Active interventions with a duration, in order of beginning.
    """

    def __init__(self, clock: Clock) -> None:
        self.done: list[dict[str, Any]] = []
        self.requests: list[dict[str, Any]] = []
        self.waiting: list[PendingIntervention] = []
        self.lasting: list[Lasting] = []
        self._clock = clock
        self._queue: list[DueIntervention] = []
        self._ends = 0
        self._followed: list[dict[str, Any]] = []  # `done`, without immediate requests

    def request(self, act: Intervention, step: int) -> None:
        """Schedule an intervention from outside at a step, after all earlier requests."""
        due = DueIntervention(step, OUTSIDE, len(self.requests), act)
        self.requests.append(due.record)
        self.add(due)

    def add(self, due: DueIntervention) -> None:
        """Schedule an intervention."""
        insort(self._queue, due, key=lambda due: due[:3])

    def follow(self, act: Intervention, step: int, by: str = FOLLOWED) -> None:
        """Schedule a consequence of another intervention, before all others due at that step.

        Args:
            act: The consequence.
            step: The step.
            by: The origin of the consequence, for the manifest.
        """
        self._ends += 1
        self.add(DueIntervention(step, FOLLOWS, self._ends, act, by))

    def next_due(self) -> int | None:
        """Return the step of the next intervention; None if none is scheduled."""
        return self._queue[0].step if self._queue else None

    def take(self, step: int) -> Iterator[DueIntervention]:
        """Yield the interventions that are due by a step, in order, and schedule their ends."""
        while self._queue and self._queue[0].step <= step:
            due = self._queue.pop(0)
            if isinstance(due.act, Lasting):
                if due.ends:
                    self.forget(due.act)
                else:
                    # The copy may begin again before the original has ended.
                    act = due.act.model_copy()
                    self.lasting.append(act)
                    due = due._replace(act=act)
            yield due
            if due.ends:
                continue
            self._record(due)
            duration = due.act.duration if isinstance(due.act, Lasting) else None
            if duration is not None and any(act is due.act for act in self.lasting):
                ends_us = due.step * self._clock.step_us + micros(duration)
                ends = max(self._clock.step_at_or_after(ends_us), due.step + 1)
                self._ends += 1
                self.add(DueIntervention(ends, ENDS, self._ends, due.act))

    def _record(self, due: DueIntervention) -> None:
        request = self.requests[due.number] if due.rank == OUTSIDE else None
        if request is not None and ENTRY_KEYS.isdisjoint(request):
            self.done.append(request)
            return
        self.done.append(due.record)
        origin = due.by if request is None else f"request.{due.number}"
        self._followed.append({**due.record, "by": origin})

    def undo(self, applies: Callable[[Lasting], bool]) -> list[Lasting]:
        """Remove the active interventions to which a condition applies, and return them."""
        removed = [act for act in self.lasting if applies(act)]
        for act in removed:
            self.forget(act)
            self._queue = [due for due in self._queue if not (due.ends and due.act is act)]
        return removed

    def forget(self, act: Intervention) -> None:
        """Remove an intervention if it is active, by identity: another may be equal to it."""
        self.lasting = [active for active in self.lasting if active is not act]

    @property
    def acts(self) -> list[Mapping[str, Any]]:
        """All interventions, done and scheduled, as `dump_intervention` writes them."""
        queue = [*self._queue, *(waiting.due for waiting in self.waiting)]
        return [*self.done, *(dump_intervention(due.act) for due in queue if not due.ends)]

    @property
    def kinds(self) -> frozenset[str]:
        """The kinds of events that interventions wait for."""
        return frozenset(w.trigger.event for w in self.waiting if not w.is_over)

    @property
    def unmet(self) -> list[str]:
        """Remarks on entries of the script whose event hasn't happened."""
        return [
            f"{waiting.due.by}: {waiting.due.act.type_name} was never applied: no"
            f" {waiting.trigger} came"
            for waiting in self.waiting
            if waiting.last < 0 and waiting.due.by
        ]

    def take_events(self, events: Sequence[Event]) -> None:
        """Schedule entries that wait for one of some events, at the step after it or later.

        Of several such events at one step, only the first counts.
        """
        for event in events:
            for waiting in self.waiting:
                is_early = event.step < waiting.due.step
                if is_early or waiting.is_over or not waiting.trigger.fits(event):
                    continue
                after = event.step * self._clock.step_us + waiting.delay_us
                step = max(self._clock.step_at_or_after(after), event.step + 1)
                if step != waiting.last:
                    self.add(waiting.due._replace(step=step))
                    waiting.last = step

    @property
    def records(self) -> list[dict[str, Any]]:
        """Records of an unfinished run: consequences of a script or request, and requests.

        A request to happen at once is its own record.
        """
        return [*self._followed, *self.requests]


def read_record(content: Mapping[str, Any]) -> tuple[int, dict[str, Any]]:
    """Return the step of a record in a manifest, and its content for `parse_intervention`.

    Example:
        >>> read_record({"do": "replan", "step": 60, "entity": "astro"})
        (60, {'do': 'replan', 'entity': 'astro'})
    """
    fields = {key: value for key, value in content.items() if key not in ("step", "by")}
    return int(content.get("step", 0)), fields


def is_from_outside(content: Mapping[str, Any]) -> bool:
    """Return whether an intervention came from a caller, not from the scenario's `script`."""
    return "by" not in content
