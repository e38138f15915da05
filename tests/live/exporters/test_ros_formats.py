"""What ROS's own libraries read from exported files is what the run stored."""

import json
import math
import signal
from collections import defaultdict

import numpy as np
import pytest
from tests.live.exporters.worlds import END, FIRST, day, part, poses, rows
from tests.scenes import process
from tests.two_storeys import PLAN

import fleet2d
from fleet2d.errors import RunDirectoryError
from fleet2d.live.exporters import Selection
from fleet2d.live.exporters.bags import export_mcap, export_rosbag2
from fleet2d.runs.robot_log import robot_log

pytest.importorskip("rosbags", reason="the extra ros is not installed")
BEGIN_NS = 1_767_571_200 * 1_000_000_000  # 2026-01-05T00:00, taken as UTC


@pytest.fixture(scope="module")
def from_mcap(tmp_path_factory):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    path = tmp_path_factory.mktemp("mcap") / "day.mcap"
    export_mcap(day(), path, part())
    messages = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            messages[channel.topic].append((message.log_time, decoded))
    return messages


@pytest.fixture(scope="module")
def from_bag(tmp_path_factory):
    from rosbags.highlevel import AnyReader

    path = tmp_path_factory.mktemp("bag") / "day"
    export_rosbag2(day(), path, part())
    messages = defaultdict(list)
    with AnyReader([path]) as reader:
        for connection, time, data in reader.messages():
            decoded = reader.deserialize(data, connection.msgtype)
            messages[connection.topic].append((time, decoded))
    return messages


@pytest.fixture(params=["mcap", "rosbag2"])
def messages(request, from_mcap, from_bag):
    return from_mcap if request.param == "mcap" else from_bag


def step_of(stamp):
    """The step of a stamp of a message; a step is a second."""
    return stamp.sec + stamp.nanosec / 1e9 - BEGIN_NS / 1e9


def pose_of(stamp, place, rotation):
    """The step, x, y and heading."""
    assert 0 == rotation.x == rotation.y
    return step_of(stamp), place.x, place.y, float(2 * np.arctan2(rotation.z, rotation.w))


def assert_poses(expected, found):
    """Compare steps, places and headings, the latter up to a whole turn."""
    expected, found = np.array(expected), np.array(found)
    assert expected.shape == found.shape
    np.testing.assert_array_equal(expected[:, :3], found[:, :3])
    turned = (expected[:, 3] - found[:, 3] + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(0, turned, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "frames"),
    [
        ("ana", ("map", "ana")),
        ("ben", ("map", "ben")),
        ("astro", ("astro/odom", "astro/base_link")),
    ],
)
def test_transforms_are_the_poses_at_home(messages, name, frames):
    found = []
    for time, message in messages["/tf"]:
        for one in message.transforms:
            if (one.header.frame_id, one.child_frame_id) == frames:
                moved = one.transform
                found.append(pose_of(one.header.stamp, moved.translation, moved.rotation))
                assert (time - BEGIN_NS) / 1e9 == found[-1][0]

    assert_poses(poses(name), found)
    everywhere = (END - FIRST) // 30
    assert (name == "astro") == (len(found) == everywhere)  # who is away has no transform


def test_frames_form_a_tree_from_the_map(messages):
    ((_, still),) = messages["/tf_static"]

    pairs = {(one.header.frame_id, one.child_frame_id) for one in still.transforms}
    assert {("map", "astro/odom")} == pairs


def test_odometry_has_the_poses_and_the_speeds_between_them(messages):
    odometry = [message for _, message in messages["/astro/odom"]]
    frames = {(message.header.frame_id, message.child_frame_id) for message in odometry}
    found = [
        pose_of(m.header.stamp, m.pose.pose.position, m.pose.pose.orientation) for m in odometry
    ]
    speeds = [math.hypot(m.twist.twist.linear.x, m.twist.twist.linear.y) for m in odometry]

    assert {("astro/odom", "astro/base_link")} == frames
    assert_poses(poses("astro"), found)
    moved = np.hypot(*np.diff(np.array(found)[:, 1:3], axis=0).T)
    np.testing.assert_allclose(moved / 30, speeds[1:], atol=1e-12)


