"""A slow, obvious twin of the look kernel: cosines to sixty digits, and a look at every wall."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from decimal import Decimal, localcontext
from fractions import Fraction
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from tests.reference.headings import DIGITS, alignment, cosine, sine
from tests.reference.line_of_sight import visible
from tests.reference.motion import half_up
from tests.reference.random import random_bell, random_below, random_bits

import fleet2d.kernels as k
from fleet2d import _core
from fleet2d.kernels import I64

Point = tuple[int, int]


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


class Body(NamedTuple):
    """Where somebody is in a step."""

    x: int
    y: int
    away: bool
    heading: int = 0
    posture: int = 0


class Obstacle(NamedTuple):
    """A body that hides others: where it is in each step, its radius, and its height by posture."""

    poses: list[Body]
    radius: int
    tops: list[int]


class Piece(NamedTuple):
    """A piece of furniture: its corners [lattice units], and its height [mm]."""

    corners: list[Point]
    top: int


@dataclass
class Heights:
    """How high cameras, users and furniture are [mm].

    Attributes:
        eyes: Of each camera, by the posture of its owner.
        points: Of the points of each user, by camera and posture.
        furniture: All pieces.
    """

    eyes: list[list[int]]
    points: list[list[list[list[int]]]]
    furniture: list[Piece]

    def base(self, body):
        """Return how high a body lies, as who lies on furniture is on top of it."""
        here = shapely.Point(body.x, body.y)
        on = [p.top for p in self.furniture if shapely.Polygon(p.corners).covers(here)]
        return max(on, default=0) if body.posture == 2 else 0


class Watched(NamedTuple):
    """Who looks at whom, and what may hide them.

    Attributes:
        walls: int64 (w, 4), pieces of wall.
        robot: Where it is in each step.
        users: Where each of them is in each step.
        radius: Of the users.
        keys: The stream of each user, for the first camera; later cameras have later ones.
        step_us: Length of a step.
        method: Which points of a user a camera has in view at a step, instead of lines of sight.
        obstacles: The users by number, and others by negative ones, that hide each other.
        heights: How high all are; None if that doesn't matter.
    """

    walls: I64
    robot: list[Body]
    users: list[list[Body]]
    radius: int
    keys: list[int]
    step_us: int
    method: Callable | None
    obstacles: dict[int, Obstacle]
    heights: Heights | None


@dataclass
class Carried:
    """What a robot carries from span to span.

    Attributes:
        noticed: When each identity was noticed last; the last one is somebody unknown.
        seen: Whether each is taken to be there.
        errors: How each camera errs; None for one that doesn't.
        waiting: Sightings that the robot will get later.
    """

    noticed: list[int]
    seen: list[bool]
    errors: list
    waiting: list = field(default_factory=list)


class Ghost(NamedTuple):
    """Somebody who isn't there."""

    x: int
    y: int
    heading: int
    identity: int


def in_wedge(heading, half_angle, dx, dy):
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


def offset(forward, left, heading):
    """Return a place in the robot's frame in that of the home, by sines of 30 binary digits."""
    along, up = (round(f(2 * heading) * 2**30) for f in (cosine, sine))
    return (
        half_up(Fraction(forward * along - left * up, 2**30)),
        half_up(Fraction(forward * up + left * along, 2**30)),
    )


