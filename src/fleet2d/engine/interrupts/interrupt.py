"""The base class of interrupts, and the part of a run that they see."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from fleet2d.configuration.components import Component
from fleet2d.engine.bodies import PoseBlock
from fleet2d.entities.behavior import Actor
from fleet2d.kernels import Bool


@dataclass(frozen=True)
class SpanView:
    """Consecutive steps in which no body decides and the home stays as it is.

    Attributes:
        actor: The body whose plan waits for the interrupt.
        actors: All bodies: users, then robots. They are in the home `actor.home`.
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
    """A condition that ends the plans that wait for it, when it becomes true.

    A plan waits for it by `plan.interrupt_on(name)`, a behavior by `listens`. It happens at a step
    at which the condition holds, and at the step before it didn't; the behavior is asked at the
    step after. A condition that holds when the plan begins has to end before it can happen. It has
    no keys, and whether it holds must follow from the arguments of `holds` alone.
    """

    kind: ClassVar[str] = "interrupt"

    def holds(self, span: SpanView) -> Bool:
        """Return at which steps of a span the condition holds, bool (steps,)."""
        raise NotImplementedError
