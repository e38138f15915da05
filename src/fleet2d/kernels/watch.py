"""What a robot has seen over time: when it saw each cell, and how much of each room for how long.

A robot stands most of the time, and it returns to the same poses on its rounds, so the view of a
pose is cached: the number of cells of each room, and the last step at which the robot had the pose.
The cells themselves are computed again when the last steps are needed.
"""

from typing import NamedTuple

import numpy as np

from fleet2d._core import NEVER, Mesh, settle, watch
from fleet2d.kernels import I16, I32, I64
from fleet2d.kernels.lens import Lenses

__all__ = ["NEVER", "PoseCache", "SightRecord", "WatchSetup", "empty_pose_cache", "settle", "watch"]


class PoseCache(NamedTuple):
    """What cameras see at each pose: an open hash table of 2**n slots, at most half full.

    Attributes:
        pose: int64 (slots, 4), x, y [lattice units], heading, and pan position of the cameras.
        last: int64 (slots,), last step with the pose, -1 for an empty slot.
        settled: int64 (slots,), the last of these steps that `SightRecord.last` has counted.
        cells: int32 (slots, patches), number of cells of each patch in view.
        used: int64 (1,), number of used slots.
    """

    pose: I64
    last: I64
    settled: I64
    cells: I32
    used: I64


class SightRecord(NamedTuple):
    """What a robot has seen since the start.

    Attributes:
        first: int64 (rows, columns), first step at which each cell was in view, -1 for never.
        last: int64 (rows, columns), the last such step, up to the last call of `settle`; empty: not
            recorded.
        exposure: int64 (patches,), cells of each patch in view, summed over the steps.
        counted: int64 (rows, columns), the last look that counted each cell, which several cameras
            may show; empty for one camera.
        binned: int64 (bins, patches), as `exposure`, by time: `watch` overwrites the bins of its
            steps; empty: not recorded.
        most: int64 (bins, patches), largest number of cells of each patch in view at a step,
            likewise.
    """

    first: I64
    last: I64
    exposure: I64
    counted: I64
    binned: I64
    most: I64


class WatchSetup(NamedTuple):
    """The constants of a robot's watching.

    Attributes:
        walls: Mesh of the space that is free for sight; its borders are the walls.
        lenses: The robot's cameras.
        patch_of_cell: int16 (rows, columns), the patch of each cell, a room or a part of one; -1
            for none.
        step_us: Length of a step.
        every: It looks at multiples of this step; each look counts for this many steps.
        bin_steps: Steps of a bin of `SightRecord.binned`; bins begin at step 0.
    """

    walls: Mesh
    lenses: Lenses
    patch_of_cell: I16
    step_us: int
    every: int
    bin_steps: int


def empty_pose_cache(slots: int, patches: int) -> PoseCache:
    """Return an empty cache; `slots` is a power of two, each of 48 bytes and 4 per patch."""
    return PoseCache(
        pose=np.zeros((slots, 4), np.int64),
        last=np.full(slots, NEVER, np.int64),
        settled=np.full(slots, NEVER, np.int64),
        cells=np.zeros((slots, patches), np.int32),
        used=np.zeros(1, np.int64),
    )
