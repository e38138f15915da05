"""ROS 2: a live run as a node that the graph of ROS sees, with ROS or without.

Where the library of ROS can be imported, it connects to the graph; else the protocol of `rmw_zenoh`
is spoken.

Published are the topics of `RosTopics`. Subscribed, for each body, are `/NAME/goal_pose` and
`/NAME/pose`, for each robot `/NAME/cmd_vel` and `/NAME/initialpose`; robots serve the action
`/NAME/navigate_to_pose`.
"""

import os
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from fleet2d.engine.simulation import Simulation
from fleet2d.errors import InputError
from fleet2d.live.bridge import Content, LiveStep, Peer, PeerFault, Post
from fleet2d.live.goals import GoalState, GoalStatus
from fleet2d.live.ros.node import LATCHED, USUAL, ActionGoal, ActionStatus, RosAction, RosNode
from fleet2d.live.ros.rclpy_node import RclpyNode, is_rclpy_there
from fleet2d.live.ros.reading import POSE, TWISTS, contents_of, velocities_of
from fleet2d.live.ros.topics import RosTopic, RosTopics, pose_at
from fleet2d.live.ros.types import DISTRIBUTIONS, NAVIGATE, RosTypes
from fleet2d.live.ros.zenoh_node import PORT, ZenohNode
from fleet2d.runs.run import Run

INITIAL_POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
GOAL_STATE = "std_msgs/msg/String"
DEFAULT_DISTRIBUTION = "jazzy"
MAX_DOMAIN = 232
FASTEST = 10.0
"""At more times real time, timers of programs with `use_sim_time` skip."""
# nav2_msgs/action/NavigateToPose: an error that none of its constants describes.
_UNKNOWN_ERROR = 9000
_STATUSES = {
    GoalStatus.REACHED: ActionStatus.SUCCEEDED,
    GoalStatus.IMPOSSIBLE: ActionStatus.ABORTED,
    GoalStatus.CANCELLED: ActionStatus.ABORTED,
}


def parse_place(path: str) -> tuple[str, str | None]:
    """Return the distribution, and the robot without a prefix, of the path of an address.

    Raises:
        InputError: There is no such distribution.

    Example:
        >>> parse_place("/kilted/astro")
        ('kilted', 'astro')
    """
    first, _, second = path.strip("/").partition("/")
    distribution = first or os.environ.get("ROS_DISTRO") or DEFAULT_DISTRIBUTION
    if distribution not in DISTRIBUTIONS:
        known = ", ".join(DISTRIBUTIONS)
        raise InputError(
            f"ros2://HOST:PORT/{distribution}: there is no such version of ROS 2: choose one of"
            f" {known}"
        )
    return distribution, second or None


def domain_of_environment() -> int:
    """Return the domain of ROS, `ROS_DOMAIN_ID`.

    Raises:
        InputError: The variable holds no domain.
    """
    text = os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if not (text.isascii() and text.isdigit() and int(text) <= MAX_DOMAIN):
        raise InputError(f"ROS_DOMAIN_ID is {text!r}: expected a number from 0 to {MAX_DOMAIN}")
    return int(text)


