"""ROS 2 messages as a bag in SQLite, which any ROS 2 can play: needs the extra `ros`."""

from pathlib import Path

from fleet2d.errors import RunDirectoryError, extra
from fleet2d.runs.exporters import Records, Selection
from fleet2d.runs.ros import RosMessages
from fleet2d.runs.run import Run


def export(run: Run, path: Path, part: Selection) -> str:
    """Write the same messages as the exporter `mcap` as a folder that `ros2 bag play` accepts.

    Args:
        run: A run with key frames.
        path: The folder to write, which doesn't exist yet.
        part: The part of the run, and the time between two poses.

    Returns:
        A line with the number of messages.

    Raises:
        InputError: rosbags isn't installed.
        RunDirectoryError: The folder exists, or can't be written.
    """
    with extra("ros", "bags need rosbags"):
        from rosbags.interfaces import (
            Qos,
            QosDurability,
            QosHistory,
            QosLiveliness,
            QosReliability,
            QosTime,
        )
        from rosbags.rosbag2 import Writer, WriterError
    messages = RosMessages(Records(run, part))
    no_limit = QosTime(0, 0)
    latched = Qos(
        QosHistory.KEEP_LAST,
        1,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL,
        no_limit,
        no_limit,
        QosLiveliness.AUTOMATIC,
        no_limit,
        avoid_ros_namespace_conventions=False,
    )
    count = 0
    try:
        with Writer(path, version=8) as writer:
            connections = {
                topic.name: writer.add_connection(
                    topic.name,
                    topic.type,
                    typestore=messages.types,
                    offered_qos_profiles=[latched] if topic.latched else [],
                )
                for topic in messages.topics.values()
            }
            for time, name, data in messages:
                writer.write(connections[name], time, data)
                count += 1
    except (OSError, WriterError) as error:
        raise RunDirectoryError(f"{path} can't be written: {error}") from error
    return f"{count:,} messages in {path}"
