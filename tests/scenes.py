"""Small scenarios for the tests of whole runs, and what they are judged by."""

import atexit
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

import fleet2d
from fleet2d.configuration.documents import parse
from fleet2d.engine.access import directory_of
from fleet2d.runs.run import Run

Cli = Callable[..., tuple[int, str, str]]
"""What the fixture `fleet2d` is: the command line, which returns exit code, stdout and stderr."""

TESTS = Path(__file__).parent
OWN = f"{TESTS.as_posix()}/own_components"
"""The module of the tests' own components, as a scenario names it."""

ROOMS = {
    "living_room": (0, 0, 5, 4),
    "kitchen": (5.1, 0, 8, 4),
    "bedroom": (0, 4.1, 4, 7),
    "bathroom": (4.1, 4.1, 8, 7),
    "storage": (9, 0, 11, 2),  # without a door
}
DOORS = [(5, 2.6, 5.1, 3.6), (3, 4, 3.9, 4.1), (5.2, 4, 6.1, 4.1)]
PILLAR = [(2, 1), (3, 1.5), (2.4, 2.2)]
ENTRANCE = (0.5, 0.5)


def flat_document() -> dict[str, Any]:
    """A flat of four rooms joined by doors, one room without a door, and a pillar with slanted walls."""
    space = shapely.union_all([shapely.box(*box) for box in (*ROOMS.values(), *DOORS)])
    space = shapely.difference(space, shapely.Polygon(PILLAR))
    return {
        "format": "fleet2d-floorplan",
        "version": 1,
        "name": "flat",
        "free": [
            {
                "outline": [list(c) for c in part.exterior.coords[:-1]],
                "holes": [[list(c) for c in hole.coords[:-1]] for hole in part.interiors],
            }
            for part in shapely.get_parts(space).tolist()
        ],
        "rooms": [
            {
                "type": kind,
                "polygon": [list(c) for c in shapely.box(*box).exterior.coords[:-1]],
            }
            for kind, box in ROOMS.items()
        ],
        "entrance": list(ENTRANCE),
    }


def write_flat(folder: Path) -> Path:
    """Write the flat's floor plan to a folder; return its path."""
    path = folder / "flat.json"
    path.write_text(json.dumps(flat_document()))
    return path


def write_plan(folder: Path, outline: Any, rooms: Mapping[str, Any], **more: Any) -> str:
    """Write a floor plan of one outline, whose rooms have a type and a polygon each; return its path."""
    document = {
        "format": "fleet2d-floorplan",
        "version": 1,
        "name": "home",
        "free": [{"outline": outline, "holes": []}],
        "rooms": [{"type": kind, "polygon": polygon} for kind, polygon in rooms.items()],
        **more,
    }
    path = folder / "home.json"
    path.write_text(json.dumps(document))
    return str(path)


def box(*bounds: float) -> list[list[float]]:
    """Return the corners of a box from (x, y) to (x, y)."""
    return [list(corner) for corner in shapely.box(*bounds).exterior.coords[:-1]]


@cache
def flat_path() -> Path:
    """The flat's floor plan in a file that is there until the process ends."""
    folder = tempfile.TemporaryDirectory(prefix="fleet2d-flat-")
    atexit.register(folder.cleanup)
    return write_flat(Path(folder.name))


def scenario(duration: str = "10 min", **sections: Any) -> dict[str, Any]:
    """A scenario in the flat, on Monday at 07:00, with seed 4, that stores a pose per minute.

    Bodies are ghosts, so that what a robot does is its own doing: `test_yielding` is of the others.
    """
    simulation = {"start": "2026-01-05T07:00", "duration": duration, "seed": 4, "ghosts": True}
    simulation |= sections.pop("simulation", {})
    return {
        "simulation": simulation,
        "floorplan": {"type": "native", "path": str(flat_path())},
        "artifacts": {"trajectories": "1 min", **sections.pop("artifacts", {})},
        **sections,
    }


AGENDA = [
    {
        "on": "daily",
        "items": [
            {"at": "06:30", "place": "bedroom", "activity": "sleep"},
            {"at": "07:02", "place": "bathroom", "dwell": "4 min", "activity": "wash"},
            {"place": "kitchen", "dwell": "10 min", "activity": "breakfast"},
            {"at": "07:30", "away": True, "activity": "errand"},
            {"at": "07:45:30", "place": [1.0, 3.0], "activity": "read"},
            {"at": "08:20", "place": ["attic", "any"], "activity": "tidy"},
        ],
    }
]


