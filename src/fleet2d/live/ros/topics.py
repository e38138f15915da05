"""The topics, types and frames that a run publishes to ROS, by whichever way.

A message is a mapping of the fields of its type in ROS 2; fields that are left out are 0 or empty.
Frames and stamps are those of `fleet2d export`: the truth about bodies is in `/tf` and
`/NAME/odom`, what a robot knows of people in `/NAME/detections` and `/NAME/people`.
"""

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fleet2d.kernels import F64, Mesh, region_outline, visible_region
from fleet2d.live.twists import twists
from fleet2d.runtime.local_time import stamp_us

if TYPE_CHECKING:
    from fleet2d.engine.simulation import Simulation
    from fleet2d.floorplan.plan import FloorPlan
    from fleet2d.live.bridge import LiveStep

BEAMS = 360
"""Number of beams of a laser scan, over a whole turn."""
SCAN_RANGE_M = 12.0
EXACT = np.zeros(36)
"""The covariance of an exact pose."""
PERSON_M = (0.4, 0.4, 1.7)
"""The box of a detected person, whose true size no robot knows: x, y, z [m]."""
UNKNOWN = "unknown"
"""The class of a detected person who wasn't recognized."""
_CHARGING = 1  # of sensor_msgs/msg/BatteryState
_DISCHARGING = 2
_NOT_CHARGING = 3


class RosTopic(NamedTuple):
    """A topic.

    Attributes:
        name: Its name, such as `/astro/odom`.
        type: The type of its messages, such as `nav_msgs/msg/Odometry`.
        is_latched: Whether later subscribers get its last message, too.
    """

    name: str
    type: str
    is_latched: bool = False


Fields = Mapping[str, Any]
"""A message, or a part of one, as a mapping of its fields."""
Message = tuple[RosTopic, Fields]


