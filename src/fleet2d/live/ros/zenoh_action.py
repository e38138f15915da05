"""An action of ROS 2 over services and topics below `NAME/_action`, as in rcl_action."""

import threading
from collections.abc import Callable
from types import MappingProxyType
from typing import Any

import numpy as np

from fleet2d.live.ros.node import ActionGoal, ActionStatus, Fields

# The number of ended goals that are remembered, as clients ask for their results.
MAX_GOALS = 1000
_NONE = 0  # of action_msgs/srv/CancelGoal
_UNKNOWN_GOAL = 2
_IS_OVER = 3
Reply = Callable[[Fields], None]


class _AcceptedGoal(ActionGoal):
    """A goal, with its result and the clients that wait for it."""

    result: Fields = MappingProxyType({})
    waiting: tuple[Reply, ...] = ()

    @property
    def info(self) -> Fields:
        """The fields of its action_msgs/msg/GoalInfo."""
        return {"goal_id": {"uuid": _uuid(self.id)}, "stamp": self.stamp}

    @property
    def response(self) -> Fields:
        """The reply to a client that asks for the result."""
        return {"status": int(self.status), "result": self.result}


class ZenohAction:
    """An action; its functions are called in threads of the library."""

    def __init__(
        self,
        feedback: Reply,
        states: Reply,
        begin: Callable[[ActionGoal], bool],
        cancel: Callable[[ActionGoal], None],
        stamp: Callable[[], Fields],
    ) -> None:
        """Begin without goals.

        Args:
            feedback: Publishes feedback.
            states: Publishes the states of all goals.
            begin: Called with each goal; returns whether it is accepted.
            cancel: Called with a goal that a client withdraws; `finish` is expected later.
            stamp: Returns the present time.
        """
        self._feedback = feedback
        self._states = states
        self._begin = begin
        self._cancel = cancel
        self._stamp = stamp
        self._goals: dict[str, _AcceptedGoal] = {}
        self._lock = threading.RLock()

    def goal(self, name: str) -> ActionGoal | None:
        """Return the goal of an identifier that isn't over."""
        with self._lock:
            goal = self._goals.get(name)
        return None if goal is None or goal.status.is_over else goal

    def open_goals(self) -> list[ActionGoal]:
        """Return the goals that aren't over."""
        with self._lock:
            return [goal for goal in self._goals.values() if not goal.status.is_over]

    def tell(self, goal: ActionGoal, feedback: Fields) -> None:
        """Publish feedback about a goal."""
        self._feedback({"goal_id": {"uuid": _uuid(goal.id)}, "feedback": feedback})

    def finish(self, goal: ActionGoal, status: ActionStatus, result: Fields) -> None:
        """End a goal, and send the result to clients that wait for it."""
        with self._lock:
            kept = self._goals[goal.id]
            kept.status = status
            kept.result = result
            waiting = kept.waiting
            kept.waiting = ()
            self._publish()
        for reply in waiting:
            reply(kept.response)

    def _publish(self) -> None:
        states = [{"goal_info": g.info, "status": int(g.status)} for g in self._goals.values()]
        self._states({"status_list": states})

    def accept(self, request: dict[str, Any], reply: Reply) -> None:
        """Serve `send_goal`."""
        identifier = bytes(request["goal_id"]["uuid"])
        goal = _AcceptedGoal(identifier, request["goal"], self._stamp())
        with self._lock:
            is_accepted = goal.id not in self._goals and self._begin(goal)
            if is_accepted:
                self._forget()
                self._goals[goal.id] = goal
        reply({"accepted": is_accepted, "stamp": goal.stamp})
        if is_accepted:
            with self._lock:
                self._publish()

    def _forget(self) -> None:
        over = [name for name, goal in self._goals.items() if goal.status.is_over]
        for name in over[: max(0, len(self._goals) - MAX_GOALS)]:
            del self._goals[name]

    def tell_result(self, request: dict[str, Any], reply: Reply) -> None:
        """Serve `get_result`; the reply about an open goal waits for its end."""
        with self._lock:
            goal = self._goals.get(bytes(request["goal_id"]["uuid"]).hex())
            if goal is not None and not goal.status.is_over:
                goal.waiting = (*goal.waiting, reply)
                return
        reply({} if goal is None else goal.response)  # the state 0 is "unknown"

    def cancel(self, request: dict[str, Any], reply: Reply) -> None:
        """Serve `cancel_goal` as rcl_action does: for one goal, all up to a time, or all."""
        info = request["goal_info"]
        name = bytes(info["goal_id"]["uuid"]).hex()
        until = _time(info["stamp"])
        is_all = not int(name, 16) and not until
        with self._lock:
            chosen = [
                goal
                for goal in self._goals.values()
                if goal.status == ActionStatus.EXECUTING
                and (is_all or goal.id == name or 0 < _time(goal.stamp) <= until)
            ]
            for goal in chosen:
                goal.status = ActionStatus.CANCELING
            is_known = name in self._goals
        code = _UNKNOWN_GOAL
        if chosen or is_all or until:
            code = _NONE
        elif is_known:
            code = _IS_OVER
        reply({"return_code": code, "goals_canceling": [goal.info for goal in chosen]})
        for goal in chosen:
            self._cancel(goal)
        with self._lock:
            self._publish()


def _uuid(name: str) -> Any:
    return np.frombuffer(bytes.fromhex(name), np.uint8)


def _time(stamp: Fields) -> int:
    """Return the time of a ROS stamp [ns]."""
    return int(stamp["sec"]) * 10**9 + int(stamp["nanosec"])
