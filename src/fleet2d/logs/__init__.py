"""Real logs: positions and activities of people, from the files of smart homes and trackers."""

from fleet2d.logs.log import AWAY, ActivityLog, LogError, PositionLog, Reading
from fleet2d.logs.read import Layout, read_log

__all__ = ["AWAY", "ActivityLog", "Layout", "LogError", "PositionLog", "Reading", "read_log"]
