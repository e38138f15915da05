"""The layers of a run, and the times at which they are stored."""

from collections.abc import Set
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.algorithms.algorithm import Algorithm
from fleet2d.algorithms.history import Log
from fleet2d.artifacts.table import ALL_CELLS, DTYPES, KINDS, LAYER_PREFIX, Column, time_column
from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import whole_steps
from fleet2d.engine.basis import Basis
from fleet2d.errors import ComponentError
from fleet2d.floorplan.costmap import CostmapSettings, costs_of
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.layers import COSTMAP, SEEN_LAYERS, Layer, LayerSettings, LayerType
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.metrics.metric import Metric
from fleet2d.scenario.model import Scenario

if TYPE_CHECKING:
    from fleet2d.algorithms.evidence import Patches
    from fleet2d.engine.seen_area import SeenArea

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
    """The layers of a run, with the cells that robots have seen; stores each at its times.

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
        names = needs | (scenario.floorplan.layers.keys() & SEEN_LAYERS)
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
                log.expose_bins(bins_of_areas[0][:, np.newaxis])  # a view of one area needs no copy
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
        """Return the next step after `step` before which a layer is stored; None: none."""
        if not self._home.layers:  # every span asks, so this case is quick
            return None
        periods = [self._period(layer) for layer in self._home.layers.values()]
        dues = [every * (step // every + 1) for every in periods if every]
        return min(dues, default=None)

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

    def _open_areas(self, basis: Basis, names: Set[str]) -> "list[SeenArea]":
        """Return the area that each robot with a camera has seen, before the first step."""
        from fleet2d.algorithms.evidence import patches_of, steps_of_bin, whole_rooms
        from fleet2d.engine.seen_area import SeenArea

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
                self._home.layers.add_layer(layer, settings, getattr(area, name))

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
        if np.isnan(fill):
            differs = ~np.isnan(values)
        else:
            differs = values != fill.astype(values.dtype)
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
