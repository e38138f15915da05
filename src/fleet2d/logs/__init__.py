"""Real logs: positions and activities of people, from the files of smart homes and trackers."""

from fleet2d.logs.layout import Layout, read_log
from fleet2d.logs.log import AWAY, ActivityLog, LogError, PositionLog, Reading

__all__ = ["AWAY", "ActivityLog", "Layout", "LogError", "PositionLog", "Reading", "read_log"]
