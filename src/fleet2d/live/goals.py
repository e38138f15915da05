"""Goals of bodies in a live run, followed from their acceptance to their end.

A body that has reached its goal stands there until it is released, as its order says.
"""

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Any, NamedTuple

from fleet2d.engine.simulation import Simulation
from fleet2d.entities.decisions import DecidingActor, GoTo
from fleet2d.live.messages import GoalMessage
from fleet2d.runtime.events import Event, EventKind

Sender = tuple[int, int]
"""The number of a peer, and of its client."""


class GoalStatus(StrEnum):
    """The state of a goal."""

    ACCEPTED = "accepted"
    UNDER_WAY = "under_way"
    BLOCKED = "blocked"
    REACHED = "reached"
    IMPOSSIBLE = "impossible"
    CANCELLED = "cancelled"


class GoalState(NamedTuple):
    """A goal at a step.

    Attributes:
        entity: The body.
        id: The name that its sender gave it.
        to: The place, as it was sent.
        state: Its state.
        detail: Why it is impossible, cancelled or blocked.
        metres: The length of the rest of the planned way.
        seconds: The time that the rest of the planned way takes.
        sender: Who sent it.
    """

    entity: str
    id: str
    to: Any
    state: GoalStatus
    detail: str
    metres: float
    seconds: float
    sender: Sender

    def message(self) -> dict[str, Any]:
        """Return the fields that other programs get."""
        fields = self._asdict()
        del fields["sender"]
        return {"type": "goal_state", **fields, "state": str(self.state)}

    def text(self) -> str:
        """Return the message as JSON."""
        return json.dumps(self.message())


@dataclass
class _Goal:
    message: GoalMessage
    sender: Sender
    order: GoTo | None = None
    obstacle: str | None = None  # the name of what blocks the way
    is_reached: bool = False  # the body still stands there

    def state(
        self, state: GoalStatus, detail: str = "", metres: float = 0.0, seconds: float = 0.0
    ) -> GoalState:
        sent = self.message
        return GoalState(sent.entity, sent.id, sent.to, state, detail, metres, seconds, self.sender)


class Goals:
    """The goals of all bodies in a live run: each has one at a time."""

    def __init__(self, simulation: Simulation) -> None:
        """Begin without goals."""
        self._simulation = simulation
        self._goals: dict[str, _Goal] = {}
        self._news: list[GoalState] = []

    def accept(self, message: GoalMessage, sender: Sender) -> None:
        """Add the goal of an order that was given; it replaces the one before."""
        self.cancel(message.entity, "another goal was sent")
        goal = _Goal(message, sender)
        self._goals[message.entity] = goal
        self._news.append(goal.state(GoalStatus.ACCEPTED))

    def refuse(self, message: GoalMessage, sender: Sender, reason: str) -> None:
        """Report that a goal is impossible."""
        self._news.append(_Goal(message, sender).state(GoalStatus.IMPOSSIBLE, reason))

    def cancel(self, entity: str, reason: str) -> None:
        """Report that the goal of a body, if it has one, is given up."""
        goal = self._goals.pop(entity, None)
        if goal is not None and not goal.is_reached:
            self._news.append(goal.state(GoalStatus.CANCELLED, reason))

    def has(self, entity: str, name: str = "") -> bool:
        """Return whether a body has a goal, or the goal of a name."""
        goal = self._goals.get(entity)
        return goal is not None and name in ("", goal.message.id)

    def of(self, sender: Sender) -> list[GoalMessage]:
        """Return the goals of a sender that bodies follow or stand at."""
        return [goal.message for goal in self._goals.values() if goal.sender == sender]

    def take_news(self, events: Iterable[Event]) -> list[GoalState]:
        """Return the states of goals under way, and of those that began or ended lately.

        Args:
            events: The events since the last call.
        """
        blocked = {e.entity: e.detail for e in events if e.event == EventKind.WAY_BLOCKED}
        for entity, goal in list(self._goals.items()):
            goal.obstacle = blocked.get(entity, goal.obstacle)
            state = self._state_of(goal, self._simulation.actors[entity])
            if not goal.is_reached:
                self._news.append(state)
            goal.is_reached |= state.state == GoalStatus.REACHED
            if state.state == GoalStatus.CANCELLED:
                del self._goals[entity]
        news = self._news
        self._news = []
        return news

    def _state_of(self, goal: _Goal, actor: DecidingActor) -> GoalState:
        order = actor.order
        if goal.order is None and isinstance(order, GoTo):
            goal.order = order
        if order is None or order is not goal.order:
            return goal.state(GoalStatus.CANCELLED, "the body has another order, or none")
        metres, seconds = self._rest_of_way(actor)
        if goal.order.has_reached(actor.state) and not seconds:
            return goal.state(GoalStatus.REACHED)
        if actor.is_immobile:
            return goal.state(GoalStatus.BLOCKED, "it can't move", metres, seconds)
        if goal.obstacle is not None and not metres:
            return goal.state(GoalStatus.BLOCKED, goal.obstacle)
        goal.obstacle = None
        return goal.state(GoalStatus.UNDER_WAY, "", metres, seconds)

    def _rest_of_way(self, actor: DecidingActor) -> tuple[float, float]:
        """Return the length [m] and the time [s] of the rest of a planned way."""
        clock = self._simulation.clock
        now_us = self._simulation.step * clock.step_us
        rows = actor.plan.legs.rows().tolist()
        ahead = [tuple(row) for row in rows if row[0] > now_us]
        poses = [(now_us, *actor.state), *ahead]
        metres = 0.0
        arrival_us = now_us
        for (_, *before), (time_us, *after) in pairwise(poses):
            metres += math.dist(before[:2], after[:2])
            if before != after:
                arrival_us = time_us
        units = self._simulation.home.plan.lattice.units_per_m
        return metres / units, (arrival_us - now_us) / 1e6
