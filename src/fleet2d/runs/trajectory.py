"""Poses at any step of a stored run, rebuilt exactly from its key frames."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.bounds import one_line
from fleet2d.clock import Clock
from fleet2d.entities.actor import Actor
from fleet2d.entities.meander import Meander
from fleet2d.entities.motion import Pose
from fleet2d.errors import ArtifactError
from fleet2d.floorplan.home.home import Home
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I16, I64, Bool
from fleet2d.kernels.headings import TURN, in_radians
from fleet2d.kernels.mesh import SUB
from fleet2d.kernels.motion import (
    Breakpoints,
    Poses,
    empty_poses,
    paste_poses,
    trace_meander,
    trace_track,
)
from fleet2d.runs.key_kinds import KEY_KINDS, PLANNED, WALK
from fleet2d.scenario.model import load_scenario
from fleet2d.trust import restrict_stored
from fleet2d.units import whole_steps

if TYPE_CHECKING:
    from fleet2d.runs.run import Run

# The sections of a scenario that bodies depend on; the components of all others are not imported.
_BODIES = ("simulation", "floorplan", "users", "robots")


@dataclass(frozen=True)
class Trajectory:
    """Poses of one body, all arrays of one length.

    Attributes:
        step: Steps, int64.
        time: Local times, datetime64[us].
        x: float64 [m]; while the body is away, the place where it left the home.
        y: float64 [m].
        heading: Counter-clockwise from +x, float64 [rad].
        away: Whether the body is away from home, bool.
        room: Index of the room, -1 while away, int16.
    """

    step: I64
    time: NDArray[np.datetime64]
    x: F64
    y: F64
    heading: F64
    away: Bool
    room: I16


def rebuild_path(run: "Run", plan: FloorPlan, entity: str, every: timedelta) -> Trajectory:
    """Return the poses of a body of a stored run at regular times.

    Args:
        run: A run that stored key frames.
        plan: The floor plan it ran in.
        entity: The name of the body.
        every: Time between two poses, a multiple of the step.

    Raises:
        ArtifactError: The run stored no key frames or damaged ones, there is no such body, or
            `every` is not a multiple of the step.
    """
    manifest = run.manifest
    clock = Clock(datetime.fromisoformat(manifest["start"]), manifest["step_us"], manifest["steps"])
    if not isinstance(every, timedelta):
        raise ArtifactError(
            f"every: expected a timedelta like timedelta(seconds=10), got {every!r}"
        )
    stride = whole_steps(every, clock.step_us, "every", ArtifactError)
    if "key_frames" not in run.tables:
        raise ArtifactError("the run stored no key frames: run it with artifacts.key_frames=true")
    try:
        keys = _keys_of(run, plan, entity, clock)
        steps = np.arange(0, clock.steps, stride, dtype=np.int64)
        out = empty_poses(len(steps))
        out.x[:] = -1  # outside of the plan: what damaged key frames leave out
        _trace(run, plan, entity, clock, keys, stride, out)
    except (KeyError, ValueError, OverflowError, MemoryError) as error:
        raise ArtifactError(
            f"key_frames.parquet can't be followed ({one_line(error, 100)}): it is damaged;"
            " `fleet2d verify` says which files have changed"
        ) from error
    rows, columns = plan.room_of_place.shape
    cells = out.y // SUB, out.x // SUB
    inside = (0 <= cells[0]) & (cells[0] < rows) & (0 <= cells[1]) & (cells[1] < columns)
    if not inside.all():
        raise ArtifactError(
            f"key_frames.parquet has poses of {entity} outside of the floor plan: it is damaged;"
            " `fleet2d verify` says which files have changed"
        )
    xy = plan.lattice.to_metres(np.stack([out.x, out.y], axis=-1))
    room = np.where(out.away, -1, plan.room_of_place[cells])
    return Trajectory(
        steps,
        clock.times(steps),
        xy[:, 0],
        xy[:, 1],
        in_radians(out.heading),
        out.away.astype(bool),
        room,
    )


def _keys_of(run: "Run", plan: FloorPlan, entity: str, clock: Clock) -> dict[str, Any]:
    """Return the key frames of a body in lattice units, each column (n,)."""
    entities = run.manifest["entities"]
    names = [*entities["users"], *entities["robots"]]
    if entity not in names:
        raise ArtifactError(f"there is no {entity!r} in the run; there are: {', '.join(names)}")
    from pyarrow import array, compute

    table = run.tables["key_frames"]
    rows = table.filter(compute.equal(table["entity"].cast("string"), entity))
    column = {n: rows[n].to_numpy() for n in ("step", "time", "x", "y", "heading", "away")}
    kind = compute.index_in(rows["kind"].cast("string"), array(KEY_KINDS)).to_numpy()
    xy = plan.lattice.to_lattice(np.stack([column["x"], column["y"]], axis=-1))
    return {
        "step": column["step"],
        "time": (column["time"].astype("M8[us]") - np.datetime64(clock.start, "us")).astype(
            np.int64
        ),
        "kind": kind.astype(np.int64),
        "x": np.ascontiguousarray(xy[:, 0]),
        "y": np.ascontiguousarray(xy[:, 1]),
        "heading": np.rint(column["heading"] * (TURN / (2 * np.pi))).astype(np.int64) % TURN,
        "away": column["away"].astype(np.uint8),
    }


def _trace(
    run: "Run",
    plan: FloorPlan,
    entity: str,
    clock: Clock,
    keys: dict[str, Any],
    stride: int,
    out: Poses,
) -> None:
    """Fill `out` from the key frames, segment by segment, each up to the next one's begin."""
    kind, step = keys["kind"], keys["step"]
    walker = None
    begin = 0
    while begin < len(kind):
        end = begin + 1
        if kind[begin] == WALK:
            stop = step[end] if end < len(kind) else clock.steps
            walker = walker or _walker(run, plan, entity, clock)
            _follow_walk(walker, keys, begin, int(stop), stride, out)
        else:
            while end < len(kind) and kind[end] not in (WALK, PLANNED):
                end += 1
            if end < len(kind) and kind[end] == PLANNED:  # the body never reached it
                end += 1
            stop = step[end] if end < len(kind) else clock.steps
            _follow_track(keys, begin, end, int(stop), clock, stride, out)
        begin = end


