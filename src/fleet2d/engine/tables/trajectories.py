"""Samples: the poses of all bodies at regular times, for the table of trajectories."""

import numpy as np

from fleet2d.artifacts.settings import ArtifactSettings
from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.configuration.units import whole_steps
from fleet2d.engine.basis import Basis
from fleet2d.engine.bodies import Bodies
from fleet2d.engine.tables.ordering import in_order
from fleet2d.engine.tables.shared_columns import HEADING, STEP, TIME, X, Y, away_column
from fleet2d.kernels import I64
from fleet2d.kernels.numbers import in_radians
from fleet2d.kernels.space import SUB
from fleet2d.runtime.clock import Clock


def trajectory_table(entity: Column, room: Column) -> TableSpec:
    """Return the table of trajectories; `Samples.store` fills its columns."""
    away = away_column("x, y and room are missing")
    return TableSpec("trajectories", (STEP, TIME, entity, X, Y, HEADING, room, away))


class Samples:
    """Collects the rows of the table of trajectories.

    Attributes:
        count: Number of rows that are not stored yet.
    """

    def __init__(self, basis: Basis) -> None:
        """Start without rows.

        Raises:
            ScenarioError: The interval between samples is not a multiple of the step.
        """
        self._store, self._clock, self._home = basis.store, basis.clock, basis.home
        self._every = _steps_between(basis.scenario.artifacts, basis.clock)
        self._blocks: list[I64] = []
        self.count = 0

    def take(self, bodies: Bodies, first: int, end: int) -> None:
        """Collect the samples of the steps from `first` to `end` - 1."""
        if not self._every or first >= end:
            return
        steps = np.arange(-(-first // self._every) * self._every, end, self._every)
        rows = np.empty((len(steps), len(bodies), 6), np.int64)
        rows[:, :, 0] = steps[:, None]
        rows[:, :, 1] = np.arange(len(bodies))
        if self._every == 1:
            block = bodies.block(first, end)
            rows[:, :, 2], rows[:, :, 3] = block.x.T, block.y.T
            rows[:, :, 4], rows[:, :, 5] = block.heading.T, block.away.T
        else:
            for i, step in enumerate(steps.tolist()):
                rows[i, :, 2:] = np.stack(bodies.poses(step), axis=-1)
        if rows.size:
            self._blocks.append(rows.reshape(-1, 6))
            self.count += len(steps) * len(bodies)

    def store(self) -> None:
        """Append all collected rows to the store."""
        if not self._blocks:
            return
        rows = in_order(self._blocks)
        self._blocks, self.count = [], 0
        step, entity, x, y, heading, away = rows.T
        plan = self._home.plan
        is_away = away.astype(bool)
        xy = plan.lattice.to_metres(rows[:, 2:4])
        xy[is_away] = np.nan
        room = plan.room_of_place[y // SUB, x // SUB].astype(np.int32)
        self._store.append(
            "trajectories",
            step=step,
            time=self._clock.times(step),
            entity=entity.astype(np.int32),
            x=xy[:, 0],
            y=xy[:, 1],
            heading=in_radians(heading),
            room=np.where(is_away, np.int32(-1), room),
            away=is_away,
        )


def _steps_between(settings: ArtifactSettings, clock: Clock) -> int:
    """Return the steps between two samples, 0 for no samples.

    Raises:
        ScenarioError: The interval is not a multiple of the step.
    """
    if settings.trajectories == "off":
        return 0
    if settings.trajectories == "every step":
        return 1
    return whole_steps(settings.trajectories, clock.step_us, "artifacts.trajectories")
