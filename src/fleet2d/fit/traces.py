"""Traces: the kind of room of each second, of a log and of a simulated persona."""

from datetime import timedelta
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.fit.timeline import read_seconds
from fleet2d.logs.log import AWAY, ActivityLog, LogError
from fleet2d.logs.read import read_log

START = "2026-01-05"  # a Monday
I16 = NDArray[np.int16]


class RoomTrace(NamedTuple):
    """The kind of room of each second, from midnight on.

    Attributes:
        rooms: Index of the kind, -1 if unknown, int16 (seconds,).
        kinds: The kinds of rooms.
    """

    rooms: I16
    kinds: tuple[str, ...]


def trace_of_log(path: Path) -> RoomTrace:
    """Return the trace of a log of rooms and activities.

    Raises:
        LogError: The log can't be read, or is one of positions.
    """
    log = read_log(path)
    if not isinstance(log, ActivityLog):
        raise LogError(f"{path} is a log of positions: give a log of rooms")
    states, seconds = read_seconds(log)
    kinds = tuple(sorted({state.place for state in states}))
    index = np.array([kinds.index(state.place) for state in states] + [-1], np.int16)
    return RoomTrace(index[seconds], kinds)


def trace_of_persona(persona: str, days: int, seed: int) -> RoomTrace:
    """Return the trace of a persona that lives alone in the bundled home, with furniture."""
    from fleet2d.engine.run import run

    stored = run(
        {
            "simulation": {"start": START, "duration": f"{days} d", "seed": seed},
            "floorplan": {"type": "bundled", "furnish": True},
            "users": {"ana": {"type": "routine", "persona": persona}},
        }
    )
    of_room = [room.type for room in stored.plan.rooms]
    kinds = tuple(sorted({*of_room, AWAY}))
    index = np.array([kinds.index(kind) for kind in (*of_room, AWAY)], np.int16)
    return RoomTrace(index[stored.path("ana", every=timedelta(seconds=1)).room], kinds)
