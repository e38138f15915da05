"""The gauge for each signal, and the gauge of cameras."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fleet2d.algorithms.algorithm import to_columns
from fleet2d.configuration.problems import suggest
from fleet2d.engine.cameras import Cameras
from fleet2d.engine.gauges.block import Block
from fleet2d.engine.gauges.gauges import (
    ActivityGauge,
    AwayGauge,
    BatteryGauge,
    DistanceGauge,
    DoorGauge,
    EventGauge,
    Gauge,
    PerceivedGauge,
    RoomGauge,
    SeenGauge,
    SensorGauge,
    SpeedGauge,
    SwitchGauge,
    ValueGauge,
    outline,
)
from fleet2d.engine.state import State
from fleet2d.errors import ScenarioError
from fleet2d.expectations import quantities, states
from fleet2d.expectations.signals import Measurement
from fleet2d.floorplan.geometry.lattice import UNITS_PER_CELL
from fleet2d.floorplan.home.home import Home, lattice_footprint
from fleet2d.kernels import I64
from fleet2d.kernels.sight import SightMemory

# The chance of a lens that notices all bodies in view.
CERTAIN = 2**53


class PerfectCameras(Cameras):
    """Cameras that look at every step, and notice all bodies in view at once."""

    def _set_up(self) -> SightMemory:
        memory = super()._set_up()
        lenses = self.lenses
        self.lenses = lenses._replace(
            chance=np.full_like(lenses.chance, CERTAIN),
            period=np.ones_like(lenses.period),
            latency=np.zeros_like(lenses.latency),
            errs=np.zeros_like(lenses.errs),
        )
        self.rule, self.sighting_errors = self.rule._replace(patience=1), None
        return memory


class InViewGauge(SwitchGauge):
    """Measures whether a body is in view of another's cameras, as if these made no errors."""

    def __init__(self, state: State, cameras: Cameras, body: str) -> None:
        super().__init__(False)
        actors, users = state.actors, state.bodies.users
        self._cameras = PerfectCameras(cameras.row, actors, users, cameras.method, cameras.radii)
        self._cameras.next_step = state.settled
        self._body = body

    def _changes(self, block: Block) -> list[tuple[int, float]]:
        events = self._cameras.take(block.bodies, block.end)
        self._cameras.collect()
        _, seen = self._cameras.event_names
        return [(e.step, float(e.event == seen)) for e in events if e.detail == self._body]


# The gauge for each signal


def gauge_of(signal: Measurement, state: State, step_us: int) -> Gauge:
    """Return a gauge that measures a signal from the present step on."""
    return _MAKERS[type(signal)](signal, state, step_us)


def row_of(state: State, name: str) -> int:
    """Return the row of a body in `state.actors` and in arrays of poses."""
    return next(row for row, actor in enumerate(state.actors) if actor.name == name)


def _distance(signal: quantities.DistanceSignal, state: State, _: int) -> Gauge:
    row, other = row_of(state, signal.body), signal.other
    names = [actor.name for actor in state.actors]
    if isinstance(other, str) and other in names:
        return DistanceGauge(row, names.index(other), None)
    return DistanceGauge(row, None, Shape(other))


class Shape:
    """The present outline of a room, an object or a point."""

    def __init__(self, place: str | tuple[float, float]) -> None:
        self._place = place
        self._outline: tuple[object, I64] | None = None

    def __call__(self, home: Home) -> I64:
        """Return its edges, int64 (n, 4) [lattice units]."""
        plan, place = home.plan, self._place
        if not isinstance(place, str):
            x, y = plan.lattice.to_lattice(place).tolist()
            return np.array([[x, y, x, y]], np.int64)
        rooms = [room.index for room in home.rooms if place in (room.name, room.type)]
        item = None if rooms else home.object(place)
        if self._outline is None or self._outline[0] is not item:
            if item is None:
                edges = outline(np.isin(plan.room_of_place, rooms), UNITS_PER_CELL)
            else:
                ring = np.array(lattice_footprint(plan, item).exterior.coords).round()
                edges = np.concatenate([ring[:-1], ring[1:]], axis=1).astype(np.int64)
            self._outline = item, edges
        return self._outline[1]


def _speed(signal: quantities.SpeedSignal | states.IsMoving, state: State, step_us: int) -> Gauge:
    row, step = row_of(state, signal.body), state.settled
    last_pose: tuple[int, ...] = ()
    if step > 0 and hasattr(state.actors[row], "motion"):
        # The present pose stands for the one before, which may be forgotten.
        pose = state.bodies.pose_at(row, step)
        last_pose = (pose.x, pose.y, pose.away)
    return SpeedGauge(row, last_pose, step_us)


def _seen_gauge(signal: states.IsSeen, state: State, _: int) -> Gauge:
    cameras = _cameras_of(state, signal.by)
    return SeenGauge(signal, signal.body in cameras.in_view)


