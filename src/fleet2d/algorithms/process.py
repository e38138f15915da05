"""Process: an algorithm that is a program of its own, in any language, over pipes."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Any, Literal

import numpy as np
from pydantic import Field

from fleet2d.algorithms.algorithm import Algorithm, Present, RoomDistribution
from fleet2d.algorithms.history import History
from fleet2d.algorithms.presence.belief import Presence
from fleet2d.configuration.components import register
from fleet2d.configuration.trust import check_trust
from fleet2d.configuration.units import InputPath, PositiveDuration
from fleet2d.errors import ComponentError
from fleet2d.floorplan.home import Home
from fleet2d.runtime.program import ExternalProgram

# What ends an Arrow IPC stream: no further message.
END_OF_STREAM = b"\xff\xff\xff\xff\0\0\0\0"


@register("algorithm", "process")
class Process(Algorithm):
    """An algorithm in another process, of any language.

    The program gets the history since its last update as Arrow IPC streams, and answers with a
    share for each room, with shares for each user, or with columns to store; see
    `fleet2d.runtime.program` for the messages.

    Attributes:
        command: The program; a file .py is run by Python.
        arguments: Its arguments.
        sends: What it is sent: observations, evidence, poses of robots.
        settings: Its own settings, which it gets in the first message.
        timeout: The longest time to wait for an answer; then the run fails.
    """

    command: InputPath
    arguments: tuple[str, ...] = ()
    sends: tuple[Literal["observations", "evidence", "poses"], ...] = Field(
        default=("observations",), min_length=1
    )
    settings: dict[str, Any] = Field(default={})
    timeout: PositiveDuration = timedelta(seconds=10)

    @property
    def needs(self) -> frozenset[str]:  # type: ignore[override]
        """What has to be computed for it."""
        return frozenset({"evidence"} & set(self.sends))

    def start(self, home: Home) -> None:
        """Check that the program may run; it starts at the first update."""
        check_trust("process", [self.command])
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
        blocks = {
            name: data
            for part in self.sends
            for name, data in _TABLES[part](history, state).items()
        }
        message = {"type": "update", "first": history.first, "end": history.end}
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
    import pyarrow as pa

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
        "x": np.concatenate([part.x for part in parts]) if parts else np.zeros(0),
        "y": np.concatenate([part.y for part in parts]) if parts else np.zeros(0),
        "heading": np.concatenate([part.heading for part in parts]) if parts else np.zeros(0),
    }
    return {"poses": _ipc(columns)}


_TABLES = {"observations": _observations, "evidence": _evidence, "poses": _poses}
