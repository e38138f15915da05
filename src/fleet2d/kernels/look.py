"""What one camera sees of all users over a span of steps."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.headings import QUARTER, TURN, half_sine
from fleet2d.kernels.mesh import Mesh, locate
from fleet2d.kernels.motion import Poses
from fleet2d.kernels.random import random_bits
from fleet2d.kernels.sight import walk_line_of_sight

I64 = NDArray[np.int64]

USER_LOST = 0
USER_SEEN = 1


class Lens(NamedTuple):
    """A camera's constants."""

    near_squared: int  # lattice units squared
    far_squared: int
    half_angle: int  # 1/8192 of a turn; 4096 and more is all round
    chance: int  # probability of noticing a user in view, times 2**53
    patience: int  # steps without a detection after which a user counts as lost


class Crowd(NamedTuple):
    """All users over the span: row u is user u, column j is step first + j."""

    x: I64
    y: I64
    away: NDArray[np.uint8]


class Memory(NamedTuple):
    """What a camera carries from span to span, one entry per user."""

    key: NDArray[np.uint64]  # stream of the detection draws
    noticed: I64  # last step with a detection
    seen: NDArray[np.uint8]  # 1 while the user counts as seen


class Detections(NamedTuple):
    """Detections, in order of (step, user); all arrays of one length."""

    step: I64
    user: NDArray[np.int32]
    x: I64  # perceived position, lattice units
    y: I64


class SightEvents(NamedTuple):
    """Users that come into view or are lost, in order of (step, user)."""

    step: I64
    user: NDArray[np.int32]
    kind: NDArray[np.int32]  # USER_SEEN | USER_LOST


@kernel
def in_wedge(heading: int, half_angle: int, dx: int, dy: int) -> bool:
    """Tell whether (dx, dy) lies within `half_angle` [1/8192 turn] of a heading, or on it."""
    if half_angle >= TURN:
        return True
    right, left = 2 * heading - half_angle, 2 * heading + half_angle
    from_right = half_sine(right + 2 * QUARTER) * dy - half_sine(right) * dx
    to_left = half_sine(left) * dx - half_sine(left + 2 * QUARTER) * dy
    if half_angle <= 2 * QUARTER:
        # With a wedge of half a turn, both borders are one line: the test is the half plane.
        return from_right >= 0 and to_left >= 0
    return from_right >= 0 or to_left >= 0


@kernel
def look(
    walls: Mesh,
    lens: Lens,
    robot: Poses,
    crowd: Crowd,
    first: int,
    memory: Memory,
    stops: tuple[bool, bool],
    sightings: Detections,
    events: SightEvents,
) -> tuple[int, int, int]:
    """Look at all users in each step of a span, up to the first step with an event that stops it.

    `stops` says whether (USER_LOST, USER_SEEN) stop. Returns the steps done (the stopping one
    included) and the numbers of sightings and events written.
    """
    # Taking an array out of a tuple costs a counted reference, so it is done once, not per step.
    robot_x, robot_y, robot_heading, robot_away = robot.x, robot.y, robot.heading, robot.away
    user_x, user_y, user_away = crowd.x, crowd.y, crowd.away
    key, last, seen = memory.key, memory.noticed, memory.seen
    vertices, triangles, neighbors = walls.vertices, walls.triangles, walls.neighbors
    found = happened = 0
    for j in range(robot_x.shape[0]):
        stop = False
        x, y = robot_x[j], robot_y[j]
        triangle = -1
        for u in range(user_x.shape[0]):
            noticed = False
            dx, dy = user_x[u, j] - x, user_y[u, j] - y
            squared = dx * dx + dy * dy
            in_range = lens.near_squared <= squared <= lens.far_squared
            if in_range and not (user_away[u, j] or robot_away[j]):
                if in_wedge(robot_heading[j], lens.half_angle, dx, dy):
                    if triangle < 0:
                        triangle = locate(walls, x, y)
                    if walk_line_of_sight(
                        vertices, triangles, neighbors, x, y, triangle, x + dx, y + dy
                    ):
                        draw = random_bits(key[u], first + j) >> np.uint64(11)
                        noticed = bool(np.int64(draw) < lens.chance)
            if noticed:
                last[u] = first + j
                sightings.step[found], sightings.user[found] = first + j, u
                sightings.x[found], sightings.y[found] = x + dx, y + dy
                found += 1
            is_seen = noticed or (seen[u] == 1 and first + j - last[u] < lens.patience)
            if is_seen != (seen[u] == 1):
                seen[u] = is_seen
                kind = USER_SEEN if is_seen else USER_LOST
                events.step[happened], events.user[happened] = first + j, u
                events.kind[happened] = kind
                happened += 1
                stop = stop or stops[kind]
        if stop:
            return j + 1, found, happened
    return robot_x.shape[0], found, happened
