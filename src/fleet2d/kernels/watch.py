"""What a robot has seen over time: when it saw each cell, and how much of each room for how long.

Most of the time a robot stands, and on its rounds it comes by the same poses again, so what a pose
shows is kept: how many cells of each room, and the last step at which the pose was taken. The cells
themselves are found again when somebody asks which were seen last.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.lens import Lenses, camera_pose
from fleet2d.kernels.mesh import Int32, Int64, Mesh
from fleet2d.kernels.motion import Poses
from fleet2d.kernels.seen import Bench, Reach, cells_in_view

NEVER = -1


class Glances(NamedTuple):
    """The poses kept, in an open hash table; a power of two long, and at most half full.

    Attributes:
        pose: int64 (slots, 4), x, y [lattice], heading, and how far the cameras are panned.
        last: int64 (slots,), last step at which it was taken, -1 for an empty slot.
        told: int64 (slots,), the last such step that `Record.last` knows of.
        cells: int32 (slots, patches), cells of each patch that it shows.
        taken: int64 (1,), how many slots are.
    """

    pose: Int64
    last: Int64
    told: Int64
    cells: Int32
    taken: Int64


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
        np.zeros((slots, 4), np.int64),
        np.full(slots, NEVER, np.int64),
        np.full(slots, NEVER, np.int64),
        np.zeros((slots, patches), np.int32),
        np.zeros(1, np.int64),
    )


@kernel
def _slot_of(pose: Int64, last: Int64, x: int, y: int, heading: int, panned: int) -> int:
    """Return the slot that holds a pose, or the empty one that it would go to."""
    mixed = np.uint64(x) * np.uint64(0x9E3779B97F4A7C15)
    mixed ^= np.uint64(y) * np.uint64(0xC2B2AE3D27D4EB4F)
    mixed ^= np.uint64(panned * 4096 + heading)
    mixed *= np.uint64(0x165667B19E3779F9)
    slots = last.shape[0]
    slot = int(mixed >> np.uint64(33)) & (slots - 1)
    while last[slot] != NEVER:
        same = pose[slot, 0] == x and pose[slot, 1] == y and pose[slot, 2] == heading
        if same and pose[slot, 3] == panned:
            return int(slot)
        slot = (slot + 1) & (slots - 1)
    return int(slot)


@kernel
def _view(watched: Watched, camera: int, pose: Int64, step: int, bench: Bench) -> int:
    """Find the cells that one camera shows from the robot's pose; return the number of spans."""
    lenses = watched.lenses
    x, y, heading = camera_pose(lenses, camera, pose[0], pose[1], pose[2], step * watched.step_us)
    reach = Reach(
        lenses.near_squared[camera], lenses.far_squared[camera], lenses.half_angle[camera]
    )
    return cells_in_view(watched.walls, x, y, heading, reach, bench)


@kernel
def settle(watched: Watched, glances: Glances, bench: Bench, seen: Int64) -> None:
    """Bring `seen`, the last step of each cell, up to date with poses that were taken again."""
    last, told, spans = glances.last, glances.told, bench.spans
    for slot in range(last.shape[0]):
        step = last[slot]
        if step == told[slot]:
            continue
        told[slot] = step
        for camera in range(watched.lenses.near_squared.shape[0]):
            count = _view(watched, camera, glances.pose[slot], step, bench)
            for i in range(count):
                row = spans[i, 0]
                for column in range(spans[i, 1], spans[i, 2] + 1):
                    seen[row, column] = max(seen[row, column], step)


@kernel
def _glance(
    watched: Watched, pose: Int64, step: int, bench: Bench, record: Record, cells: Int32
) -> None:
    """Look from a new pose: mark what was never seen before, and count the cells of each patch."""
    spans, patches = bench.spans, watched.patch_of_cell
    first, last, counted = record.first, record.last, record.counted
    keeps_last = last.shape[0] > 0
    cameras = watched.lenses.near_squared.shape[0]
    cells[:] = 0
    for camera in range(cameras):
        count = _view(watched, camera, pose, step, bench)
        for i in range(count):
            row = spans[i, 0]
            for column in range(spans[i, 1], spans[i, 2] + 1):
                if first[row, column] == NEVER:
                    first[row, column] = step
                if keeps_last:
                    last[row, column] = step
                if cameras > 1:
                    if counted[row, column] == step:
                        continue
                    counted[row, column] = step
                patch = patches[row, column]
                if patch >= 0:
                    cells[patch] += 1


