"""ROS 2 messages in an MCAP file, for Foxglove, PlotJuggler and ROS: needs the extra `ros`."""

import json
from pathlib import Path

from fleet2d.errors import extra
from fleet2d.runs.exporters import new_file
from fleet2d.runs.records import Records, Selection
from fleet2d.runs.ros import RosMessages, Topic
from fleet2d.runs.run import Run


def export(run: Run, path: Path, part: Selection) -> str:
    """Write map, transforms, odometry, detections, events and tables as ROS 2 messages.

    A layout for Foxglove is written beside the file, as `NAME.layout.json`.

    Args:
        run: A run with key frames.
        path: The file to write.
        part: The part of the run, and the time between two poses.

    Returns:
        A line with the number of messages.

    Raises:
        InputError: foxglove-sdk or rosbags isn't installed.
        RunDirectoryError: The file can't be written.
    """
    with extra("ros", "MCAP files need foxglove-sdk and rosbags"):
        from foxglove import Channel, Context, Schema, open_mcap
        from foxglove.mcap import MCAPWriteOptions
    messages = RosMessages(Records(run, part))
    layout = path.with_suffix(".layout.json")
    count = 0
    context = Context()
    options = MCAPWriteOptions(profile="ros2", compression_threads=0)
    with new_file(path) as file, open_mcap(file, context=context, writer_options=options):
        channels = {}
        for topic in messages.topics.values():
            definition = messages.definition(topic).encode()
            channels[topic.name] = Channel(
                topic.name,
                schema=Schema(name=topic.type, encoding="ros2msg", data=definition),
                message_encoding="cdr",
                metadata=_metadata(topic),
                context=context,
            )
        for time, name, data in messages:
            channels[name].log(data, log_time=time)
            count += 1
    with new_file(layout) as file:
        file.write(json.dumps(foxglove_layout(messages), indent=1).encode())
    return f"{count:,} messages in {path}, {path.stat().st_size / 1e6:.1f} MB; layout: {layout}"


def foxglove_layout(messages: RosMessages) -> dict[str, object]:
    """Return a layout of Foxglove's panels: the home with all bodies, the events, the speeds."""
    robots = [name for name in messages.topics if name.endswith("/odom")]
    detections = [name for name in messages.topics if name.endswith("/detections")]
    visible = {name: {"visible": True} for name in ("/map", *robots, *detections)}
    plots = [{"value": f"{name}.twist.twist.linear.x", "enabled": True} for name in robots]
    return {
        "configById": {
            "3D!home": {
                "followTf": "map",
                "cameraState": {"perspective": False, "phi": 0, "distance": 25},
                "topics": visible,
            },
            "RosOut!events": {"topicToRender": "/events"},
            "Plot!speed": {"paths": plots, "title": "speed [m/s]"},
        },
        "globalVariables": {},
        "userNodes": {},
        "layout": {
            "direction": "row",
            "first": "3D!home",
            "second": {"direction": "column", "first": "RosOut!events", "second": "Plot!speed"},
            "splitPercentage": 65,
        },
    }


def _metadata(topic: Topic) -> dict[str, str]:
    """Return the quality of service of a topic, as rosbag2 stores it."""
    if not topic.latched:
        return {}
    no_limit = {"sec": 0, "nsec": 0}
    latched = {
        "history": 1,  # keep the last
        "depth": 1,
        "reliability": 1,  # reliable
        "durability": 1,  # transient local: for those who subscribe later, too
        "deadline": no_limit,
        "lifespan": no_limit,
        "liveliness": 1,
        "liveliness_lease_duration": no_limit,
        "avoid_ros_namespace_conventions": False,
    }
    return {"offered_qos_profiles": json.dumps([latched])}  # JSON is YAML
