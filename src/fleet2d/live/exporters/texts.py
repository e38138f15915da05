"""Text files: poses as CSV, records as JSON Lines, readings in the format of CASAS."""

import json
from collections.abc import Iterator
from operator import itemgetter
from pathlib import Path
from typing import Any

from fleet2d.errors import RunDirectoryError
from fleet2d.live.exporters import Chunk, Records, Selection, new_file
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import Trajectory
from fleet2d.runtime.clock import Clock

# The activity that CASAS writes where none is known.
OTHER = "Other_Activity"


def export_csv(run: Run, path: Path, part: Selection) -> str:
    """Write columns step, time, entity, x [m], y [m], heading [rad], away and room.

    While a body is away, x, y and room are empty.

    Args:
        run: A run with key frames.
        path: The file to write.
        part: The part of the run, and the time between two poses.

    Returns:
        A line with the number of rows.

    Raises:
        RunDirectoryError: The run has no bodies, or the file can't be written.
    """
    import pyarrow as pa
    from pyarrow import csv

    if not any(run.manifest["entities"].values()):
        raise RunDirectoryError(
            "the run has neither users nor robots, so there are no poses: its events are in a file"
            " .jsonl"
        )
    rooms = pa.array([room.name for room in run.plan.rooms])
    count = 0
    with new_file(path) as file:
        writer = None
        for chunk in Records(run, part).chunks(tables=()):
            clock = run.clock
            tables = [_table(name, way, rooms, clock) for name, way in chunk.poses.items()]
            rows = pa.concat_tables(tables).sort_by([("step", "ascending")])
            writer = writer or csv.CSVWriter(file, rows.schema)
            writer.write_table(rows)
            count += rows.num_rows
        if writer is not None:
            writer.close()
    return f"{count:,} poses in {path}"


def _table(name: str, way: Trajectory, rooms: Any, clock: Clock) -> Any:
    import pyarrow as pa

    columns = {
        "step": pa.array(way.step),
        "time": pa.array(clock.texts(way.step) if clock.zone else way.time),
        "entity": pa.repeat(name, len(way.step)),
        "x": pa.array(way.x, mask=way.away),
        "y": pa.array(way.y, mask=way.away),
        "heading": pa.array(way.heading),
        "away": pa.array(way.away),
        "room": rooms.take(pa.array(way.room, mask=way.room < 0)),
    }
    return pa.table(columns)


def export_jsonl(run: Run, path: Path, part: Selection) -> str:
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
            poses = _poses(chunk, rooms, run.clock)
            rows = sorted((*poses, *_rows(chunk)), key=itemgetter("step"))
            file.writelines(f"{json.dumps(row, default=str)}\n".encode() for row in rows)
            count += len(rows)
    return f"{count:,} objects in {path}"


def _poses(chunk: Chunk, rooms: list[str], clock: Clock) -> Iterator[dict[str, Any]]:
    for name, way in chunk.poses.items():
        times = clock.texts(way.step)
        for i, (step, away) in enumerate(zip(way.step.tolist(), way.away.tolist(), strict=True)):
            row = {"step": step, "time": times[i], "record": "pose", "entity": name}
            if not away:
                row["x"] = float(way.x[i])
                row["y"] = float(way.y[i])
                row["heading"] = float(way.heading[i])
                if way.room[i] >= 0:
                    row["room"] = rooms[way.room[i]]
            yield row | {"away": away}


def _rows(chunk: Chunk) -> Iterator[dict[str, Any]]:
    for table, rows in chunk.rows.items():
        for row in rows:
            present = {key: value for key, value in row.items() if value is not None}
            present["time"] = row["time"].isoformat()
            yield {"step": 0, "time": "", "record": table} | present


def export_casas(run: Run, path: Path, part: Selection) -> str:
    """Write a line per reading: date, time, room, sensor, state, activity.

    Spaces in names become underscores, because spaces separate the columns.

    Args:
        run: A run whose scenario has sensors.
        path: The file to write.
        part: The part of the run.

    Returns:
        A line with the number of readings.

    Raises:
        RunDirectoryError: The run has no sensors, or the file can't be written.
    """
    if "sensors" not in run.tables:
        raise RunDirectoryError(
            "the run has no table of sensors: add objects that sense to its scenario, such as"
            " hall: {type: motion_sensor, at: [1, 2]}"
        )
    records = Records(run, part).chunks(poses=False, tables=["sensors"])
    rows = [row for chunk in records for row in chunk.rows["sensors"]]
    lines = [
        f"{row['time']:%Y-%m-%d %H:%M:%S.%f} {_word(row['room'])} {_word(row['sensor'])}"
        f" {row['state']} {_word(row['activity']) or OTHER}\n"
        for row in rows
    ]
    with new_file(path) as file:
        file.write("".join(lines).encode())
    return f"{len(lines)} readings in {path}"


def _word(name: str) -> str:
    return "_".join(name.split())
