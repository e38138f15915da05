"""The facts of a stored run that the page receives: everything except its tables."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from fleet2d import __version__
from fleet2d.configuration.units import parse_duration
from fleet2d.errors import ArtifactError
from fleet2d.palette import body_color
from fleet2d.runs.layers import PREFIX
from fleet2d.runs.run import Run
from fleet2d.sight.camera import USUAL_ANGLE_DEG, USUAL_RANGE_M
from fleet2d.storage.files import path_in
from fleet2d.viewer.facts.contract import BodyFacts, CameraFacts, ColumnFacts, RunFacts, TableFacts
from fleet2d.viewer.facts.home_facts import home_facts
from fleet2d.viewer.facts.marks import marks_of
from fleet2d.viewer.facts.walls import HomeDoors, WallsHistory

Role = Literal["log", "algorithm", "metric", "layer"]


def run_facts(run: Run, doors: HomeDoors, walls: WallsHistory) -> RunFacts:
    """Return the facts of a run.

    Raises:
        ArtifactError: The run has no floor plan, or the plan can't be read.
    """
    manifest = run.manifest
    scenario = manifest["scenario"]
    return RunFacts(
        title=run_title(run),
        status=run.status,
        notes=list(run.notes),
        start=manifest["start"],
        step_us=manifest["step_us"],
        steps=manifest["steps"],
        first_step=0,
        end_step=manifest["steps"],
        seed=manifest["seed"],
        digest=run.digest,
        version=__version__,
        home=home_facts(run.plan, doors.facts),
        bodies=bodies_of(scenario, manifest["entities"]),
        tables=[_table_facts(run, name) for name in run.tables],
        walls=walls.changes,
        marks=marks_of(run),
        metrics=run.metrics,
        scenario=scenario,
        walks_every_s=0.0,
    )


def run_title(run: Run) -> str:
    """Return the title of a run: the name of its directory, else of its scenario."""
    if run.directory is not None:
        return Path(run.directory).resolve().name
    return str(run.manifest["scenario"].get("name") or "run")


def bodies_of(scenario: Mapping[str, Any], entities: Mapping[str, Any]) -> list[BodyFacts]:
    """Return the facts of users, then of robots."""
    bodies = []
    for bucket, robot in (("users", False), ("robots", True)):
        for number, name in enumerate(entities.get(bucket, ())):
            settings = scenario.get(bucket, {}).get(name, {})
            color = settings.get("color")
            bodies.append(
                BodyFacts(
                    name=name,
                    robot=robot,
                    color=color if _is_color(color) else body_color(number, robot=robot),
                    radius=float(settings.get("radius", 0.15 if robot else 0.2)),
                    cameras=_cameras(settings),
                    behaviors=[b.get("type", "") for b in settings.get("behaviors", ())],
                )
            )
    return bodies


def _is_color(value: object) -> bool:
    return isinstance(value, str) and value.startswith("#") and len(value) == 7


def _cameras(settings: Mapping[str, Any]) -> list[CameraFacts]:
    cameras = dict(settings.get("cameras") or {})
    if settings.get("camera"):
        cameras = {"camera": settings["camera"], **cameras}
    return [_camera(name, camera) for name, camera in cameras.items()]


def _camera(name: str, camera: Mapping[str, Any]) -> CameraFacts:
    near, far = camera.get("range", USUAL_RANGE_M)
    forward, left = camera.get("offset", (0.0, 0.0))
    pan = camera.get("pan") or {}
    dwell = parse_duration(pan.get("dwell", "5 s"))
    return CameraFacts(
        name=name,
        near=near,
        far=far,
        angle=math.radians(camera.get("angle_deg", USUAL_ANGLE_DEG)),
        forward=forward,
        left=left,
        heading=math.radians(camera.get("heading_deg", 0.0)),
        pan=[math.radians(degrees) for degrees in pan.get("headings_deg", ())],
        pan_us=round(dwell.total_seconds() * 1e6),
    )


def _table_facts(run: Run, name: str) -> TableFacts:
    description = run.manifest["tables"].get(name)
    if description is None:  # the manifest of an unfinished run doesn't list its tables
        description = {"rows": _rows_of(run, name), "columns": _columns_of(run, name)}
    path = None if run.directory is None else path_in(run.directory, f"{name}.parquet")
    return TableFacts(
        name=name,
        rows=int(description["rows"]),
        bytes=path.stat().st_size if path is not None and path.exists() else 0,
        role=_role(run.manifest["scenario"], name),
        columns=[
            ColumnFacts(
                name=column["name"],
                kind=column.get("kind", ""),
                unit=column.get("unit", ""),
                description=column.get("description", ""),
            )
            for column in description["columns"]
        ],
    )


def _rows_of(run: Run, name: str) -> int:
    try:
        return int(run.tables[name].num_rows)
    except ArtifactError:
        return 0


def _columns_of(run: Run, name: str) -> list[dict[str, str]]:
    from fleet2d.artifacts.arrow import spec_of

    try:
        columns = spec_of(run.tables[name].schema).columns
    except ArtifactError:
        return []
    return [{"name": c.name, "kind": c.kind, "unit": c.unit} for c in columns]


def _role(scenario: Mapping[str, Any], name: str) -> Role:
    if name.startswith(PREFIX):
        return "layer"
    if name in scenario.get("algorithms", {}):
        return "algorithm"
    return "metric" if name in scenario.get("metrics", {}) else "log"