def everything(duration: str = "2 h", **changes: Any) -> dict[str, Any]:
    """A scenario with every behavior, cameras that are unsure, algorithms and metrics."""
    unsure = {"range": [0.2, 4], "angle_deg": 120, "detection": 0.7, "lost_after": "20 s"}
    return (
        scenario(
            duration,
            simulation={"ghosts": False},
            users={
                "ana": {"type": "schedule", "days": AGENDA, "rest": "living_room"},
                "ben": {"type": "meander", "speed": 0.7},
            },
            robots={
                "astro": {
                    "camera": unsure,
                    "behaviors": [
                        {"type": f"{OWN}:Greet"},
                        {"type": "patrol", "dwell": "90 s", "order": "random"},
                    ],
                },
                "bolt": {
                    "camera": {**unsure, "detection": 1, "lost_after": "4 s"},
                    "behaviors": [{"type": f"{OWN}:Greet", "patience": "40 s"}, {"type": "patrol"}],
                },
                "curio": {
                    "camera": unsure,
                    "type": "patrol",
                    "waypoints": [[1, 1], [7, 1], [7, 6]],
                    "dwell": "10 s",
                },
                "drift": {"type": "meander", "camera": {"range": [0, 2]}, "radius": 0.1},
                "ego": {"camera": None, "type": f"{OWN}:Obey", "speed": 1.2},
            },
            algorithms={
                "smooth": {"type": f"{OWN}:Smooth", "reads": ["share"], "period": "20 min"},
                "share": {"type": f"{OWN}:Share", "period": "10 min"},
            },
            metrics={
                "room_share": {"period": "1 h"},
                "sightings": {"period": "25 min"},
                "distance": {"period": "7 min"},
            },
        )
        | changes
    )


def every_step(duration: str = "5 min") -> dict[str, Any]:
    """The same with an algorithm that is updated after every step, which no span outlasts."""
    content = everything(duration)
    content["algorithms"] = {
        **content["algorithms"],
        "tick": {"type": f"{OWN}:Tick", "period": "1 s"},
    }
    return content


def run(content: Mapping[str, Any], *overrides: str, **settings: Any) -> Run:
    """Run a scenario in memory."""
    return fleet2d.run(content, *overrides, **settings)


def entries(text: str) -> list[Any]:
    """Return entries of a script, one a line, as a scenario's file has them between braces."""
    return [parse(f"{{{line}}}") for line in text.strip().splitlines()]


def expecting(text: str) -> dict[str, str]:
    """Return expectations, one a line, as a scenario has them."""
    return {f"line_{n}": line.strip() for n, line in enumerate(text.strip().splitlines(), 1)}


def unmet(stored: Run) -> list[str]:
    """Return what those expectations of a run say that don't hold, or were never put to the test."""
    verdicts = stored.manifest["expectations"].values()
    return [verdict["says"] for verdict in verdicts if verdict["holds"] is not True]


def digests(stored: Run) -> dict[str, Any]:
    """The digest of the run and of each table."""
    tables = {name: table["digest"] for name, table in stored.manifest["tables"].items()}
    return {"run": stored.digest, **tables}


def table(stored: Run, name: str, **where: str) -> dict[str, NDArray[Any]]:
    """The columns of a table, those rows of it where columns have the given values."""
    rows = stored.tables[name]
    columns = {
        column: rows[column].combine_chunks().to_pandas().to_numpy() for column in rows.column_names
    }
    keep = np.ones(rows.num_rows, bool)
    for column, value in where.items():
        keep &= columns[column] == value
    return {column: values[keep] for column, values in columns.items()}


def path(stored: Run, entity: str) -> Any:
    """Every pose of a body, rebuilt from key frames: an independent way to what happened."""
    from datetime import timedelta

    return stored.path(entity, every=timedelta(microseconds=stored.manifest["step_us"]))


def each_step(content: Mapping[str, Any], entity: str, *overrides: str) -> dict[str, NDArray[Any]]:
    """Every row of the trajectories table of a body, stored at every step."""
    return table(
        run(content, "artifacts.trajectories=every step", *overrides), "trajectories", entity=entity
    )


def process(
    *arguments: str, timeout: float = 120, cwd: Path | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run Python in a process of its own."""
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        timeout=timeout,
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment},
        check=False,
    )


def fleet2d_process(*arguments: str, **more: Any) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own."""
    return process("-m", "fleet2d.cli", *arguments, **more)


def cut_off(simulation: fleet2d.Simulation) -> Path:
    """Leave a run as the end of its process would."""
    unfinished = simulation._store._unfinished
    assert unfinished is not None
    unfinished.journal.close()
    assert unfinished._lock is not None
    os.close(unfinished._lock._handle)
    directory = directory_of(simulation)
    assert directory is not None
    return directory
