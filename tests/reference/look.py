"""A slow, obvious twin of the look kernel: cosines to sixty digits, and a look at every wall."""

import math
from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from tests.reference.headings import DIGITS, alignment, cosine, sine
from tests.reference.random import random_bits
from tests.reference.sight import visible

Int64 = npt.NDArray[np.int64]
LOST, SEEN = 0, 1


class Eye(NamedTuple):
    """A camera: lattice units, 1/8192 turn (half angle), 1/4096 turn (headings), steps."""

    near: int
    far: int
    half_angle: int
    chance: int  # times 2**53
    patience: int
    forward: int = 0
    left: int = 0
    heading: int = 0
    pans: tuple[int, ...] = ()
    pan_us: int = 1
    period: int = 1
    latency: int = 0
    points: int = 0


@dataclass
class Known:
    """What the robot carries along for one identity."""

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


def offset(forward: int, left: int, heading: int) -> tuple[int, int]:
    """Return a place in the robot's frame in that of the home, by sines of 30 binary digits."""
    along, up = (round(f(2 * heading) * 2**30) for f in (cosine, sine))
    half = Fraction(1, 2)
    return (
        math.floor(Fraction(forward * along - left * up, 2**30) + half),
        math.floor(Fraction(forward * up + left * along, 2**30) + half),
    )


def pose_of(eye: Eye, robot: Body, heading: int, moment_us: int) -> tuple[Body, int]:
    """Return where a camera is, and where it looks."""
    dx, dy = offset(eye.forward, eye.left, heading)
    turn = eye.pans[moment_us // eye.pan_us % len(eye.pans)] if eye.pans else 0
    return Body(robot.x + dx, robot.y + dy, robot.away), (heading + eye.heading + turn) % 4096


def body_points(eye: Eye, radius: int) -> list[tuple[int, int]]:
    """Return the points of a body that are looked at, from its centre."""
    around = [round(i * 4096 / eye.points) for i in range(eye.points)]
    return [(0, 0), *(offset(radius, 0, heading) for heading in around)]


class Look(NamedTuple):
    """What came of looking: (known at, camera, user, x, y), (step, identity, kind), looks."""

    done: int
    sightings: list[tuple[int, ...]]
    events: list[tuple[int, int, int]]
    counts: list[list[list[int]]]


def look(
    walls: Int64,
    eyes: list[Eye],
    robot: list[tuple[Body, int]],
    users: list[list[Body]],
    radii: list[int],
    keys: list[list[int]],
    step_us: int,
    first: int,
    known: list[Known],
    stops: tuple[bool, bool],
) -> Look:
    """Look at all users in each step, and tell what becomes known.

    `robot` is its body and heading in each step, `users` a list of bodies for each user, `keys`
    the streams of each camera's users.
    """
    sightings: list[tuple[int, ...]] = []
    events: list[tuple[int, int, int]] = []
    waiting: list[tuple[int, ...]] = []
    counts = [[[0, 0] for _ in users] for _ in eyes]
    patience = max(eye.patience for eye in eyes)
    for j, (body, heading) in enumerate(robot):
        step, stop = first + j, False
        for c, eye in enumerate(eyes):
            if body.away or step % eye.period != 0:
                continue
            at, towards = pose_of(eye, body, heading, step * step_us)
            for u, user in enumerate(users):
                if user[j].away or not _in_view(walls, eye, at, towards, user[j], radii[u]):
                    continue
                counts[c][u][0] += 1
                if random_bits(keys[c][u], step) // 2**11 < eye.chance:
                    counts[c][u][1] += 1
                    waiting.append((step + eye.latency, c, u, user[j].x, user[j].y))
        told = sorted((row for row in waiting if row[0] == step), key=lambda row: row[1])
        waiting = [row for row in waiting if row[0] > step]
        sightings += told
        for row in told:
            known[row[2]].noticed = step
        for identity, memory in enumerate(known):
            lately = memory.seen and step - memory.noticed < patience
            seen = memory.noticed == step or lately
            if seen != memory.seen:
                memory.seen = seen
                kind = SEEN if seen else LOST
                events.append((step, identity, kind))
                stop |= stops[kind]
        if stop:
            return Look(j + 1, sightings, events, counts)
    return Look(len(robot), sightings, events, counts)


def _in_view(walls: Int64, eye: Eye, at: Body, heading: int, user: Body, radius: int) -> bool:
    """Return whether a point of a user's body is in range, in the wedge, and behind no wall."""
    for px, py in body_points(eye, radius):
        dx, dy = user.x + px - at.x, user.y + py - at.y
        if (
            eye.near**2 <= dx * dx + dy * dy <= eye.far**2
            and in_wedge(heading, eye.half_angle, dx, dy)
            and visible(walls, np.array([at.x, at.y]), np.array([[at.x + dx, at.y + dy]]))[0]
        ):
            return True
    return False
