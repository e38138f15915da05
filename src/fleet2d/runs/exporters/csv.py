"""Poses of all users and robots as CSV: a row for each body and time."""

from pathlib import Path
from typing import Any

from fleet2d.runs.exporters import Records, Selection, new_file
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import Trajectory


def export(run: Run, path: Path, part: Selection) -> str:
    """Write columns step, time, entity, x [m], y [m], heading [rad], away and room.

    While a body is away, x, y and room are empty.

    Args:
        run: A run with key frames.
        path: The file to write.
        part: The part of the run, and the time between two poses.

    Returns:
        A line with the number of rows.

    Raises:
        RunDirectoryError: The file can't be written.
    """
    import pyarrow as pa
    from pyarrow import csv

    rooms = pa.array([room.name for room in run.plan.rooms])
    count = 0
    with new_file(path) as file:
        writer = None
        for chunk in Records(run, part).chunks(tables=()):
            tables = [_table(name, way, rooms) for name, way in chunk.poses.items()]
            rows = pa.concat_tables(tables).sort_by([("step", "ascending")])
            writer = writer or csv.CSVWriter(file, rows.schema)
            writer.write_table(rows)
            count += rows.num_rows
        if writer is not None:
            writer.close()
    return f"{count:,} poses in {path}"


def _table(name: str, way: Trajectory, rooms: Any) -> Any:
    import pyarrow as pa

    columns = {
        "step": pa.array(way.step),
        "time": pa.array(way.time),
        "entity": pa.repeat(name, len(way.step)),
        "x": pa.array(way.x, mask=way.away),
        "y": pa.array(way.y, mask=way.away),
        "heading": pa.array(way.heading),
        "away": pa.array(way.away),
        "room": rooms.take(pa.array(way.room, mask=way.room < 0)),
    }
    return pa.table(columns)
