"""A recording for the viewer of Rerun: needs the extra `rerun`."""

from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.errors import RunDirectoryError, errors_as, extra, os_errors_as
from fleet2d.kernels import I64, Bool
from fleet2d.live.exporters import Chunk, Records, Selection
from fleet2d.palette import WALL_COLOR, body_color, deep_color
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import Trajectory
from fleet2d.storage.files import partial_file

# Lengths of the arrows that show headings, and radii of points [m].
_ARROW = 0.4
_BODY = 0.15
_SIGHTING = 0.06
_GREY = (136, 136, 136)


def export_rerun(run: Run, path: Path, part: Selection) -> str:
    """Write walls, rooms, poses where they change, sightings, events and presence.

    The timeline `time` is the local time of the run, `step` its step. What is shown of a body that
    is away is empty.

    Args:
        run: A run with key frames.
        path: The file to write, `.rrd`.
        part: The part of the run, and the time between two poses.

    Returns:
        A line about the file.

    Raises:
        InputError: rerun-sdk isn't installed.
        RunDirectoryError: The file can't be written.
    """
    with extra("rerun", "recordings for Rerun need rerun-sdk"):
        import rerun as rr
    records = Records(run, part)
    stream = rr.RecordingStream("fleet2d", recording_id=str(run.digest or path.name))
    failure = f"{path} can't be written"
    with os_errors_as(RunDirectoryError, failure), partial_file(path) as partial:
        partial.touch()  # that it can be written is found out before the work
        with errors_as(RunDirectoryError, failure, of=RuntimeError):
            stream.save(partial)
        _Writer(rr, stream, records).write()
        stream.disconnect()
    return f"{path}, {path.stat().st_size / 1e6:.1f} MB"


class _Writer:
    """Writes records to a stream of Rerun."""

    def __init__(self, rr: Any, stream: Any, records: Records) -> None:
        self._rr, self._stream, self._records = rr, stream, records
        users = records.users
        robots = records.robots
        self._colors = {name: _rgb(body_color(i, robot=False)) for i, name in enumerate(users)}
        self._colors |= {name: _rgb(body_color(i, robot=True)) for i, name in enumerate(robots)}
        self._last: dict[str, tuple[float, float, float, bool]] = {}

    def write(self) -> None:
        self._home()
        for chunk in self._records.chunks():
            for name, way in chunk.poses.items():
                self._body(name, way)
            self._rows(chunk)

    def _home(self) -> None:
        """Write walls and rooms, which are there at all times."""
        rr = self._rr
        plan = self._records.run.plan
        self._stream.log("home", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        rings = [
            plan.lattice.to_metres(np.asarray(ring.coords))
            for polygon in plan.polygons
            for ring in (polygon.exterior, *polygon.interiors)
        ]
        walls = rr.LineStrips3D([_on_floor(ring) for ring in rings], colors=[_rgb(WALL_COLOR)])
        self._stream.log("home/walls", walls, static=True)
        anchors = rr.Points3D(
            [(*room.anchor_xy, 0.0) for room in plan.rooms],
            labels=[room.name for room in plan.rooms],
            colors=[_rgb(deep_color(room.type)) for room in plan.rooms],
            radii=[_SIGHTING],
        )
        self._stream.log("home/rooms", anchors, static=True)

    def _times(self, steps: I64) -> list[Any]:
        times = self._records.run.clock.stamps(steps)
        return [
            self._rr.TimeColumn("time", timestamp=times.astype("datetime64[ns]")),
            self._rr.TimeColumn("step", sequence=steps),
        ]

    def _body(self, name: str, way: Trajectory) -> None:
        """Write the poses of a body that differ from the ones before."""
        pose = np.stack([way.x, way.y, way.heading, way.away], axis=-1)
        if not len(pose):
            return
        before = np.concatenate([[self._last.get(name, (np.nan,) * 4)], pose[:-1]])
        self._last[name] = tuple(pose[-1].tolist())
        at = np.flatnonzero(np.any(pose != before, axis=1))
        home: Bool = ~way.away[at]
        shown = at[home]
        xyz = _on_floor(np.stack([way.x[shown], way.y[shown]], axis=-1))
        ahead = np.stack([np.cos(way.heading[shown]), np.sin(way.heading[shown])], axis=-1)
        arrows = self._rr.Arrows3D.columns(
            origins=xyz,
            vectors=_on_floor(ahead * _ARROW),
            colors=[self._colors[name]] * len(xyz),
            radii=np.full(len(xyz), _BODY / 4),
        )
        points = self._rr.Points3D.columns(
            positions=xyz,
            colors=[self._colors[name]] * len(xyz),
            radii=np.full(len(xyz), _BODY),
            labels=[name] * len(xyz),
        )
        times = self._times(way.step[at])
        for place, columns in ((name, points), (f"{name}/heading", arrows)):
            parts = columns.partition(home.astype(np.int64))
            self._rr.send_columns(f"bodies/{place}", times, parts, recording=self._stream)

    def _rows(self, chunk: Chunk) -> None:
        for table, rows in chunk.rows.items():
            if table == "observations":
                for robot, seen in _grouped(rows, "robot").items():
                    self._sightings(f"bodies/{robot}/sees", seen)
            elif table == "events":
                for entity, events in _grouped(rows, "entity").items():
                    texts = [" ".join(_words(row)) for row in events]
                    self._send(f"events/{entity}", events, self._rr.TextLog.columns(text=texts))
            elif rows and {"user", "room", "share"} <= rows[0].keys():
                for (user, room), shares in _grouped(rows, "user", "room").items():
                    values = self._rr.Scalars.columns(scalars=[row["share"] for row in shares])
                    self._send(f"{table}/{user}/{room}", shares, values)

    def _sightings(self, place: str, rows: list[dict[str, Any]]) -> None:
        counts = np.unique([row["step"] for row in rows], return_counts=True)[1]
        first = np.concatenate([[0], np.cumsum(counts)[:-1]])
        looks = [rows[i] for i in first]
        points = self._rr.Points3D.columns(
            positions=[(row["x"], row["y"], 0.0) for row in rows],
            labels=[row["user"] or "unknown" for row in rows],
            colors=[self._colors.get(row["user"] or "", _GREY) for row in rows],
            radii=np.full(len(rows), _SIGHTING),
        )
        self._send(place, looks, points.partition(counts))

    def _send(self, place: str, rows: list[dict[str, Any]], columns: Any) -> None:
        steps = np.array([row["step"] for row in rows], np.int64)
        self._rr.send_columns(place, self._times(steps), columns, recording=self._stream)


def _grouped(rows: list[dict[str, Any]], *keys: str) -> dict[Any, list[dict[str, Any]]]:
    groups: dict[Any, list[dict[str, Any]]] = {}
    for row in rows:
        key = row[keys[0]] if len(keys) == 1 else tuple(row[key] for key in keys)
        groups.setdefault(key, []).append(row)
    return groups


def _words(row: dict[str, Any]) -> list[str]:
    return [str(row[key]) for key in ("event", "user", "detail") if row.get(key)]


def _rgb(color: str) -> tuple[int, ...]:
    """Return a colour such as "#ff8000" as red, green and blue."""
    return tuple(bytes.fromhex(color[1:7]))


def _on_floor(xy: Any) -> Any:
    """Return points in the plane as points in space, (n, 3)."""
    return np.concatenate([xy, np.zeros((len(xy), 1))], axis=1)
