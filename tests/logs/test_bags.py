"""Poses of bags: topics and frames, ROS 1 and ROS 2, and what is wrong in bags of real robots."""

from pathlib import Path

import numpy as np
import pytest
from tests.logs.ros import NINE, ODOMETRY, TF, Ros, moved, stamped

import fleet2d
from fleet2d.logs import LogError, read_log

pytest.importorskip("rosbags", reason="the extra ros is not installed")


def drive(ros, topic="/odom", begin=NINE):
    """Ten seconds along x, a message a second."""
    times = [begin + second * 10**9 for second in range(10)]
    return [(topic, ODOMETRY, t, ros.odometry(t, float(i), 2.0, 0.5)) for i, t in enumerate(times)]


@pytest.fixture(params=[1, 2])
def ros(request):
    return Ros(request.param)


def read(ros, folder, rows, **settings):
    """Write messages to a bag, and read its poses."""
    path = ros.bag(folder / ("drive" if ros.version == 2 else "drive.bag"), rows)
    return read_log(path, **{"time_zone": "UTC", **settings})


def test_odometry_is_read_in_the_local_time_of_the_home(ros, tmp_path):
    log = read(ros, tmp_path, drive(ros), time_zone="Europe/Berlin")

    assert ("bag", "2026-01-05") == (log.layout, str(log.first_day))
    assert [(9 * 3600 + i) * 10**6 for i in range(10)] == log.time_us.tolist()
    assert [[float(i), 2.0] for i in range(10)] == log.xy.tolist()
    np.testing.assert_allclose(log.heading, 0.5)
    assert ("/odom: 10 poses in the frame 'map'",) == log.notes


ROS2 = Ros(2)


def backwards(ros):
    """The drive, recorded from its end to its beginning."""
    return [(*row[:2], NINE + i, row[3]) for i, row in enumerate(drive(ros)[::-1])]


