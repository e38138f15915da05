"""The interface of a node of ROS 2, whichever library connects it to the graph."""

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any, NamedTuple, Protocol

Fields = Mapping[str, Any]
"""A message, as a mapping of its fields."""


class Quality(NamedTuple):
    """The quality of service of a topic; all else has the defaults of ROS.

    Attributes:
        depth: The number of messages that are kept.
        is_latched: Whether later subscribers get the last ones.
    """

    depth: int = 10
    is_latched: bool = False


USUAL = Quality()
LATCHED = Quality(1, is_latched=True)


class ActionStatus(IntEnum):
    """The states of action_msgs/msg/GoalStatus."""

    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6

    @property
    def is_over(self) -> bool:
        """Whether the state is final."""
        return self >= self.SUCCEEDED


class ActionGoal:
    """A goal that a client of an action sent.

    Attributes:
        id: Its identifier, as text.
        fields: Its fields.
        stamp: When it was accepted.
        status: Its state.
    """

    def __init__(self, identifier: bytes, fields: dict[str, Any], stamp: Fields) -> None:
        """Begin to execute it."""
        self.id = identifier.hex()
        self.fields = fields
        self.stamp = stamp
        self.status = ActionStatus.EXECUTING


class RosAction(Protocol):
    """An action that a node serves."""

    def goal(self, name: str) -> ActionGoal | None:
        """Return the goal of an identifier, unless it is over or unknown."""

    def open_goals(self) -> list[ActionGoal]:
        """Return the goals that aren't over."""

    def tell(self, goal: ActionGoal, feedback: Fields) -> None:
        """Publish feedback about a goal."""

    def finish(self, goal: ActionGoal, status: ActionStatus, result: Fields) -> None:
        """End a goal, and send the result to clients that wait for it."""


class RosNode(Protocol):
    """A node in the graph of ROS 2; its functions are called in threads of a library.

    Attributes:
        distribution: The version of ROS 2.
        hears_several_types: Whether it can hear messages of several types on a topic.
        notes: Notes on what it leaves out, and why.
    """

    distribution: str
    hears_several_types: bool
    notes: list[str]

    def publisher(self, name: str, of: str, quality: Quality = USUAL) -> Callable[[Fields], None]:
        """Return a function that publishes a message."""

    def subscribe(
        self,
        name: str,
        of: str,
        heard: Callable[[dict[str, Any]], None],
        wrong: Callable[[str], None],
        quality: Quality = USUAL,
    ) -> None:
        """Call a function with each message of a topic.

        Args:
            name: The topic.
            of: The type of its messages.
            heard: Called with the fields of each message.
            wrong: Called with the fault of a message that can't be read.
            quality: Its quality of service.
        """

    def action(
        self,
        name: str,
        of: str,
        begin: Callable[[ActionGoal], bool],
        cancel: Callable[[ActionGoal], None],
        stamp: Callable[[], Fields],
    ) -> RosAction:
        """Serve an action.

        Args:
            name: Its name.
            of: Its type.
            begin: Called with each goal; returns whether it is accepted.
            cancel: Called with a goal that a client withdraws; `finish` is expected later.
            stamp: Returns the present time.
        """

    def close(self) -> None:
        """Leave the graph."""
