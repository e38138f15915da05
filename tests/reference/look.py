"""A slow, obvious twin of the look kernel: cosines to sixty digits, and a look at every wall."""

from dataclasses import dataclass
from decimal import Decimal, localcontext
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from tests.reference.headings import DIGITS, alignment, cosine
from tests.reference.random import random_bits
from tests.reference.sight import visible

Int64 = npt.NDArray[np.int64]
LOST, SEEN = 0, 1


class Eye(NamedTuple):
    """A camera: ranges [lattice], half angle [1/8192 turn], chance * 2**53, patience [steps]."""

    near: int
    far: int
    half_angle: int
    chance: int
    patience: int


@dataclass
class Known:
    """What the camera carries along for one user."""

    key: int
    noticed: int
    seen: bool


class Body(NamedTuple):
    """Where somebody is in a step."""

    x: int
    y: int
    away: bool


def in_wedge(heading: int, half_angle: int, dx: int, dy: int) -> bool:
    """Return whether the angle between (dx, dy) and the heading is at most `half_angle`.

    The angle is at most half a turn, so its cosine decides. A border runs right through a lattice
    point only at multiples of an eighth of a turn. Elsewhere the kernel's borders are rounded, and
    a point so near to one that this could matter is refused.
    """
    if half_angle >= 4096 or (dx, dy) == (0, 0):
        return True
    with localcontext(prec=DIGITS):
        length = Decimal(dx * dx + dy * dy).sqrt()
        margin = alignment(2 * heading, dx, dy) / length - cosine(half_angle)
    if abs(margin) < Decimal(10) ** -40:
        assert (2 * heading - half_angle) % 1024 == 0 or (2 * heading + half_angle) % 1024 == 0
        return True
    assert abs(margin) > Decimal(10) ** -12, "choose another point"
    return margin > 0


def look(
    walls: Int64,
    eye: Eye,
    robot: list[tuple[Body, int]],
    users: list[list[Body]],
    first: int,
    known: list[Known],
    stops: tuple[bool, bool],
) -> tuple[int, list[tuple[int, int, int, int]], list[tuple[int, int, int]]]:
    """Return the steps done, the sightings (step, user, x, y) and the events (step, user, kind).

    `robot` is its body and heading in each step, `users` a list of bodies for each user.
    """
    sightings, events = [], []
    for j, (body, heading) in enumerate(robot):
        step, stop = first + j, False
        for u, user in enumerate(users):
            memory, there = known[u], user[j]
            if _notices(walls, eye, body, heading, there, memory.key, step):
                memory.noticed = step
                sightings.append((step, u, there.x, there.y))
                seen = True
            else:
                seen = memory.seen and step - memory.noticed < eye.patience
            if seen != memory.seen:
                memory.seen = seen
                kind = SEEN if seen else LOST
                events.append((step, u, kind))
                stop |= stops[kind]
        if stop:
            return j + 1, sightings, events
    return len(robot), sightings, events


def _notices(
    walls: Int64, eye: Eye, robot: Body, heading: int, user: Body, key: int, step: int
) -> bool:
    dx, dy = user.x - robot.x, user.y - robot.y
    in_view = (
        not (robot.away or user.away)
        and eye.near**2 <= dx * dx + dy * dy <= eye.far**2
        and in_wedge(heading, eye.half_angle, dx, dy)
        and visible(walls, np.array([robot.x, robot.y]), np.array([[user.x, user.y]]))[0]
    )
    return bool(in_view and random_bits(key, step) // 2**11 < eye.chance)