def link(parent, child, topic="/tf"):
    """A transform that is none."""
    return topic, TF, NINE, ROS2.transform(NINE, parent, child, (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("rows", "settings", "message"),
    [
        (drive(ROS2), {"time_zone": None}, "say which local time the home has by time_zone"),
        (drive(ROS2), {"columns": {"x": "east"}}, "columns are for tables"),
        ([*drive(ROS2), *drive(ROS2, "/amcl")], {}, "several poses: select one by 'id': /odom, /amcl"),
        (drive(ROS2), {"id": "/oodm"}, "no topic or frame '/oodm': did you mean '/odom'"),
        (backwards(ROS2), {}, "the time runs backwards there"),
        ([link("map", "x"), link("odom", "x")], {"id": "x"}, r"'x' has two parents, 'map' \(/tf\) and 'odom' \(/t"),
        ([link("a", "b"), link("b", "a")], {"id": "a"}, "a circle: a > b > a"),
        ([link("map", "dock", "/tf_static")], {"id": "dock"}, "the frame 'dock' never moves in 'map'"),
    ],
)  # fmt: skip
def test_a_bag_that_leaves_something_open_is_refused(rows, settings, message, tmp_path):
    with pytest.raises(LogError, match=message):
        read(ROS2, tmp_path, rows, **settings)


def test_one_of_several_poses_is_selected(ros, tmp_path):
    log = read(ros, tmp_path, drive(ros) + drive(ros, "/amcl"), id="/amcl")

    assert 10 == len(log.time_us)


def test_frame_is_followed_through_its_tree(ros, tmp_path):
    """A corrected odometry: the robot drives along its own x, the map turned by a quarter."""
    rows = [("/tf_static", TF, NINE, ros.transform(0, "base_link", "lidar", (0.1, 0.0, 0.0)))]
    for second in range(10):
        t = NINE + second * 10**9
        rows.append(("/tf", TF, t, ros.transform(t, "odom", "base_link", (second, 0.0, 0.0))))
    for second, x, y in ((2, 5.0, 0.0), (6, 7.0, 1.0)):
        t = NINE + second * 10**9
        rows.append(("/tf", TF, t, ros.transform(t, "map", "odom", (x, y, np.pi / 2))))
    log = read(ros, tmp_path, sorted(rows, key=lambda row: row[2]), id="base_link")

    share = np.clip((np.arange(2, 10) - 2) / 4, 0, 1)  # of the way to the correction
    np.testing.assert_allclose(log.xy[:, 0], 5 + 2 * share, atol=1e-12)
    np.testing.assert_allclose(log.xy[:, 1], np.arange(2, 10) + share, atol=1e-12)
    np.testing.assert_allclose(log.heading, np.pi / 2)
    way = "transform from 'base_link' to 'map'"
    assert log.notes == (
        "base_link: 10 poses in the frame 'map'",
        f"2 poses before the first {way} were left out",
        f"2 poses use the last {way}, which is up to 3 s older",
    )


def test_a_robot_is_where_its_bag_has_it_in_the_map(tmp_path):
    """A drive along x at 2 cm/s from (7, 4), with `/tf` from map to odom by 2 m."""
    ros = Ros(2)
    turn = (0.0, 0.0, 1.414, 1.414)
    poses = [stamped(ros, "odom", turn, x=7 + 0.02 * s, after=s) for s in range(20)]
    bag = str(ros.bag(tmp_path / "bag", [moved(ros, "odom"), *poses]))
    replay = {"type": "replay", "path": bag, "id": "/pose", "time_zone": "UTC", "day": "date"}
    simulation = fleet2d.Simulation(
        "bundled:paper",
        "simulation.start=2026-01-05T08:00",
        robots={"astro": {"behaviors": [replay]}},
    )
    simulation.advance(10)

    astro = simulation.state["astro"]
    expected = (9.2, 4.0, np.pi / 2)
    assert expected == pytest.approx((astro["x"], astro["y"], astro["heading"]), abs=0.01)


@pytest.mark.parametrize(
    ("version", "links", "frame", "x"),
    [
        (1, [("odom", "/map", 2.0)], "odom", 9.0),  # a slash before a frame makes no difference
        (1, [("odom", "/map", 2.0)], "/odom", 9.0),
        (2, [("map", "odom", 2.0)], "odom", 5.0),  # a map below odom
        (2, [("bob/odom", "bob/map", 5.0), ("astro/odom", "astro/map", 2.0)], "astro/odom", 9.0),
        (2, [], "", 7.0),  # without a frame it counts as in the map
    ],
)
def test_poses_are_transformed_to_the_map(version, links, frame, x, tmp_path):
    ros = Ros(version)
    rows = [moved(ros, child, parent, by) for child, parent, by in links]
    log = read(ros, tmp_path, [*rows, stamped(ros, frame)], id="/pose")

    assert log.xy.tolist() == [[x, 4.0]]
    assert ("1 poses without a frame count as in 'map'" in log.notes) == (not frame)


@pytest.mark.parametrize(
    ("links", "listed"),
    [([], "none"), ([("base_link", "odom")], "base_link, odom"), ([("x", "map")], "x, map")],
)
def test_poses_without_a_way_to_the_map_are_refused(links, listed, tmp_path):
    ros = Ros(2)
    path = ros.bag(
        tmp_path / "bag", [*(moved(ros, *names) for names in links), stamped(ros, "odom")]
    )

    with pytest.raises(LogError) as caught:
        read_log(path, time_zone="UTC", id="/pose")
    assert str(caught.value).endswith(
        f"/pose: no transform leads from the frame 'odom' to 'map' (frames of /tf: {listed}); to"
        " take coordinates in 'odom' as those of the floor plan, write frame: {name: odom}"
    )
    log = read_log(path, time_zone="UTC", id="/pose", frame="odom")
    assert log.xy.tolist() == [[7.0, 4.0]]


def test_poses_before_the_first_transform_are_left_out_and_counted(tmp_path):
    ros = Ros(2)
    poses = [stamped(ros, "odom", x=float(i), after=i) for i in range(10)]

    def rows(late):
        ns = NINE + late * 10**9
        return [*poses, ("/tf", TF, ns, ros.transform(ns, "map", "odom", (2.0, 0.0, 0.0)))]

    log = read(ros, tmp_path, rows(7), id="/pose")

    assert log.xy[:, 0].tolist() == [9.0, 10.0, 11.0]
    assert "7 poses before the first transform from 'odom' to 'map' were left out" in log.notes
    with pytest.raises(LogError, match=r"no pose is left: .*; 10 poses before the first transform"):
        read(ros, tmp_path / "late", rows(11), id="/pose")


@pytest.mark.parametrize(
    ("turn", "heading", "note"),
    [
        ((0.0, 0.0, -3.0, 3.0), -np.pi / 2, ""),
        ((0.0, 0.0, 0.0, 0.0), np.nan, "1 poses have no heading: their quaternion is 0 or not"),
        ((0.0, 0.0, np.nan, 1.0), np.nan, "1 poses have no heading: their quaternion is 0 or not"),
        ((0.6, 0.0, 0.0, 0.8), 0.0, "1 poses are tilted by more than 45 degrees"),
    ],
)
def test_quaternions_are_normalized_or_say_nothing(turn, heading, note, tmp_path):
    log = read(Ros(2), tmp_path, [stamped(Ros(2), "map", turn)])

    np.testing.assert_allclose(log.heading, [heading])
    assert len(log.notes) == 1 + bool(note)
    assert log.notes[-1].startswith(note)


def test_a_transform_without_a_turn_is_left_out_and_counted(tmp_path):
    ros = Ros(2)
    broken = ros.transform(NINE, "map", "odom", (50.0, 0.0, 0.0))
    broken.transforms[0].transform.rotation.w = 0.0
    rows = [("/tf", TF, NINE, broken), moved(ros, "odom"), stamped(ros, "odom")]
    log = read(ros, tmp_path, rows, id="/pose")

    assert log.xy.tolist() == [[9.0, 4.0]]
    assert "1 transforms without a place or a turn were left out" in log.notes


def test_odometry_of_a_sensor_is_told(tmp_path):
    message = Ros(2).odometry(NINE, 1.0, 2.0, 0.0, "map", "camera_link")
    log = read(Ros(2), tmp_path, [("/vio", ODOMETRY, NINE, message)])

    assert log.notes[-1] == "/vio: these are poses of 'camera_link', not of a base_link"


def test_a_transform_topic_is_read(tmp_path):
    ros = Ros(2)
    one = ros.transform(NINE, "map", "astro", (3.0, 4.0, 0.5)).transforms[0]
    row = ("/vicon", "geometry_msgs/msg/TransformStamped", NINE, one)
    log = read(ros, tmp_path, [row])

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
    log = read_log(tmp_path / "drive.bag", time_zone="UTC")

    assert log.xy[:, 0].tolist() == [0.0, 1.0]


def test_a_simulated_clock_may_begin_at_zero(ros, tmp_path):
    """The stamp 0 was replaced by the time of recording, of another clock."""
    rows = [(*row[:2], NINE + i, row[3]) for i, row in enumerate(drive(ros, begin=0))]
    log = read(ros, tmp_path, rows, time_zone=None)

    assert (None, 0, 9 * 10**6) == (log.first_day, log.time_us[0], log.time_us[-1])


def test_bag_without_poses_lists_its_topics(tmp_path):
    ros = Ros(2)
    row = ("/chatter", "std_msgs/msg/String", NINE, ros.new("std_msgs/msg/String", "hello"))
    with pytest.raises(LogError, match="no poses: no odometry, poses or /tf among /chatter"):
        read_log(ros.bag(tmp_path / "bag", [row]))


def test_stamps_that_run_backwards_are_sorted_if_asked(ros, tmp_path):
    log = read(ros, tmp_path, backwards(ros), sort=True)

    assert [float(i) for i in range(10)] == log.xy[:, 0].tolist()


@pytest.mark.parametrize(
    "damage", [lambda whole: whole[:200], lambda _: b"no bag at all" * 100], ids=["cut", "noise"]
)
def test_damaged_bag_is_one_line(damage, tmp_path):
    path = Ros(1).bag(tmp_path / "drive.bag", drive(Ros(1)))
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(LogError, match=r"drive\.bag can't be read as a bag") as caught:
        read_log(path, time_zone="UTC")
    assert "\n" not in str(caught.value)


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
