"""rosbridge: standard ROS messages of a live run to a robot's or a laptop's ROS, and goals from it.

Published: `/map`, `/tf`, and for each robot `/NAME/odom`, `/NAME/scan` and `/NAME/detections`, with
the frames of `fleet2d export`. Subscribed, for each body: `/NAME/goal_pose` and `/NAME/pose`, both
`geometry_msgs/PoseStamped` in the frame `map`.
"""

import math
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from pydantic import AliasChoices, BaseModel, Field, ValidationError

from fleet2d.bounds import one_line
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import InputError, extra
from fleet2d.kernels import F64, Mesh, region_outline, visible_region
from fleet2d.live.bridge import Content, LiveStep, Peer, PeerFault, Post, lose
from fleet2d.live.messages import first_fault
from fleet2d.logs.frames import MAP, frame_name, is_named
from fleet2d.runs.run import Run
from fleet2d.runtime.local_time import stamp_us
from fleet2d.storage.bags import LATEST_SIMULATED_NS, headings_of

WAIT_S = 5
BEAMS = 360
"""Number of beams of a laser scan, over a whole turn."""
SCAN_RANGE_M = 12.0
EXACT = [0.0] * 36
"""The covariance of what is known exactly."""


class RosbridgePeer(Peer):
    """A rosbridge server, such as that of the ROS package `rosbridge_server`."""

    def __init__(self, host: str, port: int) -> None:
        """Connect to a server.

        Raises:
            InputError: There is no server at the address, or roslibpy isn't installed.
        """
        with extra("rosbridge", "rosbridge:// needs roslibpy"):
            import roslibpy

        self._library: Any = roslibpy
        self._address = f"rosbridge://{host}:{port}"
        _quiet_twisted()
        self._ros = roslibpy.Ros(host=host, port=port)
        try:
            self._ros.run(timeout=WAIT_S)
        except Exception as error:
            self._ros.close()
            raise InputError(f"{self._address}: there is no server: {error}") from error
        self._topics: dict[str, Any] = {}

    def open(self, simulation: Simulation, post: Post) -> None:
        """Advertise and subscribe."""
        self._robots = list(simulation.scenario.robots)
        self._start_s = stamp_us(simulation.clock.start) // 1_000_000
        self._last: dict[str, tuple[float, float, float]] = {}
        self._step_s = simulation.clock.step_us / 1e6
        self._simulation = simulation
        self._ros.on("close", lambda *_: lose(post, self._address))
        for robot in self._robots:
            self._advertise(f"/{robot}/odom", "nav_msgs/Odometry")
            self._advertise(f"/{robot}/scan", "sensor_msgs/LaserScan")
            self._advertise(f"/{robot}/detections", "vision_msgs/Detection3DArray")
        self._advertise("/tf", "tf2_msgs/TFMessage")
        self._advertise("/map", "nav_msgs/OccupancyGrid", latch=True)
        chart = self._map(simulation)
        self._topics["/map"].publish(chart)
        self._ros.on("ready", lambda _: self._topics["/map"].publish(chart))  # again: it is latched
        for name in simulation.actors:
            self._subscribe(f"/{name}/goal_pose", name, "goal", post)
            self._subscribe(f"/{name}/pose", name, "pose", post)

    def _advertise(self, name: str, kind: str, *, latch: bool = False) -> None:
        self._topics[name] = self._library.Topic(self._ros, name, kind, latch=latch)
        self._topics[name].advertise()

    def _subscribe(self, topic: str, name: str, kind: str, post: Post) -> None:
        def receive(message: object) -> None:
            for content in contents_of(topic, name, kind, message):
                post(content)

        self._topics[topic] = self._library.Topic(self._ros, topic, "geometry_msgs/PoseStamped")
        self._topics[topic].subscribe(receive)

    def _map(self, simulation: Simulation) -> dict[str, Any]:
        plan = simulation.home.plan
        lattice = plan.lattice
        info = {
            "map_load_time": self._stamp(0),
            "resolution": lattice.cell,
            "width": lattice.columns,
            "height": lattice.rows,
            "origin": _pose(*lattice.origin, 0.0),
        }
        cells = np.where(plan.free, 0, 100).ravel().tolist()
        return {"header": self._header(0, "map"), "info": info, "data": cells}

    def send(self, frame: LiveStep) -> None:
        """Publish a frame."""
        present = {name: body for name, body in frame.bodies.items() if not body["away"]}
        transforms = []
        for name, body in present.items():
            x = body["x"]
            y = body["y"]
            heading = body["heading"]
            pose = _pose(x, y, heading)
            is_robot = name in self._robots
            parent, child = (f"{name}/odom", f"{name}/base_link") if is_robot else ("map", name)
            transforms.append(self._transform(frame.step, parent, child, pose))
            if is_robot:
                still = _pose(0.0, 0.0, 0.0)
                transforms.append(self._transform(frame.step, "map", parent, still))
                self._topics[f"/{name}/odom"].publish(self._odometry(frame.step, name, body))
                self._topics[f"/{name}/scan"].publish(self._scan(frame.step, name, body))
        self._topics["/tf"].publish({"transforms": transforms})
        for robot in self._robots:
            seen = [r for t, r in frame.rows if t == "observations" and r["robot"] == robot]
            if seen:
                self._topics[f"/{robot}/detections"].publish(self._detections(frame.step, seen))

    def _transform(
        self, step: int, parent: str, child: str, pose: dict[str, Any]
    ) -> dict[str, Any]:
        return {
            "header": self._header(step, parent),
            "child_frame_id": child,
            "transform": {"translation": pose["position"], "rotation": pose["orientation"]},
        }

    def _odometry(self, step: int, name: str, body: Any) -> dict[str, Any]:
        x = body["x"]
        y = body["y"]
        heading = body["heading"]
        before = self._last.get(name, (x, y, heading))
        self._last[name] = x, y, heading
        speed = math.hypot(x - before[0], y - before[1]) / self._step_s
        turn = (heading - before[2] + math.pi) % (2 * math.pi) - math.pi
        linear = {"x": speed, "y": 0.0, "z": 0.0}
        angular = {"x": 0.0, "y": 0.0, "z": turn / self._step_s}
        return {
            "header": self._header(step, f"{name}/odom"),
            "child_frame_id": f"{name}/base_link",
            "pose": {"pose": _pose(x, y, heading), "covariance": EXACT},
            "twist": {"twist": {"linear": linear, "angular": angular}, "covariance": EXACT},
        }

    def _scan(self, step: int, name: str, body: Any) -> dict[str, Any]:
        home = self._simulation.home
        x, y = home.plan.lattice.point_at((body["x"], body["y"]))
        ranges = scan_of(home.walls, x, y, body["heading"]) / home.plan.lattice.units_per_m
        return {
            "header": self._header(step, f"{name}/base_link"),
            "angle_min": -math.pi,
            "angle_max": math.pi - 2 * math.pi / BEAMS,
            "angle_increment": 2 * math.pi / BEAMS,
            "time_increment": 0.0,
            "scan_time": self._step_s,
            "range_min": 0.0,
            "range_max": SCAN_RANGE_M,
            "ranges": [r if r <= SCAN_RANGE_M else None for r in ranges.round(4).tolist()],
            "intensities": [],
        }

    def _detections(self, step: int, rows: list[Any]) -> dict[str, Any]:
        header = self._header(step, "map")
        detections = []
        for row in rows:
            user = row["user"] or "unknown"
            pose = _pose(row["x"], row["y"], 0.0)
            hypothesis = {"class_id": user, "score": 1.0}
            result = {"hypothesis": hypothesis, "pose": {"pose": pose, "covariance": EXACT}}
            box = {"center": pose, "size": {"x": 0.4, "y": 0.4, "z": 1.7}}
            detections.append({"header": header, "id": user, "results": [result], "bbox": box})
        return {"header": header, "detections": detections}

    def _stamp(self, step: int) -> dict[str, int]:
        ns = self._start_s * 10**9 + round(step * self._step_s * 1e9)
        return {"sec": ns // 10**9, "nanosec": ns % 10**9}

    def _header(self, step: int, frame: str) -> dict[str, Any]:
        return {"stamp": self._stamp(step), "frame_id": frame}

    def close(self, run: Run) -> None:
        """Disconnect."""
        for topic in self._topics.values():
            topic.unsubscribe() if topic.is_subscribed else topic.unadvertise()
        self._ros.close()


class _RosStamp(BaseModel):
    """A time of ROS 2, or of ROS 1."""

    sec: int = Field(default=0, ge=0, lt=1 << 32, validation_alias=AliasChoices("sec", "secs"))
    nanosec: int = Field(
        default=0, ge=0, lt=1 << 32, validation_alias=AliasChoices("nanosec", "nsecs")
    )


class _RosHeader(BaseModel):
    frame_id: str = ""
    stamp: _RosStamp = _RosStamp()


class _RosPoint(BaseModel):
    x: float
    y: float


class _RosQuaternion(BaseModel):
    """A turn; rosbridge has null for NaN."""

    x: float | None = 0.0
    y: float | None = 0.0
    z: float | None = 0.0
    w: float | None = 0.0


class _RosPose(BaseModel):
    position: _RosPoint
    orientation: _RosQuaternion = _RosQuaternion()


class _PoseStamped(BaseModel):
    """A `geometry_msgs/PoseStamped`."""

    header: _RosHeader = _RosHeader()
    pose: _RosPose


def contents_of(topic: str, name: str, kind: str, message: object) -> Iterator[Content]:
    """Yield the message to a run that a `PoseStamped` is, and what is odd about it.

    Args:
        topic: The topic on which it arrived.
        name: The body.
        kind: "pose" or "goal".
        message: The message of ROS as JSON has it.
    """
    try:
        stamped = _PoseStamped.model_validate(message)
    except ValidationError as error:
        yield PeerFault("wrong", f"{topic}: {first_fault(error)}", is_message=True)
        return
    frame = frame_name(stamped.header.frame_id)
    if frame and not is_named(frame, MAP):
        text = f"{topic} is in the frame {one_line(frame)!r}: only poses in {MAP!r} count"
        yield PeerFault("in other frames", text, is_message=True)
        return
    position = stamped.pose.position
    turn = stamped.pose.orientation
    content: dict[str, Any] = {"type": kind, "entity": name}
    content |= {"to": [position.x, position.y]} if kind == "goal" else dict(position)
    stamp_ns = stamped.header.stamp.sec * 1_000_000_000 + stamped.header.stamp.nanosec
    if stamp_ns >= LATEST_SIMULATED_NS:
        content["time"] = stamp_ns / 1e9
    elif stamp_ns:
        yield PeerFault("of a simulated clock", f"{topic}: nobody knows which messages are late")
    (heading,) = headings_of(np.array([[turn.x, turn.y, turn.z, turn.w]], np.float64))
    if math.isfinite(heading):
        content["heading_deg"] = math.degrees(heading)
    else:
        yield PeerFault("without heading", f"{topic}: the quaternion is 0 or not a number")
    yield content


@cache
def _quiet_twisted() -> None:
    """Keep Twisted from writing errors to the terminal: roslibpy passes them to its logger."""
    from twisted.logger import globalLogBeginner

    globalLogBeginner.beginLoggingTo([], redirectStandardIO=False)


def scan_of(walls: Mesh, x: int, y: int, heading: float) -> F64:
    """Return how far a laser scanner sees to the next wall, float64 (BEAMS,) [lattice units].

    Beams begin behind and turn counter-clockwise. Furniture and people are lower than the laser.

    Args:
        walls: The free space between walls and shut doors.
        x: Its place [lattice units].
        y: Its place [lattice units].
        heading: Its heading [rad].
    """
    pieces = visible_region(walls, x, y)
    if not len(pieces[0]):
        return np.zeros(BEAMS)
    ends = region_outline(walls, x, y, *pieces)[0].reshape(-1, 2, 2) - np.array([x, y])
    right, left = ends[:, 0], ends[:, 1]
    turn = 2 * math.pi
    angles = heading - math.pi + turn / BEAMS * np.arange(BEAMS)
    begins = np.arctan2(right[:, 1], right[:, 0]) % turn
    order = np.argsort(begins, kind="stable")
    piece = order[np.searchsorted(begins[order], angles % turn, side="right") - 1]
    direction = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    wall = (left - right)[piece]
    across = direction[:, 0] * wall[:, 1] - direction[:, 1] * wall[:, 0]
    start = right[piece]
    along = start[:, 0] * wall[:, 1] - start[:, 1] * wall[:, 0]
    distance: F64 = np.abs(along / np.where(across == 0, np.inf, across))
    return distance


def _pose(x: float, y: float, heading: float) -> dict[str, Any]:
    z, w = math.sin(heading / 2), math.cos(heading / 2)
    orientation = {"x": 0.0, "y": 0.0, "z": z, "w": w}
    return {"position": {"x": x, "y": y, "z": 0.0}, "orientation": orientation}