class RosTopics:
    """The topics of a run.

    Attributes:
        all: The topics, in the order in which a step is published.
    """

    def __init__(self, simulation: "Simulation", root: str | None = None) -> None:
        """Collect the topics of a run.

        Args:
            simulation: The run.
            root: The robot whose topics and frames have no prefix, as programs for a single robot
                expect it.
        """
        self._simulation = simulation
        self._root = root
        self._start_ns = stamp_us(simulation.clock.start) * 1000
        self._step_ns = simulation.clock.step_us * 1000
        self._last: dict[str, F64] = {}
        self._scans: dict[str, tuple[object, Any]] = {}
        self._clock = RosTopic("/clock", "rosgraph_msgs/msg/Clock")
        self._map = RosTopic("/map", "nav_msgs/msg/OccupancyGrid", is_latched=True)
        self._tf = RosTopic("/tf", "tf2_msgs/msg/TFMessage")
        self._static = RosTopic("/tf_static", "tf2_msgs/msg/TFMessage", is_latched=True)
        self._robots = {name: self._topics_of(name) for name in simulation.scenario.robots}
        self.all = [self._clock, self._map, self._static, self._tf]
        for topics in self._robots.values():
            self.all += topics.values()

    def _topics_of(self, robot: str) -> dict[str, RosTopic]:
        types = {
            "odom": "nav_msgs/msg/Odometry",
            "scan": "sensor_msgs/msg/LaserScan",
            "detections": "vision_msgs/msg/Detection3DArray",
            "people": "people_msgs/msg/People",
        }
        if self._simulation.actors[robot].charge is not None:
            types["battery_state"] = "sensor_msgs/msg/BatteryState"
        return {key: RosTopic(self.name(robot, key), of) for key, of in types.items()}

    def name(self, body: str, topic: str) -> str:
        """Return the name of a topic of a body."""
        return f"/{topic}" if body == self._root else f"/{body}/{topic}"

    def frame(self, robot: str, frame: str) -> str:
        """Return the name of a frame of a robot."""
        return frame if robot == self._root else f"{robot}/{frame}"

    def time_ns(self, step: int) -> int:
        """Return the simulated time of a step [ns since 1970]."""
        return self._start_ns + step * self._step_ns

    def stamp(self, step: int) -> dict[str, int]:
        """Return the simulated time of a step."""
        return stamp_at(self.time_ns(step))

    def once(self, step: int = 0) -> Iterator[Message]:
        """Yield the latched messages: the map, and the static frames."""
        header = self._header(step, "map")
        yield self._map, occupancy_grid(header, self._simulation.home.plan)
        still = pose_at(0.0, 0.0, 0.0)
        fixed = [transform(header, self.frame(robot, "odom"), still) for robot in self._robots]
        yield self._static, {"transforms": fixed}

    def of(self, frame: "LiveStep") -> Iterator[Message]:
        """Yield the messages of a step, the clock first, so that stamps are known times."""
        step = frame.step
        yield self._clock, {"clock": self.stamp(step)}
        present = {name: body for name, body in frame.bodies.items() if not body["away"]}
        moved = [self._moved(step, name, body) for name, body in present.items()]
        yield self._tf, {"transforms": moved}
        observations = [row for table, row in frame.rows if table == "observations"]
        for robot, topics in self._robots.items():
            if robot in present:
                yield topics["odom"], self._odometry(step, robot, present[robot])
                yield topics["scan"], self._scan(step, robot, present[robot])
            if "battery_state" in topics:
                yield topics["battery_state"], self._battery(step, robot)
            seen = [row for row in observations if row["robot"] == robot]
            if seen:
                yield topics["detections"], self._detections(step, seen)
                yield topics["people"], self._people(step, seen)

    def _moved(self, step: int, name: str, body: Mapping[str, Any]) -> dict[str, Any]:
        pose = pose_at(body["x"], body["y"], body["heading"])
        if name not in self._robots:
            return transform(self._header(step, "map"), name, pose)
        header = self._header(step, self.frame(name, "odom"))
        return transform(header, self.frame(name, "base_link"), pose)

    def _odometry(self, step: int, robot: str, body: Mapping[str, Any]) -> dict[str, Any]:
        x = body["x"]
        y = body["y"]
        heading = body["heading"]
        pose = np.array([[x, y, heading]])
        before = self._last.get(robot, pose)
        self._last[robot] = pose
        plan = self._simulation.home.plan
        (speeds,) = twists(plan, before, pose, self._step_ns / 1e9).tolist()
        header = self._header(step, self.frame(robot, "odom"))
        return odometry(header, self.frame(robot, "base_link"), pose_at(x, y, heading), speeds)

    def _scan(self, step: int, robot: str, body: Mapping[str, Any]) -> dict[str, Any]:
        home = self._simulation.home
        key = body["x"], body["y"], body["heading"], home.walls
        if robot not in self._scans or self._scans[robot][0] != key:
            x, y = home.plan.lattice.point_at((body["x"], body["y"]))
            metres = scan_of(home.walls, x, y, body["heading"]) / home.plan.lattice.units_per_m
            ranges = np.where(metres <= SCAN_RANGE_M, metres, np.inf).astype(np.float32)
            self._scans[robot] = key, ranges
        return {
            "header": self._header(step, self.frame(robot, "base_link")),
            "angle_min": -math.pi,
            "angle_max": math.pi - 2 * math.pi / BEAMS,
            "angle_increment": 2 * math.pi / BEAMS,
            "scan_time": self._step_ns / 1e9,
            "range_max": SCAN_RANGE_M,
            "ranges": self._scans[robot][1],
        }

    def _battery(self, step: int, robot: str) -> dict[str, Any]:
        actor = self._simulation.actors[robot]
        moment = np.array([self._simulation.step * self._simulation.clock.step_us])
        charge = actor.charge
        assert charge is not None
        course = charge.course(actor.motion)
        level = float(course.levels(moment)[0])
        piece = int(np.searchsorted(course.begins, moment[0], side="right")) - 1
        rate = course.rates[piece]
        state = _DISCHARGING
        if rate > 0:
            state = _NOT_CHARGING if level >= 1 else _CHARGING
        unknown = ("voltage", "temperature", "current", "charge", "capacity", "design_capacity")
        return {
            "header": self._header(step, self.frame(robot, "base_link")),
            "percentage": level,
            "power_supply_status": state,
            "present": True,
            **dict.fromkeys(unknown, math.nan),
        }

    def _detections(self, step: int, rows: list[Any]) -> dict[str, Any]:
        header = self._header(step, "map")
        detections = []
        for row in rows:
            pose = pose_at(row["x"], row["y"], 0.0)
            detections.append(detection(header, row["user"] or UNKNOWN, pose, pose))
        return {"header": header, "detections": detections}

    def _people(self, step: int, rows: list[Any]) -> dict[str, Any]:
        people = []
        for row in rows:
            name = row["user"] or UNKNOWN
            position = vector(row["x"], row["y"])
            velocity = vector()
            person = {"name": name, "position": position, "velocity": velocity, "reliability": 1.0}
            people.append(person)
        return {"header": self._header(step, "map"), "people": people}

    def _header(self, step: int, frame: str) -> dict[str, Any]:
        return {"stamp": self.stamp(step), "frame_id": frame}


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> dict[str, float]:
    """Return a vector or point."""
    return {"x": x, "y": y, "z": z}


