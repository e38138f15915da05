"""Checks of your own errors of perception: whether they do what the engine relies on."""

from collections.abc import Iterator
from typing import Any

from fleet2d.engine.simulation import Simulation
from fleet2d.errors import Fleet2DError
from fleet2d.runs.run import Run
from fleet2d.scenario.model import load_scenario
from fleet2d.sight.perception_error import PerceptionError


def check_perception_error(cls: type[PerceptionError], **settings: Any) -> None:
    """Check an error of perception in a small scenario for all that the engine relies on.

    * What it returns can be stored.
    * Two runs with one seed are equal, and so is a run in spans of seven steps.

    Args:
        cls: The class of the error.
        settings: Its configuration, where it differs from the defaults.

    Raises:
        AssertionError: One of these doesn't hold; the message says which.

    Example:
        >>> from fleet2d import PerceptionError
        >>> class Lying(PerceptionError):
        ...     '''Everybody seems to lie.'''
        ...     def distort(self, sightings):
        ...         return sightings.replace(posture=2)
        >>> check_perception_error(Lying)
    """
    problems = list(_problems(cls, settings))
    if problems:
        raise AssertionError(
            f"the engine can't rely on the error of perception {cls.__name__}: "
            + "; ".join(problems)
        )


def _problems(cls: type[PerceptionError], settings: dict[str, Any]) -> Iterator[str]:
    try:
        digest = _run(cls(**settings)).digest
        if digest != _run(cls(**settings)).digest:
            yield (
                "two runs with one seed differ: draw by sightings.uniform(purpose) or"
                " sightings.bell(purpose), and use no clock, no hash() and no global state"
            )
        elif digest != _run(cls(**settings), max_span=7).digest:
            yield "a run in spans of 7 steps differs: treat each sighting by itself"
    except Fleet2DError as error:
        yield str(error)


def _run(error: PerceptionError, **simulation: Any) -> Run:
    """Return a run in which two robots perceive two people with an error."""
    robot = {
        "type": "patrol",
        "dwell": "1 min",
        "camera": {"angle_deg": 200, "detection": 0.9, "latency": "2 s"},
        "perception": {"errors": {"checked": error}, "false_positives": {"per_hour": 60}},
    }
    content = {
        "simulation": {"start": "2026-01-05", "seed": 4, "duration": "1 h", **simulation},
        "floorplan": "bundled",
        "users": {"ana": "meander", "ben": "meander"},
        "robots": {"astro": robot, "bolt": robot},
        "artifacts": {"trajectories": "off"},
    }
    return Simulation(load_scenario(content)).run()
