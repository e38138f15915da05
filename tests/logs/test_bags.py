"""Poses of bags: topics and frames, ROS 1 and ROS 2, and what is wrong in bags of real robots."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.logs.ros import NINE, ODOMETRY, TF, Ros, Row, moved, stamped

import fleet2d
from fleet2d.logs import LogError, read_log

pytest.importorskip("rosbags", reason="the extra ros is not installed")


def drive(ros: Ros, topic: str = "/odom", begin: int = NINE) -> list[Row]:
    """Ten seconds along x, a message a second."""
    times = [begin + second * 10**9 for second in range(10)]
    return [(topic, ODOMETRY, t, ros.odometry(t, float(i), 2.0, 0.5)) for i, t in enumerate(times)]


@pytest.fixture(params=[1, 2])
def ros(request):
    return Ros(request.param)


def name_of(ros: Ros) -> str:
    return "drive" if ros.version == 2 else "drive.bag"


def test_odometry_is_read_in_the_local_time_of_the_home(ros, tmp_path):
    log: Any = read_log(ros.bag(tmp_path / name_of(ros), drive(ros)), time_zone="Europe/Berlin")

    assert ("bag", "2026-01-05") == (log.layout, str(log.first_day))
    nine = 9 * 3600 * 10**6
    assert [nine + i * 10**6 for i in range(10)] == log.time_us.tolist()
    assert [[float(i), 2.0] for i in range(10)] == log.xy.tolist()
    np.testing.assert_allclose(log.heading, 0.5)
    assert ("/odom: 10 poses in the frame 'map'",) == log.notes


def test_zone_is_asked_for(ros, tmp_path):
    path = ros.bag(tmp_path / name_of(ros), drive(ros))
    with pytest.raises(LogError, match="say which local time the home has by time_zone"):
        read_log(path)


def test_simulated_clock_counts_from_the_first_message(ros, tmp_path):
    log: Any = read_log(ros.bag(tmp_path / name_of(ros), drive(ros, begin=5 * 10**9)))

    assert (None, 0, 9 * 10**6) == (log.first_day, log.time_us[0], log.time_us[-1])


def test_one_of_several_poses_is_selected(ros, tmp_path):
    rows = drive(ros) + drive(ros, "/amcl")
    path = ros.bag(tmp_path / name_of(ros), rows)

    with pytest.raises(LogError, match="several poses: select one by 'id': /odom, /amcl"):
        read_log(path, time_zone="UTC")
    with pytest.raises(LogError, match="no topic or frame '/oodm': did you mean '/odom'"):
        read_log(path, time_zone="UTC", id="/oodm")
    log: Any = read_log(path, time_zone="UTC", id="/amcl")
    assert 10 == len(log.time_us)


def test_frame_is_followed_through_its_tree(ros, tmp_path):
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

    share = [min(max(i - 2, 0) / 4, 1) for i in range(2, 10)]  # of the way to the correction
    expected = [(5 + 2 * part, i + part) for i, part in enumerate(share, 2)]
    np.testing.assert_allclose(log.xy, expected, atol=1e-12)
    np.testing.assert_allclose(log.heading, np.pi / 2)
    way = "transform from 'base_link' to 'map'"
    assert log.notes == (
        "base_link: 10 poses in the frame 'map'",
        f"2 poses before the first {way} were left out",
        f"2 poses use the last {way}, which is up to 3 s older",
    )


def test_frame_with_two_parents_is_refused(tmp_path):
    ros = Ros(2)
    rows = [
        ("/tf", TF, NINE, ros.transform(NINE, parent, "base_link", (0.0, 0.0, 0.0)))
        for parent in ("odom", "map")
    ]
    with pytest.raises(
        LogError, match=r"'base_link' has two parents, 'map' \(/tf\) and 'odom' \(/t"
    ):
        read_log(ros.bag(tmp_path / "bag", rows), time_zone="UTC", id="base_link")


def test_poses_in_odom_are_transformed_to_the_map(ros, tmp_path):
    rows = [moved(ros, "odom"), stamped(ros, "odom")]
    log: Any = read_log(ros.bag(tmp_path / name_of(ros), rows), time_zone="UTC")

    assert log.xy.tolist() == [[9.0, 4.0]]


@pytest.mark.parametrize(
    ("frame", "turn", "place", "heading"),
    [
        ("odom", (0.0, 0.0, 0.0, 1.0), (9.2, 4.0), 0.0),
        ("map", (0.0, 0.0, 1.414, 1.414), (7.2, 4.0), np.pi / 2),
    ],
)
def test_a_robot_is_where_its_bag_has_it_in_the_map(frame, turn, place, heading, tmp_path):
    """A drive along x at 2 cm/s from (7, 4), with `/tf` from map to odom by 2 m."""
    ros, rows = Ros(2), [moved(Ros(2), "odom")]
    for second in range(20):
        topic, kind, ns, message = stamped(ros, frame, turn, x=7 + 0.02 * second, after=second)
        rows.append((topic, kind, ns, message))
    bag = str(ros.bag(tmp_path / "bag", rows))
    replay = {"type": "replay", "path": bag, "id": "/pose", "time_zone": "UTC", "day": "date"}
    simulation = fleet2d.Simulation(
        "bundled:paper",
        "simulation.duration=20 s",
        "simulation.start=2026-01-05T08:00",
        robots={"astro": {"behaviors": [replay]}},
    )
    for _ in range(10):
        simulation.advance()

    astro = simulation.state["astro"]
    assert (astro["x"], astro["y"]) == pytest.approx(place, abs=0.01)
    assert astro["heading"] == pytest.approx(heading, abs=0.01)


@pytest.mark.parametrize("spelling", ["/odom", "odom"])
def test_a_slash_before_a_frame_makes_no_difference(spelling, tmp_path):
    ros = Ros(1)
    rows = [moved(ros, "odom", "/map"), stamped(ros, spelling)]
    log: Any = read_log(ros.bag(tmp_path / "drive.bag", rows), time_zone="UTC")

    assert log.xy.tolist() == [[9.0, 4.0]]


def test_frames_of_namespaces_are_followed_to_their_own_map(tmp_path):
    ros = Ros(2)
    rows = [
        moved(ros, "bob/odom", "bob/map", x=5.0),
        moved(ros, "astro/odom", "astro/map"),
        stamped(ros, "astro/odom"),
    ]
    log: Any = read_log(ros.bag(tmp_path / "bag", rows), time_zone="UTC", id="/pose")

    assert log.xy.tolist() == [[9.0, 4.0]]


def test_a_map_below_odom_is_found(tmp_path):
    ros = Ros(2)
    rows = [moved(ros, "map", "odom"), stamped(ros, "odom")]
    log: Any = read_log(ros.bag(tmp_path / "bag", rows), time_zone="UTC", id="/pose")

    assert log.xy.tolist() == [[5.0, 4.0]]


@pytest.mark.parametrize(
    ("links", "listed"),
    [([], "none"), ([("base_link", "odom")], "base_link, odom"), ([("x", "map")], "x, map")],
)
def test_poses_without_a_way_to_the_map_are_refused(links, listed, tmp_path):
    ros = Ros(2)
    rows = [*(moved(ros, *link) for link in links), stamped(ros, "odom")]
    path = ros.bag(tmp_path / "bag", rows)

    with pytest.raises(LogError) as caught:
        read_log(path, time_zone="UTC", id="/pose")
    assert str(caught.value).endswith(
        f"/pose: no transform leads from the frame 'odom' to 'map' (frames of /tf: {listed}); to"
        " take coordinates in 'odom' as those of the floor plan, write frame: {name: odom}"
    )
    log: Any = read_log(path, time_zone="UTC", id="/pose", frame="odom")
    assert log.xy.tolist() == [[7.0, 4.0]]


def test_poses_before_the_first_transform_are_left_out_and_counted(tmp_path):
    ros = Ros(2)
    late = NINE + 7 * 10**9
    link: Row = ("/tf", TF, late, ros.transform(late, "map", "odom", (2.0, 0.0, 0.0)))
    odometry = [
        ("/odom", ODOMETRY, t, ros.odometry(t, float(i), 2.0, 0.5, "odom"))
        for i, t in enumerate(range(NINE, NINE + 10 * 10**9, 10**9))
    ]
    log: Any = read_log(ros.bag(tmp_path / "bag", [*odometry, link]), time_zone="UTC", id="/odom")

    assert log.xy[:, 0].tolist() == [9.0, 10.0, 11.0]
    assert "7 poses before the first transform from 'odom' to 'map' were left out" in log.notes


def test_a_bag_whose_transforms_come_too_late_is_refused(tmp_path):
    ros = Ros(2)
    link: Row = ("/tf", TF, NINE, ros.transform(NINE + 1, "map", "odom", (2.0, 0.0, 0.0)))
    path = ros.bag(tmp_path / "bag", [link, stamped(ros, "odom")])
    with pytest.raises(LogError, match=r"no pose is left: .*; 1 poses before the first transform"):
        read_log(path, time_zone="UTC", id="/pose")


def test_poses_without_a_frame_count_as_in_the_map(tmp_path):
    ros = Ros(2)
    log: Any = read_log(ros.bag(tmp_path / "bag", [stamped(ros, "")]), time_zone="UTC")

    assert log.xy.tolist() == [[7.0, 4.0]]
    assert "1 poses without a frame count as in 'map'" in log.notes


@pytest.mark.parametrize(
    ("turn", "heading", "note"),
    [
        ((0.0, 0.0, 1.414, 1.414), np.pi / 2, ""),
        ((0.0, 0.0, -3.0, 3.0), -np.pi / 2, ""),
        ((0.0, 0.0, 0.0, 0.0), np.nan, "1 poses have no heading: their quaternion is 0 or not"),
        ((0.0, 0.0, np.nan, 1.0), np.nan, "1 poses have no heading: their quaternion is 0 or not"),
        ((0.6, 0.0, 0.0, 0.8), 0.0, "1 poses are tilted by more than 45 degrees"),
    ],
)
def test_quaternions_are_normalized_or_say_nothing(turn, heading, note, tmp_path):
    ros = Ros(2)
    log: Any = read_log(ros.bag(tmp_path / "bag", [stamped(ros, "map", turn)]), time_zone="UTC")

    np.testing.assert_allclose(log.heading, [heading])
    assert len(log.notes) == 1 + bool(note)
    assert log.notes[-1].startswith(note)


def test_a_transform_without_a_turn_is_left_out_and_counted(tmp_path):
    ros = Ros(2)
    broken = ros.transform(NINE, "map", "odom", (50.0, 0.0, 0.0))
    broken.transforms[0].transform.rotation.w = 0.0
    rows = [("/tf", TF, NINE, broken), moved(ros, "odom"), stamped(ros, "odom")]
    log: Any = read_log(ros.bag(tmp_path / "bag", rows), time_zone="UTC", id="/pose")

    assert log.xy.tolist() == [[9.0, 4.0]]
    assert "1 transforms without a place or a turn were left out" in log.notes


def test_odometry_of_a_sensor_is_told(tmp_path):
    ros = Ros(2)
    row = ("/vio", ODOMETRY, NINE, ros.odometry(NINE, 1.0, 2.0, 0.0, "map", "camera_link"))
    log: Any = read_log(ros.bag(tmp_path / "bag", [row]), time_zone="UTC")

    assert log.notes[-1] == "/vio: these are poses of 'camera_link', not of a base_link"


def test_a_frame_that_never_moves_is_refused(tmp_path):
    ros = Ros(2)
    dock: Row = ("/tf_static", TF, NINE, ros.transform(0, "map", "dock", (1.0, 0.0, 0.0)))
    with pytest.raises(LogError, match="the frame 'dock' never moves in 'map'"):
        read_log(ros.bag(tmp_path / "bag", [dock]), time_zone="UTC", id="dock")


def test_a_transform_topic_is_read(tmp_path):
    ros = Ros(2)
    kind = "geometry_msgs/msg/TransformStamped"
    one = ros.transform(NINE, "map", "astro", (3.0, 4.0, 0.5)).transforms[0]
    log: Any = read_log(ros.bag(tmp_path / "bag", [("/vicon", kind, NINE, one)]), time_zone="UTC")

    assert log.xy.tolist() == [[3.0, 4.0]]
    np.testing.assert_allclose(log.heading, 0.5)


def test_all_publishers_of_a_topic_are_read(tmp_path):
    """ROS 1 keeps a connection for each: only the last one's messages were read."""
    from rosbags.rosbag1 import Writer

    ros = Ros(1)
    with Writer(tmp_path / "drive.bag") as writer:
        for i, caller in enumerate(("/first", "/second")):
            connection = writer.add_connection(
                "/odom", ODOMETRY, typestore=ros.types, callerid=caller
            )
            ns = NINE + i * 10**9
            message = ros.odometry(ns, float(i), 2.0, 0.0)
            writer.write(connection, ns, bytes(ros.types.serialize_ros1(message, ODOMETRY)))
    log: Any = read_log(tmp_path / "drive.bag", time_zone="UTC")

    assert log.xy[:, 0].tolist() == [0.0, 1.0]


