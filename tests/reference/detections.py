"""A slow, obvious twin of the look kernel: cosines to sixty digits, and a look at every wall."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import shapely
from tests.reference.headings import DIGITS, alignment, cosine, sine
from tests.reference.line_of_sight import visible
from tests.reference.motion import half_up
from tests.reference.random import random_bell, random_below, random_bits

import fleet2d.kernels as k
from fleet2d import _core

Point = tuple[int, int]
LOST, SEEN = 0, 1
Method = Callable[[int, int, int], int]
"""Camera, user and step, from the first one on, to points in view, bit i for number i."""


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
    heading: int = 0
    posture: int = 0


class Obstacle(NamedTuple):
    """A body that hides others: where it is in each step, and its radius."""

    poses: list[Body]
    radius: int


class Piece(NamedTuple):
    """A piece of furniture: its corners [lattice units], and its height [mm]."""

    corners: list[Point]
    top: int


@dataclass
class Heights:
    """How high cameras, bodies and furniture are [mm].

    Attributes:
        eyes: Of each camera, by the posture of its owner.
        points: Of the points of each user, by camera and posture.
        tops: Of each obstacle by number, as they are given to `detect`, by posture.
        furniture: All pieces.
    """

    eyes: list[list[int]]
    points: list[list[list[list[int]]]]
    tops: dict[int, list[int]]
    furniture: list[Piece]

    def base(self, body):
        """Return how high a body lies, as who lies on furniture is on top of it."""
        here = shapely.Point(body.x, body.y)
        on = [p.top for p in self.furniture if shapely.Polygon(p.corners).covers(here)]
        return max(on, default=0) if body.posture == 2 else 0

    def line(self, camera, user, point, owner, body):
        """Return the heights of a camera and of a point of a user."""
        to = self.base(body) + self.points[camera][user][body.posture][point]
        return self.base(owner) + self.eyes[camera][owner.posture], to


def line_is_low(eye, to, part, top):
    """Return whether a line from a height to another is at a part of its way at a top or below."""
    return eye + part * (to - eye) <= top


def _furniture_hides(heights, at, point, eye, to):
    """Return whether the line meets an edge of a piece, and is not above it there."""
    px, py = point[0] - at.x, point[1] - at.y
    for piece in heights.furniture:
        corners = [(x - at.x, y - at.y) for x, y in piece.corners]
        for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
            across = px * (by - ay) - py * (bx - ax)
            ends = [(ax, ay), (bx, by)]
            parts = []
            if across != 0:
                part = Fraction(ax * (by - ay) - ay * (bx - ax), across)
                where = Fraction(ax * py - ay * px, across)
                if 0 <= where <= 1:
                    parts = [part]
            elif px * ay == py * ax and (px, py) != (0, 0):  # along the line
                parts = [Fraction(px * x + py * y, px * px + py * py) for x, y in ends]
            if any(
                0 <= p <= 1 and line_is_low(Fraction(eye), Fraction(to), p, piece.top)
                for p in parts
            ):
                return True
    return False


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
    half = Fraction(1, 2)
    return (
        math.floor(Fraction(forward * along - left * up, 2**30) + half),
        math.floor(Fraction(forward * up + left * along, 2**30) + half),
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
        users = self.tables.keys.shape[1]
        self.keys = self.tables.keys[self.camera].tolist()
        self.ghost_keys = self.tables.ghost_keys[self.camera].tolist()
        self.row = self.tables.table[self.camera].tolist()
        self.draws = [None] * users  # step and value of the last one
        self.tracks = [None] * users  # last step, and taken for whom

    def _share(self, user, purpose, step):
        return random_bits(self.keys[user][purpose], step) // 2**33

    def _noise(self, key, counter, noise):
        return half_up(Fraction(random_bell(key, counter) * noise, 2**16))

    def notices(
        self, u, now, step_us, heading, away, user,
        shown, chance,
    ):  # fmt: skip
        """Return whether a user who is `away` from the camera is noticed."""
        last, value = self.draws[u], 0
        lasts = False
        if last is not None and self.row[k.TablePart.STAY] != 0:
            share = self._share(u, k.UserDraw.ATTEND, now)
            lasts = share < _core.persistence_chance(self.tables.table, self.camera, now - last[0])
        if last is not None and lasts:
            value = last[1]
        else:
            value = random_bits(self.keys[u][k.UserDraw.DETECT], now) // 2**11
        self.draws[u] = now, value
        minute = (self.start_us + now * step_us) // 60_000_000 % 1440
        steady = _core.steady_chance(
            self.tables.table, self.camera, heading, *away, user.heading, user.posture, shown
        )
        return value < _core.notice_chance(steady, self.row[k.TablePart.LIGHT + minute], chance)

    def taken_for(self, u, now, away, patience):
        """Return for whom a noticed user is taken; -1 for nobody known."""
        before = self.tracks[u]
        if before is not None and self.row[k.TablePart.KEEPS] == 1 and now - before[0] < patience:
            identity = before[1]
        else:
            bin_ = _core.distance_bin(self.tables.table, self.camera, *away)
            right, mistaken = (
                self.row[k.TablePart.RIGHT + bin_],
                self.row[k.TablePart.MISTAKEN + bin_],
            )
            draw, identity = self._share(u, k.UserDraw.IDENTIFY, now), -1
            if draw < right:
                identity = u
            elif draw < right + mistaken:
                other = self._share(u, k.UserDraw.MISTAKE, now)
                confusion = self.tables.confusion[self.camera, u].tolist()
                identity = next((i for i, end in enumerate(confusion) if other < end), -1)
        self.tracks[u] = now, identity
        return identity

    def perceived(self, u, now, away, user):
        """Return x and y beside where the user is, heading and posture, as perceived."""
        table, c = self.tables.table, self.camera
        dx, dy = _core.perceived_offset(table, self.tables.keys, c, u, now, *away)
        turn = self._noise(
            self.keys[u][k.UserDraw.HEADING], now, self.row[k.TablePart.HEADING_NOISE]
        )
        posture = _core.perceived_posture(
            table, c, user.posture, self._share(u, k.UserDraw.POSTURE, now)
        )
        return dx - away[0], dy - away[1], (user.heading + turn) % 4096, posture

    def ghosts(self, walls, eye, at, heading, now):
        """Return the false positives of a look."""
        if not self.tables.has_ghosts[self.camera]:
            return []
        of = dict(zip(k.GhostDraw, self.ghost_keys, strict=True))
        keys = {purpose: random_bits(key, now) for purpose, key in of.items()}
        draw = random_bits(of[k.GhostDraw.COUNT], now) // 2**33
        found = []
        for number in range(_outcome(self.tables.ghosts[self.camera].tolist(), draw)):
            share = random_bits(keys[k.GhostDraw.SOURCE], number) // 2**33
            source = _outcome(self.tables.source[self.camera].tolist(), share)
            key = random_bits(keys[k.GhostDraw.PLACE], number)
            place = self._place(walls, eye, at, heading, source, key)
            if place is None:
                continue
            share = random_bits(keys[k.GhostDraw.IDENTITY], number) // 2**33
            who = _outcome(self.tables.looks_like[self.camera].tolist(), share)
            faces = random_below(keys[k.GhostDraw.HEADING], number, 4096)
            found.append(Ghost(*place, faces, who if who < len(self.keys) else -1))
        return found

    def _place(self, walls, eye, at, heading, source, key):
        """Return where a false positive of a source appears, if it does."""
        here = np.array([at.x, at.y])
        if source > 0:
            x, y, noise = self.tables.spot[self.camera, source].tolist()
            dx, dy = x - at.x, y - at.y
            if not _in_range(eye, dx, dy) or not in_wedge(heading, eye.half_angle, dx, dy):
                return None
            there = (x + self._noise(key, 0, noise), y + self._noise(key, 1, noise))
            return there if visible(walls, here, np.array([there]))[0] else None
        half = min(eye.half_angle, 4096)
        for attempt in range(1024):
            part = random_below(key, 2 * attempt, 2**20)
            reach = math.isqrt(eye.near**2 + (eye.far**2 - eye.near**2) * part // 2**20)
            turned = 2 * heading + random_below(key, 2 * attempt + 1, 2 * half) - half
            dx, dy = (
                half_up(Fraction(reach * round(f(turned) * 2**30), 2**30)) for f in (cosine, sine)
            )
            there = (at.x + dx, at.y + dy)
            if visible(walls, here, np.array([there]))[0]:
                return there
        return None


def _outcome(sums, draw):
    return next((i for i, end in enumerate(sums) if draw < end), len(sums))


class Look(NamedTuple):
    """What came of looking.

    Sightings have the columns of the kernel's; events are (step, identity, kind).
    """

    done: int
    sightings: list[tuple[int, ...]]
    events: list[tuple[int, int, int]]
    counts: list[list[list[int]]]


def detect(
    walls,
    eyes,
    robot,
    users,
    radii,
    keys,
    step_us,
    first,
    known,
    stops,
    errors=(),
    method=None,
    obstacles=None,
    heights=None,
):
    """Look at all users in each step, and tell what becomes known.

    Args:
        walls: int64 (w, 4), pieces of wall.
        eyes: The cameras.
        robot: Where it is in each step.
        users: Where each of them is in each step.
        radii: Of the users.
        keys: The streams of each camera's users, of one that doesn't err.
        step_us: Length of a step.
        first: The first step.
        known: What is carried along for each identity; updated.
        stops: Whether it ends when somebody is lost, and when somebody is seen.
        errors: How each camera errs; None for one that doesn't.
        method: Which points of a user a camera has in view at a step, instead of lines of sight.
        obstacles: The users by number, and others by negative ones, that hide each other.
        heights: How high all are; None if that doesn't matter.
    """
    sightings = []
    events = []
    waiting = []
    counts = [[[0, 0] for _ in users] for _ in eyes]
    patience = max(eye.patience for eye in eyes)
    for j, body in enumerate(robot):
        step, stop = first + j, False
        for c, eye in enumerate(eyes):
            if body.away or step % eye.period != 0:
                continue
            at, towards = pose_of(eye, body, step * step_us)
            errs = errors[c] if errors else None
            for u, user in enumerate(users):
                if user[j].away:
                    continue
                points, identity = body_points(eye, radii[u]), u
                in_view = {i for i in range(len(points)) if method and method(c, u, j) >> i & 1}
                if method is None:
                    in_view = _points_in_view(walls, eye, at, towards, user[j], points)
                between = {n: body for n, body in (obstacles or {}).items() if n != u}
                lines = _lines(heights, c, u, in_view, body, user[j])
                shown = _count_shown(at, user[j], points, lines, between, j, heights)
                if shown == 0:
                    continue
                counts[c][u][0] += 1
                away = user[j].x - at.x, user[j].y - at.y
                seems = truth = (user[j].x, user[j].y, user[j].heading, user[j].posture)
                if errs is None:
                    noticed = random_bits(keys[c][u], step) // 2**11 < eye.chance
                else:
                    noticed = errs.notices(
                        u, step, step_us, towards, away, user[j], shown, eye.chance
                    )
                if noticed and errs is not None:
                    identity = errs.taken_for(u, step, away, patience)
                    dx, dy, heading, posture = errs.perceived(u, step, away, user[j])
                    seems = (user[j].x + dx, user[j].y + dy, heading, posture)
                if noticed:
                    counts[c][u][1] += 1
                    waiting.append((step + eye.latency, c, u, identity, *seems, *truth))
            for ghost in errs.ghosts(walls, eye, at, towards, step) if errs else ():
                seems = (ghost.x, ghost.y, ghost.heading, 0)
                waiting.append((step + eye.latency, c, -1, ghost.identity, *seems, *seems))
        told = sorted((row for row in waiting if row[0] == step), key=lambda row: row[1])
        waiting = [row for row in waiting if row[0] > step]
        sightings += told
        for row in told:
            known[row[3]].noticed = step  # -1, somebody unknown, is the last one
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


def _lines(heights, c, u, in_view, owner, user):
    """Return the heights of both ends of the lines to the points of a user in view."""
    if heights is None:
        return dict.fromkeys(in_view, (0, 0))
    return {i: heights.line(c, u, i, owner, user) for i in in_view}


def _count_shown(
    at,
    user,
    points,
    lines,
    between,
    j,
    heights,
):
    """Return how many points of a user no body that is at home hides from a camera, and no piece.

    `lines` has the heights of both ends of the line to each point in view.
    """
    bodies = {n: body for n, body in between.items() if not body.poses[j].away}

    def is_hidden(number, eye, to):
        x, y = user.x + points[number][0], user.y + points[number][1]
        if heights is not None and _furniture_hides(heights, at, (x, y), eye, to):
            return True
        px, py = x - at.x, y - at.y
        for n, obstacle in bodies.items():
            body = obstacle.poses[j]
            bx, by = body.x - at.x, body.y - at.y
            if not hides((px, py), (bx, by), obstacle.radius):
                continue
            if heights is None:
                return True
            part = Fraction(px * bx + py * by, px * px + py * py)
            top = heights.tops[n][body.posture] + heights.base(body)
            if line_is_low(Fraction(eye), Fraction(to), part, top):
                return True
        return False

    return sum(not is_hidden(number, *line) for number, line in lines.items())


def _points_in_view(walls, eye, at, heading, user, points):
    """Return which points of a body are in range, in the wedge, and behind no wall."""
    in_view = set()
    for number, (px, py) in enumerate(points):
        dx, dy = user.x + px - at.x, user.y + py - at.y
        if (
            _in_range(eye, dx, dy)
            and in_wedge(heading, eye.half_angle, dx, dy)
            and visible(walls, np.array([at.x, at.y]), np.array([[at.x + dx, at.y + dy]]))[0]
        ):
            in_view.add(number)
    return in_view
