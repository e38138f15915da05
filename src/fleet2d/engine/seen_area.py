"""The cells that the cameras of a robot have had in view."""

from collections.abc import Collection, Sequence, Set
from typing import TYPE_CHECKING

import numpy as np

from fleet2d.engine.basis import Watcher
from fleet2d.entities.body import Bodies
from fleet2d.entities.decisions import DecidingActor
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
from fleet2d.runtime.events import Event
from fleet2d.sight.camera import TableContext, stack_lenses

if TYPE_CHECKING:
    from fleet2d.algorithms.evidence import Patches

# The cache of poses has this many slots for half as many poses. A round through a large home has a
# few thousand poses, a month of visits to people ten thousand.
SLOTS = 1 << 15
# Most steps in one call of the kernel.
MAX_BATCH_STEPS = 1 << 16


class SeenArea(Watcher):
    """The cells that the cameras of one robot have had in view since the start.

    A cell is in view at a step if its centre is: not too near or far, within the angle, and no wall
    touches the line to it, from the exact pose of the camera at that step.

    Attributes:
        robot: The robot.
        row: The robot's row among the bodies.
        next_step: The first step that is not included.
    """

    hears_plans = False

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
        self.robot = robot
        self.row = robot.row
        self.every = every
        self._patches = patches
        self._bodies = bodies
        self._bin_steps = bin_steps
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
        # The sum and the maximum of cells in view, from bin _first_bin on.
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
        self._cache.number[:] = NEVER
        self._cache.used[0] = 0

    def darken(self, cameras: Collection[str]) -> None:
        """Let some cameras see nothing from the present step on, and all others see normally."""
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
        """Forget which cells were seen, and when; the counts of the evidence stay."""
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
        open_bins = self._bins[first:]  # the last bin may have earlier steps
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
