"""The samples of a body in a stored run, ready for drawing: positions, rooms and paths."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import numpy as np
from matplotlib.colors import is_color_like
from numpy.typing import NDArray

from fleet2d.errors import ArtifactError
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I16, I64, Bool
from fleet2d.palette import body_color
from fleet2d.runs.run import Run, categories
from fleet2d.runs.trajectory import rebuild_path

SAMPLES = 40_000  # of short runs; longer runs have a sample a minute
SAMPLE_US = 60_000_000
# A random walk has a leg for each step: all of them would be slow to draw, and no legible picture.
LEGS = 1_500
WALKED_STEPS = 4_000_000
# Positions with a longer time between them are not connected by a line.
JOINED_US = 5_000_000
# A position so near to the way between its neighbours is on it: somewhat more than rounding.
STRAIGHT_M = 0.003


@dataclass(frozen=True)
class BodyTrace:
    """The samples of one body over a run; their arrays have the same length.

    Attributes:
        name: Its name in the scenario.
        color: Its colour.
        robot: Whether it is a robot.
        every_us: The time between two samples [us].
        step: The steps of the samples, int64 (n,).
        xy: The positions, float64 (n, 2) [m].
        heading: The headings, float64 (n,) [rad].
        room: The index of the room, -1 while away, int16 (n,).
        legs: Straight pieces of its paths without duplicates, float64 (m, 2, 2) [m].
        note: What the trace doesn't show exactly; empty if nothing.
    """

    name: str
    color: str
    robot: bool
    every_us: int
    step: I64
    xy: F64
    heading: F64
    room: I16
    legs: F64
    note: str = ""


def trace_of(run: Run, plan: FloorPlan, name: str, number: int, *, robot: bool) -> BodyTrace | None:
    """Return the trace of a body, None if nothing is stored of it.

    Args:
        run: The run.
        plan: Its home.
        name: The body.
        number: Its number among the users or robots, for its colour.
        robot: Whether it is a robot.
    """
    color = _color(run, name, number, robot=robot)
    reason = "no key frames were stored"
    if "key_frames" in run.tables:
        try:
            return _from_key_frames(run, plan, name, color, robot=robot)
        except ArtifactError as error:
            reason = str(error)
    return _from_trajectories(run, plan, name, color, reason, robot=robot)


def _color(run: Run, name: str, number: int, *, robot: bool) -> str:
    bucket = run.manifest["scenario"].get("robots" if robot else "users", {})
    color = bucket.get(name, {}).get("color")
    if isinstance(color, str) and is_color_like(color):
        return color
    return body_color(number, robot=robot)


def _from_key_frames(run: Run, plan: FloorPlan, name: str, color: str, *, robot: bool) -> BodyTrace:
    step_us, steps = run.manifest["step_us"], run.manifest["steps"]
    stride = max(1, min(SAMPLE_US, steps * step_us // SAMPLES) // step_us)
    every_us = stride * step_us
    path = rebuild_path(run, plan, name, timedelta(microseconds=every_us))
    xy = np.stack([path.x, path.y], axis=1)
    legs, note = _legs_of(run, plan, name)
    return BodyTrace(
        name, color, robot, every_us, path.step, xy, path.heading, path.room, legs, note
    )


def _legs_of(run: Run, plan: FloorPlan, name: str) -> tuple[F64, str]:
    """Return the legs between the key frames of a body, and a remark if some are left out.

    Of a random walk, the first `LEGS` legs are returned, and none of a long one.
    """
    keys = _rows(run, "key_frames", name, ("x", "y", "heading", "away"), "kind")
    if (keys["kind"] == "walk").any():
        step_us, steps = run.manifest["step_us"], run.manifest["steps"]
        if steps > WALKED_STEPS or step_us > JOINED_US:
            return _no_legs(), ""
        path = rebuild_path(run, plan, name, timedelta(microseconds=step_us))
        legs = _legs_between(np.stack([path.x, path.y], axis=1), path.away)
        if len(legs) <= LEGS:
            return legs, ""
        moving = np.flatnonzero(np.diff(path.x).astype(bool) | np.diff(path.y).astype(bool))
        minutes = max(1, round(int(moving[LEGS]) * step_us / 6e7))
        return legs[:LEGS], f"only the ways of the first {minutes} min are drawn"
    # The end of a leg that was interrupted is only planned, and left out.
    keys = {name: column[keys["kind"] != "planned"] for name, column in keys.items()}
    xy = np.stack([keys["x"], keys["y"]], axis=1)
    ends = _are_ends(xy, np.stack([keys["heading"], keys["away"]], axis=1))
    legs = _legs_between(xy[ends], keys["away"][ends])
    # A patrol repeats the same paths for weeks: equal legs, to the centimetre, are drawn once.
    _, first = np.unique(np.rint(legs.reshape(-1, 4) * 100), axis=0, return_index=True)
    return legs[np.sort(first)], ""


def _from_trajectories(
    run: Run, plan: FloorPlan, name: str, color: str, reason: str, *, robot: bool
) -> BodyTrace | None:
    """Return the samples of the table of trajectories; `reason` is for the note."""
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
    legs = _legs_between(xy, rows["away"])[:LEGS] if every_us <= JOINED_US else _no_legs()
    note = f"{reason}: positions every {_length(every_us)}"
    samples = (rows["step"], xy, rows["heading"], room)
    return BodyTrace(name, color, robot, every_us, *samples, legs, note)


def _rows(
    run: Run, table: str, name: str, columns: Sequence[str], category: str
) -> dict[str, NDArray[Any]]:
    """Return columns of the rows of a body; `category` is a column of texts."""
    content = run.tables[table]
    code, names = categories(content["entity"])
    of_body = code == names.index(name) if name in names else np.zeros(len(code), np.bool_)
    rows = {column: content[column].to_numpy()[of_body] for column in columns}
    code, names = categories(content[category])
    rows[category] = np.array([*names, ""])[code[of_body]]
    return rows


def _legs_between(xy: F64, away: Bool) -> F64:
    """Return the legs between positions, without those from and to an absence: (n, 2, 2) [m]."""
    legs = np.stack([xy[:-1], xy[1:]], axis=1)
    home = ~away.astype(bool)
    return legs[(legs[:, 0] != legs[:, 1]).any(axis=1) & home[:-1] & home[1:]]


def _are_ends(xy: F64, state: F64) -> Bool:
    """Return which positions aren't just passed on a straight way, as where a robot brakes.

    Args:
        xy: Positions [m], float64 (n, 2).
        state: What else differs at the ends of ways, (n, k).
    """
    to, on, way = xy[1:-1] - xy[:-2], xy[2:] - xy[1:-1], xy[2:] - xy[:-2]
    beside = np.abs(to[:, 0] * way[:, 1] - to[:, 1] * way[:, 0])
    is_straight = ((to * on).sum(axis=1) > 0) & (beside <= STRAIGHT_M * np.hypot(*way.T))
    is_same = (state[1:] == state[:-1]).all(axis=1)
    ends = np.ones(len(xy), np.bool_)
    ends[1:-1] = ~(is_straight & is_same[1:] & is_same[:-1])
    return ends


def _no_legs() -> F64:
    return np.zeros((0, 2, 2))


def _length(us: int) -> str:
    seconds = us / 1e6
    if seconds < 60:
        return f"{seconds:g} s"
    return f"{seconds / 60:g} min" if seconds < 3600 else f"{seconds / 3600:g} h"