def test_a_simulated_clock_may_begin_at_zero(ros, tmp_path):
    """The stamp 0 was replaced by the time of recording, of another clock."""
    rows = [(*row[:2], NINE + i, row[3]) for i, row in enumerate(drive(ros, begin=0))]
    log: Any = read_log(ros.bag(tmp_path / name_of(ros), rows))

    assert (None, 0, 9 * 10**6) == (log.first_day, log.time_us[0], log.time_us[-1])


def test_transforms_in_a_circle_are_refused(tmp_path):
    ros = Ros(2)
    rows = [
        ("/tf", TF, NINE, ros.transform(NINE, *names, (0.0, 0.0, 0.0)))
        for names in (("a", "b"), ("b", "a"))
    ]
    with pytest.raises(LogError, match="a circle: a > b > a"):
        read_log(ros.bag(tmp_path / "bag", rows), time_zone="UTC", id="a")


def test_stamps_that_run_backwards_are_refused_or_sorted(ros, tmp_path):
    rows = drive(ros)
    rows[3], rows[7] = rows[7], rows[3]
    rows = [(*row[:2], NINE + i, row[3]) for i, row in enumerate(rows)]
    path = ros.bag(tmp_path / name_of(ros), rows)

    with pytest.raises(LogError, match="the time runs backwards there"):
        read_log(path, time_zone="UTC")
    log: Any = read_log(path, time_zone="UTC", sort=True)
    assert [float(i) for i in range(10)] == log.xy[:, 0].tolist()


