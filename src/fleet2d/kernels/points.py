"""Visibility queries for sight methods written in Python: many steps at once, without repeats."""

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
