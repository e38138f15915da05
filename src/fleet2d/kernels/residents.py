"""People who do activities in a home, as numbers: where they go, and what they do meanwhile."""

from fleet2d._core import LastStint, Resident, Scene, Waits

__all__ = ["LastStint", "Resident", "Scene", "Waits"]
