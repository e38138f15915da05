"""Poses at any step of a stored run, rebuilt exactly from its key frames."""

from bisect import bisect_right
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.artifacts.arrow import values_of
from fleet2d.artifacts.table import KEY_KINDS, PLANNED, WALK
from fleet2d.bounds import one_line
from fleet2d.configuration.trust import stored_code
from fleet2d.configuration.units import whole_steps
from fleet2d.entities.body import Pose
from fleet2d.errors import ArtifactError
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import (
    F64,
    I16,
    I64,
    SUB,
    TURN,
    Bool,
    Breakpoints,
    Poses,
    empty_poses,
    in_radians,
    trace_meander,
    trace_track,
)
from fleet2d.runtime.clock import Clock

if TYPE_CHECKING:
    from fleet2d.entities.behavior import Actor
    from fleet2d.entities.meander import Meander
    from fleet2d.floorplan.home import Home
    from fleet2d.runs.run import Run

# Bodies depend on these sections of a scenario; components of others are not imported.
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
        plan: The floor plan that the run took place in.
        entity: The name of the body.
        every: Time between two poses, a multiple of the step.

    Raises:
        ArtifactError: The run stored no key frames or damaged ones, there is no such body, or
            `every` is not a multiple of the step.
    """
    reader = PathReader(run, plan, entity)
    return reader.read(0, reader.clock.steps, every)


class PathReader:
    """The path of one body of a stored run, read in parts so that memory stays bounded.

    Attributes:
        clock: The simulated time of the run.
    """

    def __init__(self, run: "Run", plan: FloorPlan, entity: str) -> None:
        """Read the key frames of a body.

        Raises:
            ArtifactError: The run stored no key frames or damaged ones, or there is no such body.
        """
        self.clock = run.clock
        self._run = run
        self._plan = plan
        self._entity = entity
        if "key_frames" not in run.tables:
            raise ArtifactError(
                "the run stored no key frames: run it with artifacts.key_frames=true"
            )
        with _damage():
            self._keys = _keys_of(run, plan, entity)
            edges = [*self._keys["step"].tolist(), self.clock.steps]
            segments = _segments(self._keys["kind"])
            self._segments = [(begin, end, edges[begin], edges[end]) for begin, end in segments]
        self._walker: tuple[Home, Actor, Meander] | None = None

    def read(self, first: int, end: int, every: timedelta) -> Trajectory:
        """Return the poses at the multiples of a time in the steps from `first` to before `end`.

        Args:
            first: The first step, at least 0.
            end: The step after the last one.
            every: Time between two poses, a multiple of the step.

        Raises:
            ArtifactError: The key frames are damaged, or `every` is not a multiple of the step.
        """
        if not isinstance(every, timedelta):
            raise ArtifactError(
                f"every: expected a timedelta like timedelta(seconds=10), got {every!r}"
            )
        clock = self.clock
        plan = self._plan
        stride = whole_steps(every, clock.step_us, "every", ArtifactError)
        end = min(end, clock.steps)
        before = -(-first // stride)  # the number of poses before the first one
        steps = np.arange(before * stride, end, stride, dtype=np.int64)
        out = empty_poses(len(steps))
        out.x[:] = -1  # a place outside of the plan marks what damaged key frames leave out
        with _damage():
            for key, last_key, begin, stop in self._segments:
                low = -(-begin // stride) - before
                high = -(-stop // stride) - before
                part = slice(max(low, 0), min(high, len(steps)))
                if part.start < part.stop:
                    x, y, heading, away = out
                    poses = Poses(x[part], y[part], heading[part], away[part])
                    self._trace(key, last_key, stop, steps[part], poses)
        rows, columns = plan.room_of_place.shape
        row = out.y // SUB
        column = out.x // SUB
        inside = (0 <= row) & (row < rows) & (0 <= column) & (column < columns)
        if not inside.all():
            raise ArtifactError(
                f"key_frames.parquet has poses of {self._entity} outside of the floor plan: it is"
                " damaged; `fleet2d verify` says which files have changed"
            )
        points = np.stack([out.x, out.y], axis=-1)
        xs, ys = plan.lattice.to_metres(points).T
        is_away = out.away.astype(bool)
        room = np.where(out.away, -1, plan.room_of_place[row, column])
        return Trajectory(steps, clock.times(steps), xs, ys, in_radians(out.heading), is_away, room)

    def _trace(self, begin: int, end: int, stop: int, steps: I64, out: Poses) -> None:
        """Fill in poses of the segment of some key frames, which ends before the step `stop`."""
        keys = self._keys
        step_us = self.clock.step_us
        if keys["kind"][begin] != WALK:
            part = Breakpoints(*(keys[name][begin:end] for name in Breakpoints._fields))
            apart = int(steps[1] - steps[0]) if len(steps) > 1 else 1
            trace_track(part, int(steps[0]) * step_us, apart * step_us, out)
            return
        if self._walker is None:
            self._walker = _walker(self._run, self._plan, self._entity, self.clock)
        home, actor, behavior = self._walker
        step = int(keys["step"][begin])
        state = Pose(*(int(keys[name][begin]) for name in Pose._fields))
        poses = empty_poses(stop - step + 1)
        trace_meander(home.barriers, actor.space.mesh, behavior.rule, step, state[:3], poses)
        # A walk without a step ended because the body was put elsewhere; others have a stored end.
        if begin + 1 < len(keys["x"]) and stop > step:
            last = (poses.x[-1], poses.y[-1], poses.heading[-1])
            stored = tuple(keys[name][begin + 1] for name in ("x", "y", "heading"))
            if last != stored:
                raise ArtifactError(
                    f"the random walk of {self._entity} from step {step} on can't be rebuilt: it"
                    " was walked by other rules than those of its behavior 'meander', or by"
                    " another version"
                )
        at = steps - step
        out.x[:] = poses.x[at]
        out.y[:] = poses.y[at]
        out.heading[:] = poses.heading[at]
        out.away[:] = poses.away[at]


@contextmanager
def _damage() -> Iterator[None]:
    """Raise an ArtifactError for errors that damaged key frames cause."""
    try:
        yield
    except (KeyError, ValueError, OverflowError, IndexError, MemoryError) as error:
        raise ArtifactError(
            f"key_frames.parquet can't be followed ({one_line(error, 100)}): it is damaged;"
            " `fleet2d verify` says which files have changed"
        ) from error


def _segments(kind: I64) -> Iterator[tuple[int, int]]:
    """Yield the first key frame of each walk and track, and the one after its last."""
    is_end = np.isin(kind, (WALK, PLANNED))
    ends = np.flatnonzero(is_end).tolist()
    begin = 0
    while begin < len(kind):
        if kind[begin] == WALK:
            end = begin + 1
        else:
            at = bisect_right(ends, begin)
            end = ends[at] if at < len(ends) else len(kind)
            if end < len(kind) and kind[end] == PLANNED:  # the body never reached it
                end += 1
        yield begin, end
        begin = end


def _keys_of(run: "Run", plan: FloorPlan, entity: str) -> dict[str, Any]:
    """Return the key frames of a body in lattice units, each column (n,)."""
    entities = run.manifest["entities"]
    bodies = [*entities["users"], *entities["robots"]]
    if entity not in bodies:
        raise ArtifactError(f"there is no {entity!r} in the run; there are: {', '.join(bodies)}")
    table = run.tables["key_frames"]
    own = values_of(table["entity"]) == entity
    names = ("step", "time", "x", "y", "heading", "away", "kind")
    column = {name: values_of(table[name])[own] for name in names}
    numbers = {name: number for number, name in enumerate(KEY_KINDS)}
    kind = np.array([numbers[name] for name in column["kind"].tolist()], np.int64)
    places = np.stack([column["x"], column["y"]], axis=-1)
    xy = plan.lattice.to_lattice(places)
    headings = np.rint(column["heading"] * (TURN / (2 * np.pi)))
    start_us = int(run.clock.stamp(0).astype(np.int64))
    return {
        "step": column["step"],
        "time": column["time"] - start_us,
        "kind": kind,
        "x": np.ascontiguousarray(xy[:, 0]),
        "y": np.ascontiguousarray(xy[:, 1]),
        "heading": headings.astype(np.int64) % TURN,
        "away": column["away"].astype(np.uint8),
    }


def _walker(
    run: "Run", plan: FloorPlan, entity: str, clock: Clock
) -> "tuple[Home, Actor, Meander]":
    """Return the home, the body, and the behavior that repeats the random walk."""
    sections = run.manifest["scenario"]
    from fleet2d.entities.behavior import Actor  # few paths have walks
    from fleet2d.entities.meander import Meander
    from fleet2d.floorplan.home import Home
    from fleet2d.scenario.load import load_scenario

    bodies = {key: sections[key] for key in _BODIES if key in sections}
    with stored_code(run.directory or "the run", bodies, trust=run.trust):
        scenario = load_scenario(bodies)
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
