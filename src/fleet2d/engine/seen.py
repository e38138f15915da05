"""The seen area of a robot in a run: what its cameras have had in view, cell by cell."""

from copy import deepcopy
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.patches import Patches
from fleet2d.engine.buckets import PoseBlock
from fleet2d.entities.actor import Actor
from fleet2d.entities.entity import Robot
from fleet2d.kernels.mesh import Mesh
from fleet2d.kernels.motion import Poses, empty_poses, paste_poses
from fleet2d.kernels.seen import bench_for
from fleet2d.kernels.watch import NEVER, Record, Watched, no_glances, settle, watch
from fleet2d.sight.tables import Scene, stack_lenses

# Poses kept: half as many as slots. Rounds through a large home take a few thousand.
SLOTS = 1 << 14
# Steps that wait to be looked from together.
BUFFER = 1 << 16

I64 = NDArray[np.int64]


class SeenArea:
    """What the cameras of one robot have had in view since the start.

    A cell is in view at a step if its centre is: not too near or far, within the angle, and no wall
    touches the line to it, from the exact pose that the camera has at that step.

    Attributes:
        robot: Whose cameras.
        row: Its row in a PoseBlock.
        steps: Steps taken in so far.
    """

    def __init__(
        self,
        robot: Actor,
        row: int,
        patches: Patches,
        *,
        every: int = 1,
        keeps_last: bool = True,
        bin_steps: int = 0,
    ) -> None:
        """Begin with nothing seen.

        Args:
            robot: Whose cameras.
            row: Its row in a PoseBlock.
            patches: The parts of rooms that bins tell apart.
            every: It looks at the steps that this divides; each look stands for so many steps.
            keeps_last: Whether the last step at which each cell was in view can be asked for.
            bin_steps: Keep exposure by bins of so many steps, for `take_bins`; 0: don't.
        """
        assert isinstance(robot.entity, Robot)
        self.robot, self.row, self.every, self._patches = robot, row, every, patches
        self.steps = 0
        plan = robot.home.plan
        lattice, step_us = plan.lattice, robot.clock.step_us
        lenses = [c.lens(lattice.units_per_m, step_us) for c in robot.entity.eyes.values()]
        scene = Scene([], [], lattice, step_us, robot.path)
        self._lenses = stack_lenses(lenses, [False] * len(lenses), scene)
        grid, none = (lattice.rows, lattice.columns), (0, 0)
        bins = (BUFFER // bin_steps + 2 if bin_steps else 0, len(patches.room))
        self._record = Record(
            first=np.full(grid, NEVER, np.int64),
            last=np.full(grid if keeps_last else none, NEVER, np.int64),
            exposure=np.zeros(len(patches.room), np.int64),
            counted=np.full(grid if len(lenses) > 1 else none, NEVER, np.int64),
            binned=np.zeros(bins, np.int64),
            most=np.zeros(bins, np.int64),
        )
        self._bin_steps = bin_steps
        # Cells in view, summed and at most, from bin _first_bin on.
        self._bins = np.zeros((0, 2, len(patches.room)), np.int64)
        self._first_bin = 0
        self._glances = no_glances(SLOTS, len(patches.room))
        self._buffer, self._waiting = empty_poses(BUFFER), 0
        self._face(robot.home.walls)

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        """Return a twin that goes on by itself; walls and cameras don't change, and are shared."""
        twin = self.__class__.__new__(self.__class__)
        memo[id(self)] = twin
        memo[id(self._watched)] = self._watched
        twin.__dict__.update({key: deepcopy(value, memo) for key, value in self.__dict__.items()})
        return twin

    def _face(self, walls: Mesh) -> None:
        """Take other walls: what is known of poses no longer holds."""
        plan = self.robot.home.plan
        self._watched = Watched(
            walls,
            self._lenses,
            self._patches.of_cell,
            self.robot.clock.step_us,
            self.every,
            max(self._bin_steps, 1),
        )
        self._bench = bench_for(walls, plan.lattice.rows, plan.lattice.columns)
        self._glances.last[:] = self._glances.told[:] = NEVER
        self._glances.taken[0] = 0

    def span(self, block: PoseBlock, first: int, count: int) -> None:
        """Take in the steps from `first` to `first + count - 1`."""
        walls = self.robot.home.walls
        if walls is not self._watched.walls:
            self._settle()
            self._face(walls)
        taken = 0
        while taken < count:
            if self._waiting == BUFFER:
                self._catch_up()
            part = min(count - taken, BUFFER - self._waiting)
            row = block.row(self.row, count)
            paste_poses(self._buffer, self._waiting, row, slice(taken, taken + part))
            self._waiting += part
            self.steps = first + taken + part
            taken += part

    def _catch_up(self) -> None:
        """Look from the poses that wait: a call of the kernel costs as much as many of them."""
        if self._waiting:
            x, y, heading, away = self._buffer
            waiting = slice(self._waiting)
            poses = Poses(x[waiting], y[waiting], heading[waiting], away[waiting])
            begin = self.steps - self._waiting
            watch(self._watched, poses, begin, self._glances, self._bench, self._record)
            self._waiting = 0
            if self._bin_steps:
                self._gather_bins(begin)

    def _gather_bins(self, begin: int) -> None:
        """Keep the bins of the steps from `begin` to the present one."""
        first = begin // self._bin_steps - self._first_bin
        end = (self.steps - 1) // self._bin_steps + 1 - self._first_bin
        grown = np.zeros((end, *self._bins.shape[1:]), np.int64)
        grown[: len(self._bins)] = self._bins
        grown[first:, 0] += self._record.binned[: end - first]
        grown[first:, 1] = np.maximum(grown[first:, 1], self._record.most[: end - first])
        self._bins = grown

    def _settle(self) -> None:
        self._catch_up()
        if len(self._record.last):
            settle(self._watched, self._glances, self._bench, self._record.last)

    @property
    def exposure(self) -> I64:
        """Cells of each room in view, summed over the steps so far: int64 (rooms,), a copy."""
        self._catch_up()
        return np.add.reduceat(self._record.exposure, self._patches.first)

    def take_bins(self, end: int) -> I64:
        """Hand over exposure by bins, of those that end by step `end` and weren't taken before.

        Returns:
            int64 (bins, 2, patches), cells of each patch in view, summed over the steps of each
            bin, and at most at one.
        """
        self._catch_up()
        count = end // self._bin_steps - self._first_bin
        taken, self._bins = self._bins[:count], self._bins[count:]
        self._first_bin += count
        return taken

    def explored(self) -> NDArray[np.bool_]:
        """Return which cells were ever in view: bool (rows, columns)."""
        self._catch_up()
        explored: NDArray[np.bool_] = self._record.first != NEVER
        return explored

    def first_seen(self) -> I64:
        """Return the first step at which each cell was in view: int64 (rows, columns), -1 never."""
        self._catch_up()
        return self._record.first.copy()

    def last_seen(self) -> I64:
        """Return the last step at which each cell was in view: int64 (rows, columns), -1 never."""
        self._settle()
        return self._record.last.copy()

    def time_since_seen(self) -> NDArray[np.float64]:
        """Return how long ago each cell was in view [s]: float64 (rows, columns), NaN: never."""
        last = self.last_seen()
        steps = np.where(last == NEVER, np.nan, self.steps - 1 - last)
        elapsed: NDArray[np.float64] = steps * (self.robot.clock.step_us / 1e6)
        return elapsed
