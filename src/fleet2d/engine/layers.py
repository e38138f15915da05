"""The layers of a run: those that it keeps itself, and when each is stored."""

from collections.abc import Sequence, Set
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.algorithm import Algorithm
from fleet2d.algorithms.evidence import steps_of_bin
from fleet2d.algorithms.log import Log
from fleet2d.algorithms.patches import Patches, patches_of, whole_rooms
from fleet2d.artifacts.layers import layer_rows, layer_table
from fleet2d.artifacts.store import RunStore
from fleet2d.clock import Clock
from fleet2d.component import Component
from fleet2d.engine.bodies import Bodies
from fleet2d.engine.seen import SeenArea
from fleet2d.entities.actor import Actor
from fleet2d.entities.entity import Robot
from fleet2d.errors import ComponentError
from fleet2d.floorplan.home.costmap import CostmapSettings, costs_of
from fleet2d.floorplan.home.home import Home
from fleet2d.floorplan.home.layers import COSTMAP, SEEN_LAYERS, Layer, LayerSettings, LayerType
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.metrics.metric import Metric
from fleet2d.problems import did_you_mean
from fleet2d.scenario.model import Scenario
from fleet2d.units import whole_steps

NEEDS = ("evidence", "exposure", *SEEN_LAYERS)


def lay_layers(home: Home, source: FloorPlanSource) -> None:
    """Add the layers to a home that a scenario asks for, but those of what robots see."""
    layers = dict(source.layers)
    costs = layers.pop(COSTMAP, None)
    if source.costmap is not None or costs is not None:
        layer = home.layers.add_layer(COSTMAP, _kept(_COSTS, costs or LayerSettings(store=False)))
        solid = [thing.footprint for thing in home.objects if thing.blocks != "nothing"]
        layer.values = costs_of(home.plan, source.costmap or CostmapSettings(), solid)
    for name, settings in layers.items():
        if name not in SEEN_LAYERS:
            home.layers.add_layer(name, settings)


