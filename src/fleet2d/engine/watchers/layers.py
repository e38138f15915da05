"""The layers of a run: those of what robots have seen, and when each layer is stored."""

from collections.abc import Set
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.algorithm import Algorithm
from fleet2d.algorithms.evidence import Patches, patches_of, steps_of_bin, whole_rooms
from fleet2d.algorithms.log import Log
from fleet2d.artifacts.layers import layer_rows, layer_table
from fleet2d.configuration.components import Component
from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import whole_steps
from fleet2d.engine.basis import Basis
from fleet2d.engine.watchers.seen_area import SeenArea
from fleet2d.entities.entity import Robot
from fleet2d.errors import ComponentError
from fleet2d.floorplan.home.costmap import CostmapSettings, costs_of
from fleet2d.floorplan.home.home import Home
from fleet2d.floorplan.home.layers import COSTMAP, SEEN_LAYERS, Layer, LayerSettings, LayerType
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.metrics.metric import Metric
from fleet2d.scenario.model import Scenario

NEEDS = ("evidence", "exposure", *SEEN_LAYERS)


def lay_layers(home: Home, source: FloorPlanSource) -> None:
    """Add the layers of a scenario to a home, except those of what robots have seen."""
    layers = dict(source.layers)
    costs = layers.pop(COSTMAP, None)
    if source.costmap is not None or costs is not None:
        layer = home.layers.add_layer(
            COSTMAP, _with_storage(_COSTS, costs or LayerSettings(store=False))
        )
        footprints = [item.footprint for item in home.objects if item.blocks != "nothing"]
        layer.values = costs_of(home.plan, source.costmap or CostmapSettings(), footprints)
    for name, settings in layers.items():
        if name not in SEEN_LAYERS:
            home.layers.add_layer(name, settings)


class LayerBook:
    """The layers of a run: it records what robots have seen, and stores layers at their times.

    Attributes:
        areas: The area that each robot with a camera has seen; empty if no component needs it.
    """

    def __init__(self, basis: Basis) -> None:
        """Add the layers of what robots have seen to the home, if they are needed.

        Raises:
            ScenarioError: A period is not a multiple of the step.
            ComponentError: A component has an unknown need.
        """
        self._home, self._store, self._clock = basis.home, basis.store, basis.clock
        scenario = basis.scenario
        self._stored_at: dict[str, int] = {}
        self._robots, self._first_robot = len(scenario.robots), len(scenario.users)
        learners = {
            **{f"algorithms.{name}": learner for name, learner in scenario.algorithms.items()},
            **{f"metrics.{name}": learner for name, learner in scenario.metrics.items()},
        }
        needs = {need for path, learner in learners.items() for need in _needs_of(path, learner)}
        behaviors = [behavior for actor in basis.actors for behavior in actor.behaviors]
        needs |= {need for behavior in behaviors for need in behavior.needs}
        names = {*needs, *(name for name in scenario.floorplan.layers if name in SEEN_LAYERS)}
        self._exposes = "exposure" in needs
        self._bin_steps = steps_of_bin(self._clock.step_us) if "evidence" in needs else 0
        self._logged_bins = 0
        self._patches = _patches(basis.home, "patches" if self._bin_steps else "rooms")
        self.areas = self._open_areas(basis, names) if names else []
        self._add_seen_layers(scenario, needs)
        self.next_due(0)

    def expose(self, step: int, log: Log) -> None:
        """Add the parts of rooms that each robot has had in view before `step` to the log."""
        if self._bin_steps:
            log.bin_steps, log.patches = self._bin_steps, self._patches
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
            every = self._period(layer)
            if every and end % every == 0:
                self._put(layer, end - 1)

    def finish(self, end: int) -> None:
        """Store all layers with `store`, as they are after the step before `end`."""
        for layer in self._home.layers.values():
            if layer.store and end > 0 and self._stored_at.get(layer.name) != end - 1:
                self._put(layer, end - 1)

    def _open_areas(self, basis: Basis, names: Set[str]) -> list[SeenArea]:
        """Return the area that each robot with a camera has seen, before the first step."""
        every = self._multiple(basis.scenario.sight.seen_every, "sight.seen_every") or 1
        keeps_last = bool({"last_seen", "time_since_seen"} & names)
        return [
            SeenArea(
                actor,
                row,
                self._patches,
                basis.bodies,
                every=every,
                keeps_last=keeps_last,
                bin_steps=self._bin_steps,
            )
            for row, actor in enumerate(basis.actors)
            if isinstance(actor.entity, Robot) and actor.entity.eyes
        ]

    def _add_seen_layers(self, scenario: Scenario, needs: Set[str]) -> None:
        """Add the layers of what robots have seen to the home, if they are needed."""
        for name, cells in _SEEN.items():
            storage = scenario.floorplan.layers.get(name)
            if storage is None and name not in needs:
                continue
            settings = _with_storage(cells, storage or LayerSettings(store=False))
            for area in self.areas:
                self._home.layers.add_layer(
                    f"{name}.{area.robot.name}", settings, _Cells(area, name)
                )

    def _period(self, layer: Layer) -> int:
        """Return the steps between two times at which a layer is stored; 0 for never."""
        if not layer.store:
            return 0
        name = layer.name.partition(".")[0]
        return self._multiple(layer.every, f"floorplan.layers.{name}.every")

    def _multiple(self, duration: timedelta | None, key: str) -> int:
        """Return a duration in steps, 0 for none."""
        if duration is None:
            return 0
        return whole_steps(duration, self._clock.step_us, key)

    def _put(self, layer: Layer, step: int) -> None:
        spec = layer_table(layer)
        self._store.add_table(spec)
        columns = layer_rows(layer)
        steps = np.full(len(columns["row"]), step, np.int64)
        self._store.append(spec.name, step=steps, time=self._clock.times(steps), **columns)
        self._stored_at[layer.name] = step


