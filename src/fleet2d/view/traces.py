"""What a stored run says of one body, ready to be drawn: where it was, and the ways it went."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import numpy as np
from matplotlib.colors import is_color_like
from numpy.typing import NDArray

from fleet2d.errors import ArtifactError
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.palette import body_color
from fleet2d.runs.categories import categories
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import rebuild_path

SAMPLES = 40_000  # a short run is sampled more often than once a minute, up to about so many times
SAMPLE_US = 60_000_000
# A random walk has a leg per step: a whole one is a scribble that takes long to draw.
LEGS = 1_500
WALKED_STEPS = 4_000_000
# Positions farther apart in time than this are not joined by a line.
JOINED_US = 5_000_000

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True)
class Trace:
    """One body over a run; the arrays of samples are of one length.

    Attributes:
        name: Its name in the scenario.
        color: The colour to draw it in.
        robot: Whether it is a robot.
        every_us: Time between two samples [us].
        step: Steps of the samples, int64.
        xy: Where it was, float64 (n, 2) [m].
        heading: float64 [rad].
        room: Index of the room, -1 while away, int16.
        legs: Straight pieces that it walked, float64 (m, 2, 2) [m], none twice.
        note: What is not shown as it was; "" if all is.
    """

    name: str
    color: str
    robot: bool
    every_us: int
    step: I64
    xy: F64
    heading: F64
    room: NDArray[np.int16]
    legs: F64
    note: str = ""


def trace_of(run: Run, plan: FloorPlan, name: str, number: int, *, robot: bool) -> Trace | None:
    """Return what is stored of a body, None if nothing is.

    Args:
        run: The run.
        plan: Its home.
        name: The body.
        number: Which of the users or robots it is, for its colour.
        robot: Whether it is a robot.
    """
    color = _color(run, name, number, robot=robot)
    if "key_frames" in run.tables:
        try:
            return _rebuilt(run, plan, name, color, robot=robot)
        except ArtifactError as error:
            trace = _sampled(run, plan, name, color, str(error), robot=robot)
    else:
        trace = _sampled(run, plan, name, color, "no key frames were stored", robot=robot)
    return trace


def _color(run: Run, name: str, number: int, *, robot: bool) -> str:
    bucket = run.manifest["scenario"].get("robots" if robot else "users", {})
    color = bucket.get(name, {}).get("color")
    if isinstance(color, str) and is_color_like(color):
        return color
    return body_color(number, robot=robot)


def _rebuilt(run: Run, plan: FloorPlan, name: str, color: str, *, robot: bool) -> Trace:
    step_us, steps = run.manifest["step_us"], run.manifest["steps"]
    stride = max(1, min(SAMPLE_US, steps * step_us // SAMPLES) // step_us)
    every_us = stride * step_us
    path = rebuild_path(run, plan, name, timedelta(microseconds=every_us))
    xy = np.stack([path.x, path.y], axis=1)
    legs, note = _legs_of(run, plan, name)
    return Trace(name, color, robot, every_us, path.step, xy, path.heading, path.room, legs, note)


def _legs_of(run: Run, plan: FloorPlan, name: str) -> tuple[F64, str]:
    """Return the legs between the key frames of a body; of a random walk, the first ones."""
    keys = _rows(run, "key_frames", name, ("x", "y", "away"), "kind")
    if (keys["kind"] == "walk").any():
        step_us, steps = run.manifest["step_us"], run.manifest["steps"]
        if steps > WALKED_STEPS or step_us > JOINED_US:
            return _no_legs(), ""
        path = rebuild_path(run, plan, name, timedelta(microseconds=step_us))
        legs = _joined(np.stack([path.x, path.y], axis=1), path.away)
        if len(legs) <= LEGS:
            return legs, ""
        moving = np.flatnonzero(np.diff(path.x).astype(bool) | np.diff(path.y).astype(bool))
        minutes = max(1, round(int(moving[LEGS]) * step_us / 6e7))
        return legs[:LEGS], f"only the ways of the first {minutes} min are drawn"
    # Where a leg was broken off, the next plan begins: the end that was only planned is left out.
    reached = keys["kind"] != "planned"
    xy = np.stack([keys["x"][reached], keys["y"][reached]], axis=1)
    legs = _joined(xy, keys["away"][reached])
    # A patrol goes the same ways for weeks: each is drawn once, to the centimetre.
    _, first = np.unique(np.rint(legs.reshape(-1, 4) * 100), axis=0, return_index=True)
    return legs[np.sort(first)], ""


def _sampled(
    run: Run, plan: FloorPlan, name: str, color: str, why: str, *, robot: bool
) -> Trace | None:
    """Return what the trajectories table says, sampled as it is."""
    if "trajectories" not in run.tables:
        return None
    rows = _rows(run, "trajectories", name, ("step", "x", "y", "heading", "away"), "room")
    if len(rows["step"]) == 0:
        return None
    step_us = run.manifest["step_us"]
    gaps = np.diff(rows["step"])
    every_us = int(gaps[0] if len(gaps) else 1) * step_us
    xy = np.stack([rows["x"], rows["y"]], axis=1)
    index = {room.name: room.index for room in plan.rooms}
    room = np.array([index.get(word, -1) for word in rows["room"].tolist()], np.int16)
    legs = _joined(xy, rows["away"])[:LEGS] if every_us <= JOINED_US else _no_legs()
    note = f"{why}: positions every {_length(every_us)}"
    shown = (rows["step"], xy, rows["heading"], room)
    return Trace(name, color, robot, every_us, *shown, legs, note)


def _rows(
    run: Run, table: str, name: str, columns: Sequence[str], words: str
) -> dict[str, NDArray[Any]]:
    """Return columns of a body's rows of a table; `words` is a column of categories."""
    whole = run.tables[table]
    code, names = categories(whole["entity"])
    mine = code == names.index(name) if name in names else np.zeros(len(code), np.bool_)
    rows = {column: whole[column].to_numpy()[mine] for column in columns}
    code, names = categories(whole[words])
    rows[words] = np.array([*names, ""])[code[mine]]
    return rows


def _joined(xy: F64, away: NDArray[np.bool_]) -> F64:
    """Return the moves from position to position, without those across an absence."""
    legs = np.stack([xy[:-1], xy[1:]], axis=1)
    gone = away.astype(bool)
    walked = (legs[:, 0] != legs[:, 1]).any(axis=1) & ~gone[:-1] & ~gone[1:]
    found: F64 = legs[walked]
    return found


def _no_legs() -> F64:
    return np.zeros((0, 2, 2))


def _length(us: int) -> str:
    seconds = us / 1e6
    if seconds < 60:
        return f"{seconds:g} s"
    return f"{seconds / 60:g} min" if seconds < 3600 else f"{seconds / 3600:g} h"
