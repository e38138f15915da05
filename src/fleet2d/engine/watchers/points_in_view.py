"""Points in view by a method of sight that is written in Python, each computed only once."""

import math

import numpy as np

from fleet2d.errors import ComponentError
from fleet2d.floorplan.home.home import Home
from fleet2d.kernels import I64, U64
from fleet2d.kernels.motion import Poses
from fleet2d.kernels.sight import Lenses, Reach, UserPoses, view_queries
from fleet2d.kernels.sight import ViewQueryColumn as Column
from fleet2d.kernels.space import SUB
from fleet2d.sight.fov import FieldOfView

# Methods may round points to cells, so points this far outside the field of view are checked, too.
SLACK = 2 * SUB


def points_seen(
    method: FieldOfView,
    home: Home,
    lenses: Lenses,
    robot: Poses,
    crowd: UserPoses,
    first: int,
    step_us: int,
) -> U64:
    """Return which points of each body are in view of each camera at each step.

    Args:
        method: The method of sight.
        home: The home.
        lenses: The cameras.
        robot: The n poses of the owner of the cameras.
        crowd: The other bodies.
        first: The step of the first pose.
        step_us: Length of a step [us].

    Returns:
        uint64 (cameras, bodies, n), bit i for point i.

    Raises:
        ComponentError: The method doesn't return a bool for each point.
    """
    widest = np.array(
        [[(math.isqrt(squared) + SLACK) ** 2 for squared in row] for row in lenses.widest.tolist()],
        np.int64,
    ).reshape(lenses.widest.shape)
    queries, number = view_queries(
        lenses, widest, SLACK, robot, crowd.x, crowd.y, crowd.away, first, step_us
    )
    answers = np.zeros(len(queries) + 1, np.uint64)
    has_moved = queries[1:, : Column.EYE_HEADING + 1] != queries[:-1, : Column.EYE_HEADING + 1]
    has_moved[:, Column.BODY] = False
    begins = [0, *(np.flatnonzero(has_moved.any(axis=1)) + 1).tolist()] if len(queries) else []
    for begin, end in zip(begins, [*begins[1:], len(queries)], strict=False):
        answers[begin + 1 : end + 1] = _answers(method, home, lenses, queries[begin:end])
    return answers[number]


def _answers(method: FieldOfView, home: Home, lenses: Lenses, queries: I64) -> U64:
    """Return which points of each body are in view, for one pose of one camera."""
    camera, _, x, y, heading = queries[0, : Column.EYE_HEADING + 1].tolist()
    reach = Reach(
        int(lenses.near_squared[camera]),
        int(lenses.far_squared[camera]),
        int(lenses.half_angle[camera]),
    )
    bodies = lenses.bodies[camera, queries[:, Column.BODY], : int(lenses.points[camera]) + 1]
    points = (bodies + queries[:, None, [Column.BODY_X, Column.BODY_Y]]).reshape(-1, 2)
    flags: object = method.sees(home, x, y, heading, reach, points)  # a user's own may be wrong
    if not isinstance(flags, np.ndarray) or flags.dtype != bool or flags.shape != (len(points),):
        raise ComponentError(
            f"{type(method).__name__} returned {flags!r}, expected a bool array of shape"
            f" ({len(points)},), a value for each point"
        )
    in_view = flags.reshape(len(queries), -1)
    bits: U64 = np.uint64(1) << np.arange(in_view.shape[1], dtype=np.uint64)
    return in_view @ bits
