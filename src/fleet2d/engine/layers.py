"""The layers of a run: the cells that robots have seen, and the times of storing layers."""

from collections.abc import Collection, Sequence, Set
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.algorithm import Algorithm
from fleet2d.algorithms.history import Log
from fleet2d.artifacts.table import DTYPES, KINDS, Column, time_column
from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import whole_steps
from fleet2d.engine.basis import Basis, Watcher
from fleet2d.entities.body import Bodies
from fleet2d.entities.decisions import DecidingActor
from fleet2d.errors import ComponentError
from fleet2d.floorplan.costmap import CostmapSettings, costs_of
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.layers import COSTMAP, SEEN_LAYERS, Layer, LayerSettings, LayerType
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.kernels import (
    F64,
    I64,
    NEVER,
    Bool,
    CoverageRecord,
    CoverageSetup,
    Mesh,
    empty_pose_cache,
    record_coverage,
    settle_coverage,
)
from fleet2d.metrics.metric import Metric
from fleet2d.runs.run import ALL_CELLS, LAYER_PREFIX
from fleet2d.runtime.events import Event
from fleet2d.scenario.model import Scenario
from fleet2d.sight.camera import TableContext, stack_lenses

if TYPE_CHECKING:
    from fleet2d.algorithms.evidence import Patches

# Slots of the cache of poses, which holds half as many. A round through a large home has a few
# thousand poses, a month of going to people ten thousand.
SLOTS = 1 << 15
# Most steps in one call of the kernel.
MAX_BATCH_STEPS = 1 << 16


