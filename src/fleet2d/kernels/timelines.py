"""The motion of bodies over time, and the runs of equal pose that follow from it."""

from fleet2d._core import Timelines, Window

__all__ = ["Timelines", "Window"]
