"""Many points looked at from one place: which are in sight, and which in range and angle.

And for methods that are not compiled: what there is to ask over many steps, nothing twice in a row.
"""

from fleet2d._core import points_in_reach, points_in_sight, questions

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
    "questions",
]

# The columns of a question: whose camera and body, where the camera is, and the body's centre.
CAMERA, BODY, EYE_X, EYE_Y, EYE_HEADING, BODY_X, BODY_Y = range(7)
