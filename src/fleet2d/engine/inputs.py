"""The input files of a run."""

from collections.abc import Iterator, Mapping, ValuesView
from pathlib import Path

from pydantic import BaseModel

from fleet2d.artifacts.manifest import Manifest, input_record
from fleet2d.configuration.components import Component
from fleet2d.configuration.trust import source_files
from fleet2d.errors import RunDirectoryError, blame
from fleet2d.scenario.model import Scenario
from fleet2d.sight.perception import Perception


def input_files(scenario: Scenario) -> list[Path]:
    """Return the files that components read, and those of the user's own modules, sorted.

    The files of a component are those of its method `files`, and all paths among its fields.
    """
    files: set[Path] = set()
    for component in components_of(scenario):
        files_of = getattr(component, "files", None)
        if files_of:
            with blame(component.type_name, None):
                files |= set(files_of())
        files |= {value for _, value in component if isinstance(value, Path) and value.is_file()}
        if not type(component).__module__.startswith("fleet2d."):
            files |= set(source_files(type(component)))
    return sorted(files)


def changed_inputs(manifest: Manifest) -> list[str]:
    """Return the files that a run read and whose content has changed since.

    Raises:
        RunDirectoryError: One is missing, or is not a file.
    """
    changed_paths = []
    for record in manifest.inputs:
        path = Path(record.path)
        try:
            if path.exists() and not path.is_file():
                raise RunDirectoryError(
                    f"the run read {path}, which is not a file any more: restore it"
                )
            if input_record(path).sha256 != record.sha256:
                changed_paths.append(record.path)
        except (OSError, ValueError) as error:
            raise RunDirectoryError(
                f"the run read {path}, which is missing or can't be read: restore it"
            ) from error
    return changed_paths


def components_of(scenario: Scenario) -> Iterator[Component]:
    """Yield all components of a scenario, also those within others."""
    entities = (*scenario.users.values(), *scenario.robots.values())
    holders = [scenario, scenario.sight, *entities, *scenario.script, *_perceptions_of(scenario)]
    queue = [component for holder in holders for component in _components_in(holder)]
    while queue:
        component = queue.pop()
        yield component
        queue += _components_in(component)


def _components_in(holder: BaseModel) -> Iterator[Component]:
    """Yield the components among the values of fields, and in their lists and mappings."""
    for _, value in holder:
        values = value.values() if isinstance(value, Mapping) else value
        several = values if isinstance(values, list | tuple | ValuesView) else (values,)
        yield from (item for item in several if isinstance(item, Component))


def _perceptions_of(scenario: Scenario) -> Iterator[Perception]:
    """Yield the perceptions of all robots, their cameras, and the faults of a script."""
    for robot in scenario.robots.values():
        cameras = [camera.perception for camera in robot.eyes.values()]
        yield from (p for p in (robot.perception, *cameras) if p is not None)
    for entry in scenario.script:
        if (errs := getattr(entry.act, "errs", None)) is not None:
            yield errs