def test_a_robot_on_stairs_has_no_speed_of_their_length_in_the_plan(tmp_path):
    """The ends of the stairs are 10 m apart there, which was a speed of 10 m/s."""
    from rosbags.highlevel import AnyReader

    (tmp_path / "house.json").write_text(json.dumps(PLAN))
    run = fleet2d.run(
        {
            "simulation": {"duration": "2 min"},
            "floorplan": {"type": "native", "path": str(tmp_path / "house.json")},
            "users": {},
            "robots": {"astro": {"climbs": True, "behaviors": [], "start": [1.0, 2.0]}},
            "script": [{"at": "5 s", "send": "astro", "to": "above"}],
        }
    )
    export_rosbag2(run, tmp_path / "bag", Selection.of(run))
    with AnyReader([tmp_path / "bag"]) as reader:
        odometry = [c for c in reader.connections if c.topic == "/astro/odom"]
        messages = [reader.deserialize(d, c.msgtype) for c, _, d in reader.messages(odometry)]
    speeds = [math.hypot(m.twist.twist.linear.x, m.twist.twist.linear.y) for m in messages]
    assert messages[-1].pose.pose.position.x > 6
    assert 0.5 < max(speeds) < 0.7


@pytest.mark.parametrize("export", [export_mcap, export_rosbag2])
def test_topics_that_ros_refuses_are_told(export, tmp_path):
    robots = {"astro": None, "Käfer": {"behaviors": []}, "robot-1": {"behaviors": []}}
    scenario = {"extends": "bundled:paper", "simulation": {"duration": "1 min"}, "robots": robots}
    run = fleet2d.run(scenario)
    told = export(run, tmp_path / "run.mcap", Selection.of(run))
    assert "ROS plays no topic with other letters than a-z, 0-9 and _: /Käfer/odom" in told
    assert "/robot-1/odom" in told
    assert "ROS" not in export(day(), tmp_path / "day.mcap", part())


def test_map_has_the_free_cells_of_the_plan_at_their_places(messages):
    ((_, grid),) = messages["/map"]

    plan = day().plan
    free = np.array(grid.data).reshape(grid.info.height, grid.info.width) == 0
    np.testing.assert_array_equal(plan.free, free)
    assert plan.lattice.cell == pytest.approx(grid.info.resolution)
    corner = grid.info.origin.position
    assert plan.lattice.origin == (corner.x, corner.y)
    for room in plan.rooms:
        x, y = room.anchor_xy
        row = int((y - corner.y) / grid.info.resolution)
        column = int((x - corner.x) / grid.info.resolution)
        assert free[row, column], room.name


def test_detections_are_the_observations(messages):
    found = []
    for _, message in messages["/astro/detections"]:
        for one in message.detections:
            (likely,) = one.results
            pose = likely.pose.pose
            assert pose.position == one.bbox.center.position
            found.append(
                (
                    likely.hypothesis.class_id,
                    *pose_of(message.header.stamp, pose.position, pose.orientation),
                )
            )

    expected = [
        (row["user"] or "unknown", row["step"], row["x"], row["y"], row["heading"])
        for row in rows("observations")
    ]
    assert {"ana", "unknown"} <= {who for who, *_ in found}
    assert sorted(who for who, *_ in expected) == sorted(who for who, *_ in found)
    assert_poses([row[1:] for row in sorted(expected)], [row[1:] for row in sorted(found)])


def test_events_and_beliefs_are_the_rows_of_the_tables(messages):
    events = [(step_of(e.stamp), e.name, e.function) for _, e in messages["/events"]]
    beliefs = [json.loads(message.data) for _, message in messages["/ltp"]]

    assert [(row["step"], row["entity"], row["event"]) for row in rows("events")] == events
    assert [(row["room"], row["share"]) for row in rows("ltp")] == [
        (row["room"], row["share"]) for row in beliefs
    ]


