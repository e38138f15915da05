"""Speeds of robots between two poses, as in odometry."""

from typing import TYPE_CHECKING

import numpy as np

from fleet2d.floorplan.placed_objects import PORTAL_REACH_M
from fleet2d.kernels import F64

if TYPE_CHECKING:
    from fleet2d.floorplan.plan import FloorPlan


def twists(plan: "FloorPlan", before: F64, after: F64, passed_s: float) -> F64:
    """Return mean speeds from pose to pose: ahead, to the left [m/s] and round [rad/s].

    Stairs and lifts have no length, as for `sum_moves`: their ends lie far apart in the plan.

    Args:
        plan: The floor plan.
        before: x, y [m] and heading [rad] before each move, float64 (n, 3).
        after: x, y [m] and heading [rad] after each move, float64 (n, 3).
        passed_s: The time that each move takes.

    Returns:
        float64 (n, 3).
    """
    x, y = (after[:, :2] - before[:, :2]).T
    covered = np.hypot(x, y)
    length = covered.copy()
    ends = plan.lattice.to_metres(plan.portal_ends[:, :4].reshape(-1, 2, 2))
    for one, other in [*ends, *ends[:, ::-1]]:
        enters = _off(before, one)
        leaves = _off(after, other)
        passes = (enters < _off(before, other)) & (leaves < _off(after, one))
        to_portal = np.maximum(enters - PORTAL_REACH_M, 0.0)
        from_portal = np.maximum(leaves - PORTAL_REACH_M, 0.0)
        shorter = np.minimum(length, to_portal + from_portal)
        length = np.where(passes, shorter, length)
    share = np.divide(length, covered, out=np.ones(len(after)), where=covered > 0)
    x = x * share
    y = y * share
    heading = after[:, 2]
    cos = np.cos(heading)
    sin = np.sin(heading)
    ahead = x * cos + y * sin
    left = y * cos - x * sin
    turned = (heading - before[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return np.stack([ahead, left, turned], axis=-1) / passed_s


def _off(poses: F64, place: F64) -> F64:
    return np.hypot(*(poses[:, :2] - place).T)