def _cameras_of(state: State, name: str) -> Cameras:
    return next(c for c in [*state.user_cameras, *state.cameras] if c.owner.name == name)


def _perceived(signal: states.IsPerceived, state: State, _: int) -> Gauge:
    cameras = _cameras_of(state, signal.by)
    names = [other.name for other in cameras.others]
    return PerceivedGauge(cameras.index, names.index(signal.body))


def _value(
    signal: quantities.OutputSignal | quantities.MetricSignal, state: State, _: int
) -> Gauge:
    reader = OutputReader if isinstance(signal, quantities.OutputSignal) else MetricReader
    return ValueGauge(state.settled, reader(signal.path, state.home))


def _activity(signal: states.ActivitySignal, state: State, _: int) -> Gauge:
    now = state.recorder.activities.now(row_of(state, signal.user))
    return ActivityGauge(signal.user, now)


class OutputReader:
    """Reads a number from the output of an algorithm, by its path."""

    def __init__(self, path: str, home: Home) -> None:
        self._path = path
        self._rooms = [room.name for room in home.rooms]
        kinds = [room.type for room in home.rooms]
        self._names = {r.type: r.name for r in home.rooms if kinds.count(r.type) == 1}

    def __call__(self, output: Any) -> float:
        """Return the number.

        Raises:
            ScenarioError: There is no such number in the output, or there are several.
        """
        columns = to_columns(output, self._rooms, f"algorithms.{self._path.split('.')[0]}")
        keep = np.ones(len(next(iter(columns.values()))), np.bool_)
        words = {n: c for n, c in columns.items() if c.dtype.kind == "O"}
        number = next((n for n, c in columns.items() if c.dtype.kind in "fiub"), None)
        for part in self._path.split(".")[1:]:
            if part in columns and part not in words:
                number = part
                continue
            names = [part, self._names.get(part, part)]
            matches = [np.isin(column.astype(str), names) for column in words.values()]
            rows = np.any(matches, axis=0) if matches else np.zeros_like(keep)
            if not rows.any():
                known = [*columns, *dict.fromkeys(w for c in words.values() for w in c.tolist())]
                raise ScenarioError(
                    f'output("{self._path}"): there is no {part!r} in it{suggest(part, known)}'
                )
            keep &= rows
        if keep.sum() != 1 or number is None:
            how = (
                f"select one by: {', '.join(words)}" if words else "they have no names to select by"
            )
            raise ScenarioError(f'output("{self._path}") matches {keep.sum()} rows; {how}')
        return float(columns[number][keep][0])


class MetricReader:
    """Reads a number from the result of a metric, by its path; NaN while the result is empty."""

    def __init__(self, path: str, home: Home) -> None:
        self._path = path

    def __call__(self, result: Any) -> float:
        """Return the number.

        Raises:
            ScenarioError: The path leads to no number.
        """
        for part in self._path.split(".")[1:]:
            if not isinstance(result, Mapping) or part not in result:
                if isinstance(result, Mapping) and not result:
                    return float("nan")
                known = list(result) if isinstance(result, Mapping) else []
                raise ScenarioError(
                    f'metric("{self._path}"): there is no {part!r} in it{suggest(part, known)}'
                )
            result = result[part]
        if isinstance(result, bool | int | float):
            return float(result)
        if isinstance(result, Mapping) and not result:
            return float("nan")
        keys = ", ".join(result) if isinstance(result, Mapping) else repr(result)
        raise ScenarioError(f'metric("{self._path}") is not a number: extend it by one of {keys}')


_MAKERS: Mapping[type, Callable[[Any, State, int], Gauge]] = {
    states.ActivitySignal: _activity,
    states.IsAway: lambda signal, state, _: AwayGauge(row_of(state, signal.body)),
    quantities.BatterySignal: lambda signal, state, _: BatteryGauge(
        state.actors[row_of(state, signal.robot)]
    ),
    quantities.DistanceSignal: _distance,
    states.IsOpen: lambda signal, state, _: DoorGauge(state.changes.names.index(signal.name)),
    states.EventHappens: lambda signal, *_: EventGauge(signal),
    states.IsInView: lambda signal, state, _: InViewGauge(
        state, _cameras_of(state, signal.by), signal.body
    ),
    quantities.MetricSignal: _value,
    states.IsMoving: _speed,
    quantities.OutputSignal: _value,
    states.IsPerceived: _perceived,
    states.RoomSignal: lambda signal, state, _: RoomGauge(row_of(state, signal.body), state.home),
    states.IsSeen: _seen_gauge,
    states.IsOn: lambda signal, state, _: SensorGauge(signal.name, state.sensors.on[signal.name]),
    quantities.SpeedSignal: _speed,
}
