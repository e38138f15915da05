"""What a robot has seen over time: when it saw each cell, and how much of each room for how long.

Most of the time a robot stands, and on its rounds it comes by the same poses again, so what a pose
shows is kept: how many cells of each room, and the last step at which the pose was taken. The cells
themselves are found again when somebody asks which were seen last.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d._core import NEVER, Mesh, settle, watch
from fleet2d.kernels.lens import Lenses

__all__ = ["NEVER", "Glances", "Record", "Watched", "no_glances", "settle", "watch"]

Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]


class Glances(NamedTuple):
    """The poses kept, in an open hash table; a power of two long, and at most half full.

    Attributes:
        pose: int64 (slots, 4), x, y [lattice], heading, and how far the cameras are panned.
        last: int64 (slots,), last step at which it was taken, -1 for an empty slot.
        settled: int64 (slots,), the last such step that `Record.last` knows of.
        cells: int32 (slots, patches), cells of each patch that it shows.
        used: int64 (1,), how many slots are used.
    """

    pose: Int64
    last: Int64
    settled: Int64
    cells: Int32
    used: Int64


class Record(NamedTuple):
    """What a robot has seen since the start.

    Attributes:
        first: int64 (rows, columns), first step at which each cell was in view, -1 for never.
        last: int64 (rows, columns), the last such step as far as `settle` was called; not kept
            where it is empty.
        exposure: int64 (patches,), cells of each patch in view, summed over the steps.
        counted: int64 (rows, columns), the last look that counted each cell, which several cameras
            may show; empty for one camera.
        binned: int64 (bins, patches), as `exposure`, by time: `watch` sets as many anew as its
            steps reach; empty where nobody asks for it.
        most: int64 (bins, patches), the most cells of each patch in view at a step, likewise.
    """

    first: Int64
    last: Int64
    exposure: Int64
    counted: Int64
    binned: Int64
    most: Int64


class Watched(NamedTuple):
    """What doesn't change while a robot watches.

    Attributes:
        walls: Free space.
        lenses: The robot's cameras.
        patch_of_cell: int16 (rows, columns), which of the parts that are told apart each cell
            belongs to, a room or part of one; -1 for none.
        step_us: Length of a step.
        every: It looks at the steps that this divides; each look stands for so many steps.
        bin_steps: Steps of a bin of `Record.binned`; bins begin at step 0.
    """

    walls: Mesh
    lenses: Lenses
    patch_of_cell: NDArray[np.int16]
    step_us: int
    every: int
    bin_steps: int


def no_glances(slots: int, patches: int) -> Glances:
    """Return an empty table of a power of two slots: 48 bytes and 4 per patch each."""
    return Glances(
        pose=np.zeros((slots, 4), np.int64),
        last=np.full(slots, NEVER, np.int64),
        settled=np.full(slots, NEVER, np.int64),
        cells=np.zeros((slots, patches), np.int32),
        used=np.zeros(1, np.int64),
    )
