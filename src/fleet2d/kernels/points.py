"""Visibility queries for sight methods written in Python: many steps at once, without repeats."""

from enum import IntEnum

from fleet2d._core import points_in_reach, points_in_sight, view_queries

__all__ = ["ViewQueryColumn", "points_in_reach", "points_in_sight", "view_queries"]


class ViewQueryColumn(IntEnum):
    """The columns of a query of `view_queries`: the pose of the camera, the centre of the body."""

    CAMERA = 0
    BODY = 1
    EYE_X = 2
    EYE_Y = 3
    EYE_HEADING = 4
    BODY_X = 5
    BODY_Y = 6
