"""The files that a run depends on, besides Fleet2D itself."""

import inspect
from collections.abc import Iterator
from pathlib import Path

from fleet2d.artifacts.manifest import Manifest, input_record, is_regular
from fleet2d.component import Component
from fleet2d.errors import RunDirectoryError
from fleet2d.scenario.model import Scenario


def input_files(scenario: Scenario) -> list[Path]:
    """Return the files that components read, and the modules of the user's own, sorted.

    A component says by `files` what it reads; the paths among its fields are noted anyway.
    """
    files: set[Path] = set()
    for component in components_of(scenario):
        reads = getattr(component, "files", None)
        files |= set(reads()) if reads else set()
        files |= {value for _, value in component if isinstance(value, Path) and value.is_file()}
        if not type(component).__module__.startswith("fleet2d."):
            source = inspect.getsourcefile(type(component))
            if source:
                files.add(Path(source))
    return sorted(files)


def changed_inputs(manifest: Manifest) -> list[str]:
    """Return the files that a run read and that hold something else now.

    Raises:
        RunDirectoryError: One is gone, or is no file.
    """
    changed = []
    for record in manifest.inputs:
        path = Path(record.path)
        try:
            if not is_regular(path):
                raise RunDirectoryError(
                    f"the run read {path}, which is no file now: put the file back"
                )
            if input_record(path).sha256 != record.sha256:
                changed.append(record.path)
        except (OSError, ValueError) as error:
            raise RunDirectoryError(
                f"the run read {path}, which is gone or can't be read: put it back"
            ) from error
    return changed


def components_of(scenario: Scenario) -> Iterator[Component]:
    """Yield all components of a scenario, and those within others."""
    outer: list[Component] = [scenario.floorplan, scenario.sight.method]
    for entity in (*scenario.users.values(), *scenario.robots.values()):
        outer += entity.behaviors
    outer += scenario.objects.values()
    outer += scenario.algorithms.values()
    outer += scenario.metrics.values()
    outer += [entry.act for entry in scenario.script]
    while outer:  # components may have others within: an algorithm its model
        component = outer.pop()
        yield component
        outer += [value for _, value in component if isinstance(value, Component)]