class LayerBook:
    """The layers of a run: it keeps what robots have seen, and stores all layers when they are due.

    Attributes:
        areas: What each robot with a camera has seen; empty if nobody wants to know.
    """

    def __init__(
        self,
        scenario: Scenario,
        home: Home,
        actors: Sequence[Actor],
        bodies: Bodies,
        store: RunStore,
        clock: Clock,
    ) -> None:
        """Add the layers that the scenario asks for to the home.

        Args:
            scenario: What is simulated.
            home: Gets the layers.
            actors: Everybody, in the order of their rows.
            bodies: How they move.
            store: Gets the tables.
            clock: The steps of the run.

        Raises:
            ScenarioError: A period is no multiple of the step.
            ComponentError: A component needs something that there isn't.
        """
        self._home, self._store, self._clock = home, store, clock
        self._stored_at: dict[str, int] = {}
        self._robots, self._first_robot = len(scenario.robots), len(scenario.users)
        learners = {
            **{f"algorithms.{name}": learner for name, learner in scenario.algorithms.items()},
            **{f"metrics.{name}": learner for name, learner in scenario.metrics.items()},
        }
        needed = {need for path, learner in learners.items() for need in _needs_of(path, learner)}
        behaviors = [behavior for actor in actors for behavior in actor.behaviors]
        needed |= {need for behavior in behaviors for need in behavior.needs}
        wanted = {*needed, *(name for name in scenario.floorplan.layers if name in SEEN_LAYERS)}
        self._exposes = "exposure" in needed
        self._bin_steps = steps_of_bin(clock.step_us) if "evidence" in needed else 0
        self._taken_bins = 0
        self._patches = _patches(home, "patches" if self._bin_steps else "rooms")
        self.areas = self._open_areas(scenario, actors, bodies, wanted) if wanted else []
        self._lay_seen(scenario, needed)
        self.next_due(0)

    def expose(self, step: int, log: Log) -> None:
        """Add to the log how much of each room each robot has had in view before `step`."""
        if self._bin_steps:
            log.bin_steps, log.patches = self._bin_steps, self._patches
            taken = [area.take_bins(step) for area in self.areas]
            count = step // self._bin_steps - self._taken_bins
            self._taken_bins += count
            bins = np.zeros((count, self._robots, 2, len(self._patches.room)), np.int64)
            for area, rows in zip(self.areas, taken, strict=True):
                bins[:, area.row - self._first_robot] = rows
            log.expose_bins(bins)
        if self._exposes:
            exposure = np.zeros((self._robots, len(self._home.rooms)), np.int64)
            for area in self.areas:
                exposure[area.row - self._first_robot] = area.exposure
            log.expose(step, exposure)

    def next_due(self, step: int) -> int | None:
        """Return the next step after `step` before which a layer is stored; None for none."""
        if not self._home.layers:  # asked for at every span
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
        """Store all layers that are to be stored, as they are after the step before `end`."""
        for layer in self._home.layers.values():
            if layer.store and end > 0 and self._stored_at.get(layer.name) != end - 1:
                self._put(layer, end - 1)

    def _open_areas(
        self, scenario: Scenario, actors: Sequence[Actor], bodies: Bodies, wanted: Set[str]
    ) -> list[SeenArea]:
        """Return what each robot with a camera has seen, before the first step."""
        every = self._multiple(scenario.sight.seen_every, "sight.seen_every") or 1
        keeps_last = bool({"last_seen", "time_since_seen"} & wanted)
        return [
            SeenArea(
                actor,
                row,
                self._patches,
                bodies,
                every=every,
                keeps_last=keeps_last,
                bin_steps=self._bin_steps,
            )
            for row, actor in enumerate(actors)
            if isinstance(actor.entity, Robot) and actor.entity.eyes
        ]

    def _lay_seen(self, scenario: Scenario, needed: Set[str]) -> None:
        """Add the layers of what robots have seen that are asked for to the home."""
        for name, cells in _SEEN.items():
            configured = scenario.floorplan.layers.get(name)
            if configured is None and name not in needed:
                continue
            settings = _kept(cells, configured or LayerSettings(store=False))
            for area in self.areas:
                self._home.layers.add_layer(
                    f"{name}.{area.robot.name}", settings, _Cells(area, name)
                )

    def _period(self, layer: Layer) -> int:
        """Return how many steps lie between two times that a layer is stored; 0 for none."""
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
    """Return the parts of rooms that are told apart, the same for all runs in the home."""
    of = patches_of if cut_by == "patches" else whole_rooms
    return home.cached((cut_by,), lambda: of(home.plan))


@dataclass(frozen=True)
class _Cells:
    """The values of a layer of what a robot has seen, worked out when they are asked for."""

    area: SeenArea
    name: str

    def __call__(self) -> NDArray[Any]:
        values: NDArray[Any] = getattr(self.area, self.name)()
        return values


def _kept(cells: LayerSettings, configured: LayerSettings) -> LayerSettings:
    """Return what the cells of a layer of the run's own hold, stored as the scenario says."""
    return cells.model_copy(update={"store": configured.store, "every": configured.every})


def _seen(dtype: LayerType, fill: float, description: str, unit: str = "") -> LayerSettings:
    return LayerSettings.model_construct(
        dtype=dtype, fill=fill, unit=unit, description=description, store=False, every=None
    )


_SEEN = {
    "explored": _seen("bool", 0, "whether the robot has had the cell in view"),
    "first_seen": _seen("int64", -1, "first step with the cell in view of the robot, -1 for none"),
    "last_seen": _seen("int64", -1, "last step with the cell in view of the robot, -1 for none"),
    "time_since_seen": _seen("float64", np.nan, "since the robot had the cell in view", "s"),
}
_COSTS = _seen("int32", 0, "what a way costs besides its length, -1 where none leads", "%")


def _needs_of(path: str, learner: Component) -> Set[str]:
    """Return what an algorithm or a metric needs.

    Raises:
        ComponentError: There is no such thing.
    """
    assert isinstance(learner, Algorithm | Metric)
    for need in learner.needs:
        if need not in NEEDS:
            raise ComponentError(
                f"{path}: {type(learner).__name__} needs {need!r}{did_you_mean(need, NEEDS)} There"
                f" are: {', '.join(NEEDS)}"
            )
    return set(learner.needs)
