"""Who is in view by a method that is not compiled into the look: asked, and nothing twice."""

import math

import numpy as np
from numpy.typing import NDArray

from fleet2d.errors import ComponentError
from fleet2d.floorplan.home.home import Home
from fleet2d.kernels.lens import Lenses
from fleet2d.kernels.look import Crowd
from fleet2d.kernels.mesh import SUB
from fleet2d.kernels.motion import Poses
from fleet2d.kernels.points import BODY, BODY_X, BODY_Y, EYE_HEADING, questions
from fleet2d.kernels.seen import Reach
from fleet2d.sight.fov import FieldOfView

# A method may round points to cells: it is asked about those so far beside the field of view, too.
SLACK = 2 * SUB


def points_seen(
    method: FieldOfView,
    home: Home,
    lenses: Lenses,
    robot: Poses,
    crowd: Crowd,
    first: int,
    step_us: int,
) -> NDArray[np.uint64]:
    """Return which points of each body are in view of each camera at each step.

    Args:
        method: What tells whether a point is in view.
        home: The home.
        lenses: The cameras.
        robot: The poses of whoever has them, n of them.
        crowd: The others.
        first: The step of the first pose.
        step_us: Length of a step.

    Returns:
        uint64 (cameras, bodies, n), bit i for point i.

    Raises:
        ComponentError: The method answers with something else than a bool for each point.
    """
    widest = np.array(
        [[(math.isqrt(squared) + SLACK) ** 2 for squared in row] for row in lenses.widest.tolist()],
        np.int64,
    ).reshape(lenses.widest.shape)
    asked, number = questions(
        lenses, widest, SLACK, robot, crowd.x, crowd.y, crowd.away, first, step_us
    )
    answers = np.zeros(len(asked) + 1, np.uint64)
    moved = asked[1:, : EYE_HEADING + 1] != asked[:-1, : EYE_HEADING + 1]
    moved[:, BODY] = False
    begins = [0, *(np.flatnonzero(moved.any(axis=1)) + 1).tolist()] if len(asked) else []
    for begin, end in zip(begins, [*begins[1:], len(asked)], strict=False):
        answers[begin + 1 : end + 1] = _answers(method, home, lenses, asked[begin:end])
    return answers[number]


def _answers(
    method: FieldOfView, home: Home, lenses: Lenses, asked: NDArray[np.int64]
) -> NDArray[np.uint64]:
    """Return which points of each body are in view, for one pose of one camera."""
    camera, _, x, y, heading = asked[0, : EYE_HEADING + 1].tolist()
    reach = Reach(
        int(lenses.near_squared[camera]),
        int(lenses.far_squared[camera]),
        int(lenses.half_angle[camera]),
    )
    bodies = lenses.bodies[camera, asked[:, BODY], : int(lenses.points[camera]) + 1]
    points = (bodies + asked[:, None, [BODY_X, BODY_Y]]).reshape(-1, 2)
    found: object = method.sees(home, x, y, heading, reach, points)  # a user's own may err
    if not isinstance(found, np.ndarray) or found.dtype != bool or found.shape != (len(points),):
        raise ComponentError(
            f"{type(method).__name__} answered {found!r} for {len(points)} points: an array with a"
            " bool for each is wanted"
        )
    in_view = found.reshape(len(asked), -1)
    bits: NDArray[np.uint64] = np.uint64(1) << np.arange(in_view.shape[1], dtype=np.uint64)
    return in_view @ bits