def _patches(home: Home, cut_by: Literal["patches", "rooms"]) -> Patches:
    """Return the parts of rooms to distinguish, computed once for a home."""
    of = patches_of if cut_by == "patches" else whole_rooms
    return home.cached((cut_by,), lambda: of(home.plan))


@dataclass(frozen=True)
class _Cells:
    """The values of a layer of what a robot has seen, computed when they are read."""

    area: SeenArea
    name: str

    def __call__(self) -> NDArray[Any]:
        return getattr(self.area, self.name)()


def _with_storage(cells: LayerSettings, storage: LayerSettings) -> LayerSettings:
    """Return the settings of cells, with those of the storage of another layer."""
    return cells.model_copy(update={"store": storage.store, "every": storage.every})


def _cell_settings(
    dtype: LayerType, fill: float, description: str, unit: str = ""
) -> LayerSettings:
    return LayerSettings.model_construct(
        dtype=dtype, fill=fill, unit=unit, description=description, store=False, every=None
    )


_SEEN = {
    "explored": _cell_settings("bool", 0, "whether the robot has had the cell in view"),
    "first_seen": _cell_settings(
        "int64", -1, "first step with the cell in view of the robot, -1 for none"
    ),
    "last_seen": _cell_settings(
        "int64", -1, "last step with the cell in view of the robot, -1 for none"
    ),
    "time_since_seen": _cell_settings(
        "float64", np.nan, "since the robot had the cell in view", "s"
    ),
}
_COSTS = _cell_settings("int32", 0, "what a way costs besides its length, -1 where none leads", "%")


def _needs_of(path: str, learner: Component) -> Set[str]:
    """Return what an algorithm or a metric needs.

    Raises:
        ComponentError: A need is unknown.
    """
    assert isinstance(learner, Algorithm | Metric)
    for need in learner.needs:
        if need not in NEEDS:
            raise ComponentError(
                f"{path}: {type(learner).__name__} needs {need!r}{suggest(need, NEEDS)}"
            )
    return set(learner.needs)
