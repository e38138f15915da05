"""Poses of bags: topics and frames, ROS 1 and ROS 2, and what is wrong in bags of real robots."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fleet2d
from fleet2d.logs import LogError, read_log

pytest.importorskip("rosbags", reason="the extra ros is not installed")
NINE = 1_767_600_000 * 10**9  # 2026-01-05T08:00 UTC, 09:00 in Berlin
Row = tuple[str, str, int, Any]


class Ros:
    """Messages of ROS, and bags of them."""

    def __init__(self, version: int) -> None:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.version = version
        self.types = get_typestore(Stores.ROS2_HUMBLE if version == 2 else Stores.ROS1_NOETIC)
        if TF not in self.types.types:
            text = "geometry_msgs/TransformStamped[] transforms"
            self.types.register(get_types_from_msg(text, TF))

    def new(self, name: str, *values: Any) -> Any:
        return self.types.types[name](*values)

    def header(self, ns: int, frame: str) -> Any:
        stamp = self.new("builtin_interfaces/msg/Time", *divmod(ns, 10**9))
        sequence = () if self.version == 2 else (0,)
        return self.new("std_msgs/msg/Header", *sequence, stamp, frame)

    def pose(self, x: float, y: float, heading: float) -> Any:
        turn = (0.0, 0.0, float(np.sin(heading / 2)), float(np.cos(heading / 2)))
        return self.new(
            "geometry_msgs/msg/Pose",
            self.new("geometry_msgs/msg/Point", x, y, 0.0),
            self.new("geometry_msgs/msg/Quaternion", *turn),
        )

    def odometry(self, ns: int, x: float, y: float, heading: float) -> Any:
        still = self.new("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = self.new("geometry_msgs/msg/Twist", still, still)
        return self.new(
            "nav_msgs/msg/Odometry",
            self.header(ns, "odom"),
            "base_link",
            self.new(
                "geometry_msgs/msg/PoseWithCovariance", self.pose(x, y, heading), np.zeros(36)
            ),
            self.new("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)),
        )

    def transform(self, ns: int, parent: str, child: str, pose: tuple[float, ...]) -> Any:
        x, y, heading = pose
        turn = self.pose(x, y, heading).orientation
        move = self.new(
            "geometry_msgs/msg/Transform", self.new("geometry_msgs/msg/Vector3", x, y, 0.0), turn
        )
        one = self.new("geometry_msgs/msg/TransformStamped", self.header(ns, parent), child, move)
        return self.new("tf2_msgs/msg/TFMessage", [one])

    def bag(self, path: Path, rows: Iterable[Row]) -> Path:
        """Write messages: topic, type, time [ns], message."""
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import Writer as Writer2

        writer: Any = Writer2(path, version=9) if self.version == 2 else Writer1(path)
        with writer:
            connections: dict[str, Any] = {}
            for topic, kind, ns, message in rows:
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=self.types)
                serialize = (
                    self.types.serialize_cdr if self.version == 2 else self.types.serialize_ros1
                )
                writer.write(connections[topic], ns, bytes(serialize(message, kind)))
        return path


ODOMETRY = "nav_msgs/msg/Odometry"
TF = "tf2_msgs/msg/TFMessage"


def drive(ros: Ros, topic: str = "/odom", begin: int = NINE) -> list[Row]:
    """Ten seconds along x, a message a second."""
    times = [begin + second * 10**9 for second in range(10)]
    return [(topic, ODOMETRY, t, ros.odometry(t, float(i), 2.0, 0.5)) for i, t in enumerate(times)]


@pytest.fixture(params=[1, 2])
def ros(request: pytest.FixtureRequest) -> Ros:
    return Ros(request.param)


def name_of(ros: Ros) -> str:
    return "drive" if ros.version == 2 else "drive.bag"


def test_odometry_is_read_in_the_local_time_of_the_home(ros: Ros, tmp_path: Path) -> None:
    log: Any = read_log(ros.bag(tmp_path / name_of(ros), drive(ros)), time_zone="Europe/Berlin")

    assert ("bag", "2026-01-05") == (log.layout, str(log.first_day))
    nine = 9 * 3600 * 10**6
    assert [nine + i * 10**6 for i in range(10)] == log.time_us.tolist()
    assert [[float(i), 2.0] for i in range(10)] == log.xy.tolist()
    np.testing.assert_allclose(log.heading, 0.5)
    assert ("/odom: 10 poses in the frame 'odom'",) == log.notes


def test_zone_is_asked_for(ros: Ros, tmp_path: Path) -> None:
    path = ros.bag(tmp_path / name_of(ros), drive(ros))
    with pytest.raises(LogError, match="say which local time the home has by time_zone"):
        read_log(path)


def test_simulated_clock_counts_from_the_first_message(ros: Ros, tmp_path: Path) -> None:
    log: Any = read_log(ros.bag(tmp_path / name_of(ros), drive(ros, begin=5 * 10**9)))

    assert (None, 0, 9 * 10**6) == (log.first_day, log.time_us[0], log.time_us[-1])


def test_one_of_several_poses_is_selected(ros: Ros, tmp_path: Path) -> None:
    rows = drive(ros) + drive(ros, "/amcl")
    path = ros.bag(tmp_path / name_of(ros), rows)

    with pytest.raises(LogError, match="several poses: select one by 'id': /odom, /amcl"):
        read_log(path, time_zone="UTC")
    with pytest.raises(LogError, match="no topic or frame '/oodm': did you mean '/odom'"):
        read_log(path, time_zone="UTC", id="/oodm")
    log: Any = read_log(path, time_zone="UTC", id="/amcl")
    assert 10 == len(log.time_us)


def test_frame_is_followed_through_its_tree(ros: Ros, tmp_path: Path) -> None:
    """A corrected odometry: the robot drives along its own x, the map turned by a quarter."""
    rows: list[Row] = [
        ("/tf_static", TF, NINE, ros.transform(0, "base_link", "lidar", (0.1, 0.0, 0.0)))
    ]
    for i in range(10):
        t = NINE + i * 10**9
        rows.append(("/tf", TF, t, ros.transform(t, "odom", "base_link", (float(i), 0.0, 0.0))))
        if i in (2, 6):
            pose = (5.0, 0.0, np.pi / 2) if i == 2 else (7.0, 1.0, np.pi / 2)
            rows.append(("/tf", TF, t, ros.transform(t, "map", "odom", pose)))
    log: Any = read_log(ros.bag(tmp_path / name_of(ros), rows), time_zone="UTC", id="base_link")

    expected = [(5, i) if i < 6 else (7, 1 + i) for i in range(2, 10)]
    np.testing.assert_allclose(log.xy, expected, atol=1e-12)
    np.testing.assert_allclose(log.heading, np.pi / 2)
    assert "base_link: 8 poses in the frame 'map'" in log.notes


def test_frame_with_two_parents_is_refused(tmp_path: Path) -> None:
    ros = Ros(2)
    rows = [
        ("/tf", TF, NINE, ros.transform(NINE, parent, "base_link", (0.0, 0.0, 0.0)))
        for parent in ("odom", "map")
    ]
    with pytest.raises(LogError, match="'base_link' has two parents, 'odom' and 'map'"):
        read_log(ros.bag(tmp_path / "bag", rows), time_zone="UTC", id="base_link")


def test_transforms_in_a_circle_are_refused(tmp_path: Path) -> None:
    ros = Ros(2)
    rows = [
        ("/tf", TF, NINE, ros.transform(NINE, *names, (0.0, 0.0, 0.0)))
        for names in (("a", "b"), ("b", "a"))
    ]
    with pytest.raises(LogError, match="a circle: a > b > a"):
        read_log(ros.bag(tmp_path / "bag", rows), time_zone="UTC", id="a")


def test_stamps_that_run_backwards_are_refused_or_sorted(ros: Ros, tmp_path: Path) -> None:
    rows = drive(ros)
    rows[3], rows[7] = rows[7], rows[3]
    rows = [(*row[:2], NINE + i, row[3]) for i, row in enumerate(rows)]
    path = ros.bag(tmp_path / name_of(ros), rows)

    with pytest.raises(LogError, match="the time runs backwards there"):
        read_log(path, time_zone="UTC")
    log: Any = read_log(path, time_zone="UTC", sort=True)
    assert [float(i) for i in range(10)] == log.xy[:, 0].tolist()


def test_bag_without_poses_lists_its_topics(tmp_path: Path) -> None:
    ros = Ros(2)
    row = ("/chatter", "std_msgs/msg/String", NINE, ros.new("std_msgs/msg/String", "hello"))
    with pytest.raises(LogError, match="no poses: no odometry, poses or /tf among /chatter"):
        read_log(ros.bag(tmp_path / "bag", [row]))


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:200])


def _noise(path: Path) -> None:
    path.write_bytes(b"no bag at all" * 100)


@pytest.mark.parametrize("damage", [_cut, _noise])
def test_damaged_bag_is_one_line(damage: Callable[[Path], None], tmp_path: Path) -> None:
    path = Ros(1).bag(tmp_path / "drive.bag", drive(Ros(1)))
    damage(path)
    with pytest.raises(LogError, match=r"drive\.bag can't be read as a bag") as caught:
        read_log(path, time_zone="UTC")
    assert "\n" not in str(caught.value)


def test_columns_are_not_for_bags(ros: Ros, tmp_path: Path) -> None:
    path = ros.bag(tmp_path / name_of(ros), drive(ros))
    with pytest.raises(LogError, match="columns are for tables"):
        read_log(path, columns={"x": "east"})


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bag", "run.mcap"])
def test_exported_run_is_driven_again(name: str, tmp_path: Path) -> None:
    """There and back: a robot that follows the bag of a run is where it was in that run."""
    first = fleet2d.run("bundled:base", "simulation.duration=40 min", seed=4)
    fleet2d.export(first, tmp_path / name)
    bag = {"path": str(tmp_path / name), "id": "astro/base_link", "time_zone": "UTC"}
    again = fleet2d.run(
        "bundled:base",
        "simulation.duration=40 min",
        seed=4,
        robots={"astro": {"behaviors": [{"type": "replay", **bag}]}},
    )

    files = {Path(file["path"]).name for file in again.manifest["inputs"]}
    assert files >= ({name} if name == "run.mcap" else {"metadata.yaml"})
    before, after = first.path("astro"), again.path("astro")

    # At a corner between two messages it takes the straight way.
    np.testing.assert_allclose(before.x, after.x, atol=0.03)
    np.testing.assert_allclose(before.y, after.y, atol=0.03)