def _follow_track(
    keys: dict[str, Any], begin: int, end: int, stop: int, clock: Clock, stride: int, out: Poses
) -> None:
    part = Breakpoints(*(keys[name][begin:end] for name in Breakpoints._fields))
    first = -(-int(keys["step"][begin]) // stride)
    last = -(-stop // stride)
    if last > first:
        poses = Poses(
            out.x[first:last], out.y[first:last], out.heading[first:last], out.away[first:last]
        )
        trace_track(part, first * stride * clock.step_us, stride * clock.step_us, poses)


def _follow_walk(
    walker: tuple[Home, Actor, Meander],
    keys: dict[str, Any],
    begin: int,
    stop: int,
    stride: int,
    out: Poses,
) -> None:
    home, actor, behavior = walker
    step = int(keys["step"][begin])
    state = Pose(*(int(keys[n][begin]) for n in ("x", "y", "heading", "away")))
    poses = empty_poses(stop - step + 1)
    trace_meander(home.walls, actor.space.mesh, behavior.rule, step, state[:3], poses)
    # The stored end of the walk; a walk without a step ended as the body was put elsewhere.
    if begin + 1 < len(keys["x"]) and stop > step:
        last = (poses.x[-1], poses.y[-1], poses.heading[-1])
        if last != tuple(keys[name][begin + 1] for name in ("x", "y", "heading")):
            raise ArtifactError(
                f"the random walk of {actor.name} from step {step} on can't be rebuilt: it was"
                " walked by other rules than those of its behavior 'meander', or by another version"
            )
    first = -(-step // stride)
    paste_poses(out, first, poses, slice(first * stride - step, stop - step, stride))


def _walker(run: "Run", plan: FloorPlan, entity: str, clock: Clock) -> tuple[Home, Actor, Meander]:
    """Return the home, the body and its behavior that repeats its random walk."""
    sections = run.manifest["scenario"]
    with restrict_stored():
        scenario = load_scenario({key: sections[key] for key in _BODIES if key in sections})
    bucket = "users" if entity in scenario.users else "robots"
    body = {**scenario.users, **scenario.robots}[entity]
    home = Home(plan)
    actor = Actor(entity, f"{bucket}.{entity}", body, home, clock, run.manifest["seed"])
    walks = [behavior for behavior in actor.behaviors if isinstance(behavior, Meander)]
    if not walks:
        raise ArtifactError(
            f"{entity} walked at random by a behavior that is not 'meander': it can't be rebuilt"
        )
    return home, actor, walks[0]