def pose_of(eye, robot, moment_us):
    """Return where a camera is, and where it looks."""
    dx, dy = offset(eye.forward, eye.left, robot.heading)
    turn = eye.pans[moment_us // eye.pan_us % len(eye.pans)] if eye.pans else 0
    heading = (robot.heading + eye.heading + turn) % 4096
    return Body(robot.x + dx, robot.y + dy, robot.away), heading


def body_points(eye, radius):
    """Return the points of a body that are looked at, from its centre."""
    around = [round(i * 4096 / eye.points) for i in range(eye.points)]
    return [(0, 0), *(offset(radius, 0, heading) for heading in around)]


@dataclass
class Errors:
    """How one camera errs: its part of the tables, the streams of its draws, and what it remembers.

    Tables are read by the kernels' own functions, which have tests of their own; what is drawn
    when, and what is remembered of it, is told here.
    """

    tables: k.ErrorTables
    camera: int
    start_us: int = 0

    def __post_init__(self):
        self.keys, self.ghost_keys, self.row = (
            of[self.camera].tolist()
            for of in (self.tables.keys, self.tables.ghost_keys, self.tables.table)
        )
        self.draws = {}  # step and value of the last one
        self.tracks = {}  # last step, and taken for whom

    def _share(self, user, purpose, step):
        return random_bits(self.keys[user][purpose], step) // 2**33

    def _noise(self, key, counter, noise):
        return half_up(Fraction(random_bell(key, counter) * noise, 2**16))

    def notices(self, u, now, step_us, heading, away, user, shown, chance):
        """Return whether a user who is `away` from the camera is noticed."""
        value = random_bits(self.keys[u][k.UserDraw.DETECT], now) // 2**11
        if u in self.draws and self.row[k.TablePart.STAY] != 0:
            before, last = self.draws[u]
            lasts = _core.persistence_chance(self.tables.table, self.camera, now - before)
            value = last if self._share(u, k.UserDraw.ATTEND, now) < lasts else value
        self.draws[u] = now, value
        minute = (self.start_us + now * step_us) // 60_000_000 % 1440
        steady = _core.steady_chance(
            self.tables.table, self.camera, heading, *away, user.heading, user.posture, shown
        )
        return value < _core.notice_chance(steady, self.row[k.TablePart.LIGHT + minute], chance)

    def taken_for(self, u, now, away, patience):
        """Return for whom a noticed user is taken; -1 for nobody known."""
        before, identity = self.tracks.get(u, (-math.inf, -1))
        if self.row[k.TablePart.KEEPS] == 0 or now - before >= patience:
            bin_ = _core.distance_bin(self.tables.table, self.camera, *away)
            right = self.row[k.TablePart.RIGHT + bin_]
            wrong = right + self.row[k.TablePart.MISTAKEN + bin_]
            other = self._share(u, k.UserDraw.MISTAKE, now)
            confused = _outcome(self.tables.confusion[self.camera, u], other)
            outcome = _outcome([right, wrong], self._share(u, k.UserDraw.IDENTIFY, now))
            identity = (u, confused if confused < len(self.keys) else -1, -1)[outcome]
        self.tracks[u] = now, identity
        return identity

    def perceived(self, u, now, away, user):
        """Return x and y beside where the user is, heading and posture, as perceived."""
        table, c = self.tables.table, self.camera
        dx, dy = _core.perceived_offset(table, self.tables.keys, c, u, now, *away)
        noise = self.row[k.TablePart.HEADING_NOISE]
        heading = user.heading + self._noise(self.keys[u][k.UserDraw.HEADING], now, noise)
        draw = self._share(u, k.UserDraw.POSTURE, now)
        posture = _core.perceived_posture(table, c, user.posture, draw)
        return dx - away[0], dy - away[1], heading % 4096, posture

    def ghosts(self, walls, eye, at, heading, now):
        """Yield the false positives of a look."""
        if not self.tables.has_ghosts[self.camera]:
            return
        keys = [random_bits(key, now) for key in self.ghost_keys]

        def draw(of, purpose, number):
            share = random_bits(keys[purpose], number) // 2**33
            return _outcome(of[self.camera], share)

        count = random_bits(self.ghost_keys[k.GhostDraw.COUNT], now) // 2**33
        for number in range(_outcome(self.tables.ghosts[self.camera], count)):
            source = draw(self.tables.source, k.GhostDraw.SOURCE, number)
            key = random_bits(keys[k.GhostDraw.PLACE], number)
            place = self._place(walls, eye, at, heading, source, key)
            if place is not None:
                who = draw(self.tables.looks_like, k.GhostDraw.IDENTITY, number)
                faces = random_below(keys[k.GhostDraw.HEADING], number, 4096)
                yield Ghost(*place, faces, who if who < len(self.keys) else -1)

    def _place(self, walls, eye, at, heading, source, key):
        """Return where a false positive of a source appears, if it does."""

        def sees(x, y):
            return visible(walls, np.array(at[:2]), np.array([(x, y)]))[0]

        if source > 0:
            x, y, noise = self.tables.spot[self.camera, source].tolist()
            dx, dy = x - at.x, y - at.y
            there = (x + self._noise(key, 0, noise), y + self._noise(key, 1, noise))
            in_reach = _in_range(eye, dx, dy) and in_wedge(heading, eye.half_angle, dx, dy)
            return there if in_reach and sees(*there) else None
        half = min(eye.half_angle, 4096)
        for attempt in range(1024):
            part = random_below(key, 2 * attempt, 2**20)
            reach = math.isqrt(eye.near**2 + (eye.far**2 - eye.near**2) * part // 2**20)
            turned = 2 * heading + random_below(key, 2 * attempt + 1, 2 * half) - half
            dx, dy = (
                half_up(Fraction(reach * round(f(turned) * 2**30), 2**30)) for f in (cosine, sine)
            )
            if sees(at.x + dx, at.y + dy):
                return at.x + dx, at.y + dy
        return None


def _outcome(sums, draw):
    return int(np.searchsorted(sums, draw, side="right"))


def detect(watched, eyes, first, carried, stops):
    """Look at all users in each step from the first on, and tell what becomes known.

    Returns the number of steps done, the sightings with the columns of the kernel, the events
    (step, identity, kind), and by camera and user how often they were in view and noticed. It ends
    with a step in which somebody is lost or seen, if `stops` says so.
    """
    sightings, events = [], []
    counts = [[[0, 0] for _ in watched.users] for _ in eyes]
    patience = max(eye.patience for eye in eyes)
    for j, robot in enumerate(watched.robot):
        step = first + j
        for c, eye in enumerate(eyes):
            if not robot.away and step % eye.period == 0:
                rows = _look(watched, c, eye, j, step, carried.errors[c], patience, counts[c])
                carried.waiting += [(step + eye.latency, c, *row) for row in rows]
        told = sorted((row for row in carried.waiting if row[0] == step), key=lambda row: row[1])
        carried.waiting = [row for row in carried.waiting if row[0] > step]
        sightings += told
        for row in told:
            carried.noticed[row[3]] = step  # -1 is the last one
        stop = False
        for identity, noticed in enumerate(carried.noticed):
            was_seen = carried.seen[identity]
            is_seen = noticed == step or (was_seen and step - noticed < patience)
            if is_seen != was_seen:
                carried.seen[identity] = is_seen
                events.append((step, identity, int(is_seen)))
                stop |= stops[is_seen]
        if stop:
            return j + 1, sightings, events, counts
    return len(watched.robot), sightings, events, counts


def _look(watched, c, eye, j, step, errors, patience, counts):
    """Yield what a camera perceives: user, identity, and x, y, heading and posture as seen and true."""
    robot = watched.robot[j]
    at, towards = pose_of(eye, robot, step * watched.step_us)
    for u, poses in enumerate(watched.users):
        user = poses[j]
        shown = 0 if user.away else sum(_shown_points(watched, c, eye, at, towards, u, j))
        if shown == 0:
            continue
        counts[u][0] += 1
        away, truth = (user.x - at.x, user.y - at.y), (user.x, user.y, user.heading, user.posture)
        if errors is None:
            if random_bits((watched.keys[u] + c) % 2**64, step) // 2**11 < eye.chance:
                counts[u][1] += 1
                yield u, u, *truth, *truth
        elif errors.notices(u, step, watched.step_us, towards, away, user, shown, eye.chance):
            counts[u][1] += 1
            identity = errors.taken_for(u, step, away, patience)
            dx, dy, heading, posture = errors.perceived(u, step, away, user)
            yield u, identity, user.x + dx, user.y + dy, heading, posture, *truth
    for ghost in errors.ghosts(watched.walls, eye, at, towards, step) if errors else ():
        seems = (ghost.x, ghost.y, ghost.heading, 0)
        yield -1, ghost.identity, *seems, *seems


def _shown_points(watched, c, eye, at, towards, u, j):
    """Yield of each point of a user whether it is in view, and nothing hides it."""
    robot, user, heights = watched.robot[j], watched.users[u][j], watched.heights
    from_height = to_height = 0
    for number, (dx, dy) in enumerate(body_points(eye, watched.radius)):
        point = user.x + dx, user.y + dy
        if watched.method is not None:
            in_view = watched.method(c, u, j) >> number & 1 == 1
        else:
            in_view = _in_view(watched.walls, eye, at, towards, point)
        if heights is not None:
            from_height = heights.base(robot) + heights.eyes[c][robot.posture]
            to_height = heights.base(user) + heights.points[c][u][user.posture][number]
        line = at, point, from_height, to_height
        yield in_view and not (
            (heights is not None and any(_piece_hides(piece, *line) for piece in heights.furniture))
            or any(
                _body_hides(obstacle, obstacle.poses[j], heights, *line)
                for n, obstacle in watched.obstacles.items()
                if n != u and not obstacle.poses[j].away
            )
        )


def _in_view(walls, eye, at, towards, point):
    """Return whether a point is in range, in the wedge, and behind no wall."""
    dx, dy = point[0] - at.x, point[1] - at.y
    return (
        _in_range(eye, dx, dy)
        and in_wedge(towards, eye.half_angle, dx, dy)
        and bool(visible(walls, np.array(at[:2]), np.array([point]))[0])
    )


def _in_range(eye, dx, dy):
    return eye.near**2 <= dx * dx + dy * dy <= eye.far**2


def hides(point, centre, radius):
    """Return whether the line from (0, 0) to a point passes a centre within a radius, between its ends."""
    (px, py), (bx, by) = point, centre
    if (px, py) == (0, 0):
        return False
    part = Fraction(px * bx + py * by, px * px + py * py)
    away = (bx - part * px) ** 2 + (by - part * py) ** 2
    return 0 < part < 1 and away <= radius**2


def _body_hides(obstacle, body, heights, at, point, from_height, to_height):
    """Return whether a line from a camera to a point meets a body, and is not above it there."""
    (px, py), (bx, by) = ((x - at.x, y - at.y) for x, y in (point, body[:2]))
    if not hides((px, py), (bx, by), obstacle.radius):
        return False
    part = Fraction(px * bx + py * by, px * px + py * py)
    top = 0 if heights is None else obstacle.tops[body.posture] + heights.base(body)
    return from_height + part * (to_height - from_height) <= top


def _piece_hides(piece, at, point, from_height, to_height):
    """Return whether the line meets an edge of a piece, and is not above it there."""
    px, py = point[0] - at.x, point[1] - at.y
    corners = [(x - at.x, y - at.y) for x, y in piece.corners]
    for (ax, ay), (bx, by) in pairwise([*corners, corners[0]]):
        across, parts = px * (by - ay) - py * (bx - ax), []
        if across != 0:
            if 0 <= Fraction(ax * py - ay * px, across) <= 1:
                parts = [Fraction(ax * (by - ay) - ay * (bx - ax), across)]
        elif px * ay == py * ax and (px, py) != (0, 0):  # along the line
            parts = [Fraction(px * x + py * y, px**2 + py**2) for x, y in ((ax, ay), (bx, by))]
        heights = [from_height + p * (to_height - from_height) for p in parts if 0 <= p <= 1]
        if min(heights, default=math.inf) <= piece.top:
            return True
    return False