def test_bag_without_poses_lists_its_topics(tmp_path):
    ros = Ros(2)
    row = ("/chatter", "std_msgs/msg/String", NINE, ros.new("std_msgs/msg/String", "hello"))
    with pytest.raises(LogError, match="no poses: no odometry, poses or /tf among /chatter"):
        read_log(ros.bag(tmp_path / "bag", [row]))


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:200])


def _noise(path: Path) -> None:
    path.write_bytes(b"no bag at all" * 100)


@pytest.mark.parametrize("damage", [_cut, _noise])
def test_damaged_bag_is_one_line(damage, tmp_path):
    path = Ros(1).bag(tmp_path / "drive.bag", drive(Ros(1)))
    damage(path)
    with pytest.raises(LogError, match=r"drive\.bag can't be read as a bag") as caught:
        read_log(path, time_zone="UTC")
    assert "\n" not in str(caught.value)


def test_columns_are_not_for_bags(ros, tmp_path):
    path = ros.bag(tmp_path / name_of(ros), drive(ros))
    with pytest.raises(LogError, match="columns are for tables"):
        read_log(path, columns={"x": "east"})


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bag", "run.mcap"])
def test_exported_run_is_driven_again(name, tmp_path):
    """There and back: a robot that follows the bag of a run is where it was in that run."""
    first = fleet2d.run("bundled:paper", "simulation.duration=40 min", seed=4)
    fleet2d.export(first, tmp_path / name)
    bag = {"path": str(tmp_path / name), "id": "astro/base_link", "time_zone": "UTC"}
    again = fleet2d.run(
        "bundled:paper",
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
