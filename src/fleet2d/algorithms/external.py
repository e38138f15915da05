"""Algorithms for other programs: evidence as a table, a program that is asked, recorded output."""

from collections.abc import Mapping
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pydantic import Field

from fleet2d.algorithms.algorithm import Algorithm, Present, RoomDistribution
from fleet2d.algorithms.history import History
from fleet2d.algorithms.presence.belief import ANYONE, Presence
from fleet2d.configuration.problems import check_known
from fleet2d.configuration.trust import check_may_run
from fleet2d.configuration.units import InputPath, PositiveDuration, micros
from fleet2d.errors import ComponentError
from fleet2d.floorplan.home import Home
from fleet2d.logs.log import AWAY, LogError, LogKeys
from fleet2d.logs.tables import LogTable
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.local_time import at_reading
from fleet2d.runtime.program import ExternalProgram

# The end of an Arrow IPC stream: no further message.
END_OF_STREAM = b"\xff\xff\xff\xff\0\0\0\0"

NAMES = {
    "time": ("time", "timestamp", "t", "datetime", "time_s"),
    "room": ("room", "place"),
    "share": ("share", "probability", "p"),
    "user": ("user", "person"),
}
"""The names that a column may have, if the user gives none."""


class Process(Algorithm):
    """An algorithm in another process, of any language.

    The program gets the history since its last update as tables, and answers with a
    share for each room, with shares for each user, or with columns to store; see
    `fleet2d.runtime.program` for the messages.

    Attributes:
        command: The program; a file .py is run by Python, .js and .mjs by Node.
        arguments: Its arguments.
        sends: What it is sent: observations, evidence, poses of robots.
        tables: How: as Arrow IPC streams after the message, or in it as JSON, for a few values.
        settings: Its own settings, which it gets in the first message.
        timeout: The longest time to wait for an answer; then the run fails.
    """

    command: InputPath
    arguments: tuple[str, ...] = ()
    sends: tuple[Literal["observations", "evidence", "poses"], ...] = Field(
        default=("observations",), min_length=1
    )
    tables: Literal["arrow", "json"] = "arrow"
    settings: dict[str, Any] = Field(default={})
    timeout: PositiveDuration = timedelta(seconds=10)

    @property
    def needs(self) -> frozenset[str]:  # type: ignore[override]
        """The data that have to be computed for it."""
        return frozenset({"evidence"} & set(self.sends))

    def start(self, home: Home) -> None:
        """Check that the program may run; it starts at the first update."""
        check_may_run("process", [self.command])
        self._rooms = [{"name": room.name, "type": room.type} for room in home.rooms]
        self.program: ExternalProgram | None = None

    def update(self, history: History, state: Present) -> Any:
        """Ask the program."""
        if self.program is None:
            about = {
                "start": state.start.isoformat(),
                "step_s": history.step_s,
                "rooms": self._rooms,
                "users": list(state.users),
                "robots": list(state.robots),
                "settings": self.settings,
            }
            self.program = ExternalProgram(
                self.command, self.arguments, self.timeout.total_seconds(), about
            )
        blocks: dict[str, bytes] = {}
        for part in self.sends:
            blocks |= _TABLES[part](history, state)
        message: dict[str, Any] = {"type": "update", "first": history.first, "end": history.end}
        if self.tables == "json":
            message |= {name: _columns(data) for name, data in blocks.items()}
            blocks = {}
        answer = self.program.ask(message, blocks)
        return self._output(answer.content, state)

    def _output(self, content: Mapping[str, Any], state: Present) -> Any:
        """Return the output that an answer has.

        Raises:
            ComponentError: It has none of the known keys, or values of another shape.
        """
        if content.get("type") == "none":
            return None
        try:
            if "share" in content:
                return RoomDistribution(content["share"])
            if "home" in content:
                home = np.array(content["home"], np.float64)
                away = np.array(content.get("away", [0.0] * len(home)), np.float64)
                return Presence(state.users, home, away, state.time)
            if "columns" in content:
                return {name: np.array(values) for name, values in content["columns"].items()}
        except (TypeError, ValueError, AttributeError) as error:
            raise ComponentError(f"{self.command} returned invalid values: {error}") from None
        raise ComponentError(
            f"{self.command} answered {content!r:.200}: expected 'share' (one for each room),"
            " 'home' and 'away' (of each user, and of anyone), 'columns', or the type 'none'"
        )


