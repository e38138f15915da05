"""Poses and places measured: in which room, how long in each, and how far."""

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.mesh import SUB
from fleet2d.kernels.motion import Poses


@kernel
def rooms_at(
    room_of_place: NDArray[np.int16], x: NDArray[np.int64], y: NDArray[np.int64]
) -> NDArray[np.int16]:
    """Return the room of each place, int16 (n,); outside of the map that at its nearest border."""
    rows, columns = room_of_place.shape
    found = np.empty(x.shape[0], np.int16)
    for j in range(x.shape[0]):
        row, column = y[j] // SUB, x[j] // SUB
        found[j] = room_of_place[min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)]
    return found


@kernel
def count_rooms(poses: Poses, room_of_place: NDArray[np.int16], counts: NDArray[np.int64]) -> None:
    """Add the number of poses in each room to counts (rooms + 1,); the last entry is away."""
    x, y, away = poses.x, poses.y, poses.away
    last = counts.shape[0] - 1
    for j in range(x.shape[0]):
        counts[last if away[j] else room_of_place[y[j] // SUB, x[j] // SUB]] += 1


@kernel
def sum_moves(poses: Poses) -> float:
    """Return the summed length of the moves from pose to pose [lattice units]."""
    x, y = poses.x, poses.y
    total = 0.0
    for j in range(1, x.shape[0]):
        dx, dy = x[j] - x[j - 1], y[j] - y[j - 1]
        if dx != 0 or dy != 0:
            total += np.sqrt(np.float64(dx * dx + dy * dy))
    return total
