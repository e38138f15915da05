"""The seen area of a robot in a run: what its cameras have had in view, cell by cell."""

from collections.abc import Collection, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.patches import Patches
from fleet2d.engine.bodies import Bodies
from fleet2d.entities.actor import Actor
from fleet2d.entities.behavior import SightEvent
from fleet2d.entities.entity import Robot
from fleet2d.events import Event
from fleet2d.kernels.mesh import Mesh
from fleet2d.kernels.watch import NEVER, Record, Watched, no_glances, settle, watch
from fleet2d.sight.tables import TableContext, stack_lenses

# Poses kept: half as many as slots. Rounds through a large home take a few thousand.
SLOTS = 1 << 14
# Most steps that are looked from together.
LONGEST = 1 << 16

I64 = NDArray[np.int64]


class SeenArea:
    """What the cameras of one robot have had in view since the start.

    A cell is in view at a step if its centre is: not too near or far, within the angle, and no wall
    touches the line to it, from the exact pose that the camera has at that step.

    Attributes:
        robot: Whose cameras.
        row: Its row among the bodies.
        taken: The step before which it has looked.
    """

    def __init__(
        self,
        robot: Actor,
        row: int,
        patches: Patches,
        bodies: Bodies,
        *,
        every: int = 1,
        keeps_last: bool = True,
        bin_steps: int = 0,
    ) -> None:
        """Begin with nothing seen.

        Args:
            robot: Whose cameras.
            row: Its row among the bodies.
            patches: The parts of rooms that bins tell apart.
            bodies: Everybody in the run.
            every: It looks at the steps that this divides; each look stands for so many steps.
            keeps_last: Whether the last step at which each cell was in view can be asked for.
            bin_steps: Keep exposure by bins of so many steps, for `take_bins`; 0: don't.
        """
        assert isinstance(robot.entity, Robot)
        self.robot, self.row, self.every, self._patches = robot, row, every, patches
        self._bodies, self.taken = bodies, 0
        plan = robot.home.plan
        lattice, step_us = plan.lattice, robot.clock.step_us
        lenses = [c.lens(lattice.units_per_m, step_us) for c in robot.entity.eyes.values()]
        context = TableContext([], [], lattice, step_us, robot.path)
        self._names = tuple(robot.entity.eyes)
        self._lenses = stack_lenses(lenses, [False] * len(lenses), context)
        self._open_lenses = self._lenses
        grid, none = (lattice.rows, lattice.columns), (0, 0)
        bins = (LONGEST // bin_steps + 2 if bin_steps else 0, len(patches.room))
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
        self._face(robot.home.walls)

    def _face(self, walls: Mesh) -> None:
        """Take other walls: what is known of poses no longer holds."""
        self._watched = Watched(
            walls,
            self._lenses,
            self._patches.of_cell,
            self.robot.clock.step_us,
            self.every,
            max(self._bin_steps, 1),
        )
        self._glances.last[:] = self._glances.settled[:] = NEVER
        self._glances.used[0] = 0

    def darken(self, cameras: Collection[str]) -> None:
        """Let these cameras see nothing from the present step on, and all others what they see."""
        self._settle()
        dark = [name in cameras for name in self._names]
        near, far = self._open_lenses.near_squared, self._open_lenses.far_squared
        self._lenses = self._open_lenses._replace(near_squared=np.where(dark, far + 1, near))
        self._face(self.robot.home.walls)

    @property
    def waits(self) -> bool:
        """Nothing that is seen ends a span."""
        return False

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return `end`."""
        return end

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Look from the robot's poses in the steps from `taken` to `end` - 1."""
        walls = self.robot.home.walls
        if walls is not self._watched.walls:
            self._settle()
            self._face(walls)
        while self.taken < end:
            first, until = self.taken, min(end, self.taken + LONGEST)
            self.taken = until
            runs = bodies.runs(self.row, first, until)
            watch(self._watched, runs, 0, first, until, self._glances, self._record)
            if self._bin_steps:
                self._gather_bins(first)
        return ()

    def catch_up(self) -> None:
        """Look up to the present step."""
        self.take(self._bodies, self._bodies.step)

    def interruptions(self, events: Sequence[Event]) -> Iterable[tuple[int, SightEvent]]:
        """Return nothing: no plan waits for what is seen."""
        return ()

    def _gather_bins(self, begin: int) -> None:
        """Keep the bins of the steps from `begin` to the present one."""
        first = begin // self._bin_steps - self._first_bin
        end = (self.taken - 1) // self._bin_steps + 1 - self._first_bin
        under_way = self._bins[first:]  # the last bin, if steps of it were taken before
        grown = np.stack([self._record.binned[: end - first], self._record.most[: end - first]], 1)
        if len(under_way):
            grown[0, 0] += under_way[0, 0]
            grown[0, 1] = np.maximum(grown[0, 1], under_way[0, 1])
        self._bins = np.concatenate([self._bins[:first], grown]) if first else grown

    def _settle(self) -> None:
        if len(self._record.last):
            settle(self._watched, self._glances, self._record.last)

    @property
    def exposure(self) -> I64:
        """Cells of each room in view, summed over the steps so far: int64 (rooms,), a copy."""
        self.catch_up()
        return np.add.reduceat(self._record.exposure, self._patches.first)

    def take_bins(self, end: int) -> I64:
        """Hand over exposure by bins, of those that end by step `end` and weren't taken before.

        Returns:
            int64 (bins, 2, patches), cells of each patch in view, summed over the steps of each
            bin, and at most at one.
        """
        self.catch_up()
        count = end // self._bin_steps - self._first_bin
        taken, self._bins = self._bins[:count], self._bins[count:]
        self._first_bin += count
        return taken

    def explored(self) -> NDArray[np.bool_]:
        """Return which cells were ever in view: bool (rows, columns)."""
        self.catch_up()
        explored: NDArray[np.bool_] = self._record.first != NEVER
        return explored

    def first_seen(self) -> I64:
        """Return the first step at which each cell was in view: int64 (rows, columns), -1 never."""
        self.catch_up()
        return self._record.first.copy()

    def last_seen(self) -> I64:
        """Return the last step at which each cell was in view: int64 (rows, columns), -1 never."""
        self.catch_up()
        self._settle()
        return self._record.last.copy()

    def time_since_seen(self) -> NDArray[np.float64]:
        """Return how long ago each cell was in view [s]: float64 (rows, columns), NaN: never."""
        last = self.last_seen()
        steps = np.where(last == NEVER, np.nan, self.taken - 1 - last)
        elapsed: NDArray[np.float64] = steps * (self.robot.clock.step_us / 1e6)
        return elapsed