def test_the_log_of_a_robot_is_that_of_its_events_and_moves(messages):
    levels = {"INFO": 2, "WARN": 3, "ERROR": 4}
    entries = robot_log(day(), "astro", FIRST, END)
    found = [
        (step_of(m.timestamp), m.level, m.file, m.message, m.name)
        for _, m in messages["/astro/log"]
    ]

    assert [(e.step, levels[e.level], e.source, e.text, "astro") for e in entries] == found
    assert {"drive", "sight"} <= {e.source for e in entries}


def test_messages_are_in_order_of_time(messages):
    for topic, these in messages.items():
        times = [time for time, _ in these]
        assert sorted(times) == times, topic


def test_chunks_of_mcap_files_are_whole_and_indexed(tmp_path):
    """Readers without an index find the messages in order, too."""
    from mcap.reader import make_reader

    path = tmp_path / "day.mcap"
    said = export_mcap(day(), path, part())

    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        names = {channel.id: channel.topic for channel in summary.channels.values()}
        stored = [(c.topic, m) for _, c, m in reader.iter_messages(log_time_order=False)]
        noon = BEGIN_NS + (FIRST + END) // 2 * 1_000_000_000
        later = list(reader.iter_messages(topics=["/tf"], starting_at=noon))
    times = [message.log_time for _, message in stored]
    assert said.startswith(f"{len(stored):,} messages")
    assert times == sorted(times)
    assert (times[0], times[-1]) == (
        summary.statistics.message_start_time,
        summary.statistics.message_end_time,
    )
    counts = summary.statistics.channel_message_counts
    assert list(counts) == sorted(counts)  # once another order in each process
    for number, count in counts.items():
        own = [message.sequence for topic, message in stored if topic == names[number]]
        assert own == list(range(count))
    expected = [m.log_time for topic, m in stored if topic == "/tf" and m.log_time >= noon]
    assert [message.log_time for _, _, message in later] == expected


def test_layout_for_foxglove_names_the_topics_of_the_file(tmp_path):
    line = export_mcap(day(), tmp_path / "day.mcap", part())

    layout = json.loads((tmp_path / "day.layout.json").read_text())
    assert "day.layout.json" in line
    topics = layout["configById"]["3D!home"]["topics"]
    assert {"/map", "/astro/odom", "/astro/detections"} == set(topics)


@pytest.mark.parametrize(("export", "name"), [(export_mcap, "d.mcap"), (export_rosbag2, "d")])
def test_place_that_can_not_be_written_is_named(export, name, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(RunDirectoryError, match=f"{name} can't be written"):
        export(day(), tmp_path / "file" / name, part())


KILLED = """
import os, signal, sys
from pathlib import Path
from fleet2d.live.exporters import Selection
from fleet2d.live.exporters.bags import McapWriter, export_rosbag2
from tests.live.exporters.worlds import day, part

written = []
write = McapWriter.write

def write_some(*arguments):
    written.append(0)
    if len(written) == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    write(*arguments)

McapWriter.write = write_some
export_rosbag2(day(), Path(sys.argv[1]), part())
"""


@pytest.mark.slow
def test_a_killed_export_leaves_no_bag_and_the_same_command_makes_it(tmp_path):
    """Half of a bag stayed, and the same command refused to replace it."""
    from rosbags.highlevel import AnyReader

    path = tmp_path / "bag"
    killed = process("-c", KILLED, str(path))
    assert -signal.SIGKILL == killed.returncode
    assert ["bag.partial"] == [entry.name for entry in tmp_path.iterdir()]

    export_rosbag2(day(), path, part())

    assert ["bag"] == [entry.name for entry in tmp_path.iterdir()]
    with AnyReader([path]) as reader:
        assert reader.message_count > 1000
    with pytest.raises(RunDirectoryError, match="bag exists: name another folder"):
        export_rosbag2(day(), path, part())
