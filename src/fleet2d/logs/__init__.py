"""Real logs: who was where and did what, read from the files of smart homes and trackers."""

from fleet2d.logs.log import AWAY, ActivityLog, LogError, PositionLog, Reading
from fleet2d.logs.read import Layout, read_log

__all__ = ["AWAY", "ActivityLog", "Layout", "LogError", "PositionLog", "Reading", "read_log"]
