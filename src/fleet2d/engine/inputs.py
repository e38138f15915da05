"""The files that a run depends on, besides Fleet2D itself."""

import inspect
from collections.abc import Iterator
from pathlib import Path

from fleet2d.component import Component
from fleet2d.scenario.model import Scenario


def input_files(scenario: Scenario) -> list[Path]:
    """Return the floor plan's files and the modules of the user's own components, sorted."""
    files: set[Path] = set()
    for component in _components(scenario):
        reads = getattr(component, "files", None)
        files |= set(reads()) if reads else set()
        if not type(component).__module__.startswith("fleet2d."):
            source = inspect.getsourcefile(type(component))
            if source:
                files.add(Path(source))
    return sorted(files)


def _components(scenario: Scenario) -> Iterator[Component]:
    yield scenario.floorplan
    for entity in (*scenario.users.values(), *scenario.robots.values()):
        yield from entity.behaviors
    yield from scenario.algorithms.values()
    yield from scenario.metrics.values()
