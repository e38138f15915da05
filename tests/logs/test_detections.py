"""Detections of real robots: tables, topics of bags, labels, times, and what is wrong in them."""

from datetime import date

import numpy as np
import pytest
from tests.logs.ros import NINE, TF, Ros

from fleet2d.logs.detections import read_detections
from fleet2d.logs.log import LogError

ROWS = """time,label,x,y
2026-03-01 08:00:00,ana,1.0,2.0
2026-03-01 08:00:00,ben,1.5,2.5
2026-03-01 08:00:02,,1.1,2.1
"""


def write(folder, text, name="seen.csv"):
    path = folder / name
    path.write_text(text)
    return path


def test_a_table_keeps_all_detections_of_an_instant(tmp_path):
    log = read_detections(write(tmp_path, ROWS))

    assert log.labels == ("ana", "ben")
    assert log.label.tolist() == [0, 1, -1]
    assert log.counts == {"ana": 1, "ben": 1, "": 1}
    assert (log.time_us // 1_000_000).tolist() == [28800, 28800, 28802]
    assert log.xy.tolist() == [[1.0, 2.0], [1.5, 2.5], [1.1, 2.1]]
    assert log.days == 1


def test_json_lines_and_parquet_hold_the_same_as_csv(tmp_path):
    import pyarrow.csv as pacsv
    import pyarrow.parquet as pq

    path = write(tmp_path, ROWS)
    table = pacsv.read_csv(path)
    pq.write_table(table, tmp_path / "seen.parquet")
    lines = [
        '{"time": "2026-03-01 08:00:00", "label": "ana", "x": 1.0, "y": 2.0}',
        '{"time": "2026-03-01 08:00:00", "label": "ben", "x": 1.5, "y": 2.5}',
        '{"time": "2026-03-01 08:00:02", "label": null, "x": 1.1, "y": 2.1}',
    ]
    write(tmp_path, "\n".join(lines), "seen.jsonl")

    logs = [read_detections(tmp_path / f"seen.{suffix}") for suffix in ("csv", "parquet", "jsonl")]

    for log in logs[1:]:
        assert np.array_equal(log.time_us, logs[0].time_us)
        assert np.array_equal(log.xy, logs[0].xy)
        assert log.label.tolist() == logs[0].label.tolist()


def test_columns_are_named_by_the_scenario(tmp_path):
    path = write(tmp_path, "when,face,east,north\n0,f7,1,2\n5,f9,3,4\n")
    names = {"time": "when", "user": "face", "x": "east", "y": "north"}

    log = read_detections(path, columns=names)

    assert log.labels == ("f7", "f9")
    assert log.first_day is None
    assert log.time_us.tolist() == [0, 5_000_000]


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("time,x\n0,1\n", {}, "has no column 'y'"),
        ("time,x,y\n0,1,east\n", {}, "line 2: expected a number in column 'y', got 'east'"),
        ("time,x,y\n", {}, "holds no detection"),
        (
            "time,x,y\n5,1,1\n3.5,1,1\n",
            {},
            "line 3: the time runs backwards there (1 such lines, by up to 1.5 s)",
        ),
        ("time,x,y\n1767600000,1,1\n", {}, "say which local time the home has by time_zone"),
        ("time,x,y\n0,1,1\n", {"topic": "/people"}, "'topic' is for bags"),
        (
            "time,x,y\n0,1,1\n",
            {"columns": {"face": "x"}},
            "columns: unknown key 'face'; allowed here: time, user",
        ),
    ],
)
def test_a_table_with_errors_is_refused(tmp_path, text, options, message):
    with pytest.raises(LogError) as caught:
        read_detections(write(tmp_path, text), **options)

    assert message in str(caught.value)


def test_the_hour_that_is_repeated_is_left_out_with_a_note(tmp_path):
    # 2026-10-25 00:30 and 01:30 UTC are both 02:30 in Berlin.
    path = write(tmp_path, "time,x,y\n1792888200,1,1\n1792891800,1,1\n1792895400,1,1\n")

    log = read_detections(path, time_zone="Europe/Berlin")

    assert len(log.time_us) == 2
    assert "1 detections of the hour that the end of summer time repeats" in log.notes[0]


def test_sorted_rows_are_counted(tmp_path):
    log = read_detections(write(tmp_path, "time,x,y\n5,1,1\n3,2,2\n"), sort=True)

    assert log.time_us.tolist() == [0, 2_000_000] or log.time_us.tolist() == [3_000_000, 5_000_000]
    assert log.notes == ("1 lines ran backwards in time and were sorted in",)


MOMENT = [  # 2026-03-29 00:59:59.5 UTC, an instant before summer time begins in Berlin
    "1774745999.5",
    "1774745999500",
    "1774745999500000",
    "1774745999500000000",
    "2026-03-29T00:59:59.5Z",
    "2026-03-28T20:59:59.5-04:00",
]


@pytest.mark.parametrize("text", MOMENT)
def test_seconds_milli_micro_nanoseconds_and_zones_are_one_moment(tmp_path, text):
    path = write(tmp_path, f"time,x,y\n{text},1,1\n")

    log = read_detections(path, time_zone="Europe/Berlin")

    assert (log.first_day, log.time_us.tolist()) == (date(2026, 3, 29), [7_199_500_000])
    with pytest.raises(LogError, match="say which local time the home has by time_zone"):
        read_detections(path)


