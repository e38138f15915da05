"""Text files: poses as CSV, records as JSON Lines, ways as GeoJSON, sensors as CASAS has them."""

import json
from collections.abc import Iterator
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.errors import RunDirectoryError
from fleet2d.floorplan.load import source_type
from fleet2d.live.exporters import Chunk, Records, Selection, new_file
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import Trajectory

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


def export_geojson(run: Run, path: Path, part: Selection) -> str:
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
    home = source_type("geojson").document(run.plan)
    features = home.pop("features")
    count = len(features)
    tables = [name for name in ("events",) if name in run.tables]
    with new_file(path) as file:
        head = json.dumps(home)[:-1] + ', "features": [\n'
        file.write((head + ",\n".join(json.dumps(feature) for feature in features)).encode())
        for feature in _features(Records(run, part), tables):
            file.write(f",\n{json.dumps(feature)}".encode())
            count += 1
        file.write(b"\n]}\n")
    return f"{count:,} features in {path}"


def _features(records: Records, tables: list[str]) -> Iterator[dict[str, Any]]:
    """Yield all ways and events."""
    ways: dict[str, _Ways] = {}
    for chunk in records.chunks(tables=tables):
        for name, path in chunk.poses.items():
            yield from ways.setdefault(name, _Ways(name)).take(path)
        yield from (_event(row, chunk.poses) for rows in chunk.rows.values() for row in rows)
    for body in ways.values():
        yield from body.finish()


class _Ways:
    """The movements of a body, each from its last rest to its next, also from chunk to chunk."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._line: list[list[float]] = []  # of a movement that isn't over
        self._from = self._to = ""
        self._last: tuple[Any, Any, Any] | None = None  # the last pose: place, whether away, time

    def take(self, path: Trajectory) -> Iterator[dict[str, Any]]:
        """Yield the movements that are over in the next poses."""
        xy = np.stack([path.x, path.y], axis=-1)
        away = path.away
        times = np.datetime_as_string(path.time, unit="s")
        if not len(xy):
            return
        if self._last is not None:
            place, was_away, time = self._last
            xy = np.concatenate([place[np.newaxis], xy])
            away = np.append(was_away, away)
            times = np.append(time, times)
        self._last = xy[-1], away[-1], times[-1]
        moves = np.any(xy[1:] != xy[:-1], axis=1) & ~away[1:] & ~away[:-1]
        edges = np.flatnonzero(np.diff(np.concatenate([[0], moves, [0]])))
        if self._line and not (len(moves) and moves[0]):
            yield from self.finish()
        for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            line = xy[begin : end + 1].round(4).tolist()
            if self._line:  # which goes on
                self._line += line[1:]
            else:
                self._line = line
                self._from = str(times[begin])
            self._to = str(times[end])
            if end < len(moves):
                yield from self.finish()

    def finish(self) -> Iterator[dict[str, Any]]:
        """Yield the movement that isn't over, as it is cut here."""
        if self._line:
            line = {"type": "LineString", "coordinates": self._line}
            moments = {"from": self._from, "to": self._to}
            yield _feature(line, kind="way", entity=self._name, **moments)
            self._line = []


def _event(row: dict[str, Any], poses: dict[str, Trajectory]) -> dict[str, Any]:
    """Return an event at the position of its body; without one if it has none, or is away."""
    way = poses.get(row["entity"])
    place = None
    if way is not None and len(way.step):
        at = min(max(int(np.searchsorted(way.step, row["step"])), 0), len(way.step) - 1)
        if not way.away[at]:
            xy = [round(float(way.x[at]), 4), round(float(way.y[at]), 4)]
            place = {"type": "Point", "coordinates": xy}
    present = {key: value for key, value in row.items() if value is not None}
    return _feature(place, kind="event", **(present | {"time": row["time"].isoformat()}))


def _feature(geometry: dict[str, Any] | None, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": geometry}


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
