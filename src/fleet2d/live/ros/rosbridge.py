"""rosbridge: the topics of a live run on a rosbridge server, and messages of ROS to the run.

Subscribed, for each body: `/NAME/goal_pose` and `/NAME/pose` in the frame `map`, and for each robot
`/NAME/cmd_vel`. The states of goals are on `/NAME/goal_state`, as JSON.
"""

import contextlib
import math
from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any

import numpy as np

from fleet2d.engine.simulation import Simulation
from fleet2d.errors import extra
from fleet2d.live.bridge import Content, LiveStep, Peer, Post, lose, missing
from fleet2d.live.ros.reading import POSE, TWISTS, contents_of, velocities_of
from fleet2d.live.ros.topics import RosTopics
from fleet2d.runs.run import Run

WAIT_S = 5


class RosbridgePeer(Peer):
    """A rosbridge server, such as that of the ROS package `rosbridge_server`."""

    def __init__(self, host: str, port: int) -> None:
        """Connect to a server; where there is none yet, the connection is tried again.

        Raises:
            InputError: roslibpy isn't installed.
        """
        with extra("rosbridge", "rosbridge:// needs roslibpy"):
            import roslibpy

        self._library: Any = roslibpy
        self._address = f"rosbridge://{host}:{port}"
        _quiet_twisted()
        self._ros = roslibpy.Ros(host=host, port=port)
        with contextlib.suppress(self._library.core.RosTimeoutError):
            self._ros.run(timeout=WAIT_S)
        self._topics: dict[str, Any] = {}
        self._subscribed: list[Any] = []

    def open(self, simulation: Simulation, post: Post) -> None:
        """Advertise and subscribe."""
        self._messages = RosTopics(simulation)
        self._simulation = simulation
        if not self._ros.is_connected:
            post(missing(self._address, "server"))
        self._ros.on("close", lambda *_: lose(post, self._address))
        for topic in self._messages.all:
            self._advertise(topic.name, topic.type, is_latched=topic.is_latched)
        for name in simulation.actors:
            self._advertise(f"/{name}/goal_state", "std_msgs/msg/String")
            goals = partial(self._poses_of, name, "goal")
            poses = partial(self._poses_of, name, "pose")
            self._subscribe(f"/{name}/goal_pose", POSE, post, goals)
            self._subscribe(f"/{name}/pose", POSE, post, poses)
        for name in simulation.scenario.robots:
            for kind in TWISTS:
                self._subscribe(f"/{name}/cmd_vel", kind, post, partial(velocities_of, name))
        self._publish_latched()
        self._ros.on("ready", lambda _: self._publish_latched())

    def _advertise(self, name: str, kind: str, *, is_latched: bool = False) -> None:
        topic = self._library.Topic(self._ros, name, _plain(kind), latch=is_latched)
        self._topics[name] = topic
        topic.advertise()

    def _subscribe(
        self, name: str, kind: str, post: Post, read: Callable[[str, object], Iterator[Content]]
    ) -> None:
        def receive(message: object) -> None:
            for content in read(name, message):
                post(content)

        topic = self._library.Topic(self._ros, name, _plain(kind))
        self._subscribed.append(topic)
        topic.subscribe(receive)

    def _poses_of(self, name: str, kind: str, topic: str, message: object) -> Iterator[Content]:
        now_ns = self._messages.time_ns(self._simulation.step)
        return contents_of(name, kind, topic, message, now_ns)

    def _publish_latched(self) -> None:
        for topic, message in self._messages.once():
            self._topics[topic.name].publish(_as_json(message))

    def send(self, frame: LiveStep) -> None:
        """Publish a frame; without a server, roslibpy would keep all of them."""
        if not self._ros.is_connected:
            return
        for topic, message in self._messages.of(frame):
            self._topics[topic.name].publish(_as_json(message))
        for goal in frame.goals:
            self._topics[f"/{goal.entity}/goal_state"].publish({"data": goal.text()})

    def close(self, run: Run) -> None:
        """Disconnect."""
        for topic in self._subscribed:
            topic.unsubscribe()
        for topic in self._topics.values():
            topic.unadvertise()
        self._ros.close()


def _plain(kind: str) -> str:
    """Return the name of a type that both versions of ROS know, such as nav_msgs/Odometry."""
    return kind.replace("/msg/", "/")


def _as_json(value: Any) -> Any:
    """Return a message with lists in place of arrays, and null for numbers that aren't finite."""
    if isinstance(value, np.ndarray):
        return _as_json(value.tolist())
    if isinstance(value, dict):
        return {key: _as_json(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_as_json(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@cache
def _quiet_twisted() -> None:
    """Keep Twisted from writing errors to the terminal: roslibpy passes them to its logger."""
    from twisted.logger import globalLogBeginner

    globalLogBeginner.beginLoggingTo([], redirectStandardIO=False)