class Ros2Peer(Peer):
    """Programs of ROS 2; without ROS on this machine, those that use `rmw_zenoh`.

    Attributes:
        fastest: At more times real time, timers of programs with `use_sim_time` skip.
    """

    fastest = FASTEST

    def __init__(self, host: str = "localhost", port: int | None = None, path: str = "") -> None:
        """Join the graph.

        Args:
            host: The machine of zenoh's router; on this one it is started if there is none.
            port: Its port.
            path: `DISTRIBUTION/ROBOT`: the version of ROS 2, `ROS_DISTRO` by default; the robot
                whose topics and frames have no prefix.

        Raises:
            InputError: The version is unknown, there is no router at another machine, or a library
                isn't installed.
        """
        distribution, self._root = parse_place(path)
        domain = domain_of_environment()
        self._node: RosNode
        if is_rclpy_there():
            self._node = RclpyNode(distribution, domain)
        else:
            self._node = ZenohNode(RosTypes(distribution), host, port or PORT, domain=domain)
        self._publishers: dict[str, Callable[[Mapping[str, Any]], None]] = {}
        self._actions: dict[str, RosAction] = {}

    def open(self, simulation: Simulation, post: Post) -> None:
        """Publish latched messages, subscribe, and serve actions.

        Raises:
            InputError: The robot without a prefix isn't in the scenario.
        """
        robots = list(simulation.scenario.robots)
        if self._root is not None and self._root not in robots:
            self._node.close()
            raise InputError(f"ros2: there is no robot {self._root!r}, but {', '.join(robots)}")
        self._simulation = simulation
        self._post = post
        self._topics = RosTopics(simulation, self._root)
        for topic in self._topics.all:
            self._advertise(topic)
        for name in simulation.actors:
            self._advertise(RosTopic(self._name(name, "goal_state"), GOAL_STATE))
            self._subscribe(name, "goal_pose", POSE, partial(self._poses_of, name, "goal"))
            self._subscribe(name, "pose", POSE, partial(self._poses_of, name, "pose"))
        for name in robots:
            self._open_robot(name)
        for topic, message in self._topics.once():
            self._publishers[topic.name](message)
        for note in self._node.notes:
            post(PeerFault("left out", note))

    def _open_robot(self, name: str) -> None:
        for of in self._twists():
            self._subscribe(name, "cmd_vel", of, partial(velocities_of, name))
        self._subscribe(name, "initialpose", INITIAL_POSE, partial(self._initial_pose_of, name))
        self._actions[name] = self._node.action(
            self._name(name, "navigate_to_pose"),
            NAVIGATE,
            begin=partial(self._begin, name),
            cancel=lambda goal: self._post({"type": "cancel", "entity": name, "id": goal.id}),
            stamp=lambda: self._topics.stamp(simulation_step(self._simulation)),
        )

    def _twists(self) -> tuple[str, ...]:
        """Return the types of `cmd_vel` that are heard."""
        if self._node.hears_several_types:
            return TWISTS
        is_old = self._node.distribution in ("humble", "jazzy")
        return (TWISTS[0] if is_old else TWISTS[1],)

    def _name(self, body: str, topic: str) -> str:
        return self._topics.name(body, topic)

    def _advertise(self, topic: RosTopic) -> None:
        quality = LATCHED if topic.is_latched else USUAL
        self._publishers[topic.name] = self._node.publisher(topic.name, topic.type, quality)

    def _subscribe(
        self, name: str, topic: str, of: str, read: Callable[[str, object], Iterator[Content]]
    ) -> None:
        topic = self._name(name, topic)

        def receive(fields: dict[str, Any]) -> None:
            for content in read(topic, fields):
                self._post(content)

        def tell(fault: str) -> None:
            self._post(PeerFault("wrong", f"{topic}: {fault}", is_message=True))

        self._node.subscribe(topic, of, receive, tell)

    def _poses_of(self, name: str, kind: str, topic: str, message: object) -> Iterator[Content]:
        now_ns = self._topics.time_ns(self._simulation.step)
        return contents_of(name, kind, topic, message, now_ns)

    def _initial_pose_of(self, name: str, topic: str, message: Any) -> Iterator[Content]:
        return self._poses_of(name, "pose", topic, {**message, "pose": message["pose"]["pose"]})

    def _begin(self, robot: str, goal: ActionGoal) -> bool:
        """Pass a goal on if it is valid; whether the robot gets there is its result."""
        topic = f"{robot}: navigate_to_pose"
        contents = list(self._poses_of(robot, "goal", topic, goal.fields["pose"]))
        for content in contents:
            self._post({**content, "id": goal.id} if isinstance(content, dict) else content)
        return isinstance(contents[-1], dict)

    def send(self, frame: LiveStep) -> None:
        """Publish a frame, and send clients of actions the states of their goals."""
        for topic, message in self._topics.of(frame):
            self._publishers[topic.name](message)
        for goal in frame.goals:
            text = goal.text()
            self._publishers[self._name(goal.entity, "goal_state")]({"data": text})
            server = self._actions.get(goal.entity)
            asked = None if server is None else server.goal(goal.id)
            if server is not None and asked is not None:
                self._answer(server, asked, goal, frame)

    def _answer(
        self, server: RosAction, asked: ActionGoal, goal: GoalState, frame: LiveStep
    ) -> None:
        """Send the client of a goal its end, or feedback on the way."""
        status = _STATUSES.get(goal.state)
        if goal.state == GoalStatus.ACCEPTED:  # the client knows
            return
        if status is None:
            server.tell(asked, self._feedback(asked, goal, frame))
            return
        if goal.state == GoalStatus.CANCELLED and asked.status == ActionStatus.CANCELING:
            status = ActionStatus.CANCELED
        self._finish(server, asked, status, goal.detail)

    def _finish(self, server: RosAction, goal: ActionGoal, status: ActionStatus, why: str) -> None:
        has_errors = self._node.distribution != "humble"
        failed = {"error_code": _UNKNOWN_ERROR, "error_msg": why}
        is_failure = status == ActionStatus.ABORTED and has_errors
        server.finish(goal, status, failed if is_failure else {})

    def _feedback(self, asked: ActionGoal, goal: GoalState, frame: LiveStep) -> Mapping[str, Any]:
        body = frame.bodies[goal.entity]
        stamp = self._topics.stamp(frame.step)
        passed_s = stamp["sec"] - asked.stamp["sec"]
        passed_s += (stamp["nanosec"] - asked.stamp["nanosec"]) / 1e9
        pose = pose_at(body["x"], body["y"], body["heading"])
        return {
            "current_pose": {"header": {"stamp": stamp, "frame_id": "map"}, "pose": pose},
            "navigation_time": _duration(max(passed_s, 0.0)),
            "estimated_time_remaining": _duration(goal.seconds),
            "distance_remaining": goal.metres,
        }

    def close(self, run: Run) -> None:
        """End all goals, and leave the graph."""
        for server in self._actions.values():
            for goal in server.open_goals():
                self._finish(server, goal, ActionStatus.ABORTED, "the run is over")
        self._node.close()


def simulation_step(simulation: Simulation) -> int:
    """Return the step of the last frame, which the clock of ROS shows."""
    return max(0, simulation.step - 1)


def _duration(seconds: float) -> dict[str, int]:
    """Return a builtin_interfaces/msg/Duration."""
    nanoseconds = round(seconds * 1e9)
    return {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