@kernel
def _let_go(
    last: Int64,
    cells: Int32,
    exposure: Int64,
    by_bin: tuple[Int64, Int64],
    held: tuple[int, int, int, int],
) -> None:
    """Add what a pose shows: its slot, the step at which it was held last, for how many, the bin.

    It gets the few arrays that it needs: to hand over a tuple of many takes longer than to add.
    """
    slot, step, steps, row = held
    binned, most = by_bin
    if slot >= 0:
        last[slot] = step
        for patch in range(exposure.shape[0]):
            shown = np.int64(cells[slot, patch])
            exposure[patch] += steps * shown
            if binned.shape[0] > 0 and steps > 0:
                binned[row, patch] += steps * shown
                most[row, patch] = max(most[row, patch], shown)


@kernel
def _panned(lenses: Lenses, moment_us: int) -> int:
    """Return one number for how far all cameras are panned."""
    number = 0
    for camera in range(lenses.pan_count.shape[0]):
        if lenses.pan_count[camera] > 0:
            turn = moment_us // lenses.pan_us[camera] % lenses.pan_count[camera]
            number = number * lenses.pan_count[camera] + turn
    return number


@kernel
def watch(
    watched: Watched,
    poses: Poses,
    begin: int,
    glances: Glances,
    bench: Bench,
    record: Record,
) -> None:
    """Take in what a robot sees over consecutive steps.

    Args:
        watched: What it sees it with, and where.
        poses: The robot's poses.
        begin: The step of the first of them.
        glances: The poses kept so far; emptied when the table is half full.
        bench: Scratch space.
        record: What it has seen; `last` lags behind where a pose comes again: see :func:`settle`.
    """
    xs, ys, headings, aways = poses.x, poses.y, poses.heading, poses.away
    pose, last, cells, taken = glances.pose, glances.last, glances.cells, glances.taken
    lenses, every, bin_steps = watched.lenses, watched.every, watched.bin_steps
    exposure, binned, by_bin = record.exposure, record.binned, (record.binned, record.most)
    bins = binned.shape[0] > 0
    if bins and xs.shape[0] > 0:
        reached = (begin + xs.shape[0] - 1) // bin_steps - begin // bin_steps + 1
        binned[:reached] = 0
        record.most[:reached] = 0
    begin_bin, row = begin // bin_steps, 0
    next_bin = (begin_bin + 1) * bin_steps
    pans = lenses.pan_count.max() > 0
    panned, looked = 0, NEVER
    slot, looks = -1, 0  # the pose that is held, and for how many looks
    held_x, held_y, held_heading, held_panned = 0, 0, 0, 0
    j, count = -begin % every, xs.shape[0]
    while j < count:
        x, y, heading, away, step = xs[j], ys[j], headings[j], aways[j], begin + j
        j += every
        if pans:
            panned = _panned(lenses, step * watched.step_us)
        if bins and step >= next_bin:
            _let_go(last, cells, exposure, by_bin, (slot, looked, looks * every, row))
            row, looks = step // bin_steps - begin_bin, 0
            next_bin = (step // bin_steps + 1) * bin_steps
        same = x == held_x and y == held_y and heading == held_heading and panned == held_panned
        if not same or slot < 0 or away:
            _let_go(last, cells, exposure, by_bin, (slot, looked, looks * every, row))
            slot, looks = -1, 0
            if away:
                continue
            if 2 * taken[0] >= last.shape[0]:
                if record.last.shape[0] > 0:
                    settle(watched, glances, bench, record.last)
                last[:] = NEVER
                glances.told[:] = NEVER
                taken[0] = 0
            held_x, held_y, held_heading, held_panned = x, y, heading, panned
            slot = _slot_of(pose, last, x, y, heading, panned)
            if last[slot] == NEVER:
                pose[slot, 0], pose[slot, 1] = x, y
                pose[slot, 2], pose[slot, 3] = heading, panned
                _glance(watched, pose[slot], step, bench, record, cells[slot])
                last[slot] = step
                glances.told[slot] = step
                taken[0] += 1
        looks += 1
        # Mostly it stands: as long as it does, nothing is to be done.
        end = 0 if pans else min(count, next_bin - begin) if bins else count
        while j < end and not aways[j]:
            if xs[j] != x or ys[j] != y or headings[j] != heading:
                break
            j += every
            looks += 1
        looked = begin + j - every
    _let_go(last, cells, exposure, by_bin, (slot, looked, looks * every, row))