class SeenArea(Watcher):
    """The cells that the cameras of one robot have had in view since the start.

    A cell is in view at a step if its centre is: not too near or far, within the angle, and no wall
    touches the line to it, from the exact pose of the camera at that step.

    Attributes:
        robot: The robot.
        row: Its row among the bodies.
        next_step: The first step that is not included.
    """

    def __init__(
        self,
        robot: DecidingActor,
        patches: "Patches",
        bodies: Bodies,
        layers: Set[str],
        every: int,
        bin_steps: int,
    ) -> None:
        """Start with no cell seen.

        Args:
            robot: The robot.
            patches: The parts of rooms that bins distinguish.
            bodies: All bodies of the run.
            layers: The names of the layers that are needed.
            every: Number of steps between two looks; each look counts for this many steps.
            bin_steps: Steps in a bin of exposure, for `take_bins`; 0: no bins.
        """
        self.robot, self.row, self.every, self._patches = robot, robot.row, every, patches
        self._bodies, self._bin_steps = bodies, bin_steps
        plan = robot.home.plan
        lattice = plan.lattice
        step_us = robot.clock.step_us
        lenses = [c.lens(lattice.units_per_m, step_us) for c in robot.entity.eyes.values()]
        context = TableContext([], [], lattice, step_us, robot.path)
        self._names = tuple(robot.entity.eyes)
        self._lenses = stack_lenses(lenses, [False] * len(lenses), context)
        self._open_lenses = self._lenses
        grid = (lattice.rows, lattice.columns)
        none = (0, 0)
        keeps_first = not layers.isdisjoint({"explored", "first_seen"})
        keeps_last = not layers.isdisjoint({"last_seen", "time_since_seen"})
        self._record = CoverageRecord(
            first=np.full(grid if keeps_first else none, NEVER, np.int64),
            last=np.full(grid if keeps_last else none, NEVER, np.int64),
            exposure=np.zeros(len(patches.room), np.int64),
            counted=np.full(grid if len(lenses) > 1 else none, NEVER, np.int64),
            binned=np.zeros(none, np.int64),
            peak=np.zeros(none, np.int64),
        )
        # Cells in view, summed and at most, from bin _first_bin on.
        self._bins = np.zeros((0, 2, len(patches.room)), np.int64)
        self._first_bin = 0
        self._cache = empty_pose_cache(SLOTS, len(patches.room))
        self._is_dark = [False] * len(self._names)
        self._set_walls(robot.home.walls)

    def _set_walls(self, walls: Mesh) -> None:
        """Use other walls, and clear the cache of poses."""
        step_us = self.robot.clock.step_us
        of_cell = self._patches.of_cell
        bin_steps = max(self._bin_steps, 1)
        self._setup = CoverageSetup(walls, self._lenses, of_cell, step_us, self.every, bin_steps)
        self._cache.last[:] = self._cache.settled[:] = NEVER
        self._cache.used[0] = 0

    def darken(self, cameras: Collection[str]) -> None:
        """Let these cameras see nothing from the present step on, and all others see normally."""
        is_dark = [name in cameras for name in self._names]
        if is_dark == self._is_dark:
            return
        self._settle()
        self._is_dark = is_dark
        near = self._open_lenses.near_squared
        far = self._open_lenses.far_squared
        self._lenses = self._open_lenses._replace(near_squared=np.where(is_dark, far + 1, near))
        self._set_walls(self.robot.home.walls)

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Look from the robot's poses in the steps from `next_step` to `end` - 1."""
        walls = self.robot.home.walls
        if walls is not self._setup.walls:
            self._settle()
            self._set_walls(walls)
        while self.next_step < end:
            first = self.next_step
            until = min(end, first + MAX_BATCH_STEPS)
            self.next_step = until
            runs = bodies.runs(self.row, first, until)
            record = self._record
            bins = None
            if self._bin_steps:
                count = (until - 1) // self._bin_steps - first // self._bin_steps + 1
                bins = np.empty((count, *self._bins.shape[1:]), np.int64)
                record = record._replace(binned=bins[:, 0], peak=bins[:, 1])
            record_coverage(self._setup, runs, 0, first, until, self._cache, record)
            if bins is not None:
                self._collect_bins(first, bins)
        return ()

    def forget(self) -> None:
        """Forget which cells were seen, and when; what the evidence counts stays."""
        self.catch_up()
        self._settle()
        self._record.first[:] = NEVER
        self._record.last[:] = NEVER
        self._set_walls(self.robot.home.walls)

    def catch_up(self) -> None:
        """Look up to the present step."""
        self.take(self._bodies, self._bodies.step)

    def _collect_bins(self, begin: int, bins: I64) -> None:
        """Collect the bins of the steps from `begin` to the present one."""
        first = begin // self._bin_steps - self._first_bin
        open_bins = self._bins[first:]  # the last bin, if it has earlier steps
        if len(open_bins):
            bins[0, 0] += open_bins[0, 0]
            bins[0, 1] = np.maximum(bins[0, 1], open_bins[0, 1])
        self._bins = np.concatenate([self._bins[:first], bins]) if first else bins

    def _settle(self) -> None:
        if len(self._record.last):
            settle_coverage(self._setup, self._cache, self._record.last)

    @property
    def exposure(self) -> I64:
        """Cells of each room in view, summed over the steps so far: int64 (rooms,), a copy."""
        self.catch_up()
        return np.add.reduceat(self._record.exposure, self._patches.first)

    def take_bins(self, end: int) -> I64:
        """Return and remove the exposure of the bins that end by step `end`.

        Returns:
            int64 (bins, 2, patches): cells of each patch in view, the sum over the steps of each
            bin, and the maximum at one step.
        """
        self.catch_up()
        count = end // self._bin_steps - self._first_bin
        bins = self._bins[:count]
        self._bins = self._bins[count:]
        self._first_bin += count
        return bins

    def explored(self) -> Bool:
        """Return which cells were ever in view, bool (rows, columns)."""
        self.catch_up()
        return self._record.first != NEVER

    def first_seen(self) -> I64:
        """Return the first step with each cell in view, int64 (rows, columns); -1: never."""
        self.catch_up()
        return self._record.first.copy()

    def last_seen(self) -> I64:
        """Return the last step with each cell in view, int64 (rows, columns); -1: never."""
        self.catch_up()
        self._settle()
        return self._record.last.copy()

    def time_since_seen(self) -> F64:
        """Return the time since each cell was in view [s], float64 (rows, columns), NaN: never."""
        last = self.last_seen()
        steps = np.where(last == NEVER, np.nan, self.next_step - 1 - last)
        return steps * (self.robot.clock.step_us / 1e6)


NEEDS = ("evidence", "exposure", *SEEN_LAYERS)