def _ipc(columns: Mapping[str, Any]) -> bytes:
    """Return columns of numbers as an Arrow IPC stream of one batch."""
    arrays = [  # not by `pa.array`, which imports pandas
        pa.Array.from_buffers(
            pa.from_numpy_dtype(values.dtype),
            len(values),
            [None, pa.py_buffer(np.ascontiguousarray(values))],
        )
        for values in columns.values()
    ]
    batch = pa.RecordBatch.from_arrays(arrays, list(columns))
    schema: bytes = batch.schema.serialize().to_pybytes()
    return schema + batch.serialize().to_pybytes() + END_OF_STREAM


def _columns(data: bytes) -> dict[str, list[Any]]:
    """Return the columns of an Arrow IPC stream."""
    columns: dict[str, list[Any]] = pa.ipc.open_stream(data).read_all().to_pydict()
    return columns


def _observations(history: History, _: Present) -> dict[str, bytes]:
    o = history.observations
    names = ("step", "robot", "user", "room")
    integers = {name: getattr(o, name).astype(np.int64) for name in names}
    return {"observations": _ipc({**integers, "x": o.x, "y": o.y, "heading": o.heading})}


def _evidence(history: History, _: Present) -> dict[str, bytes]:
    evidence = history.evidence
    bins, rooms = evidence.watched.shape
    counts = evidence.sightings
    watched = {
        "bin": np.repeat(np.arange(bins, dtype=np.int64), rooms),
        "day": np.repeat(evidence.day, rooms),
        "minute": np.repeat(evidence.minute, rooms),
        "room": np.tile(np.arange(rooms, dtype=np.int64), bins),
        "watched": evidence.watched.ravel(),
    }
    seen = {"bin": counts.bin, "user": counts.user, "room": counts.place, "steps": counts.steps}
    return {"evidence": _ipc(watched), "sightings": _ipc(seen)}


def _poses(history: History, state: Present) -> dict[str, bytes]:
    parts = [history.poses(robot) for robot in state.robots]
    steps = np.arange(history.first, history.end, dtype=np.int64)
    count = len(steps)
    columns = {
        "step": np.tile(steps, len(parts)),
        "robot": np.repeat(np.arange(len(parts), dtype=np.int64), count),
    }
    for name in ("x", "y", "heading"):
        columns[name] = np.concatenate([np.zeros(0), *(getattr(part, name) for part in parts)])
    return {"poses": _ipc(columns)}


_TABLES = {"observations": _observations, "evidence": _evidence, "poses": _poses}


