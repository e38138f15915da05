"""A node of ROS 2 over its Python library, if that is installed, with any middleware.

Types of messages are packages of ROS; topics whose type isn't installed are left out, with a note.
"""

import importlib
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from fleet2d.live.ros.node import (
    USUAL,
    ActionGoal,
    ActionStatus,
    Fields,
    Quality,
)

_ENDS = {
    ActionStatus.SUCCEEDED: "succeed",
    ActionStatus.CANCELED: "canceled",
    ActionStatus.ABORTED: "abort",
}


def is_rclpy_there() -> bool:
    """Return whether the library of ROS can be imported and works in this process."""
    with suppress(Exception):  # a library for another Python or NumPy may raise anything
        importlib.import_module("rclpy.action")
        importlib.import_module("rosgraph_msgs.msg").Clock()
        return True
    return False


class RclpyNode:
    """A node of the library `rclpy`.

    Attributes:
        distribution: The version of ROS 2.
        notes: The topics and actions that are left out.
        hears_several_types: Whether it can hear messages of several types on a topic.
    """

    hears_several_types = False

    def __init__(self, distribution: str, domain: int = 0) -> None:
        """Join the graph."""
        import rclpy
        import rclpy.action
        import rclpy.executors
        import rclpy.qos

        self.distribution = distribution
        self.notes: list[str] = []
        self._library: Any = rclpy
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node: Any = rclpy.create_node("fleet2d", context=self._context)
        self._executor: Any = rclpy.executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        with suppress(self._library.executors.ExternalShutdownException):
            self._executor.spin()

    def _type(self, name: str, what: str) -> Any:
        """Return the class of a type; None, with a note, if its package isn't installed."""
        package, kind, last = name.split("/")
        try:
            return getattr(importlib.import_module(f"{package}.{kind}"), last)
        except (ImportError, AttributeError):
            self.notes.append(f"{what}: ROS has no {name} here")
            return None

    def _quality(self, quality: Quality) -> Any:
        qos = self._library.qos
        durability = qos.DurabilityPolicy
        kept = durability.TRANSIENT_LOCAL if quality.is_latched else durability.VOLATILE
        return qos.QoSProfile(depth=quality.depth, durability=kept)

    def publisher(self, name: str, of: str, quality: Quality = USUAL) -> Callable[[Fields], None]:
        """Return a function that publishes a message."""
        cls = self._type(of, name)
        if cls is None:
            return lambda _: None
        declared = self._node.create_publisher(cls, name, self._quality(quality))
        return lambda fields: declared.publish(filled(cls(), fields))

    def subscribe(
        self,
        name: str,
        of: str,
        heard: Callable[[dict[str, Any]], None],
        wrong: Callable[[str], None],
        quality: Quality = USUAL,
    ) -> None:
        """Call a function with each message of a topic."""
        cls = self._type(of, name)
        if cls is not None:
            receive = lambda message: heard(as_mapping(message))  # noqa: E731
            self._node.create_subscription(cls, name, receive, self._quality(quality))

    def action(
        self,
        name: str,
        of: str,
        begin: Callable[[ActionGoal], bool],
        cancel: Callable[[ActionGoal], None],
        stamp: Callable[[], Fields],
    ) -> "RclpyAction":
        """Serve an action."""
        action = RclpyAction(begin, cancel, stamp)
        cls = self._type(of, name)
        if cls is not None:
            action.serve(self._library, self._node, cls, name)
        return action

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._thread.join(timeout=5)
        self._node.destroy_node()
        self._library.shutdown(context=self._context)


class RclpyAction:
    """An action whose goals are ended by the simulation rather than by a waiting thread."""

    def __init__(
        self,
        begin: Callable[[ActionGoal], bool],
        cancel: Callable[[ActionGoal], None],
        stamp: Callable[[], Fields],
    ) -> None:
        """Begin without goals."""
        self._begin = begin
        self._cancel = cancel
        self._stamp = stamp
        self._goals: dict[str, tuple[ActionGoal, Any, Any]] = {}  # goal, handle and future
        self._lock = threading.RLock()
        self._cls: Any = None

    def serve(self, library: Any, node: Any, cls: Any, name: str) -> None:
        """Serve the action by the library's server."""
        action = library.action
        self._cls = cls

        async def execute(handle: Any) -> Any:
            goal = ActionGoal(bytes(handle.goal_id.uuid), as_mapping(handle.request), self._stamp())
            future = library.task.Future()
            with self._lock:
                self._goals[goal.id] = goal, handle, future
                if not self._begin(goal):
                    self.finish(goal, ActionStatus.ABORTED, {})
            return await future

        def asked_to_cancel(handle: Any) -> Any:
            goal = self.goal(bytes(handle.goal_id.uuid).hex())
            if goal is None:
                return action.CancelResponse.REJECT
            goal.status = ActionStatus.CANCELING
            self._cancel(goal)
            return action.CancelResponse.ACCEPT

        group = library.callback_groups.ReentrantCallbackGroup()
        self._server = action.ActionServer(
            node, cls, name, execute, callback_group=group, cancel_callback=asked_to_cancel
        )

    def goal(self, name: str) -> ActionGoal | None:
        """Return the goal of an identifier, unless it is over or unknown."""
        with self._lock:
            kept = self._goals.get(name)
        return None if kept is None else kept[0]

    def open_goals(self) -> list[ActionGoal]:
        """Return the goals that aren't over."""
        with self._lock:
            return [goal for goal, *_ in self._goals.values()]

    def tell(self, goal: ActionGoal, feedback: Fields) -> None:
        """Publish feedback about a goal."""
        with self._lock:
            handle = self._goals[goal.id][1]
        handle.publish_feedback(filled(self._cls.Feedback(), feedback))

    def finish(self, goal: ActionGoal, status: ActionStatus, result: Fields) -> None:
        """End a goal, and send the result to clients that wait for it."""
        with self._lock:
            _, handle, future = self._goals.pop(goal.id)
        goal.status = status
        getattr(handle, _ENDS[status])()
        future.set_result(filled(self._cls.Result(), result))


def filled(message: Any, fields: Fields) -> Any:
    """Return a message of ROS with some fields set from a mapping."""
    types = message.get_fields_and_field_types()
    for name, value in fields.items():
        if isinstance(value, Mapping):
            filled(getattr(message, name), value)
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            item = types[name].removeprefix("sequence<").partition(">")[0].partition(",")[0]
            package, _, last = item.partition("/")
            cls = getattr(importlib.import_module(f"{package}.msg"), last)
            setattr(message, name, [filled(cls(), part) for part in value])
        elif isinstance(value, np.ndarray) and isinstance(getattr(message, name), np.ndarray):
            getattr(message, name)[:] = value
        else:
            setattr(message, name, value)
    return message


def as_mapping(value: Any) -> Any:
    """Return a message of ROS as a mapping."""
    if hasattr(value, "get_fields_and_field_types"):
        names = value.get_fields_and_field_types()
        return {name: as_mapping(getattr(value, name)) for name in names}
    return [as_mapping(part) for part in value] if isinstance(value, list) else value
