"""Right of way: which of two robots yields when their ways cross."""

from typing import ClassVar

from fleet2d.configuration.components import Component
from fleet2d.entities.behavior import Actor


class RightOfWay(Component):
    """The rule by which one of two robots yields to the other.

    People, logs and real bodies never yield, whatever the rule is. The rule is asked whenever a
    body begins a plan, and must depend on its arguments alone.

    Example:
        >>> class Heavier(RightOfWay):
        ...     '''The larger robot goes first.'''
        ...     def goes_first(self, one, other):
        ...         return one.entity.radius >= other.entity.radius
        >>> Heavier().is_fixed
        False
    """

    kind = "right_of_way"
    # Whether the answers are the same during a whole run, so that the rule is asked once.
    is_fixed: ClassVar[bool] = False

    def goes_first(self, one: Actor, other: Actor) -> bool:
        """Return whether the first of two robots, in the order of the scenario, goes first."""
        raise NotImplementedError


class Listed(RightOfWay):
    """The robot that comes first in the scenario goes first."""

    is_fixed = True

    def goes_first(self, one: Actor, other: Actor) -> bool:
        """Return True: the first robot in the scenario goes first."""
        return True


class LowBattery(RightOfWay):
    """The robot with less charge goes first; of two without batteries the first in the scenario."""

    def goes_first(self, one: Actor, other: Actor) -> bool:
        """Compare the charges at their last decisions; a robot without a battery is full."""
        levels = [1.0 if actor.charge is None else actor.charge.level for actor in (one, other)]
        return levels[0] <= levels[1]