class ReplayedOutput(Algorithm, LogKeys):
    """Put out the beliefs of an algorithm from a table: shares of rooms at some times.

    A table of a stored run, such as its `ltp.parquet`, is one; shares are given at home, so rows of
    `away` are left out. At each update the newest shares count that aren't later; before the first
    there is no output.

    Attributes:
        path: The table (.csv, .parquet, .jsonl): a row for each time and room.
        columns: Names of its columns time, room, share and user, as {share: belief}.
        user: The person whose shares count, if the table has several.
    """

    path: InputPath
    user: str | None = None

    def files(self) -> list[Path]:
        """Return the file that it reads."""
        return [self.path]

    def start(self, home: Home) -> None:
        """Read the table.

        Raises:
            LogError: It can't be read, lacks a column, or names rooms or people of another home.
        """
        table = LogTable.read(
            self.path,
            self.columns,
            NAMES,
            ("time", "room", "share"),
            decimal_comma=self.decimal_comma,
            day_first=self.day_first,
        )
        if "user" in table.named:
            table = table.where(table.rows_of("user", self.user))
        rooms = [room.name for room in home.rooms]
        is_at_home = pc.fill_null(pc.not_equal(table.texts("room"), AWAY), False)
        table = table.where(is_at_home.to_numpy(zero_copy_only=False))
        texts = table.texts("room")
        for name in pc.unique(texts).to_pylist():
            check_known(name, "room", rooms, LogError, f"{self.path}: ")
        room = pc.index_in(texts, value_set=pa.array(rooms)).to_numpy(zero_copy_only=False)
        self._columns = table.stamps(), room, table.numbers("share"), len(rooms)

    def check_times(self, clock: Clock) -> None:
        """Place the table in the run, and refuse one of another time.

        Raises:
            LogError: Its times are wrong, or it ends before the run begins or begins after its end.
        """
        stamps, room, share, rooms = self._columns
        zone = self.zone_of(clock)
        usable = np.isfinite(share)
        local = stamps.local(self.path, "shares", usable, [], time_zone=zone, sort=self.sort)
        is_new = np.append(True, np.diff(local.time_us) > 0)
        self._times = local.time_us[is_new]
        self._day = local.first_day
        self._shares = np.zeros((len(self._times), rooms))
        np.add.at(self._shares, (np.cumsum(is_new) - 1, room[local.row]), share[local.row])
        midnight = self._midnight(clock.start)
        first, last = (midnight + timedelta(microseconds=int(t)) for t in self._times[[0, -1]])
        end = clock.time(clock.steps)
        if last < clock.start or first >= end:
            raise LogError(
                f"{self.path}: its shares are from {first} to {last}, and the run is from"
                f" {clock.start} to {end}: set simulation.start, or give a table of that time"
            )

    def _midnight(self, start: datetime) -> datetime:
        """Return the moment from which its times count, by the start of the run."""
        midnight = datetime.combine(self._day or start.date(), datetime.min.time())
        return at_reading(start, midnight)

    def update(self, history: History, state: Present) -> Any:
        """Return the newest shares; None before the first."""
        midnight = self._midnight(state.start)
        row = int(np.searchsorted(self._times, micros(state.time - midnight), side="right")) - 1
        return None if row < 0 else RoomDistribution(self._shares[row])


class EvidenceTable(Algorithm):
    """The views of robots, and the people perceived in them, as rows of a table.

    There is a row of `anyone` for each bin (a minute, or a step where that is longer) and each room
    that was in view, or in which somebody was perceived; and one more for each user who was
    recognized there. Rooms that were looked at and empty have `seen` 0. As an algorithm it can't
    read where people are: the table holds nothing that robots don't perceive.

    Columns: `bin`, the first step of the bin; its own time as `day` (as `date.toordinal` counts)
    and `minute` of the day; `room`, and its `kind`; `user`; `watched`, the share of the room in
    view, averaged over the bin; `seen`, the steps at which the user was perceived there.
    """

    needs = frozenset({"evidence"})

    def start(self, home: Home) -> None:
        """Keep the names and the kinds of rooms."""
        self.names = np.array([room.name for room in home.rooms], object)
        self.kinds = np.array([room.type for room in home.rooms], object)

    def update(self, history: History, state: Present) -> dict[str, Any] | None:
        """Return the rows of the period, by bin, room and user, anyone first; None without any."""
        evidence = history.evidence
        user, bin_, room, steps, shape = evidence.sightings  # `seen` of many users is mostly zeros
        anyone = shape[1] - 1
        seen = np.zeros((shape[0], shape[2]), np.int64)
        is_anyone = user == anyone
        seen[bin_[is_anyone], room[is_anyone]] = steps[is_anyone]
        watched_bin, watched_room = np.nonzero((evidence.watched > 0) | (seen > 0))
        known = ~is_anyone
        bins = np.concatenate([watched_bin, bin_[known]])
        rooms = np.concatenate([watched_room, room[known]])
        users = np.concatenate([np.full(len(watched_bin), -1), user[known]])
        counts = np.concatenate([seen[watched_bin, watched_room], steps[known]])
        if not len(bins):
            return None
        order = np.lexsort((users, rooms, bins))
        bins = bins[order]
        rooms = rooms[order]
        users = users[order]
        return {
            "bin": evidence.begin + bins * evidence.bin_steps,
            "day": evidence.day[bins],
            "minute": evidence.minute[bins],
            "room": self.names[rooms],
            "kind": self.kinds[rooms],
            "user": np.array([*state.users, ANYONE], object)[users],
            "watched": evidence.watched[bins, rooms],
            "seen": counts[order],
        }
