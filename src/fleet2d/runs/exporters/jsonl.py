"""JSON Lines: an object for each pose, event, observation and row of a table, in order of time."""

import json
from collections.abc import Iterator
from operator import itemgetter
from pathlib import Path
from typing import Any

from fleet2d.runs.exporters import Chunk, Records, Selection, new_file
from fleet2d.runs.run import Run


def export(run: Run, path: Path, part: Selection) -> str:
    """Write objects with `step`, `time` and `record`: `pose`, or the name of a table.

    A pose has `entity`, `x`, `y` [m], `heading` [rad], `room` and `away`; other records have the
    columns of their table, without those that are missing.

    Args:
        run: A run with key frames.
        path: The file to write.
        part: The part of the run, and the time between two poses.

    Returns:
        A line with the number of objects.

    Raises:
        RunDirectoryError: The file can't be written.
    """
    rooms = [room.name for room in run.plan.rooms]
    count = 0
    with new_file(path) as file:
        for chunk in Records(run, part).chunks():
            rows = sorted((*_poses(chunk, rooms), *_rows(chunk)), key=itemgetter("step"))
            file.writelines(f"{json.dumps(row, default=str)}\n".encode() for row in rows)
            count += len(rows)
    return f"{count:,} objects in {path}"


def _poses(chunk: Chunk, rooms: list[str]) -> Iterator[dict[str, Any]]:
    for name, way in chunk.poses.items():
        times = way.time.astype("datetime64[us]").tolist()
        for i, (step, away) in enumerate(zip(way.step.tolist(), way.away.tolist(), strict=True)):
            row = {"step": step, "time": times[i].isoformat(), "record": "pose", "entity": name}
            if not away:
                row |= {"x": float(way.x[i]), "y": float(way.y[i])}
                row |= {"heading": float(way.heading[i])}
                row |= {"room": rooms[way.room[i]]} if way.room[i] >= 0 else {}
            yield row | {"away": away}


def _rows(chunk: Chunk) -> Iterator[dict[str, Any]]:
    for table, rows in chunk.rows.items():
        for row in rows:
            present = {key: value for key, value in row.items() if value is not None}
            present["time"] = row["time"].isoformat()
            yield {"step": 0, "time": "", "record": table} | present
