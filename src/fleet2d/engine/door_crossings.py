"""The routes of bodies through doors."""

import numpy as np
from shapely import LineString

from fleet2d.entities.behavior import Actor
from fleet2d.entities.body import Track
from fleet2d.floorplan.geometry.gates import Segment
from fleet2d.kernels.motion import Breakpoints


def crossings(track: Breakpoints, line: Segment) -> list[int]:
    """Return the times [us] at which a track crosses a segment.

    A leg that only touches the line counts once; one along the line doesn't.

    Args:
        track: The motion [lattice units].
        line: The segment from jamb to jamb [lattice units].
    """
    (ax, ay), (bx, by) = line
    x, y = track.x, track.y
    side = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    legs = np.flatnonzero((side[:-1] > 0) != (side[1:] > 0))
    times: list[int] = []
    for i in legs.tolist():
        px, py, qx, qy = int(x[i]), int(y[i]), int(x[i + 1]), int(y[i + 1])
        a = (qx - px) * (ay - py) - (qy - py) * (ax - px)
        b = (qx - px) * (by - py) - (qy - py) * (bx - px)
        if (a > 0) != (b > 0) or 0 in (a, b):
            near, far = abs(int(side[i])), abs(int(side[i + 1]))
            begin, end = int(track.time[i]), int(track.time[i + 1])
            times.append(begin + (end - begin) * near // max(near + far, 1))
    return times


def way_ahead(actor: Actor, now_us: int) -> LineString | None:
    """Return the rest of a body's route [lattice units]; None if it stays where it is."""
    assert isinstance(actor.motion, Track)
    track = actor.motion.breakpoints
    ahead = track.time > now_us
    points = np.stack(
        [np.append(actor.state.x, track.x[ahead]), np.append(actor.state.y, track.y[ahead])], axis=1
    )
    return LineString(points) if (points != points[0]).any() else None
