"""GeoJSON in metres: rooms, doorways and furniture, a line for each way, a point for each event."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.floorplan.formats.geojson import geojson_document
from fleet2d.runs.exporters import new_file
from fleet2d.runs.records import Records, Selection
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import Trajectory


def export(run: Run, path: Path, part: Selection) -> str:
    """Write the home as `fleet2d convert` does, and features of kind `way` and `event`.

    A way is a movement between two rests, with properties `entity`, `from` and `to`; an event has
    those of the table `events`, and stands where its entity is.

    Args:
        run: A run with key frames.
        path: The file to write.
        part: The part of the run, and the time between two poses.

    Returns:
        A line with the number of features.

    Raises:
        RunDirectoryError: The file can't be written.
    """
    home = geojson_document(run.plan)
    features = home.pop("features")
    count = len(features)
    tables = [name for name in ("events",) if name in run.tables]
    with new_file(path) as file:
        head = json.dumps(home)[:-1] + ', "features": [\n'
        file.write((head + ",\n".join(json.dumps(feature) for feature in features)).encode())
        for chunk in Records(run, part).chunks(tables=tables):
            ways = (way for name, path in chunk.poses.items() for way in _ways(name, path))
            events = (_event(row, chunk.poses) for rows in chunk.rows.values() for row in rows)
            for feature in (*ways, *events):
                file.write(f",\n{json.dumps(feature)}".encode())
                count += 1
        file.write(b"\n]}\n")
    return f"{count:,} features in {path}"


def _ways(name: str, way: Trajectory) -> Iterator[dict[str, Any]]:
    """Yield the movements of a body, each from its last rest to its next."""
    xy = np.stack([way.x, way.y], axis=-1)
    moves = np.any(xy[1:] != xy[:-1], axis=1) & ~way.away[1:] & ~way.away[:-1]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], moves, [0]])))
    times = np.datetime_as_string(way.time, unit="s")
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        line = {"type": "LineString", "coordinates": xy[begin : end + 1].round(4).tolist()}
        moments = {"from": str(times[begin]), "to": str(times[end])}
        yield _feature(line, kind="way", entity=name, **moments)


def _event(row: dict[str, Any], poses: dict[str, Trajectory]) -> dict[str, Any]:
    """Return an event at its place; without one if its entity is no body, or away."""
    way = poses.get(row["entity"])
    place = None
    if way is not None and len(way.step):
        at = min(max(int(np.searchsorted(way.step, row["step"])), 0), len(way.step) - 1)
        if not way.away[at]:
            place = {
                "type": "Point",
                "coordinates": [round(float(way.x[at]), 4), round(float(way.y[at]), 4)],
            }
    present = {key: value for key, value in row.items() if value is not None}
    return _feature(place, kind="event", **(present | {"time": row["time"].isoformat()}))


def _feature(geometry: dict[str, Any] | None, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": geometry}