def add_layers(home: Home, source: FloorPlanSource) -> None:
    """Add the layers of a scenario to a home, except those of seen cells."""
    layers = dict(source.layers)
    costs = layers.pop(COSTMAP, None)
    if source.costmap is not None or costs is not None:
        settings = _with_storage(_COSTS, costs or LayerSettings(store=False))
        layer = home.layers.add_layer(COSTMAP, settings)
        footprints = [item.footprint for item in home.objects if item.blocks != "nothing"]
        layer.values = costs_of(home.plan, source.costmap or CostmapSettings(), footprints)
    for name, settings in layers.items():
        if name not in SEEN_LAYERS:
            home.layers.add_layer(name, settings)


class LayerBook:
    """The layers of a run: it records the cells that robots see, and stores layers at their times.

    Attributes:
        areas: The area that each robot with a camera has seen; empty if no component needs it.
    """

    def __init__(self, basis: Basis) -> None:
        """Add the layers of what robots have seen to the home, if they are needed.

        Raises:
            ScenarioError: A period is not a multiple of the step.
            ComponentError: A component has an unknown need.
        """
        self._home = basis.home
        self._store = basis.store
        self._clock = basis.clock
        scenario = basis.scenario
        self._stored_at: dict[str, int] = {}
        self._robots = len(scenario.robots)
        self._first_robot = len(scenario.users)
        learners: dict[str, Algorithm | Metric] = {
            **{f"algorithms.{name}": learner for name, learner in scenario.algorithms.items()},
            **{f"metrics.{name}": learner for name, learner in scenario.metrics.items()},
        }
        for path, learner in learners.items():
            if unknown := [need for need in learner.needs if need not in NEEDS]:
                hint = suggest(unknown[0], NEEDS)
                raise ComponentError(f"{path}: {type(learner).__name__} needs {unknown[0]!r}{hint}")
        needs = {need for learner in learners.values() for need in learner.needs}
        behaviors = [behavior for actor in basis.actors for behavior in actor.behaviors]
        needs |= {need for behavior in behaviors for need in behavior.needs}
        names = {*needs, *(name for name in scenario.floorplan.layers if name in SEEN_LAYERS)}
        self._exposes = "exposure" in needs
        self._bin_steps = 0
        self._logged_bins = 0
        self._patches: Patches | None = None
        self.areas = self._open_areas(basis, names) if names else []
        self._add_seen_layers(scenario, needs)
        self.next_due(0)

    def expose(self, step: int, log: Log) -> None:
        """Add the parts of rooms that each robot has had in view before `step` to the log."""
        if self._patches is not None and self._bin_steps:
            log.bin_steps = self._bin_steps
            log.patches = self._patches
            bins_of_areas = [area.take_bins(step) for area in self.areas]
            count = step // self._bin_steps - self._logged_bins
            self._logged_bins += count
            if len(bins_of_areas) == self._robots == 1:
                log.expose_bins(bins_of_areas[0][:, np.newaxis])  # no copy
            else:
                bins = np.zeros((count, self._robots, 2, len(self._patches.room)), np.int64)
                for area, rows in zip(self.areas, bins_of_areas, strict=True):
                    bins[:, area.row - self._first_robot] = rows
                log.expose_bins(bins)
        if self._exposes:
            exposure = np.zeros((self._robots, len(self._home.rooms)), np.int64)
            for area in self.areas:
                exposure[area.row - self._first_robot] = area.exposure
            log.expose(step, exposure)

    def next_due(self, step: int) -> int | None:
        """Return the next step after `step` before which a layer is stored; None for none."""
        if not self._home.layers:  # a quick answer, as every span needs it
            return None
        periods = [self._period(layer) for layer in self._home.layers.values()]
        return min((every * (step // every + 1) for every in periods if every), default=None)

    def keep(self, end: int) -> None:
        """Store the layers that are due after the step before `end`."""
        for layer in self._home.layers.values():
            if (every := self._period(layer)) and end % every == 0:
                self._put(layer, end - 1)

    def finish(self, end: int) -> None:
        """Store all layers with `store`, as they are after the step before `end`."""
        for layer in self._home.layers.values():
            if layer.store and end > 0 and self._stored_at.get(layer.name) != end - 1:
                self._put(layer, end - 1)

    def _open_areas(self, basis: Basis, names: Set[str]) -> list[SeenArea]:
        """Return the area that each robot with a camera has seen, before the first step."""
        from fleet2d.algorithms.evidence import patches_of, steps_of_bin, whole_rooms

        if "evidence" in names:
            self._bin_steps = steps_of_bin(self._clock.step_us)
        cut, key = (patches_of, "patches") if self._bin_steps else (whole_rooms, "rooms")
        self._patches = basis.home.cached((key,), lambda: cut(basis.home.plan))
        every = basis.scenario.sight.seen_every
        step_us = self._clock.step_us
        steps = 1 if every is None else whole_steps(every, step_us, "sight.seen_every")
        shared = self._patches, basis.bodies, names, steps, self._bin_steps
        return [SeenArea(robot, *shared) for robot in basis.robots if robot.entity.eyes]

    def _add_seen_layers(self, scenario: Scenario, needs: Set[str]) -> None:
        """Add the layers of what robots have seen to the home, if they are needed."""
        for name, cells in _SEEN.items():
            storage = scenario.floorplan.layers.get(name)
            if storage is None and name not in needs:
                continue
            settings = _with_storage(cells, storage or LayerSettings(store=False))
            for area in self.areas:
                layer = f"{name}.{area.robot.name}"
                self._home.layers.add_layer(layer, settings, _Cells(area, name))

    def _period(self, layer: Layer) -> int:
        """Return the steps between two times at which a layer is stored; 0 for never."""
        if not layer.store or layer.every is None:
            return 0
        key = f"floorplan.layers.{layer.name.partition('.')[0]}.every"
        return whole_steps(layer.every, self._clock.step_us, key)

    def _put(self, layer: Layer, step: int) -> None:
        """Store a layer after a step: its fill value, and the cells with another one."""
        values = layer.values
        fill = np.array(layer.fill)
        differs = ~np.isnan(values) if np.isnan(fill) else values != fill.astype(values.dtype)
        row, column = np.nonzero(differs)
        kind = KINDS[layer.dtype.kind]
        dtype = DTYPES[kind]
        value = np.concatenate([[fill.astype(dtype)], values[differs].astype(dtype)])
        named = Column("row", "int32", description="of the cell; -1: all cells not named")
        columns = {
            Column("step", "step", description="the layer as it was after this step"): step,
            time_column(self._clock.zone): self._clock.stamp(step),
            named: np.concatenate([[ALL_CELLS], row]),
            Column("column", "int32"): np.concatenate([[ALL_CELLS], column]),
            Column("value", kind, layer.unit, kind == "float64", (), layer.description): value,
        }
        self._store.add_rows(f"{LAYER_PREFIX}{layer.name}", columns, layer.description)
        self._stored_at[layer.name] = step


@dataclass(frozen=True)
class _Cells:
    """The values of a layer of seen cells, computed when they are read."""

    area: SeenArea
    name: str

    def __call__(self) -> NDArray[Any]:
        return getattr(self.area, self.name)()


def _with_storage(cells: LayerSettings, storage: LayerSettings) -> LayerSettings:
    """Return the settings of cells, with those of the storage of another layer."""
    return cells.model_copy(update={"store": storage.store, "every": storage.every})


def _cells(dtype: LayerType, fill: float, description: str, unit: str = "") -> LayerSettings:
    texts: dict[str, Any] = {"unit": unit, "description": description}
    return LayerSettings.model_construct(dtype=dtype, fill=fill, store=False, every=None, **texts)


_SEEN = {
    "explored": _cells("bool", 0, "whether the robot has had the cell in view"),
    "first_seen": _cells("int64", -1, "first step with the cell in view of the robot, -1 for none"),
    "last_seen": _cells("int64", -1, "last step with the cell in view of the robot, -1 for none"),
    "time_since_seen": _cells("float64", np.nan, "since the robot had the cell in view", "s"),
}
_COSTS = _cells("int32", 0, "what a way costs besides its length, -1 where none leads", "%")
