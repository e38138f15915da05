"""Interrupts: conditions that end plans when they become true, and the plans that wait for them.

Interrupts follow from the poses alone, step by step, so they don't depend on spans. A span ends
with the first one, and the body decides right afterwards.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from fleet2d.configuration.components import Component, lookup
from fleet2d.configuration.importing import source_files
from fleet2d.engine.basis import Basis, Watcher
from fleet2d.entities.behavior import Actor, SightEvent
from fleet2d.entities.body import Bodies
from fleet2d.entities.entity import Robot, User
from fleet2d.errors import ComponentError, blame
from fleet2d.kernels import Bool, PoseBlock
from fleet2d.runtime.events import Event

Wait = tuple[int, str]
"""The row of a body, and the name of the interrupt for which its plan waits."""


@dataclass(frozen=True)
class SpanView:
    """Consecutive steps in which no body decides and the home stays as it is.

    Attributes:
        actor: The body whose plan waits for the interrupt.
        actors: All bodies: users, then robots; all in the home `actor.home`.
        users: The number of users.
        first: The first step.
        poses: The poses of all bodies, (bodies, steps): row b is that of `actors[b]`.
    """

    actor: Actor
    actors: Sequence[Actor]
    users: int
    first: int
    poses: PoseBlock


class Interrupt(Component):
    """A condition that ends waiting plans when it becomes true.

    A plan waits for an interrupt by `plan.interrupt_on(name)`, a behavior by `listens`. It happens
    at a step at which the condition holds and didn't hold at the step before; the behavior is asked
    at the step after. A condition that holds when the plan begins has to end first. An interrupt
    has no keys, and `holds` must depend on its arguments alone.
    """

    kind = "interrupt"

    def holds(self, span: SpanView) -> Bool:
        """Return at which steps of a span the condition holds, bool (steps,)."""
        raise NotImplementedError


# The events of cameras and conversations, which are watchers of their own.
WATCHED_EVENTS = frozenset({*User.sight_events, *Robot.sight_events, *Robot.request_events})


class Interruptions(Watcher):
    """The watcher of plans that wait for interrupts.

    Attributes:
        files: The files of the user's own interrupts for which plans waited.
    """

    def __init__(self, basis: Basis) -> None:
        self._actors = basis.actors
        self._users = basis.bodies.users
        # Values tell whether the condition held at the last step; None: the plan hasn't begun yet.
        self._held: dict[Wait, bool | None] = {}
        self._ahead: dict[Wait, Bool] = {}  # steps of the present span at which it holds
        self._last: list[Wait] = []
        self._interrupts: dict[str, Interrupt] = {}
        self.files: list[Path] = []

    def __getstate__(self) -> dict[str, object]:
        """Leave out the interrupts, which follow from their names."""
        return {**self.__dict__, "_interrupts": {}, "files": []}

    @property
    def waits(self) -> bool:
        """Whether a plan waits for an interrupt."""
        return bool(self._held)

    def listen(self, row: int) -> None:
        """Wait for the interrupts that the present plan of a body names, and for no others."""
        names = self._actors[row].plan.interrupts - WATCHED_EVENTS
        if not names and not self._held:
            return
        others = [wait for wait in self._held if wait[0] != row]
        waits = sorted([*others, *((row, name) for name in names)])
        self._held = {wait: self._held.get(wait) for wait in waits}

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step after the first interruption, or `end` if there is none."""
        first = self.next_step
        steps = end - first
        block = bodies.block(first, end)
        self._ahead = {}
        for wait in self._held:
            row, name = wait
            span = SpanView(self._actors[row], self._actors, self._users, first, block)
            with blame(self._actors[row].path, first):
                self._ahead[wait] = _checked(name, self._interrupt(name).holds(span), steps)
            begins = self._begins(wait)
            if begins.any():
                end = min(end, first + int(begins.argmax()) + 1)
        return end

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Note which interrupts happen at step `end` - 1, and which conditions hold there."""
        last = end - self.next_step - 1
        self.next_step = end
        self._last = [wait for wait in self._ahead if self._begins(wait)[last]]
        for wait, holds in self._ahead.items():
            self._held[wait] = bool(holds[last])
        self._ahead = {}
        return ()

    def interruptions(self, events: Sequence[Event]) -> Iterator[tuple[int, SightEvent]]:
        """Yield the interruptions at the last step, with the place of the body itself."""
        for row, name in self._last:
            x, y = self._actors[row].xy
            yield row, SightEvent(name, "", x, y)

    def _interrupt(self, name: str) -> Interrupt:
        if name not in self._interrupts:
            kind = cast("type[Interrupt]", lookup("interrupt", name))
            self._interrupts[name] = kind()
            if not kind.__module__.startswith("fleet2d."):
                self.files += source_files(kind)
        return self._interrupts[name]

    def _begins(self, wait: Wait) -> Bool:
        """Return at which steps of the present span a condition becomes true."""
        holds = self._ahead[wait]
        held = self._held[wait]
        before = np.concatenate([holds[:1] if held is None else [held], holds[:-1]])
        return holds & ~before


def _checked(name: str, holds: Bool, steps: int) -> Bool:
    """Return the answer of an interrupt after checking it.

    Raises:
        ComponentError: The answer is not an array of that many booleans.
    """
    shape = getattr(holds, "shape", None)
    if shape != (steps,) or holds.dtype != np.bool_:
        raise ComponentError(
            f"interrupt {name}: holds() returned {holds!r}, expected an array of {steps} booleans,"
            " one for each step of the span"
        )
    return holds


class HomeEmpty(Interrupt):
    """The last person has left the home, as a robot may learn from everyone's phones."""

    def holds(self, span: SpanView) -> Bool:
        """Return at which steps all people are away."""
        return (span.poses.away[: span.users] != 0).all(axis=0)


class HomeOccupied(Interrupt):
    """Somebody has come home to an empty home, as a robot may learn from everyone's phones."""

    def holds(self, span: SpanView) -> Bool:
        """Return at which steps somebody is at home."""
        return (span.poses.away[: span.users] == 0).any(axis=0)