def pose_at(x: float, y: float, heading: float) -> dict[str, Any]:
    """Return a pose on the floor."""
    return pose_of(x, y, math.sin(heading / 2), math.cos(heading / 2))


def pose_of(x: float, y: float, z: float, w: float) -> dict[str, Any]:
    """Return the pose on the floor whose quaternion has a z and w."""
    return {"position": vector(x, y), "orientation": {"x": 0.0, "y": 0.0, "z": z, "w": w}}


def stamp_at(time_ns: int) -> dict[str, int]:
    """Return a time [ns since 1970] as a stamp of ROS."""
    seconds, nanoseconds = divmod(time_ns, 10**9)
    return {"sec": seconds, "nanosec": nanoseconds}


def occupancy_grid(header: Fields, plan: "FloorPlan") -> dict[str, Any]:
    """Return the fields of the OccupancyGrid of a floor plan."""
    lattice = plan.lattice
    info = {
        "map_load_time": header["stamp"],
        "resolution": lattice.cell,
        "width": lattice.columns,
        "height": lattice.rows,
        "origin": pose_at(*lattice.origin, 0.0),
    }
    cells = np.where(plan.free, 0, 100).astype(np.int8).ravel()
    return {"header": header, "info": info, "data": cells}


def transform(header: Fields, child: str, pose: Fields) -> dict[str, Any]:
    """Return the fields of the TransformStamped of a frame at a pose."""
    moved = {"translation": pose["position"], "rotation": pose["orientation"]}
    return {"header": header, "child_frame_id": child, "transform": moved}


def odometry(
    header: Fields, child: str, pose: Fields, speeds: tuple[float, float, float]
) -> dict[str, Any]:
    """Return the fields of the Odometry of a robot, by its speeds ahead, to the left and turning.

    Speeds are in m/s and rad/s.
    """
    ahead, left, turning = speeds
    twist = {"linear": vector(ahead, left), "angular": vector(0.0, 0.0, turning)}
    return {
        "header": header,
        "child_frame_id": child,
        "pose": {"pose": pose, "covariance": EXACT},
        "twist": {"twist": twist, "covariance": EXACT},
    }


def detection(header: Fields, user: str, pose: Fields, centre: Fields) -> dict[str, Any]:
    """Return the fields of the Detection3D of a person, by its pose and its box's."""
    hypothesis = {"class_id": user, "score": 1.0}
    result = {"hypothesis": hypothesis, "pose": {"pose": pose, "covariance": EXACT}}
    extent = {"center": centre, "size": vector(*PERSON_M)}
    return {"header": header, "id": user, "results": [result], "bbox": extent}


def scan_of(walls: Mesh, x: int, y: int, heading: float) -> F64:
    """Return the ranges of a laser scanner to the next walls, float64 (BEAMS,) [lattice units].

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
    outline, *_ = region_outline(walls, x, y, *pieces)
    ends = outline.reshape(-1, 2, 2) - np.array([x, y])
    right = ends[:, 0]
    left = ends[:, 1]
    turn = 2 * math.pi
    angles = heading - math.pi + turn / BEAMS * np.arange(BEAMS)
    begins = np.arctan2(right[:, 1], right[:, 0]) % turn
    order = np.argsort(begins, kind="stable")
    piece = order[np.searchsorted(begins[order], angles % turn, side="right") - 1]
    wall_x, wall_y = (left - right)[piece].T
    start_x, start_y = right[piece].T
    across = np.cos(angles) * wall_y - np.sin(angles) * wall_x
    along = start_x * wall_y - start_y * wall_x
    distance: F64 = np.abs(along / np.where(across == 0, np.inf, across))
    return distance