def test_a_jump_of_the_clock_is_told_with_its_line_and_size(tmp_path):
    rows = "2025-01-01 00:00:00,1,1\n2026-01-01 00:00:00,1,1\n2026-01-01 00:00:01,1,1\n"

    log = read_detections(write(tmp_path, "time,x,y\n" + rows))

    assert log.notes == ("line 3: the time jumps forward by 365.0 days there",)


def test_a_clock_that_was_set_after_it_began_at_1970_is_refused(tmp_path):
    path = write(tmp_path, "time,x,y\n3,1,1\n1774745999,1,1\n1774746001,1,1\n")

    with pytest.raises(
        LogError, match=r"line 3: the time jumps forward by 20541\.0 days there: lea"
    ):
        read_detections(path, time_zone="UTC")


def test_times_with_and_without_a_zone_are_refused(tmp_path):
    path = write(tmp_path, "time,x,y\n2026-01-01 00:00:00,1,1\n2026-01-01T05:00:01Z,1,1\n")

    with pytest.raises(LogError, match="some of its times have a time zone and some have none"):
        read_detections(path, time_zone="UTC")


# Bags


def bag(folder, run):
    import fleet2d

    path = folder / "run.mcap"
    fleet2d.export(run, path, every="10 s")
    return path


@pytest.fixture(scope="module")
def simulated():
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    import fleet2d

    return fleet2d.run(
        "bundled:paper", "simulation.duration=3 h", "simulation.start=2026-01-05T07:00", seed=4
    )


def test_detections_of_a_bag_are_those_of_the_run(tmp_path, simulated):
    table = simulated.tables["observations"]

    log = read_detections(bag(tmp_path, simulated), time_zone="UTC")

    assert len(table) > 0
    assert log.labels == ("ana",)
    assert np.allclose(log.xy[:, 0], table["x"].to_numpy())
    assert np.allclose(log.xy[:, 1], table["y"].to_numpy())
    seconds = log.time_us // 1_000_000 - 7 * 3600
    assert seconds.tolist() == table["step"].to_numpy().tolist()


def test_fields_of_a_topic_are_those_that_the_scenario_maps(tmp_path, simulated):
    path = bag(tmp_path, simulated)
    fields = {"each": "detections", "user": "id", "x": "results.0.pose.pose.position.x"}

    log = read_detections(path, topic="/astro/detections", columns=fields, time_zone="UTC")

    assert len(log.time_us) == len(read_detections(path, time_zone="UTC").time_us)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"topic": "/astro/detection"},
            "no topic '/astro/detection': did you mean '/astro/detections'?",
        ),
        ({"topic": "/map"}, "say where they have the position by columns"),
        (
            {"columns": {"x": "bbox.centre.position.x"}},
            "there is no 'centre'; there are: center, size",
        ),
        (
            {"columns": {"face": "id"}},
            "unknown key 'face'; allowed for a bag: each, user, x, y, heading",
        ),
    ],
)
def test_a_wrong_topic_or_field_of_a_bag_is_refused(tmp_path, simulated, options, message):
    with pytest.raises(LogError) as caught:
        read_detections(bag(tmp_path, simulated), time_zone="UTC", **options)

    assert message in str(caught.value)


def people(folder, frame, links):
    """Somebody 3 m ahead of a camera: z is ahead in its frame, x to the right."""
    ros, kind = Ros(2), "geometry_msgs/msg/PoseArray"
    place = ros.new("geometry_msgs/msg/Point", 0.0, 0.0, 3.0)
    turn = ros.new("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
    pose = ros.new("geometry_msgs/msg/Pose", place, turn)
    message = ros.new(kind, ros.header(NINE, frame), [pose])
    return ros.bag(folder / "bag", [*links, ("/people", kind, NINE, message)])


def camera(ros):
    """A camera 0.1 m ahead of the robot's middle, in the orientation of optical frames."""
    message = ros.transform(NINE, "base_link", "camera", (0.1, 0.0, 0.0))
    turn = ros.new("geometry_msgs/msg/Quaternion", -0.5, 0.5, -0.5, 0.5)
    message.transforms[0].transform.rotation = turn
    return "/tf_static", TF, NINE, message


def test_detections_of_a_camera_are_transformed_to_the_map(tmp_path):
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    ros = Ros(2)
    robot = ("/tf", TF, NINE, ros.transform(NINE, "map", "base_link", (5.0, 1.0, np.pi / 2)))

    log = read_detections(people(tmp_path, "camera", [camera(ros), robot]), time_zone="UTC")

    np.testing.assert_allclose(log.xy, [[5.0, 4.1]], atol=1e-9)


def test_detections_relative_to_the_robot_are_in_its_base_link(tmp_path):
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    path = people(tmp_path, "camera", [camera(Ros(2))])

    log = read_detections(path, time_zone="UTC", frame="base_link")

    np.testing.assert_allclose(log.xy, [[3.1, 0.0]], atol=1e-9)


def test_detections_of_a_camera_without_transforms_are_refused(tmp_path):
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    with pytest.raises(LogError, match="no transform leads from the frame 'camera' to 'map'"):
        read_detections(people(tmp_path, "camera", []), time_zone="UTC")
