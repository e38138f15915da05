"""Many points seen from one place: which are in sight, and which are in range and angle.

For methods of sight that are not compiled: the queries of many steps, without consecutive
duplicates.
"""

from fleet2d._core import points_in_reach, points_in_sight, view_queries

__all__ = [
    "BODY",
    "BODY_X",
    "BODY_Y",
    "CAMERA",
    "EYE_HEADING",
    "EYE_X",
    "EYE_Y",
    "points_in_reach",
    "points_in_sight",
    "view_queries",
]

# The columns of a query: camera, body, the pose of the camera, and the centre of the body.
CAMERA, BODY, EYE_X, EYE_Y, EYE_HEADING, BODY_X, BODY_Y = range(7)
