"""What one camera sees of all users over a span of steps."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.headings import QUARTER, TURN, half_sine
from fleet2d.kernels.mesh import Mesh, locate
from fleet2d.kernels.motion import Poses
from fleet2d.kernels.random import random_bits
from fleet2d.kernels.sight import line_of_sight

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


class Sightings(NamedTuple):
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
    """Tell whether (dx, dy) lies within `half_angle` [1/8192 turn] of a heading, border included."""
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
    sightings: Sightings,
    events: SightEvents,
) -> tuple[int, int, int]:
    """Look at all users in each step of a span, up to the first step with an event that stops it.

    `stops` says whether (USER_LOST, USER_SEEN) stop. Returns the steps done (the stopping one
    included) and the numbers of sightings and events written.
    """
    users = crowd.x.shape[0]
    found = happened = 0
    for j in range(robot.x.shape[0]):
        stop = False
        x, y, heading = robot.x[j], robot.y[j], robot.heading[j]
        triangle = -1
        for u in range(users):
            noticed = False
            dx, dy = crowd.x[u, j] - x, crowd.y[u, j] - y
            squared = dx * dx + dy * dy
            if lens.near_squared <= squared <= lens.far_squared and not (crowd.away[u, j] or robot.away[j]):
                if in_wedge(heading, lens.half_angle, dx, dy):
                    if triangle < 0:
                        triangle = locate(walls, x, y)
                    if line_of_sight(walls, x, y, triangle, crowd.x[u, j], crowd.y[u, j]):
                        draw = random_bits(memory.key[u], first + j) >> np.uint64(11)
                        noticed = np.int64(draw) < lens.chance
            if noticed:
                memory.noticed[u] = first + j
                sightings.step[found], sightings.user[found] = first + j, u
                sightings.x[found], sightings.y[found] = crowd.x[u, j], crowd.y[u, j]
                found += 1
            is_seen = noticed or (memory.seen[u] == 1 and first + j - memory.noticed[u] < lens.patience)
            if is_seen != (memory.seen[u] == 1):
                memory.seen[u] = is_seen
                kind = USER_SEEN if is_seen else USER_LOST
                events.step[happened], events.user[happened], events.kind[happened] = first + j, u, kind
                happened += 1
                stop = stop or stops[kind]
        if stop:
            return j + 1, found, happened
    return robot.x.shape[0], found, happened
